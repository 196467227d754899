"""Attitude calculation of thesis E, 7.2.1 and 7.4: the quaternion, its F and its D.

``dq/dt = q w / 2 + eps q``. Equation numbers are the thesis's; its quaternion ``(a, b, c, d)`` is
q_nb. Of the two normalisations ``eps = 1 - |q|^2`` (2.8.4) is called law 2 and ``1/|q| - 1``
(7.2.2) law 1: that is the factor which each brings into F at unit norm.
"""

from math import sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.gnssins.layout import W_A, W_B, W_D, W_F, W_T


@kernel
def feedback(a: float, b: float, c: float, d: float, law: float) -> float:
    """Return eps of (2.8.4), law 2, of (7.2.2), law 1; zero for law 0."""
    n2 = a * a + b * b + c * c + d * d
    if law == 2.0:
        eps = 1.0 - n2
    elif law == 1.0:
        eps = 1.0 / sqrt(n2) - 1.0
    else:
        eps = 0.0
    return eps


# fmt: off
@kernel
def step_first_order(
    a: float, b: float, c: float, d: float,
    p: float, q: float, r: float, dt: float, law: float,
) -> tuple[float, float, float, float]:
    """One step of ``dq = (q w / 2 + eps q) dt``, (2.8.5).

    As in the thesis eps is not multiplied by a rate: it counts in 1/s.
    """
    # fmt: on
    eps = feedback(a, b, c, d, law)
    return (
        a + dt * (0.5 * (-p * b - q * c - r * d) + eps * a),
        b + dt * (0.5 * (p * a + r * c - q * d) + eps * b),
        c + dt * (0.5 * (q * a - r * b + p * d) + eps * c),
        d + dt * (0.5 * (r * a + q * b - p * c) + eps * d),
    )


# fmt: off
@kernel
def write_f(
    w: Vec, a: float, b: float, c: float, d: float,
    p: float, q: float, r: float, law: float,
) -> None:
    """Write F_q, (7.2.8) for law 2, at unit norm: ``Omega(w) / 2 - law q q^T``."""
    # fmt: on
    (
        w[W_F], w[W_F + 1], w[W_F + 2], w[W_F + 3],
        w[W_F + 4], w[W_F + 5], w[W_F + 6], w[W_F + 7],
        w[W_F + 8], w[W_F + 9], w[W_F + 10], w[W_F + 11],
        w[W_F + 12], w[W_F + 13], w[W_F + 14], w[W_F + 15],
    ) = (
        -law * a * a, -0.5 * p - law * a * b, -0.5 * q - law * a * c, -0.5 * r - law * a * d,
        0.5 * p - law * a * b, -law * b * b, 0.5 * r - law * b * c, -0.5 * q - law * b * d,
        0.5 * q - law * a * c, -0.5 * r - law * b * c, -law * c * c, 0.5 * p - law * c * d,
        0.5 * r - law * a * d, 0.5 * q - law * b * d, -0.5 * p - law * c * d, -law * d * d,
    )  # fmt: skip


@kernel
def write_d(w: Vec, a: float, b: float, c: float, d: float) -> None:
    """Write D_q (7.2.9), ``dq/dt = D_q w``."""
    (
        w[W_D], w[W_D + 1], w[W_D + 2],
        w[W_D + 3], w[W_D + 4], w[W_D + 5],
        w[W_D + 6], w[W_D + 7], w[W_D + 8],
        w[W_D + 9], w[W_D + 10], w[W_D + 11],
    ) = (
        -0.5 * b, -0.5 * c, -0.5 * d,
        0.5 * a, -0.5 * d, 0.5 * c,
        0.5 * d, 0.5 * a, -0.5 * b,
        -0.5 * c, 0.5 * b, 0.5 * a,
    )  # fmt: skip


@kernel
def transition_series(w: Vec, dt: float, terms: int) -> None:
    """Write ``A = exp(F dt)`` and ``B = -integral of exp(F s) ds D``, (7.2.28), by series.

    B has a minus, for the thesis adds its bias and this project subtracts one.
    """
    for i in range(16):
        one = 1.0 if i % 5 == 0 else 0.0
        w[W_A + i] = one
        w[W_T + i] = one  # (F dt)^k / k!
        w[W_T + 16 + i] = one  # sum of (F dt)^k / (k + 1)!
    for k in range(1, terms + 1):
        for i in range(4):
            for j in range(4):
                v = 0.0
                for m in range(4):
                    v += w[W_T + 4 * i + m] * w[W_F + 4 * m + j]
                w[W_B + j] = v * dt / float(k)  # a row, before the old one is overwritten
            for j in range(4):
                w[W_T + 4 * i + j] = w[W_B + j]
                w[W_A + 4 * i + j] += w[W_B + j]
                w[W_T + 16 + 4 * i + j] += w[W_B + j] / float(k + 1)
    for i in range(4):
        for j in range(3):
            v = 0.0
            for m in range(4):
                v += w[W_T + 16 + 4 * i + m] * w[W_D + 3 * m + j]
            w[W_B + 3 * i + j] = -dt * v


# fmt: off
@kernel
def transition_step(
    w: Vec, a: float, b: float, c: float, d: float,
    ew: float, ex: float, ey: float, ez: float, dt: float,
) -> None:
    """Write A and B of one sample: the turn e, then normalisation, at the new q.

    ``A = (I - q q^T) R(e)`` with ``R(e) q = q e``; ``B = -dt D(q) (I - [r x] / 2)`` with the
    rotation vector r of the turn, of which the quaternion e holds half.
    """
    # fmt: on
    # rows of R(e), less q (q^T R(e)); q^T R(e) is the old q, conjugate turn undone
    oa = ew * a + ex * b + ey * c + ez * d
    ob = -ex * a + ew * b - ez * c + ey * d
    oc = -ey * a + ez * b + ew * c - ex * d
    od = -ez * a - ey * b + ex * c + ew * d
    (
        w[W_A], w[W_A + 1], w[W_A + 2], w[W_A + 3],
        w[W_A + 4], w[W_A + 5], w[W_A + 6], w[W_A + 7],
        w[W_A + 8], w[W_A + 9], w[W_A + 10], w[W_A + 11],
        w[W_A + 12], w[W_A + 13], w[W_A + 14], w[W_A + 15],
    ) = (
        ew - a * oa, -ex - a * ob, -ey - a * oc, -ez - a * od,
        ex - b * oa, ew - b * ob, ez - b * oc, -ey - b * od,
        ey - c * oa, -ez - c * ob, ew - c * oc, ex - c * od,
        ez - d * oa, ey - d * ob, -ex - d * oc, ew - d * od,
    )  # fmt: skip
    write_d(w, a, b, c, d)
    for i in range(4):
        k = 3 * i
        dx, dy, dz = w[W_D + k], w[W_D + k + 1], w[W_D + k + 2]
        w[W_B + k] = -dt * (dx - ez * dy + ey * dz)
        w[W_B + k + 1] = -dt * (dy - ex * dz + ez * dx)
        w[W_B + k + 2] = -dt * (dz - ey * dx + ex * dy)
