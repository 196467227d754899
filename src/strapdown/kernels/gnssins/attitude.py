"""Attitude Kalman filter of thesis E, 7.2 and 7.7.1: quaternion and gyro bias, 7 states.

The error is additive, ``q_true = q + dq``; q is normalised after each correction. The measured
quaternion is a linear measurement, ``H = [I 0]``. As R is the same for all its components, they
may be taken along any four orthogonal directions: q itself, which tells the norm, and ``i q``,
``j q``, ``k q``, along which q moves when it turns about north, east and down, by half the angle.
"""

from math import exp, log, pi, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.gnssins.layout import W_A, W_B, W_DX, W_H, W_M, W_N
from strapdown.kernels.gnssins.update import expect, update
from strapdown.kernels.memory import BG, STD_ATT, STD_BG, Q
from strapdown.kernels.quat import normalize

UNKNOWN = 1e12  # above the printed P_0, far above the 1 that a component can be off
LEAST_R = 1e-14  # no attitude is measured better than to 2e-7 rad, which P's rounding allows
NONSENSE = 10.0  # residuals are at most 1
MOST_BIAS = 1e6  # [rad/s]
MAX_EXPONENT = 200.0  # R beyond this is no measurement, and no overflow


@kernel
def adaptive_r(
    var: float, ka: float, base: float, off_g: float, rate: float, root: float
) -> float:
    """R of (7.7.8): ``QuatCOV 10^(KA ||f| - g|) baseR^|r|``; `root` takes the exponent's root."""
    exponent = ka * abs(off_g)
    if root > 0.0:
        exponent = sqrt(exponent)
    total = log(10.0) * exponent + log(base) * abs(rate)
    return max(var * exp(min(total, MAX_EXPONENT)), LEAST_R)


@kernel
def predict(P: Mat, w: Vec) -> None:
    """``P <- Phi P Phi^T`` with ``Phi = [[A, B], [0, I]]`` of the scratch, by blocks."""
    for i in range(4):
        for j in range(4):
            v = 0.0
            for k in range(4):
                v += w[W_A + 4 * i + k] * P[k, j]
            for k in range(3):
                v += w[W_B + 3 * i + k] * P[4 + k, j]
            w[W_M + 4 * i + j] = v
        for j in range(3):
            v = 0.0
            for k in range(4):
                v += w[W_A + 4 * i + k] * P[k, 4 + j]
            for k in range(3):
                v += w[W_B + 3 * i + k] * P[4 + k, 4 + j]
            w[W_N + 3 * i + j] = v
    for i in range(4):
        for j in range(i + 1):
            v = 0.0
            for k in range(4):
                v += w[W_M + 4 * i + k] * w[W_A + 4 * j + k]
            for k in range(3):
                v += w[W_N + 3 * i + k] * w[W_B + 3 * j + k]
            P[i, j] = v
            P[j, i] = v
        for j in range(3):
            P[i, 4 + j] = w[W_N + 3 * i + j]
            P[4 + j, i] = w[W_N + 3 * i + j]


# fmt: off
@kernel
def add_noise(
    P: Mat, a: float, b: float, c: float, d: float, turn: float, bias: float
) -> None:
    """Add ``D Q D^T dt``, (7.2.30): `turn` and `bias` are variances of the interval.

    ``D_q D_q^T = (I - q q^T) / 4``.
    """
    # fmt: on
    v = 0.25 * turn
    for i in range(4):
        qi = a if i == 0 else (b if i == 1 else (c if i == 2 else d))
        for j in range(i + 1):
            qj = a if j == 0 else (b if j == 1 else (c if j == 2 else d))
            P[i, j] -= v * qi * qj
            if i == j:
                P[i, i] += v
            else:
                P[j, i] = P[i, j]
    for i in range(4, 7):
        P[i, i] += bias


@kernel
def write_direction(w: Vec, k: int, a: float, b: float, c: float, d: float) -> None:
    """Write the row of H for north, east, down (0, 1, 2) or the norm (3)."""
    if k == 0:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = -b, a, -d, c
    elif k == 1:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = -c, d, a, -b
    elif k == 2:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = -d, -c, b, a
    else:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = a, b, c, d


@kernel
def variance(P: Mat, w: Vec) -> float:
    """Variance of the quaternion's error along ``w[W_H]``."""
    v = 0.0
    for i in range(4):
        for j in range(4):
            v += w[W_H + i] * P[i, j] * w[W_H + j]
    return max(v, 0.0)


# fmt: off
@kernel
def reset_covariance(
    x: Vec, P: Mat, w: Vec,
    a: float, b: float, c: float, d: float,
    var: float, has_heading: bool,
) -> None:
    """Set the quaternion's covariance to ``var (I - q q^T)`` and q; the bias keeps its own.

    A heading that was not measured keeps its variance.
    """
    # fmt: on
    write_direction(w, 2, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    more = 0.0 if has_heading else max(variance(P, w) - var, 0.0)
    for i in range(4):
        for j in range(7):
            P[i, j] = 0.0
            P[j, i] = 0.0
    add_noise(P, a, b, c, d, 4.0 * var, 0.0)
    write_direction(w, 2, a, b, c, d)
    for i in range(4):
        for j in range(4):
            P[i, j] += more * w[W_H + i] * w[W_H + j]
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = a, b, c, d


@kernel
def bound(x: Vec, P: Mat, w: Vec) -> None:
    """Forget what is known of a quaternion whose covariance has grown beyond all reason."""
    if not P[0, 0] + P[1, 1] + P[2, 2] + P[3, 3] < UNKNOWN:
        reset_covariance(x, P, w, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 1.0, True)


# fmt: off
@kernel
def correct(
    x: Vec, P: Mat, w: Vec, row: int,
    ra: float, rb: float, rc: float, rd: float,
    r: float, has_heading: bool, free: int,
) -> None:
    """Update with the residual ``q_meas - q``, (7.7.4) to (7.7.6), and move the estimate.

    Without a heading the direction of down is left out. `free` of 4 leaves the bias as it is.
    Residuals and their sigmas, in half radians, go to ``w[row]``.
    """
    # fmt: on
    a, b, c, d = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    for i in range(7):
        w[W_DX + i] = 0.0
    for k in range(4):
        if k != 2 or has_heading:
            write_direction(w, k, a, b, c, d)
            z = w[W_H] * ra + w[W_H + 1] * rb + w[W_H + 2] * rc + w[W_H + 3] * rd
            s = expect(P, w, 0, 7, 0, 4, r)
            left = update(P, w, 0, 7, 0, 4, z, s, free)
            if k < 3:
                w[row + k] = left
                w[row + 3 + k] = sqrt(s)
    size = abs(w[W_DX]) + abs(w[W_DX + 1]) + abs(w[W_DX + 2]) + abs(w[W_DX + 3])
    turn = abs(w[W_DX + 4]) + abs(w[W_DX + 5]) + abs(w[W_DX + 6])
    if not (size < NONSENSE and turn < MOST_BIAS):  # rounding has made P indefinite
        reset_covariance(x, P, w, a, b, c, d, 1.0, True)
        for i in range(4, 7):
            for j in range(4, 7):
                P[i, j] = 1.0 if i == j else 0.0
        return
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(
        a + w[W_DX], b + w[W_DX + 1], c + w[W_DX + 2], d + w[W_DX + 3]
    )
    for i in range(3):
        x[BG + i] += w[W_DX + 4 + i]


@kernel
def write_std(x: Vec, P: Mat, w: Vec) -> None:
    """Write the standard deviations of the attitude, in n, and of the bias."""
    for k in range(3):
        write_direction(w, k, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        # an angle cannot be more uncertain than half a turn
        x[STD_ATT + k] = min(2.0 * sqrt(variance(P, w)), pi)
        x[STD_BG + k] = sqrt(max(P[4 + k, 4 + k], 0.0))
