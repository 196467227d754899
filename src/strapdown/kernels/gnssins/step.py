"""Thesis E's system, one IMU sample at a time; with or without the position filter."""

from math import inf, isfinite, isinf, nan, pi, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.gnssins.attitude import (
    add_noise,
    bound,
    predict,
    reset_covariance,
    write_std,
)
from strapdown.kernels.gnssins.compensation import compensate
from strapdown.kernels.gnssins.control import observe, parameters_of, trigger, wants_trigger
from strapdown.kernels.gnssins.fix import (
    begin_navigation,
    earth_here,
    possible,
    propagate,
    shift,
    take_fix,
    take_motion,
    usable,
)
from strapdown.kernels.gnssins.fix import write_std as write_position_std
from strapdown.kernels.gnssins.layout import (
    ACC_ERROR,
    CRONO,
    FIX_AGE,
    FIX_LLA,
    FIX_V,
    GPS_OFF,
    GRAVITY,
    LAST_F,
    MAG_AGE,
    MEAN_F,
    MEAN_G,
    MODE,
    N_FIX,
    N_ROW,
    NAVIGATING,
    P_ACC,
    P_AT_TRIGGER,
    P_BIAS_VAR,
    P_EULER,
    P_GAP_RATE,
    P_GYR,
    P_GYR_VAR,
    P_LAW,
    P_NULL,
    P_PERIOD,
    P_QUIET_TIME,
    P_RECOVER,
    P_STATES,
    P_TKF,
    P_VAR_Q,
    Q_KEPT,
    QUIET,
    REFUSED,
    SINCE_FIX,
    SINCE_PV,
    SINCE_TRG,
    SLOW_F,
    TEMP,
    W_FIX,
    W_NEW,
    W_ROW,
)
from strapdown.kernels.gnssins.layout import W_SIZE as LAYOUT_W_SIZE
from strapdown.kernels.gnssins.quaternion import (
    step_first_order,
    transition_series,
    transition_step,
    write_d,
    write_f,
)
from strapdown.kernels.memory import (
    ALIGNED,
    BA,
    BG,
    DT,
    GNSS,
    GO,
    LLA,
    NO,
    P_ACC_RANGE,
    P_GYR_RANGE,
    P_MAX_GAP,
    SKIP,
    START,
    STATUS,
    STD_POS,
    STD_V,
    TILT,
    WIDEN,
    Q,
    V,
    begin,
    load,
    load_events,
    post,
    set_status,
)
from strapdown.kernels.quat import exp, mul, normalize, rotate

LONGEST = 6.0  # beyond this F T the series is none
TERMS = 12  # of the series of exp(F T); 3 rad/s over 1 s leave 1.5^13 / 13! = 3e-8
W_SIZE = LAYOUT_W_SIZE


# fmt: off
@kernel
def integrate(
    x: Vec, P: Mat, p: Vec, w: Vec, mode: int, dt: float, wx: float, wy: float, wz: float
) -> None:
    """Advance the attitude by one sample, normalised, and its covariance if it is due."""
    # fmt: on
    a, b, c, d = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    ew, ex, ey, ez = exp(wx * dt, wy * dt, wz * dt)
    if p[P_EULER] > 0.0:
        a1, b1, c1, d1 = step_first_order(a, b, c, d, wx, wy, wz, dt, p[P_EULER])
    else:
        a1, b1, c1, d1 = mul(a, b, c, d, ew, ex, ey, ez)
    a1, b1, c1, d1 = normalize(a1, b1, c1, d1)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = a1, b1, c1, d1
    if p[P_AT_TRIGGER] == 0.0:
        transition_step(w, a1, b1, c1, d1, ew, ex, ey, ez, dt)
        predict(P, w)
        add_noise(P, a1, b1, c1, d1, p[P_GYR_VAR + mode] * dt, p[P_BIAS_VAR + mode] * dt)
        bound(x, P, w)


@kernel
def propagate_as_printed(
    x: Vec, P: Mat, p: Vec, w: Vec, mode: int, wx: float, wy: float, wz: float
) -> None:
    """Covariance over the whole period, by F and D of now, (7.2.28) and (7.2.30)."""
    a, b, c, d = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    dt = x[SINCE_TRG]
    if dt * (0.5 * sqrt(wx * wx + wy * wy + wz * wz) + p[P_LAW]) > LONGEST:
        reset_covariance(x, P, w, a, b, c, d, 1.0, True)  # the attitude may be any
        return
    write_f(w, a, b, c, d, wx, wy, wz, p[P_LAW])
    write_d(w, a, b, c, d)
    transition_series(w, dt, TERMS)
    predict(P, w)
    add_noise(P, a, b, c, d, p[P_GYR_VAR + mode] * dt, p[P_BIAS_VAR + mode] * dt)
    bound(x, P, w)


@kernel
def widen(x: Vec, P: Mat, p: Vec, dt: float) -> None:
    """Let in what may have been turned unseen; a measurement that is far off is then right."""
    x[REFUSED] = p[P_RECOVER]
    unknown = p[P_GAP_RATE] * dt
    add_noise(P, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], min(unknown * unknown, pi * pi), 0.0)


@kernel
def move(x: Vec, dt: float, fx: float, fy: float, fz: float) -> None:
    """Advance velocity and position: flat, non-rotating Earth, uniform acceleration, (7.7.9)."""
    ax, ay, az = rotate(
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3], fx - x[BA], fy - x[BA + 1], fz - x[BA + 2]
    )
    ax += x[ACC_ERROR]
    ay += x[ACC_ERROR + 1]
    az += x[ACC_ERROR + 2] + x[GRAVITY]
    shift(x, dt, 0.5 * ax * dt, 0.5 * ay * dt, 0.5 * az * dt)
    x[V] += ax * dt
    x[V + 1] += ay * dt
    x[V + 2] += az * dt


@kernel
def navigate(
    x: Vec, P: Mat, p: Vec, w: Vec, dt: float, fresh: bool, fx: float, fy: float, fz: float
) -> None:
    """Position and velocity: double integration, and the filter at each fix."""
    if x[NAVIGATING] > 0.0:
        if dt <= p[P_MAX_GAP]:
            move(x, dt, fx, fy, fz)
        else:  # nothing is known of the gap but the velocity
            shift(x, dt, 0.0, 0.0, 0.0)
        x[SINCE_PV] += dt
        x[SINCE_FIX] += dt
        if fresh:
            take_fix(x, P, p, w)
        elif x[SINCE_PV] >= p[P_PERIOD] - 0.5 * dt:
            propagate(x, P, p)
            earth_here(x)
        if not possible(x):
            for i in range(3):
                x[BA + i] = 0.0
            begin_navigation(x, P, p)
        write_position_std(x, P, p)
    elif fresh:
        for i in range(3):  # nothing but the fix is known
            x[LLA + i] = x[FIX_LLA + i]
            x[V + i] = x[FIX_V + i] if isfinite(x[FIX_V + i]) else nan
            x[STD_POS + i] = x[GNSS + 8 + i]
            x[STD_V + i] = x[GNSS + 11 + i]
        if x[ALIGNED] != NO and x[ALIGNED] != TILT:
            begin_navigation(x, P, p)
            write_position_std(x, P, p)


@kernel
def say(x: Vec, p: Vec) -> None:
    """Add the mode to the status; before navigation begins the attitude said is the identity."""
    if x[QUIET] >= p[P_QUIET_TIME]:
        set_status(x, s.REST)
    seen = not isinf(x[FIX_AGE])
    if p[P_STATES] > 0.0:
        if x[NAVIGATING] == 0.0:
            set_status(x, s.ALIGNING)
            x[Q_KEPT] = 1.0
            for i in range(4):
                x[Q_KEPT + 1 + i] = x[Q + i]
                x[Q + i] = 1.0 if i == 0 else 0.0
        elif x[MODE] == GPS_OFF:
            set_status(x, s.OUTAGE)
    elif seen and x[MODE] == GPS_OFF:
        set_status(x, s.OUTAGE)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    w[W_NEW] = 0.0
    w[W_NEW + 1] = 0.0
    if x[Q_KEPT] > 0.0:
        for i in range(4):
            x[Q + i] = x[Q_KEPT + 1 + i]
        x[Q_KEPT] = 0.0
    gx, gy, gz = compensate(p, P_GYR, p[P_GYR_RANGE], x[TEMP], x[TEMP + 1], gx, gy, gz)
    ax, ay, az = compensate(p, P_ACC, p[P_ACC_RANGE], x[TEMP], x[TEMP + 1], ax, ay, az)
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        say(x, p)
        return
    fresh = False
    if x[GNSS] > 0.0:
        fresh = usable(x)
        if fresh:
            take_motion(x, p)
        else:
            set_status(x, s.AIDING_REJECTED)
        x[GNSS] = 0.0
    x[MAG_AGE] += dt
    if has_mag:
        x[MAG_AGE] = 0.0
    bx, by, bz = x[BG], x[BG + 1], x[BG + 2]
    if p[P_NULL] > 0.0 and x[CRONO] < p[P_TKF]:
        bx, by, bz = 0.0, 0.0, 0.0
    if not has_acc:
        ax, ay, az = x[LAST_F], x[LAST_F + 1], x[LAST_F + 2]
    x[LAST_F], x[LAST_F + 1], x[LAST_F + 2] = ax, ay, az
    fx, fy, fz = ax - x[BA], ay - x[BA + 1], az - x[BA + 2]
    if todo == START or dt == 0.0:
        x[MEAN_G], x[MEAN_G + 1], x[MEAN_G + 2] = wx, wy, wz
        x[MEAN_F], x[MEAN_F + 1], x[MEAN_F + 2] = fx, fy, fz
        x[SLOW_F], x[SLOW_F + 1], x[SLOW_F + 2] = fx, fy, fz
    observe(x, p, dt, wx, wy, wz, fx, fy, fz)
    mode = parameters_of(x, p)
    integrate(x, P, p, w, mode, dt, wx - bx, wy - by, wz - bz)
    if todo == WIDEN or (int(x[STATUS]) & s.SATURATED) != 0:
        widen(x, P, p, dt)
    if todo == START:
        reset_covariance(x, P, w, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], p[P_VAR_Q], True)
        x[CRONO] = 0.0
    elif todo == GO and wants_trigger(x, p, has_acc, has_mag, x[DT]):
        if p[P_AT_TRIGGER] > 0.0:
            propagate_as_printed(x, P, p, w, mode, wx - bx, wy - by, wz - bz)
        trigger(x, P, p, w, has_mag, wx, wy, wz, fx, fy, fz)
    write_std(x, P, w)
    if p[P_STATES] > 0.0:
        navigate(x, P, p, w, dt, fresh, ax, ay, az)
    say(x, p)


@kernel
def note(t: float, w: Vec, cell: int, count: int, row: int, out: Mat) -> int:
    """Write a row of diagnostics, the time first; returns the next row."""
    if row >= out.shape[0]:
        return row
    out[row, 0] = t
    for i in range(N_ROW + N_FIX):
        out[row, 1 + i] = nan
    for i in range(count):
        out[row, 1 + cell - W_ROW + i] = w[cell + i]
    return row + 1


# fmt: off
@kernel
def run(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat,
) -> None:
    """Loop of `step`; `out_diag` has room for each run of a filter, or none at all."""
    # fmt: on
    j = 0
    e = 0
    row = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        e = load_events(x, t[k], e, events)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        for i in range(out.shape[1]):
            out[k, i] = x[STATUS + i]
        if w[W_NEW] > 0.0:
            row = note(t[k], w, W_ROW, N_ROW, row, out_diag)
        if w[W_NEW + 1] > 0.0:
            row = note(t[k], w, W_FIX, N_FIX, row, out_diag)
    load(x, inf, j, t_mag, mag)
    load_events(x, inf, e, events)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
