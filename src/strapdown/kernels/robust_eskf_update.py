"""Measurements of the robust error-state filter: velocity, rest, heading of the field.

They enter when an interval is closed, one scalar after the other, after the covariance has
been propagated over it.
"""

from math import atan2, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    BA,
    BG,
    D_ACC,
    D_MAG,
    P_COS_D,
    P_SIN_D,
    STD_BA,
    STD_BG,
    V,
    note_sigma,
)
from strapdown.kernels.quat import exp, mul, normalize
from strapdown.kernels.robust_eskf_covariance import (
    EBA,
    EBG,
    EMG,
    INTERVAL,
    LAG,
    PHI,
    TAU,
    THETA,
    VEL,
    N,
    enter,
    propagate,
)
from strapdown.kernels.robust_eskf_layout import (
    ASTRAY,
    ATT,
    DELAY,
    DRIFT,
    ERROR,
    EXTRA,
    FIELD,
    FLAGS,
    GYR_MEAN,
    MEASURED,
    MG,
    OPEN,
    P_ACC_BIAS_STD,
    P_ACC_NOISE,
    P_GYR_BIAS_WALK,
    P_GYR_NOISE,
    P_GYR_RATE_NOISE,
    P_GYR_SCALE_STD,
    P_MAG_DELAY_STD,
    P_MAG_STD,
    P_MAG_TIME,
    P_MAG_WALK,
    P_REST_TIME,
    P_TAILS,
    P_VELOCITY_STD,
    P_VELOCITY_TIME,
    QUIET,
    R_CLOSED,
    R_COUNT,
    R_MEASURED,
    R_ROWS,
    R_STEP,
    R_SUMS,
    SCRATCH,
    SINCE_MAG,
    USUAL,
)

LOW_PASS = 0.5  # time constant of the means that show rest [s]
REST_SPEED = 0.01  # speed at rest [m/s]
REST_RATE = 3.5e-4  # mean rate at rest, bias apart [rad/s]
LOST_HEADING = 15.0  # deviations of the field to the side, alone, that no disturbance explains
LOST_TIME = 5.0  # on the mean of so long [s]
DISTURBED = 10.0  # deviations of the field that the flag tells


@kernel
def heavy_tail(tails: float, ratio: float) -> float:
    """Factor on a variance so that a normal update follows Student's t.

    `ratio` is the innovation squared over its variance, `tails` the degrees of freedom.
    """
    return max(1.0, (tails + ratio) / (tails + 1.0))


@kernel
def _measure(P: Mat, w: Vec, i: int, h_lag: float, z: float, r: float) -> None:
    """Enter a scalar into covariance and error state, and record it for the smoother."""
    m = R_MEASURED + int(w[R_COUNT]) * MEASURED
    innovation = z - w[ERROR + i] - h_lag * w[ERROR + LAG]
    variance = enter(P, i, h_lag, r, w, m + 4)
    k = innovation / sqrt(variance)
    for j in range(N):
        w[ERROR + j] += k * w[m + 4 + j]
    w[m] = float(i)
    w[m + 1] = h_lag
    w[m + 2] = innovation
    w[m + 3] = variance
    w[R_COUNT] += 1.0


@kernel
def clear(x: Vec) -> None:
    """Open a new interval."""
    for i in range(INTERVAL):
        x[OPEN + i] = 0.0
    for i in range(6):
        x[FIELD + i] = 0.0
    x[EXTRA] = 0.0
    x[EXTRA + 1] = 0.0


@kernel
def _velocity(x: Vec, P: Mat, p: Vec, w: Vec, rest: bool) -> None:
    """Velocity is zero: at rest exactly, else within its bound, with heavy tails."""
    tau = x[OPEN + TAU]
    bound = p[P_VELOCITY_STD] * p[P_VELOCITY_STD]
    fade = min(1.0, 0.5 * tau)
    for i in range(3):
        v = x[V + i]
        expected = P[VEL + i, VEL + i] + bound
        x[DRIFT + i] += fade * (v / sqrt(expected) - x[DRIFT + i])
        r = REST_SPEED * REST_SPEED
        if not rest:  # one look per interval at something that changes over `velocity_time`
            r = bound * max(1.0, 2.0 * p[P_VELOCITY_TIME] / tau)
            r *= heavy_tail(p[P_TAILS], v * v / expected)
        note_sigma(w, D_ACC, i, -v - w[ERROR + VEL + i], P[VEL + i, VEL + i] + r)
        _measure(P, w, VEL + i, 0.0, -v, r)
    w[D_ACC + 6] = s.ACCEPTED


@kernel
def _rest(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """At rest the mean rate is the gyro's bias; heavy tails, lest slow turning pass for it."""
    r0 = REST_RATE * REST_RATE
    for i in range(3):
        d = x[GYR_MEAN + i] - x[BG + i]
        r = r0 * max(1.0, 2.0 * LOW_PASS / x[OPEN + TAU])
        r *= heavy_tail(p[P_TAILS], d * d / (P[EBG + i, EBG + i] + r0))
        _measure(P, w, EBG + i, 0.0, d, r)


@kernel
def _heading(x: Vec, P: Mat, p: Vec, w: Vec) -> int:
    """Heading from the mean horizontal field of the interval; returns status bits.

    How far the field is off its usual horizontal and vertical strength tells how large the
    disturbance is, and so how much the third component, its direction, may be off.
    """
    k = 1.0 / x[FIELD + 5]
    turn_n, turn_e = k * x[FIELD + 3], k * x[FIELD + 4]
    mn = k * x[FIELD] - x[DELAY] * turn_n
    me = k * x[FIELD + 1] - x[DELAY] * turn_e
    md = k * x[FIELD + 2]
    h2 = mn * mn + me * me
    if not h2 > 0.0:
        return s.MAG_INVALID
    if x[USUAL + 2] == 0.0:  # the first field is the usual one
        x[USUAL] = sqrt(h2)
        x[USUAL + 1] = md
        x[USUAL + 2] = 400.0 * p[P_MAG_STD] * p[P_MAG_STD]
    dh = sqrt(h2) - x[USUAL]
    dd = md - x[USUAL + 1]
    off2 = dh * dh + dd * dd
    usual = p[P_MAG_STD] * p[P_MAG_STD]
    tails = p[P_TAILS]
    variance = (tails * usual + off2) / (tails + 2.0)
    c, d = p[P_COS_D], p[P_SIN_D]
    z = atan2(d * mn - c * me, c * mn + d * me)
    r = variance / (x[USUAL] * x[USUAL])
    d = z - w[ERROR + PHI + 2]
    r *= heavy_tail(tails + 2.0, d * d / (P[PHI + 2, PHI + 2] + r))
    # a disturbance lasts: looks that are closer than it tell the same
    lasting = max(1.0, 2.0 * p[P_MAG_TIME] / x[SINCE_MAG])
    note_sigma(w, D_MAG, 0, dh, variance)
    note_sigma(w, D_MAG, 1, d * x[USUAL], (P[PHI + 2, PHI + 2] + r) * x[USUAL] * x[USUAL])
    note_sigma(w, D_MAG, 2, dd, variance)
    w[D_MAG + 6] = s.ACCEPTED
    if off2 < DISTURBED * DISTURBED * usual:
        x[ASTRAY] += min(1.0, x[SINCE_MAG] / LOST_TIME) * (z - x[ASTRAY])
    if abs(x[ASTRAY]) * x[USUAL] > LOST_HEADING * p[P_MAG_STD]:  # the gyro has missed a turn
        P[PHI + 2, PHI + 2] += x[ASTRAY] * x[ASTRAY]
        x[ASTRAY] = 0.0
    # with more delay than assumed the field stood back by its turning
    h_lag = (turn_n * me - turn_e * mn) / h2
    _measure(P, w, PHI + 2, h_lag, z, r * lasting)
    x[USUAL + 2] += p[P_MAG_WALK] * p[P_MAG_WALK] * x[SINCE_MAG]
    gain = x[USUAL + 2] / (x[USUAL + 2] + variance * lasting)
    x[USUAL] += gain * dh
    x[USUAL + 1] += gain * dd
    x[USUAL + 2] *= 1.0 - gain
    x[SINCE_MAG] = 0.0
    if off2 > DISTURBED * DISTURBED * usual:
        w[D_MAG + 6] = s.REJECTED_DISTURBED
        return s.MAG_DISTURBED
    return 0


@kernel
def add_noise(x: Vec, P: Mat, p: Vec) -> None:
    """Process noise of the interval."""
    tau = x[OPEN + TAU]
    tx, ty, tz = x[OPEN + THETA], x[OPEN + THETA + 1], x[OPEN + THETA + 2]
    rate2 = (tx * tx + ty * ty + tz * tz) / (tau * tau)
    phi = p[P_GYR_NOISE] * p[P_GYR_NOISE] + p[P_GYR_RATE_NOISE] * p[P_GYR_RATE_NOISE] * rate2
    vel = p[P_ACC_NOISE] * p[P_ACC_NOISE]
    bias = p[P_GYR_BIAS_WALK] * p[P_GYR_BIAS_WALK]
    # constants may change by their own size within hours: their variance never reaches zero
    acc_bias = 1e-4 * p[P_ACC_BIAS_STD] * p[P_ACC_BIAS_STD]
    scale = 1e-6 * p[P_GYR_SCALE_STD] * p[P_GYR_SCALE_STD]
    delay = 1e-6 * p[P_MAG_DELAY_STD] * p[P_MAG_DELAY_STD]
    for i in range(3):
        P[PHI + i, PHI + i] += phi * tau + x[EXTRA]
        P[VEL + i, VEL + i] += vel * tau + x[EXTRA + 1]
        P[EBG + i, EBG + i] += bias * tau
        P[EBA + i, EBA + i] += acc_bias * tau
    for i in range(9):
        P[EMG + i, EMG + i] += scale * tau
    P[LAG, LAG] += delay * tau


@kernel
def close_interval(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Propagate over the interval, enter the measurements, correct the estimate."""
    tau = x[OPEN + TAU]
    for i in range(INTERVAL):
        w[R_SUMS + i] = x[OPEN + i]
    propagate(P, x, OPEN, w, SCRATCH)
    add_noise(x, P, p)
    for i in range(N):
        w[ERROR + i] = 0.0
    w[R_COUNT] = 0.0
    w[R_CLOSED] = 1.0
    bits = 0
    rest = x[QUIET] >= p[P_REST_TIME]
    _velocity(x, P, p, w, rest)
    if rest:
        bits |= s.REST
        _rest(x, P, p, w)
    x[SINCE_MAG] += tau
    if x[FIELD + 5] > 0.0:
        bits |= _heading(x, P, p, w)
    x[FLAGS] = float(bits)

    c0, c1, c2, c3 = exp(w[ERROR], w[ERROR + 1], w[ERROR + 2])
    q0, q1, q2, q3 = mul(c0, c1, c2, c3, x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3])
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = normalize(q0, q1, q2, q3)
    for i in range(3):
        x[V + i] += w[ERROR + VEL + i]
        x[BG + i] += w[ERROR + EBG + i]
        x[BA + i] += w[ERROR + EBA + i]
        x[STD_BG + i] = sqrt(P[EBG + i, EBG + i])
        x[STD_BA + i] = sqrt(P[EBA + i, EBA + i])
        w[R_STEP + i] = w[ERROR + PHI + i]
        w[R_STEP + 3 + i] = w[ERROR + EBG + i]
    for i in range(9):
        x[MG + i] += w[ERROR + EMG + i]
    x[DELAY] += w[ERROR + LAG]
    for j in range(N):
        for i in range(3):
            w[R_ROWS + i * N + j] = P[PHI + i, j]
            w[R_ROWS + (3 + i) * N + j] = P[EBG + i, j]
    clear(x)
