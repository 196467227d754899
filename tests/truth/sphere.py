"""Kalman filters of a quaternion and a bias: errors on the sphere, dense updates, differences.

The truth's errors are six, (dtheta_b, db): ``q_true = q exp(dtheta_b)``. The kernels' seven follow
from ``dq = 1/2 q (0, dtheta_b)``.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.kernels import memory as m
from strapdown.kernels import uav_ahrs as k
from truth.kernel_step import bias, quat, rotation, scalar_first, start

G = 9.80665
FIELD_N = np.array([2.4762e-5, 8.2465e-7, 3.865e-5])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])
NO_ACC = np.full(3, np.inf)
H_STEP = 1e-5  # of central differences: off by 1e-10 of the third derivative
TURNS = [
    Rotation.from_euler("ZYX", angles)
    for angles in ([2.1, -0.4, 2.6], [-3.0, 0.9, -0.5], [1.57, 0.05, 0.2], [0.3, -1.2, 1.8])
]


def tangent(q):
    """What a turn dtheta_b makes of q: 4x3, ``1/2 q (0, e)`` as scalar and vector parts."""
    w, v = q[0], q[1:]
    return 0.5 * np.vstack((-v, w * np.eye(3) + np.cross(np.eye(3), v).T @ -np.eye(3)))


def seven(P6, q):
    """Covariance of the seven of that of the six."""
    T = np.block([[tangent(q), np.zeros((4, 3))], [np.zeros((3, 3)), np.eye(3)]])
    return T @ P6 @ T.T


def six(P7, q):
    """The other way: the columns of twice the tangent are orthonormal."""
    T = np.block([[4.0 * tangent(q).T, np.zeros((3, 3))], [np.zeros((3, 4)), np.eye(3)]])
    return T @ P7 @ T.T


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((6, 6))
    return scale * (a @ a.T + 0.1 * np.eye(6))


def begun(flt, b0=(0.0, 0.0, 0.0), seed=None, scale=1e-2, r_nb=TURNED):
    """Memory as after a sample at t = 0, with a covariance of one's own."""
    x, P = start(flt, scalar_first(r_nb), b0)
    if seed is not None:
        P[:] = seven(some_covariance(seed, scale), quat(x))
    return x, P


def row(w):
    return w[k.W_H : k.W_H + 4].copy()


def along(f, r_nb):
    """Derivative of a function of attitude with respect to dtheta_b, by central differences."""
    return np.transpose([
        (f(r_nb * Rotation.from_rotvec(H_STEP * e)) - f(r_nb * Rotation.from_rotvec(-H_STEP * e)))
        / (2.0 * H_STEP)
        for e in np.eye(3)
    ])  # fmt: skip


def with_attitude(r_nb):
    x = np.zeros(m.HEAD)
    x[m.Q : m.Q + 4] = scalar_first(r_nb)
    return x


def dense_update(P, q, b, z, H7, R):
    """The thesis's update with matrices, in Joseph's form; the quaternion moves on its sphere."""
    H = np.hstack((H7, np.zeros((len(H7), 3))))
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    dx = K @ z
    I_KH = np.eye(7) - K @ H
    dtheta = 4.0 * tangent(q).T @ dx[:4]
    return rotation(q) * Rotation.from_rotvec(dtheta), b + dx[4:], I_KH @ P @ I_KH.T + K @ R @ K.T


def gravity_rows(r_nb):
    """Rows on all four components; what lies along q does not matter."""
    q = scalar_first(r_nb)
    return along(lambda r: r.inv().apply([0, 0, -G]), r_nb) @ (4.0 * tangent(q).T)


def field_rows(r_nb):
    q = scalar_first(r_nb)
    return along(lambda r: r.inv().apply(FIELD_N), r_nb) @ (4.0 * tangent(q).T)


def yaw_row(r_nb):
    q = scalar_first(r_nb)
    return along(lambda r: r.as_euler("ZYX")[:1], r_nb) @ (4.0 * tangent(q).T)


def predicted(flt, x, P, rate, dt):
    """State and covariance after the prediction, which has tests of its own."""
    x, P = x.copy(), P.copy()
    k.predict(x, P, flt._params(), np.zeros(k.W_SHARED), *rate, dt)
    return quat(x), bias(x), P


def same(x, P, r_nb, b, want, atol=1e-9):
    """Attitude, bias and covariance are those wanted; rows are by differences.

    `want` is a covariance and the quaternion that it belongs to: P is carried along with q, so
    that about the axes of n it is what it was.
    """
    assert (rotation(quat(x)) * r_nb.inv()).magnitude() < atol
    np.testing.assert_allclose(bias(x), b, atol=atol)
    np.testing.assert_allclose(six_n(P, quat(x)), six_n(*want), atol=atol)
    np.testing.assert_allclose(P[4:, 4:], want[0][4:, 4:], atol=atol)


def six_n(P7, q):
    """Covariance of the attitude's error about the axes of n."""
    C = rotation(q).as_matrix()
    return C @ six(P7, q)[:3, :3] @ C.T


def carried(P7, q, q_new):
    """Covariance whose errors stay about the axes of n while q moves."""
    T = np.zeros((7, 7))
    T[4:, 4:] = np.eye(3)
    C, C_new = rotation(q).as_matrix(), rotation(q_new).as_matrix()
    T[:4, :4] = tangent(q_new) @ C_new.T @ C @ (4.0 * tangent(q).T)
    return T @ P7 @ T.T
