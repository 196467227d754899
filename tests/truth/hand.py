"""A box in a moving hand, by SciPy alone: what ideal sensors say at any sampling times.

Attitude is three turns about NED axes, north first; position is a sum of sines. The gyro gives
the mean rate of the interval that ends at its sample, as a rotation vector over its length; the
accelerometer and the magnetometer what is there at the sample.
"""

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.80665
FIELD_N = np.array([21e-6, 0.0, 43e-6])  # magnetic north, dip 64 deg
ANGLES = (
    ((0.9, 5.3, 0.4), (0.25, 1.7, 2.0)),
    ((0.7, 6.7, 1.1),),
    ((2.5, 19.0, 0.0), (0.5, 3.1, 1.6)),
)
TRACK = (((0.20, 4.1, 0.2),), ((0.25, 3.3, 1.9),), ((0.10, 2.6, 0.7),))


def envelope(t, rest):
    """Zero until `rest`, one 2 s later, three times differentiable."""
    s = np.clip((t - rest) / 2.0, 0.0, 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)


def sines(t, rest, parts):
    out = np.zeros_like(t)
    for amplitude, period, phase in parts:
        out += amplitude * (np.sin(2.0 * np.pi * t / period + phase) - np.sin(phase))
    return envelope(t, rest) * out


def attitude(t, rest=5.0, start=(0.0, 0.0, 0.0)):
    """SciPy rotation b to n at times t; `start` is roll, pitch, yaw at rest."""
    roll, pitch, yaw = (sines(np.asarray(t, float), rest, parts) for parts in ANGLES)
    moving = Rotation.from_euler("ZYX", np.stack((yaw, pitch, roll), axis=1))
    return moving * Rotation.from_euler("ZYX", [start[2], start[1], start[0]])


def acceleration(t, rest=5.0):
    """Second derivative of the track in n, by central differences of 1 ms: off by 1e-5."""
    h = 1e-3
    at = [np.stack([sines(t + d, rest, p) for p in TRACK], axis=1) for d in (-h, 0.0, h)]
    return (at[0] - 2.0 * at[1] + at[2]) / h**2


def sensors(t, rest=5.0, start=(0.0, 0.0, 0.0)):
    """Return attitude, rate [rad/s], specific force [m/s^2] and field [T] of ideal sensors."""
    t = np.asarray(t, dtype=float)
    r_nb = attitude(t, rest, start)
    turned = (r_nb[:-1].inv() * r_nb[1:]).as_rotvec() / np.diff(t)[:, None]
    gyr = np.concatenate((turned[:1], turned))
    acc = r_nb.inv().apply(acceleration(t, rest) - [0.0, 0.0, G])
    return r_nb, gyr, acc, r_nb.inv().apply(FIELD_N)


def scalar_first(r_nb):
    """Quaternion of a SciPy rotation, scalar first."""
    return r_nb.as_quat()[:, [3, 0, 1, 2]]


def degrees_off(q_nb, r_nb):
    """Angle between an estimate, scalar first, and the truth [deg]."""
    return np.degrees((Rotation.from_quat(q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()).magnitude())


def rotvec_off(q_nb, r_nb):
    """Rotation vector in n that takes the estimate to the truth [rad]."""
    return (r_nb * Rotation.from_quat(q_nb[:, [1, 2, 3, 0]]).inv()).as_rotvec()
