"""Order of convergence of what turns an attitude: halve the interval, the error falls by 2^p.

The box cones, ``C_nb = Rz(a t) Rx(b) Rz(c t)``: attitude and the integrals of rate and force are
known in closed form. Samples are means over their interval, as a gyroscope that integrates gives
them; what is left out, the coning within an interval, is of second order in the end.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import attitude
from strapdown.kernels import trace
from strapdown.recording import Imu, Recording

A, B, C = 2.0, 0.7, 1.5
SPAN = 2.0
INTERVALS = (0.04, 0.02, 0.01)
FORCE_N = np.array([3.0, -2.0, 5.0])


def r_nb(t):
    return Rotation.from_euler("ZXZ", np.transpose([A * t, B + 0 * t, C * t]))


def times(dt):
    return dt * np.arange(round(SPAN / dt) + 1)


def mean_rates(t):
    """Of ``(a sin b sin ct, a sin b cos ct, a cos b + c)``; the first sample has no interval."""
    s = A * np.sin(B) / C
    integral = np.transpose([-s * np.cos(C * t), s * np.sin(C * t), (A * np.cos(B) + C) * t])
    rates = np.diff(integral, axis=0) / np.diff(t)[:, None]
    return np.vstack((rates[:1], rates))


def ratios(errors):
    return np.divide(errors[:-1], errors[1:])


SURE = {"gyr_noise": 1e-6}
QUEST = {**SURE, "rate_std": 1e3}
TURNING = {
    "gyro": (attitude.GyroIntegration(), 2),
    "madgwick": (attitude.Madgwick(), 2),
    "mahony": (attitude.Mahony(), 2),
    "mekf": (attitude.Mekf(), 2),
    "indirect-ekf": (attitude.IndirectEkf(), 2),
    "two-stage": (attitude.TwoStage(), 2),
    "two-stage, printed": (attitude.TwoStage(integration="printed"), 2),
    "quest-ekf": (attitude.QuestEkf(**QUEST), 2),
    "quest-ekf, printed": (attitude.QuestEkf(**QUEST, integration="printed"), 1),
    "robust-eskf": (attitude.RobustEskf(), 2),
}


@pytest.mark.parametrize("name", TURNING)
def test_attitude_by_the_gyroscope_alone_has_its_order(name):
    """The printed two-stage filter's Euler step is short by a^3 / 12 a turn: of second order, too.

    The printed filter of rates takes the rate of the interval before: of first order.
    """
    flt, order = TURNING[name]
    errors = []
    for dt in INTERVALS:
        t = times(dt)
        rec = Recording(imu=Imu(t=t, gyr=mean_rates(t), acc=np.full((len(t), 3), np.nan)))
        start = r_nb(t)[0].as_quat()[[3, 0, 1, 2]]
        sol, _ = flt.advance(flt.init(attitude=start), rec, diagnostics=False)
        found = Rotation.from_quat(sol.q_nb[-1, [1, 2, 3, 0]])
        errors.append((found * r_nb(t)[-1].inv()).magnitude())
    print(f"{name}: {np.array(errors)}, ratios {ratios(errors).round(2)}")
    np.testing.assert_allclose(ratios(errors), 2.0**order, rtol=0.1)


def test_turn_and_velocity_of_the_trace_are_of_second_order():
    """The mean force of an interval acts at the attitude of its middle."""
    turned, gained = [], []
    for dt in INTERVALS:
        t = times(dt)
        fine = np.linspace(0.0, 1.0, 41)  # Simpson over each interval: 1e-12 of the mean
        weights = np.r_[1.0, np.tile([4.0, 2.0], 20)[:-1], 1.0] / 120.0
        at = (t[:-1, None] + dt * fine).ravel()
        force = r_nb(at).inv().apply(FORCE_N).reshape(len(t) - 1, -1, 3)
        acc = np.einsum("j,kji->ki", weights, force)
        out = np.empty((len(t), 7))
        trace.run(t, mean_rates(t), np.vstack((acc[:1], acc)), out)
        found = Rotation.from_quat(out[-1, [1, 2, 3, 0]])
        turned.append((r_nb(t)[0] * found * r_nb(t)[-1].inv()).magnitude())
        gained.append(np.linalg.norm(r_nb(t)[0].apply(out[-1, 4:]) - SPAN * FORCE_N))
    np.testing.assert_allclose(ratios(turned), 4.0, rtol=0.1)
    np.testing.assert_allclose(ratios(gained), 4.0, rtol=0.1)
