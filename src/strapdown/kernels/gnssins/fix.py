"""GNSS fixes in thesis E's system: speed for the vertical reference, residuals for the filter."""

from math import atan2, cos, inf, isfinite, sin, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.gnssins.layout import (
    ACC_ERROR,
    COURSE,
    FIX_AGE,
    FIX_LLA,
    FIX_REFUSED,
    FIX_T,
    FIX_V,
    GRAVITY,
    NAVIGATING,
    P_0_A,
    P_0_B,
    P_0_X,
    P_FIX_PERIOD,
    P_GATE,
    P_IN_BODY,
    P_MIN_SPEED,
    P_PRINTED,
    P_Q_A,
    P_Q_B,
    P_Q_V,
    P_R_P,
    P_R_V,
    P_RECEIVER,
    P_RECOVER,
    P_STATES,
    PV,
    R_E,
    R_N,
    SINCE_FIX,
    SINCE_PV,
    U_DOT,
    W_DX,
    W_FIX,
    W_H,
    W_NEW,
    U,
)
from strapdown.kernels.gnssins.position import add_noise, start, transition
from strapdown.kernels.gnssins.update import expect, update
from strapdown.kernels.ins.mechanise import (
    E2,
    FLATTENING,
    GAMMA_E,
    SOMIGLIANA_K,
    SOMIGLIANA_M,
    A,
)
from strapdown.kernels.memory import (
    BA,
    GNSS,
    LLA,
    STD_BA,
    STD_POS,
    STD_V,
    Q,
    T,
    V,
    set_status,
)
from strapdown.kernels.quat import dcm, rotate_inverse

LEAST_COSINE = 1e-5  # 64 m from the pole
HALF_PI = 1.5707963267948966
PI = 3.141592653589793
FAR = 1e5  # heights beyond are no fix [m]
LOST = 1e7  # the filter's own height [m], speed [m/s], bias [m/s^2] beyond are nonsense
FAST = 1e4  # speeds beyond are no measurement [m/s]
LATE = 0.02  # by which the time between two fixes may vary [s]
LONGEST = 3.0  # between fixes whose speeds make an acceleration [s]


@kernel
def wrapped(angle: float) -> float:
    """Longitude, or a difference of two, in (-pi, pi]."""
    if angle > PI:
        angle -= 2.0 * PI
    elif angle <= -PI:
        angle += 2.0 * PI
    return angle


@kernel
def shift(x: Vec, dt: float, vn: float, ve: float, vd: float) -> None:
    """Move the position for dt at the velocity plus what is given; the Earth is flat."""
    x[LLA] = min(max(x[LLA] + (x[V] + vn) * dt / x[R_N], -HALF_PI), HALF_PI)
    x[LLA + 1] = wrapped(x[LLA + 1] + (x[V + 1] + ve) * dt / x[R_E])
    x[LLA + 2] -= (x[V + 2] + vd) * dt


@kernel
def earth_here(x: Vec) -> None:
    """Renew radii and gravity for the place."""
    sine = sin(x[LLA])
    s2 = sine * sine
    root = sqrt(1.0 - E2 * s2)
    height = x[LLA + 2]
    x[R_N] = A * (1.0 - E2) / (root * root * root) + height
    x[R_E] = (A / root + height) * max(cos(x[LLA]), LEAST_COSINE)
    r = height / A
    slope = 1.0 + FLATTENING + SOMIGLIANA_M - 2.0 * FLATTENING * s2
    surface = GAMMA_E * (1.0 + SOMIGLIANA_K * s2) / root
    x[GRAVITY] = surface * (1.0 - 2.0 * slope * r + 3.0 * r * r)


@kernel
def usable(x: Vec) -> bool:
    """Whether the fix in the inbox has a possible position that is newer than the last."""
    on_earth = abs(x[GNSS + 2]) <= HALF_PI and abs(x[GNSS + 3]) <= 2.0 * PI
    return bool(on_earth and abs(x[GNSS + 4]) < FAR and x[GNSS + 1] > x[FIX_T])


@kernel
def take_motion(x: Vec, p: Vec) -> None:
    """Take speed, its change and course from the fix in the inbox; keep it as the last fix.

    Without a velocity the displacement since the last fix gives one.
    """
    dt = x[GNSS + 1] - x[FIX_T]  # infinite at the first fix
    vn, ve, vd = x[GNSS + 5], x[GNSS + 6], x[GNSS + 7]
    if not (abs(vn) < FAST and abs(ve) < FAST and abs(vd) < FAST):
        vn, ve, vd = inf, inf, inf
        if dt < LONGEST:
            k = A / dt
            vn = k * (x[GNSS + 2] - x[FIX_LLA])
            ve = k * wrapped(x[GNSS + 3] - x[FIX_LLA + 1]) * cos(x[GNSS + 2])
            vd = -(x[GNSS + 4] - x[FIX_LLA + 2]) / dt
    u = sqrt(vn * vn + ve * ve + vd * vd)
    x[U_DOT] = 0.0
    if dt < LONGEST and isfinite(u) and isfinite(x[U]):
        x[U_DOT] = (u - x[U]) / dt
    x[U] = u
    x[COURSE] = inf
    if isfinite(u) and vn * vn + ve * ve > p[P_MIN_SPEED] * p[P_MIN_SPEED]:
        x[COURSE] = atan2(ve, vn)
    x[FIX_T] = x[GNSS + 1]
    x[FIX_LLA] = x[GNSS + 2]
    x[FIX_LLA + 1] = wrapped(x[GNSS + 3])
    x[FIX_LLA + 2] = x[GNSS + 4]
    x[FIX_V], x[FIX_V + 1], x[FIX_V + 2] = vn, ve, vd
    x[FIX_AGE] = 0.0


@kernel
def sigma2(x: Vec, p: Vec, cell: int, usual: float) -> float:
    """Variance of a component of the fix: the receiver's, where it is one and wanted."""
    std = x[cell]
    if p[P_RECEIVER] > 0.0 and std > 0.0 and std < 1e4:
        return float(std * std)
    return usual


@kernel
def begin_navigation(x: Vec, P: Mat, p: Vec) -> None:
    """Set position and velocity to the last fix."""
    for i in range(3):
        x[LLA + i] = x[FIX_LLA + i]
        x[V + i] = x[FIX_V + i] if isfinite(x[FIX_V + i]) else 0.0
        x[ACC_ERROR + i] = 0.0
    earth_here(x)
    start(P, int(p[P_STATES]), p[P_0_A], p[P_0_B])
    for i in range(3):
        P[PV + i, PV + i] = sigma2(x, p, GNSS + 8 + i, p[P_R_P])
        P[PV + 3 + i, PV + 3 + i] = sigma2(x, p, GNSS + 11 + i, p[P_R_V])
        if p[P_0_X] > 0.0:
            P[PV + i, PV + i] = p[P_0_X]
            P[PV + 3 + i, PV + 3 + i] = p[P_0_X]
    x[NAVIGATING] = 1.0
    x[SINCE_PV] = 0.0
    x[SINCE_FIX] = 0.0
    x[FIX_REFUSED] = 0.0


@kernel
def possible(x: Vec) -> bool:
    """Whether position, velocity and bias are numbers that a box on Earth may have."""
    sum_v = abs(x[V]) + abs(x[V + 1]) + abs(x[V + 2])
    sum_b = abs(x[BA]) + abs(x[BA + 1]) + abs(x[BA + 2])
    there = abs(x[LLA]) <= HALF_PI and abs(x[LLA + 1]) <= PI and abs(x[LLA + 2]) < LOST
    return bool(there and sum_v < LOST and sum_b < LOST)


@kernel
def propagate(x: Vec, P: Mat, p: Vec) -> None:
    """Bring the position filter's covariance to now."""
    dt = x[SINCE_PV]
    if dt > 0.0:
        states = int(p[P_STATES])
        transition(P, PV, states, dt, p[P_PRINTED])
        add_noise(P, PV, states, dt, p[P_Q_V], p[P_Q_A], p[P_Q_B], p[P_PRINTED])
        x[SINCE_PV] = 0.0


@kernel
def residual(x: Vec, i: int, at: float) -> float:
    """GNSS less INS, component i of position and then velocity (POSVEL_res), at the fix's time."""
    if i == 0:
        off = (x[FIX_LLA] - x[LLA]) * x[R_N] + x[V] * at
    elif i == 1:
        off = wrapped(x[FIX_LLA + 1] - x[LLA + 1]) * x[R_E] + x[V + 1] * at
    elif i == 2:
        off = x[LLA + 2] - x[FIX_LLA + 2] + x[V + 2] * at
    else:
        off = x[FIX_V + i - 3] - x[V + i - 3]
    return float(off)


@kernel
def take_fix(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Update with the last fix: gate, gain, and the corrections to where they belong."""
    if x[SINCE_FIX] < p[P_FIX_PERIOD] - LATE:
        return
    propagate(x, P, p)
    states = int(p[P_STATES])
    at = x[T] - x[FIX_T]
    waited = x[SINCE_FIX]
    x[SINCE_FIX] = 0.0
    for i in range(12):
        w[W_DX + i] = 0.0
    w[W_H] = 1.0
    for part in range(2):
        row = W_FIX + 7 * part
        usual = p[P_R_P] if part == 0 else p[P_R_V]
        w[row + 6] = s.ACCEPTED
        for i in range(3):
            k = 3 * part + i
            r = sigma2(x, p, GNSS + 8 + k, usual)
            z = residual(x, k, at)
            v = expect(P, w, PV, states, k, 1, r)
            w[row + i] = z
            w[row + 3 + i] = sqrt(v)
            if not isfinite(z):
                w[row + 6] = s.NOT_MEASURED
            elif z * z > p[P_GATE] * v and w[row + 6] == s.ACCEPTED:
                w[row + 6] = s.REJECTED_GATE
    w[W_NEW + 1] = 1.0
    refused = w[W_FIX + 6] == s.REJECTED_GATE or w[W_FIX + 13] == s.REJECTED_GATE
    if refused:
        set_status(x, s.AIDING_REJECTED)
        x[FIX_REFUSED] += waited
        if x[FIX_REFUSED] > p[P_RECOVER]:  # it is the filter that is wrong
            begin_navigation(x, P, p)
        return
    x[FIX_REFUSED] = 0.0
    for k in range(6):
        part = k // 3
        if w[W_FIX + 7 * part + 6] == s.ACCEPTED:
            r = sigma2(x, p, GNSS + 8 + k, p[P_R_P] if part == 0 else p[P_R_V])
            v = expect(P, w, PV, states, k, 1, r)
            update(P, w, PV, states, k, 1, w[W_FIX + 7 * part + k - 3 * part], v, states)
    feed_back(x, p, w, states)


@kernel
def feed_back(x: Vec, p: Vec, w: Vec, states: int) -> None:
    """Move the residual state into position, velocity, acceleration and accelerometer bias."""
    x[LLA] = min(max(x[LLA] + w[W_DX] / x[R_N], -HALF_PI), HALF_PI)
    x[LLA + 1] = wrapped(x[LLA + 1] + w[W_DX + 1] / x[R_E])
    x[LLA + 2] -= w[W_DX + 2]
    for i in range(3):
        x[V + i] += w[W_DX + 3 + i]
        x[ACC_ERROR + i] += w[W_DX + 6 + i]
    if states > 9:
        bn, be, bd = w[W_DX + 9], w[W_DX + 10], w[W_DX + 11]
        if p[P_IN_BODY] > 0.0:  # what is to be added in n is to be subtracted in b
            bx, by, bz = rotate_inverse(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], bn, be, bd)
            x[BA] -= bx
            x[BA + 1] -= by
            x[BA + 2] -= bz
        else:
            x[ACC_ERROR] += bn
            x[ACC_ERROR + 1] += be
            x[ACC_ERROR + 2] += bd
    earth_here(x)


@kernel
def write_std(x: Vec, P: Mat, p: Vec) -> None:
    """Write the standard deviations of position, velocity and accelerometer bias.

    The three axes of the filter never mix, so that its bias has no covariance between them.
    """
    for i in range(3):
        x[STD_POS + i] = sqrt(max(P[PV + i, PV + i], 0.0))
        x[STD_V + i] = sqrt(max(P[PV + 3 + i, PV + 3 + i], 0.0))
    if p[P_STATES] > 9.0 and p[P_IN_BODY] > 0.0:
        bn, be, bd = P[PV + 9, PV + 9], P[PV + 10, PV + 10], P[PV + 11, PV + 11]
        c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        x[STD_BA] = sqrt(c11 * c11 * bn + c21 * c21 * be + c31 * c31 * bd)
        x[STD_BA + 1] = sqrt(c12 * c12 * bn + c22 * c22 * be + c32 * c32 * bd)
        x[STD_BA + 2] = sqrt(c13 * c13 * bn + c23 * c23 * be + c33 * c33 * bd)
