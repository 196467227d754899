"""Robust error-state Kalman filter of attitude. Frames: n = NED, b = body.

Every sample turns the attitude and adds to the sums of the open interval. About ten times a
second the interval is closed: its sums propagate the covariance, and three measurements enter,
one scalar at a time: the velocity, which stays bounded; at rest the rates, which are the
gyro's bias; and the direction of the horizontal magnetic field.
"""

from math import inf, isinf, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    BA,
    BG,
    DT,
    MAG,
    P_GYR_RANGE,
    SKIP,
    START,
    STATUS,
    STD_ATT,
    STD_BA,
    STD_BG,
    STUCK,
    STUCK_TIME,
    WIDEN,
    Q,
    T,
    V,
    begin,
    load,
    post,
    set_status,
    store,
)
from strapdown.kernels.quat import dcm, exp, mul
from strapdown.kernels.robust_eskf_covariance import (
    C_DT,
    DV,
    EBA,
    EBG,
    EMG,
    LAG,
    PHI,
    TAU,
    THETA,
    N,
    forget,
)
from strapdown.kernels.robust_eskf_layout import (
    ACC_HELD,
    ACC_MEAN,
    ATT,
    DRIFT,
    EXTRA,
    FIELD,
    FLAGS,
    GYR_MEAN,
    HAS_HELD,
    LARGEST,
    LAST_GYR,
    LEVEL_LEFT,
    MG,
    OPEN,
    P_ACC_BIAS_STD,
    P_FIELD_STD,
    P_GRAVITY,
    P_GYR_BIAS_STD,
    P_GYR_SCALE_STD,
    P_INTERVAL,
    P_LATENCY,
    P_MAG_DELAY_STD,
    P_RATE_WALK,
    P_REST_ACC,
    P_REST_GYR,
    P_TIMING_STD,
    QUIET,
    REPEATED,
    STARTED,
    USUAL,
)
from strapdown.kernels.robust_eskf_layout import W_SIZE as W_SIZE
from strapdown.kernels.robust_eskf_level import level_anew, level_on, start, turn_to_first_field
from strapdown.kernels.robust_eskf_update import LOW_PASS, close_interval

MIN_RATE = 0.035  # a mean rate below 2 deg/s may be rest [rad/s]
LOST = 10.0  # deviations of the mean velocity that no motion explains
CLIPPED_RATE = 0.5  # the largest rate so far, if above this [rad/s] and ...
CLIPPED_COUNT = 3.0  # ... repeated so often to the last bit, is the end of the range
CLIPPED_TIME = 0.25  # how long an unseen rate lasts [s]


@kernel
def init(x: Vec, P: Mat, p: Vec) -> None:
    """Write what is known of the errors before the first sample."""
    for i in range(N):
        for j in range(N):
            P[i, j] = 0.0
    for i in range(3):
        P[EBG + i, EBG + i] = p[P_GYR_BIAS_STD] * p[P_GYR_BIAS_STD]
        P[EBA + i, EBA + i] = p[P_ACC_BIAS_STD] * p[P_ACC_BIAS_STD]
        x[STD_BG + i] = p[P_GYR_BIAS_STD]
        x[STD_BA + i] = p[P_ACC_BIAS_STD]
    for i in range(9):
        P[EMG + i, EMG + i] = p[P_GYR_SCALE_STD] * p[P_GYR_SCALE_STD]
    P[LAG, LAG] = p[P_MAG_DELAY_STD] * p[P_MAG_DELAY_STD]


@kernel
def _is_clipped(x: Vec, p: Vec, gx: float, gy: float, gz: float) -> bool:
    """Whether the gyro is at the end of its range, declared or shown by repeated extremes."""
    top = max(abs(gx), max(abs(gy), abs(gz)))
    repeated = (
        (gx == x[LAST_GYR] and abs(gx) == top)
        or (gy == x[LAST_GYR + 1] and abs(gy) == top)
        or (gz == x[LAST_GYR + 2] and abs(gz) == top)
    )
    x[LARGEST] = max(x[LARGEST], top)
    if repeated and top == x[LARGEST]:
        x[REPEATED] += 1.0
    else:
        x[REPEATED] = 0.0
    x[LAST_GYR], x[LAST_GYR + 1], x[LAST_GYR + 2] = gx, gy, gz
    clipped = False
    if top >= p[P_GYR_RANGE] or (top > CLIPPED_RATE and x[REPEATED] >= CLIPPED_COUNT):
        clipped = True
    return clipped


# fmt: off
@kernel
def _note_rest(
    x: Vec, p: Vec, dt: float, gx: float, gy: float, gz: float, has_acc: bool,
    ax: float, ay: float, az: float,
) -> None:
    """How long both sensors have stayed near their mean, with a mean rate that may be a bias."""
    # fmt: on
    k = dt / (LOW_PASS + dt)
    dx, dy, dz = gx - x[GYR_MEAN], gy - x[GYR_MEAN + 1], gz - x[GYR_MEAN + 2]
    x[GYR_MEAN] += k * dx
    x[GYR_MEAN + 1] += k * dy
    x[GYR_MEAN + 2] += k * dz
    quiet = dx * dx + dy * dy + dz * dz < p[P_REST_GYR] * p[P_REST_GYR]
    if has_acc:
        dx, dy, dz = ax - x[ACC_MEAN], ay - x[ACC_MEAN + 1], az - x[ACC_MEAN + 2]
        x[ACC_MEAN] += k * dx
        x[ACC_MEAN + 1] += k * dy
        x[ACC_MEAN + 2] += k * dz
        quiet = quiet and dx * dx + dy * dy + dz * dz < p[P_REST_ACC] * p[P_REST_ACC]
    limit = MIN_RATE + 4.0 * max(x[STD_BG], max(x[STD_BG + 1], x[STD_BG + 2]))
    dx, dy, dz = x[GYR_MEAN] - x[BG], x[GYR_MEAN + 1] - x[BG + 1], x[GYR_MEAN + 2] - x[BG + 2]
    if quiet and abs(dx) < limit and abs(dy) < limit and abs(dz) < limit:
        x[QUIET] += dt
    else:
        x[QUIET] = 0.0


# fmt: off
@kernel
def _publish(
    x: Vec, P: Mat, p: Vec, omega_n: float, omega_e: float,
    rx: float, ry: float, rz: float,
) -> None:
    """Attitude at the time of the sample plus the latency, and its deviations.

    `omega_n` and `omega_e` turn an unknown shift in time into tilt; ``(rx, ry, rz)`` is the
    rate in b.
    """
    # fmt: on
    q0, q1, q2, q3 = x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3]
    k = p[P_LATENCY]
    if k != 0.0:
        e0, e1, e2, e3 = exp(k * rx, k * ry, k * rz)
        q0, q1, q2, q3 = mul(q0, q1, q2, q3, e0, e1, e2, e3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q0, q1, q2, q3
    k = p[P_TIMING_STD] * p[P_TIMING_STD]
    x[STD_ATT] = sqrt(P[PHI, PHI] + k * omega_n * omega_n)
    x[STD_ATT + 1] = sqrt(P[PHI + 1, PHI + 1] + k * omega_e * omega_e)
    k = p[P_FIELD_STD] * p[P_FIELD_STD] if x[USUAL + 2] > 0.0 else 0.0
    x[STD_ATT + 2] = sqrt(P[PHI + 2, PHI + 2] + k)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance by one sample."""
    # fmt: on
    if x[STARTED] > 0.0:  # without the latency
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3]
    before = x[T]
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        if x[STARTED] > 0.0:
            _publish(x, P, p, 0.0, 0.0, 0.0, 0.0, 0.0)
        return
    new_rate = not isinf(gx)
    if not new_rate:
        gx, gy, gz = wx, wy, wz
    held = isinf(ax) and x[HAS_HELD] > 0.0  # no sample, as against a bad one
    if has_acc:
        x[ACC_HELD], x[ACC_HELD + 1], x[ACC_HELD + 2] = ax, ay, az
        x[HAS_HELD] = 1.0
    else:
        ax, ay, az = x[ACC_HELD], x[ACC_HELD + 1], x[ACC_HELD + 2]
    if x[STARTED] == 0.0:
        start(x, P, p, w, has_acc, has_mag, ax, ay, az)
        x[GYR_MEAN], x[GYR_MEAN + 1], x[GYR_MEAN + 2] = gx, gy, gz
        x[ACC_MEAN], x[ACC_MEAN + 1], x[ACC_MEAN + 2] = ax, ay, az
        before = t
        dt = 0.0
    elif todo == START:
        turn_to_first_field(x, P, w)
    if todo == WIDEN:
        level_anew(x, P, p, w, has_acc, ax, ay, az)
        k = p[P_RATE_WALK]
        P[PHI + 2, PHI + 2] += k * k * dt * dt * dt / 12.0
        if P[PHI + 2, PHI + 2] > 1.0:
            forget(P, PHI + 2, 1.0)
        dt = 0.0

    # attitude: scale and misalignment are those of the rate less its bias
    rx, ry, rz = wx - x[BG], wy - x[BG + 1], wz - x[BG + 2]
    dx = rx + x[MG] * rx + x[MG + 1] * ry + x[MG + 2] * rz
    dy = ry + x[MG + 3] * rx + x[MG + 4] * ry + x[MG + 5] * rz
    dz = rz + x[MG + 6] * rx + x[MG + 7] * ry + x[MG + 8] * rz
    e0, e1, e2, e3 = exp(dt * dx, dt * dy, dt * dz)
    q0, q1, q2, q3 = mul(x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3], e0, e1, e2, e3)
    k = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)  # 1 / norm, which is 1 to round-off
    q0, q1, q2, q3 = k * q0, k * q1, k * q2, k * q3
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = q0, q1, q2, q3
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm(q0, q1, q2, q3)
    omega_n = c11 * dx + c12 * dy + c13 * dz
    omega_e = c21 * dx + c22 * dy + c23 * dz

    # specific force; unknown it is taken to be gravity's, with much noise
    fx, fy, fz = 0.0, 0.0, -p[P_GRAVITY]
    if has_acc or held:
        bx, by, bz = ax - x[BA], ay - x[BA + 1], az - x[BA + 2]
        fx = c11 * bx + c12 * by + c13 * bz
        fy = c21 * bx + c22 * by + c23 * bz
        fz = c31 * bx + c32 * by + c33 * bz
    else:
        x[EXTRA + 1] += dt
    x[OPEN + C_DT] += dt * c11
    x[OPEN + C_DT + 1] += dt * c12
    x[OPEN + C_DT + 2] += dt * c13
    x[OPEN + C_DT + 3] += dt * c21
    x[OPEN + C_DT + 4] += dt * c22
    x[OPEN + C_DT + 5] += dt * c23
    x[OPEN + C_DT + 6] += dt * c31
    x[OPEN + C_DT + 7] += dt * c32
    x[OPEN + C_DT + 8] += dt * c33
    x[OPEN + THETA] += dt * dx
    x[OPEN + THETA + 1] += dt * dy
    x[OPEN + THETA + 2] += dt * dz
    x[OPEN + DV] += dt * fx
    x[OPEN + DV + 1] += dt * fy
    x[OPEN + DV + 2] += dt * fz
    x[OPEN + TAU] += dt
    x[V] += dt * fx
    x[V + 1] += dt * fy
    x[V + 2] += dt * (fz + p[P_GRAVITY])

    missing = dt - x[DT]
    if missing > 0.5 * x[DT]:  # variance of a random walk of the rate between its two ends
        x[EXTRA] += p[P_RATE_WALK] * p[P_RATE_WALK] * missing * missing * missing / 12.0
    if new_rate and _is_clipped(x, p, gx, gy, gz):  # the rate may be much higher
        x[EXTRA] += CLIPPED_TIME * dt * (gx * gx + gy * gy + gz * gz)
        set_status(x, s.SATURATED)
    elif (int(x[STATUS]) & s.GYR_STUCK) != 0:  # the rate has walked away unseen
        k = p[P_RATE_WALK] * min(STUCK_TIME - x[STUCK], CLIPPED_TIME)
        x[EXTRA] += k * k * dt

    if has_mag:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        omega_d = c31 * dx + c32 * dy + c33 * dz
        hx = c11 * mx + c12 * my + c13 * mz
        hy = c21 * mx + c22 * my + c23 * mz
        hz = c31 * mx + c32 * my + c33 * mz
        x[FIELD] += hx
        x[FIELD + 1] += hy
        x[FIELD + 2] += hz
        x[FIELD + 3] += omega_e * hz - omega_d * hy
        x[FIELD + 4] += omega_d * hx - omega_n * hz
        x[FIELD + 5] += 1.0

    _note_rest(x, p, t - before, gx, gy, gz, has_acc, ax, ay, az)
    if x[OPEN + TAU] >= p[P_INTERVAL] and x[LEVEL_LEFT] > 0.0:
        level_on(x, P, p, w)
    elif x[OPEN + TAU] >= p[P_INTERVAL]:
        close_interval(x, P, p, w)
        k = x[DRIFT] * x[DRIFT] + x[DRIFT + 1] * x[DRIFT + 1] + x[DRIFT + 2] * x[DRIFT + 2]
        if k > LOST * LOST and has_acc:
            level_anew(x, P, p, w, True, ax, ay, az)
    set_status(x, int(x[FLAGS]))
    _publish(x, P, p, omega_n, omega_e, dx, dy, dz)


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
