"""Whether a filter is as sure as it should be: normalised squares of errors and innovations."""

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray

_MOST = 10**9  # errors that anyone averages


def nees(errors: ArrayLike, P: ArrayLike) -> FloatArray:
    """Normalised estimation error squared, ``e^T P^-1 e``.

    Parameters
    ----------
    errors : array_like, shape (..., n)
        True less estimated.
    P : array_like, shape (..., n, n)
        Stated covariances.

    Returns
    -------
    ndarray, shape (...)
        Of a consistent filter chi-square with n degrees of freedom: n in the mean. Larger: too
        sure; smaller: too modest.

    Raises
    ------
    ValueError
        If shapes do not fit, or a covariance is singular.

    Examples
    --------
    >>> nees([[1.0, 2.0], [0.0, 0.5]], np.diag([1.0, 4.0]))
    array([2.    , 0.0625])
    """
    e = _checks.as_floats("errors", errors)
    cov = _checks.as_floats("P", P)
    if e.ndim < 1 or cov.ndim < 2 or cov.shape[-2:] != (e.shape[-1], e.shape[-1]):
        raise ValueError(
            f"`P` must have shape (..., n, n) for errors of shape (..., n), got {cov.shape} and "
            f"{e.shape}."
        )
    _checks.same_shape(errors=e[..., 0], P=cov[..., 0, 0])
    try:
        solved = np.linalg.solve(cov, e[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise ValueError(
            "`P` must be invertible, got a singular covariance; leave out what is known exactly."
        ) from None
    return np.asarray(np.einsum("...i,...i->...", e, solved))


def nis(innovations: ArrayLike, S: ArrayLike) -> FloatArray:
    """Normalised innovation squared, ``nu^T S^-1 nu``; NaN where nothing was measured.

    Parameters
    ----------
    innovations : array_like, shape (k, m)
        Measured less predicted.
    S : array_like, shape (k, m, m)
        Their stated covariances.

    Returns
    -------
    ndarray, shape (k,)
        Of a consistent filter chi-square with m degrees of freedom, and white.

    Examples
    --------
    >>> nis([[2.0], [np.nan]], [[[4.0]], [[np.nan]]])
    array([ 1., nan])
    """
    nu, cov = _checks.as_floats("innovations", innovations), _checks.as_floats("S", S)
    if nu.ndim < 1 or cov.shape != (*nu.shape, nu.shape[-1]):
        raise ValueError(
            f"`S` must have shape (k, m, m) for innovations of shape (k, m), got {cov.shape} and "
            f"{nu.shape}."
        )
    seen = np.asarray(np.isfinite(nu).all(axis=-1))
    filled = np.where(seen[..., None, None], cov, np.eye(nu.shape[-1]))
    return np.where(seen, nees(np.where(seen[..., None], nu, 0.0), filled), np.nan)


def mean_bounds(dof: int, count: int, probability: float = 0.99) -> tuple[float, float]:
    """Bounds that the mean of independent chi-square values keeps.

    Parameters
    ----------
    dof : int
        Degrees of freedom of each: the size of the error or the innovation.
    count : int
        How many independent ones are averaged: runs, rather than samples of one run.
    probability : float
        With which a consistent filter keeps them.

    Returns
    -------
    low, high : float

    Examples
    --------
    >>> low, high = mean_bounds(6, 100)
    >>> round(low, 2), round(high, 2)
    (5.15, 6.93)
    """
    from scipy.stats import chi2

    _checks.whole("dof", dof, 1, _MOST)
    _checks.whole("count", count, 1, _MOST)
    _checks.in_range("probability", probability, 0.0, 1.0)
    tail = 0.5 * (1.0 - probability)
    low, high = chi2.ppf([tail, 1.0 - tail], dof * count) / count
    return float(low), float(high)
