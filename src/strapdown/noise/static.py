"""Statistics of sensors at rest: means, variances, covariance, offsets at no input.

References
----------
.. [1] Thesis B (kinematic device), chapter 5, tables 3-5: mean and variance of each axis of
       gyroscope, accelerometer and magnetometer over 150 s at rest.
.. [2] Thesis C (indoor attitude), section 6.2, tables 6.1 and 6.2: zero-g and zero-rate offsets.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import LARGEST, as_floats, as_samples, positive, recording
from strapdown._types import FloatArray, IntArray
from strapdown.constants import G0
from strapdown.errors import InputError, MissingStream
from strapdown.recording import Recording

_BLOCKS: Final = 16  # block means that show how sure a mean is


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticStatistics:
    """Statistics of the channels of one sensor.

    Attributes
    ----------
    n : int
        Samples.
    mean, variance, std, minimum, maximum : ndarray, shape (k,)
        Of each channel; the variance is the unbiased one.
    mean_std : ndarray, shape (k,)
        Standard deviation of the mean, from block means: it holds slow noise too, which
        ``std / sqrt(n)`` does not.
    covariance : ndarray, shape (k, k)
        Of all channels.
    """

    n: int
    mean: FloatArray
    variance: FloatArray
    std: FloatArray
    minimum: FloatArray
    maximum: FloatArray
    mean_std: FloatArray
    covariance: FloatArray


def static_statistics(samples: ArrayLike) -> StaticStatistics:
    """Return mean, variance and covariance of a sensor at rest [1]_.

    Parameters
    ----------
    samples : array_like, shape (n, k)
        Samples; rows with NaN are left out.

    Returns
    -------
    StaticStatistics

    Raises
    ------
    InputError
        If fewer than 32 rows are complete.
    """
    values = as_floats("samples", samples)
    if values.ndim != 2:
        raise ValueError(f"`samples` must have shape (n, k), got {values.shape}.")
    y = values[(np.abs(values) <= LARGEST).all(axis=1)]  # False for NaN
    n = len(y)
    if n < 2 * _BLOCKS:
        raise InputError(
            f"`samples` must have at least {2 * _BLOCKS} complete rows, got {n}; record longer."
        )
    length = n // _BLOCKS
    blocks = y[: length * _BLOCKS].reshape(_BLOCKS, length, -1).mean(axis=1)
    covariance = np.atleast_2d(np.cov(y, rowvar=False))
    variance = np.diag(covariance).copy()
    return StaticStatistics(
        n=n,
        mean=y.mean(axis=0),
        variance=variance,
        std=np.sqrt(variance),
        minimum=y.min(axis=0),
        maximum=y.max(axis=0),
        mean_std=blocks.std(axis=0, ddof=1) / np.sqrt(_BLOCKS),
        covariance=covariance,
    )


def full_statistics(rec: Recording) -> StaticStatistics:
    """Return the statistics of gyroscope, accelerometer and magnetometer together.

    Parameters
    ----------
    rec : Recording
        A device at rest.

    Returns
    -------
    StaticStatistics
        Of nine channels gyr, acc, mag, or six without a magnetometer, at the times of the
        slower sensor; each takes the nearest sample of the other, so that no variance is
        smoothed away.

    Raises
    ------
    MissingStream
        If there is no inertial sensor.
    """
    recording("rec", rec)
    if rec.imu is None:
        raise MissingStream("the recording must have the stream 'imu' for a full covariance.")
    parts = np.column_stack((rec.imu.gyr, rec.imu.acc))
    if rec.mag is None:
        return static_statistics(parts)
    t_imu, t_mag = rec.imu.t, rec.mag.t
    if len(t_mag) <= len(t_imu):
        return static_statistics(np.column_stack((parts[_nearest(t_imu, t_mag)], rec.mag.mag)))
    return static_statistics(np.column_stack((parts, rec.mag.mag[_nearest(t_mag, t_imu)])))


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroG:
    """Norm of the specific force at rest, one pose [2]_.

    Attributes
    ----------
    mean, maximum : float
        Norm in units of gravity.
    offset : float
        Mean norm less one: the modulus of the zero-g offset, which needs no level pose.
    offset_std : float
        Its standard deviation, from block means.
    above, below : float
        Share of the samples with a norm above and below one.
    noise_excess : float
        What noise across gravity alone adds to the mean norm.
    """

    mean: float
    maximum: float
    offset: float
    offset_std: float
    above: float
    below: float
    noise_excess: float


def zero_g(poses: Sequence[ArrayLike], gravity: float = G0) -> tuple[ZeroG, ...]:
    """Return the zero-g offset in each pose [2]_.

    Parameters
    ----------
    poses : sequence of array_like, shape (n, 3)
        Specific force at rest, one array for each pose [m/s^2].
    gravity : float
        Local gravity [m/s^2].

    Returns
    -------
    tuple of ZeroG
    """
    gravity = positive("gravity", gravity)
    found = []
    if not isinstance(poses, Sequence | np.ndarray):
        raise TypeError(f"`poses` must be a sequence of arrays, got {type(poses).__name__}.")
    for k, pose in enumerate(poses):
        acc = as_samples(f"poses[{k}]", pose) / gravity
        norm = np.linalg.norm(acc, axis=1)
        statistics = static_statistics(norm[:, np.newaxis])
        mean_acc = acc.mean(axis=0)
        level = float(np.linalg.norm(mean_acc))
        if level == 0.0:
            raise InputError(f"`poses[{k}]` must show gravity, got a mean of zero.")
        along = mean_acc / level
        covariance = np.cov(acc, rowvar=False)
        across = float(np.trace(covariance) - along @ covariance @ along)
        found.append(
            ZeroG(
                mean=float(statistics.mean[0]),
                maximum=float(statistics.maximum[0]),
                offset=float(statistics.mean[0]) - 1.0,
                offset_std=float(statistics.mean_std[0]),
                above=float(np.mean(norm > 1.0)),
                below=float(np.mean(norm < 1.0)),
                noise_excess=0.5 * across / level,
            )
        )
    return tuple(found)


def zero_rate(gyr: ArrayLike) -> StaticStatistics:
    """Return the zero-rate offset: mean and variance of a gyroscope at rest [2]_.

    Parameters
    ----------
    gyr : array_like, shape (n, 3)
        Angular rate at rest [rad/s]. The Earth's rate, 7.3e-5 rad/s, is part of it.

    Returns
    -------
    StaticStatistics
        `mean` is the offset.
    """
    return static_statistics(as_samples("gyr", gyr, allow_nan=True))


def _nearest(t: FloatArray, wanted: FloatArray) -> IntArray:
    """Return the rows of `t` nearest to the wanted times."""
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    before = after - 1
    return np.where(wanted - t[before] <= t[after] - wanted, before, after)
