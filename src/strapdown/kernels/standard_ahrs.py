"""Standard AHRS: gravity corrects roll and pitch, the levelled field yaw. n = NED, b = body.

State, covariance, prediction and scalar updates are those of `uav_ahrs`. Section numbers are those
of spec D (thesis "micro UAV", after Jang and Liccardo).
"""

from math import asin, atan2, cos, inf, isnan, nan, sin, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    ALIGNED,
    D_ACC,
    D_MAG,
    MAG,
    P_COS_D,
    P_SIN_D,
    SKIP,
    START,
    STATUS,
    TILT,
    Q,
    begin,
    heading_from_mag,
    load,
    note,
    note_sigma,
    post,
    set_status,
    store,
)
from strapdown.kernels.quat import mul, normalize, rotate
from strapdown.kernels.uav_ahrs import (
    AS_PRINTED,
    LEVELLED,
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
    W_H,
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
ROLL = X_SHARED  # at the end of the step before, kept where `P_BEFORE` asks for it [rad]
PITCH = X_SHARED + 1
X_SIZE = X_SHARED + 2

# --- own parameters ------------------------------------------------------------------------
P_BEFORE = P_SHARED  # 1: the field is levelled by the angles of the step before, as printed
P_SIZE = P_SHARED + 1
W_SIZE = W_SHARED


@kernel
def remember_tilt(x: Vec) -> None:
    """Keep roll and pitch for the next step's field."""
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    x[ROLL] = atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy))
    x[PITCH] = asin(min(1.0, max(-1.0, 2.0 * (qw * qy - qx * qz))))


@kernel
def heading_left(x: Vec, p: Vec) -> float:
    """Measured less predicted heading, (2.43) to (2.45); NaN where the field is vertical.

    Levelled by the estimate it is the turn about down that brings the field to its heading.
    """
    if p[P_BEFORE] == 0.0:
        return float(heading_from_mag(x, 0.0, 0.0, 0.0, p[P_COS_D], p[P_SIN_D]))
    mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
    level_x = mx * cos(x[PITCH]) + (my * sin(x[ROLL]) + mz * cos(x[ROLL])) * sin(x[PITCH])
    level_y = my * cos(x[ROLL]) - mz * sin(x[ROLL])
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    yaw = atan2(2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qy * qy + qz * qz))
    return float(wrap(atan2(-level_y, level_x) + atan2(p[P_SIN_D], p[P_COS_D]) - yaw))


@kernel
def levelled_row(x: Vec, p: Vec, w: Vec) -> None:
    """Write the derivative by q of the turn about down: an error of tilt turns the field too.

    The field has the dip that is measured and the heading that is predicted: with the measured one
    its noise would be in the row as well.
    """
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    north, east, down = rotate(qw, qx, qy, qz, x[MAG + 1], x[MAG + 2], x[MAG + 3])
    k = -down / sqrt(north * north + east * east)
    # a turn u in n is measured by the row 2 (0, u) q
    w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3] = mul(
        0.0, 2.0 * k * p[P_COS_D], 2.0 * k * p[P_SIN_D], 2.0, qw, qx, qy, qz
    )


@kernel
def correct_heading(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Enter the heading of the field in the inbox, if it has one."""
    left = heading_left(x, p)
    ok = not isnan(left)
    if ok and p[P_JACOBIAN] == LEVELLED:
        levelled_row(x, p, w)
    elif ok:
        ok = heading_row(x, w, 1.0 if p[P_JACOBIAN] == AS_PRINTED else 0.0)
    if ok:
        forget(w)
        r = variance_of(x, p[P_MAG_NOISE], p[P_MAG_PERIOD])
        left, expected, accepted = update_scalar(P, w, left, r, p[P_GATE])
        note(w, D_MAG, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
        note_sigma(w, D_MAG, 0, left, expected)
        if not accepted:
            set_status(x, s.MAG_REJECTED)
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
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    predict(x, P, p, w, wx, wy, wz, dt)
    if x[STARTED] == 0.0 and todo == START:
        restart(x, P, p)
    elif x[STARTED] == 0.0:
        begin_given(x, P, p, inf)  # the source's first step takes the heading
    else:
        x[SINCE_ACC] += dt
        x[SINCE_MAG] += dt
        if (int(x[STATUS]) & s.GAP) != 0:
            bridge_gap(x, P, p, dt, has_acc, ax, ay, az)
        if todo == START:  # the first field, or the first after a gap, has just set the heading
            reset_heading(x, P, p[P_STD_HEADING] * p[P_STD_HEADING])
            x[SINCE_MAG] = 0.0
        else:
            if has_acc and due(x, SINCE_ACC, p[P_ACC_PERIOD], dt):
                forget(w)
                r = variance_of(x, p[P_ACC_NOISE], p[P_ACC_PERIOD])
                g = p[P_GRAVITY]
                # at rest f_b points up: (2.33) with the sign of the program
                update_vector(x, P, w, D_ACC, 0.0, 0.0, -g, ax, ay, az, r, inf)
                inject(x, P, p, w)
                wind(x, SINCE_ACC, p[P_ACC_PERIOD])
            if has_mag and x[ALIGNED] != TILT and due(x, SINCE_MAG, p[P_MAG_PERIOD], dt):
                x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(
                    x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
                )
                correct_heading(x, P, p, w)
                wind(x, SINCE_MAG, p[P_MAG_PERIOD])
        write_std(x, P)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    if p[P_BEFORE] > 0.0:
        remember_tilt(x)


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
