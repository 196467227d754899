"""From a continuous model to a discrete one: exact, by one matrix exponential, or by series.

``x' = F x + B u + G w`` with white w of density Q becomes ``x_k+1 = Phi x_k + B_k u + w_k``.
Source: thesis GNSS/INS theory, 3.6: (3.6.25) to (3.6.31). Misprint corrected: the derivative of
Phi by its second time is ``-Phi F``. Three-axis platform, 7.5, prints closed forms for its
attitude error (7.22) to (7.29), and their first terms, (8.1) to (8.5).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m

_HIGHEST_ORDER = 1000  # of a series; far beyond what adds a digit


def van_loan(
    F: ArrayLike, Q: ArrayLike, dt: float, *, G: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Transition and process noise of a step, both exact for constant F.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Dynamics [1/s].
    Q : array_like, shape (n, n), or (r, r) with `G`
        Spectral density of the white noise: its square per second.
    dt : float
        Length of the step [s].
    G : array_like, shape (n, r), optional
        Distributes the noise over the state.

    Returns
    -------
    Phi : ndarray, shape (n, n)
        ``exp(F dt)``.
    Q_d : ndarray, shape (n, n)
        ``int Phi(s) G Q G^T Phi(s)^T ds`` over the step (3.6.28).

    References
    ----------
    .. [1] C. F. Van Loan, "Computing integrals involving the matrix exponential", IEEE Trans.
           Automatic Control 23(3), 1978.

    Examples
    --------
    Position and velocity driven by white acceleration:

    >>> Phi, Q_d = van_loan([[0, 1], [0, 0]], np.diag([0, 3.0]), 2.0)
    >>> Phi
    array([[1., 2.],
           [0., 1.]])
    >>> Q_d.round(9)
    array([[8., 6.],
           [6., 6.]])
    """
    dynamics = _m.square("F", F)
    n = len(dynamics)
    noise = _m.distributed("Q", Q, G, n)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n] = -dynamics
    block[:n, n:] = noise
    block[n:, n:] = dynamics.T
    power = _expm(block * _checks.positive("dt", dt, allow_zero=True))
    Phi = power[n:, n:].T
    Q_d = Phi @ power[:n, n:]
    return np.ascontiguousarray(Phi), 0.5 * (Q_d + Q_d.T)


def transition(F: ArrayLike, dt: float, order: int | None = None) -> FloatArray:
    """Transition matrix of a step, ``exp(F dt)``.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Dynamics [1/s].
    dt : float
        Length of the step [s].
    order : int, optional
        Last power of ``F dt`` of the series (3.6.30); one is Euler's ``I + F dt``, as micro UAV
        (3.4.4) and kinematic device (4.3.3) print it. None: exact.

    Returns
    -------
    ndarray, shape (n, n)

    Examples
    --------
    >>> turn = [[0, -1], [1, 0]]
    >>> transition(turn, 0.1, order=1)
    array([[ 1. , -0.1],
           [ 0.1,  1. ]])
    >>> transition(turn, np.pi).round(9) + 0.0
    array([[-1.,  0.],
           [ 0., -1.]])
    """
    step = _m.square("F", F) * _checks.positive("dt", dt, allow_zero=True)
    if order is None:
        return _expm(step)
    term = total = np.eye(len(step))
    for k in range(1, _checks.whole("order", order, 0, _HIGHEST_ORDER) + 1):
        term = term @ step / k
        total = total + term
    return total


def noise_series(
    F: ArrayLike, Q: ArrayLike, dt: float, order: int = 1, *, G: ArrayLike | None = None
) -> FloatArray:
    """Process noise of a step by the series of (3.6.28) in dt.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Dynamics [1/s].
    Q : array_like, shape (n, n), or (r, r) with `G`
        Spectral density of the white noise.
    dt : float
        Length of the step [s].
    order : int
        Last power of dt. One is ``G Q G^T dt`` (3.6.31), which the sources use. A low order may
        have negative eigenvalues where noise reaches a state through another one only.
    G : array_like, shape (n, r), optional
        Distributes the noise over the state.

    Returns
    -------
    ndarray, shape (n, n)
        ``sum L^k(G Q G^T) dt^(k+1) / (k+1)!`` with ``L(X) = F X + X F^T``.

    Examples
    --------
    >>> noise_series([[0, 1], [0, 0]], np.diag([0, 3.0]), 2.0)
    array([[0., 0.],
           [0., 6.]])
    >>> noise_series([[0, 1], [0, 0]], np.diag([0, 3.0]), 2.0, order=3)
    array([[8., 6.],
           [6., 6.]])
    """
    dynamics = _m.square("F", F)
    term = _m.distributed("Q", Q, G, len(dynamics))
    length = _checks.positive("dt", dt, allow_zero=True)
    total = np.zeros_like(term)
    for k in range(_checks.whole("order", order, 1)):
        total = total + term * (length ** (k + 1) / math.factorial(k + 1))
        term = dynamics @ term + term @ dynamics.T
    return 0.5 * (total + total.T)


def input_matrix(F: ArrayLike, B: ArrayLike, dt: float) -> FloatArray:
    """Input matrix of a step over which the input is constant: (3.6.26), exact.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Dynamics [1/s].
    B : array_like, shape (n, q)
        Input matrix of ``x' = F x + B u``.
    dt : float
        Length of the step [s].

    Returns
    -------
    ndarray, shape (n, q)
        ``int Phi(s) B ds`` over the step.

    Examples
    --------
    >>> input_matrix([[0, 1], [0, 0]], [[0], [1]], 2.0)
    array([[2.],
           [2.]])
    """
    dynamics = _m.square("F", F)
    n = len(dynamics)
    into = _m.matrix("B", B, n)
    block = np.zeros((n + into.shape[1], n + into.shape[1]))
    block[:n, :n], block[:n, n:] = dynamics, into
    return _expm(block * _checks.positive("dt", dt, allow_zero=True))[:n, n:]


def _expm(matrix: FloatArray) -> FloatArray:
    """Return the matrix exponential."""
    from scipy.linalg import expm

    with np.errstate(over="ignore", invalid="ignore"):
        found = np.asarray(expm(matrix))
    if not np.isfinite(found).all():
        raise ValueError("`F` and `dt` must be small enough for exp(F dt) to be a number.")
    return found
