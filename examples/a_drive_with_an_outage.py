"""
A drive through a tunnel
========================

A car drives three minutes with a cheap IMU, mounted askew, and a cheap receiver. For half a minute
the fixes are taken away. The loosely coupled filter is told neither the mount nor the start
attitude. It comes out of the outage some metres off; dead reckoning without any fix, kilometres.
The smoother also looks at what comes after, and is better yet in the middle.
"""

import numpy as np

import strapdown as sd
from strapdown.units import DEG

drive = sd.simulation.load("drive").record(seed=11)
tunnel = (110.0, 140.0)
dark = sd.evaluation.blank(drive, [tunnel])  # the estimators see this one
print(f"{len(drive.imu)} IMU samples, {len(dark.gnss)} of {len(drive.gnss)} fixes left")

coupled = sd.navigation.LooselyCoupled()
runs = {
    "dead reckoning": sd.navigation.DeadReckoning(height="held").run(dark),
    "loosely coupled": coupled.run(dark),
    "smoothed": coupled.smooth(dark),
}
for name, sol in runs.items():
    errors = sd.evaluation.navigation_errors(sol, drive.reference)
    (window,) = sd.evaluation.outage_errors(sol, drive, [tunnel])
    where = "at its end" if sol.causal else "in its middle"
    print(
        f"{name:16s}{errors.summary()['horizontal_rmse_m']:8.2f} m RMSE, in the outage "
        f"{window.horizontal_error_m:8.2f} m {where}"
    )

sol = runs["loosely coupled"]
aligned = sol.t[np.argmax((sol.status & sd.Status.ALIGNING) == 0)]
roll, pitch, yaw = sd.rotation.rpy_from_quat(sol.q_vb[-1]) / DEG
print(f"aligned after {aligned - sol.t[0]:.1f} s")
print(f"mount found: {roll:.1f}, {pitch:.1f}, {yaw:.1f} deg")
roll, pitch, yaw = sd.rotation.rpy_from_quat(drive.reference.mount.q_vb[-1]) / DEG
print(f"mount as simulated: {roll:.1f}, {pitch:.1f}, {yaw:.1f} deg")
