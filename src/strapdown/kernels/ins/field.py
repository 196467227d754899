"""The magnetometer as an aid of heading. Frames: n = NED, b = body.

Less the iron of box and car, `b`, the field lies in the vertical plane of magnetic north, at the
declination `D`, and there is nothing across it: ``0 = e_c . C_nb (m_b - b)`` with
``e_c = (-sin D, cos D, 0)``. `b` and `D` are states that need no prior knowledge: fixes give
heading while the car turns, and the field keeps it when they are gone. Its strength and dip are
not used. Disturbances by what stands and drives about last, and have heavy tails.
"""

from math import cos, inf, sin

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.covariance import (
    absorb,
    clear_correction,
    clear_row,
    inject,
    project,
    remaining,
    reset,
)
from strapdown.kernels.ins.layout import (
    DECLINATION,
    I_MAG,
    IRON,
    MAG_T,
    PHI,
    SD_MAG,
    T_MAG,
    H,
    Q,
)
from strapdown.kernels.memory import MAG, MAX_MAG2, MIN_MAG2, T
from strapdown.kernels.quat import dcm
from strapdown.kernels.robust_eskf_update import heavy_tail

SD_IRON = 5e-5  # of the iron before anything is known [T]
SD_DECLINATION = 0.3  # [rad]
TAILS = 4.0  # degrees of freedom of Student's t


@kernel
def field_row(x: Vec, p: Vec, w: Vec) -> float:
    """Write the row of the field across magnetic north; return what it should add up to [T]."""
    k = int(p[I_MAG])
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    bx, by, bz = x[MAG + 1] - x[IRON], x[MAG + 2] - x[IRON + 1], x[MAG + 3] - x[IRON + 2]
    mn = c11 * bx + c12 * by + c13 * bz
    me = c21 * bx + c22 * by + c23 * bz
    md = c31 * bx + c32 * by + c33 * bz
    c, s = cos(x[DECLINATION]), sin(x[DECLINATION])
    along = c * mn + s * me
    clear_row(p, w)
    w[H + PHI] = -c * md
    w[H + PHI + 1] = -s * md
    w[H + PHI + 2] = along
    w[H + k] = s * c11 - c * c21
    w[H + k + 1] = s * c12 - c * c22
    w[H + k + 2] = s * c13 - c * c23
    w[H + k + 3] = -along
    missing: float = s * mn - c * me
    return missing


@kernel
def take_field(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Take the field in the inbox."""
    k = int(p[I_MAG])
    m2 = x[MAG + 1] * x[MAG + 1] + x[MAG + 2] * x[MAG + 2] + x[MAG + 3] * x[MAG + 3]
    if k < 0 or not (m2 > MIN_MAG2 and m2 < MAX_MAG2):
        return
    since = x[T] - x[MAG_T]
    if P[k, k] == 0.0:
        since = inf
        reset(P, p, w, k, 3, SD_IRON)
        reset(P, p, w, k + 3, 1, SD_DECLINATION)
    x[MAG_T] = x[T]
    clear_correction(p, w)
    y = field_row(x, p, w)
    r = p[SD_MAG] * p[SD_MAG]
    variance = project(P, p, w)
    y_left = remaining(p, w, y)
    # a disturbance lasts: looks that are closer than it tell the same
    r *= heavy_tail(TAILS, y_left * y_left / (variance + r)) * max(1.0, 2.0 * p[T_MAG] / since)
    absorb(P, p, w, y, r)
    inject(x, p, w)
