"""When a device rests: windowed noise of gyroscope and accelerometer against its floor.

At rest a sensor shows its own noise and nothing else. The test takes the standard deviation
in a short window, relative to the noise floor that the log itself shows, so that it needs
no knowledge of the sensor. Two forms are kept apart:

* `rest_mask` looks at a window centred on each sample and at the floor of the whole log.
  It is *offline*: for calibration and smoothing.
* `rest_mask_causal` looks at the window that ends at each sample and at the floor so far.
  It is *online*: the first part of a log gives the same answer as the whole of it.

Limits: a device that turns at a constant rate about the vertical has the same noise as one at
rest, and one that tilts by some degrees per second nearly so; `RestTest.max_rate` alone tells
them apart. With ``max_rate=math.inf`` the test finds steady
motion, such as the positions on a turntable.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import (
    as_floats,
    as_samples,
    as_times,
    instance,
    positive,
    same_length,
)
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.units import DPS

# No MEMS sensor is quieter in a window of half a second; keeps rounding in exact,
# noise-free logs from passing for noise.
_LEAST_GYR_NOISE = 1e-5  # [rad/s]
_LEAST_ACC_NOISE = 1e-4  # [m/s^2]
_FLOOR_QUANTILE = 0.01  # share of a log that must be at rest for its floor to be seen


@dataclass(frozen=True, slots=True, kw_only=True)
class RestTest:
    """What counts as rest.

    Parameters
    ----------
    window : float
        Length of the window [s]. Longer is surer and finds shorter rests worse.
    factor : float
        How many times the noise floor the windowed standard deviation may reach. Larger
        admits more tremor; a device held in the hand needs about 3.
    max_gyr_std, max_acc_std : float
        Standard deviations that are motion whatever the floor [rad/s], [m/s^2]. They speak
        where a log never rests.
    max_rate : float
        Mean rate that is motion whatever its noise [rad/s]; it has to exceed the bias of
        the gyroscope. ``math.inf`` admits steady rotation.
    min_duration : float
        Shortest segment of rest [s].
    """

    window: float = 0.5
    factor: float = 3.0
    max_gyr_std: float = 3.0 * DPS
    max_acc_std: float = 0.3
    max_rate: float = 20.0 * DPS
    min_duration: float = 1.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        positive("window", self.window)
        positive("factor", self.factor)
        positive("max_gyr_std", self.max_gyr_std)
        positive("max_acc_std", self.max_acc_std)
        positive("max_rate", self.max_rate, allow_inf=True)
        positive("min_duration", self.min_duration, allow_zero=True)


DEFAULT = RestTest()


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of samples: rows `start` up to but without `stop`.

    Attributes
    ----------
    start, stop : int
        Rows.
    t_start, t_stop : float
        Times of the first and the last sample [s].
    """

    start: int
    stop: int
    t_start: float
    t_stop: float

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return self.t_stop - self.t_start

    @property
    def rows(self) -> slice:
        """The rows as a slice."""
        return slice(self.start, self.stop)


def rest_mask(t: ArrayLike, gyr: ArrayLike, acc: ArrayLike, test: RestTest = DEFAULT) -> BoolArray:
    """Return where the device rests, each sample judged with what follows it.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s], strictly increasing.
    gyr : array_like, shape (n, 3)
        Angular rate [rad/s]; NaN rows count as not known.
    acc : array_like, shape (n, 3)
        Specific force [m/s^2]; NaN rows count as not known.
    test : RestTest
        What counts as rest.

    Returns
    -------
    ndarray of bool, shape (n,)
        True where the whole window around the sample is quiet. The edges of a rest are
        therefore half a window inside it.

    Notes
    -----
    Offline: the window is centred, and the noise floor is the first percentile over the log.
    """
    t, gyr, acc = _checked(t, gyr, acc, test)
    half = 0.5 * test.window
    low = np.searchsorted(t, t - half, side="left")
    high = np.searchsorted(t, t + half, side="right")
    gyr_mean, gyr_std = _windowed(gyr, low, high)
    acc_std = _windowed(acc, low, high)[1]
    gyr_floor = max(_quantile(gyr_std), _resolution(gyr), _LEAST_GYR_NOISE)
    acc_floor = max(_quantile(acc_std), _resolution(acc), _LEAST_ACC_NOISE)
    return _quiet(test, gyr_mean, gyr_std, gyr_floor, acc_std, acc_floor)


def rest_mask_causal(
    t: ArrayLike, gyr: ArrayLike, acc: ArrayLike, test: RestTest = DEFAULT
) -> BoolArray:
    """Return where the device rests, each sample judged with what came before it.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s], strictly increasing.
    gyr : array_like, shape (n, 3)
        Angular rate [rad/s]; NaN rows count as not known.
    acc : array_like, shape (n, 3)
        Specific force [m/s^2]; NaN rows count as not known.
    test : RestTest
        What counts as rest.

    Returns
    -------
    ndarray of bool, shape (n,)
        True where the window that ends at the sample is full and quiet. Rest is therefore
        seen one window after it began.

    Notes
    -----
    Online: the noise floor is the quietest full window so far. Until a log has rested once,
    its floor is too high and only `max_gyr_std`, `max_acc_std` and `max_rate` hold.
    """
    t, gyr, acc = _checked(t, gyr, acc, test)
    low = np.searchsorted(t, t - test.window, side="left")
    high = np.arange(1, len(t) + 1)
    gyr_mean, gyr_std = _windowed(gyr, low, high)
    acc_std = _windowed(acc, low, high)[1]
    full = t - _run_start(t, 0.5 * test.window) >= test.window
    gyr_floor = np.maximum(_least_so_far(gyr_std, full), _LEAST_GYR_NOISE)
    acc_floor = np.maximum(_least_so_far(acc_std, full), _LEAST_ACC_NOISE)
    return full & _quiet(test, gyr_mean, gyr_std, gyr_floor, acc_std, acc_floor)


def segments(
    t: ArrayLike, mask: ArrayLike, min_duration: float = 0.0, max_gap: float = math.inf
) -> tuple[Segment, ...]:
    """Return the stretches where `mask` is true, those shorter than `min_duration` left out.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    mask : array_like of bool, shape (n,)
        What belongs to a stretch.
    min_duration : float
        Shortest stretch [s].
    max_gap : float
        Longest interval between two samples of one stretch [s].

    Returns
    -------
    tuple of Segment
        In order of time.
    """
    t = as_times("t", t)
    positive("min_duration", min_duration, allow_zero=True)
    positive("max_gap", max_gap, allow_inf=True)
    inside = as_floats("mask", mask) != 0.0
    if inside.shape != t.shape:
        raise ValueError(f"`mask` must have shape {t.shape}, got {inside.shape}.")
    if not inside.any():
        return ()
    rows = np.flatnonzero(inside)
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(t[rows]) > max_gap))
    starts = rows[np.concatenate(([0], breaks + 1))]
    stops = rows[np.concatenate((breaks, [len(rows) - 1]))] + 1
    found = (
        Segment(int(start), int(stop), float(t[start]), float(t[stop - 1]))
        for start, stop in zip(starts, stops, strict=True)
    )
    return tuple(segment for segment in found if segment.duration >= min_duration)


def rest_segments(
    t: ArrayLike, gyr: ArrayLike, acc: ArrayLike, test: RestTest = DEFAULT
) -> tuple[Segment, ...]:
    """Return the stretches of rest of a log, offline.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    gyr : array_like, shape (n, 3)
        Angular rate [rad/s].
    acc : array_like, shape (n, 3)
        Specific force [m/s^2].
    test : RestTest
        What counts as rest.

    Returns
    -------
    tuple of Segment
        In order of time, none shorter than `test.min_duration`, none across a gap of more
        than half a window.
    """
    mask = rest_mask(t, gyr, acc, test)
    return segments(t, mask, test.min_duration, max_gap=0.5 * test.window)


def _checked(
    t: ArrayLike, gyr: ArrayLike, acc: ArrayLike, test: RestTest
) -> tuple[FloatArray, FloatArray, FloatArray]:
    instance("test", test, RestTest)
    gyr = as_samples("gyr", gyr, allow_nan=True)
    acc = as_samples("acc", acc, allow_nan=True)
    return as_times("t", t, same_length(gyr=gyr, acc=acc)), gyr, acc


def _windowed(samples: FloatArray, low: IntArray, high: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the norm of the mean and the RMS over axes of the deviation in each window.

    Both are infinite where a window has less than half of its samples, or less than three.
    """
    good: BoolArray = np.asarray(~np.isnan(samples).any(axis=1))
    if not good.any():
        never = np.full(len(samples), math.inf)
        return never, never
    centre = np.median(samples[good], axis=0)  # keeps the sums of squares small
    offsets = np.where(good[:, np.newaxis], samples - centre, 0.0)
    count = _window_sum(good.astype(np.float64), low, high)
    enough = (count >= 3) & (2.0 * count >= high - low)
    divisor = np.where(enough, count, 1.0)
    mean = _window_sum(offsets, low, high) / divisor[:, np.newaxis]
    square = _window_sum(np.einsum("ij,ij->i", offsets, offsets), low, high) / divisor
    variance = np.maximum(square - np.einsum("ij,ij->i", mean, mean), 0.0) / 3.0
    std = np.sqrt(variance * divisor / np.maximum(divisor - 1.0, 1.0))
    level = np.linalg.norm(mean + centre, axis=1)
    return np.where(enough, level, math.inf), np.where(enough, std, math.inf)


def _window_sum(values: FloatArray, low: IntArray, high: IntArray) -> FloatArray:
    sums = np.concatenate((np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)))
    return np.asarray(sums[high] - sums[low])


def _quiet(
    test: RestTest,
    gyr_mean: FloatArray,
    gyr_std: FloatArray,
    gyr_floor: float | FloatArray,
    acc_std: FloatArray,
    acc_floor: float | FloatArray,
) -> BoolArray:
    return np.asarray(
        (gyr_std <= np.minimum(test.factor * gyr_floor, test.max_gyr_std))
        & (acc_std <= np.minimum(test.factor * acc_floor, test.max_acc_std))
        & (gyr_mean < test.max_rate)
    )


def _quantile(std: FloatArray) -> float:
    known = std[np.isfinite(std)]
    return float(np.quantile(known, _FLOOR_QUANTILE)) if len(known) else 0.0


def _least_so_far(std: FloatArray, full: BoolArray) -> FloatArray:
    return np.asarray(np.minimum.accumulate(np.where(full, std, math.inf)))


def _resolution(samples: FloatArray) -> float:
    """Return the noise of rounding to the smallest step between samples, RMS of the axes.

    A sensor of coarse resolution may repeat one value for seconds and then show the next.
    """
    steps = np.abs(np.diff(samples, axis=0))
    steps = np.where(steps > 0.0, steps, np.inf)  # NaN too becomes inf
    least = np.min(steps, axis=0, initial=np.inf)
    least = least[np.isfinite(least)]
    return float(np.sqrt(np.mean(least**2) / 12.0)) if len(least) else 0.0


def _run_start(t: FloatArray, max_gap: float) -> FloatArray:
    """Return for each sample the time at which its run without a longer gap began."""
    first = np.ones(len(t), dtype=np.bool_)
    first[1:] = np.diff(t) > max_gap
    return np.asarray(t[np.maximum.accumulate(np.where(first, np.arange(len(t)), 0))])
