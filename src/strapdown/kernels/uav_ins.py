"""Inertial navigation behind the multi-mode AHRS. n = NED, b = body.

``P`` holds two covariances that share nothing: of quaternion and gyro bias, 7x7, and from row `PN`
on that of position [m], velocity [m/s], both in n, and accelerometer bias in b [m/s^2]: what is
to be added to the estimate. Section numbers are those of spec D (thesis "micro UAV"), which names
this algorithm but prints (1.2) of it only.
"""

from math import cos, inf, isfinite, isnan, nan, sin, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.mechanise import E2, A
from strapdown.kernels.memory import (
    ALIGNED,
    BA,
    BG,
    FULL,
    GIVEN,
    GNSS,
    LLA,
    OMEGA,
    STATUS,
    STD_ATT,
    STD_BA,
    STD_POS,
    STD_V,
    Q,
    T,
    V,
    load,
    load_events,
    note_sigma,
    post,
    set_status,
    store,
)
from strapdown.kernels.multi_mode_ahrs import D_COURSE, W_COURSE
from strapdown.kernels.multi_mode_ahrs import P_SIZE as AHRS_P_SIZE
from strapdown.kernels.multi_mode_ahrs import W_SIZE as AHRS_W_SIZE
from strapdown.kernels.multi_mode_ahrs import X_SIZE as AHRS_X_SIZE
from strapdown.kernels.multi_mode_ahrs import step as ahrs_step
from strapdown.kernels.quat import dcm
from strapdown.kernels.uav_ahrs import P_GRAVITY

# --- own states of x, after those of the AHRS ---------------------------------------------------
NAVIGATING = AHRS_X_SIZE  # 1 from the first usable fix on
FORCE = AHRS_X_SIZE + 1  # last specific force [m/s^2]: 3; NaN: none yet
R_N = AHRS_X_SIZE + 4  # metres per radian of latitude
R_E = AHRS_X_SIZE + 5  # metres per radian of longitude
X_SIZE = AHRS_X_SIZE + 6

# --- own parameters ------------------------------------------------------------------------
P_FORCE_NOISE = AHRS_P_SIZE  # [m/s^2/sqrt(Hz)]
P_WALK = AHRS_P_SIZE + 1  # of the accelerometer's bias [m/s^2/sqrt(s)]
P_TILT_TIME = AHRS_P_SIZE + 2  # correlation time of errors of attitude [s]
P_STD_BIAS = AHRS_P_SIZE + 3  # of the accelerometer's bias at the start [m/s^2]
P_FIX_POSITION = AHRS_P_SIZE + 4  # where the receiver states none [m]
P_FIX_VELOCITY = AHRS_P_SIZE + 5  # [m/s]
P_FIX_GATE = AHRS_P_SIZE + 6  # [sigma]
P_SIZE = AHRS_P_SIZE + 7

# --- own scratch -----------------------------------------------------------------------------
W_DX = AHRS_W_SIZE  # correction found so far: 9
W_PH = AHRS_W_SIZE + 9  # P h: 9
W_C = AHRS_W_SIZE + 18  # C_nb at the middle of the interval: 9
W_FIX = AHRS_W_SIZE + 27  # diagnostics of a fix: innovation 3, sigma 3, outcome, twice
W_SIZE = AHRS_W_SIZE + 41

PN = 7  # first row of the navigation's covariance
D_FIX = D_COURSE + 7  # where the fix stands in a row of the diagnostics
LEAST_COSINE = 1e-5  # 64 m from the pole
HALF_PI = 1.5707963267948966
PI = 3.141592653589793


@kernel
def radii(x: Vec) -> None:
    """Renew R_m + h and (R_n + h) cos(lat) of (1.2); keep longitude within half a turn."""
    x[LLA] = min(max(x[LLA], -HALF_PI), HALF_PI)
    if x[LLA + 1] > PI:
        x[LLA + 1] -= 2.0 * PI
    if x[LLA + 1] <= -PI:
        x[LLA + 1] += 2.0 * PI
    sine = sin(x[LLA])
    d = 1.0 - E2 * sine * sine
    across = A / sqrt(d)
    x[R_N] = (1.0 - E2) * across / d + x[LLA + 2]
    x[R_E] = (across + x[LLA + 2]) * max(cos(x[LLA]), LEAST_COSINE)


@kernel
def middle(x: Vec, w: Vec, dt: float) -> None:
    """Write C_nb of the middle of the interval that ends now."""
    hx, hy, hz = x[OMEGA] - x[BG], x[OMEGA + 1] - x[BG + 1], x[OMEGA + 2] - x[BG + 2]
    k = 0.5 * dt
    if (hx * hx + hy * hy + hz * hz) * k * k > 0.25:  # no turn to go back by to first order
        k = 0.0
    hx, hy, hz = k * hx, k * hy, k * hz
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    # C (I - [h x])
    w[W_C] = c0 - (c1 * hz - c2 * hy)
    w[W_C + 1] = c1 - (c2 * hx - c0 * hz)
    w[W_C + 2] = c2 - (c0 * hy - c1 * hx)
    w[W_C + 3] = c3 - (c4 * hz - c5 * hy)
    w[W_C + 4] = c4 - (c5 * hx - c3 * hz)
    w[W_C + 5] = c5 - (c3 * hy - c4 * hx)
    w[W_C + 6] = c6 - (c7 * hz - c8 * hy)
    w[W_C + 7] = c7 - (c8 * hx - c6 * hz)
    w[W_C + 8] = c8 - (c6 * hy - c7 * hx)


@kernel
def mechanise(x: Vec, p: Vec, w: Vec, dt: float) -> None:
    """Velocity and position over one interval: ``v' = C_nb (f_b - b_a) + g``, and (1.2)."""
    fx, fy, fz = x[FORCE] - x[BA], x[FORCE + 1] - x[BA + 1], x[FORCE + 2] - x[BA + 2]
    half = 0.5 * dt
    for i in range(3):
        a = w[W_C + 3 * i] * fx + w[W_C + 3 * i + 1] * fy + w[W_C + 3 * i + 2] * fz
        if i == 2:
            a += p[P_GRAVITY]
        way = (x[V + i] + half * a) * dt
        x[V + i] += a * dt
        if i == 0:
            x[LLA] += way / x[R_N]
        elif i == 1:
            x[LLA + 1] += way / x[R_E]
        else:
            x[LLA + 2] -= way
    radii(x)


@kernel
def spread(P: Mat, w: Vec, dt: float) -> None:
    """``P <- F P F^T``: position follows velocity, velocity minus C_nb times the bias."""
    half = 0.5 * dt
    for i in range(3):
        c0, c1, c2 = dt * w[W_C + 3 * i], dt * w[W_C + 3 * i + 1], dt * w[W_C + 3 * i + 2]
        for j in range(PN, PN + 9):
            pulled = c0 * P[PN + 6, j] + c1 * P[PN + 7, j] + c2 * P[PN + 8, j]
            P[PN + i, j] += dt * P[PN + 3 + i, j] - half * pulled
            P[PN + 3 + i, j] -= pulled
    for i in range(3):
        c0, c1, c2 = dt * w[W_C + 3 * i], dt * w[W_C + 3 * i + 1], dt * w[W_C + 3 * i + 2]
        for j in range(PN, PN + 9):
            pulled = c0 * P[j, PN + 6] + c1 * P[j, PN + 7] + c2 * P[j, PN + 8]
            P[j, PN + i] += dt * P[j, PN + 3 + i] - half * pulled
            P[j, PN + 3 + i] -= pulled
    for i in range(PN, PN + 9):  # both passes round differently
        for j in range(PN, i):
            P[j, i] = P[i, j]


@kernel
def predict(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Covariance over one interval.

    An error of tilt turns gravity into an acceleration g times as large. It lasts: its density is
    ``2 tau g^2 sigma^2``, with the sigma that the AHRS states. Heading turns the horizontal force.
    """
    spread(P, w, dt)
    white = p[P_FORCE_NOISE] * p[P_FORCE_NOISE]
    lasts = 2.0 * p[P_TILT_TIME]
    g2 = p[P_GRAVITY] * p[P_GRAVITY]
    north, east = 0.0, 0.0  # horizontal force
    for i in range(3):
        north += w[W_C + i] * (x[FORCE + i] - x[BA + i])
        east += w[W_C + 3 + i] * (x[FORCE + i] - x[BA + i])
    yaw2 = x[STD_ATT + 2] * x[STD_ATT + 2]
    for i in range(3):
        q = white
        if i == 0:
            q += lasts * (g2 * x[STD_ATT + 1] * x[STD_ATT + 1] + east * east * yaw2)
        elif i == 1:
            q += lasts * (g2 * x[STD_ATT] * x[STD_ATT] + north * north * yaw2)
        P[PN + 3 + i, PN + 3 + i] += q * dt
        P[PN + i, PN + i] += q * dt * dt * dt / 3.0
        P[PN + i, PN + 3 + i] += 0.5 * q * dt * dt
        P[PN + 3 + i, PN + i] = P[PN + i, PN + 3 + i]
        P[PN + 6 + i, PN + 6 + i] += p[P_WALK] * p[P_WALK] * dt


@kernel
def variance(x: Vec, cell: int, usual: float) -> float:
    """Variance of a component of the fix: the receiver's, where it states one."""
    std = x[cell]
    if not (std > 0.0 and std < 1e4):
        std = usual
    return float(std * std)


@kernel
def begin(x: Vec, P: Mat, p: Vec) -> None:
    """Start at the fix in the inbox; without a velocity it may stand or fly."""
    moving = isfinite(x[GNSS + 5] + x[GNSS + 6] + x[GNSS + 7])
    for i in range(9):
        for j in range(9):
            P[PN + i, PN + j] = 0.0
    for i in range(3):
        x[LLA + i] = x[GNSS + 2 + i]
        x[V + i] = x[GNSS + 5 + i] if moving else 0.0
        P[PN + i, PN + i] = variance(x, GNSS + 8 + i, p[P_FIX_POSITION])
        P[PN + 3 + i, PN + 3 + i] = 100.0
        if moving:
            P[PN + 3 + i, PN + 3 + i] = variance(x, GNSS + 11 + i, p[P_FIX_VELOCITY])
        P[PN + 6 + i, PN + 6 + i] = p[P_STD_BIAS] * p[P_STD_BIAS]
    radii(x)
    x[NAVIGATING] = 1.0


@kernel
def enter(P: Mat, w: Vec, k: int, innovation: float, r: float, gate: float) -> bool:
    """Enter a measurement of component k in Joseph form; beyond the gate it is weighted down."""
    for i in range(9):
        w[W_PH + i] = P[PN + i, PN + k]
    left = innovation - w[W_DX + k]
    expected = w[W_PH + k] + r
    used = expected
    accepted = left * left <= gate * gate * expected
    if not accepted:
        used = left * left / (gate * gate)
    cell = W_FIX if k < 3 else W_FIX + 7
    note_sigma(w, cell, k % 3, left, expected)
    if not accepted:
        w[cell + 6] = s.REJECTED_GATE
    for i in range(9):
        gain_i = w[W_PH + i] / used
        w[W_DX + i] += gain_i * left
        for j in range(i + 1):
            gain_j = w[W_PH + j] / used
            v = P[PN + i, PN + j] - gain_i * w[W_PH + j] - w[W_PH + i] * gain_j
            v += gain_i * used * gain_j
            P[PN + i, PN + j] = v
            P[PN + j, PN + i] = v
    return bool(accepted)


@kernel
def residual(x: Vec, i: int, late: float) -> float:
    """Fix less INS at the time of the fix, component i of position and then velocity."""
    left = nan
    if i == 0:
        left = (x[GNSS + 2] - x[LLA]) * x[R_N] + x[V] * late
    elif i == 1:
        turn = x[GNSS + 3] - x[LLA + 1]
        if turn > PI:
            turn -= 2.0 * PI
        if turn < -PI:
            turn += 2.0 * PI
        left = turn * x[R_E] + x[V + 1] * late
    elif i == 2:
        left = x[LLA + 2] - x[GNSS + 4] + x[V + 2] * late
    else:
        left = x[GNSS + 2 + i] - x[V + i - 3]
    return float(left)


@kernel
def take_fix(x: Vec, P: Mat, p: Vec, w: Vec, t: float) -> None:
    """Correct position, velocity and accelerometer bias by the fix in the inbox."""
    late = min(max(t - x[GNSS + 1], 0.0), 1.0)
    for i in range(9):
        w[W_DX + i] = 0.0
    accepted = True
    for k in range(6):
        cell = W_FIX if k < 3 else W_FIX + 7
        left = residual(x, k, late)
        if isfinite(left):
            w[cell + 6] = max(w[cell + 6], float(s.ACCEPTED))
            usual = p[P_FIX_POSITION] if k < 3 else p[P_FIX_VELOCITY]
            r = variance(x, GNSS + 8 + k, usual)
            ok = enter(P, w, k, left, r, p[P_FIX_GATE])
            accepted = accepted and ok
    if not accepted:
        set_status(x, s.AIDING_REJECTED)
    x[LLA] += w[W_DX] / x[R_N]
    x[LLA + 1] += w[W_DX + 1] / x[R_E]
    x[LLA + 2] -= w[W_DX + 2]
    for i in range(3):
        x[V + i] += w[W_DX + 3 + i]
        x[BA + i] += w[W_DX + 6 + i]
    radii(x)


@kernel
def write_std(x: Vec, P: Mat) -> None:
    """Write the standard deviations of position, velocity and accelerometer bias."""
    for i in range(3):
        x[STD_POS + i] = sqrt(P[PN + i, PN + i])
        x[STD_V + i] = sqrt(P[PN + 3 + i, PN + 3 + i])
        x[STD_BA + i] = sqrt(P[PN + 6 + i, PN + 6 + i])


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    before = x[T]
    waiting = x[GNSS] > 0.0
    w[W_FIX + 6] = s.NOT_MEASURED
    w[W_FIX + 13] = s.NOT_MEASURED
    ahrs_step(x, P, p, w, t, gx, gy, gz, ax, ay, az)
    bits = int(x[STATUS])
    if (bits & s.GYR_INVALID) != 0:  # nothing is known of this interval yet
        return
    if isfinite(ax + ay + az) and (bits & (s.ACC_INVALID | s.SATURATED)) == 0:
        x[FORCE], x[FORCE + 1], x[FORCE + 2] = ax, ay, az
    dt = 0.0
    if not isnan(before):
        dt = t - before
    if x[NAVIGATING] > 0.0 and dt > 0.0:
        middle(x, w, dt)
        if (bits & s.GAP) != 0:  # it flies on; what turned and pushed it was not seen
            x[LLA] += x[V] * dt / x[R_N]
            x[LLA + 1] += x[V + 1] * dt / x[R_E]
            x[LLA + 2] -= x[V + 2] * dt
            spread(P, w, dt)
            unseen = min(p[P_GRAVITY] * dt, 1e3)
            for i in range(3):
                P[PN + 3 + i, PN + 3 + i] += unseen * unseen
                P[PN + i, PN + i] += 0.25 * unseen * unseen * dt * dt
        else:
            mechanise(x, p, w, dt)
            predict(x, P, p, w, dt)
    known = isfinite(x[GNSS + 2] + x[GNSS + 3] + x[GNSS + 4])
    known = known and abs(x[GNSS + 2]) <= HALF_PI and abs(x[GNSS + 4]) < 1e5
    # the AHRS has taken the fix out of the inbox, but its numbers are there still
    if waiting and x[GNSS] == 0.0 and known:
        if x[NAVIGATING] > 0.0:
            take_fix(x, P, p, w, t)
        elif (x[ALIGNED] == FULL or x[ALIGNED] == GIVEN) and not isnan(x[FORCE]):
            begin(x, P, p)
    if x[NAVIGATING] > 0.0:
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
    e = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        e = load_events(x, t[k], e, events)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
        if out_diag.shape[0] > 0:
            for i in range(7):
                out_diag[k, D_COURSE + i] = w[W_COURSE + i]
            for i in range(14):
                out_diag[k, D_FIX + i] = w[W_FIX + i]
    load(x, inf, j, t_mag, mag)
    load_events(x, inf, e, events)


@kernel
def update(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec
) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
