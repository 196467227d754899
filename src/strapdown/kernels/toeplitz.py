"""Symmetric positive definite Toeplitz matrices: the covariance of a stationary series.

All cost n**2 instead of n**3, by the recursion of Levinson and Durbin and the formula of
Gohberg and Semencul for the inverse (G. H. Golub, C. F. Van Loan, "Matrix computations",
section on Toeplitz systems).
"""

from math import log, nan

from strapdown.kernels._jit import Vec, kernel


@kernel
def solve(r: Vec, y: Vec, a: Vec, x: Vec) -> tuple[float, float]:
    """Solve ``T x = y`` for the matrix of first row `r`; return log det T and the last error.

    `a` divided by that error becomes the first column of the inverse. Both returned values are
    NaN if T is not positive definite.
    """
    n = r.shape[0]
    error = r[0]
    if not error > 0.0:
        return nan, nan
    a[0] = 1.0
    x[0] = y[0] / error
    log_det = log(error)
    for k in range(1, n):
        s = 0.0
        for j in range(k):
            s += a[j] * r[k - j]
        g = -s / error
        a[k] = 0.0
        for i in range((k + 1) // 2):
            j = k - i
            first = a[i]
            last = a[j]
            a[i] = first + g * last
            a[j] = last + g * first
        if k % 2 == 0:
            a[k // 2] += g * a[k // 2]
        error *= 1.0 - g * g
        if not error > 0.0:
            return nan, nan
        log_det += log(error)
        s = y[k]
        for j in range(k):
            s -= r[k - j] * x[j]
        s /= error
        x[k] = 0.0
        for j in range(k + 1):
            x[j] += s * a[k - j]
    return log_det, error


@kernel
def inverse_diagonals(a: Vec, error: float, sums: Vec) -> None:
    """Write the sum of each upper diagonal of the inverse, from what `solve` left."""
    n = a.shape[0]
    for j in range(n):
        s = 0.0
        for k in range(n - j):
            s += float(n - j - 2 * k) * a[k] * a[k + j]
        sums[j] = s / error


@kernel
def lagged_products(x: Vec, sums: Vec) -> None:
    """Write ``sum over k of x[k] x[k + j]`` for each lag j."""
    n = x.shape[0]
    for j in range(n):
        s = 0.0
        for k in range(n - j):
            s += x[k] * x[k + j]
        sums[j] = s
