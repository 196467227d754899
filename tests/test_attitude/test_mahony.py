"""The Mahony filter as a whole, on a hand's motion with a biased gyro."""

import numpy as np
from scipy.spatial.transform import Rotation
from truth import hand

from strapdown.attitude import Madgwick, Mahony
from strapdown.recording import Imu, Mag, Recording

BIAS = np.array([0.01, -0.02, 0.015])


def biased(seconds=60.0, rate=100.0):
    t = np.arange(round(seconds * rate)) / rate
    r_nb, gyr, acc, mag = hand.sensors(t, rest=5.0)
    rec = Recording(imu=Imu(t=t, gyr=gyr + BIAS, acc=acc), mag=Mag(t=t, mag=mag))
    return rec, r_nb


def test_bias_is_found_in_motion_and_helps():
    rec, r_nb = biased()
    plain, full = Mahony(kp=0.5, ki=0.0).run(rec), Mahony(kp=0.5, ki=0.03).run(rec)
    late = rec.imu.t > 40.0
    # the hand's accelerations of 0.1 g shake the integral by ki times 0.1 times a second
    np.testing.assert_allclose(full.gyr_bias[-1], BIAS, atol=5e-3)
    off = [np.sqrt(np.mean(hand.degrees_off(s.q_nb, r_nb)[late] ** 2)) for s in (plain, full)]
    assert off[1] < 0.6 * off[0]


def test_larger_gain_of_either_filter_follows_the_vectors_more_quickly():
    """A start 20 deg off at rest: the time to fall below 5 deg shrinks with the gain."""
    rec, r_nb = biased(5.0)
    start = r_nb[0] * Rotation.from_rotvec([0.2, -0.28, 0.0])
    q0 = start.as_quat()[[3, 0, 1, 2]]

    def seconds(flt):
        sol, _ = flt.advance(flt.init(attitude=q0), rec)
        return rec.imu.t[np.argmax(hand.degrees_off(sol.q_nb, r_nb) < 5.0)]

    assert 0.0 < seconds(Mahony(kp=4.0)) < 0.6 * seconds(Mahony(kp=2.0))
    assert 0.0 < seconds(Madgwick(beta=0.4)) < 0.6 * seconds(Madgwick(beta=0.2))
