"""Which cut-off of the sensor's low-pass filter to choose: noise against delay.

A lower cut-off lets less noise through and delays more. Over one integration interval noise
makes an angle error ``k sigma_w dt``, and the delay, at a rate omega, one of
``omega dt_delay`` ([1]_ (5.14) and (5.15)). The worst case adds them.

* A cut-off is *rejected* if at every rate of the range, and every multiple k, some other one
  has the smaller error: it only worsens the measurement.
* The *recommended* one, of those left, has the smallest regret: the largest ratio of its error
  to the least possible, at any rate from rest to the highest.

References
----------
.. [1] Thesis A (three-axis platform), section 5.3.1, tables 5.1 and 5.2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_series, as_vector, instance, positive, same_length
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.noise.spectrum import PowerDensity
from strapdown.units import DPS, MS

RATES: Final = (0.1 * DPS, 40.0 * DPS)  # range of rates in [1]_ [rad/s]
MULTIPLES: Final = (1.0, 2.0, 3.0)  # of sigma, [1]_ figure 5.8
_RATE_STEPS: Final = 200

# MPU-6050 gyroscope, [1]_ tables 5.1 and 5.2, sampled at 100 Hz.
MPU6050_CUTOFF_HZ: Final = (256.0, 188.0, 98.0, 42.0, 20.0, 10.0, 5.0)
MPU6050_DELAY: Final = tuple(d * MS for d in (0.98, 1.9, 2.8, 4.8, 8.3, 13.4, 18.6))  # [s]
MPU6050_SIGMA: Final = tuple(  # [rad/s]
    s * DPS for s in (0.110, 0.083, 0.069, 0.055, 0.046, 0.045, 0.044)
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LowPassStudy:
    """Errors of each cut-off, and which to take.

    Attributes
    ----------
    cutoff_hz : ndarray, shape (c,)
        Cut-off frequencies [Hz].
    rates : ndarray, shape (r,)
        Rates of motion [rad/s].
    multiples : ndarray, shape (k,)
        Multiples of sigma.
    noise_error : ndarray, shape (k, c)
        ``k sigma_w dt`` [rad].
    delay_error : ndarray, shape (r, c)
        ``omega dt_delay`` [rad].
    best : ndarray of int, shape (k, r)
        Which cut-off has the smallest sum of both.
    regret : ndarray, shape (c,)
        Largest ratio of the sum to the smallest one, rest included.
    rejected : ndarray of bool, shape (c,)
        Best nowhere in the range of rates.
    recommended : int
        Row of the recommended cut-off.
    """

    cutoff_hz: FloatArray
    rates: FloatArray
    multiples: FloatArray
    noise_error: FloatArray
    delay_error: FloatArray
    best: IntArray
    regret: FloatArray
    rejected: BoolArray
    recommended: int

    @property
    def recommended_hz(self) -> float:
        """The recommended cut-off [Hz]."""
        return float(self.cutoff_hz[self.recommended])

    @property
    def rejected_hz(self) -> tuple[float, ...]:
        """The cut-offs that only worsen the measurement [Hz]."""
        return tuple(float(f) for f in self.cutoff_hz[self.rejected])


def low_pass_study(
    cutoff_hz: ArrayLike = MPU6050_CUTOFF_HZ,
    sigma: ArrayLike = MPU6050_SIGMA,
    delay: ArrayLike = MPU6050_DELAY,
    dt: float = 0.01,
    *,
    rates: tuple[float, float] = RATES,
    multiples: Sequence[float] = MULTIPLES,
) -> LowPassStudy:
    """Weigh noise against delay for the cut-offs of a low-pass filter.

    Parameters
    ----------
    cutoff_hz : array_like, shape (c,)
        Cut-off frequencies [Hz]. The defaults are the MPU-6050's gyroscope in [1]_.
    sigma : array_like, shape (c,)
        Standard deviation of the sampled noise at each cut-off [rad/s].
    delay : array_like, shape (c,)
        Delay of the filter at each cut-off [s].
    dt : float
        Integration interval [s].
    rates : tuple of float
        Lowest and highest rate of motion [rad/s].
    multiples : sequence of float
        Multiples of sigma to look at.

    Returns
    -------
    LowPassStudy

    Examples
    --------
    >>> study = low_pass_study()
    >>> study.recommended_hz, study.rejected_hz
    (188.0, (20.0, 10.0, 5.0))
    """
    f = as_series("cutoff_hz", cutoff_hz)
    s, d = as_series("sigma", sigma), as_series("delay", delay)
    same_length(cutoff_hz=f, sigma=s, delay=d)
    if f.size < 2:
        raise ValueError(f"`cutoff_hz` must hold at least two cut-offs, got {f.size}.")
    for name, values in (("cutoff_hz", f), ("sigma", s), ("delay", d)):
        for k, value in enumerate(values):
            positive(f"{name}[{k}]", value)
    dt = positive("dt", dt)
    low, high = as_vector("rates", rates, 2).tolist()
    positive("rates[0]", low)
    if not low < high:
        raise ValueError(f"`rates` must increase, got {low:g} and {high:g} rad/s.")
    omega = np.geomspace(low, high, _RATE_STEPS)
    sigmas = as_series("multiples", multiples)
    if not (sigmas.size and (sigmas > 0.0).all()):
        raise ValueError("`multiples` must hold positive numbers, at least one.")
    noise, lag = np.outer(sigmas, s) * dt, np.outer(omega, d)
    total = noise[:, np.newaxis] + lag  # (k, r, c)
    best = np.argmin(total, axis=2)
    rejected = ~np.isin(np.arange(f.size), best)
    ratio = total / total.min(axis=2, keepdims=True)
    at_rest = noise / noise.min(axis=1, keepdims=True)
    regret = np.maximum(ratio.max(axis=(0, 1)), at_rest.max(axis=0))
    return LowPassStudy(
        cutoff_hz=f,
        rates=omega,
        multiples=sigmas,
        noise_error=noise,
        delay_error=lag,
        best=best,
        regret=regret,
        rejected=rejected,
        recommended=int(np.argmin(np.where(rejected, np.inf, regret))),
    )


def sigma_behind_filter(spectrum: PowerDensity, cutoff_hz: ArrayLike) -> FloatArray:
    """Return the noise that low-pass filters would let through.

    Parameters
    ----------
    spectrum : PowerDensity
        Of a record at rest, made with the filter off or at its widest.
    cutoff_hz : array_like, shape (c,)
        Cut-off frequencies of filters of first order [Hz].

    Returns
    -------
    ndarray, shape (c,)
        Standard deviation of samples taken behind the filter, in the signal's unit.

    Notes
    -----
    What lies above half the record's sampling rate is taken as white, at the level of the
    upper half of the record's band: noise that sampling would fold, samples hold.
    """
    instance("spectrum", spectrum, PowerDensity)
    cutoffs = as_series("cutoff_hz", cutoff_hz)
    for k, cutoff in enumerate(cutoffs):
        positive(f"cutoff_hz[{k}]", cutoff)
    f, density = spectrum.f, spectrum.density
    level = float(np.mean(density[f >= 0.5 * f[-1]]))
    passed = density / (1.0 + (f / cutoffs[:, np.newaxis]) ** 2)
    inside = np.sum(passed, axis=1) * (f[1] - f[0])
    beyond = level * cutoffs * (0.5 * math.pi - np.arctan(f[-1] / cutoffs))
    return np.asarray(np.sqrt(inside + beyond))
