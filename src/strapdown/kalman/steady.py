"""Constant gain: where the covariance of a time-invariant filter settles.

Where Phi, H, Q and R are constant so are, after a while, P and K: they can be computed
beforehand and stored, which spares a small processor all matrices but the gain. Sources: thesis
indoor explorer, B.2 (printed: "after the first iteration"; it takes as many as the filter is
slow); GNSS/INS theory, 3.1.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import NotConverged
from strapdown.kalman import _matrices as _m
from strapdown.kalman.linear import measurements


class SteadyState(NamedTuple):
    """Where a filter settles.

    Attributes
    ----------
    P_before, P_after : ndarray, shape (n, n)
        Covariance before and after each measurement.
    K : ndarray, shape (n, m)
        Gain.
    S : ndarray, shape (m, m)
        Covariance of the innovation.
    decay : float
        Largest magnitude of an eigenvalue of ``(I - K H) Phi``: what is left of an error after
        one step. Below one the filter is stable.
    """

    P_before: FloatArray
    P_after: FloatArray
    K: FloatArray
    S: FloatArray
    decay: float


def steady_state(
    Phi: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    *,
    tolerance: float = 1e-13,
    max_iterations: int = 60,
) -> SteadyState:
    """Solve the Riccati equation of a time-invariant filter.

    Parameters
    ----------
    Phi : array_like, shape (n, n)
        Transition matrix.
    H : array_like, shape (m, n)
        Measurement matrix.
    Q : array_like, shape (n, n)
        Covariance of the process noise of a step.
    R : array_like, shape (m, m)
        Covariance of the measurement noise, positive definite.
    tolerance : float
        Relative change of the covariance at which it has settled.
    max_iterations : int
        Doublings: k of them are ``2^k`` steps of the filter.

    Returns
    -------
    SteadyState

    Raises
    ------
    ValueError
        If shapes do not fit or a covariance is none.
    NotConverged
        If the covariance does not settle: a state that is not stable is not seen, or one on the
        edge of stability is not driven by noise.

    References
    ----------
    .. [1] E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, "Structure-preserving algorithms for
           periodic discrete-time algebraic Riccati equations", Int. J. Control 77, 2004: doubling.

    Examples
    --------
    A random walk, seen with noise of the same size: the golden section.

    >>> found = steady_state([[1]], [[1]], [[1]], [[1]])
    >>> found.P_before.round(6), found.K.round(6), round(found.decay, 6)
    (array([[1.618034]]), array([[0.618034]]), 0.381966)
    """
    _checks.positive("tolerance", tolerance)
    step = _m.square("Phi", Phi)
    n = len(step)
    rows = _m.matrix("H", H, columns=n)
    error = _m.covariance("R", R, len(rows), definite=True)
    A, P = step.T, _m.covariance("Q", Q, n)
    gathered = rows.T @ np.linalg.solve(error, rows)
    change = np.inf
    with np.errstate(over="ignore", invalid="ignore"):  # what does not settle may grow
        for _ in range(_checks.whole("max_iterations", max_iterations, 1)):
            left = np.linalg.inv(np.eye(n) + gathered @ P)
            added = A.T @ P @ left @ A
            gathered = gathered + A @ left @ gathered @ A.T
            A = A @ left @ A
            P = P + 0.5 * (added + added.T)
            scale = float(np.abs(P).max())
            change = float(np.abs(added).max()) / max(scale, np.finfo(float).tiny)
            if not (np.isfinite(scale) and np.isfinite(A).all() and change >= tolerance):
                break
    if change < tolerance:
        S = rows @ P @ rows.T + error
        K = _m.solve("R", S, rows @ P).T
        left = np.eye(n) - K @ rows
        decay = float(np.abs(np.linalg.eigvals(left @ step)).max())
        if decay < 1.0:
            after = left @ P @ left.T + K @ error @ K.T
            return SteadyState(P, 0.5 * (after + after.T), K, S, decay)
    raise NotConverged(
        "steady state of the filter",
        max_iterations,
        change,
        "every state that is not stable must be seen by H and driven by Q",
    )


def run_constant(
    z: ArrayLike, Phi: ArrayLike, H: ArrayLike, K: ArrayLike, x0: ArrayLike
) -> FloatArray:
    """Filter a series of measurements with a constant gain.

    Parameters
    ----------
    z : array_like, shape (k, m)
        Measurements; in a row with NaN nothing was measured.
    Phi : array_like, shape (n, n)
        Transition matrix.
    H : array_like, shape (m, n)
        Measurement matrix.
    K : array_like, shape (n, m)
        Gain, as of `steady_state`.
    x0 : array_like, shape (n,)
        State at the first measurement, before it.

    Returns
    -------
    ndarray, shape (k, n)
        States after each measurement.

    Examples
    --------
    >>> run_constant([[1.0], [1.0]], [[1]], [[1]], [[0.5]], [0])
    array([[0.5 ],
           [0.75]])
    """
    state = _m.vector("x0", x0)
    n = state.size
    looks = measurements(z)
    step, rows = _m.square("Phi", Phi, n), _m.matrix("H", H, looks.shape[1], n)
    gain = _m.matrix("K", K, n, looks.shape[1])
    out = np.empty((len(looks), n))
    for i, look in enumerate(looks):
        if i:
            state = step @ state
        if not np.isnan(look).any():
            state = state + gain @ (look - rows @ state)
        out[i] = state
    return out
