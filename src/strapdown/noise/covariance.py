"""Means and joint covariance of overlapping Allan variances of a noise model.

The rate is a sum of independent noises; the square of each coefficient scales one of them:

==============  ============  =========================  ==============================
term            coefficient   density of the rate, S(f)  Allan variance
==============  ============  =========================  ==============================
quantisation    Q             ``(2 pi f Q)**2 tau_0``    ``3 Q**2 / tau**2``
random walk     N             ``N**2``                   ``N**2 / tau``
instability     B             ``B**2 / (2 pi f)``        ``(2 ln 2 / pi) B**2``
rate walk       K             ``(K / (2 pi f))**2``      ``K**2 tau / 3``
==============  ============  =========================  ==============================

(S two-sided, as in IEEE Std 952.)  The integrated noise x has a generalised autocovariance G,
known up to a polynomial that second differences take away.  It gives the
covariance C of two such differences, and for Gaussian noise that of the mean squares::

    cov(mean z_i**2, mean z_j**2) = 2 / (M_i M_j) * sum over all pairs of C_ij**2

which is quadratic in the squared coefficients, so its parts are computed once.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray, IntArray

TERMS: Final = ("Q", "N", "B", "K")

_SECOND: Final = (1.0, -2.0, 1.0)
_FINE = 16  # quadrature points per shorter averaging time, near the steps of the longer one
_COARSE = 64  # quadrature points per longer averaging time
_REACH = 6  # how far flicker noise is followed, in longer averaging times


class Moments(NamedTuple):
    """What each term, at coefficient one, contributes for one set of averaging factors.

    Attributes
    ----------
    design : ndarray, shape (k, 4)
        Variance at each averaging time; columns in the order of `TERMS`. Times are in samples.
    parts : ndarray, shape (4, 4, k, k)
        ``parts[a, b]`` times both squared coefficients adds to the covariance.
    """

    design: FloatArray
    parts: FloatArray

    def covariance(self, squares: FloatArray) -> FloatArray:
        """Return the covariance of the variances at these squared coefficients, shape (k, k)."""
        return np.asarray(np.einsum("a,b,abij->ij", squares, squares, self.parts))

    def without_shortest(self, count: int) -> "Moments":
        """Return the moments without the first `count` averaging factors."""
        return Moments(self.design[count:], self.parts[:, :, count:, count:])


def phase_covariance(term: int, t: FloatArray) -> FloatArray:
    """Return G of term number `term` at coefficient one, lags in samples."""
    a = np.abs(t)
    if term == 0:
        return np.asarray(a == 0.0, dtype=np.float64)
    if term == 1:
        return np.asarray(-0.5 * a)
    if term == 2:
        return np.asarray(a**2 * np.log(np.where(a > 0.0, a, 1.0)) / (2.0 * np.pi))
    return np.asarray(a**3 / 12.0)


def difference_covariance(term: int, lag: FloatArray, mi: int, mj: int) -> FloatArray:
    """Return the covariance of a second difference of span `mi` and one of `mj` `lag` later."""
    total = np.zeros(lag.shape)
    for a, ca in enumerate(_SECOND):
        for b, cb in enumerate(_SECOND):
            total += ca * cb * phase_covariance(term, lag + (b * mj - a * mi))
    return total


@lru_cache(maxsize=16)
def moments(n: int, factors: tuple[int, ...]) -> Moments:
    """Return means and covariance parts of overlapping variances of n samples.

    Parameters
    ----------
    n : int
        Rate samples.
    factors : tuple of int
        Averaging factors, increasing.

    Returns
    -------
    Moments
    """
    k = len(factors)
    scale = 1.0 / (2.0 * np.array(factors, dtype=np.float64) ** 2)
    zero = np.zeros(1)
    design = np.empty((k, len(TERMS)))
    parts = np.empty((len(TERMS), len(TERMS), k, k))
    for i, mi in enumerate(factors):
        for a in range(len(TERMS)):
            design[i, a] = difference_covariance(a, zero, mi, mi)[0] * scale[i]
        for j in range(i, k):
            block = _pair_sums(n, mi, factors[j])
            parts[:, :, i, j] = parts[:, :, j, i] = block * scale[i] * scale[j]
    return Moments(design, parts)


def _pair_sums(n: int, mi: int, mj: int) -> FloatArray:
    """Return the sums over pairs of differences, ``mi <= mj``, of products of covariances."""
    count_i, count_j = n + 1 - 2 * mi, n + 1 - 2 * mj
    lags, weight = _lags(count_i, count_j, mi, mj)
    smooth = [difference_covariance(a, lags, mi, mj) for a in range(1, len(TERMS))]
    # White noise of x correlates at a few single lags only, which the quadrature must not see.
    steps = np.arange(3)
    single = np.unique(steps[:, np.newaxis] * mi - steps * mj).astype(np.float64)
    single = single[(single > -count_i) & (single < count_j)]
    pairs_single = _pairs(single, count_i, count_j)
    at_single = [difference_covariance(a, single, mi, mj) for a in range(len(TERMS))]
    weight = weight * _pairs(lags, count_i, count_j)
    sums = np.empty((len(TERMS), len(TERMS)))
    for a in range(len(TERMS)):
        for b in range(len(TERMS)):
            if a == 0 or b == 0:
                sums[a, b] = np.sum(pairs_single * at_single[a] * at_single[b])
            else:
                sums[a, b] = np.sum(weight * smooth[a - 1] * smooth[b - 1])
    return 2.0 / (float(count_i) * float(count_j)) * sums


def _pairs(lag: FloatArray, count_i: int, count_j: int) -> FloatArray:
    """Return how many pairs of starts lie `lag` apart."""
    pairs = np.minimum(count_i, count_j - lag) - np.maximum(0.0, -lag)
    return np.asarray(np.clip(pairs, 0.0, None))


def _lags(count_i: int, count_j: int, mi: int, mj: int) -> tuple[FloatArray, FloatArray]:
    """Return lags and their weights, so that weighted sums stand for sums over all lags.

    Lags are dense where the steps of the two differences meet and sparse between. Where all
    lags are present, all weights are one.
    """
    first = max(-(count_i - 1), -(2 + _REACH) * mj)
    last = min(count_j - 1, 2 * mi + _REACH * mj)
    near = np.arange(-4 * mi, 6 * mi + 1, max(1, mi // _FINE))
    grids = [near - b * mj for b in range(3)]
    grids.append(np.arange(first, last + 1, max(1, mj // _COARSE)))
    grids.append(np.array([first, last]))
    lags: IntArray = np.unique(np.concatenate(grids))
    lags = lags[(lags >= first) & (lags <= last)]
    weight = np.ones(lags.size)
    if lags.size > 1:
        # The sum over the integers of a function linear between the lags.
        gap = np.diff(lags).astype(np.float64)
        weight[:] = 0.0
        weight[:-1] += 0.5 * (gap - 1.0)
        weight[1:] += 0.5 * (gap - 1.0)
        weight += 1.0
    return lags.astype(np.float64), weight
