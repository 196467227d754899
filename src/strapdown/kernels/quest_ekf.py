"""Extended Kalman filter of limb rates and quaternion, with QUEST in front. n = NED, b = body.

State: omega_b, the mean rate of the interval that ends at the sample, and q_nb. `P` (7x7) is the
covariance of what has to be added to them. The quaternion's error lies along the sphere,
``dq = 1/2 (0, phi_n) q``, so a turn u . phi_n is measured by the row ``2 (0, u) q``. P belongs
to the quaternion in `Q_P`; what has turned q since then is made good before P is used. Equation
numbers are those of spec B (thesis "kinematic device", section 4.3.3).
"""

from math import atan2, exp, inf, isnan, nan, pi, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mekf import UNSEEN_TIME
from strapdown.kernels.memory import (
    ALIGNED,
    D_MAG,
    FULL,
    MAG,
    P_COS_D,
    P_MAX_GAP,
    P_SIN_D,
    SKIP,
    START,
    STATUS,
    TILT,
    Q,
    T,
    begin,
    level,
    load,
    note,
    post,
    set_status,
    store,
)
from strapdown.kernels.quat import exp as exp_q
from strapdown.kernels.quat import mul, normalize, rotate
from strapdown.kernels.quest_ekf_covariance import (
    add_turn,
    belongs,
    decay,
    rate_matrix,
    reset_attitude,
    reset_heading,
    spread,
    turn_frame,
    turn_matrix,
    turn_variance,
    turned_since,
    write_std,
)
from strapdown.kernels.quest_ekf_layout import (
    MAX_EULER,
    MIN_SINE,
    P_ACC_NOISE,
    P_EULER,
    P_GAP_RATE,
    P_GRAVITY,
    P_GYR_NOISE,
    P_MAG_NOISE,
    P_RATE_STD,
    P_RATE_TIME,
    P_SIN_DIP,
    P_STD_HEADING,
    P_STD_TILT,
    P_VECTORS,
    RATE,
    STARTED,
    T_ACC,
    T_MAG,
    W_B,
    W_DX,
)
from strapdown.kernels.quest_ekf_layout import W_SIZE as W_SIZE
from strapdown.kernels.quest_ekf_update import (
    inject,
    quest,
    update_both,
    update_down,
    update_field,
    update_rate,
)


# fmt: off
@kernel
def bridge_gap(
    x: Vec, P: Mat, p: Vec, w: Vec, dt: float, has_acc: bool, ax: float, ay: float, az: float
) -> None:
    """Widen the covariance over a gap; where tilt is lost, level again and wait for a field."""
    # fmt: on
    unknown = min(p[P_GAP_RATE] * dt, pi)
    if unknown > p[P_STD_TILT] and has_acc:
        heading = turn_variance(x, P, w, 2)
        level(x, ax, ay, az)
        # Of one sample, which is thereby used: it stands for the longest interval that counts.
        tilt = p[P_ACC_NOISE] * p[P_ACC_NOISE] / (p[P_GRAVITY] * p[P_GRAVITY] * p[P_MAX_GAP])
        tilt = max(tilt, p[P_STD_TILT] * p[P_STD_TILT])
        reset_attitude(x, P, w, tilt, min(heading + unknown * unknown, pi * pi))
        x[T_ACC] = x[T]
        if x[ALIGNED] == FULL:
            x[ALIGNED] = TILT
    else:
        for i in range(3):
            add_turn(x, P, w, i, unknown * unknown)


# fmt: off
@kernel
def enter_rates(
    x: Vec, P: Mat, p: Vec, w: Vec, wx: float, wy: float, wz: float, dt: float
) -> None:
    """Update with the measured rates: the mean over dt of white noise, or little of them seen."""
    # fmt: on
    r = p[P_GYR_NOISE] * p[P_GYR_NOISE] / dt
    if (int(x[STATUS]) & (s.SATURATED | s.GYR_STUCK)) != 0:
        r += min(2.0 * UNSEEN_TIME * p[P_GAP_RATE] * p[P_GAP_RATE] / dt, pi * pi / (dt * dt))
    update_rate(P, w, 0, wx - x[RATE], r)
    update_rate(P, w, 1, wy - x[RATE + 1], r)
    update_rate(P, w, 2, wz - x[RATE + 2], r)


@kernel
def predict(x: Vec, P: Mat, p: Vec, w: Vec, wx: float, wy: float, wz: float, dt: float) -> None:
    """Carry rates and quaternion over one interval, (64) and (65), and enter the gyroscope.

    The rates enter before they turn the quaternion, which to first order is the same as after it,
    and exact for a constant rate. The printed order leaves its correction to the measurements.
    """
    tau = p[P_RATE_TIME]
    variance = p[P_RATE_STD] * p[P_RATE_STD]
    turn2 = x[RATE] * x[RATE] + x[RATE + 1] * x[RATE + 1] + x[RATE + 2] * x[RATE + 2]
    if p[P_EULER] > 0.0 and turn2 * dt * dt < MAX_EULER * MAX_EULER:
        ew, ex, ey, ez = turned_since(x)
        turn_matrix(w, ew, ex, ey, ez)
        for i in range(12):
            w[W_B + i] = 0.0
        spread(P, w)
        hx, hy, hz = 0.5 * x[RATE] * dt, 0.5 * x[RATE + 1] * dt, 0.5 * x[RATE + 2] * dt
        turn_matrix(w, 1.0, hx, hy, hz)
        rate_matrix(w, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, 0.0, 0.0, dt)
        spread(P, w)
        qw, qx, qy, qz = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 1.0, hx, hy, hz)
        a = 1.0 - min(dt / tau, 1.0)
        decay(P, a, 2.0 * variance * min(dt / tau, 0.5))
        for i in range(3):
            x[RATE + i] *= a
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(qw, qx, qy, qz)
        belongs(x)
        enter_rates(x, P, p, w, wx, wy, wz, dt)
    else:
        a = exp(-dt / tau)
        decay(P, a, variance * (1.0 - a * a))
        for i in range(3):
            x[RATE + i] *= a
        enter_rates(x, P, p, w, wx, wy, wz, dt)
        inject(x, w)
        rx, ry, rz = x[RATE] * dt, x[RATE + 1] * dt, x[RATE + 2] * dt
        ew, ex, ey, ez = exp_q(rx, ry, rz)
        qw, qx, qy, qz = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ew, ex, ey, ez)
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(qw, qx, qy, qz)
        ew, ex, ey, ez = turned_since(x)
        turn_matrix(w, ew, ex, ey, ez)
        rate_matrix(w, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], rx, ry, rz, dt)
        spread(P, w)
        belongs(x)


# fmt: off
@kernel
def correct(
    x: Vec, P: Mat, p: Vec, w: Vec, has_acc: bool, ax: float, ay: float, az: float,
    has_mag: bool, r_d: float, r_m: float,
) -> None:
    """Enter accelerometer and field, by QUEST or as vectors; r is of the unit vectors."""
    # fmt: on
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    mx, my, mz = 0.0, 0.0, 0.0
    north, east, down, c, d = 0.0, 0.0, 0.0, 0.0, 0.0
    if has_mag:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        k = 1.0 / sqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = k * mx, k * my, k * mz
        vx, vy, down = rotate(qw, qx, qy, qz, mx, my, mz)
        north = p[P_COS_D] * vx + p[P_SIN_D] * vy
        east = p[P_COS_D] * vy - p[P_SIN_D] * vx
        if isnan(p[P_SIN_DIP]):
            c, d = sqrt(north * north + east * east), down
        else:
            d = p[P_SIN_DIP]
            c = sqrt(1.0 - d * d)
        if north * north + east * east < MIN_SINE * MIN_SINE:  # vertical: it has no heading
            has_mag = False
            note(w, D_MAG, nan, nan, nan, s.REJECTED_INVALID)
            set_status(x, s.MAG_REJECTED)
    if has_acc and p[P_VECTORS] > 0.0:
        # Scaled, not normalised: linear accelerations then average out.
        k = -1.0 / p[P_GRAVITY]
        vx, vy, _ = rotate(qw, qx, qy, qz, k * ax, k * ay, k * az)
        n, e = p[P_COS_D] * vx + p[P_SIN_D] * vy, p[P_COS_D] * vy - p[P_SIN_D] * vx
        update_down(x, P, p, w, n, e, r_d, r_d)
    elif has_acc:
        k = -1.0 / sqrt(ax * ax + ay * ay + az * az)  # at rest f_b points up, so -f_b points down
        # An acceleration of any direction spreads that of f like (sigma_a^2 / (g |f|)): a long f
        # counts more, a short one less, and over time accelerations average out.
        r_d *= -k * p[P_GRAVITY]
        ax, ay, az = k * ax, k * ay, k * az
        fw, fx, fy, fz = nan, nan, nan, nan
        if has_mag:
            fw, fx, fy, fz = quest(
                ax, ay, az, mx, my, mz, p[P_SIN_DIP], 1.0 / r_d, 1.0 / r_m, p[P_COS_D], p[P_SIN_D]
            )
        if isnan(fw):  # one vector alone leaves the turn about it open
            vx, vy, _ = rotate(qw, qx, qy, qz, ax, ay, az)
            n, e = p[P_COS_D] * vx + p[P_SIN_D] * vy, p[P_COS_D] * vy - p[P_SIN_D] * vx
            update_down(x, P, p, w, n, e, r_d, r_d)
        else:
            fw, fx, fy, fz = mul(qw, qx, qy, qz, fw, -fx, -fy, -fz)
            update_both(x, P, p, w, fw, fx, fy, fz, atan2(east, north), c, d, r_d, r_m)
            has_mag = False
    if has_mag:
        update_field(x, P, p, w, north, east, down, c, d, r_m)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    std_heading = 0.0  # an arbitrary heading is exact by definition
    if x[ALIGNED] == FULL:
        std_heading = p[P_STD_HEADING]
    for i in range(7):
        w[W_DX + i] = 0.0
    if x[STARTED] == 0.0:
        x[STARTED] = 1.0
        x[T_ACC] = x[T]
        x[T_MAG] = x[T]
        if todo == START:
            tilt = p[P_STD_TILT] * p[P_STD_TILT]
            reset_attitude(x, P, w, tilt, std_heading * std_heading)
        else:  # the attitude was given
            turn_matrix(w, qw, qx, qy, qz)
            for i in range(12):
                w[W_B + i] = 0.0
            spread(P, w)
            belongs(x)
        write_std(x, P, w)
        return
    if todo == START:
        turn_frame(x, P, w, qw, qx, qy, qz)
    predict(x, P, p, w, wx, wy, wz, dt)
    if (int(x[STATUS]) & s.GAP) != 0:
        inject(x, w)
        bridge_gap(x, P, p, w, dt, has_acc, ax, ay, az)
    if todo == START:  # the first field, or the first after a gap, has just set the heading
        inject(x, w)
        reset_heading(x, P, w, std_heading * std_heading)
        x[T_MAG] = x[T]
        write_std(x, P, w)
        return

    # A sample stands for the time since the last one, but not for what a gap has hidden.
    r_d, r_m = 1.0, 1.0
    has_acc = has_acc and t > x[T_ACC]
    if has_acc:
        r_d = p[P_ACC_NOISE] / p[P_GRAVITY]
        r_d = r_d * r_d / min(t - x[T_ACC], p[P_MAX_GAP])
        x[T_ACC] = t
    if (int(x[STATUS]) & s.MAG_DISTURBED) != 0 and not has_mag:
        x[T_MAG] = t  # the next one does not stand for the time of those left out
    has_mag = has_mag and t > x[T_MAG] and x[ALIGNED] != TILT
    if has_mag:
        r_m = p[P_MAG_NOISE] * p[P_MAG_NOISE] / min(t - x[T_MAG], p[P_MAX_GAP])
        x[T_MAG] = t
    correct(x, P, p, w, has_acc, ax, ay, az, has_mag, r_d, r_m)
    inject(x, w)
    write_std(x, P, w)


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
