"""What is known of a car: it goes where it points, it stands still, its wheels count.

The vehicle frame v is forward-right-down; ``q_vb`` takes the axes of the box to it. At one point
of its x axis, near the rear axle and `ARM_V` from the box, a car does not slip sideways.
"""

from math import isnan, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.covariance import (
    absorb,
    clear_correction,
    clear_row,
    inject,
    project,
    remaining,
    reset,
)
from strapdown.kernels.ins.layout import (
    ACC_N,
    ARM_V,
    ARM_V_0,
    BARO,
    CORE,
    DBG,
    DP,
    DV,
    FIX_SPEED,
    FIX_T,
    GATE,
    I_ARM_V,
    I_BARO,
    I_MOUNT,
    I_SODO,
    LLA,
    M_BACK,
    M_COUNT,
    M_SUM,
    MOUNTED,
    PHI,
    QVB,
    RATE,
    S3,
    SD_ARM_V,
    SD_BARO,
    SD_MOUNT,
    SD_REST_G,
    SD_REST_V,
    SD_ROLL,
    SD_SIDE,
    SD_SPEED,
    SD_UP,
    SLIP,
    SODO,
    T_CON,
    H,
    Q,
    V,
)
from strapdown.kernels.memory import BARO as IN_BARO
from strapdown.kernels.memory import SPEED as IN_SPEED
from strapdown.kernels.memory import T
from strapdown.kernels.quat import dcm, from_dcm, mul, rotate, rotate_inverse

MOUNT_UNKNOWN = 3.0  # prior of a mount that nothing is known of [rad]
SEARCH_SPEED = 2.5  # the mount is looked for above this speed [m/s]
SEARCH_RATE = 0.12  # and below this angular rate [rad/s]
SEARCH_HEADING = 0.15  # and with heading known to this [rad]
SEARCH_TICKS = 15.0  # directions of travel that are averaged
SEARCH_SPREAD = 0.95  # least length of their mean
BACK_SPEED = 2.5  # no car goes back this fast [m/s]
BACK_TIME = 5.0  # for so long [s]
FIXED_MOUNT = 0.03  # error of a mount that is found but not estimated on [rad]
ROLL_TIME = 5.0  # over which the roll of the road is one and the same [s]
SPEED_GATE = 9.0
PULL_AWAY = 0.12  # smoothed horizontal acceleration that ends a standstill [m/s^2]


@kernel
def velocity(x: Vec) -> tuple[float, float, float, float, float, float]:
    """Velocity of the point without side slip, and angular rate, vehicle axes."""
    bx, by, bz = rotate_inverse(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], x[V], x[V + 1], x[V + 2])
    vx, vy, vz = rotate(x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3], bx, by, bz)
    wx, wy, wz = rotate(
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3], x[RATE], x[RATE + 1], x[RATE + 2]
    )
    return vx, vy + wz * x[ARM_V], vz - wy * x[ARM_V], wx, wy, wz


# fmt: off
@kernel
def velocity_row(
    x: Vec, p: Vec, w: Vec, r0: float, r1: float, r2: float, axis: int,
    vx: float, vy: float, vz: float, arm: float,
) -> None:
    """Row of vehicle velocity along `axis`, whose row of ``C_vn`` is (r0, r1, r2).

    ``v_v = C_vb C_nb^T v_n`` moves with ``C_vn (dv + v x phi) + m x v_v``, m the mount's error.
    """
    # fmt: on
    clear_row(p, w)
    w[H + DV], w[H + DV + 1], w[H + DV + 2] = r0, r1, r2
    vn, ve, vd = x[V], x[V + 1], x[V + 2]
    w[H + PHI] = r1 * vd - r2 * ve
    w[H + PHI + 1] = r2 * vn - r0 * vd
    w[H + PHI + 2] = r0 * ve - r1 * vn
    k = int(p[I_MOUNT])
    if k > 0:
        if axis == 0:
            w[H + k + 1] = vz
            w[H + k + 2] = -vy
        elif axis == 1:
            w[H + k] = -vz
            w[H + k + 2] = vx
        else:
            w[H + k] = vy
            w[H + k + 1] = -vx
    k = int(p[I_ARM_V])
    if k > 0:
        w[H + k] = arm


@kernel
def constrain(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Non-holonomic constraint over a tick of `dt`, and a road that is level on average.

    What the constraint leaves out (tyres that slip with the lateral acceleration, springs) lasts
    about `T_CON`, so that a tick is worth less than an independent measurement.
    """
    clear_correction(p, w)
    vx, vy, vz, _wx, wy, wz = velocity(x)
    qw, qa, qb, qc = mul(
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3], x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3]
    )
    _c0, _c1, c2, c3, c4, c5, c6, c7, c8 = dcm(qw, qa, qb, qc)
    slip = p[SLIP] * abs(vx * wz)
    loose = 0.0
    k = int(p[I_MOUNT])
    if k < 0:
        loose = FIXED_MOUNT * abs(vx)
    share = p[T_CON] / dt
    sd = p[SD_SIDE] + slip + loose
    velocity_row(x, p, w, c3, c4, c5, 1, vx, vy, vz, wz)
    _gated(x, P, p, w, -vy, sd * sd * share, p[GATE])
    sd = p[SD_UP] + slip + loose
    velocity_row(x, p, w, c6, c7, c8, 2, vx, vy, vz, -wy)
    _gated(x, P, p, w, -vz, sd * sd * share, p[GATE])
    if k > 0:
        clear_row(p, w)
        w[H + PHI] = c4
        w[H + PHI + 1] = -c3
        w[H + k] = -c8
        w[H + k + 2] = c2
        project(P, p, w)
        absorb(P, p, w, -c5, p[SD_ROLL] * p[SD_ROLL] * ROLL_TIME / dt)
    inject(x, p, w)


@kernel
def _gated(x: Vec, P: Mat, p: Vec, w: Vec, y: float, r: float, gate: float) -> bool:
    """Take one scalar unless it is beyond the gate."""
    s = project(P, p, w) + r
    y_left = remaining(p, w, y)
    if y_left * y_left > gate * s:
        return False
    absorb(P, p, w, y, r)
    return True


@kernel
def stand(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Zero velocity and zero rate at rest, unless the filter or the last fix contradict."""
    if x[T] - x[FIX_T] < 1.5 and x[FIX_SPEED] > 1.0:
        return
    if x[ACC_N] * x[ACC_N] + x[ACC_N + 1] * x[ACC_N + 1] > PULL_AWAY * PULL_AWAY:
        return  # sooner than the window can see it
    clear_correction(p, w)
    r = p[SD_REST_V] * p[SD_REST_V] / dt
    for i in range(3):
        clear_row(p, w)
        w[H + DV + i] = 1.0
        s = project(P, p, w) + p[SD_REST_V] * p[SD_REST_V]
        if x[V + i] * x[V + i] > SPEED_GATE * s:
            return
    for i in range(3):
        clear_row(p, w)
        w[H + DV + i] = 1.0
        project(P, p, w)
        absorb(P, p, w, -x[V + i], r)
    for i in range(3):
        clear_row(p, w)
        w[H + DBG + i] = 1.0
        project(P, p, w)
        absorb(P, p, w, x[RATE + i], p[SD_REST_G] * p[SD_REST_G] / dt)
    inject(x, p, w)


@kernel
def find_mount(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Forward is where the box travels while it does not turn; down is down."""
    v = sqrt(x[V] * x[V] + x[V + 1] * x[V + 1])
    rx, ry, rz = x[RATE], x[RATE + 1], x[RATE + 2]
    heading = P[PHI + 2, PHI + 2]
    if v < SEARCH_SPEED or heading > SEARCH_HEADING * SEARCH_HEADING:
        return
    if rx * rx + ry * ry + rz * rz > SEARCH_RATE * SEARCH_RATE:
        return
    bx, by, bz = rotate_inverse(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], x[V], x[V + 1], x[V + 2])
    x[M_SUM] += bx / v
    x[M_SUM + 1] += by / v
    x[M_SUM + 2] += bz / v
    x[M_COUNT] += 1.0
    if x[M_COUNT] < SEARCH_TICKS:
        return
    fx, fy, fz = x[M_SUM], x[M_SUM + 1], x[M_SUM + 2]
    count = x[M_COUNT]
    x[M_SUM], x[M_SUM + 1], x[M_SUM + 2], x[M_COUNT] = 0.0, 0.0, 0.0, 0.0
    s = sqrt(fx * fx + fy * fy + fz * fz)
    if s < SEARCH_SPREAD * count:
        return
    fx, fy, fz = fx / s, fy / s, fz / s
    dx, dy, dz = rotate_inverse(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, 0.0, 1.0)
    s = dx * fx + dy * fy + dz * fz
    dx, dy, dz = dx - s * fx, dy - s * fy, dz - s * fz
    s = sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / s, dy / s, dz / s
    qw, qa, qb, qc = from_dcm(
        fx, fy, fz,
        dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx,
        dx, dy, dz,
    )  # fmt: skip
    x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3] = qw, qa, qb, qc
    x[MOUNTED] = 1.0
    x[M_BACK] = 0.0
    new_mount(x, P, p, w)
    tie_mount(x, P, p, w)


@kernel
def new_mount(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Prior of a mount that is known besides the attitude."""
    x[ARM_V] = p[ARM_V_0]
    reset(P, p, w, int(p[I_MOUNT]), 3, p[SD_MOUNT])
    reset(P, p, w, int(p[I_ARM_V]), 1, p[SD_ARM_V])


@kernel
def tie_mount(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Prior of a mount that was found by the attitude: it is off by what the attitude is off.

    The vehicle's axes came from the course, so that ``mu_v = C_vn phi_n`` and an error of its own.
    Taken for independent, the constraint would turn an error of heading into knowledge.
    """
    k = int(p[I_MOUNT])
    if k < 0:
        return
    reset(P, p, w, k, 3, MOUNT_UNKNOWN)
    qw, qa, qb, qc = mul(
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3], x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3]
    )
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(qw, qa, qb, qc)
    w[S3], w[S3 + 1], w[S3 + 2] = c0, c1, c2
    w[S3 + 3], w[S3 + 4], w[S3 + 5] = c3, c4, c5
    w[S3 + 6], w[S3 + 7], w[S3 + 8] = c6, c7, c8
    clear_correction(p, w)
    for i in range(3):
        clear_row(p, w)
        w[H + k + i] = 1.0
        for j in range(3):
            w[H + PHI + j] = -w[S3 + 3 * i + j]
        project(P, p, w)
        absorb(P, p, w, 0.0, p[SD_MOUNT] * p[SD_MOUNT])


@kernel
def turn_mount(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Turn the mount about when the car is found to go backwards fast."""
    vx, _vy, _vz, _wx, _wy, _wz = velocity(x)
    if vx < -BACK_SPEED:
        x[M_BACK] += dt
    elif vx > BACK_SPEED:
        x[M_BACK] = max(x[M_BACK] - dt, 0.0)
    if x[M_BACK] > BACK_TIME:
        qw, qa, qb, qc = mul(0.0, 0.0, 0.0, 1.0, x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3])
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3] = qw, qa, qb, qc
        x[M_BACK] = 0.0
        new_mount(x, P, p, w)
        tie_mount(x, P, p, w)


@kernel
def take_speed(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Take the wheel speed in the inbox: forward velocity times one plus its scale error."""
    clear_correction(p, w)
    vx, vy, vz, _wx, wy, wz = velocity(x)
    qw, qa, qb, qc = mul(
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3], x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3]
    )
    c0, c1, c2, _c3, _c4, _c5, _c6, _c7, _c8 = dcm(qw, qa, qb, qc)
    velocity_row(x, p, w, c0, c1, c2, 0, vx, vy - wz * x[ARM_V], vz + wy * x[ARM_V], 0.0)
    scale = 1.0 + x[SODO]
    for i in range(CORE):
        w[H + i] *= scale
    k = int(p[I_MOUNT])
    if k > 0:
        for i in range(k, k + 3):
            w[H + i] *= scale
    k = int(p[I_SODO])
    if k > 0:
        w[H + k] = vx
    y = x[IN_SPEED + 1] - scale * vx
    if not isnan(y):
        _gated(x, P, p, w, y, p[SD_SPEED] * p[SD_SPEED], p[GATE])
    inject(x, p, w)


@kernel
def take_height(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Take the pressure height in the inbox; its offset is a state."""
    k = int(p[I_BARO])
    if k < 0:
        return
    # the standard atmosphere: 288.15 K, 6.5 K/km
    height = 44330.77 * (1.0 - (x[IN_BARO + 1] / 101325.0) ** 0.1902632)
    if isnan(height):
        return
    if P[k, k] == 0.0:
        x[BARO] = height - x[LLA + 2]
        reset(P, p, w, k, 1, 20.0)
    clear_correction(p, w)
    clear_row(p, w)
    w[H + DP + 2] = -1.0
    w[H + k] = 1.0
    _gated(x, P, p, w, height - x[LLA + 2] - x[BARO], p[SD_BARO] * p[SD_BARO], p[GATE])
    inject(x, p, w)
