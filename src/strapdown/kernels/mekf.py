"""Multiplicative extended Kalman filter: attitude and gyro bias. n = NED, b = body.

Error state ``(dtheta_b, dbg)``: ``q_nb_true = q_nb exp(dtheta_b)``, ``b_g_true = b_g + dbg``.
`P` is its covariance, 6x6. Measurements enter one scalar at a time in Joseph form.
"""

from math import inf, isnan, nan, pi, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    D_ACC,
    D_MAG,
    FULL,
    HEAD,
    MAG,
    P_COS_D,
    P_HEAD,
    P_MAX_GAP,
    P_SIN_D,
    SKIP,
    START,
    STATUS,
    STD_ATT,
    STD_BG,
    TILT,
    W_HEAD,
    Q,
    T,
    advance_attitude,
    begin,
    field_in_body,
    heading_from_mag,
    level,
    load,
    note,
    note_sigma,
    post,
    set_status,
    store,
)
from strapdown.kernels.quat import dcm, down_in_body, exp

# --- own states of x -------------------------------------------------------------------
T_ACC = HEAD  # time of the last accelerometer update [s]
T_MAG = HEAD + 1  # time of the last field update [s]
STARTED = HEAD + 2  # 1 once tilt is known
X_SIZE = HEAD + 3

# --- own parameters ------------------------------------------------------------------------
P_GYR_NOISE = P_HEAD  # [rad/s/sqrt(Hz)]
P_BIAS_NOISE = P_HEAD + 1  # [rad/s^2/sqrt(Hz)]
P_ACC_NOISE = P_HEAD + 2  # [m/s^2/sqrt(Hz)]
P_MAG_NOISE = P_HEAD + 3  # [rad/sqrt(Hz)]
P_GRAVITY = P_HEAD + 4  # [m/s^2]
P_GATE = P_HEAD + 5  # [sigma]
P_GAP_RATE = P_HEAD + 6  # [rad/s]
P_STD_TILT = P_HEAD + 7  # [rad]
P_STD_HEADING = P_HEAD + 8  # [rad]
P_SIZE = P_HEAD + 9

ROUND_OFF = 1e-12  # of P: no measurement is surer, lest its update leave P negative
UNSEEN_TIME = 0.25  # correlation time of a rate beyond the range, or of one that sticks [s]

# --- scratch -----------------------------------------------------------------------------
W_A = W_HEAD  # transition of dtheta: 3x3
W_B = W_HEAD + 9  # influence of dbg on dtheta: 3x3
W_M = W_HEAD + 18  # A P_tt + B P_bt: 3x3
W_N = W_HEAD + 27  # A P_tb + B P_bb: 3x3
W_DX = W_HEAD + 36  # error state found so far in this update: 6
W_PH = W_HEAD + 42  # P h: 6
W_SIZE = W_HEAD + 48


@kernel
def transition(w: Vec, phi_x: float, phi_y: float, phi_z: float, dt: float) -> None:
    """Write ``A = exp(-[phi])`` and ``B = -J_r(phi) dt`` into the scratch.

    J_r is the right Jacobian of the rotation to second order: the first term left out is
    ``|phi|^3 / 24``.
    """
    qw, qx, qy, qz = exp(-phi_x, -phi_y, -phi_z)
    (
        w[W_A], w[W_A + 1], w[W_A + 2],
        w[W_A + 3], w[W_A + 4], w[W_A + 5],
        w[W_A + 6], w[W_A + 7], w[W_A + 8],
    ) = dcm(qw, qx, qy, qz)  # fmt: skip
    phi2 = phi_x * phi_x + phi_y * phi_y + phi_z * phi_z
    k = dt / 6.0
    h = dt / 2.0
    w[W_B] = -dt - k * (phi_x * phi_x - phi2)
    w[W_B + 1] = -h * phi_z - k * phi_x * phi_y
    w[W_B + 2] = h * phi_y - k * phi_x * phi_z
    w[W_B + 3] = h * phi_z - k * phi_x * phi_y
    w[W_B + 4] = -dt - k * (phi_y * phi_y - phi2)
    w[W_B + 5] = -h * phi_x - k * phi_y * phi_z
    w[W_B + 6] = -h * phi_y - k * phi_x * phi_z
    w[W_B + 7] = h * phi_x - k * phi_y * phi_z
    w[W_B + 8] = -dt - k * (phi_z * phi_z - phi2)


@kernel
def predict(P: Mat, w: Vec, q_theta: float, q_bias: float) -> None:
    """``P <- F P F^T + Q`` with ``F = [[A, B], [0, I]]``, by blocks."""
    for i in range(3):
        for j in range(3):
            m = 0.0
            n = 0.0
            for k in range(3):
                m += w[W_A + 3 * i + k] * P[k, j] + w[W_B + 3 * i + k] * P[3 + k, j]
                n += w[W_A + 3 * i + k] * P[k, 3 + j] + w[W_B + 3 * i + k] * P[3 + k, 3 + j]
            w[W_M + 3 * i + j] = m
            w[W_N + 3 * i + j] = n
    for i in range(3):
        for j in range(i + 1):
            v = 0.0
            for k in range(3):
                v += w[W_M + 3 * i + k] * w[W_A + 3 * j + k]
                v += w[W_N + 3 * i + k] * w[W_B + 3 * j + k]
            if i == j:
                v += q_theta
            P[i, j] = v
            P[j, i] = v
        for j in range(3):
            P[i, 3 + j] = w[W_N + 3 * i + j]
            P[3 + j, i] = w[W_N + 3 * i + j]
        P[3 + i, 3 + i] += q_bias


# fmt: off
@kernel
def update_scalar(
    P: Mat, w: Vec,
    h0: float, h1: float, h2: float,
    innovation: float, r: float, gate: float,
) -> tuple[float, float, bool]:
    """Joseph update with ``innovation = h . dtheta_b + noise``, variance r.

    Returns the innovation left after what this update has found so far, its variance, and
    whether it lies within the gate; beyond it the noise is raised until it lies on the gate.
    """
    # fmt: on
    for i in range(6):
        w[W_PH + i] = P[i, 0] * h0 + P[i, 1] * h1 + P[i, 2] * h2
    hph = h0 * w[W_PH] + h1 * w[W_PH + 1] + h2 * w[W_PH + 2]
    left = innovation - h0 * w[W_DX] - h1 * w[W_DX + 1] - h2 * w[W_DX + 2]
    hph = max(hph, 0.0)
    expected = hph + max(r, ROUND_OFF * hph)
    variance = expected
    accepted = left * left <= gate * gate * expected
    if not accepted:
        variance = left * left / (gate * gate)
    for i in range(6):
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
def update_direction(
    P: Mat, w: Vec,
    dx: float, dy: float, dz: float,
    mx: float, my: float, mz: float,
    r: float, gate: float,
) -> bool:
    """Update with the measured unit vector m of a direction d predicted in b.

    ``m = d + d x dtheta_b``, so the rows of H are those of ``[d]``.
    """
    # fmt: on
    a, va, ok_a = update_scalar(P, w, 0.0, -dz, dy, mx - dx, r, gate)
    b, vb, ok_b = update_scalar(P, w, dz, 0.0, -dx, my - dy, r, gate)
    c, vc, ok_c = update_scalar(P, w, -dy, dx, 0.0, mz - dz, r, gate)
    note_sigma(w, D_ACC, 0, a, va)
    note_sigma(w, D_ACC, 1, b, vb)
    note_sigma(w, D_ACC, 2, c, vc)
    accepted = ok_a and ok_b and ok_c
    w[D_ACC + 6] = s.ACCEPTED if accepted else s.REJECTED_GATE
    return accepted


# fmt: off
@kernel
def update_heading(
    P: Mat, w: Vec, angle: float,
    ux: float, uy: float, uz: float,
    dx: float, dy: float, dz: float,
    r: float, gate: float,
) -> bool:
    """Update with the angle by which the field d in b is off its heading; down is u in b.

    ``m = d + d x dtheta_b`` across the heading only: along it and in dip the measured field
    agrees with its reference by construction, which tells nothing. An error of tilt shows as one
    of heading too; the row knows. Diagnostics: one component, to the magnetic east.
    """
    # fmt: on
    ex, ey, ez = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
    h = sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / h, ey / h, ez / h
    hx, hy, hz = dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex
    left, expected, accepted = update_scalar(P, w, hx, hy, hz, h * angle, r, gate)
    note(w, D_MAG, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
    note_sigma(w, D_MAG, 0, left, expected)
    return accepted


@kernel
def reset_attitude(x: Vec, P: Mat, p: Vec) -> None:
    """Set the attitude's covariance after an alignment; the bias keeps its own."""
    c = p[P_STD_TILT] * p[P_STD_TILT]
    heading = 0.0  # an arbitrary heading is exact by definition
    if x[ALIGNED] == FULL:
        heading = p[P_STD_HEADING] * p[P_STD_HEADING]
    dx, dy, dz = down_in_body(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    for i in range(3):
        for j in range(6):
            P[i, j] = 0.0
            P[j, i] = 0.0
        P[i, i] = c
    k = heading - c
    P[0, 0] += k * dx * dx
    P[0, 1] += k * dx * dy
    P[0, 2] += k * dx * dz
    P[1, 1] += k * dy * dy
    P[1, 2] += k * dy * dz
    P[2, 2] += k * dz * dz
    P[1, 0] = P[0, 1]
    P[2, 0] = P[0, 2]
    P[2, 1] = P[1, 2]


@kernel
def reset_heading(x: Vec, P: Mat, variance: float) -> None:
    """Make the heading's error independent, with this variance; tilt and bias keep their own."""
    d0, d1, d2 = down_in_body(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    for j in range(6):  # P <- (I - d d^T) P, on the rows of dtheta
        along = d0 * P[0, j] + d1 * P[1, j] + d2 * P[2, j]
        P[0, j] -= d0 * along
        P[1, j] -= d1 * along
        P[2, j] -= d2 * along
    for i in range(6):  # P <- P (I - d d^T), on its columns
        along = P[i, 0] * d0 + P[i, 1] * d1 + P[i, 2] * d2
        P[i, 0] -= along * d0
        P[i, 1] -= along * d1
        P[i, 2] -= along * d2
    P[0, 0] += variance * d0 * d0
    P[1, 1] += variance * d1 * d1
    P[2, 2] += variance * d2 * d2
    P[1, 0] += variance * d0 * d1
    P[2, 0] += variance * d0 * d2
    P[2, 1] += variance * d1 * d2
    P[0, 1] = P[1, 0]
    P[0, 2] = P[2, 0]
    P[1, 2] = P[2, 1]


@kernel
def unseen(p: Vec, dt: float) -> float:
    """Variance that a sample adds whose rate was not seen: one that stays for a quarter second."""
    rate = float(p[P_GAP_RATE])
    return min(2.0 * UNSEEN_TIME * rate * rate * dt, pi * pi)


# fmt: off
@kernel
def bridge_gap(
    x: Vec, P: Mat, p: Vec, dt: float, has_acc: bool, ax: float, ay: float, az: float
) -> None:
    """Widen the covariance over a gap; where tilt is lost, level again and wait for a field.

    One sample of the accelerometer then knows tilt better, and a linear update would not bear
    the size of the error.
    """
    # fmt: on
    unknown = min(p[P_GAP_RATE] * dt, pi)
    if unknown > p[P_STD_TILT] and has_acc:
        dx, dy, dz = down_in_body(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        heading = dx * (P[0, 0] * dx + P[0, 1] * dy + P[0, 2] * dz)
        heading += dy * (P[1, 0] * dx + P[1, 1] * dy + P[1, 2] * dz)
        heading += dz * (P[2, 0] * dx + P[2, 1] * dy + P[2, 2] * dz)
        level(x, ax, ay, az)
        reset_attitude(x, P, p)
        # Of one sample, which is thereby used: it stands for the longest interval that counts.
        tilt = p[P_ACC_NOISE] * p[P_ACC_NOISE] / (p[P_GRAVITY] * p[P_GRAVITY] * p[P_MAX_GAP])
        for i in range(3):
            P[i, i] += max(0.0, tilt - p[P_STD_TILT] * p[P_STD_TILT])
        x[T_ACC] = x[T]
        reset_heading(x, P, min(heading + unknown * unknown, pi * pi))
        if x[ALIGNED] == FULL:
            x[ALIGNED] = TILT
    else:
        for i in range(3):
            P[i, i] += unknown * unknown


@kernel
def write_std(x: Vec, P: Mat) -> None:
    """Write the standard deviations of attitude, in n, and bias."""
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[STD_ATT] = _axis_std(P, c0, c1, c2)
    x[STD_ATT + 1] = _axis_std(P, c3, c4, c5)
    x[STD_ATT + 2] = _axis_std(P, c6, c7, c8)
    for i in range(3):
        x[STD_BG + i] = sqrt(P[3 + i, 3 + i])


@kernel
def _axis_std(P: Mat, a: float, b: float, c: float) -> float:
    v = P[0, 0] * a * a + P[1, 1] * b * b + P[2, 2] * c * c
    v += 2.0 * (P[0, 1] * a * b + P[0, 2] * a * c + P[1, 2] * b * c)
    if v < 0.0:  # round-off of a direction known exactly
        v = 0.0
    return sqrt(v)


@kernel
def inject(x: Vec, w: Vec) -> None:
    """Move the error state found into the estimate."""
    advance_attitude(x, w[W_DX], w[W_DX + 1], w[W_DX + 2])
    for i in range(3):
        x[BG + i] += w[W_DX + 3 + i]


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    rx, ry, rz = (wx - x[BG]) * dt, (wy - x[BG + 1]) * dt, (wz - x[BG + 2]) * dt
    advance_attitude(x, rx, ry, rz)
    if x[STARTED] == 0.0:
        x[STARTED] = 1.0
        x[T_ACC] = x[T]
        x[T_MAG] = x[T]
        if todo == START:  # not so if the attitude was given
            reset_attitude(x, P, p)
            write_std(x, P)
            return
    q_theta = p[P_GYR_NOISE] * p[P_GYR_NOISE] * dt
    if (int(x[STATUS]) & (s.SATURATED | s.GYR_STUCK)) != 0:
        q_theta += unseen(p, dt)
    transition(w, rx, ry, rz, dt)
    predict(P, w, q_theta, p[P_BIAS_NOISE] * p[P_BIAS_NOISE] * dt)
    if (int(x[STATUS]) & s.GAP) != 0:
        bridge_gap(x, P, p, dt, has_acc, ax, ay, az)
    if todo == START:  # the first field, or the first after a gap, has just set the heading
        reset_heading(x, P, p[P_STD_HEADING] * p[P_STD_HEADING])
        x[T_MAG] = x[T]
        write_std(x, P)
        return

    for i in range(6):
        w[W_DX + i] = 0.0
    if has_acc and t > x[T_ACC]:
        # At rest f_b points up, so -f_b points down. It is scaled, not normalised: a linear
        # acceleration then adds a zero-mean error, where a normalised one would bend it.
        k = -1.0 / p[P_GRAVITY]
        dx, dy, dz = down_in_body(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        # A sample stands for the time since the last one, but not for what a gap has hidden.
        r = k * k * p[P_ACC_NOISE] * p[P_ACC_NOISE] / min(t - x[T_ACC], p[P_MAX_GAP])
        if not update_direction(P, w, dx, dy, dz, k * ax, k * ay, k * az, r, p[P_GATE]):
            set_status(x, s.ACC_REJECTED)
        x[T_ACC] = t
    if (int(x[STATUS]) & s.MAG_DISTURBED) != 0 and not has_mag:
        x[T_MAG] = t  # the next one does not stand for the time of those left out
    if has_mag and t > x[T_MAG]:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        k = 1.0 / sqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = k * mx, k * my, k * mz
        dx, dy, dz = field_in_body(
            x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz, p[P_COS_D], p[P_SIN_D]
        )
        ux, uy, uz = down_in_body(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        angle = heading_from_mag(x, 0.0, 0.0, 0.0, p[P_COS_D], p[P_SIN_D])
        r = p[P_MAG_NOISE] * p[P_MAG_NOISE] / min(t - x[T_MAG], p[P_MAX_GAP])
        if not isnan(angle):
            if not update_heading(P, w, angle, ux, uy, uz, dx, dy, dz, r, p[P_GATE]):
                set_status(x, s.MAG_REJECTED)
            x[T_MAG] = t
    inject(x, w)
    write_std(x, P)


# fmt: off
@kernel
def run(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat,
) -> None:
    """Loop of `step` over a recording."""
    # fmt: on
    j = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
    load(x, inf, j, t_mag, mag)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
