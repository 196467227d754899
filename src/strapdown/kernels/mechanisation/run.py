"""The step that all mechanisations share, and the loop over samples.

The specific force turns with the body inside the step exactly (`increments`); the frame turns
by so little that its mean is enough. Position takes the trapezoid of the velocity, corrected by
the specific force at both ends, which makes it of fourth order.
"""

from math import atan2, cos, sin, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mechanisation.attitude import advance, matrix_of, quat_of
from strapdown.kernels.mechanisation.ellipsoid import ned_axes, normal
from strapdown.kernels.mechanisation.frames import (
    cartesian_middle,
    cartesian_move,
    ned_middle,
    ned_move,
    wander_middle,
    wander_move,
)
from strapdown.kernels.mechanisation.increments import (
    left_jacobian,
    rotation_vector,
    translation_vector,
    weighted,
)
from strapdown.kernels.mechanisation.layout import (
    AT_END,
    AT_START,
    ATT,
    BEFORE,
    C0,
    C1,
    COUNT,
    DV,
    FIRST,
    FRAME,
    HEIGHT,
    HELD,
    INERTIAL,
    NED,
    OK,
    OMEGA,
    OUT,
    PHI,
    POS,
    Q_EW,
    R_N,
    REST,
    SLOTS,
    SPAN,
    STATUS,
    T0,
    TH,
    TURN,
    W_IN,
    WANDER,
    T,
    U,
    V,
)
from strapdown.kernels.quat import mul, rotate, rotate_inverse


@kernel
def _middle(x: Vec, p: Vec, w: Vec, h: float) -> None:
    """Write the frame's turn and the change of velocity by gravity and Coriolis."""
    frame = int(p[FRAME])
    if frame == NED:
        ned_middle(x, p, w, h)
    elif frame == WANDER:
        wander_middle(x, p, w, h)
    else:
        cartesian_middle(x, p, w, h)


@kernel
def prime(x: Vec, p: Vec, w: Vec) -> None:
    """Find what a step takes from the step before, for the first one."""
    w[U], w[U + 1], w[U + 2] = 0.0, 0.0, 0.0
    x[R_N] = 1.0
    for _ in range(2):  # the radii first, then the rates that divide by them
        _middle(x, p, w, 0.0)


# fmt: off
@kernel
def begin_level(
    x: Vec, p: Vec, w: Vec, t: float,
    lat: float, lon: float, height: float,
    vn: float, ve: float, vd: float,
    qw: float, qx: float, qy: float, qz: float,
) -> None:
    """Begin in the wander frame, its x axis to the north, with the attitude a quaternion."""
    # fmt: on
    x[T], x[T0] = t, t
    x[POS + 2], x[HEIGHT] = height, height
    x[V], x[V + 1], x[V + 2] = vn, ve, vd * (1.0 - p[HELD])
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = qw, qx, qy, qz
    x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3] = ned_axes(lat, lon)
    x[COUNT], x[SPAN], x[BEFORE], x[STATUS] = p[FIRST], 0.0, 0.0, OK
    prime(x, p, w)


@kernel
def step(x: Vec, p: Vec, w: Vec) -> None:
    """Advance attitude, velocity and position by the samples in the slots."""
    m = int(p[SLOTS])
    h = x[SPAN]
    if p[FIRST] > 0.0:
        _recall(x, h)
    rx, ry, rz = rotation_vector(x, p, m)
    sx, sy, sz = translation_vector(x, p, m)
    w[PHI], w[PHI + 1], w[PHI + 2] = rx, ry, rz
    matrix_of(x, p, w, C0)
    _first_half(x, w, h, sx, sy, sz)
    _middle(x, p, w, h)
    if x[STATUS] != OK:
        return
    dx, dy, dz = left_jacobian(rx, ry, rz, sx, sy, sz)
    ux, uy, uz = _times(w, C0, dx, dy, dz)
    rx, ry, rz = _times(w, C0, rx, ry, rz)
    # mean over the step of exp(-turn tau x) exp(phi tau x) s, to second order in the small turn:
    # u - turn x (u / 2 + phi x u / 12 - turn x u / 6)
    tx, ty, tz = w[TURN], w[TURN + 1], w[TURN + 2]
    ax, ay, az = rx / 12.0 - tx / 6.0, ry / 12.0 - ty / 6.0, rz / 12.0 - tz / 6.0
    bx = 0.5 * ux + ay * uz - az * uy
    by = 0.5 * uy + az * ux - ax * uz
    bz = 0.5 * uz + ax * uy - ay * ux
    gx = ux - ty * bz + tz * by + w[REST]
    gy = uy - tz * bx + tx * bz + w[REST + 1]
    gz = uz - tx * by + ty * bx + w[REST + 2]
    level = int(p[FRAME]) >= NED
    if level and p[HELD] > 0.0:
        gz = -x[V + 2]
    advance(x, p, w, m)
    matrix_of(x, p, w, C1)
    fx, fy, fz = weighted(x, p, DV, AT_START, m)
    ax, ay, az = _times(w, C0, fx, fy, fz)
    fx, fy, fz = weighted(x, p, DV, AT_END, m)
    bx, by, bz = _times(w, C1, fx, fy, fz)
    ax = x[V] + 0.5 * gx + (ax - bx) / 12.0
    ay = x[V + 1] + 0.5 * gy + (ay - by) / 12.0
    az = x[V + 2] + 0.5 * gz + (az - bz) / 12.0
    x[V] += gx
    x[V + 1] += gy
    x[V + 2] += gz
    if level and p[HELD] > 0.0:
        az = 0.0
    frame = int(p[FRAME])
    if frame == NED:
        ned_move(x, h, ax, ay, az)
    elif frame == WANDER:
        wander_move(x, p, h, ax, ay, az)
    else:
        cartesian_move(x, p, h, ax, ay, az)
    if p[FIRST] > 0.0:
        for i in range(3):
            x[TH + i] = x[TH + 3 + i]
            x[DV + i] = x[DV + 3 + i]
        x[BEFORE] = h
    x[COUNT] = p[FIRST]
    x[SPAN] = 0.0


@kernel
def _first_half(x: Vec, w: Vec, h: float, sx: float, sy: float, sz: float) -> None:
    """Write twice the change of velocity by specific force over the first half of the step."""
    ux, uy, uz = left_jacobian(0.5 * w[PHI], 0.5 * w[PHI + 1], 0.5 * w[PHI + 2], sx, sy, sz)
    ux, uy, uz = _times(w, C0, ux, uy, uz)
    k = 0.25 * h
    tx, ty, tz = k * x[W_IN], k * x[W_IN + 1], k * x[W_IN + 2]
    w[U] = ux - ty * uz + tz * uy
    w[U + 1] = uy - tz * ux + tx * uz
    w[U + 2] = uz - tx * uy + ty * ux


@kernel
def _recall(x: Vec, h: float) -> None:
    """Bring the sample before to the length of this step; if there is none, take this one."""
    k = h / x[BEFORE] if x[BEFORE] > 0.0 else 0.0
    for i in range(3):
        x[TH + i] *= k
        x[DV + i] *= k
        if k == 0.0:
            x[TH + i] = x[TH + 3 + i]
            x[DV + i] = x[DV + 3 + i]


# fmt: off
@kernel
def _times(w: Vec, at: int, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Product of the matrix at ``w[at]`` with a vector."""
    # fmt: on
    return (
        w[at] * vx + w[at + 1] * vy + w[at + 2] * vz,
        w[at + 3] * vx + w[at + 4] * vy + w[at + 5] * vz,
        w[at + 6] * vx + w[at + 7] * vy + w[at + 8] * vz,
    )


@kernel
def tell(x: Vec, p: Vec, w: Vec) -> None:
    """Write latitude, longitude, height, ``v_n`` and ``q_nb`` into `w`."""
    qw, qx, qy, qz = quat_of(x, p)
    vx, vy, vz = x[V], x[V + 1], x[V + 2]
    lat, lon, height = x[POS], x[POS + 1], x[POS + 2]
    frame = int(p[FRAME])
    if frame != NED:
        if frame == WANDER:
            ew, ea, eb, ec = x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3]
            dx, dy, dz = rotate(ew, ea, eb, ec, 0.0, 0.0, 1.0)  # down
            lat, lon = atan2(-dz, sqrt(dx * dx + dy * dy)), atan2(-dy, -dx)
        else:
            ew, ea, eb, ec = 1.0, 0.0, 0.0, 0.0
            rx, ry, rz = x[POS], x[POS + 1], x[POS + 2]
            if frame == INERTIAL:
                vx, vy = vx + p[OMEGA] * ry, vy - p[OMEGA] * rx
                half = 0.5 * p[OMEGA] * (x[T] - x[T0])
                ew, ec = cos(half), -sin(half)  # q_ei
            rx, ry, rz = rotate(ew, ea, eb, ec, rx, ry, rz)
            s, c, _, height = normal(p, rx, ry, rz)
            lat, lon = atan2(s, c), atan2(ry, rx)
        vx, vy, vz = rotate(ew, ea, eb, ec, vx, vy, vz)
        qw, qx, qy, qz = mul(ew, ea, eb, ec, qw, qx, qy, qz)  # q_eb
        ew, ea, eb, ec = ned_axes(lat, lon)
        vx, vy, vz = rotate_inverse(ew, ea, eb, ec, vx, vy, vz)
        qw, qx, qy, qz = mul(ew, -ea, -eb, -ec, qw, qx, qy, qz)
    else:
        lon -= 6.283185307179586 * _turns(lon)
    w[OUT], w[OUT + 1], w[OUT + 2] = lat, lon, height
    w[OUT + 3], w[OUT + 4], w[OUT + 5] = vx, vy, vz
    w[OUT + 6], w[OUT + 7], w[OUT + 8], w[OUT + 9] = qw, qx, qy, qz


@kernel
def _turns(lon: float) -> float:
    """Full turns to take off a longitude, to bring it into [-pi, pi)."""
    n = int(lon / 6.283185307179586)
    rest = lon - 6.283185307179586 * n
    if rest >= 3.141592653589793:
        n += 1
    if rest < -3.141592653589793:
        n -= 1
    return float(n)


# fmt: off
@kernel
def feed(
    x: Vec, t: float, gx: float, gy: float, gz: float, fx: float, fy: float, fz: float
) -> None:
    """Put one sample into its slot: mean rate and specific force since the one before."""
    # fmt: on
    dt = t - x[T]
    i = 3 * int(x[COUNT])
    x[TH + i], x[TH + i + 1], x[TH + i + 2] = gx * dt, gy * dt, gz * dt
    x[DV + i], x[DV + i + 1], x[DV + i + 2] = fx * dt, fy * dt, fz * dt
    x[T] = t
    x[SPAN] += dt
    x[COUNT] += 1.0


@kernel
def run(x: Vec, p: Vec, w: Vec, t: Vec, gyr: Mat, acc: Mat, out: Mat) -> int:
    """Loop of `step` over mean rates and specific forces; returns the rows written.

    It ends early where a step is refused, with the reason in ``x[STATUS]``.
    """
    row = 0
    for k in range(t.shape[0]):
        feed(x, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        if x[COUNT] == p[SLOTS]:
            step(x, p, w)
            if x[STATUS] != OK:
                return row
            tell(x, p, w)
            for i in range(10):
                out[row, i] = w[OUT + i]
            row += 1
    return row
