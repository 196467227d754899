"""Small dense matrices (3x3 to about 16x16) in arrays that the caller owns.

Symmetric results are symmetric by construction: the lower triangle is computed and
mirrored. Outputs must not be one of the inputs, unless the text says "in place".

A measurement enters a covariance one scalar at a time: `innovation` gives the variance to
gate with, `update` the gain and the new covariance. The update is Joseph's form,
``P = (I - k h^T) P (I - k h^T)^T + r k k^T``, in two rank-one steps that cost n^2
operations each [1]_. It stays positive where ``P - k h^T P`` does not.

References
----------
.. [1] G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation",
       Academic Press, 1977: the stabilised Kalman update.
"""

from math import sqrt

from strapdown.kernels._jit import IntVec, Mat, Vec, kernel


@kernel
def mul(a: Mat, b: Mat, out: Mat) -> None:
    """``out = A B``."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            s = 0.0
            for k in range(a.shape[1]):
                s += a[i, k] * b[k, j]
            out[i, j] = s


@kernel
def mul_t(a: Mat, b: Mat, out: Mat) -> None:
    """``out = A B^T``."""
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            s = 0.0
            for k in range(a.shape[1]):
                s += a[i, k] * b[j, k]
            out[i, j] = s


@kernel
def t_mul(a: Mat, b: Mat, out: Mat) -> None:
    """``out = A^T B``."""
    for i in range(a.shape[1]):
        for j in range(b.shape[1]):
            s = 0.0
            for k in range(a.shape[0]):
                s += a[k, i] * b[k, j]
            out[i, j] = s


@kernel
def mul_vec(a: Mat, x: Vec, out: Vec) -> None:
    """``out = A x``."""
    for i in range(a.shape[0]):
        s = 0.0
        for k in range(a.shape[1]):
            s += a[i, k] * x[k]
        out[i] = s


@kernel
def t_mul_vec(a: Mat, x: Vec, out: Vec) -> None:
    """``out = A^T x``."""
    for i in range(a.shape[1]):
        s = 0.0
        for k in range(a.shape[0]):
            s += a[k, i] * x[k]
        out[i] = s


@kernel
def congruence(a: Mat, p: Mat, work: Mat, out: Mat) -> None:
    """``out = A P A^T`` for symmetric P; `work` has the shape of A, `out` may be P."""
    mul(a, p, work)
    for i in range(a.shape[0]):
        for j in range(i + 1):
            s = 0.0
            for k in range(a.shape[1]):
                s += work[i, k] * a[j, k]
            out[i, j] = s
            out[j, i] = s


@kernel
def rank1_update(p: Mat, v: Vec, alpha: float) -> None:
    """``P += alpha v v^T`` in place, P symmetric."""
    for i in range(p.shape[0]):
        av = alpha * v[i]
        for j in range(i + 1):
            s = p[i, j] + av * v[j]
            p[i, j] = s
            p[j, i] = s


@kernel
def cholesky(a: Mat, lower: Mat) -> bool:
    """Lower factor of ``A = L L^T``; False if A is not positive definite.

    Reads the lower triangle of A and may work in place. The upper triangle of L is zero.
    """
    n = a.shape[0]
    for i in range(n):
        for j in range(i + 1):
            s = a[i, j]
            for k in range(j):
                s -= lower[i, k] * lower[j, k]
            if i == j:
                if not s > 0.0:  # also when it is NaN
                    return False
                lower[i, i] = sqrt(s)
            else:
                lower[i, j] = s / lower[j, j]
    for i in range(n):
        for j in range(i + 1, n):
            lower[i, j] = 0.0
    return True


@kernel
def cholesky_solve(lower: Mat, b: Vec, x: Vec) -> None:
    """Solve ``L L^T x = b``; `x` may be `b`."""
    n = lower.shape[0]
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= lower[i, k] * x[k]
        x[i] = s / lower[i, i]
    for m in range(n):
        i = n - 1 - m
        s = x[i]
        for k in range(i + 1, n):
            s -= lower[k, i] * x[k]
        x[i] = s / lower[i, i]


@kernel
def innovation(p: Mat, h: Vec, r: float, ph: Vec) -> float:
    """Variance ``s = h^T P h + r`` of a scalar measurement; writes ``ph = P h``."""
    s = r
    for i in range(p.shape[0]):
        t = 0.0
        for j in range(p.shape[0]):
            t += p[i, j] * h[j]
        ph[i] = t
        s += h[i] * t
    return s


@kernel
def update(p: Mat, h: Vec, r: float, s: float, ph: Vec, gain: Vec) -> None:
    """Joseph update of P in place after `innovation`; writes the gain ``k = P h / s``.

    The caller adds ``gain[i] * residual`` to its state. `ph` is overwritten.
    """
    _first_step(p, s, ph, gain)
    for i in range(p.shape[0]):
        t = 0.0
        for j in range(p.shape[0]):
            t += p[i, j] * h[j]
        ph[i] = t
    _second_step(p, r, ph, gain)


@kernel
def innovation_sparse(p: Mat, index: IntVec, h: Vec, m: int, r: float, ph: Vec) -> float:
    """`innovation` for a row whose m elements ``h[j]`` stand in the columns ``index[j]``."""
    s = r
    for i in range(p.shape[0]):
        t = 0.0
        for j in range(m):
            t += p[i, index[j]] * h[j]
        ph[i] = t
    for j in range(m):
        s += h[j] * ph[index[j]]
    return s


# fmt: off
@kernel
def update_sparse(
    p: Mat, index: IntVec, h: Vec, m: int, r: float, s: float, ph: Vec, gain: Vec
) -> None:
    """`update` for a row whose m elements ``h[j]`` stand in the columns ``index[j]``."""
    # fmt: on
    _first_step(p, s, ph, gain)
    for i in range(p.shape[0]):
        t = 0.0
        for j in range(m):
            t += p[i, index[j]] * h[j]
        ph[i] = t
    _second_step(p, r, ph, gain)


@kernel
def _first_step(p: Mat, s: float, ph: Vec, gain: Vec) -> None:
    """``k = P h / s`` and ``P1 = P - k (P h)^T`` in place."""
    d = 1.0 / s
    for i in range(p.shape[0]):
        gain[i] = d * ph[i]
    for i in range(p.shape[0]):
        for j in range(i + 1):
            t = p[i, j] - gain[i] * ph[j]
            p[i, j] = t
            p[j, i] = t


@kernel
def _second_step(p: Mat, r: float, ph: Vec, gain: Vec) -> None:
    """``P = P1 - (P1 h) k^T + r k k^T`` in place, from ``ph = P1 h`` as stored.

    Symmetrised, the last two terms are ``g k^T + k g^T`` with ``g = (r k - P1 h) / 2``.
    """
    for i in range(p.shape[0]):
        ph[i] = 0.5 * (r * gain[i] - ph[i])
    for i in range(p.shape[0]):
        for j in range(i + 1):
            t = p[i, j] + (ph[i] * gain[j] + gain[i] * ph[j])
            p[i, j] = t
            p[j, i] = t
