"""Covariance of the GNSS/INS filter: prediction, one scalar measurement, correction.

With ``phi_n`` the attitude error in n (``C_true = (I + [phi x]) C_nb``) and ``f_n`` the specific
force, the inertial rows of the error model are ::

    phi' = -omega_in x phi - C_nb (db_g + omega_d ds_g)
    dv'  =  phi x f_n      - C_nb (db_a + diag(f) ds_a)
    dp'  =  dv

(terms of the size of the Earth's rate times velocity error, and of gravity's change with
height, are left out: they matter over hours, not over the minutes between two fixes). The
covariance moves once per tick, by default ten times a second: ``Phi - I`` follows from sums of
``C_nb dt`` and ``f_n dt`` that the mechanisation keeps, and is exact in them to second order.

References
----------
.. [1] P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
       Systems", 2nd edition, Artech House, 2013, section 14.2.
"""

from math import exp as exponential
from math import sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.layout import (
    ACC_N,
    ARM_A,
    ARM_V,
    BA,
    BARO,
    BG,
    BP,
    BR,
    BV,
    DBA,
    DBG,
    DECLINATION,
    DELAY,
    DP,
    DT,
    DV,
    DX,
    FIX_SD,
    FIX_SV,
    GAIN,
    I_ARM_A,
    I_ARM_V,
    I_BARO,
    I_BP,
    I_DELAY,
    I_MAG,
    I_MOUNT,
    I_SA,
    I_SG,
    I_SODO,
    IRON,
    K_SLOW,
    LLA,
    MOVED,
    N_SUMS,
    NEXT,
    NOISE_A,
    NOISE_G,
    PH,
    Q_A,
    Q_BA,
    Q_BG,
    Q_G,
    Q_MOUNT,
    Q_SA,
    Q_SG,
    QVB,
    R_E,
    R_N,
    R_PREDICT,
    R_RESET,
    R_SCALAR,
    RATE,
    RECORD,
    S_C,
    S_CF,
    S_CW,
    S_F,
    SA,
    SG,
    SODO,
    STRIDE,
    TAU_BP,
    TAU_BV,
    W_IN,
    F,
    G,
    H,
    M,
    N,
    Q,
    V,
)
from strapdown.kernels.quat import exp, mul, normalize

IRON_WALK = 1e-7  # of the iron, currents and temperature [T/sqrt(s)]
BARO_WALK = 0.05  # of the barometer's offset, weather and wind [m/sqrt(s)]


@kernel
def transition(x: Vec, p: Vec, w: Vec) -> None:
    """Write ``Phi - I`` of the nine inertial rows into ``w[F]``, 9 x m."""
    m = int(p[M])
    sg = int(p[I_SG])
    sa = int(p[I_SA])
    dt = x[DT]
    for i in range(9 * m):
        w[F + i] = 0.0
    # -omega_in x phi
    rn, re, rd = x[W_IN] * dt, x[W_IN + 1] * dt, x[W_IN + 2] * dt
    w[F + 1] = rd
    w[F + 2] = -re
    w[F + m] = -rd
    w[F + m + 2] = rn
    w[F + 2 * m] = re
    w[F + 2 * m + 1] = -rn
    # phi x f_n
    sn, se, sd = x[S_F], x[S_F + 1], x[S_F + 2]
    v = F + DV * m
    w[v + 1] = sd
    w[v + 2] = -se
    w[v + m] = -sd
    w[v + m + 2] = sn
    w[v + 2 * m] = se
    w[v + 2 * m + 1] = -sn
    for i in range(3):
        w[F + (DP + i) * m + DV + i] = dt
        for j in range(3):
            c = x[S_C + 3 * i + j]
            w[F + i * m + DBG + j] = -c
            w[v + i * m + DBA + j] = -c
            w[F + (DP + i) * m + j] = 0.5 * dt * w[v + i * m + j]
            w[F + (DP + i) * m + DBA + j] = -0.5 * dt * c
            if sg > 0:
                w[F + i * m + sg + j] = -x[S_CW + 3 * i + j]
            if sa > 0:
                w[v + i * m + sa + j] = -x[S_CF + 3 * i + j]
    # half of the attitude error that a gyro bias makes in the tick acts on the velocity
    for j in range(3):
        a, b, c = -0.5 * x[S_C + j], -0.5 * x[S_C + 3 + j], -0.5 * x[S_C + 6 + j]
        w[v + DBG + j] = b * sd - c * se
        w[v + m + DBG + j] = c * sn - a * sd
        w[v + 2 * m + DBG + j] = a * se - b * sn


@kernel
def predict(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Move the covariance over the time since the last tick and clear the sums."""
    n = int(p[N])
    m = int(p[M])
    dt = x[DT]
    if not dt > 0.0:
        return
    transition(x, p, w)
    for i in range(9):
        g = G + i * STRIDE
        for j in range(n):
            w[g + j] = 0.0
        for k in range(m):
            a = w[F + i * m + k]
            if a != 0.0:
                for j in range(n):
                    w[g + j] += a * P[k, j]
    for i in range(9):
        for j in range(i, 9):
            a = 0.0
            for k in range(m):
                a += w[G + i * STRIDE + k] * w[F + j * m + k]
            a += P[i, j] + (w[G + i * STRIDE + j] + w[G + j * STRIDE + i])
            P[i, j] = a
            P[j, i] = a
        for j in range(9, n):
            a = P[i, j] + w[G + i * STRIDE + j]
            P[i, j] = a
            P[j, i] = a
    _noise(x, P, p, dt)
    ep, ev, cr, cv = _fade_fix_error(x, P, p, dt)
    if w[RECORD] > 0.0:
        at = int(w[NEXT])
        w[at] = float(R_PREDICT)
        w[at + 1] = ep
        w[at + 2] = ev
        w[at + 3] = cr
        w[at + 4] = cv
        for i in range(9 * m):
            w[at + 5 + i] = w[F + i]
        w[at + 5 + 9 * m] = 6.0 + 9.0 * m
        w[NEXT] = at + 6.0 + 9.0 * m
    for i in range(N_SUMS):
        x[DT + i] = 0.0


@kernel
def _noise(x: Vec, P: Mat, p: Vec, dt: float) -> None:
    """Add the process noise of `dt` seconds.

    It is the carrier's vibration, or the sensor's own noise where that is more, as it shows in the
    quietest second so far; and what errors of scale and axes leave, in proportion to rate and
    acceleration.
    """
    rate2 = x[RATE] * x[RATE] + x[RATE + 1] * x[RATE + 1] + x[RATE + 2] * x[RATE + 2]
    acc2 = x[ACC_N] * x[ACC_N] + x[ACC_N + 1] * x[ACC_N + 1] + x[ACC_N + 2] * x[ACC_N + 2]
    qg = (max(p[Q_G] * p[Q_G], x[NOISE_G]) + p[Q_SG] * p[Q_SG] * rate2) * dt
    qa = (max(p[Q_A] * p[Q_A], x[NOISE_A]) + p[Q_SA] * p[Q_SA] * acc2) * dt
    for i in range(3):
        P[i, i] += qg
        P[DV + i, DV + i] += qa
        P[DP + i, DV + i] += 0.5 * qa * dt
        P[DV + i, DP + i] += 0.5 * qa * dt
        P[DP + i, DP + i] += qa * dt * dt / 3.0
        P[DBG + i, DBG + i] += p[Q_BG] * p[Q_BG] * dt
        P[DBA + i, DBA + i] += p[Q_BA] * p[Q_BA] * dt
    k = int(p[I_MOUNT])
    if k > 0:
        for i in range(k, k + 3):
            P[i, i] += p[Q_MOUNT] * p[Q_MOUNT] * dt
    k = int(p[I_BARO])
    if k > 0:
        P[k, k] += BARO_WALK * BARO_WALK * dt
    k = int(p[I_MAG])
    if k > 0 and P[k, k] > 0.0:
        for i in range(k, k + 3):
            P[i, i] += IRON_WALK * IRON_WALK * dt


@kernel
def _drive(P: Mat, a: int, b: int, sd: float, tau: float, e: float, dt: float) -> None:
    """Add what drives the rate `b`, of sigma `sd`, during a tick, and its integral in `a`."""
    q = 2.0 * sd * sd * dt / tau  # leading terms: a tick is short against tau
    P[a, a] += q * dt * dt / 3.0
    P[a, b] += 0.5 * q * dt
    P[b, a] += 0.5 * q * dt
    P[b, b] += sd * sd * (1.0 - e * e)


@kernel
def _fade_fix_error(x: Vec, P: Mat, p: Vec, dt: float) -> tuple[float, float, float, float]:
    """Move the slow errors of the fixes by a tick.

    b_r and b_v are driven by white noise ::

        b_p' = b_r + b_v - b_p / tau_p,    b_r' = -b_r / tau_p,    b_v' = -b_v / tau_v

    Returns the factors of b_p and b_r, of b_v, and those of b_r and b_v into b_p.
    """
    k = int(p[I_BP])
    if k < 0:
        return 1.0, 1.0, 0.0, 0.0
    n = int(p[N])
    ep = exponential(-dt / p[TAU_BP])
    ev = exponential(-dt / p[TAU_BV])
    cr = dt * ep
    cv = 0.5 * dt * (ev + ep)
    apart = 1.0 / p[TAU_BV] - 1.0 / p[TAU_BP]
    if abs(apart) * dt > 1e-4:  # the other leaves out a twelfth of its square
        cv = (ep - ev) / apart
    for i in range(k, k + 3):
        for j in range(n):
            P[i, j] = ep * P[i, j] + cr * P[i + 3, j] + cv * P[i + 6, j]
            P[i + 3, j] *= ep
            P[i + 6, j] *= ev
    for i in range(k, k + 3):
        for j in range(k, k + 9):
            P[j, i] = ep * P[j, i] + cr * P[j, i + 3] + cv * P[j, i + 6]
            P[j, i + 3] *= ep
            P[j, i + 6] *= ev
    for i in range(k, k + 9):
        for j in range(n):
            if j < i or j >= k + 9:
                P[j, i] = P[i, j]
    drift = drift_share(p)
    for i in range(3):
        sd = x[K_SLOW + i // 2] * x[FIX_SD + i]
        _drive(P, k + i, k + 3 + i, drift * sd, p[TAU_BP], ep, dt)
        sd = x[K_SLOW + 2 + i // 2] * x[FIX_SV + i]
        _drive(P, k + i, k + 6 + i, sd, p[TAU_BV], ev, dt)
        x[BP + i] = ep * x[BP + i] + cr * x[BR + i] + cv * x[BV + i]
        x[BR + i] *= ep
        x[BV + i] *= ev
    return ep, ev, cr, cv


@kernel
def drift_share(p: Vec) -> float:
    """Sigma of the drift b_r that by itself makes one of b_p [1/s]."""
    share: float = sqrt(2.0) / p[TAU_BP]
    return share


@kernel
def clear_row(p: Vec, w: Vec) -> None:
    """Set the measurement row to zero."""
    for i in range(int(p[N])):
        w[H + i] = 0.0


@kernel
def project(P: Mat, p: Vec, w: Vec) -> float:
    """Write ``P h`` into ``w[PH]`` and return ``h^T P h``; `h` is mostly zeros."""
    n = int(p[N])
    for i in range(n):
        w[PH + i] = 0.0
    for k in range(n):
        h = w[H + k]
        if h != 0.0:
            for j in range(n):
                w[PH + j] += h * P[k, j]
    s = 0.0
    for k in range(n):
        s += w[H + k] * w[PH + k]
    return s


@kernel
def remaining(p: Vec, w: Vec, y: float) -> float:
    """Innovation `y` less what the corrections of this instant already explain."""
    for k in range(int(p[N])):
        y -= w[H + k] * w[DX + k]
    return y


@kernel
def absorb(P: Mat, p: Vec, w: Vec, y: float, r: float) -> None:
    """Take one scalar measurement: row ``w[H]``, `y` measured less predicted, variance `r`.

    Expects `project` just before. The covariance takes Joseph's form in two passes of rank
    one and two, each symmetric to the bit; the correction gathers in ``w[DX]``.
    """
    n = int(p[N])
    s = r
    for k in range(n):
        s += w[H + k] * w[PH + k]
    d = remaining(p, w, y)
    if w[RECORD] > 0.0:
        at = int(w[NEXT])
        w[at] = float(R_SCALAR)
        w[at + 1] = s
        w[at + 2] = d
        for k in range(n):
            w[at + 3 + k] = w[H + k]
            w[at + 3 + n + k] = w[PH + k]
        w[at + 3 + 2 * n] = 4.0 + 2.0 * n
        w[NEXT] = at + 4.0 + 2.0 * n
    root = 1.0 / sqrt(s)
    for i in range(n):
        w[PH + i] *= root
        w[GAIN + i] = w[PH + i] * root
        w[DX + i] += w[GAIN + i] * d
    for i in range(n):
        u = w[PH + i]
        for j in range(n):
            P[i, j] -= u * w[PH + j]
    project(P, p, w)
    for i in range(n):
        w[PH + i] = 0.5 * (r * w[GAIN + i] - w[PH + i])
    for i in range(n):
        g = w[PH + i]
        k = w[GAIN + i]
        for j in range(n):
            P[i, j] += g * w[GAIN + j] + k * w[PH + j]


@kernel
def clear_correction(p: Vec, w: Vec) -> None:
    """Set the gathered correction to zero."""
    for i in range(int(p[N])):
        w[DX + i] = 0.0


@kernel
def _turn(x: Vec, at: int, rx: float, ry: float, rz: float) -> None:
    """Turn the quaternion at ``x[at]`` by a rotation vector on its left."""
    ew, ea, eb, ec = exp(rx, ry, rz)
    qw, qa, qb, qc = mul(ew, ea, eb, ec, x[at], x[at + 1], x[at + 2], x[at + 3])
    qw, qa, qb, qc = normalize(qw, qa, qb, qc)
    x[at], x[at + 1], x[at + 2], x[at + 3] = qw, qa, qb, qc


@kernel
def inject(x: Vec, p: Vec, w: Vec) -> None:
    """Move the gathered correction into the estimates and clear it."""
    apply(x, p, w, DX)
    for i in range(int(p[N])):
        w[MOVED + i] += w[DX + i]
        w[DX + i] = 0.0


@kernel
def apply(x: Vec, p: Vec, w: Vec, d: int) -> None:
    """Add the error state at ``w[d]`` to the estimates."""
    _turn(x, Q, w[d], w[d + 1], w[d + 2])
    for i in range(3):
        x[V + i] += w[d + DV + i]
        x[BG + i] += w[d + DBG + i]
        x[BA + i] += w[d + DBA + i]
    x[LLA] += w[d + DP] / x[R_N]
    x[LLA + 1] += w[d + DP + 1] / x[R_E]
    x[LLA + 2] -= w[d + DP + 2]
    _add(x, SG, w, d, int(p[I_SG]), 3)
    _add(x, SA, w, d, int(p[I_SA]), 3)
    k = int(p[I_MOUNT])
    if k > 0:
        _turn(x, QVB, w[d + k], w[d + k + 1], w[d + k + 2])
    _add(x, ARM_V, w, d, int(p[I_ARM_V]), 1)
    _add(x, ARM_A, w, d, int(p[I_ARM_A]), 3)
    _add(x, DELAY, w, d, int(p[I_DELAY]), 1)
    k = int(p[I_BP])
    _add(x, BP, w, d, k, 3)
    if k > 0:
        _add(x, BR, w, d, k + 3, 3)
        _add(x, BV, w, d, k + 6, 3)
    _add(x, SODO, w, d, int(p[I_SODO]), 1)
    _add(x, BARO, w, d, int(p[I_BARO]), 1)
    k = int(p[I_MAG])
    _add(x, IRON, w, d, k, 3)
    if k > 0:
        _add(x, DECLINATION, w, d, k + 3, 1)


@kernel
def _add(x: Vec, at: int, w: Vec, d: int, k: int, count: int) -> None:
    """Add an optional block of the error state, if it is on."""
    if k > 0:
        for i in range(count):
            x[at + i] += w[d + k + i]


@kernel
def reset(P: Mat, p: Vec, w: Vec, k: int, count: int, sd: float) -> None:
    """Give `count` states from index `k` a new prior of standard deviation `sd`."""
    if k < 0:
        return
    n = int(p[N])
    for i in range(k, k + count):
        for j in range(n):
            P[i, j] = 0.0
            P[j, i] = 0.0
        P[i, i] = sd * sd
    if w[RECORD] > 0.0:
        at = int(w[NEXT])
        w[at] = float(R_RESET)
        w[at + 1] = float(k)
        w[at + 2] = float(count)
        w[at + 3] = 4.0
        w[NEXT] = at + 4.0
