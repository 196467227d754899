"""From samples to the rotation and the velocity of a step: the weights, and their use by hand.

References
----------
.. [1] R. B. Miller, "A new strapdown attitude algorithm", J. Guidance 6(4), 1983.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_floats, as_samples, as_times, same_length
from strapdown._types import FloatArray
from strapdown.kernels.mechanisation import layout as k

MOST_SAMPLES: Final = 4

# Weights of the products of samples i < j in a step of m equal samples. Their sums over pairs of
# the same distance are those that null most terms of the coning error [1]_; they are exact for
# rates that are linear in time, which settles two and three samples, and those of four are exact
# for quadratic ones as well.
_PRODUCTS: Final[Mapping[int, Mapping[tuple[int, int], float]]] = {
    1: {},
    2: {(0, 1): 2 / 3},
    3: {(0, 1): 27 / 40, (1, 2): 27 / 40, (0, 2): 9 / 20},
    4: {
        (0, 1): 232 / 315, (1, 2): 178 / 315, (2, 3): 232 / 315,
        (0, 2): 46 / 105, (1, 3): 46 / 105, (0, 3): 18 / 35,
    },
}  # fmt: skip
# Weights of the samples in the rate at start and middle of the step, times its length, for rates
# that are polynomials of degree m - 1. The end mirrors the start.
_START: Final[Mapping[int, Sequence[float]]] = {
    1: (1.0,),
    2: (3.0, -1.0),
    3: (11 / 2, -7 / 2, 1.0),
    4: (25 / 3, -23 / 3, 13 / 3, -1.0),
}
_MIDDLE: Final[Mapping[int, Sequence[float]]] = {
    1: (1.0,),
    2: (1.0, 1.0),
    3: (-1 / 8, 13 / 4, -1 / 8),
    4: (-1 / 3, 7 / 3, 7 / 3, -1 / 3),
}


def fill(p: FloatArray, samples: int, *, compensate: bool) -> None:
    """Write the weights of a step of so many samples into a kernel's parameters.

    A single sample is compensated with the one before it: the rate is the straight line through
    the means of the two.
    """
    if compensate and samples == 1:
        p[k.SLOTS], p[k.FIRST] = 2, 1
        p[k.SUM : k.SUM + 2] = 0.0, 1.0
        p[k.CONING + 1] = 1 / 12
        p[k.AT_START : k.AT_START + 2] = 0.5, 0.5
        p[k.AT_MIDDLE : k.AT_MIDDLE + 2] = 0.0, 1.0
        p[k.AT_END : k.AT_END + 2] = -0.5, 1.5
        return
    p[k.SLOTS], p[k.FIRST] = samples, 0
    p[k.SUM : k.SUM + samples] = 1.0
    for at in (k.AT_START, k.AT_MIDDLE, k.AT_END):
        p[at : at + samples] = 1.0
    if compensate:
        for (i, j), weight in _PRODUCTS[samples].items():
            p[k.CONING + 4 * i + j] = weight
        p[k.AT_START : k.AT_START + samples] = _START[samples]
        p[k.AT_MIDDLE : k.AT_MIDDLE + samples] = _MIDDLE[samples]
        p[k.AT_END : k.AT_END + samples] = _START[samples][::-1]


def coning_sculling(dtheta_b: ArrayLike, dvel_b: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Rotation vector and velocity gained over one interval, from its sub-samples.

    The sub-samples are of equal length. The error of one interval is of its fifth order for two
    and more of them; that of pure coning of small angles of order ``2 m + 1``. Gravity is not
    included.

    Parameters
    ----------
    dtheta_b : array_like, shape (m, 3)
        Gyro increments of the m sub-samples, 1 to 4, body frame [rad].
    dvel_b : array_like, shape (m, 3)
        Accelerometer increments, body frame [m/s].

    Returns
    -------
    phi_b : ndarray, shape (3,)
        Rotation vector of the interval [rad].
    dvel_b0 : ndarray, shape (3,)
        Velocity gained, resolved in the body frame at the start [m/s].

    Raises
    ------
    ValueError
        If shapes differ, there are more than four samples, or a value is not finite.

    Notes
    -----
    Online.

    References
    ----------
    .. [1] R. B. Miller, "A new strapdown attitude algorithm", J. Guidance 6(4), 1983.
    .. [2] P. G. Savage, "Strapdown inertial navigation integration algorithm design", J. Guidance
           21(1) and 21(2), 1998.

    Examples
    --------
    >>> phi_b, dvel_b0 = coning_sculling([[0.01, 0, 0], [0, 0.01, 0]], [[0, 0, -0.1]] * 2)
    >>> phi_b * 1e3
    array([10.        , 10.        ,  0.06666667])
    """
    from strapdown.kernels.mechanisation.increments import (
        left_jacobian,
        rotation_vector,
        translation_vector,
    )

    dtheta, dvel = as_samples("dtheta_b", dtheta_b), as_samples("dvel_b", dvel_b)
    m = same_length(dtheta_b=dtheta, dvel_b=dvel)
    if not 1 <= m <= MOST_SAMPLES:
        raise ValueError(f"`dtheta_b` must hold 1 to {MOST_SAMPLES} sub-samples, got {m}.")
    x, p = np.zeros(k.X_SIZE), np.zeros(k.P_SIZE)
    p[k.SUM : k.SUM + m] = 1.0
    for (i, j), weight in _PRODUCTS[m].items():
        p[k.CONING + 4 * i + j] = weight
    x[k.TH : k.TH + 3 * m] = dtheta.ravel()
    x[k.DV : k.DV + 3 * m] = dvel.ravel()
    phi = rotation_vector(x, p, m)
    return np.array(phi), np.array(left_jacobian(*phi, *translation_vector(x, p, m)))


def means_from_points(t: ArrayLike, values: ArrayLike) -> FloatArray:
    """Return the means over the sampling intervals of something that was sampled at points.

    A mechanisation wants what an integrating sensor gives: row k is the mean over
    ``(t[k-1], t[k]]``. Here it is the integral of the cubic spline through the points.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times [s], at least two.
    values : array_like, shape (n, d)
        Values at these times.

    Returns
    -------
    ndarray, shape (n, d)
        Row 0, whose interval is not known, is the value at ``t[0]``.

    Notes
    -----
    Offline: a spline looks ahead. Error of fourth order of the sampling interval.

    Examples
    --------
    >>> means_from_points([0.0, 1.0, 2.0], [[0.0], [1.0], [4.0]])[1:, 0].round(6)
    array([0.333333, 2.333333])
    """
    from scipy.interpolate import CubicSpline

    times, points = as_times("t", t), as_floats("values", values)
    if len(times) < 2 or points.ndim != 2 or points.shape[:1] != times.shape:
        raise ValueError(
            f"`values` must have as many rows as `t`, and at least two, got {points.shape} and "
            f"{times.shape}."
        )
    if not np.isfinite(points).all():
        raise ValueError("`values` must be finite: a spline goes through all of them.")
    pieces = CubicSpline(times, points).c  # of each interval, highest power first
    h = np.diff(times)[:, np.newaxis]
    mean = pieces[0]
    for power, part in zip((4, 3, 2, 1), pieces, strict=True):
        mean = part / power if power == 4 else mean * h + part / power
    return np.concatenate((points[:1], mean))
