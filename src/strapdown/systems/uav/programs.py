"""The two programs of appendix A in dense matrices, step by step as they are printed.

They stand beside the kernels as Matlab stands beside C in the thesis: the same filter written
twice, here once with NumPy's products and inverses, there sparse and one scalar at a time.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from strapdown._types import FloatArray

DT: Final = 0.02
G: Final = 9.81
VAR_ACC: Final = 1.962361
VAR_PSI: Final = 0.014924  # of the magnetic heading, standard
VAR_COURSE: Final = 0.001
VAR_MAG: Final = 7e-5  # [G^2]
NOISE: Final = (1e-4, 1e-4, 1e-4, 0.25e-4, 0.25e-4, 1e-8)  # aQ
FIELD: Final = (2.4762e-1, 824.65e-5, 3.865e-1)  # V^E [G]


@dataclass(slots=True)
class Memory:
    """What a program keeps from step to step.

    Attributes
    ----------
    x : ndarray, shape (7,)
        Quaternion and biases [rad/s].
    P : ndarray, shape (7, 7)
        Covariance.
    count : int
        Steps; wide enough not to overflow.
    tilt : tuple of float
        Roll and pitch at the end of the step before [rad].
    """

    x: FloatArray = field(default_factory=lambda: np.array([1.0, 0, 0, 0, 0, 0, 0]))
    P: FloatArray = field(default_factory=lambda: 0.1 * np.eye(7))
    count: int = 0
    tilt: tuple[float, float] = (0.0, 0.0)


def standard(m: Memory, mag: FloatArray, acc: FloatArray, gyr: FloatArray) -> None:
    """Do one step of the program of A.1, the standard AHRS.

    Parameters
    ----------
    m : Memory
        Changed in place.
    mag, acc, gyr : ndarray, shape (3,)
        Field, of any unit; specific force [m/s^2]; rates [rad/s].
    """
    _predict(m, gyr)
    m.P[np.diag_indices(7)] += [1e-8] * 4 + [1e-12] * 3
    m.count += 1
    if m.count % 2 == 0:
        h, H = vector(m.x[:4], np.array([0.0, 0.0, -G]))
        _correct(m, acc - h, H, VAR_ACC * np.eye(3))
    if m.count % 5 == 1:
        roll, pitch = m.tilt
        level_x = mag[0] * np.cos(pitch)
        level_x += (mag[1] * np.sin(roll) + mag[2] * np.cos(roll)) * np.sin(pitch)
        level_y = mag[1] * np.cos(roll) - mag[2] * np.sin(roll)
        m.x[:4] /= np.linalg.norm(m.x[:4])
        yaw, H = heading(m.x[:4])
        _correct(m, [_wrap(np.arctan2(-level_y, level_x) - yaw)], H, VAR_PSI * np.eye(1))
    _finish(m)


def multi_mode(
    m: Memory,
    mag: FloatArray,
    acc: FloatArray,
    gyr: FloatArray,
    v_n: FloatArray,
    *,
    valid: bool,
) -> None:
    """Do one step of the program of A.2, the multi-mode AHRS.

    Parameters
    ----------
    m : Memory
        Changed in place.
    mag, acc, gyr : ndarray, shape (3,)
        Field [G]; specific force [m/s^2]; rates [rad/s].
    v_n : ndarray
        Velocity north and east [m/s].
    valid : bool
        ``gps_valid``.
    """
    _predict(m, gyr)
    m.x[:4] /= np.linalg.norm(m.x[:4])
    V = np.zeros((7, 6))
    V[:4, :3] = DT * of_rate(m.x[:4])
    V[4:, 3:] = DT * np.eye(3)
    m.P[np.diag_indices(7)] += np.diag(V @ np.diag(NOISE) @ V.T)
    m.count += 1
    if m.count % 2 == 0:
        h, H = vector(m.x[:4], np.array(FIELD))
        left = mag - h
        if valid:
            yaw, row = heading(m.x[:4])
            left = np.append(left, _wrap(np.arctan2(v_n[1], v_n[0]) - yaw))
            H, R = np.vstack((H, row)), [VAR_MAG] * 3 + [VAR_COURSE]
        else:
            h, rows = vector(m.x[:4], np.array([0.0, 0.0, -G]))
            left = np.concatenate((left, acc - h))
            H, R = np.vstack((H, rows)), [VAR_MAG] * 3 + [VAR_ACC] * 3
        _correct(m, left, H, np.diag(R))
    _finish(m)


def of_rate(q: FloatArray) -> FloatArray:
    """Return A2 (3.9), what a bias makes of the quaternion's derivative.

    Parameters
    ----------
    q : ndarray, shape (4,)
        Quaternion.

    Returns
    -------
    ndarray, shape (4, 3)
    """
    w, x, y, z = q
    return 0.5 * np.array([[x, y, z], [-w, z, -y], [-z, -w, x], [y, -x, -w]])


def _predict(m: Memory, gyr: FloatArray) -> None:
    """Carry quaternion and covariance over one interval."""
    p, q, r = gyr - m.x[4:]
    omega = np.array([[0, -p, -q, -r], [p, 0, r, -q], [q, -r, 0, p], [r, q, -p, 0]])
    F = np.eye(7)
    F[:4, :4] += 0.5 * DT * omega
    F[:4, 4:] = DT * of_rate(m.x[:4])
    m.x[:4] = F[:4, :4] @ m.x[:4]
    m.P = F @ m.P @ F.T


def _correct(m: Memory, left: FloatArray | list[float], H: FloatArray, R: FloatArray) -> None:
    """Add ``K left`` to the state; ``P <- (I - K H) P``."""
    H = np.hstack((H, np.zeros((len(H), 3))))
    K = m.P @ H.T @ np.linalg.inv(H @ m.P @ H.T + R)
    m.x = m.x + K @ np.asarray(left)
    m.P = (np.eye(7) - K @ H) @ m.P
    m.x[:4] /= np.linalg.norm(m.x[:4])


def vector(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return C (1.8) times v, and its derivative by q (C1 and C2).

    Parameters
    ----------
    q : ndarray, shape (4,)
        Quaternion.
    v : ndarray, shape (3,)
        Vector in n.

    Returns
    -------
    ndarray, shape (3,)
    ndarray, shape (3, 4)
    """
    w, x, y, z = q
    C = np.array([
        [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
    ])  # fmt: skip
    a = w * v[0] + z * v[1] - y * v[2]
    b = x * v[0] + y * v[1] + z * v[2]
    c = -y * v[0] + x * v[1] - w * v[2]
    d = -z * v[0] + w * v[1] + x * v[2]
    return C @ v, 2.0 * np.array([[a, b, c, d], [d, -c, b, -a], [-c, -d, a, b]])


def heading(q: FloatArray, *, exact: bool = False) -> tuple[float, FloatArray]:
    """Return yaw and its derivative, exact, or as in both programs, a factor beta too many.

    Parameters
    ----------
    q : ndarray, shape (4,)
        Quaternion.
    exact : bool
        The derivative of the arctangent.

    Returns
    -------
    float
        Yaw [rad].
    ndarray, shape (1, 4)
    """
    w, x, y, z = q
    alpha, beta = 2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)
    c = 2.0 / (alpha**2 + beta**2)
    t0, t1 = beta * c, alpha * c * (1.0 if exact else beta)
    return float(np.arctan2(alpha, beta)), np.array(
        [[z * t0, y * t0, x * t0 + 2 * y * t1, w * t0 + 2 * z * t1]]
    )


def _wrap(angle: float) -> float:
    if angle > np.pi:
        return angle - 2.0 * np.pi
    return angle + 2.0 * np.pi if angle < -np.pi else angle


def _finish(m: Memory) -> None:
    """Normalise, and keep roll and pitch."""
    m.x[:4] /= np.linalg.norm(m.x[:4])
    w, x, y, z = m.x[:4]
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    m.tilt = (float(roll), float(np.arcsin(np.clip(2 * (w * y - x * z), -1.0, 1.0))))
