"""The numbers that sum up an error over time."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.rotation import wrap_pi


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """Summary of an error, in the unit of the error.

    Attributes
    ----------
    samples : int
        Number of samples.
    rmse : float
        Root of the mean square.
    median, p95, maximum : float
        Of the magnitude.
    """

    samples: int
    rmse: float
    median: float
    p95: float
    maximum: float

    @classmethod
    def of(cls, errors: ArrayLike) -> Self:
        """Return the summary of `errors`, shape (n,), signed or not."""
        size = np.abs(_checks.as_series("errors", errors))
        if not size.size:
            raise ValueError("`errors` must hold at least one sample, got none.")
        median, p95 = np.quantile(size, (0.5, 0.95))
        return cls(
            samples=size.size,
            rmse=float(np.sqrt(np.mean(size * size))),
            median=float(median),
            p95=float(p95),
            maximum=float(size.max()),
        )


def robust_circular_mean(angle: FloatArray) -> float:
    """Return the mean direction of angles [rad], without the outliers.

    The circular median gives a first value; the mean is then taken of what lies within 3
    scaled median absolute deviations of it. It equals the mean for noise and for a steady
    drift, and leaves aside a short time in which an estimator was lost.

    Parameters
    ----------
    angle : ndarray, shape (n,)
        Angles [rad], at least one.

    Returns
    -------
    float
        In (-pi, pi].
    """
    angle = _checks.as_series("angle", angle)
    if not angle.size:
        raise ValueError("`angle` must hold at least one angle, got none.")
    start = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean())
    start += np.median(wrap_pi(angle - start))
    rest = wrap_pi(angle - start)
    spread = 1.4826 * np.median(np.abs(rest))  # the standard deviation, if it is normal
    near = np.abs(rest) <= max(3.0 * spread, 1e-12)
    return float(wrap_pi(start + rest[near].mean()))
