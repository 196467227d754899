"""An aircraft that sways about its course, by SciPy: data that an AHRS's own model describes.

Yaw turns round and round, pitch and roll swing by up to 0.4 and 0.7 rad; gravity is all that the
accelerometer feels. Rates are means over the interval.
"""

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.80665


def attitude(t, rng):
    """SciPy rotation b to n: other frequencies and phases for every generator."""
    f, phase = rng.uniform(0.05, 0.3, 4), rng.uniform(0.0, 2.0 * np.pi, 5)
    roll = 0.5 * np.sin(2 * np.pi * f[0] * t + phase[0]) + 0.2 * np.sin(5.0 * t + phase[1])
    pitch = 0.4 * np.sin(2 * np.pi * f[1] * t + phase[2])
    yaw = phase[3] + 0.3 * t + 0.8 * np.sin(2 * np.pi * f[2] * t + phase[4])
    return Rotation.from_euler("ZYX", np.stack((yaw, pitch, roll), axis=1))


def rates(r_nb, dt):
    """Mean rate of the interval that ends at each sample; the first is that of the second."""
    turned = (r_nb[:-1].inv() * r_nb[1:]).as_rotvec() / dt
    return np.concatenate((turned[:1], turned))


def walk(n, dt, start, density, rng):
    """A bias that starts as drawn and walks."""
    steps = np.sqrt(dt) * np.asarray(density) * rng.standard_normal((n, 3))
    steps[0] = 0.0
    return start * rng.standard_normal(3) + np.cumsum(steps, axis=0)


def tangent(q):
    """What a turn phi_n makes of a quaternion, ``1/2 (0, phi_n) q``: 4x3."""
    w, (x, y, z) = q[0], q[1:]
    return 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])


def nees(state, r_nb, bias):
    """Normalised squared error of attitude and bias, of a P of quaternion and bias."""
    q = state.q_nb
    T = np.block([[4.0 * tangent(q).T, np.zeros((3, 3))], [np.zeros((3, 4)), np.eye(3)]])
    off = (r_nb * Rotation.from_quat(q[[1, 2, 3, 0]]).inv()).as_rotvec()
    e = np.r_[off, bias - state.gyr_bias]
    return float(e @ np.linalg.solve(T @ state.P @ T.T, e))
