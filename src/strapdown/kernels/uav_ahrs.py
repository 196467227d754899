"""What the standard and the multi-mode AHRS share: quaternion and gyro bias. n = NED, b = body.

`P` (7x7) is the covariance of what is to be added to the four components of q_nb and to the bias.
The quaternion's error lies along the sphere, ``dq = 1/2 (0, phi_n) q``: P has no part along q, and
is carried along when q moves. As printed, P knows of no sphere. Measurements enter one scalar at a
time in Joseph form, all linearised at the same attitude: the sum is the update with vectors.
Section and equation numbers are those of spec D (thesis "micro UAV").
"""

from math import pi, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mekf import ROUND_OFF
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    DT,
    FULL,
    GIVEN,
    HEAD,
    P_HEAD,
    STATUS,
    STD_ATT,
    STD_BG,
    TILT,
    Q,
    advance_attitude,
    level,
    note_sigma,
)
from strapdown.kernels.quat import exp, mul, normalize
from strapdown.kernels.quest_ekf_covariance import rate_matrix, turn_matrix
from strapdown.kernels.quest_ekf_layout import W_A, W_B

# --- states of x that both have ------------------------------------------------------------
STARTED = HEAD  # 1 once tilt is known
SINCE_ACC = HEAD + 1  # time since the last correction by the accelerometer [s]
SINCE_MAG = HEAD + 2  # time since the last correction by the field [s]
X_SHARED = HEAD + 3

# --- parameters that both have ---------------------------------------------------------------
P_GYR_NOISE = P_HEAD  # [rad/s/sqrt(Hz)]
P_BIAS_NOISE = P_HEAD + 1  # of each axis [rad/s^2/sqrt(Hz)]: 3
P_ACC_NOISE = P_HEAD + 4  # [m/s^2/sqrt(Hz)]
P_MAG_NOISE = P_HEAD + 5  # heading [rad/sqrt(Hz)], or field [T/sqrt(Hz)]
P_ACC_PERIOD = P_HEAD + 6  # from one correction to the next [s]
P_MAG_PERIOD = P_HEAD + 7
P_GRAVITY = P_HEAD + 8  # [m/s^2]
P_GATE = P_HEAD + 9  # of field and course [sigma]
P_GAP_RATE = P_HEAD + 10  # [rad/s]
P_STD_TILT = P_HEAD + 11  # [rad]
P_STD_HEADING = P_HEAD + 12  # [rad]
P_PROPAGATION = P_HEAD + 13  # EXACT, or as printed: CONSTANT or DIAGONAL
P_JACOBIAN = P_HEAD + 14  # of the heading
P_SHARED = P_HEAD + 15

# --- propagation: exact, or to first order with the noise of one of the two filters -------------
EXACT = 0.0
CONSTANT = 1.0  # the same noise on the four components
DIAGONAL = 2.0  # diagonal of V aQ V^T

# --- Jacobian of the heading ----------------------------------------------------------------
OF_ANGLE = 0.0  # of the third Euler angle
AS_PRINTED = 1.0  # with a factor too many
LEVELLED = 2.0  # of the angle about down, the field being levelled by the estimate

# --- scratch -----------------------------------------------------------------------------
# W_A and W_B, 4x4 and 4x3, are those of the quaternion's two derivatives
W_M = W_B + 12  # upper rows of F P: 4x7
W_H = W_M + 28  # row of a measurement: 4
W_DX = W_H + 4  # correction found so far: 7
W_PH = W_DX + 7  # P h: 7
W_SHARED = W_PH + 7

UNSEEN_TIME = 0.25  # correlation time of a rate beyond the range, or of one that sticks [s]
MIN_LEVEL = 0.01  # square of the cosine of pitch from which on a heading angle means something


@kernel
def congruence(P: Mat, w: Vec) -> None:
    """``P <- F P F^T`` with ``F = [[A, B], [0, I]]``, A and B of the scratch."""
    for i in range(4):
        for j in range(7):
            v = 0.0
            for k in range(4):
                v += w[W_A + 4 * i + k] * P[k, j]
            for k in range(3):
                v += w[W_B + 3 * i + k] * P[4 + k, j]
            w[W_M + 7 * i + j] = v
    for i in range(4):
        for j in range(i + 1):
            v = 0.0
            for k in range(4):
                v += w[W_M + 7 * i + k] * w[W_A + 4 * j + k]
            for k in range(3):
                v += w[W_M + 7 * i + 4 + k] * w[W_B + 3 * j + k]
            P[i, j] = v
            P[j, i] = v
        for j in range(4, 7):
            P[i, j] = w[W_M + 7 * i + j]
            P[j, i] = w[W_M + 7 * i + j]


@kernel
def spread(P: Mat, x: Vec, variance: float) -> None:
    """Add a turn about any axis, of this variance: ``V1 V1^T`` is ``(I - q q^T) / 4``."""
    for i in range(4):
        for j in range(i + 1):
            v = -x[Q + i] * x[Q + j]
            if i == j:
                v += 1.0
            P[i, j] += 0.25 * variance * v
            P[j, i] = P[i, j]


@kernel
def predict(x: Vec, P: Mat, p: Vec, w: Vec, wx: float, wy: float, wz: float, dt: float) -> None:
    """Carry quaternion and covariance over one interval: (3.29) to (3.31), sections 9.3, 10.3.

    As printed the quaternion comes out with a norm beyond one by ``|r|^2 / 8``.
    """
    rx, ry, rz = (wx - x[BG]) * dt, (wy - x[BG + 1]) * dt, (wz - x[BG + 2]) * dt
    variance = p[P_GYR_NOISE] * p[P_GYR_NOISE] * dt
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    if p[P_PROPAGATION] == EXACT:
        advance_attitude(x, rx, ry, rz)
        ew, ex, ey, ez = exp(rx, ry, rz)
        turn_matrix(w, ew, ex, ey, ez)
        # a bias is to be subtracted from the rate
        rate_matrix(w, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], rx, ry, rz, -dt)
        congruence(P, w)
        spread(P, x, variance)
    else:
        ex, ey, ez = 0.5 * rx, 0.5 * ry, 0.5 * rz
        turn_matrix(w, 1.0, ex, ey, ez)  # I + F11 dt and F12 dt of (3.25)
        rate_matrix(w, qw, qx, qy, qz, 0.0, 0.0, 0.0, -dt)
        congruence(P, w)
        qw, qx, qy, qz = mul(qw, qx, qy, qz, 1.0, ex, ey, ez)
        if p[P_PROPAGATION] == DIAGONAL:
            qw, qx, qy, qz = normalize(qw, qx, qy, qz)
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = qw, qx, qy, qz
        for i in range(4):
            share = 0.25
            if p[P_PROPAGATION] == DIAGONAL:
                share -= 0.25 * x[Q + i] * x[Q + i]
            P[i, i] += share * variance
    for i in range(3):
        P[4 + i, 4 + i] += p[P_BIAS_NOISE + i] * p[P_BIAS_NOISE + i] * dt
    if (int(x[STATUS]) & (s.SATURATED | s.GYR_STUCK)) != 0:
        rate = float(p[P_GAP_RATE])
        spread(P, x, min(2.0 * UNSEEN_TIME * rate * rate * dt, pi * pi))


@kernel
def due(x: Vec, clock: int, period: float, dt: float) -> bool:
    """Whether a correction is due at the sample nearest to the end of its period."""
    return x[clock] + 0.5 * min(dt, period) >= period and dt > 0.0


@kernel
def wind(x: Vec, clock: int, period: float) -> None:
    """Begin the next period; what a sample came too late or too early by is made good."""
    x[clock] -= period
    if not abs(x[clock]) <= 0.5 * period:
        x[clock] = 0.0


@kernel
def variance_of(x: Vec, density: float, period: float) -> float:
    """Variance of a correction: it stands for its period, or for a slower IMU's interval."""
    return float(density * density / max(period, x[DT]))


@kernel
def update_scalar(
    P: Mat, w: Vec, innovation: float, r: float, gate: float
) -> tuple[float, float, bool]:
    """Enter a measurement of the quaternion's components, with the row of the scratch.

    Returns the innovation left after what has been found so far, its variance, and whether it lies
    within the gate; beyond it the noise is raised until it lies on the gate.
    """
    h0, h1, h2, h3 = w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3]
    for i in range(7):
        w[W_PH + i] = P[i, 0] * h0 + P[i, 1] * h1 + P[i, 2] * h2 + P[i, 3] * h3
    hph = h0 * w[W_PH] + h1 * w[W_PH + 1] + h2 * w[W_PH + 2] + h3 * w[W_PH + 3]
    left = innovation - h0 * w[W_DX] - h1 * w[W_DX + 1] - h2 * w[W_DX + 2] - h3 * w[W_DX + 3]
    hph = max(hph, 0.0)
    expected = hph + max(r, ROUND_OFF * hph)
    variance = expected
    accepted = left * left <= gate * gate * expected
    if not accepted:
        variance = left * left / (gate * gate)
    for i in range(7):
        gain_i = w[W_PH + i] / variance
        w[W_DX + i] += gain_i * left
        for j in range(i + 1):
            gain_j = w[W_PH + j] / variance
            # (I - K h) P (I - K h)^T + K r K^T, written out
            v = P[i, j] - gain_i * w[W_PH + j] - w[W_PH + i] * gain_j + gain_i * variance * gain_j
            P[i, j] = v
            P[j, i] = v
    return left, expected, accepted


# fmt: off
@kernel
def vector_row(
    w: Vec, i: int,
    qw: float, qx: float, qy: float, qz: float,
    vx: float, vy: float, vz: float,
) -> float:
    """Write the derivative by q of component i of ``C(q)^T v_n``, section 10.3; returns it.

    Quadratic in q, it is half of the row times q.
    """
    # fmt: on
    a = 2.0 * (qw * vx + qz * vy - qy * vz)
    b = 2.0 * (qx * vx + qy * vy + qz * vz)
    c = 2.0 * (-qy * vx + qx * vy - qw * vz)
    d = 2.0 * (-qz * vx + qw * vy + qx * vz)
    if i == 0:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = a, b, c, d
    elif i == 1:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = d, -c, b, -a
    else:
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = -c, -d, a, b
    return float(0.5 * (w[W_H] * qw + w[W_H + 1] * qx + w[W_H + 2] * qy + w[W_H + 3] * qz))


# fmt: off
@kernel
def update_vector(
    x: Vec, P: Mat, w: Vec, cell: int,
    vx: float, vy: float, vz: float,
    mx: float, my: float, mz: float,
    r: float, gate: float,
) -> bool:
    """Enter the vector v_n, seen as m in b; False if a component is beyond the gate."""
    # fmt: on
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    accepted = True
    for i in range(3):
        h = vector_row(w, i, qw, qx, qy, qz, vx, vy, vz)
        m = mx if i == 0 else (my if i == 1 else mz)
        left, expected, ok = update_scalar(P, w, m - h, r, gate)
        note_sigma(w, cell, i, left, expected)
        accepted = accepted and ok
    w[cell + 6] = s.ACCEPTED if accepted else s.REJECTED_GATE
    return accepted


@kernel
def heading_row(x: Vec, w: Vec, printed: float) -> bool:
    """Write the derivative by q of the yaw angle, (2.38) and C3; False where it has none.

    As printed, and in both programs, the terms of alpha have a factor beta too many.
    """
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    alpha = 2.0 * (qx * qy + qw * qz)
    beta = 1.0 - 2.0 * (qy * qy + qz * qz)
    level2 = alpha * alpha + beta * beta
    if not level2 > MIN_LEVEL:
        return False
    a, b = 2.0 * alpha / level2, 2.0 * beta / level2
    if printed > 0.0:
        a *= beta
    w[W_H] = b * qz
    w[W_H + 1] = b * qy
    w[W_H + 2] = b * qx + 2.0 * a * qy
    w[W_H + 3] = b * qw + 2.0 * a * qz
    return True


@kernel
def wrap(angle: float) -> float:
    """Angle within half a turn."""
    while angle > pi:
        angle -= 2.0 * pi
    while angle < -pi:
        angle += 2.0 * pi
    return angle


@kernel
def forget(w: Vec) -> None:
    """Begin an update: nothing has been found."""
    for i in range(7):
        w[W_DX + i] = 0.0


@kernel
def inject(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Move the correction found into the estimate; along the sphere, and P with it."""
    dw, dx, dy, dz = w[W_DX], w[W_DX + 1], w[W_DX + 2], w[W_DX + 3]
    if p[P_PROPAGATION] == EXACT:
        _, rx, ry, rz = mul(x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3], dw, dx, dy, dz)
        rx, ry, rz = 2.0 * rx, 2.0 * ry, 2.0 * rz
        advance_attitude(x, rx, ry, rz)
        ew, ex, ey, ez = exp(rx, ry, rz)
        turn_matrix(w, ew, ex, ey, ez)
        for i in range(12):
            w[W_B + i] = 0.0
        congruence(P, w)
    else:
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(
            x[Q] + dw, x[Q + 1] + dx, x[Q + 2] + dy, x[Q + 3] + dz
        )
    for i in range(3):
        x[BG + i] += w[W_DX + 4 + i]


@kernel
def add_turn(x: Vec, P: Mat, ux: float, uy: float, uz: float, variance: float) -> None:
    """Add a turn about the unit vector u_n, of this variance; negative takes one out."""
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    aw, ax, ay, az = mul(0.0, ux, uy, uz, qw, qx, qy, qz)
    for i in range(4):
        a = aw if i == 0 else (ax if i == 1 else (ay if i == 2 else az))
        for j in range(i + 1):
            b = aw if j == 0 else (ax if j == 1 else (ay if j == 2 else az))
            P[i, j] += 0.25 * variance * a * b
            P[j, i] = P[i, j]


@kernel
def reset_attitude(x: Vec, P: Mat, p: Vec) -> None:
    """Set the attitude's covariance after an alignment; the bias keeps its own."""
    tilt = p[P_STD_TILT] * p[P_STD_TILT]
    for i in range(4):
        for j in range(7):
            P[i, j] = 0.0
            P[j, i] = 0.0
    if p[P_PROPAGATION] == EXACT:
        heading = 0.0  # an arbitrary heading is exact by definition
        if x[ALIGNED] == FULL or x[ALIGNED] == GIVEN:
            heading = p[P_STD_HEADING] * p[P_STD_HEADING]
        spread(P, x, tilt)
        add_turn(x, P, 0.0, 0.0, 1.0, heading - tilt)
    else:
        for i in range(4):
            P[i, i] = 0.25 * tilt


@kernel
def reset_heading(x: Vec, P: Mat, variance: float) -> None:
    """Make the heading's error independent, with this variance; tilt and bias keep their own."""
    aw, ax, ay, az = mul(0.0, 0.0, 0.0, 1.0, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    for j in range(7):  # P <- (I - a a^T) P, on the rows of q
        along = aw * P[0, j] + ax * P[1, j] + ay * P[2, j] + az * P[3, j]
        P[0, j] -= aw * along
        P[1, j] -= ax * along
        P[2, j] -= ay * along
        P[3, j] -= az * along
    for i in range(7):  # P <- P (I - a a^T), on its columns
        along = aw * P[i, 0] + ax * P[i, 1] + ay * P[i, 2] + az * P[i, 3]
        P[i, 0] -= aw * along
        P[i, 1] -= ax * along
        P[i, 2] -= ay * along
        P[i, 3] -= az * along
    add_turn(x, P, 0.0, 0.0, 1.0, variance)
    for i in range(7):  # both passes round differently
        for j in range(i):
            P[i, j] = P[j, i]


@kernel
def turn_variance(x: Vec, P: Mat, ux: float, uy: float, uz: float) -> float:
    """Variance of the turn about the unit vector u_n."""
    w, a, b, c = mul(0.0, ux, uy, uz, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    v = P[0, 0] * w * w + P[1, 1] * a * a + P[2, 2] * b * b + P[3, 3] * c * c
    v += 2.0 * (P[0, 1] * w * a + P[0, 2] * w * b + P[0, 3] * w * c)
    v += 2.0 * (P[1, 2] * a * b + P[1, 3] * a * c + P[2, 3] * b * c)
    return float(max(4.0 * v, 0.0))


# fmt: off
@kernel
def bridge_gap(
    x: Vec, P: Mat, p: Vec, dt: float, has_acc: bool, ax: float, ay: float, az: float
) -> None:
    """Widen the covariance over a gap; where tilt is lost, level again and wait for a heading.

    One sample of the accelerometer then knows tilt better, and a linear update would not bear
    the size of the error.
    """
    # fmt: on
    unknown = min(p[P_GAP_RATE] * dt, pi)
    if unknown > p[P_STD_TILT] and has_acc:
        heading = turn_variance(x, P, 0.0, 0.0, 1.0)
        level(x, ax, ay, az)
        reset_attitude(x, P, p)
        k = 1.0 / p[P_GRAVITY]
        tilt = k * k * variance_of(x, p[P_ACC_NOISE], p[P_ACC_PERIOD])
        spread(P, x, max(0.0, tilt - p[P_STD_TILT] * p[P_STD_TILT]))
        x[SINCE_ACC] = 0.0  # the sample has been used
        reset_heading(x, P, min(heading + unknown * unknown, pi * pi))
        if x[ALIGNED] == FULL:
            x[ALIGNED] = TILT
    else:
        spread(P, x, unknown * unknown)


@kernel
def write_std(x: Vec, P: Mat) -> None:
    """Write the standard deviations of attitude, in n, and bias."""
    x[STD_ATT] = sqrt(turn_variance(x, P, 1.0, 0.0, 0.0))
    x[STD_ATT + 1] = sqrt(turn_variance(x, P, 0.0, 1.0, 0.0))
    x[STD_ATT + 2] = sqrt(turn_variance(x, P, 0.0, 0.0, 1.0))
    for i in range(3):
        x[STD_BG + i] = sqrt(P[4 + i, 4 + i])


@kernel
def restart(x: Vec, P: Mat, p: Vec) -> None:
    """Set covariance and clocks after an alignment, which has used accelerometer and field."""
    x[STARTED] = 1.0
    reset_attitude(x, P, p)
    x[SINCE_ACC] = 0.0
    x[SINCE_MAG] = 0.0
    write_std(x, P)


@kernel
def begin_given(x: Vec, P: Mat, p: Vec, since_mag: float) -> None:
    """Set covariance and clocks at the first sample of a given attitude; nothing has been used."""
    x[STARTED] = 1.0
    reset_attitude(x, P, p)
    x[SINCE_ACC] = 0.0
    x[SINCE_MAG] = since_mag
    write_std(x, P)
