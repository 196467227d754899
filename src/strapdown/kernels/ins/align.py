"""Alignment in motion and in any mounting: turn of the box that makes its accelerations fit.

Between two fixes the specific force, summed in the axes of the box (alpha), has to become the
change of the receiver's velocity less gravity (beta)::

    beta_n = v_n(k) - v_n(k-1) - g_n dt = C_nb alpha_b

Gravity gives level, and any change of speed or direction gives heading. The attitude profile
matrix ``B = sum w beta alpha^T`` [1]_ is kept in the axes of now and fades with `FADE`; the
attitude is its best rotation, and the curvature of the loss there is the information on heading,
which decides when alignment is done. The gyro bias is what the gyro reads at rest, if the drive
began with one.

References
----------
.. [1] G. Wahba, "A least squares estimate of satellite attitude", SIAM Review 7(3), 1965.
"""

from math import atan2, cos, exp, isnan, sin, sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.ins.layout import (
    A_COUNT,
    A_DT,
    A_F,
    A_FIX,
    A_LLA,
    A_Q,
    A_REST,
    A_SQUARES,
    A_V,
    A_VAR,
    AB,
    BG,
    GRAVITY,
    IN_LLA,
    IN_SP,
    IN_SV,
    IN_V,
    LLA,
    R_E,
    R_N,
    S3,
    SD_HEADING,
    Q,
    V,
)
from strapdown.kernels.ins.mechanise import earth_terms
from strapdown.kernels.ins.rest import mean_rate
from strapdown.kernels.quat import dcm, from_dcm, mul, rotate
from strapdown.kernels.quat import exp as quat_exp

FADE = 30.0  # [s]
SHORTEST = 0.4  # fixes closer than this are left out: their velocity noise is one and the same [s]
LONGEST = 15.0  # [s]
WORST_FIT = 25.0  # mean square residual, of what is expected, above which nothing is believed
LEAST_COUNT = 2.5  # fixes, faded, before anything is believed
ENOUGH_COUNT = 10.0  # and before residuals may say that the receiver states too much
MARGIN = 6.0  # and so many times more than they show is believed of its errors
LEAST_FIT = 0.05  # but never less than this, of what the weights expect
MOVING = 1.0  # a fix faster than this is of no carrier at rest [m/s]
MOST_RESTS = 20.0  # blocks over which the bias is averaged


@kernel
def learn_bias(x: Vec) -> None:
    """Average the gyro's reading at rest into the bias.

    A car on a smooth road, straight or in one long turn, is as quiet; the last fix tells.
    """
    if x[A_FIX] > 0.0 and x[A_V] * x[A_V] + x[A_V + 1] * x[A_V + 1] > MOVING * MOVING:
        return
    k = 1.0 / (1.0 + min(x[A_REST], MOST_RESTS))
    x[A_REST] += 1.0
    for i in range(3):
        x[BG + i] += k * (mean_rate(x, i) - x[BG + i])


# fmt: off
@kernel
def feed(
    x: Vec, dt: float, gx: float, gy: float, gz: float, fx: float, fy: float, fz: float
) -> None:
    """Add one sample to the turn and the specific force since the last fix."""
    # fmt: on
    h = 0.5 * dt
    dw, da, db, dc = quat_exp((gx - x[BG]) * h, (gy - x[BG + 1]) * h, (gz - x[BG + 2]) * h)
    w, a, b, c = mul(x[A_Q], x[A_Q + 1], x[A_Q + 2], x[A_Q + 3], dw, da, db, dc)
    ux, uy, uz = rotate(w, a, b, c, fx, fy, fz)
    x[A_F] += ux * dt
    x[A_F + 1] += uy * dt
    x[A_F + 2] += uz * dt
    w, a, b, c = mul(w, a, b, c, dw, da, db, dc)
    s = 1.5 - 0.5 * (w * w + a * a + b * b + c * c)
    x[A_Q], x[A_Q + 1], x[A_Q + 2], x[A_Q + 3] = w * s, a * s, b * s, c * s
    x[A_DT] += dt


@kernel
def restart(x: Vec) -> None:
    """Forget all that was gathered, after a gap."""
    for i in range(9):
        x[AB + i] = 0.0
    x[A_SQUARES] = 0.0
    x[A_COUNT] = 0.0
    x[A_FIX] = 0.0
    begin_interval(x)


@kernel
def begin_interval(x: Vec) -> None:
    """Start the sums at the fix in the inbox."""
    x[A_Q], x[A_Q + 1], x[A_Q + 2], x[A_Q + 3] = 1.0, 0.0, 0.0, 0.0
    for i in range(3):
        x[A_F + i] = 0.0
        x[A_V + i] = x[IN_V + i]
        x[A_LLA + i] = x[IN_LLA + i]
    x[A_DT] = 0.0


@kernel
def take_fix(x: Vec, p: Vec, w: Vec) -> bool:
    """Take the fix in the inbox; True once heading is known to `p[SD_HEADING]`."""
    for i in range(3):
        x[LLA + i] = x[IN_LLA + i]
    earth_terms(x)
    if isnan(x[IN_V] + x[IN_V + 1] + x[IN_V + 2]):
        _velocity_from_positions(x)
    for i in range(3):
        x[V + i] = x[IN_V + i]
    if x[A_FIX] == 0.0:
        x[A_FIX] = 1.0
        begin_interval(x)
        return False
    dt = x[A_DT]
    if dt < SHORTEST:
        return False
    ready = False
    if dt < LONGEST:
        _gather(x, dt)
        ready = solve(x, p, w)
    begin_interval(x)
    return ready


@kernel
def _velocity_from_positions(x: Vec) -> None:
    """Stand in for a receiver that gives no velocity: displacement since the last fix."""
    dt = max(x[A_DT], SHORTEST)
    known = 1.0 if x[A_FIX] > 0.0 else 0.0
    x[IN_V] = known * (x[IN_LLA] - x[A_LLA]) * x[R_N] / dt
    x[IN_V + 1] = known * (x[IN_LLA + 1] - x[A_LLA + 1]) * x[R_E] / dt
    x[IN_V + 2] = -known * (x[IN_LLA + 2] - x[A_LLA + 2]) / dt
    for i in range(3):
        x[IN_SV + i] = 1.0 + x[IN_SP + i] / dt


@kernel
def _gather(x: Vec, dt: float) -> None:
    """Add one pair of vectors to B and bring it to the axes of now."""
    sd = 0.5 * (x[IN_SV] + x[IN_SV + 1])
    weight = 1.0 / (0.08 * 0.08 + 0.1 * sd * sd + 0.02 * 0.02 * dt * dt)
    b0 = x[IN_V] - x[A_V]
    b1 = x[IN_V + 1] - x[A_V + 1]
    b2 = x[IN_V + 2] - x[A_V + 2] - x[GRAVITY] * dt
    a0, a1, a2 = x[A_F], x[A_F + 1], x[A_F + 2]
    keep = exp(-dt / FADE)
    for j in range(3):
        a = weight * x[A_F + j]
        x[AB + j] = keep * x[AB + j] + b0 * a
        x[AB + 3 + j] = keep * x[AB + 3 + j] + b1 * a
        x[AB + 6 + j] = keep * x[AB + 6 + j] + b2 * a
    squares = b0 * b0 + b1 * b1 + b2 * b2 + a0 * a0 + a1 * a1 + a2 * a2
    x[A_SQUARES] = keep * x[A_SQUARES] + weight * squares
    x[A_COUNT] = keep * x[A_COUNT] + 1.0
    qw, qa, qb, qc = x[A_Q], -x[A_Q + 1], -x[A_Q + 2], -x[A_Q + 3]
    for i in range(AB, AB + 9, 3):
        r0, r1, r2 = rotate(qw, qa, qb, qc, x[i], x[i + 1], x[i + 2])
        x[i], x[i + 1], x[i + 2] = r0, r1, r2


@kernel
def _first_guess(x: Vec) -> tuple[float, float, float, float]:
    """Level from the down row of B, heading from the other two."""
    d0, d1, d2 = x[AB + 6], x[AB + 7], x[AB + 8]
    s = 1.0 / sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    d0, d1, d2 = s * d0, s * d1, s * d2
    u0, u1, u2 = -d2, 0.0, d0  # two level axes u, v with u x v = d
    if abs(d0) < 0.7:
        u0, u1, u2 = 0.0, d2, -d1
    s = 1.0 / sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    u0, u1, u2 = s * u0, s * u1, s * u2
    v0, v1, v2 = d1 * u2 - d2 * u1, d2 * u0 - d0 * u2, d0 * u1 - d1 * u0
    nu = x[AB] * u0 + x[AB + 1] * u1 + x[AB + 2] * u2
    nv = x[AB] * v0 + x[AB + 1] * v1 + x[AB + 2] * v2
    eu = x[AB + 3] * u0 + x[AB + 4] * u1 + x[AB + 5] * u2
    ev = x[AB + 3] * v0 + x[AB + 4] * v1 + x[AB + 5] * v2
    heading = atan2(eu - nv, nu + ev)  # of u
    c = cos(heading)
    s = sin(heading)
    qw, qa, qb, qc = from_dcm(
        c * u0 - s * v0, c * u1 - s * v1, c * u2 - s * v2,
        s * u0 + c * v0, s * u1 + c * v1, s * u2 + c * v2,
        d0, d1, d2,
    )  # fmt: skip
    return qw, qa, qb, qc


@kernel
def solve(x: Vec, p: Vec, w: Vec) -> bool:
    """Best attitude of B by Newton steps; True if its heading is good enough.

    Writes the attitude into ``x[Q]`` and the variance of heading into ``x[A_VAR]``.
    """
    if not x[AB + 6] * x[AB + 6] + x[AB + 7] * x[AB + 7] + x[AB + 8] * x[AB + 8] > 0.0:
        return False
    qw, qa, qb, qc = _first_guess(x)
    variance = -1.0
    trace = 0.0
    for _ in range(4):
        c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(qw, qa, qb, qc)
        for i in range(3):  # M = B C^T
            b0, b1, b2 = x[AB + 3 * i], x[AB + 3 * i + 1], x[AB + 3 * i + 2]
            w[S3 + 3 * i] = b0 * c0 + b1 * c1 + b2 * c2
            w[S3 + 3 * i + 1] = b0 * c3 + b1 * c4 + b2 * c5
            w[S3 + 3 * i + 2] = b0 * c6 + b1 * c7 + b2 * c8
        trace = w[S3] + w[S3 + 4] + w[S3 + 8]
        # curvature tr(M) I - sym(M), gradient the antisymmetric part
        h00 = trace - w[S3]
        h11 = trace - w[S3 + 4]
        h22 = trace - w[S3 + 8]
        h01 = -0.5 * (w[S3 + 1] + w[S3 + 3])
        h02 = -0.5 * (w[S3 + 2] + w[S3 + 6])
        h12 = -0.5 * (w[S3 + 5] + w[S3 + 7])
        g0 = w[S3 + 7] - w[S3 + 5]
        g1 = w[S3 + 2] - w[S3 + 6]
        g2 = w[S3 + 3] - w[S3 + 1]
        m00 = h11 * h22 - h12 * h12
        m01 = h02 * h12 - h01 * h22
        m02 = h01 * h12 - h02 * h11
        m11 = h00 * h22 - h02 * h02
        m12 = h01 * h02 - h00 * h12
        m22 = h00 * h11 - h01 * h01
        det = h00 * m00 + h01 * m01 + h02 * m02
        r0 = (m00 * g0 + m01 * g1 + m02 * g2) / det
        r1 = (m01 * g0 + m11 * g1 + m12 * g2) / det
        r2 = (m02 * g0 + m12 * g1 + m22 * g2) / det
        size = sqrt(r0 * r0 + r1 * r1 + r2 * r2)
        if not size < 1e3:
            return False
        if size > 0.5:
            r0, r1, r2 = r0 * 0.5 / size, r1 * 0.5 / size, r2 * 0.5 / size
        ew, ea, eb, ec = quat_exp(r0, r1, r2)
        qw, qa, qb, qc = mul(ew, ea, eb, ec, qw, qa, qb, qc)
        variance = m22 / det
    if not variance > 0.0:
        return False
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = qw, qa, qb, qc
    # residuals in units of what the weights expect; the loss is theirs. A receiver that states far
    # too much shows in residuals that are far too small, of which `MARGIN` times is believed.
    fit = (x[A_SQUARES] - 2.0 * trace) / x[A_COUNT] / 3.0
    trust = 1.0
    if x[A_COUNT] > ENOUGH_COUNT:
        trust = min(max(MARGIN * fit, LEAST_FIT), 1.0)
    x[A_VAR] = variance * max(fit, trust)
    known: bool = x[A_VAR] < p[SD_HEADING] * p[SD_HEADING] and x[A_COUNT] > LEAST_COUNT
    return known and fit < WORST_FIT
