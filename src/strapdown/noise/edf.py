"""Equivalent degrees of freedom of Allan-type variances, and the intervals that follow.

An estimate of a variance from correlated Gaussian differences is distributed nearly like
``variance * chi2(edf) / edf``, with ``edf = 2 * mean**2 / variance_of_the_estimate``.  That
variance is a sum of squared autocovariances of the differences, known in closed form for noise
whose power follows a power of frequency [1]_.

References
----------
.. [1] C. A. Greenhall, W. J. Riley, "Uncertainty of stability variances based on finite
       differences", 35th PTTI meeting, 2003.
.. [2] W. J. Riley, "Handbook of frequency stability analysis", NIST SP 1065, 2008, section on
       confidence intervals.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.stats import chi2

from strapdown._types import FloatArray, IntArray

# Exponents alpha of S(f) ~ f**alpha of the *rate*.
QUANTISATION: Final = 2
WHITE: Final = 0
FLICKER: Final = -1
RANDOM_WALK: Final = -2

_STEPS = 64  # steps per averaging time that stand for a continuum
_REACH = 8  # lags kept, in spans of a difference; flicker noise forgets like 1/lag**2

# Total deviation: edf = b * T / tau - c  [2]_. At few samples it is the Allan deviation.
_TOTAL: Final = {WHITE: (1.5, 0.0), FLICKER: (1.17, 0.22), RANDOM_WALK: (0.93, 0.36)}
_TOTAL_FROM: Final = 8


def difference_order(kind: str) -> int:
    """Return the order of the differences of the integrated signal: Hadamard 3, others 2."""
    return 3 if kind in ("hdev", "ohdev") else 2


def difference_coefficients(order: int) -> FloatArray:
    """Return the coefficients of a difference of order 2 or 3, earliest sample first."""
    return np.array([1.0, -2.0, 1.0] if order == 2 else [-1.0, 3.0, -3.0, 1.0])


def alpha_of_slope(slope: FloatArray) -> IntArray:
    """Return the exponent whose slope in a log-log plot of the deviation is nearest.

    Parameters
    ----------
    slope : ndarray, shape (k,)
        Local slopes, averaging time increasing: -1 quantisation, -1/2 white, 0 flicker, +1/2
        random walk. A ramp, slope +1, counts as a random walk.

    Returns
    -------
    ndarray of int, shape (k,)
        Never increasing: of a sum of noises the one of smaller exponent rules later, and a
        steeper slope at the longest times is chance.
    """
    limits = np.array([-0.75, -0.25, 0.25])
    alphas = np.array([QUANTISATION, WHITE, FLICKER, RANDOM_WALK])
    return np.asarray(np.minimum.accumulate(alphas[np.searchsorted(limits, slope)]))


@lru_cache(maxsize=4096)
def edf(kind: str, n: int, m: int, alpha: int) -> float:
    """Return the equivalent degrees of freedom of one point of a deviation curve.

    Parameters
    ----------
    kind : {'adev', 'oadev', 'mdev', 'totdev', 'hdev', 'ohdev'}
        Estimator.
    n : int
        Number of rate samples.
    m : int
        Averaging factor.
    alpha : int
        Exponent of the noise that dominates at this averaging time.

    Returns
    -------
    float
        At least 1.
    """
    if kind == "totdev" and alpha in _TOTAL and m >= _TOTAL_FROM:
        b, c = _TOTAL[alpha]
        return max(b * n / m - c, 1.0)
    order = difference_order(kind)
    averaged = kind == "mdev"
    steps = 1 if kind in ("adev", "hdev") else m
    free = n - order * m - (m - 1 if averaged else 0)  # shifts that the record leaves
    if alpha == QUANTISATION and not averaged:
        # White noise of the integrated signal: only lags of whole averaging times count.
        count = max(1 + steps * free // m, 1)
        lags = np.arange(order + 1) * steps
    else:
        steps = min(steps, _STEPS)
        count = max(1 + steps * free // m, 1)
        lags = np.arange(min(count, _REACH * (order + 1) * steps))
    cov = _autocovariance(lags / steps, alpha, order, averaged)
    square = np.clip(1.0 - lags / count, 0.0, None) * (cov / cov[0]) ** 2
    return float(max(count / (2.0 * square.sum() - square[0]), 1.0))


def confidence_interval(
    dev: FloatArray, dof: FloatArray, confidence: float
) -> tuple[FloatArray, FloatArray]:
    """Return the limits of a deviation whose square is distributed like chi2 with `dof`.

    Parameters
    ----------
    dev, dof : ndarray, shape (k,)
        Deviations and their degrees of freedom.
    confidence : float
        Probability that the interval holds the true value.

    Returns
    -------
    low, high : ndarray, shape (k,)
    """
    tail = 0.5 * (1.0 - confidence)
    low = dev * np.sqrt(dof / chi2.ppf(1.0 - tail, dof))
    high = dev * np.sqrt(dof / chi2.ppf(tail, dof))
    return np.asarray(low), np.asarray(high)


def _autocovariance(t: FloatArray, alpha: int, order: int, averaged: bool) -> FloatArray:
    """Return the autocovariance of differences at lags `t` in averaging times, up to a factor."""
    if averaged:  # the mean over an averaging time is a difference of the next integral
        c = np.convolve(difference_coefficients(order), [1.0, -1.0])
        law = alpha
    else:
        c = difference_coefficients(order)
        law = alpha + 2
    weights = np.correlate(c, c, mode="full")
    half = len(c) - 1
    return np.asarray(
        sum(w * _power_law(t + k - half, law) for k, w in enumerate(weights)), dtype=np.float64
    )


def _power_law(t: FloatArray, law: int) -> FloatArray:
    """Return the generalised autocovariance of noise of density f**(law - 4), [1]_.

    It is known up to a polynomial, which the differences take away.
    """
    a = np.abs(t)
    if law % 2 == 0:
        odd = {4: 0, 2: 1, 0: 3, -2: 5}[law]
        if odd == 0:
            return np.asarray(a == 0.0, dtype=np.float64)
        return np.asarray((1.0 if odd == 3 else -1.0) * a**odd)
    even = {1: 2, -1: 4}[law]
    log = np.log(np.where(a > 0.0, a, 1.0))
    return np.asarray((1.0 if even == 2 else -1.0) * a**even * log)
