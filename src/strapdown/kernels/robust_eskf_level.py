"""How the robust error-state filter begins, and begins anew when its level is lost.

One sample of specific force may be anything where the box moves. So the force is summed up in n,
carried along by the gyroscope alone, and levels the attitude at the end of each interval:
over a time T the mean of a motion that stays about is off gravity by a change of velocity over T.
The usual field is learnt from the last of these levels on. Biases are left alone meanwhile: errors
of tens of degrees are no linear ones.
"""

from math import atan2, cos, sin, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import ALIGNED, GIVEN, P_COS_D, P_SIN_D, Q, T, V
from strapdown.kernels.quat import exp, from_two_vectors, log, mul, normalize, rotate
from strapdown.kernels.robust_eskf_covariance import DV, PHI, TAU, VEL, forget, propagate
from strapdown.kernels.robust_eskf_layout import (
    ATT,
    DRIFT,
    EXTRA,
    FIELD,
    FLAGS,
    LEVEL_DV,
    LEVEL_LEFT,
    OPEN,
    P_GRAVITY,
    P_MAG_STD,
    P_VELOCITY_STD,
    P_VELOCITY_TIME,
    QUIET,
    R_LEVEL_T,
    R_RESET,
    R_RESET_T,
    R_TURN,
    SCRATCH,
    SINCE_MAG,
    STARTED,
    USUAL,
)
from strapdown.kernels.robust_eskf_update import add_noise, clear

LEVEL_TIME = 2.0  # so long the force is summed up [s]
TILT_STD = 0.5  # of an attitude levelled from one sample, perhaps in motion [rad]
GIVEN_STD = 0.1  # of the level of an attitude that was given [rad]
HEADING_STD = 0.3  # of a heading from one sample of the field, seen level [rad]
STEEP = 2.5  # tangent of a steep dip: heading that a wrong level makes, per tilt
WEIGHTLESS = 0.1  # a mean force below this part of gravity shows no level


@kernel
def _forget_motion(x: Vec, P: Mat, p: Vec, tilt: float) -> None:
    """Velocity is unknown again and tilt to `tilt`; the open interval is dropped."""
    for i in range(2):
        forget(P, PHI + i, tilt * tilt)
    for i in range(3):
        forget(P, VEL + i, p[P_VELOCITY_STD] * p[P_VELOCITY_STD])
        x[V + i] = 0.0
        x[DRIFT + i] = 0.0
    clear(x)


@kernel
def _turn_up(x: Vec, fx: float, fy: float, fz: float) -> tuple[float, float, float, float]:
    """Turn the attitude the short way until ``(fx, fy, fz)`` in n points up; returns the turn."""
    c0, c1, c2, c3 = from_two_vectors(fx, fy, fz, 0.0, 0.0, -1.0)
    q0, q1, q2, q3 = mul(c0, c1, c2, c3, x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3])
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = normalize(q0, q1, q2, q3)
    return c0, c1, c2, c3


# fmt: off
@kernel
def level_anew(
    x: Vec, P: Mat, p: Vec, w: Vec, has_acc: bool, ax: float, ay: float, az: float
) -> None:
    """Begin with the specific force of now, if any; heading stays as it is."""
    # fmt: on
    if has_acc:
        q0, q1, q2, q3 = x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3]
        fx, fy, fz = rotate(q0, q1, q2, q3, ax, ay, az)
        _turn_up(x, fx, fy, fz)
    _forget_motion(x, P, p, TILT_STD)
    x[QUIET] = 0.0
    x[LEVEL_LEFT] = LEVEL_TIME
    for i in range(3):
        x[LEVEL_DV + i] = 0.0
    w[R_RESET] = 1.0
    w[R_RESET_T] = x[T]
    w[R_LEVEL_T] = x[T]


# fmt: off
@kernel
def start(
    x: Vec, P: Mat, p: Vec, w: Vec, has_acc: bool, has_mag: bool,
    ax: float, ay: float, az: float,
) -> None:
    """Take over the attitude that `begin` has just found, with its uncertainty."""
    # fmt: on
    x[STARTED] = 1.0
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    tilt = GIVEN_STD
    if x[ALIGNED] == GIVEN:
        _forget_motion(x, P, p, tilt)
    else:
        tilt = TILT_STD
        level_anew(x, P, p, w, has_acc, ax, ay, az)
    heading = 0.0  # without a field it is arbitrary
    if has_mag:
        heading = _heading_variance(tilt)
    P[PHI + 2, PHI + 2] = heading


@kernel
def _heading_variance(tilt: float) -> float:
    """Variance of a heading from one sample of the field where tilt is that uncertain."""
    return HEADING_STD * HEADING_STD + STEEP * STEEP * tilt * tilt


@kernel
def turn_to_first_field(x: Vec, P: Mat, w: Vec) -> None:
    """`begin` has turned the attitude to the first field: the picture so far turns about down."""
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    c0, c1, c2, c3 = mul(q0, q1, q2, q3, x[ATT], -x[ATT + 1], -x[ATT + 2], -x[ATT + 3])
    c1, c2, c3 = log(c0, c1, c2, c3)
    x[V], x[V + 1] = (
        cos(c3) * x[V] - sin(c3) * x[V + 1],
        sin(c3) * x[V] + cos(c3) * x[V + 1],
    )
    forget(P, PHI + 2, _heading_variance(sqrt(0.5 * (P[PHI, PHI] + P[PHI + 1, PHI + 1]))))
    clear(x)
    w[R_TURN] += c3
    if x[LEVEL_LEFT] == 0.0 and w[R_RESET] == 0.0:
        w[R_RESET] = 2.0
        w[R_RESET_T] = x[T]
    x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = q0, q1, q2, q3


# fmt: off
@kernel
def _face_field(
    x: Vec, P: Mat, p: Vec, w: Vec, mn: float, me: float, md: float, tilt: float
) -> None:
    """Turn the attitude to the field ``(mn, me, md)``; the last one is usual from then on."""
    # fmt: on
    h = sqrt(mn * mn + me * me)
    if h > 0.0:
        c, d = p[P_COS_D], p[P_SIN_D]
        angle = atan2(d * mn - c * me, c * mn + d * me)
        w[R_TURN] += angle
        c0, c1, c2, c3 = exp(0.0, 0.0, angle)
        q0, q1, q2, q3 = mul(c0, c1, c2, c3, x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3])
        x[ATT], x[ATT + 1], x[ATT + 2], x[ATT + 3] = q0, q1, q2, q3
        forget(P, PHI + 2, _heading_variance(tilt))
        if x[LEVEL_LEFT] == 0.0:
            x[USUAL] = h
            x[USUAL + 1] = md
            x[USUAL + 2] = 400.0 * p[P_MAG_STD] * p[P_MAG_STD]
            x[SINCE_MAG] = 0.0


@kernel
def level_on(x: Vec, P: Mat, p: Vec, w: Vec) -> None:
    """Close an interval while the level is still sought."""
    tau = x[OPEN + TAU]
    propagate(P, x, OPEN, w, SCRATCH)
    add_noise(x, P, p)
    if x[EXTRA + 1] == 0.0:  # every sample had a specific force
        for i in range(3):
            x[LEVEL_DV + i] += x[OPEN + DV + i]
    x[LEVEL_LEFT] = max(0.0, x[LEVEL_LEFT] - tau)
    gone = LEVEL_TIME - x[LEVEL_LEFT]
    fx, fy, fz = x[LEVEL_DV], x[LEVEL_DV + 1], x[LEVEL_DV + 2]
    f = sqrt(fx * fx + fy * fy + fz * fz)
    mn, me, md = x[FIELD], x[FIELD + 1], x[FIELD + 2]
    tilt = TILT_STD
    if f > WEIGHTLESS * p[P_GRAVITY] * gone:
        c0, c1, c2, c3 = _turn_up(x, fx, fy, fz)
        mn, me, md = rotate(c0, c1, c2, c3, mn, me, md)
        x[LEVEL_DV], x[LEVEL_DV + 1], x[LEVEL_DV + 2] = 0.0, 0.0, -f
        # of a velocity at each end, as uncertain as one look at it is
        looks = 2.0 * max(1.0, 2.0 * p[P_VELOCITY_TIME] / tau)
        tilt = min(tilt, sqrt(looks) * p[P_VELOCITY_STD] / f)
    x[SINCE_MAG] += tau
    if x[FIELD + 5] > 0.0 and x[USUAL + 2] == 0.0:
        k = 1.0 / x[FIELD + 5]
        _face_field(x, P, p, w, k * mn, k * me, k * md, tilt)
    _forget_motion(x, P, p, tilt)
    w[R_LEVEL_T] = x[T]
    x[FLAGS] = 0.0
