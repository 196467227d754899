"""What all estimators share: the layout of their memory, and how a sample enters it.

An estimator remembers one vector `x` and one matrix `P` (empty if it has no covariance). The
head of `x` is laid out here, the same for all; a filter's own states follow from `HEAD` on.
`p` holds parameters: the common ones below, then the filter's own from `P_HEAD` on.
`w` is scratch; its first cells tell what became of the accelerometer and the magnetometer.
"""

from math import atan2, cos, isinf, isnan, nan, sin, sqrt
from math import exp as exp_  # `exp` is a rotation's

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, inlined_kernel, kernel
from strapdown.kernels.quat import dcm, exp, from_acc, from_two_vectors, mul, normalize, rotate

# --- head of x -------------------------------------------------------------------------
T = 0  # time of the last sample used [s], NaN before the first
STATUS = 1  # bits of `status`
Q = 2  # q_nb: 4
BG = 6  # gyro bias [rad/s]: 3
STD_ATT = 9  # attitude error about north, east, down [rad]: 3
STD_BG = 12  # [rad/s]: 3
LLA = 15  # latitude, longitude, height [rad, rad, m]: 3
V = 18  # v_n [m/s]: 3
STD_POS = 21  # north, east, down [m]: 3
STD_V = 24  # [m/s]: 3
BA = 27  # accelerometer bias [m/s^2]: 3
STD_BA = 30  # [m/s^2]: 3
Q_VB = 33  # mount, body to vehicle: 4
OMEGA = 37  # last valid rate [rad/s]: 3
DT = 40  # usual sampling interval [s], zero before it is known
ALIGNED = 41  # NO, TILT, FULL or GIVEN
MAG = 42  # inbox: fresh?, field [T]: 4
STAR = 46  # inbox: fresh?, q_nb: 5
GNSS = 51  # inbox: fresh?, t, lla, v_n, std_position_n, std_velocity_n, heading: 15
BARO = 66  # inbox: fresh?, pressure [Pa]: 2
SPEED = 68  # inbox: fresh?, forward speed [m/s]: 2
AIRSPEED = 70  # inbox: fresh?, airspeed [m/s]: 2
T_FIELD = 72  # time of the last valid field [s]
FIELD = 73  # usual horizontal part of the field and its part down [T], zeros before: 2
FIELD_NEW = 75  # the same of a disturbed field that may become usual: 2
FIELD_HELD = 77  # how long it has stayed the same [s]
FIELD_WAIT = 78  # how long the field must still be as usual to be trusted [s]
AHEAD = 79  # how far the attitude is carried on by a held rate [s]
STUCK = 80  # how long a rate of zero is still doubted [s]
ONSETS = 81  # how often the field was disturbed of late, and the time of the last [s]: 2
HEAD = 83

# --- how far alignment is -----------------------------------------------------------------
NO = 0.0
TILT = 1.0  # roll and pitch from the accelerometer, heading waits for the first field
FULL = 2.0
GIVEN = 3.0  # the user set the attitude

# --- head of p -------------------------------------------------------------------------
P_MAX_GAP = 0  # [s]
P_USE_MAG = 1  # 0 or 1
P_COS_D = 2  # cosine and sine of the declination, the heading of magnetic north
P_SIN_D = 3
P_GYR_RANGE = 4  # [rad/s]
P_ACC_RANGE = 5  # [m/s^2]
P_REALIGN = 6  # 1: after a gap align again; 0: the filter widens its covariance
P_REJECT = 7  # 1: a field that is not as usual is not used
P_HEAD = 8

# --- head of w: diagnostics ---------------------------------------------------------------
D_ACC = 0  # innovation 3, sigma 3, outcome
D_MAG = 7  # innovation 3, sigma 3, outcome
W_HEAD = 14

# --- what `begin` asks of the filter ---------------------------------------------------------
SKIP = 0  # nothing: no usable sample, or no attitude yet
START = 1  # attitude was set just now: propagate by dt, reset what depends on it
GO = 2  # propagate by dt, then update
WIDEN = 3  # propagate over a gap of dt, widen the covariance, then update

# Beyond these a number is a broken sample, not a motion.
MAX_RATE2 = 1e8  # (10^4 rad/s)^2
MIN_ACC2 = 1e-12  # (10^-6 m/s^2)^2
MAX_ACC2 = 1e10  # (10^5 m/s^2)^2
MIN_MAG2 = 1e-24  # (10^-12 T)^2
MAX_MAG2 = 1e4  # (100 T)^2

# Three rates of exactly zero are no motion that stops: a gyroscope has noise and a bias.
TURNING2 = 1e-4  # (0.01 rad/s)^2, the box was turning
STUCK_TIME = 5.0  # then it may be an ideal sensor at rest [s]

# The usual field; `P_REJECT` says whether more than a flag comes of it.
FIELD_OFF = 0.2  # so far off, relative, it is disturbed: a fifth of its strength, or 11 deg of dip
FIELD_TIME = 10.0  # time constant of the usual field while nothing disturbs [s]
FIELD_STEADY = 30.0  # a disturbed field that stays the same for so long becomes usual [s]
FIELD_AGAIN = 1.0  # after a disturbance it must be as usual for so long [s]
FIELD_RECENT = 60.0  # time constant of "of late" [s]
FIELD_OFTEN = 8.0  # disturbed so often of late, it is the magnetometer that is not calibrated
FIELD_MISSING = 5.0  # without a valid sample for so long the field is missing [s]


@inlined_kernel
def load(x: Vec, t: float, j: int, t_mag: Vec, mag: Mat) -> int:
    """Put the latest field sample up to time `t` into the inbox; returns the next row."""
    while j < t_mag.shape[0] and t_mag[j] <= t:
        x[MAG] = 1.0
        x[MAG + 1] = mag[j, 0]
        x[MAG + 2] = mag[j, 1]
        x[MAG + 3] = mag[j, 2]
        j += 1
    return j


@kernel
def load_events(x: Vec, t: float, j: int, events: Mat) -> int:
    """Put rows (time, cell, count, values...) up to time `t` into their inboxes."""
    while j < events.shape[0] and events[j, 0] <= t:
        cell = int(events[j, 1])
        x[cell] = 1.0
        for i in range(int(events[j, 2])):
            x[cell + 1 + i] = events[j, 3 + i]
        j += 1
    return j


@kernel
def post(x: Vec, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """Check lengths and put one field sample, if not empty, into the inbox."""
    if gyr.shape[0] != 3 or acc.shape[0] != 3:
        return False
    if mag.shape[0] == 3:
        x[MAG] = 1.0
        x[MAG + 1] = mag[0]
        x[MAG + 2] = mag[1]
        x[MAG + 3] = mag[2]
        return True
    return bool(mag.shape[0] == 0)


@inlined_kernel
def store(x: Vec, w: Vec, k: int, out: Mat, out_diag: Mat) -> None:
    """Write row `k` of the outputs; `out_diag` may be empty."""
    for i in range(out.shape[1]):
        out[k, i] = x[STATUS + i]
    if out_diag.shape[0] > 0:
        for i in range(W_HEAD):
            out_diag[k, i] = w[i]


# fmt: off
@inlined_kernel
def field_in_body(
    w: float, x: float, y: float, z: float,
    mx: float, my: float, mz: float,
    cos_d: float, sin_d: float,
) -> tuple[float, float, float]:
    """Predicted field in b: with the dip that is measured, and the heading of the reference.

    So made, the difference to the measured field is one of heading only.
    """
    # fmt: on
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm(w, x, y, z)
    hx = c11 * mx + c12 * my + c13 * mz
    hy = c21 * mx + c22 * my + c23 * mz
    hz = c31 * mx + c32 * my + c33 * mz
    h = sqrt(hx * hx + hy * hy)
    hx, hy = h * cos_d, h * sin_d
    return (
        c11 * hx + c21 * hy + c31 * hz,
        c12 * hx + c22 * hy + c32 * hz,
        c13 * hx + c23 * hy + c33 * hz,
    )


@inlined_kernel
def advance_attitude(x: Vec, rx: float, ry: float, rz: float) -> None:
    """``q_nb <- q_nb exp(r_b)``."""
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    # The squared norm is off one by the round-off e of the step before, which leaves here: the
    # root's first term is off by 3 e^2 / 8 only.
    k = 1.5 - 0.5 * (qw * qw + qx * qx + qy * qy + qz * qz)
    ew, ea, eb, ec = exp(rx, ry, rz)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = mul(k * qw, k * qx, k * qy, k * qz, ew, ea, eb, ec)


@kernel
def set_status(x: Vec, bit: int) -> None:
    """Add a flag to the status word."""
    x[STATUS] = float(int(x[STATUS]) | bit)


# fmt: off
@kernel
def heading_from_mag(
    x: Vec, rx: float, ry: float, rz: float, cos_d: float, sin_d: float
) -> float:
    """Angle about down that turns the field of the inbox to its heading; NaN if vertical.

    ``r_b`` is the rotation since the time of the attitude.
    """
    # fmt: on
    ew, ea, eb, ec = exp(rx, ry, rz)
    hx, hy, hz = rotate(ew, ea, eb, ec, x[MAG + 1], x[MAG + 2], x[MAG + 3])
    hx, hy, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], hx, hy, hz)
    h2 = hx * hx + hy * hy
    angle = atan2(sin_d * hx - cos_d * hy, cos_d * hx + sin_d * hy)
    if not h2 > 1e-12 * (h2 + hz * hz):
        angle = nan
    return angle


@kernel
def turn_heading(x: Vec, angle: float) -> None:
    """Turn the attitude about down."""
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = mul(
        cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle), x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    )


@kernel
def level(x: Vec, ax: float, ay: float, az: float) -> None:
    """Turn the attitude the short way until the specific force points up."""
    fx, fy, fz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ax, ay, az)
    cw, cx, cy, cz = from_two_vectors(fx, fy, fz, 0.0, 0.0, -1.0)
    w, a, b, c = mul(cw, cx, cy, cz, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(w, a, b, c)


@inlined_kernel
def note(w: Vec, cell: int, ix: float, iy: float, iz: float, outcome: int) -> None:
    """Write an innovation without stated sigma into the diagnostics."""
    w[cell] = ix
    w[cell + 1] = iy
    w[cell + 2] = iz
    w[cell + 3] = nan
    w[cell + 4] = nan
    w[cell + 5] = nan
    w[cell + 6] = outcome


@inlined_kernel
def _differs(h: float, d: float, usual_h: float, usual_d: float) -> bool:
    """Whether a field is off another in strength or dip."""
    dh, dd = h - usual_h, d - usual_d
    usual2 = usual_h * usual_h + usual_d * usual_d
    return dh * dh + dd * dd > FIELD_OFF * FIELD_OFF * usual2


@kernel
def _watch_disturbed(x: Vec, h: float, d: float, dt: float) -> None:
    """Take a field that is not as usual for the usual one once it has long stayed the same."""
    if x[FIELD_WAIT] < FIELD_AGAIN:  # the sample before was as usual
        t = x[T_FIELD]
        x[ONSETS] = 1.0 + x[ONSETS] * exp_(-(t - x[ONSETS + 1]) / FIELD_RECENT)
        x[ONSETS + 1] = t
    x[FIELD_WAIT] = FIELD_AGAIN
    if x[FIELD_HELD] == 0.0 or _differs(h, d, x[FIELD_NEW], x[FIELD_NEW + 1]):
        x[FIELD_NEW], x[FIELD_NEW + 1] = h, d
        x[FIELD_HELD] = 1e-9  # it has begun
    else:
        k = dt / (FIELD_TIME + dt)
        x[FIELD_NEW] += k * (h - x[FIELD_NEW])
        x[FIELD_NEW + 1] += k * (d - x[FIELD_NEW + 1])
        x[FIELD_HELD] += dt
        if x[FIELD_HELD] > FIELD_STEADY:
            x[FIELD], x[FIELD + 1] = x[FIELD_NEW], x[FIELD_NEW + 1]
            x[FIELD_HELD] = 0.0


@inlined_kernel
def watch_field(x: Vec, t: float, m2: float) -> int:
    """Compare strength and dip of the field in the inbox with the usual ones; returns flags.

    `m2` is its square.
    """
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    d = 2.0 * ((qx * qz - qw * qy) * x[MAG + 1] + (qy * qz + qw * qx) * x[MAG + 2])
    d += (1.0 - 2.0 * (qx * qx + qy * qy)) * x[MAG + 3]
    h = sqrt(max(m2 - d * d, 0.0))
    dt = min(t - x[T_FIELD], 1.0)
    x[T_FIELD] = t
    bits = 0
    if x[FIELD] + abs(x[FIELD + 1]) == 0.0:
        x[FIELD], x[FIELD + 1] = h, d
    elif _differs(h, d, x[FIELD], x[FIELD + 1]):
        _watch_disturbed(x, h, d, dt)
        bits = s.MAG_DISTURBED
    elif x[FIELD_WAIT] > 0.0:
        x[FIELD_HELD] = 0.0
        x[FIELD_WAIT] = max(x[FIELD_WAIT] - dt, 0.0)
        bits = s.MAG_DISTURBED
    else:
        k = dt / (FIELD_TIME + dt)
        x[FIELD] += k * (h - x[FIELD])
        x[FIELD + 1] += k * (d - x[FIELD + 1])
    return bits


@kernel
def _watch_zeros(x: Vec, dt: float) -> int:
    """Whether rates of exactly zero are to be doubted; the rate before them is still kept."""
    last2 = x[OMEGA] * x[OMEGA] + x[OMEGA + 1] * x[OMEGA + 1] + x[OMEGA + 2] * x[OMEGA + 2]
    if last2 > 0.0:  # the first of them
        x[STUCK] = STUCK_TIME if last2 > TURNING2 else 0.0
    bits = 0
    if x[STUCK] > 0.0:
        x[STUCK] -= dt
        bits = s.GYR_STUCK
    return bits


# fmt: off
@inlined_kernel
def begin(
    x: Vec, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> tuple[int, float, float, float, float, bool, bool]:
    """Judge a sample, keep the time, align; tells the filter what to do with it.

    Returns one of SKIP, START, GO, WIDEN; the interval dt; the mean rate over it; and whether
    accelerometer and magnetometer may be used. A sample of inf is absent: the last rate is held
    until the next one, which stands for all the time since the last and puts that right.
    """
    # fmt: on
    bits = 0
    w[D_ACC + 6] = s.NOT_MEASURED
    w[D_MAG + 6] = s.NOT_MEASURED
    has_acc = not isinf(ax)
    a2 = ax * ax + ay * ay + az * az
    if has_acc:
        if not (a2 > MIN_ACC2 and a2 < MAX_ACC2):
            has_acc = False
            bits |= s.ACC_INVALID
        elif abs(ax) >= p[P_ACC_RANGE] or abs(ay) >= p[P_ACC_RANGE] or abs(az) >= p[P_ACC_RANGE]:
            has_acc = False
            bits |= s.SATURATED
        if not has_acc:
            note(w, D_ACC, nan, nan, nan, s.REJECTED_INVALID)
    has_mag = x[MAG] > 0.0 and p[P_USE_MAG] > 0.0
    m2 = 0.0
    if has_mag:
        m2 = x[MAG + 1] * x[MAG + 1] + x[MAG + 2] * x[MAG + 2] + x[MAG + 3] * x[MAG + 3]
        if not (m2 > MIN_MAG2 and m2 < MAX_MAG2):
            has_mag = False
            x[MAG] = 0.0
            bits |= s.MAG_INVALID
            note(w, D_MAG, nan, nan, nan, s.REJECTED_INVALID)

    absent = isinf(gx)
    if absent:
        gx, gy, gz = x[OMEGA], x[OMEGA + 1], x[OMEGA + 2]
        if x[AHEAD] > p[P_MAX_GAP]:  # too long to hold a rate
            gx = nan
    if not gx * gx + gy * gy + gz * gz < MAX_RATE2 or (not t > x[T] and not isnan(x[T])):
        # No rate: the next valid sample integrates over this one. The field waits in the inbox.
        bits |= s.GYR_INVALID
        if x[ALIGNED] == NO:
            bits |= s.ALIGNING
        x[STATUS] = float(bits)
        return SKIP, 0.0, 0.0, 0.0, 0.0, False, False
    x[MAG] = 0.0
    if has_mag and x[ALIGNED] != NO:
        field_bits = watch_field(x, t, m2)
        bits |= field_bits
        if field_bits != 0 and p[P_REJECT] > 0.0 and x[ONSETS] < FIELD_OFTEN:
            has_mag = False
            note(w, D_MAG, nan, nan, nan, s.REJECTED_DISTURBED)
    elif t - x[T_FIELD] > FIELD_MISSING and x[FIELD] + abs(x[FIELD + 1]) > 0.0:
        bits |= s.MAG_MISSING
    if abs(gx) >= p[P_GYR_RANGE] or abs(gy) >= p[P_GYR_RANGE] or abs(gz) >= p[P_GYR_RANGE]:
        bits |= s.SATURATED

    dt = 0.0
    wx, wy, wz = gx, gy, gz
    todo = GO
    if not isnan(x[T]):
        dt = t - x[T]
        usual = x[DT]
        if dt > p[P_MAX_GAP]:
            bits |= s.GAP
            todo = WIDEN
        elif usual == 0.0:
            x[DT] = dt
        else:  # a mean, so that jitter does not pass for samples that are missing
            x[DT] = usual + 0.02 * (min(dt, 2.0 * usual) - usual)
        if x[AHEAD] > 0.0 and not absent:  # the rate of all the time since the last one
            ahead = x[AHEAD] / dt
            wx += ahead * (gx - x[OMEGA])
            wy += ahead * (gy - x[OMEGA + 1])
            wz += ahead * (gz - x[OMEGA + 2])
        elif 0.0 < 1.5 * usual < dt:  # samples are missing: their rate is the mean of the two
            missed = 0.5 * (dt - usual) / dt
            wx += missed * (x[OMEGA] - gx)
            wy += missed * (x[OMEGA + 1] - gy)
            wz += missed * (x[OMEGA + 2] - gz)
    if gx == 0.0 and gy == 0.0 and gz == 0.0:
        bits |= _watch_zeros(x, dt)
    if absent:
        x[AHEAD] += dt
    elif x[AHEAD] > 0.0:
        x[AHEAD] = 0.0
    x[T] = t
    x[OMEGA] = gx
    x[OMEGA + 1] = gy
    x[OMEGA + 2] = gz

    if x[ALIGNED] == NO:
        todo = SKIP
        if has_acc:
            x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = from_acc(ax, ay, az)
            x[ALIGNED] = TILT
            todo = START
    elif todo == WIDEN and p[P_REALIGN] > 0.0:
        todo = START
        dt = 0.0
        if has_acc:
            level(x, ax, ay, az)
        if x[ALIGNED] == FULL:
            x[ALIGNED] = TILT
    if x[ALIGNED] == TILT and has_mag:
        rx, ry, rz = (wx - x[BG]) * dt, (wy - x[BG + 1]) * dt, (wz - x[BG + 2]) * dt
        angle = heading_from_mag(x, rx, ry, rz, p[P_COS_D], p[P_SIN_D])
        if not isnan(angle):
            turn_heading(x, angle)
            x[ALIGNED] = FULL
            todo = START
    if x[ALIGNED] == NO:
        bits |= s.ALIGNING
    x[STATUS] = float(bits)
    return todo, dt, wx, wy, wz, has_acc, has_mag


@kernel
def note_sigma(w: Vec, cell: int, i: int, innovation: float, variance: float) -> None:
    """Write component `i` of an innovation and its sigma into the diagnostics."""
    w[cell + i] = innovation
    w[cell + 3 + i] = sqrt(variance)
