"""Linear Kalman filter: prediction, correction in Joseph form, and the loop over a series.

Sources: thesis GNSS/INS theory, 3.1 to 3.7; three-axis platform, 3.4.1; kinematic device, 4.3.2;
indoor explorer, B.1 and B.2; micro UAV, 2.2. They agree but for names: Phi here is A or F there,
G is W, J is V. All print ``P = (I - K H) P``; here it is Joseph's form (3.11.24 bis), which stays
symmetric and without negative eigenvalues.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m


class Estimate(NamedTuple):
    """A state and how sure it is.

    Attributes
    ----------
    x : ndarray, shape (n,)
        State.
    P : ndarray, shape (n, n)
        Covariance of its error.
    """

    x: FloatArray
    P: FloatArray


class Correction(NamedTuple):
    """What a measurement makes of an estimate.

    Attributes
    ----------
    x, P : ndarray, shape (n,), (n, n)
        State and covariance after it.
    innovation : ndarray, shape (m,)
        Measured less predicted.
    S : ndarray, shape (m, m)
        Covariance of the innovation, ``H P H^T + R``.
    K : ndarray, shape (n, m)
        Gain.
    """

    x: FloatArray
    P: FloatArray
    innovation: FloatArray
    S: FloatArray
    K: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """A filter's estimates over a series of k measurements.

    Attributes
    ----------
    x : ndarray, shape (k, n)
        States after each measurement.
    P : ndarray, shape (k, n, n)
        Their covariances.
    innovation : ndarray, shape (k, m)
        Measured less predicted; NaN where nothing was measured.
    S : ndarray, shape (k, m, m)
        Covariances of the innovations.
    """

    x: FloatArray
    P: FloatArray
    innovation: FloatArray
    S: FloatArray


def predict(
    x: ArrayLike,
    P: ArrayLike,
    Phi: ArrayLike,
    Q: ArrayLike,
    *,
    G: ArrayLike | None = None,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
) -> Estimate:
    """Estimate one step later, from the estimate now.

    Parameters
    ----------
    x : array_like, shape (n,)
        State.
    P : array_like, shape (n, n)
        Its covariance.
    Phi : array_like, shape (n, n)
        Transition matrix of the step.
    Q : array_like, shape (n, n), or (r, r) with `G`
        Covariance of the process noise of the step.
    G : array_like, shape (n, r), optional
        Distributes the noise over the state.
    B : array_like, shape (n, q), optional
        Input matrix; with `u`.
    u : array_like, shape (q,), optional
        Known input, constant over the step.

    Returns
    -------
    Estimate
        ``Phi x + B u`` and ``Phi P Phi^T + G Q G^T``.

    Raises
    ------
    ValueError
        If shapes do not fit or a covariance is none.

    Examples
    --------
    A clock that drifts by one part in a thousand:

    >>> x, P = predict([0.0, 1e-3], np.diag([1.0, 1e-6]), [[1, 10], [0, 1]], np.zeros((2, 2)))
    >>> x
    array([0.01 , 0.001])
    """
    state = _m.vector("x", x)
    n = state.size
    step = _m.square("Phi", Phi, n)
    noise = _m.distributed("Q", Q, G, n)
    ahead = step @ state + _input(B, u, n)
    return Estimate(ahead, _congruence(step, _m.covariance("P", P, n), noise))


def update(
    x: ArrayLike,
    P: ArrayLike,
    z: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    *,
    J: ArrayLike | None = None,
) -> Correction:
    """Estimate after a measurement ``z = H x + J v``.

    Parameters
    ----------
    x : array_like, shape (n,)
        State before it.
    P : array_like, shape (n, n)
        Its covariance.
    z : array_like, shape (m,)
        What was measured.
    H : array_like, shape (m, n)
        Measurement matrix.
    R : array_like, shape (m, m), or (l, l) with `J`
        Covariance of the measurement noise.
    J : array_like, shape (m, l), optional
        Distributes the noise over the measurement.

    Returns
    -------
    Correction

    Raises
    ------
    ValueError
        If shapes do not fit, a covariance is none, or the innovation's is singular.

    Examples
    --------
    Two equally good looks at one number:

    >>> found = update([0.0], [[1.0]], [1.0], [[1.0]], [[1.0]])
    >>> found.x, found.P
    (array([0.5]), array([[0.5]]))
    """
    state = _m.vector("x", x)
    measured = _m.vector("z", z)
    rows = _m.matrix("H", H, measured.size, state.size)
    return corrected(
        state,
        _m.covariance("P", P, state.size),
        measured - rows @ state,
        rows,
        _m.distributed("R", R, J, measured.size),
    )


def run(
    z: ArrayLike,
    Phi: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    G: ArrayLike | None = None,
    J: ArrayLike | None = None,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
) -> Track:
    """Filter a series of measurements.

    Parameters
    ----------
    z : array_like, shape (k, m)
        Measurements; in a row with NaN nothing was measured.
    Phi, H, Q, R : array_like
        As in `predict` and `update`, the same for all steps.
    x0 : array_like, shape (n,)
        State at the first measurement, before it.
    P0 : array_like, shape (n, n)
        Its covariance.
    G, J, B : array_like, optional
        As in `predict` and `update`.
    u : array_like, shape (k, q), optional
        Input from each measurement to the next; the last is not used.

    Returns
    -------
    Track

    Raises
    ------
    ValueError
        If shapes do not fit or a covariance is none.

    Examples
    --------
    A constant, looked at four times with unit noise; the second look is missing:

    >>> track = run([[1.2], [np.nan], [0.8], [1.0]], [[1]], [[1]], [[0]], [[1]], [0], [[1e6]])
    >>> track.x[:, 0].round(3)
    array([1.2, 1.2, 1. , 1. ])
    >>> track.P[:, 0, 0].round(3)
    array([1.   , 1.   , 0.5  , 0.333])
    """
    state = _m.vector("x0", x0)
    n = state.size
    cov = _m.covariance("P0", P0, n)
    looks = measurements(z)
    k, m = looks.shape
    step, rows = _m.square("Phi", Phi, n), _m.matrix("H", H, m, n)
    noise, error = _m.distributed("Q", Q, G, n), _m.distributed("R", R, J, m)
    inputs = inputs_of(B, u, k)
    track = empty_track(k, n, m)
    for i in range(k):
        if i:
            state = step @ state + _input(B, None if inputs is None else inputs[i - 1], n)
            cov = _congruence(step, cov, noise)
        state, cov = put(track, i, state, cov, looks[i] - rows @ state, rows, error)
    return track


# --- on checked arrays, for the other filters of this package ---------------------------------


def corrected(
    x: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> Correction:
    """Return the correction by an innovation, in Joseph form."""
    S = H @ P @ H.T + R
    S = 0.5 * (S + S.T)
    K = _m.solve("R", S, H @ P).T
    left = np.eye(x.size) - K @ H
    return Correction(x + K @ innovation, _congruence(left, P, K @ R @ K.T), innovation, S, K)


def put(
    track: Track,
    i: int,
    x: FloatArray,
    P: FloatArray,
    innovation: FloatArray,
    H: FloatArray,
    R: FloatArray,
) -> Estimate:
    """Correct, unless the innovation is NaN, and write row i of the track."""
    if not np.isnan(innovation).any():
        x, P, track.innovation[i], track.S[i], _ = corrected(x, P, innovation, H, R)
    track.x[i], track.P[i] = x, P
    return Estimate(x, P)


def empty_track(k: int, n: int, m: int) -> Track:
    """Return a track in which nothing was measured yet."""
    return Track(
        x=np.empty((k, n)),
        P=np.empty((k, n, n)),
        innovation=np.full((k, m), np.nan),
        S=np.full((k, m, m), np.nan),
    )


def measurements(z: ArrayLike) -> FloatArray:
    """Return measurements of shape (k, m)."""
    array = _checks.as_floats("z", z)
    if array.ndim != 2:
        raise ValueError(f"`z` must have shape (k, m), one measurement a row, got {array.shape}.")
    if np.isinf(array).any():
        raise ValueError("`z` must be finite or NaN, got inf.")
    return array


def inputs_of(B: ArrayLike | None, u: ArrayLike | None, k: int) -> FloatArray | None:
    """Return inputs of shape (k, q), if there are any."""
    if (B is None) != (u is None):
        raise ValueError("`B` and `u` must be given together, got one of them.")
    if u is None:
        return None
    array = _m.matrix("u", u)
    if len(array) != k:
        raise ValueError(f"`u` must have as many rows as `z`, got {len(array)} and {k}.")
    return array


def _input(B: ArrayLike | None, u: ArrayLike | None, n: int) -> FloatArray:
    """Return ``B u``, zero without."""
    if (B is None) != (u is None):
        raise ValueError("`B` and `u` must be given together, got one of them.")
    if B is None or u is None:
        return np.zeros(n)
    into = _m.matrix("B", B, n)
    return np.asarray(into @ _m.vector("u", u, into.shape[1]))


def _congruence(left: FloatArray, P: FloatArray, noise: FloatArray) -> FloatArray:
    """Return ``left P left^T + noise``, symmetric to the last bit."""
    out = left @ P @ left.T + noise
    return np.asarray(0.5 * (out + out.T))
