"""Extended and linearised Kalman filters.

Both work on deviations from a reference trajectory. The linearised filter takes a nominal one,
known beforehand; the extended filter the estimate itself, which it moves there after each
correction, so that the deviation starts from zero again. Sources: thesis GNSS/INS theory, 3.11;
three-axis platform, 3.4.2; indoor explorer, B.3; micro UAV, 2.3.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m
from strapdown.kalman.linear import (
    Correction,
    Estimate,
    Track,
    corrected,
    empty_track,
    measurements,
    put,
)

Function: TypeAlias = Callable[[FloatArray], ArrayLike]
Matrix: TypeAlias = ArrayLike | Function


def jacobian(f: Function, x: ArrayLike, step: float = 1e-6) -> FloatArray:
    """Return the derivative of a function of a vector, by central differences.

    Parameters
    ----------
    f : callable
        Takes an array of shape (n,), returns one of shape (m,).
    x : array_like, shape (n,)
        Where.
    step : float
        Step of each element, relative to it where it is larger than one.

    Returns
    -------
    ndarray, shape (m, n)
        Off by some ``step^2`` of the third derivative, and by ``1e-16 / step``.

    Examples
    --------
    >>> jacobian(lambda x: [x[0] * x[1], np.sin(x[1])], [2.0, 0.0]).round(9)
    array([[0., 2.],
           [0., 1.]])
    """
    _checks.call("f", f)
    _checks.positive("step", step)
    at = _m.vector("x", x)
    if not at.size:
        raise ValueError("`x` must hold at least one number, got none.")
    columns = []
    for i in range(at.size):
        d = np.zeros(at.size)
        d[i] = step * max(1.0, abs(at[i]))
        up, down = _m.vector("f(x)", f(at + d)), _m.vector("f(x)", f(at - d))
        columns.append((up - down) / (2.0 * d[i]))
    return np.stack(columns, axis=1)


def extended_predict(
    x: ArrayLike,
    P: ArrayLike,
    f: Function,
    F: Matrix | None,
    Q: ArrayLike,
    *,
    G: Matrix | None = None,
) -> Estimate:
    """Estimate one step later, through a function.

    Parameters
    ----------
    x : array_like, shape (n,)
        State.
    P : array_like, shape (n, n)
        Its covariance.
    f : callable
        State one step later, without noise, of a state of shape (n,). A known input goes into
        it, as ``lambda x: f(x, u)``.
    F : callable or array_like, shape (n, n), or None
        Its Jacobian, as a function of the state or as it is; None: by differences.
    Q : array_like, shape (n, n), or (r, r) with `G`
        Covariance of the process noise of the step.
    G : callable or array_like, shape (n, r), optional
        Derivative of the next state by the noise.

    Returns
    -------
    Estimate

    Examples
    --------
    >>> x, P = extended_predict([1.0], [[0.1]], lambda x: x**2, None, [[0.0]])
    >>> x, P.round(9)
    (array([1.]), array([[0.4]]))
    """
    _checks.call("f", f)
    state = _m.vector("x", x)
    n = state.size
    step = _at(F, f, state, "F", n)
    noise = _m.distributed("Q", Q, _value(G, state), n)
    cov = step @ _m.covariance("P", P, n) @ step.T + noise
    return Estimate(_m.vector("f(x)", f(state), n), 0.5 * (cov + cov.T))


def extended_update(
    x: ArrayLike,
    P: ArrayLike,
    z: ArrayLike,
    h: Function,
    H: Matrix | None,
    R: ArrayLike,
    *,
    J: Matrix | None = None,
) -> Correction:
    """Estimate after a measurement ``z = h(x)`` with noise.

    Parameters
    ----------
    x : array_like, shape (n,)
        State before it.
    P : array_like, shape (n, n)
        Its covariance.
    z : array_like, shape (m,)
        What was measured.
    h : callable
        What a state of shape (n,) lets expect.
    H : callable or array_like, shape (m, n), or None
        Its Jacobian, as a function of the state or as it is; None: by differences.
    R : array_like, shape (m, m), or (l, l) with `J`
        Covariance of the measurement noise.
    J : callable or array_like, shape (m, l), optional
        Derivative of the measurement by the noise.

    Returns
    -------
    Correction

    Examples
    --------
    A range of 5 m from the origin, seen from (3, 3) +- 1 m:

    >>> distance = lambda x: [np.hypot(*x)]
    >>> found = extended_update([3.0, 3.0], np.eye(2), [5.0], distance, None, [[0.01]])
    >>> found.x.round(2)
    array([3.53, 3.53])
    """
    _checks.call("h", h)
    state = _m.vector("x", x)
    measured = _m.vector("z", z)
    m = measured.size
    rows = _at(H, h, state, "H", m)
    return corrected(
        state,
        _m.covariance("P", P, state.size),
        measured - _m.vector("h(x)", h(state), m),
        rows,
        _m.distributed("R", R, _value(J, state), m),
    )


def run_extended(
    z: ArrayLike,
    f: Function,
    F: Matrix | None,
    h: Function,
    H: Matrix | None,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
) -> Track:
    """Filter a series of measurements, linearised at the estimate.

    Parameters
    ----------
    z : array_like, shape (k, m)
        Measurements; in a row with NaN nothing was measured.
    f, F : callable
        As in `extended_predict`, the same for all steps.
    h, H : callable
        As in `extended_update`.
    Q, R : array_like, shape (n, n), (m, m)
        Covariances of process and measurement noise.
    x0 : array_like, shape (n,)
        State at the first measurement, before it.
    P0 : array_like, shape (n, n)
        Its covariance.

    Returns
    -------
    Track

    Examples
    --------
    A pendulum of 1 s^-2, ten times a second, of which the sine is seen:

    >>> f = lambda x: [x[0] + 0.1 * x[1], x[1] - 0.1 * np.sin(x[0])]
    >>> x, z = np.array([1.0, 0.0]), []
    >>> for _ in range(60):
    ...     z.append([np.sin(x[0])])
    ...     x = np.array(f(x))
    >>> seen = lambda x: [np.sin(x[0])]
    >>> Q, R = 1e-6 * np.eye(2), [[1e-4]]
    >>> track = run_extended(z, f, None, seen, None, Q, R, [0.5, 0.5], np.eye(2))
    >>> float(abs(np.sin(track.x[-1, 0]) - z[-1][0])) < 0.01
    True
    """
    state = _m.vector("x0", x0)
    n = state.size
    cov = _m.covariance("P0", P0, n)
    looks = measurements(z)
    k, m = looks.shape
    noise, error = _m.covariance("Q", Q, n), _m.covariance("R", R, m)
    track = empty_track(k, n, m)
    for i in range(k):
        if i:
            step = _at(F, f, state, "F", n)
            state = _m.vector("f(x)", f(state), n)
            cov = step @ cov @ step.T + noise
        rows = _at(H, h, state, "H", m)
        innovation = looks[i] - _m.vector("h(x)", h(state), m)
        state, cov = put(track, i, state, cov, innovation, rows, error)
    return track


def run_linearised(
    z: ArrayLike,
    nominal: ArrayLike,
    F: Matrix,
    h: Function,
    H: Matrix | None,
    Q: ArrayLike,
    R: ArrayLike,
    dx0: ArrayLike,
    P0: ArrayLike,
) -> Track:
    """Filter a series of measurements, linearised on a nominal trajectory.

    The gains depend on the nominal trajectory only and could be computed beforehand. It holds as
    long as the truth stays near it.

    Parameters
    ----------
    z : array_like, shape (k, m)
        Measurements; in a row with NaN nothing was measured.
    nominal : array_like, shape (k, n)
        Nominal states at the measurements, which obey the model without noise.
    F : callable or array_like, shape (n, n)
        Jacobian of the step from a nominal state to the next.
    h, H : callable
        As in `extended_update`; evaluated at the nominal states.
    Q, R : array_like, shape (n, n), (m, m)
        Covariances of process and measurement noise.
    dx0 : array_like, shape (n,)
        Deviation from the nominal trajectory at the first measurement, before it.
    P0 : array_like, shape (n, n)
        Its covariance.

    Returns
    -------
    Track
        Its states are nominal plus deviation.

    Examples
    --------
    A straight path at unit speed, of which the square of the position is seen; truth is 0.01 off:

    >>> path = np.arange(1.0, 6.0)[:, None]
    >>> z = (path + 0.01) ** 2
    >>> h, H = lambda x: x**2, lambda x: [[2 * x[0]]]
    >>> track = run_linearised(z, path, [[1.0]], h, H, [[0.0]], [[1e-6]], [0.0], [[1.0]])
    >>> (track.x - path)[-1].round(3)
    array([0.01])
    """
    looks = measurements(z)
    k, m = looks.shape
    path = _m.matrix("nominal", nominal, k)
    n = path.shape[1]
    dx, cov = _m.vector("dx0", dx0, n), _m.covariance("P0", P0, n)
    noise, error = _m.covariance("Q", Q, n), _m.covariance("R", R, m)
    track = empty_track(k, n, m)
    for i in range(k):
        if i:
            step = _m.matrix("F", F(path[i - 1]) if callable(F) else F, n, n)
            dx = step @ dx
            cov = step @ cov @ step.T + noise
        rows = _at(H, h, path[i], "H", m)
        dz = looks[i] - _m.vector("h(x)", h(path[i]), m)
        dx, cov = put(track, i, dx, cov, dz - rows @ dx, rows, error)
    track.x[:] += path
    return track


def _value(matrix: Matrix | None, x: FloatArray) -> ArrayLike | None:
    """Return a matrix that may be a function of the state."""
    return matrix(x) if callable(matrix) else matrix


def _at(matrix: Matrix | None, f: Function, x: FloatArray, name: str, rows: int) -> FloatArray:
    """Return a Jacobian at x: a function's value, the matrix itself, or differences of f."""
    value = _value(matrix, x)
    if value is None:
        value = jacobian(f, x)
    return _m.matrix(name, value, rows, x.size)
