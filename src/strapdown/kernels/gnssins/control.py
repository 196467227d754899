"""Control Unit of thesis E, 7.8: modes, uniform motion, resets, and which attitude is measured."""

from math import isfinite, isinf, isnan, nan, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.gnssins.attitude import adaptive_r, correct, reset_covariance
from strapdown.kernels.gnssins.layout import (
    AGE,
    ALIGNMENT,
    AUTO,
    COURSE,
    CRONO,
    FIX_AGE,
    GPS_OFF,
    GPS_ON,
    GRAVITY,
    MAG_AGE,
    MASTER_SLAVE,
    MEAN_F,
    MEAN_G,
    MODE,
    P_ALIGN_TIME,
    P_BASE,
    P_C_VB,
    P_KA,
    P_LIMIT,
    P_METHOD,
    P_PERIOD,
    P_QUAT_VAR,
    P_QUIET_ACC,
    P_QUIET_GYR,
    P_QUIET_TIME,
    P_RECOVER,
    P_RESET_EVERY,
    P_ROOT,
    P_STOP,
    P_TABLES,
    P_TIMEOUT,
    P_TKF,
    P_USE_Z,
    QUIET,
    REF_D,
    REF_H,
    REFUSED,
    SINCE_TRG,
    SLOW_F,
    U_DOT,
    W_NEW,
    W_ROW,
    U,
)
from strapdown.kernels.gnssins.measurement import (
    gauss_newton,
    level_and_course,
    level_only,
    master_slave,
)
from strapdown.kernels.gnssins.vertical import vehicle_acceleration
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    FULL,
    MAG,
    P_COS_D,
    P_SIN_D,
    TILT,
    Q,
    set_status,
)

SMOOTHING = 0.5  # of the rate and force that tell uniform motion [s]


# fmt: off
@kernel
def observe(
    x: Vec, p: Vec, dt: float,
    gx: float, gy: float, gz: float,
    fx: float, fy: float, fz: float,
) -> None:
    """Keep the clocks, the smoothed motion, and the mode."""
    # fmt: on
    x[AGE] += dt
    x[SINCE_TRG] += dt
    x[CRONO] += dt
    x[FIX_AGE] += dt
    k = dt / (SMOOTHING + dt)
    x[MEAN_G] += k * (gx - x[MEAN_G])
    x[MEAN_G + 1] += k * (gy - x[MEAN_G + 1])
    x[MEAN_G + 2] += k * (gz - x[MEAN_G + 2])
    x[MEAN_F] += k * (fx - x[MEAN_F])
    x[MEAN_F + 1] += k * (fy - x[MEAN_F + 1])
    x[MEAN_F + 2] += k * (fz - x[MEAN_F + 2])
    k = dt / (p[P_QUIET_TIME] + dt)
    x[SLOW_F] += k * (x[MEAN_F] - x[SLOW_F])
    x[SLOW_F + 1] += k * (x[MEAN_F + 1] - x[SLOW_F + 1])
    x[SLOW_F + 2] += k * (x[MEAN_F + 2] - x[SLOW_F + 2])
    x[QUIET] += dt
    if not uniform(x, p):
        x[QUIET] = 0.0
        for i in range(3):
            x[SLOW_F + i] = x[MEAN_F + i]
        if x[AGE] > SMOOTHING and x[MODE] == ALIGNMENT:  # it moves: no static alignment
            x[AGE] = p[P_ALIGN_TIME]
    if x[MODE] != ALIGNMENT or x[AGE] >= p[P_ALIGN_TIME]:
        x[MODE] = GPS_ON if x[FIX_AGE] < p[P_TIMEOUT] else GPS_OFF


@kernel
def uniform(x: Vec, p: Vec) -> bool:
    """Whether rate, ``||f| - g|`` and the force's change are small; with GPS, ``u'`` as well.

    Pulling away with 2.5 m/s^2 makes only 0.3 m/s^2 of the modulus, but all of the change.
    """
    wx, wy, wz = x[MEAN_G] - x[BG], x[MEAN_G + 1] - x[BG + 1], x[MEAN_G + 2] - x[BG + 2]
    fx, fy, fz = x[MEAN_F], x[MEAN_F + 1], x[MEAN_F + 2]
    still = wx * wx + wy * wy + wz * wz < p[P_QUIET_GYR] * p[P_QUIET_GYR]
    off_g = sqrt(fx * fx + fy * fy + fz * fz) - x[GRAVITY]
    calm = abs(off_g) < p[P_QUIET_ACC]
    dx, dy, dz = fx - x[SLOW_F], fy - x[SLOW_F + 1], fz - x[SLOW_F + 2]
    same = dx * dx + dy * dy + dz * dz < p[P_QUIET_ACC] * p[P_QUIET_ACC]
    steady = x[FIX_AGE] >= p[P_TIMEOUT] or abs(x[U_DOT]) < p[P_QUIET_ACC]
    return bool(still and calm and same and steady)


@kernel
def parameters_of(x: Vec, p: Vec) -> int:
    """QRctr: which column of table 7.3 holds; uniform motion takes that of alignment."""
    if x[MODE] == ALIGNMENT or x[QUIET] >= p[P_QUIET_TIME]:
        return 0
    return int(x[MODE])


# fmt: off
@kernel
def gravity_vector(
    x: Vec, p: Vec, mode: int,
    wx: float, wy: float, wz: float,
    fx: float, fy: float, fz: float,
) -> tuple[float, float, float]:
    """Vertical reference (7.5.2), (7.5.4), scaled by g; gctr lets the acceleration in."""
    # fmt: on
    gx, gy, gz = -fx, -fy, -fz
    if mode == int(GPS_ON) and isfinite(x[U]):
        ax, ay, az = vehicle_acceleration(
            p, P_C_VB, wx - x[BG], wy - x[BG + 1], wz - x[BG + 2], x[U], x[U_DOT]
        )
        gx, gy, gz = gx + ax, gy + ay, gz + az
    k = 1.0 / x[GRAVITY]
    return k * gx, k * gy, k * gz


@kernel
def learn_field(x: Vec, gx: float, gy: float, gz: float) -> None:
    """Take strength and dip of the reference from the field of the inbox and gravity in b."""
    mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
    down = (mx * gx + my * gy + mz * gz) / sqrt(gx * gx + gy * gy + gz * gz)
    h2 = mx * mx + my * my + mz * mz - down * down
    if h2 > 0.0:
        x[REF_H] = sqrt(h2)
        x[REF_D] = down


# fmt: off
@kernel
def measured(
    x: Vec, p: Vec, w: Vec, mode: int, has_mag: bool,
    gx: float, gy: float, gz: float,
) -> tuple[float, float, float, float, bool]:
    """Measured attitude, and whether its heading is one. g is gravity in b, of about length 1.

    Master-Slave in alignment and reset, Gauss-Newton otherwise, 7.6.3; where that does not
    converge, or where measurements are being rejected and it may have converged to a wrong one,
    Master-Slave. Without a field the course of the fixes gives heading.
    """
    # fmt: on
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    a, b, c, d = nan, nan, nan, nan
    w[W_ROW + 9] = 0.0
    if has_mag:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        iterate = p[P_METHOD] != MASTER_SLAVE and (p[P_METHOD] != AUTO or mode > 0)
        if iterate and x[REF_H] > 0.0 and x[REFUSED] == 0.0:
            k = 1.0 / sqrt(gx * gx + gy * gy + gz * gz)
            m = 1.0 / sqrt(mx * mx + my * my + mz * mz)
            r = 1.0 / sqrt(x[REF_H] * x[REF_H] + x[REF_D] * x[REF_D])
            north, east, down = x[REF_H] * p[P_COS_D], x[REF_H] * p[P_SIN_D], x[REF_D]
            a, b, c, d = gauss_newton(
                w, qw, qx, qy, qz, k * gx, k * gy, k * gz, m * mx, m * my, m * mz,
                r * north, r * east, r * down, p[P_USE_Z], p[P_STOP],
            )  # fmt: skip
            w[W_ROW + 9] = 0.0 if isnan(a) else 1.0
        if isnan(a):
            a, b, c, d = master_slave(
                gx, gy, gz, mx, my, mz, p[P_COS_D], p[P_SIN_D], p[P_TABLES]
            )
        if not isnan(a):
            return a, b, c, d, True
    if isfinite(x[COURSE]) and x[FIX_AGE] < p[P_TIMEOUT]:
        a, b, c, d = level_and_course(
            qw, qx, qy, qz, gx, gy, gz,
            p[P_C_VB], p[P_C_VB + 1], p[P_C_VB + 2], x[COURSE],
        )  # fmt: skip
        if not isnan(a):
            return a, b, c, d, True
    a, b, c, d = level_only(qw, qx, qy, qz, gx, gy, gz)
    return a, b, c, d, False


# fmt: off
@kernel
def set_attitude(
    x: Vec, P: Mat, w: Vec,
    a: float, b: float, c: float, d: float,
    r: float, has_heading: bool,
) -> None:
    """Reset: ``q = q_meas`` (7.4.3); the clock of the withheld bias starts."""
    # fmt: on
    reset_covariance(x, P, w, a, b, c, d, r, has_heading)
    x[CRONO] = 0.0
    x[REFUSED] = 0.0


# fmt: off
@kernel
def trigger(
    x: Vec, P: Mat, p: Vec, w: Vec, has_mag: bool,
    wx: float, wy: float, wz: float,
    fx: float, fy: float, fz: float,
) -> None:
    """Run the attitude filter, reset, or reject: what 7.8 lets MasterTRG do."""
    # fmt: on
    mode = parameters_of(x, p)
    waited = x[SINCE_TRG]
    x[SINCE_TRG] = 0.0
    gx, gy, gz = gravity_vector(x, p, mode, wx, wy, wz, fx, fy, fz)
    if not gx * gx + gy * gy + gz * gz > 1e-6:  # free fall
        return
    if has_mag and (x[REF_H] == 0.0 or mode == 0):
        learn_field(x, gx, gy, gz)
    a, b, c, d, has_heading = measured(x, p, w, mode, has_mag, gx, gy, gz)
    if isnan(a):
        return
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    if a * q0 + b * q1 + c * q2 + d * q3 < 0.0:  # the same attitude, QUATres flips its sign
        a, b, c, d = -a, -b, -c, -d
    ra, rb, rc, rd = a - q0, b - q1, c - q2, d - q3
    off_g = sqrt(fx * fx + fy * fy + fz * fz) - x[GRAVITY]
    yaw_rate = (
        p[P_C_VB + 6] * (wx - x[BG])
        + p[P_C_VB + 7] * (wy - x[BG + 1])
        + p[P_C_VB + 8] * (wz - x[BG + 2])
    )
    r = adaptive_r(
        p[P_QUAT_VAR + mode], p[P_KA + mode], p[P_BASE + mode], off_g, yaw_rate, p[P_ROOT]
    )
    w[W_NEW] = 1.0
    w[W_ROW + 6] = s.ACCEPTED
    w[W_ROW + 7] = float(mode)
    w[W_ROW + 8] = 0.0
    w[W_ROW + 10] = r
    for k in range(3):
        w[W_ROW + 3 + k] = nan
    turn_n = 2.0 * (-q1 * ra + q0 * rb - q3 * rc + q2 * rd)
    turn_e = 2.0 * (-q2 * ra + q3 * rb + q0 * rc - q1 * rd)
    turn_d = 2.0 * (-q3 * ra - q2 * rb + q1 * rc + q0 * rd)
    w[W_ROW], w[W_ROW + 1], w[W_ROW + 2] = 0.5 * turn_n, 0.5 * turn_e, 0.5 * turn_d
    first_heading = has_heading and x[ALIGNED] == TILT
    quiet = x[QUIET] >= p[P_QUIET_TIME] and x[MODE] != ALIGNMENT
    if first_heading or (quiet and x[CRONO] >= p[P_RESET_EVERY]):
        if first_heading:
            x[ALIGNED] = FULL
        w[W_ROW + 8] = 1.0
        set_attitude(x, P, w, a, b, c, d, r, has_heading)
        return
    limit = p[P_LIMIT]
    near = abs(turn_n) < limit and abs(turn_e) < limit and abs(turn_d) < limit
    small = ra * ra + rb * rb + rc * rc + rd * rd < 1.0
    if not small or not (near or mode == 0):
        w[W_ROW + 6] = s.REJECTED_GATE
        set_status(x, s.AIDING_REJECTED)
        x[REFUSED] += waited
        if x[REFUSED] > p[P_RECOVER]:  # it is the estimate that is wrong
            w[W_ROW + 8] = 1.0
            set_attitude(x, P, w, a, b, c, d, r, has_heading)
        return
    x[REFUSED] = 0.0
    free = 4 if x[CRONO] < p[P_TKF] else 7
    correct(x, P, w, W_ROW, ra, rb, rc, rd, r, has_heading, free)


@kernel
def wants_trigger(x: Vec, p: Vec, has_acc: bool, has_mag: bool, dt: float) -> bool:
    """MasterTRG: the timer has run out, and the sample has what a measurement needs.

    A field that comes more slowly is waited for, if its samples are less than two periods apart.
    """
    if not has_acc or x[SINCE_TRG] < p[P_PERIOD] - 0.5 * dt:
        return False
    return has_mag or isinf(x[MAG_AGE]) or x[MAG_AGE] > 2.0 * p[P_PERIOD]
