"""One IMU sample through the GNSS/INS filter, and the loop over samples.

The mechanisation runs at the rate of the IMU. At each tick, by default ten times a second, and
at each fix the covariance moves and the constraints act; then comes the fix.
"""

from math import inf, isfinite, isinf, isnan, nan, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.align import feed as feed_alignment
from strapdown.kernels.ins.align import learn_bias, restart, take_fix
from strapdown.kernels.ins.covariance import drift_share, predict
from strapdown.kernels.ins.field import take_field
from strapdown.kernels.ins.gnss import begin_learning, check_fix
from strapdown.kernels.ins.gnss import update as update_gnss
from strapdown.kernels.ins.layout import (
    A_FIX,
    A_LLA,
    A_REST,
    A_V,
    A_VAR,
    ACC_N,
    ARM_A,
    ARM_V,
    AT_REST,
    BA,
    BG,
    BP,
    BR,
    BV,
    CAR,
    D_NEW,
    D_POS,
    DBA,
    DBG,
    DECLINATION,
    DELAY,
    DP,
    DT,
    DV,
    FIX_SD,
    FIX_SV,
    FIX_T,
    I_ARM_A,
    I_BP,
    I_DELAY,
    I_SA,
    I_SG,
    I_SODO,
    IN_LLA,
    IN_SP,
    IN_SV,
    IN_V,
    IRON,
    JUMPS,
    K_SLOW,
    LAST_F,
    LAST_G,
    LLA,
    MODE,
    MOUNTED,
    N_DIAG,
    N_SUMS,
    NEXT,
    OUT_HEAD,
    PHI,
    QVB,
    R_E,
    R_N,
    R_START,
    RATE,
    REALIGN_GAP,
    RECORD,
    SA,
    SCALE_V,
    SD_ARM_A,
    SD_BA,
    SD_BG,
    SD_DELAY,
    SD_SCALE_A,
    SD_SCALE_G,
    SD_SODO,
    SG,
    SHARE_BP,
    SODO,
    T_POS,
    T_VEL,
    TAPE,
    TICK,
    V_CON,
    ZUPT,
    N,
    Q,
    V,
)
from strapdown.kernels.ins.layout import BARO as BARO_OFFSET
from strapdown.kernels.ins.mechanise import advance, earth_terms
from strapdown.kernels.ins.rest import feed as feed_rest
from strapdown.kernels.ins.rest import forget, measure_noise
from strapdown.kernels.ins.vehicle import (
    constrain,
    find_mount,
    new_mount,
    stand,
    take_height,
    take_speed,
    turn_mount,
)
from strapdown.kernels.memory import (
    ALIGNED,
    BARO,
    FULL,
    GNSS,
    MAG,
    MAX_ACC2,
    MAX_RATE2,
    MIN_ACC2,
    NO,
    P_ACC_RANGE,
    P_GYR_RANGE,
    P_MAX_GAP,
    Q_VB,
    SPEED,
    STATUS,
    STD_ATT,
    STD_BA,
    STD_BG,
    STD_POS,
    STD_V,
    T,
    load_events,
    post,
    set_status,
)
from strapdown.kernels.memory import BA as OUT_BA
from strapdown.kernels.memory import BG as OUT_BG
from strapdown.kernels.memory import LLA as OUT_LLA
from strapdown.kernels.memory import Q as OUT_Q
from strapdown.kernels.memory import V as OUT_V
from strapdown.kernels.quat import exp, mul

W_SIZE = TAPE

SD_TILT_START = 0.02  # of level after alignment [rad]
SD_TILT_UNRESTED = 0.05  # of level, where no rest has shown the gyro's bias [rad]
SD_HEADING_UNRESTED = 0.7  # of heading there, besides what its own curvature says [rad]
SD_REST_BIAS = 5e-4  # of a gyro bias that was seen at rest [rad/s]
TURN_IN_GAP = 0.3  # angular rate about down that a gap may hide [rad/s]
TILT_IN_GAP = 0.03  # [rad/s]
ACC_IN_GAP = 2.0  # [m/s^2]
OUTAGE_AFTER = 5.0  # without a position [s]


@kernel
def prior(P: Mat, p: Vec, w: Vec, k: int, count: int, sd: float) -> None:
    """Set the prior of an optional block, if it is on."""
    if k > 0:
        for i in range(k, k + count):
            P[i, i] = sd * sd


@kernel
def start(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Begin to navigate: state from alignment and the fix in the inbox, covariance from priors."""
    n = int(p[N])
    for i in range(n):
        for j in range(n):
            P[i, j] = 0.0
    known = x[A_REST] > 0.0
    for i in range(3):
        x[LLA + i] = x[IN_LLA + i]
        x[V + i] = x[IN_V + i]
        x[ACC_N + i] = 0.0
        x[FIX_SD + i] = x[IN_SP + i]
        x[FIX_SV + i] = x[IN_SV + i]
        P[PHI + i, PHI + i] = SD_TILT_START * SD_TILT_START
        P[DV + i, DV + i] = x[IN_SV + i] * x[IN_SV + i] + 0.01
        P[DP + i, DP + i] = x[IN_SP + i] * x[IN_SP + i] + 0.01
        P[DBG + i, DBG + i] = SD_REST_BIAS * SD_REST_BIAS if known else p[SD_BG] * p[SD_BG]
        P[DBA + i, DBA + i] = p[SD_BA] * p[SD_BA]
    P[PHI + 2, PHI + 2] = 2.0 * x[A_VAR] + 0.001
    if not known:  # the gyroscope's bias has turned gravity into what looked like acceleration
        for i in range(2):
            P[PHI + i, PHI + i] = SD_TILT_UNRESTED * SD_TILT_UNRESTED
        P[PHI + 2, PHI + 2] += SD_HEADING_UNRESTED * SD_HEADING_UNRESTED
    prior(P, p, w, int(p[I_SG]), 3, p[SD_SCALE_G])
    prior(P, p, w, int(p[I_SA]), 3, p[SD_SCALE_A])
    prior(P, p, w, int(p[I_ARM_A]), 3, p[SD_ARM_A])
    prior(P, p, w, int(p[I_DELAY]), 1, p[SD_DELAY])
    prior(P, p, w, int(p[I_SODO]), 1, p[SD_SODO])
    k = int(p[I_BP])
    if k > 0:
        for i in range(3):
            prior(P, p, w, k + i, 1, p[SHARE_BP] * x[FIX_SD + i])
            prior(P, p, w, k + 3 + i, 1, drift_share(p) * p[SHARE_BP] * x[FIX_SD + i])
            prior(P, p, w, k + 6 + i, 1, p[SCALE_V] * x[FIX_SV + i])
    for i in range(N_SUMS):
        x[DT + i] = 0.0
    begin_learning(x, p)
    x[T_POS] = x[T]
    x[T_VEL] = x[T]
    x[JUMPS] = 0.0
    x[MAG] = 0.0
    x[MODE] = 1.0
    x[ALIGNED] = FULL
    if x[MOUNTED] > 0.0:
        new_mount(x, P, p, w)
    earth_terms(x)
    if w[RECORD] > 0.0:
        at = int(w[NEXT])
        w[at] = float(R_START)
        w[at + 1] = 2.0
        w[NEXT] = at + 2.0


@kernel
def align(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Take the fix in the inbox while aligning; start when it suffices."""
    if x[GNSS] == 0.0:
        return
    x[GNSS] = 0.0
    if not check_fix(x):
        return
    if take_fix(x, p, w):
        if x[A_REST] > 0.0:
            x[A_REST] = 1000.0
        start(x, P, p, w)


@kernel
def mind_gap(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Carry on over an interval without samples: straight on, with the covariance to match."""
    set_status(x, s.GAP)
    forget(x)
    if x[MODE] == 0.0:
        restart(x)
        return
    predict(x, P, p, w)
    if dt > p[REALIGN_GAP]:
        x[MODE] = 0.0
        restart(x)
        return
    for i in range(3):
        P[DV + i, DV + i] += ACC_IN_GAP * ACC_IN_GAP * dt * dt
        sd = x[V] * x[V] + x[V + 1] * x[V + 1]
        P[DP + i, DP + i] += 0.1 * sd * dt * dt + ACC_IN_GAP * ACC_IN_GAP * dt * dt * dt * dt / 4.0
        tilt = TILT_IN_GAP if i < 2 else TURN_IN_GAP
        P[PHI + i, PHI + i] += tilt * tilt * dt * dt
    x[LLA] += x[V] * dt / x[R_N]
    x[LLA + 1] += x[V + 1] * dt / x[R_E]
    x[LLA + 2] -= x[V + 2] * dt
    earth_terms(x)


@kernel
def sane(x: Vec, P: Mat, p: Vec) -> bool:
    """Whether the estimates are numbers that a carrier of this sensor can have."""
    total = 0.0
    total += x[ARM_V] + x[SODO] + x[BARO_OFFSET] + x[DECLINATION]
    for i in range(4):
        total += x[Q + i] + x[QVB + i]
    for i in range(3):
        total += x[LLA + i] + x[BP + i] + x[BR + i] + x[BV + i] + x[ACC_N + i] + x[RATE + i]
        total += x[IRON + i]
        if not (abs(x[V + i]) < 1e5 and abs(x[BG + i]) < 1.0 and abs(x[BA + i]) < 30.0):
            return False
        if not (abs(x[SG + i]) < 0.5 and abs(x[SA + i]) < 0.5 and abs(x[ARM_A + i]) < 1e3):
            return False
    for i in range(int(p[N])):
        total += P[i, i]
        if P[i, i] < 0.0:
            return False
    return isfinite(total) and abs(x[DELAY]) < 5.0


@kernel
def navigate(x: Vec, P: Mat, p: Vec, w: Vec, dt: float) -> None:
    """Tick: covariance, constraints, aiding."""
    fix = x[GNSS] > 0.0
    full = x[DT] >= p[TICK] - 0.25 * dt
    if not (fix or full or x[SPEED] > 0.0 or x[BARO] > 0.0):
        return
    span = x[DT]
    predict(x, P, p, w)
    earth_terms(x)
    if p[CAR] > 0.0 and span > 0.0:
        if x[MOUNTED] == 0.0:
            find_mount(x, P, p, w, span)
        elif x[V] * x[V] + x[V + 1] * x[V + 1] > p[V_CON] * p[V_CON]:
            turn_mount(x, P, p, w, span)
            constrain(x, P, p, w, span)
        if p[ZUPT] > 0.0 and x[AT_REST] > 0.0:
            stand(x, P, p, w, span)
        if x[SPEED] > 0.0 and x[MOUNTED] > 0.0:
            take_speed(x, P, p, w)
    if x[BARO] > 0.0:
        take_height(x, P, p, w)
    if full and x[MAG] > 0.0:
        take_field(x, P, p, w)
        x[MAG] = 0.0
    x[SPEED] = 0.0
    x[BARO] = 0.0
    if fix:
        x[GNSS] = 0.0
        update_gnss(x, P, p, w)
    if not sane(x, P, p):
        for i in range(3):
            x[BG + i] = 0.0
            x[BA + i] = 0.0
            x[SG + i] = 0.0
            x[SA + i] = 0.0
            x[ARM_A + i] = 0.0
            x[BP + i] = 0.0
            x[BR + i] = 0.0
            x[BV + i] = 0.0
            x[IRON + i] = 0.0
        x[DECLINATION] = 0.0
        x[DELAY] = 0.0
        x[SODO] = 0.0
        x[A_REST] = 0.0
        x[MOUNTED] = 0.0
        x[ARM_V] = 0.0
        x[QVB], x[QVB + 1], x[QVB + 2], x[QVB + 3] = 1.0, 0.0, 0.0, 0.0
        x[BARO_OFFSET] = 0.0
        x[MODE] = 0.0
    if x[MODE] == 0.0:
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = 1.0, 0.0, 0.0, 0.0
        restart(x)
    else:
        earth_terms(x)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample, with what aiding is in the inbox."""
    # fmt: on
    w[D_NEW] = 0.0
    x[STATUS] = 0.0
    if not gx * gx + gy * gy + gz * gz < MAX_RATE2:
        set_status(x, s.GYR_INVALID)
    if isinf(ax):  # no sample of the slower accelerometer
        ax, ay, az = x[LAST_F], x[LAST_F + 1], x[LAST_F + 2]
    a2 = ax * ax + ay * ay + az * az
    if not (a2 > MIN_ACC2 and a2 < MAX_ACC2):
        set_status(x, s.ACC_INVALID)
    if x[STATUS] == 0.0 and (t > x[T] or isnan(x[T])):
        r = p[P_GYR_RANGE]
        if abs(gx) >= r or abs(gy) >= r or abs(gz) >= r:
            set_status(x, s.SATURATED)
        r = p[P_ACC_RANGE]
        if abs(ax) >= r or abs(ay) >= r or abs(az) >= r:
            set_status(x, s.SATURATED)
        dt = t - x[T]
        if isnan(dt):  # the first sample
            x[T] = t
            x[A_FIX] = 0.0
            x[FIX_T] = -inf
            restart(x)
        else:
            x[T] = t
            if dt > p[P_MAX_GAP]:
                mind_gap(x, P, p, w, dt)
                dt = 0.0
            else:
                measure_noise(x, dt, gx, gy, gz, ax, ay, az)
                new = feed_rest(x, p, dt, gx, gy, gz, ax, ay, az)
                if x[MODE] > 0.0:
                    advance(x, dt, gx, gy, gz, ax, ay, az)
                else:
                    if new and x[AT_REST] > 0.0:
                        learn_bias(x)
                    feed_alignment(x, dt, gx, gy, gz, ax, ay, az)
            if x[MODE] > 0.0:
                navigate(x, P, p, w, dt)
            else:
                align(x, P, p, w)
        x[LAST_F], x[LAST_F + 1], x[LAST_F + 2] = ax, ay, az
        x[LAST_G], x[LAST_G + 1], x[LAST_G + 2] = gx, gy, gz
    if x[MODE] == 0.0:
        set_status(x, s.ALIGNING)
    elif x[T] - x[T_POS] > OUTAGE_AFTER:
        set_status(x, s.OUTAGE)
    if x[AT_REST] > 0.0:
        set_status(x, s.REST)
    if w[RECORD] < 2.0:
        publish(x, P, p)


@kernel
def unseen(x: Vec, p: Vec, i: int) -> float:
    """Variance of the fixes' error that shows in no innovation: constant over minutes [m^2].

    Where the drive that is learned is below half of what the receiver says, the rest is there.
    """
    if p[I_BP] < 0.0:
        return 0.0
    k = x[K_SLOW + i // 2]
    rest = p[SHARE_BP] * p[SHARE_BP] - 4.0 * k * k
    variance: float = max(rest, 0.0) * x[FIX_SD + i] * x[FIX_SD + i]
    return variance


@kernel
def publish(x: Vec, P: Mat, p: Vec) -> None:
    """Write the head of `x`: what the filter says at the time of the sample."""
    for i in range(3):
        x[OUT_BG + i] = x[BG + i]
    if x[MODE] == 0.0:
        if x[ALIGNED] == NO:  # nothing but the last fix is known
            known = x[A_FIX] > 0.0
            for i in range(3):
                x[OUT_LLA + i] = x[A_LLA + i] if known else nan
                x[OUT_V + i] = x[A_V + i] if known else nan
                x[STD_POS + i] = x[IN_SP + i] if known else nan
                x[STD_V + i] = x[IN_SV + i] if known else nan
        return
    say(x)
    for i in range(3):
        x[STD_ATT + i] = sqrt(P[PHI + i, PHI + i])
        x[STD_V + i] = sqrt(P[DV + i, DV + i])
        x[STD_POS + i] = sqrt(P[DP + i, DP + i] + unseen(x, p, i))
        x[STD_BG + i] = sqrt(P[DBG + i, DBG + i])
        x[STD_BA + i] = sqrt(P[DBA + i, DBA + i])


@kernel
def say(x: Vec) -> None:
    """Write the estimates into the head of `x`.

    Time is the receiver's: they go back by `DELAY`, the difference of the two clocks.
    """
    d = x[DELAY]
    ew, ea, eb, ec = exp(-x[RATE] * d, -x[RATE + 1] * d, -x[RATE + 2] * d)
    qw, qa, qb, qc = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ew, ea, eb, ec)
    x[OUT_Q], x[OUT_Q + 1], x[OUT_Q + 2], x[OUT_Q + 3] = qw, qa, qb, qc
    x[OUT_LLA] = x[LLA] - x[V] * d / x[R_N]
    x[OUT_LLA + 1] = x[LLA + 1] - x[V + 1] * d / x[R_E]
    x[OUT_LLA + 2] = x[LLA + 2] + x[V + 2] * d
    for i in range(3):
        x[OUT_BG + i] = x[BG + i]
        x[OUT_BA + i] = x[BA + i]
        x[OUT_V + i] = x[V + i] - x[ACC_N + i] * d
    for i in range(4):
        x[Q_VB + i] = x[QVB + i]


@kernel
def store(x: Vec, k: int, out: Mat) -> None:
    """Write row `k` of the output."""
    for i in range(OUT_HEAD):
        out[k, i] = x[STATUS + i]
    for i in range(3):
        out[k, OUT_HEAD + i] = x[ARM_A + i]


# fmt: off
@kernel
def run(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat,
) -> None:
    """Loop of `step`; `out_diag` has a row for each fix, in order, or none at all."""
    # fmt: on
    j = 0
    row = 0
    for k in range(t.shape[0]):
        j = load_events(x, t[k], j, events)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, k, out)
        if w[D_NEW] > 0.0 and row < out_diag.shape[0]:
            out_diag[row, 0] = t[k]
            for i in range(N_DIAG):
                out_diag[row, 1 + i] = w[D_POS + i]
            row += 1
    if t.shape[0] > 0:
        load_events(x, inf, j, events)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
