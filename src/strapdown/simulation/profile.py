"""Time laws: steps with smooth ramps, sums of sines, splines."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from strapdown._types import FloatArray
from strapdown.simulation.jet import Jet, Smooth, constant, jet_of, sin_cos, time


def ramps(
    start: float, changes: Sequence[tuple[float, float, float]]
) -> Any:  # SciPy's PPoly, which has no types
    """Return a function that goes from value to value by smooth ramps and holds between.

    A ramp is ``10 s^3 - 15 s^4 + 6 s^5``: rate and acceleration vanish at both of its ends.

    Parameters
    ----------
    start : float
        Value before the first ramp.
    changes : sequence of (float, float, float)
        Time at which a ramp starts, how long it takes [s], and the value it goes to. Each
        starts where the one before has ended, or later.

    Returns
    -------
    scipy.interpolate.PPoly
        With ``derivative`` and ``antiderivative``; constant before and after.

    Raises
    ------
    ValueError
        If a ramp starts before the one before has ended, or takes no time.
    """
    from scipy.interpolate import PPoly

    first = changes[0][0] if changes else 0.0
    edges, pieces = [first - 1.0], [[0.0, 0.0, 0.0, 0.0, 0.0, start]]
    value = start
    edges.append(first)
    for number, (begin, length, target) in enumerate(changes):
        if not length > 0.0 or begin < edges[-1] - 1e-9:
            raise ValueError(
                "ramps must take time and follow each other, got one of "
                f"{length:g} s at {begin:g} s after {edges[-1]:g} s (ramp {number})."
            )
        if begin > edges[-1] + 1e-9:
            pieces.append([0.0, 0.0, 0.0, 0.0, 0.0, value])
            edges.append(begin)
        step = target - value
        pieces.append(
            [6.0 * step / length**5, -15.0 * step / length**4, 10.0 * step / length**3]
            + [0.0, 0.0, value]
        )
        edges.append(edges[-1] + length)
        value = target
    pieces.append([0.0, 0.0, 0.0, 0.0, 0.0, value])
    edges.append(edges[-1] + 1.0)
    return PPoly(np.array(pieces).T, np.array(edges))


def steps(start: float, changes: Sequence[tuple[float, float]]) -> Any:
    """Return a piecewise constant function, for integrating it.

    Parameters
    ----------
    start : float
        Value before the first change.
    changes : sequence of (float, float)
        Times, increasing [s], and the values from then on.

    Returns
    -------
    scipy.interpolate.PPoly
    """
    from scipy.interpolate import PPoly

    times = [t for t, _ in changes]
    values = [start, *(value for _, value in changes)]
    return PPoly(np.array([values]), np.array([times[0] - 1.0, *times, times[-1] + 1.0]))


def integral(function: Any, origin: float = 0.0) -> Any:
    """Return the antiderivative that is zero at `origin`."""
    total = function.antiderivative()
    total.c[-1] -= total(origin)
    return total


def spline(t: FloatArray, x: FloatArray) -> Any:
    """Return the quintic spline through points, its ends at rest.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Increasing abscissae.
    x : ndarray, shape (n,)
        Ordinates.

    Returns
    -------
    scipy.interpolate.PPoly
        Four times continuously differentiable; first and second derivative zero at the ends
        and beyond them.
    """
    from scipy.interpolate import PPoly, make_interp_spline

    ends = [(1, 0.0), (2, 0.0)]
    inner = PPoly.from_spline(make_interp_spline(t, x, k=5, bc_type=(ends, ends)))
    # repeated knots make empty pieces; constant ones are put before and after
    keep = np.diff(inner.x) > 0.0
    c, edges = inner.c[:, keep], np.unique(inner.x)
    hold = np.zeros((len(c), 2))
    hold[-1] = x[0], x[-1]
    return PPoly(
        np.concatenate((hold[:, :1], c, hold[:, 1:]), axis=1),
        np.concatenate(([edges[0] - 1.0], edges, [edges[-1] + 1.0])),
    )


def free_spline(u: FloatArray, x: FloatArray) -> Smooth:
    """Return the spline of degree 7 through points, at least eight, whose ends are free."""
    from scipy.interpolate import make_interp_spline

    function: Smooth = make_interp_spline(u, x, k=7)
    return function


def sines(t: FloatArray, order: int, terms: Sequence[Sequence[float]]) -> Jet:
    """Return a sum of sines.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s].
    order : int
        Derivatives wanted.
    terms : sequence of (float, float, float)
        Amplitude, period [s] and phase [rad] of each.

    Returns
    -------
    Jet
    """
    clock = time(t, order)
    total = constant(0.0, clock)
    for amplitude, period, phase in terms:
        sine, _ = sin_cos(clock * (2.0 * np.pi / period) + phase)
        total = total + sine * amplitude
    return total


def gate(t: FloatArray, order: int, opens: float, closes: float, ramp: float) -> Jet:
    """Return a factor that is one between two times and zero outside, with smooth ramps."""
    law = ramps(0.0, [(opens, ramp, 1.0), (closes - ramp, ramp, 0.0)])
    return jet_of(law, t, order)
