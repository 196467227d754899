"""Dead reckoning: level at rest, begin at a fix, then mechanise in the wander frame.

Frames: n = NED, b = body. While the box rests, its level is the running mean of what the
accelerometer says, and its mean rate, less the Earth's, the gyro's bias.
"""

from math import atan2, cos, inf, isnan, sin

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mechanisation.layout import OMEGA, OUT, P_SIZE, X_SIZE
from strapdown.kernels.mechanisation.layout import W_SIZE as W_SIZE
from strapdown.kernels.mechanisation.run import begin_level, feed, tell
from strapdown.kernels.mechanisation.run import step as mechanise
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    GIVEN,
    GNSS,
    LLA,
    SKIP,
    Q,
    T,
    V,
    advance_attitude,
    begin,
    load,
    load_events,
    post,
    set_status,
    store,
    turn_heading,
)
from strapdown.kernels.quat import exp, mul, rotate, rotate_inverse

# --- behind the mechanisation's cells -----------------------------------------------------
SINCE = X_SIZE  # time of the first sample [s]
RESTED = X_SIZE + 1  # samples averaged
STARTED = X_SIZE + 2  # 1: it navigates
RATE = X_SIZE + 3  # sum of the rates at rest [rad/s]: 3
FORCE = X_SIZE + 6  # last valid specific force [m/s^2]: 3
SIZE = X_SIZE + 9

P_ALIGN_TIME = P_SIZE  # [s]
P_HEADING = P_SIZE + 1  # known heading [rad]; NaN: none
P_COUNT = P_SIZE + 2


@kernel
def _average(x: Vec, has_acc: bool, wx: float, wy: float, wz: float) -> None:
    """Add one sample at rest to level and mean rate."""
    x[RESTED] += 1.0
    x[RATE] += wx
    x[RATE + 1] += wy
    x[RATE + 2] += wz
    if has_acc:
        fx, fy, fz = rotate(
            x[Q], x[Q + 1], x[Q + 2], x[Q + 3], x[FORCE], x[FORCE + 1], x[FORCE + 2]
        )
        # turns the force towards up, by its share of the mean
        k = 1.0 / x[RESTED]
        ew, ea, eb, ec = exp(k * atan2(-fy, -fz), k * atan2(fx, -fz), 0.0)
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = mul(
            ew, ea, eb, ec, x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        )


@kernel
def _start(x: Vec, p: Vec, w: Vec, t: float) -> None:
    """Begin to navigate at the fix in the inbox."""
    x[GNSS] = 0.0
    if x[ALIGNED] != GIVEN and not isnan(p[P_HEADING]):
        qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        yaw = atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        turn_heading(x, p[P_HEADING] - yaw)
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    lat, lon, height = x[GNSS + 2], x[GNSS + 3], x[GNSS + 4]
    vn, ve, vd = 0.0, 0.0, 0.0
    if x[RESTED] > 0.0:
        ex, ey, ez = rotate_inverse(qw, qx, qy, qz, p[OMEGA] * cos(lat), 0.0, -p[OMEGA] * sin(lat))
        x[BG] = x[RATE] / x[RESTED] - ex
        x[BG + 1] = x[RATE + 1] / x[RESTED] - ey
        x[BG + 2] = x[RATE + 2] / x[RESTED] - ez
    elif not isnan(x[GNSS + 5] + x[GNSS + 6] + x[GNSS + 7]):
        vn, ve, vd = x[GNSS + 5], x[GNSS + 6], x[GNSS + 7]
    begin_level(x, p, w, t, lat, lon, height, vn, ve, vd, qw, qx, qy, qz)
    x[ALIGNED] = GIVEN  # a field that comes later changes nothing
    x[STARTED] = 1.0
    _show(x, p, w)


@kernel
def _show(x: Vec, p: Vec, w: Vec) -> None:
    """Copy what the mechanisation has to where all estimators show it."""
    tell(x, p, w)
    for i in range(3):
        x[LLA + i] = w[OUT + i]
        x[V + i] = w[OUT + 3 + i]
    for i in range(4):
        x[Q + i] = w[OUT + 6 + i]


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` by one sample."""
    # fmt: on
    first = isnan(x[T])
    todo, dt, wx, wy, wz, has_acc, _ = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if x[STARTED] > 0.0:
        set_status(x, s.OUTAGE)
    if todo == SKIP:
        return
    if first:
        x[SINCE] = t
    if has_acc:
        x[FORCE], x[FORCE + 1], x[FORCE + 2] = ax, ay, az
    if x[STARTED] > 0.0:
        bx, by, bz = wx - x[BG], wy - x[BG + 1], wz - x[BG + 2]
        feed(x, t, bx, by, bz, x[FORCE], x[FORCE + 1], x[FORCE + 2])
        mechanise(x, p, w)
        _show(x, p, w)
        return
    resting = x[ALIGNED] != GIVEN and t - x[SINCE] < p[P_ALIGN_TIME]
    if resting:
        _average(x, has_acc, wx, wy, wz)
    else:  # it may be moved before the first fix; at rest it showed bias and Earth's rate
        k = 1.0 / max(x[RESTED], 1.0)
        bx, by, bz = wx - k * x[RATE], wy - k * x[RATE + 1], wz - k * x[RATE + 2]
        advance_attitude(x, bx * dt, by * dt, bz * dt)
    known = x[GNSS] > 0.0 and not isnan(x[GNSS + 2] + x[GNSS + 3] + x[GNSS + 4])
    if known and not resting and has_acc:
        _start(x, p, w, t)
        set_status(x, s.OUTAGE)


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
    load(x, inf, j, t_mag, mag)
    load_events(x, inf, e, events)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
