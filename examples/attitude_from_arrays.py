"""
From three arrays to an attitude
================================

A recording is what sensors said, an estimator is its parameters, a solution is what it
believes. Here the arrays come from a simulated box in a moving hand, so the truth is known.

The multiplicative Kalman filter finds most of the gyro bias within the minute, and its
inclination stays below one degree. Integrating the gyro alone drifts with that bias by some
degrees; it would be more, if the box did not turn over and over and so average it.
"""

import strapdown as sd
from strapdown.units import DPS

simulated = sd.simulation.demo.recording(seed=7)
t, gyr, acc = simulated.imu.t, simulated.imu.gyr, simulated.imu.acc  # s, rad/s, m/s^2
mag = simulated.mag.mag  # T

rec = sd.from_arrays(t, gyr, acc, mag, name="my box")

for flt in (sd.attitude.GyroIntegration(), sd.attitude.Madgwick(), sd.attitude.Mekf()):
    sol = flt.run(rec)
    errors = sd.evaluation.attitude_errors(sol, simulated.reference, remove_heading=True)
    figures = errors.summary()
    print(
        f"{sol.filter:16s} inclination {figures['inclination_rmse_deg']:6.2f} deg, "
        f"heading {figures['heading_rmse_deg']:6.2f} deg"
    )

bias = sol.gyr_bias[-1] / DPS
print("gyro bias found [deg/s]:", bias.round(2), "true: [0.4, -0.3, 0.2]")
