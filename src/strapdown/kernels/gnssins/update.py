"""Measurement update of one of the two covariances, a scalar at a time, in Joseph form."""

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.gnssins.layout import W_DX, W_H, W_PH


@kernel
def expect(P: Mat, w: Vec, first: int, size: int, at: int, m: int, r: float) -> float:
    """Variance ``h P h + r``; the m elements of h, in ``w[W_H]``, stand for states from `at` on.

    Writes ``P h``. `first` and `size` say which block of P; `at` counts from `first`.
    """
    for i in range(size):
        v = 0.0
        for j in range(m):
            v += P[first + i, first + at + j] * w[W_H + j]
        w[W_PH + i] = v
    hph = 0.0
    for j in range(m):
        hph += w[W_H + j] * w[W_PH + at + j]
    return max(hph, 0.0) + r  # rounding may have left P below zero


# fmt: off
@kernel
def update(
    P: Mat, w: Vec, first: int, size: int, at: int, m: int,
    innovation: float, s: float, free: int,
) -> float:
    """Update after `expect`; what the update has found so far is taken off the innovation.

    Of the gain only the first `free` elements count, the others are zero: those states wait.
    ``P - k (P h)^T - (P h) k^T + s k k^T`` is Joseph's form, right for any gain. Returns the
    innovation that was left.
    """
    # fmt: on
    left = innovation
    for j in range(m):
        left -= w[W_H + j] * w[W_DX + at + j]
    for i in range(size):
        gain_i = w[W_PH + i] / s if i < free else 0.0
        w[W_DX + i] += gain_i * left
        for j in range(i + 1):
            gain_j = w[W_PH + j] / s if j < free else 0.0
            v = P[first + i, first + j] - gain_i * w[W_PH + j] - w[W_PH + i] * gain_j
            v += gain_i * s * gain_j
            P[first + i, first + j] = v
            P[first + j, first + i] = v
    return left
