"""When a sensor looks, and through what: rate, low-pass, delay, jitter, dropouts."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray
from strapdown.sensors.settings import Quantity

SAME_TIME = 4e-15  # of the length of a recording


class Ticks(NamedTuple):
    """Sampling times of one sensor.

    Attributes
    ----------
    t : ndarray, shape (n,)
        When it looks [s].
    stamp : ndarray, shape (n,)
        What the log says [s].
    kept : ndarray of bool, shape (n,)
        False where the sample is lost.
    """

    t: FloatArray
    stamp: FloatArray
    kept: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Rate, bandwidth and timing of a sensor.

    Parameters
    ----------
    rate : float
        Samples per second [Hz]. Zero takes every sample of the truth.
    average : bool
        True gives the mean over ``(t[k-1], t[k]]``, as a rate-integrating gyro does; false what
        is there at ``t[k]``.
    bandwidth : float
        -3 dB frequency of the low-pass [Hz]. Zero leaves it out.
    order : int
        Order of the low-pass, a Butterworth filter.
    delay : float
        Total delay at low frequency [s], that of the low-pass included. Zero stands for the
        low-pass alone. Some datasheets state less than a filter of that bandwidth has; the
        difference is then made up by a shift ahead.
    filters_noise : bool
        Whether the white noise passes the low-pass too, as in a sensor that filters
        digitally. If not, it is white at the output.
    jitter : float
        Standard deviation of the stamps [s]; limited to 0.45 of the interval, so that the
        stamps increase.
    dropout : float
        Share of the samples that is lost, below 1.
    dropout_length : float
        Mean length of a loss, at least 1 [samples].
    """

    rate: Annotated[float, Quantity("frequency")] = 0.0
    average: bool = False
    bandwidth: Annotated[float, Quantity("frequency")] = 0.0
    order: int = 2
    delay: Annotated[float, Quantity("time")] = 0.0
    filters_noise: bool = False
    jitter: Annotated[float, Quantity("time")] = 0.0
    dropout: float = 0.0
    dropout_length: float = 1.0

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("rate", "bandwidth", "delay", "jitter"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        _checks.whole("order", self.order, 1, 8)
        _checks.in_range("dropout", self.dropout, 0.0, 0.99)
        _checks.in_range("dropout_length", self.dropout_length, 1.0, 1e9)

    def ticks(self, t: FloatArray, rng: np.random.Generator) -> Ticks:
        """Return when the sensor looks within the span of the truth.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the truth [s].
        rng : numpy.random.Generator
            For jitter and dropouts.

        Returns
        -------
        Ticks
        """
        if not len(t):
            return Ticks(t, t, np.ones(0, dtype=np.bool_))
        if self.rate:
            # the last sample may lie on the last time, but for rounding
            number = math.floor((t[-1] - t[0]) * self.rate + 1e-6) + 1
            times = np.minimum(t[0] + np.arange(number) / self.rate, t[-1])
        else:
            times = t
        n, step = len(times), self.step(t)
        late = np.clip(rng.standard_normal(n) * self.jitter, -0.45 * step, 0.45 * step)
        kept = np.ones(n, dtype=np.bool_)
        if self.dropout:
            # two states: the chance to come back gives the length, the chance to be lost the share
            back = 1.0 / self.dropout_length
            lost_rate = min(1.0, back * self.dropout / (1.0 - self.dropout))
            chance, lost = rng.random(n), False
            for k in range(n):
                lost = chance[k] >= back if lost else chance[k] < lost_rate
                kept[k] = not lost
        stamp = times + late if self.jitter else times
        return Ticks(times, stamp, kept)

    def step(self, t: FloatArray) -> float:
        """Return the time from one sample to the next [s], given the truth's times."""
        if self.rate:
            return 1.0 / self.rate
        return float(np.median(np.diff(t))) if len(t) > 1 else 1.0

    def sample(self, t: FloatArray, x: FloatArray, ticks: Ticks) -> FloatArray:
        """Return what the sensor sees of a signal.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the truth [s], evenly spaced if there is a low-pass.
        x : ndarray, shape (n, k)
            The signal there. Between, a cubic spline stands for it.
        ticks : Ticks
            When it looks.

        Returns
        -------
        ndarray, shape (m, k)
            One row per tick, lost ones too.

        Raises
        ------
        ValueError
            If the truth's times are not even, or too wide apart for the low-pass.
        """
        if not len(t):
            return x
        shift = self.delay
        if self.bandwidth:
            x = self._filtered(t, x)
            shift = self.delay - self.filter_delay if self.delay else 0.0
        when = ticks.t - shift
        if not self.average:
            return _at(t, x, when)
        return _means(t, x, when - self.step(t), when)

    @property
    def filter_delay(self) -> float:
        """Delay of the low-pass at low frequency [s]."""
        if not self.bandwidth:
            return 0.0
        poles = np.exp(0.5j * np.pi * (1.0 + (2.0 * np.arange(self.order) + 1.0) / self.order))
        return float(np.sum(-1.0 / poles).real) / (2.0 * math.pi * self.bandwidth)

    def _filtered(self, t: FloatArray, x: FloatArray) -> FloatArray:
        """Return the signal behind the low-pass, at first at rest at its first value."""
        from scipy.signal import butter, cont2discrete, lfilter, tf2ss

        if len(t) < 2:
            return x
        dt = np.diff(t)
        step = float(dt.mean())
        if np.abs(dt - step).max() > 1e-6 * step:
            raise ValueError("`t` of the truth must be evenly spaced for a low-pass filter.")
        if self.bandwidth * step > 0.5:
            raise ValueError(
                f"`t` of the truth must have a rate of at least twice the bandwidth of "
                f"{self.bandwidth:g} Hz, got {1.0 / step:g} Hz; raise the truth's rate."
            )
        continuous = tf2ss(*butter(self.order, 2.0 * math.pi * self.bandwidth, analog=True))
        # exact for a signal that is straight between the samples
        A, B, C, D, _ = cont2discrete(continuous, step, method="foh")
        numerator, denominator = _transfer(A, B, C, D)
        return np.asarray(lfilter(numerator, denominator, x - x[0], axis=0) + x[0])


def _transfer(A: Any, B: Any, C: Any, D: Any) -> tuple[FloatArray, FloatArray]:
    from scipy.signal import ss2tf

    numerator, denominator = ss2tf(A, B, C, D)
    return np.asarray(numerator[0]), np.asarray(denominator)


def _at(t: FloatArray, x: FloatArray, when: FloatArray) -> FloatArray:
    """Return the signal at any times; beyond the ends it keeps its last value."""
    after = np.clip(np.searchsorted(t, when), 0, len(t) - 1)
    before = np.maximum(after - 1, 0)
    index = np.where(np.abs(t[before] - when) < np.abs(t[after] - when), before, after)
    # times that differ by rounding alone are the same
    if len(t) < 2 or np.abs(t[index] - when).max(initial=0.0) <= SAME_TIME * (t[-1] - t[0]):
        return x[index]
    from scipy.interpolate import CubicSpline

    out: FloatArray = CubicSpline(t, x, axis=0)(np.clip(when, t[0], t[-1]))
    return out


def _means(t: FloatArray, x: FloatArray, start: FloatArray, stop: FloatArray) -> FloatArray:
    """Return means over intervals, cut to the span of the truth; of no interval, the value."""
    if len(t) < 2:
        return x[np.zeros(len(stop), dtype=np.int64)]
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(t, x, axis=0)
    total = curve.antiderivative()
    low, high = np.clip(start, t[0], t[-1]), np.clip(stop, t[0], t[-1])
    length = (high - low)[:, np.newaxis]
    empty = length <= 0.0
    mean = (total(high) - total(low)) / np.where(empty, 1.0, length)
    return np.asarray(np.where(empty, curve(high), mean))
