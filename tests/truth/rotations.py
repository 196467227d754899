"""Rotations in 40-digit arithmetic, from definitions: no formula of the package appears here.

A quaternion is multiplied by the table of its units, a rotation matrix comes from Rodrigues'
formula or from three turns about coordinate axes.
"""

import mpmath as mp
import numpy as np

mp.mp.dps = 40

# i j = k, j k = i, k i = j; the square of each is -1: {(row, column): (sign, unit)}
UNITS = {
    (0, 0): (1, 0), (0, 1): (1, 1), (0, 2): (1, 2), (0, 3): (1, 3),
    (1, 0): (1, 1), (1, 1): (-1, 0), (1, 2): (1, 3), (1, 3): (-1, 2),
    (2, 0): (1, 2), (2, 1): (-1, 3), (2, 2): (-1, 0), (2, 3): (1, 1),
    (3, 0): (1, 3), (3, 1): (1, 2), (3, 2): (-1, 1), (3, 3): (-1, 0),
}  # fmt: skip


def hamilton(a, b):
    """Product of two quaternions by the table of units."""
    out = [mp.mpf(0)] * 4
    for (i, j), (sign, k) in UNITS.items():
        out[k] += sign * mp.mpf(float(a[i])) * mp.mpf(float(b[j]))
    return np.array([float(x) for x in out])


def rodrigues(rotvec):
    """Rotation matrix of a rotation vector."""
    r = mp.matrix([mp.mpf(float(x)) for x in rotvec])
    angle = mp.sqrt(sum(x * x for x in r))
    skew = mp.matrix([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    if angle == 0:
        return np.eye(3)
    out = mp.eye(3) + mp.sin(angle) / angle * skew
    return to_float(out + (1 - mp.cos(angle)) / angle**2 * skew * skew)


def exp_quat(rotvec):
    """Quaternion of a rotation vector."""
    r = [mp.mpf(float(x)) for x in rotvec]
    angle = mp.sqrt(sum(x * x for x in r))
    k = mp.sin(angle / 2) / angle if angle else mp.mpf(1) / 2
    return np.array([float(mp.cos(angle / 2))] + [float(k * x) for x in r])


def zyx(roll, pitch, yaw):
    """``C_nb = Rz(yaw) Ry(pitch) Rx(roll)``."""
    r, p, y = (mp.mpf(float(x)) for x in (roll, pitch, yaw))
    rx = mp.matrix([[1, 0, 0], [0, mp.cos(r), -mp.sin(r)], [0, mp.sin(r), mp.cos(r)]])
    ry = mp.matrix([[mp.cos(p), 0, mp.sin(p)], [0, 1, 0], [-mp.sin(p), 0, mp.cos(p)]])
    rz = mp.matrix([[mp.cos(y), -mp.sin(y), 0], [mp.sin(y), mp.cos(y), 0], [0, 0, 1]])
    return to_float(rz * ry * rx)


def to_float(matrix):
    """NumPy array of an mpmath matrix."""
    return np.array(matrix.tolist(), dtype=float)


def random_quats(n, seed=0):
    """Unit quaternions spread evenly over all rotations."""
    q = np.random.default_rng(seed).standard_normal((n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def same_sign(q, reference):
    """Pick, of q and -q, the one nearer to `reference`: both are the same rotation."""
    return q * np.where(np.sum(q * reference, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
