"""Attitude of b in x by quaternion, direction cosines or Euler angles, over one step.

Quaternion and matrix are advanced exactly, ``C_xb <- exp(-turn x) C_xb exp(phi x)``. Euler angles
follow their differential equation [1]_ with the classical Runge-Kutta rule of fourth order; the
rate within the step is the polynomial through the samples.

References
----------
.. [1] D. H. Titterton, J. L. Weston, "Strapdown Inertial Navigation Technology", 2nd edition,
       IEE, 2004, section 3.6.
"""

from math import cos, sin

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.mechanisation.increments import rotation_matrix, weighted
from strapdown.kernels.mechanisation.layout import (
    AT_END,
    AT_MIDDLE,
    AT_START,
    ATT,
    ATTITUDE,
    DCM,
    EULER,
    GIMBAL_LOCK,
    PHI,
    STATUS,
    TH,
    TURN,
)
from strapdown.kernels.quat import dcm, exp, from_dcm, mul

LEAST_COSINE = 1e-3  # of pitch: within 0.06 deg of the vertical Euler angles have no rates


@kernel
def matrix_of(x: Vec, p: Vec, w: Vec, at: int) -> None:
    """Write ``C_xb`` into ``w[at:at + 9]``."""
    if int(p[ATTITUDE]) == DCM:
        for i in range(9):
            w[at + i] = x[ATT + i]
    else:
        qw, qx, qy, qz = quat_of(x, p)
        (
            w[at], w[at + 1], w[at + 2],
            w[at + 3], w[at + 4], w[at + 5],
            w[at + 6], w[at + 7], w[at + 8],
        ) = dcm(qw, qx, qy, qz)  # fmt: skip


@kernel
def quat_of(x: Vec, p: Vec) -> tuple[float, float, float, float]:
    """``q_xb``, of whatever represents it."""
    kind = int(p[ATTITUDE])
    if kind == DCM:
        qw, qx, qy, qz = from_dcm(
            x[ATT], x[ATT + 1], x[ATT + 2],
            x[ATT + 3], x[ATT + 4], x[ATT + 5],
            x[ATT + 6], x[ATT + 7], x[ATT + 8],
        )  # fmt: skip
    elif kind == EULER:
        cr, sr = cos(0.5 * x[ATT]), sin(0.5 * x[ATT])
        cp, sp = cos(0.5 * x[ATT + 1]), sin(0.5 * x[ATT + 1])
        cy, sy = cos(0.5 * x[ATT + 2]), sin(0.5 * x[ATT + 2])
        qw = cr * cp * cy + sr * sp * sy
        qx = sr * cp * cy - cr * sp * sy
        qy = cr * sp * cy + sr * cp * sy
        qz = cr * cp * sy - sr * sp * cy
    else:
        qw, qx, qy, qz = x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3]
    return qw, qx, qy, qz


@kernel
def advance(x: Vec, p: Vec, w: Vec, m: int) -> None:
    """Advance the attitude by the rotation vector and the turn of x that stand in `w`."""
    kind = int(p[ATTITUDE])
    if kind == DCM:
        _advance_matrix(x, w)
    elif kind == EULER:
        _advance_angles(x, p, w, m)
    else:
        _advance_quat(x, w)


@kernel
def _advance_quat(x: Vec, w: Vec) -> None:
    qw, qx, qy, qz = x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3]
    k = 1.5 - 0.5 * (qw * qw + qx * qx + qy * qy + qz * qz)  # Newton step towards unit norm
    bw, bx, by, bz = exp(w[PHI], w[PHI + 1], w[PHI + 2])
    qw, qx, qy, qz = mul(k * qw, k * qx, k * qy, k * qz, bw, bx, by, bz)
    bw, bx, by, bz = exp(-w[TURN], -w[TURN + 1], -w[TURN + 2])
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = mul(bw, bx, by, bz, qw, qx, qy, qz)


@kernel
def _advance_matrix(x: Vec, w: Vec) -> None:
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = rotation_matrix(w[PHI], w[PHI + 1], w[PHI + 2])
    for i in range(ATT, ATT + 9, 3):
        r0, r1, r2 = x[i], x[i + 1], x[i + 2]
        x[i] = r0 * b0 + r1 * b3 + r2 * b6
        x[i + 1] = r0 * b1 + r1 * b4 + r2 * b7
        x[i + 2] = r0 * b2 + r1 * b5 + r2 * b8
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = rotation_matrix(-w[TURN], -w[TURN + 1], -w[TURN + 2])
    for j in range(ATT, ATT + 3):
        r0, r1, r2 = x[j], x[j + 3], x[j + 6]
        x[j] = b0 * r0 + b1 * r1 + b2 * r2
        x[j + 3] = b3 * r0 + b4 * r1 + b5 * r2
        x[j + 6] = b6 * r0 + b7 * r1 + b8 * r2
    _orthogonalise(x)


@kernel
def _orthogonalise(x: Vec) -> None:
    """Newton step of the matrix towards its nearest rotation: ``C (3 I - C^T C) / 2``."""
    c0, c1, c2 = x[ATT], x[ATT + 1], x[ATT + 2]
    c3, c4, c5 = x[ATT + 3], x[ATT + 4], x[ATT + 5]
    c6, c7, c8 = x[ATT + 6], x[ATT + 7], x[ATT + 8]
    k00 = 1.5 - 0.5 * (c0 * c0 + c3 * c3 + c6 * c6)
    k11 = 1.5 - 0.5 * (c1 * c1 + c4 * c4 + c7 * c7)
    k22 = 1.5 - 0.5 * (c2 * c2 + c5 * c5 + c8 * c8)
    k01 = -0.5 * (c0 * c1 + c3 * c4 + c6 * c7)
    k02 = -0.5 * (c0 * c2 + c3 * c5 + c6 * c8)
    k12 = -0.5 * (c1 * c2 + c4 * c5 + c7 * c8)
    for i in range(ATT, ATT + 9, 3):
        r0, r1, r2 = x[i], x[i + 1], x[i + 2]
        x[i] = r0 * k00 + r1 * k01 + r2 * k02
        x[i + 1] = r0 * k01 + r1 * k11 + r2 * k12
        x[i + 2] = r0 * k02 + r1 * k12 + r2 * k22


@kernel
def _advance_angles(x: Vec, p: Vec, w: Vec, m: int) -> None:
    tx, ty, tz = w[TURN], w[TURN + 1], w[TURN + 2]
    roll, pitch, yaw = x[ATT], x[ATT + 1], x[ATT + 2]
    wx, wy, wz = weighted(x, p, TH, AT_START, m)
    a0, a1, a2 = _angle_steps(roll, pitch, yaw, wx, wy, wz, tx, ty, tz)
    wx, wy, wz = weighted(x, p, TH, AT_MIDDLE, m)
    b0, b1, b2 = _angle_steps(
        roll + 0.5 * a0, pitch + 0.5 * a1, yaw + 0.5 * a2, wx, wy, wz, tx, ty, tz
    )
    c0, c1, c2 = _angle_steps(
        roll + 0.5 * b0, pitch + 0.5 * b1, yaw + 0.5 * b2, wx, wy, wz, tx, ty, tz
    )
    wx, wy, wz = weighted(x, p, TH, AT_END, m)
    d0, d1, d2 = _angle_steps(roll + c0, pitch + c1, yaw + c2, wx, wy, wz, tx, ty, tz)
    x[ATT] = roll + (a0 + 2.0 * b0 + 2.0 * c0 + d0) / 6.0
    x[ATT + 1] = pitch + (a1 + 2.0 * b1 + 2.0 * c1 + d1) / 6.0
    x[ATT + 2] = yaw + (a2 + 2.0 * b2 + 2.0 * c2 + d2) / 6.0
    if not abs(cos(x[ATT + 1])) > LEAST_COSINE:
        x[STATUS] = GIMBAL_LOCK


# fmt: off
@kernel
def _angle_steps(
    roll: float, pitch: float, yaw: float,
    wx: float, wy: float, wz: float,
    tx: float, ty: float, tz: float,
) -> tuple[float, float, float]:
    """Rates of the angles times the step; turns of b (in b) and of x (in x) over the step."""
    # fmt: on
    cr, sr = cos(roll), sin(roll)
    cp, sp = cos(pitch), sin(pitch)
    cy, sy = cos(yaw), sin(yaw)
    ax, ay = cy * tx + sy * ty, cy * ty - sy * tx
    bx, bz = cp * ax - sp * tz, sp * ax + cp * tz
    wx -= bx
    wy -= cr * ay + sr * bz
    wz -= cr * bz - sr * ay
    about_down = sr * wy + cr * wz
    return wx + about_down * sp / cp, cr * wy - sr * wz, about_down / cp
