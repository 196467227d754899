"""GNSS fixes: measurement rows at the antenna and at the time of the fix, gating, recovery.

What a receiver gives is filtered: its velocity errs for a second or so, its position is in part
the integral of that and errs slowly, and both are often far better than it says. Velocity has an
error state `b_v` (Gauss-Markov), position a state `b_p` that integrates it and has a drive of its
own. The scales of both drives, ``x[K_SLOW]``, and of white noise beside them, ``x[K_WHITE]``, are
learned, causally, level and down apart: they move until the normalised innovations are one on
average; the correlation of one innovation with the next tells which of the two to blame.
"""

from math import exp, isnan, nan, pi, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.covariance import (
    absorb,
    clear_correction,
    clear_row,
    inject,
    project,
)
from strapdown.kernels.ins.layout import (
    A_FIX,
    ACC_N,
    ARM_A,
    BP,
    BR,
    BV,
    D_LAST,
    D_NEW,
    D_NPOS,
    D_NVEL,
    D_OPOS,
    D_OVEL,
    D_POS,
    D_SPOS,
    D_VEL,
    DELAY,
    DP,
    DV,
    FIX_SD,
    FIX_SPEED,
    FIX_SV,
    FIX_T,
    FIXES,
    GATE,
    I_ARM_A,
    I_BP,
    I_DELAY,
    IN_LLA,
    IN_SP,
    IN_SV,
    IN_T,
    IN_V,
    JUMP,
    JUMPS,
    K_SLOW,
    K_WHITE,
    LAG,
    LEARN,
    LLA,
    MODE,
    PH,
    PHI,
    R_E,
    R_N,
    RATE,
    RECOVER,
    RHO,
    ROWS,
    S3,
    SCALE_V,
    SHARE_BP,
    STRIDE,
    T_POS,
    T_VEL,
    WHITE_P,
    H,
    N,
    Q,
    V,
)
from strapdown.kernels.memory import T, set_status
from strapdown.kernels.quat import dcm
from strapdown.kernels.status import (
    ACCEPTED,
    AIDING_REJECTED,
    NOT_MEASURED,
    REJECTED_GATE,
    REJECTED_INVALID,
)

OLDEST = 1.0  # a fix may be this late [s]; beyond, replay
LEAST_SP = 0.05  # floors of the receiver's sigmas [m], [m/s]
LEAST_SV = 0.02
DEFAULT_SP = 5.0  # where the receiver states none
DEFAULT_SV = 0.5
LARGEST_SP = 1e4  # a fix with more is none
LARGEST_SV = 100.0
FLOOR_P = 0.004  # white error of any fix: 1e-7 deg of resolution [m], [m/s]
FLOOR_V = 0.004
LEAST_K = 0.005
MOST_K = 3.0
MOST_NIS = 4.0  # per axis, for learning: one outlier teaches little
CLIPPED_ONE = 0.9205  # mean of chi-square of one, clipped there
CLIPPED_TWO = 0.9817  # and of half of chi-square of two
EARLY = 10.0  # how much faster the first fixes teach
SOON = 10.0  # how many these are
SURE_RHO = 0.1  # a correlation below this may be chance
AGREE = 3  # rejected fixes in a row that agree, before a jump is believed


@kernel
def check_fix(x: Vec) -> bool:
    """Put the inbox in order: sigmas where there are none; False if there is no position."""
    lat, lon, height = x[IN_LLA], x[IN_LLA + 1], x[IN_LLA + 2]
    if isnan(lat + lon + height) or abs(lat) > 0.5 * pi or abs(lon) > 4.0 * pi:
        return False
    if abs(height) > 1e6:
        return False
    for i in range(3):
        s = x[IN_SP + i]
        if isnan(s) or s <= 0.0:
            x[IN_SP + i] = DEFAULT_SP
        elif s > LARGEST_SP:
            return False
        elif s < LEAST_SP:
            x[IN_SP + i] = LEAST_SP
        s = x[IN_SV + i]
        if isnan(s) or s <= 0.0:
            x[IN_SV + i] = DEFAULT_SV
        elif s > LARGEST_SV:
            for j in range(3):
                x[IN_V + j] = nan
        elif s < LEAST_SV:
            x[IN_SV + i] = LEAST_SV
    return True


# fmt: off
@kernel
def _arm_row(
    x: Vec, p: Vec, w: Vec, i: int, lx: float, ly: float, lz: float
) -> tuple[float, float, float, float]:
    """Row i of ``C_nb`` and component i of ``C_nb l``; sets the attitude part of the row.

    ``C_true l = C l + phi x (C l)``.
    """
    # fmt: on
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    an = c0 * lx + c1 * ly + c2 * lz
    ae = c3 * lx + c4 * ly + c5 * lz
    ad = c6 * lx + c7 * ly + c8 * lz
    if i == 0:
        w[H + PHI + 1] = ad
        w[H + PHI + 2] = -ae
        return c0, c1, c2, an
    if i == 1:
        w[H + PHI] = -ad
        w[H + PHI + 2] = an
        return c3, c4, c5, ae
    w[H + PHI] = ae
    w[H + PHI + 1] = -an
    return c6, c7, c8, ad


@kernel
def position_row(x: Vec, p: Vec, w: Vec, i: int, age: float) -> float:
    """Set row i of the position; return fix less IMU position that is expected [m].

    `age` is now less the time of the fix, on the IMU's clock.
    """
    clear_row(p, w)
    r0, r1, r2, arm = _arm_row(x, p, w, i, x[ARM_A], x[ARM_A + 1], x[ARM_A + 2])
    w[H + DP + i] = 1.0
    w[H + DV + i] = -age
    k = int(p[I_ARM_A])
    if k > 0:
        w[H + k], w[H + k + 1], w[H + k + 2] = r0, r1, r2
    k = int(p[I_DELAY])
    if k > 0:
        w[H + k] = -x[V + i]
    k = int(p[I_BP])
    if k > 0:
        w[H + k + i] = 1.0
        w[H + k + 3 + i] = -age
        w[H + k + 6 + i] = -age
    v = x[V + i] + x[BR + i] + x[BV + i]
    expected: float = arm - v * age + 0.5 * age * age * x[ACC_N + i] + x[BP + i]
    return expected


@kernel
def velocity_row(x: Vec, p: Vec, w: Vec, i: int, age: float) -> float:
    """Set row i of the velocity; return fix less IMU velocity that is expected [m/s]."""
    clear_row(p, w)
    lx, ly, lz = x[ARM_A], x[ARM_A + 1], x[ARM_A + 2]
    ox, oy, oz = x[RATE], x[RATE + 1], x[RATE + 2]
    ux, uy, uz = oy * lz - oz * ly, oz * lx - ox * lz, ox * ly - oy * lx
    r0, r1, r2, arm = _arm_row(x, p, w, i, ux, uy, uz)
    w[H + DV + i] = 1.0
    k = int(p[I_ARM_A])
    if k > 0:  # r . (omega x dl)
        w[H + k] = r1 * oz - r2 * oy
        w[H + k + 1] = r2 * ox - r0 * oz
        w[H + k + 2] = r0 * oy - r1 * ox
    k = int(p[I_DELAY])
    if k > 0:
        w[H + k] = -x[ACC_N + i]
    k = int(p[I_BP])
    if k > 0:
        w[H + k + 6 + i] = 1.0
    expected: float = arm - x[ACC_N + i] * age + x[BV + i]
    return expected


@kernel
def _rows(x: Vec, p: Vec, w: Vec, kind: int, age: float) -> None:
    """Write the three rows of position (0) or velocity (1) and their innovations."""
    n = int(p[N])
    for i in range(3):
        y = 0.0
        if kind == 1:
            y = x[IN_V + i] - x[V + i] - velocity_row(x, p, w, i, age)
        else:
            if i == 0:
                y = (x[IN_LLA] - x[LLA]) * x[R_N]
            elif i == 1:
                d = x[IN_LLA + 1] - x[LLA + 1]
                d -= 2.0 * pi * float(int(d / (2.0 * pi)))
                if d > pi:
                    d -= 2.0 * pi
                if d < -pi:
                    d += 2.0 * pi
                y = d * x[R_E]
            else:
                y = x[LLA + 2] - x[IN_LLA + 2]
            y -= position_row(x, p, w, i, age)
        w[D_POS + 3 * kind + i] = y
        for k in range(n):
            w[ROWS + i * STRIDE + k] = w[H + k]


@kernel
def _use_row(p: Vec, w: Vec, i: int) -> None:
    """Make row i the measurement row."""
    for k in range(int(p[N])):
        w[H + k] = w[ROWS + i * STRIDE + k]


@kernel
def _variance(x: Vec, p: Vec, kind: int, i: int) -> float:
    """White variance of axis i."""
    k = x[K_WHITE + 2 * kind + i // 2]
    if kind == 0:
        sd: float = k * x[IN_SP + i]
        return sd * sd + FLOOR_P * FLOOR_P
    sd = k * x[IN_SV + i]
    lag: float = p[LAG] * p[LAG] * (x[ACC_N] * x[ACC_N] + x[ACC_N + 1] * x[ACC_N + 1])
    return sd * sd + FLOOR_V * FLOOR_V + lag


@kernel
def _nis(x: Vec, P: Mat, p: Vec, w: Vec, kind: int, age: float) -> float:
    """Normalised innovation squared of the three axes; writes innovations and sigmas."""
    n = int(p[N])
    _rows(x, p, w, kind, age)
    for i in range(3):
        _use_row(p, w, i)
        project(P, p, w)
        for j in range(3):
            s = 0.0
            for k in range(n):
                s += w[ROWS + j * STRIDE + k] * w[PH + k]
            w[S3 + 3 * i + j] = s
        w[S3 + 3 * i + i] += _variance(x, p, kind, i)
        w[D_SPOS + 3 * kind + i] = sqrt(w[S3 + 3 * i + i])
    y = D_POS + 3 * kind
    l00 = sqrt(w[S3])
    l10 = w[S3 + 3] / l00
    l20 = w[S3 + 6] / l00
    l11 = sqrt(w[S3 + 4] - l10 * l10)
    l21 = (w[S3 + 7] - l20 * l10) / l11
    l22 = sqrt(w[S3 + 8] - l20 * l20 - l21 * l21)
    z0: float = w[y] / l00
    z1: float = (w[y + 1] - l10 * z0) / l11
    z2: float = (w[y + 2] - l20 * z0 - l21 * z1) / l22
    return z0 * z0 + z1 * z1 + z2 * z2


@kernel
def _take(x: Vec, P: Mat, p: Vec, w: Vec, kind: int) -> None:
    """Absorb the three axes of position or velocity."""
    clear_correction(p, w)
    for i in range(3):
        _use_row(p, w, i)
        project(P, p, w)
        absorb(P, p, w, w[D_POS + 3 * kind + i], _variance(x, p, kind, i))
    inject(x, p, w)


@kernel
def begin_learning(x: Vec, p: Vec) -> None:
    """Set what is believed of the receiver before its first innovation."""
    slow = p[I_BP] > 0.0
    for i in range(2):
        x[K_SLOW + i] = p[SHARE_BP]
        x[K_SLOW + 2 + i] = p[SCALE_V]
        x[K_WHITE + i] = p[WHITE_P]
        x[K_WHITE + 2 + i] = 0.5 * p[SCALE_V] if slow else p[SCALE_V]
    for i in range(4):
        x[RHO + i] = 0.25
    for i in range(6):
        x[D_LAST + i] = 0.0
    x[FIXES] = 0.0


@kernel
def _scaled(k: float, rate: float, nis: float, mean: float) -> float:
    """Scale that drifts up while clipped innovations squared exceed their mean, and down below."""
    grown: float = k * exp(rate * (min(nis, MOST_NIS) - mean))
    return min(max(grown, LEAST_K), MOST_K)


@kernel
def _learn(x: Vec, p: Vec, w: Vec, kind: int) -> None:
    """Divide the blame of an innovation between slow and white error, level and down apart."""
    rate = p[LEARN] * (1.0 + EARLY / (1.0 + x[FIXES] / SOON))
    for down in range(2):
        k = 2 * kind + down
        first = 2 * down
        axes = 2 - down
        mean = CLIPPED_ONE if down == 1 else CLIPPED_TWO
        nis = 0.0
        c = 0.0
        for i in range(first, first + axes):
            z = w[D_POS + 3 * kind + i] / w[D_SPOS + 3 * kind + i]
            nis += z * z / float(axes)
            z = min(max(z, -3.0), 3.0)
            c += z * x[D_LAST + 3 * kind + i] / float(axes)
            x[D_LAST + 3 * kind + i] = z
        x[RHO + k] += p[LEARN] * (c - x[RHO + k] * max(min(nis, 9.0), 0.1))
        slow = 0.0
        if p[I_BP] > 0.0:
            slow = min(max(2.0 * x[RHO + k], 0.0), 1.0)
            # a drive that is too strong shows in innovations that change sign, one that is too
            # weak in innovations that repeat
            rho = x[RHO + k]
            turn = 4.0 * p[LEARN] * (rho - min(max(rho, -SURE_RHO), SURE_RHO))
            x[K_SLOW + k] = max(x[K_SLOW + k] * exp(min(turn, 0.0)), LEAST_K)
            x[K_WHITE + k] = max(x[K_WHITE + k] * exp(min(-turn, 0.0)), LEAST_K)
        x[K_SLOW + k] = _scaled(x[K_SLOW + k], slow * rate, nis, mean)
        x[K_WHITE + k] = _scaled(x[K_WHITE + k], (1.0 - slow) * rate, nis, mean)


@kernel
def _velocity(x: Vec, P: Mat, p: Vec, w: Vec, age: float) -> None:
    """Gate and take the velocity of the fix."""
    nis = _nis(x, P, p, w, 1, age)
    w[D_NVEL] = nis
    _learn(x, p, w, 1)
    lost = x[T] - x[T_VEL]
    if nis > p[GATE] and lost > 3.0 * p[RECOVER]:
        x[MODE] = 0.0  # nothing fits any more: align again, with the biases that are known
        x[A_FIX] = 0.0
    if nis > p[GATE] and lost <= p[RECOVER]:
        w[D_OVEL] = float(REJECTED_GATE)
        set_status(x, AIDING_REJECTED)
        return
    if nis > p[GATE]:
        for i in range(3):
            y = w[D_VEL + i]
            P[DV + i, DV + i] += y * y + 1.0
        P[PHI + 2, PHI + 2] += 0.25
    x[T_VEL] = x[T] if nis <= p[GATE] else x[T_VEL]
    w[D_OVEL] = float(ACCEPTED)
    _take(x, P, p, w, 1)


@kernel
def _position(x: Vec, P: Mat, p: Vec, w: Vec, age: float) -> None:
    """Gate and take the position of the fix; believe a jump once it lasts."""
    nis = _nis(x, P, p, w, 0, age)
    w[D_NPOS] = nis
    _learn(x, p, w, 0)
    if nis > p[GATE]:
        same = 0.0
        for i in range(2):
            d = w[D_POS + i] - x[JUMP + i]
            same += d * d
        near = 5.0 + 4.0 * x[IN_SP]
        x[JUMPS] = x[JUMPS] + 1.0 if same < near * near else 1.0
        for i in range(3):
            x[JUMP + i] = w[D_POS + i]
        if x[T] - x[T_POS] <= p[RECOVER] or x[JUMPS] < float(AGREE):
            w[D_OPOS] = float(REJECTED_GATE)
            if w[D_OVEL] != float(REJECTED_GATE):
                set_status(x, AIDING_REJECTED)
            return
        for i in range(3):
            y = w[D_POS + i]
            P[DP + i, DP + i] += y * y
    x[JUMPS] = 0.0
    x[T_POS] = x[T]
    w[D_OPOS] = float(ACCEPTED)
    _take(x, P, p, w, 0)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Take the fix in the inbox. Its age counts from the time it says, less the clock delay."""
    w[D_NEW] = 1.0
    for i in range(12):
        w[D_POS + i] = nan
    w[D_NPOS] = nan
    w[D_NVEL] = nan
    w[D_OPOS] = float(NOT_MEASURED)
    w[D_OVEL] = float(NOT_MEASURED)
    if not check_fix(x) or x[T] - x[IN_T] > OLDEST:
        w[D_OPOS] = float(REJECTED_INVALID)
        return
    for i in range(3):
        x[FIX_SD + i] = x[IN_SP + i]
        x[FIX_SV + i] = x[IN_SV + i]
    x[FIX_SPEED] = sqrt(x[IN_V] * x[IN_V] + x[IN_V + 1] * x[IN_V + 1])
    x[FIX_T] = x[IN_T]
    x[FIXES] += 1.0
    if not isnan(x[IN_V] + x[IN_V + 1] + x[IN_V + 2]):
        _velocity(x, P, p, w, x[T] - x[IN_T] + x[DELAY])
    _position(x, P, p, w, x[T] - x[IN_T] + x[DELAY])
