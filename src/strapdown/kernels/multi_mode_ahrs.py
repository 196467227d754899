"""Multi-mode AHRS: field and GPS course, or field and gravity. n = NED, b = body.

State, covariance, prediction and scalar updates are those of `uav_ahrs`. Section numbers are those
of spec D (thesis "micro UAV", after Bauer and Bokor).
"""

from math import atan2, inf, isfinite, isnan, nan, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    D_ACC,
    D_MAG,
    FULL,
    GNSS,
    MAG,
    P_COS_D,
    P_SIN_D,
    SKIP,
    START,
    STATUS,
    TILT,
    W_HEAD,
    Q,
    begin,
    heading_from_mag,
    load,
    load_events,
    note,
    note_sigma,
    post,
    set_status,
    store,
    turn_heading,
)
from strapdown.kernels.quat import rotate
from strapdown.kernels.standard_ahrs import levelled_row
from strapdown.kernels.uav_ahrs import (
    AS_PRINTED,
    P_ACC_NOISE,
    P_ACC_PERIOD,
    P_GATE,
    P_GRAVITY,
    P_JACOBIAN,
    P_MAG_NOISE,
    P_MAG_PERIOD,
    P_SHARED,
    P_STD_HEADING,
    SINCE_ACC,
    SINCE_MAG,
    STARTED,
    W_SHARED,
    X_SHARED,
    begin_given,
    bridge_gap,
    due,
    forget,
    heading_row,
    inject,
    predict,
    reset_heading,
    restart,
    update_scalar,
    update_vector,
    variance_of,
    wind,
    wrap,
    write_std,
)

# --- own states of x -------------------------------------------------------------------
REF_H = X_SHARED  # horizontal part of the reference field [T], zero before it is known
REF_D = X_SHARED + 1  # its part down [T]
T_MAG = X_SHARED + 2  # time of the last field that was used [s]; -inf: none
T_COURSE = X_SHARED + 3  # time of the last valid course [s]; -inf: none, or lost
HAD_GPS = X_SHARED + 4  # 1 once there was a fix
LEARN = X_SHARED + 5  # how long the reference is still learned [s]; zero where it is given
LEARNED = X_SHARED + 6  # samples that it is the mean of
X_SIZE = X_SHARED + 7

# --- own parameters ------------------------------------------------------------------------
P_STD_COURSE = P_SHARED  # of a fix [rad]
P_TIMEOUT = P_SHARED + 1  # a course, or a field, counts for so long [s]
P_MIN_SPEED = P_SHARED + 2  # [m/s]
P_SIZE = P_SHARED + 3

# --- own scratch -----------------------------------------------------------------------------
W_COURSE = W_SHARED  # diagnostics: innovation 3, sigma 3, outcome
W_SIZE = W_SHARED + 7

D_COURSE = W_HEAD  # where they stand in a row of the diagnostics


@kernel
def learning(x: Vec) -> bool:
    """Whether the reference field is not known yet."""
    return bool(x[LEARN] > 0.0 or x[REF_H] == 0.0)


@kernel
def learn_reference(x: Vec) -> None:
    """Add dip and magnitude of the field in the inbox to their means, if it is not vertical."""
    mx, my, mz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], x[MAG + 1], x[MAG + 2], x[MAG + 3])
    h2 = mx * mx + my * my
    if h2 > 1e-12 * (h2 + mz * mz):
        x[LEARNED] += 1.0
        x[REF_H] += (sqrt(h2) - x[REF_H]) / x[LEARNED]
        x[REF_D] += (mz - x[REF_D]) / x[LEARNED]


@kernel
def take_course(x: Vec, p: Vec, t: float) -> float:
    """Course of the fix in the inbox, (3.17); NaN without one. Says whether GPS is valid."""
    course = nan
    if x[GNSS] > 0.0:
        x[GNSS] = 0.0
        x[HAD_GPS] = 1.0
        north, east = x[GNSS + 5], x[GNSS + 6]
        v2 = north * north + east * east
        late = t - x[GNSS + 1]
        if isfinite(v2) and v2 >= p[P_MIN_SPEED] * p[P_MIN_SPEED] and late <= p[P_TIMEOUT]:
            course = atan2(east, north)
            x[T_COURSE] = t
        else:
            x[T_COURSE] = -inf
    return course


@kernel
def yaw_rate(x: Vec, wx: float, wy: float, wz: float) -> float:
    """Rate of the yaw angle, (1.16), while pitch is not near a right angle."""
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    down_y = 2.0 * (qy * qz + qw * qx)
    down_z = 1.0 - 2.0 * (qx * qx + qy * qy)
    level2 = down_y * down_y + down_z * down_z
    rate = ((wy - x[BG + 1]) * down_y + (wz - x[BG + 2]) * down_z) / max(level2, 0.01)
    return float(rate)


@kernel
def correct_course(x: Vec, P: Mat, p: Vec, w: Vec, course: float) -> bool:
    """Enter the course as yaw, (3.19); False if it is beyond the gate."""
    accepted = True
    if heading_row(x, w, 1.0 if p[P_JACOBIAN] == AS_PRINTED else 0.0):
        qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        yaw = atan2(2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qy * qy + qz * qz))
        r = p[P_STD_COURSE] * p[P_STD_COURSE]
        left, expected, accepted = update_scalar(P, w, wrap(course - yaw), r, p[P_GATE])
        note(w, W_COURSE, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
        note_sigma(w, W_COURSE, 0, left, expected)
    return accepted


@kernel
def align_by_course(x: Vec, P: Mat, p: Vec, course: float) -> None:
    """Take the first heading from a course, where no field has given one."""
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    yaw = atan2(2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qy * qy + qz * qz))
    turn_heading(x, course - yaw)
    x[ALIGNED] = FULL
    reset_heading(x, P, p[P_STD_HEADING] * p[P_STD_HEADING])


@kernel
def correct_field(x: Vec, P: Mat, p: Vec, w: Vec) -> bool:
    """Enter the field of the inbox as a vector, (3.15); False if it is beyond the gate.

    While its reference is learned, its heading only: the dip would agree with itself.
    """
    r = variance_of(x, p[P_MAG_NOISE], p[P_MAG_PERIOD])
    accepted = True
    if not learning(x):
        north, east = x[REF_H] * p[P_COS_D], x[REF_H] * p[P_SIN_D]
        accepted = update_vector(
            x, P, w, D_MAG, north, east, x[REF_D], x[MAG + 1], x[MAG + 2], x[MAG + 3], r, p[P_GATE]
        )
    else:
        left = heading_from_mag(x, 0.0, 0.0, 0.0, p[P_COS_D], p[P_SIN_D])
        if not isnan(left) and x[REF_H] > 0.0:
            levelled_row(x, p, w)
            r /= x[REF_H] * x[REF_H]
            left, expected, accepted = update_scalar(P, w, left, r, p[P_GATE])
            note(w, D_MAG, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
            note_sigma(w, D_MAG, 0, left, expected)
    return accepted


# fmt: off
@kernel
def correct(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float, dt: float, course: float,
    has_acc: bool, ax: float, ay: float, az: float, has_mag: bool,
) -> None:
    """Enter what is due: in mode 1 field and course, in mode 2 field and gravity."""
    # fmt: on
    forget(w)
    anything = False
    if has_mag and learning(x):
        learn_reference(x)
    if has_mag and x[ALIGNED] != TILT and due(x, SINCE_MAG, p[P_MAG_PERIOD], dt):
        anything = True
        if not correct_field(x, P, p, w):
            set_status(x, s.MAG_REJECTED)
        wind(x, SINCE_MAG, p[P_MAG_PERIOD])
        x[T_MAG] = t
    if not isnan(course) and dt > 0.0:
        anything = True
        if not correct_course(x, P, p, w, course):
            set_status(x, s.AIDING_REJECTED)
    gps = t - x[T_COURSE] <= p[P_TIMEOUT]
    if x[HAD_GPS] > 0.0 and not gps:
        set_status(x, s.OUTAGE)
    mode_1 = gps and t - x[T_MAG] <= p[P_TIMEOUT] and not learning(x)
    if has_acc and due(x, SINCE_ACC, p[P_ACC_PERIOD], dt):
        if not mode_1:
            anything = True
            r = variance_of(x, p[P_ACC_NOISE], p[P_ACC_PERIOD])
            g = p[P_GRAVITY]
            # at rest f_b points up: (3.16) with the sign of the program
            update_vector(x, P, w, D_ACC, 0.0, 0.0, -g, ax, ay, az, r, inf)
        wind(x, SINCE_ACC, p[P_ACC_PERIOD])
    if anything:
        inject(x, P, p, w)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    w[W_COURSE + 6] = s.NOT_MEASURED
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    predict(x, P, p, w, wx, wy, wz, dt)
    fixed_at = x[GNSS + 1]
    course = take_course(x, p, t)
    if not isnan(course):  # of the fix's time: yaw has gone on since
        course += yaw_rate(x, wx, wy, wz) * max(t - fixed_at, 0.0)
    if x[LEARNED] > 0.0:
        x[LEARN] = max(x[LEARN] - dt, 0.0)
    if todo == START and has_mag and x[ALIGNED] == FULL:
        x[T_MAG] = t
        if learning(x):
            learn_reference(x)
    if x[STARTED] == 0.0 and todo == START:
        restart(x, P, p)
        return
    if x[STARTED] == 0.0:
        begin_given(x, P, p, 0.0)
        return
    x[SINCE_ACC] += dt
    x[SINCE_MAG] += dt
    if (int(x[STATUS]) & s.GAP) != 0:
        bridge_gap(x, P, p, dt, has_acc, ax, ay, az)
    if todo == START:  # the first field, or the first after a gap, has just set the heading
        reset_heading(x, P, p[P_STD_HEADING] * p[P_STD_HEADING])
        x[SINCE_MAG] = 0.0
    elif x[ALIGNED] == TILT and not isnan(course):
        align_by_course(x, P, p, course)
    else:
        correct(x, P, p, w, t, dt, course, has_acc, ax, ay, az, has_mag)
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
    load(x, inf, j, t_mag, mag)
    load_events(x, inf, e, events)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
