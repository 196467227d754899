"""Power spectral density of a signal at rest, by Welch's average of periodograms.

References
----------
.. [1] P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra",
       IEEE Trans. Audio Electroacoust. 15(2), 1967.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import get_window, welch
from scipy.stats import chi2

from strapdown._checks import as_series, in_range, positive, whole
from strapdown._types import FloatArray
from strapdown.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerDensity:
    """A one-sided power spectral density.

    Attributes
    ----------
    f : ndarray, shape (k,)
        Frequencies, zero left out [Hz].
    density : ndarray, shape (k,)
        Power per hertz, in the square of the signal's unit; its integral over f is the
        variance.
    low, high : ndarray, shape (k,)
        Confidence interval.
    edf : float
        Equivalent degrees of freedom of each value.
    confidence : float
        Probability of the interval.
    """

    f: FloatArray
    density: FloatArray
    low: FloatArray
    high: FloatArray
    edf: float
    confidence: float

    @property
    def amplitude(self) -> FloatArray:
        """Square root of the density: what datasheets call noise density."""
        return np.asarray(np.sqrt(self.density))

    def white_level(self, f_low: float, f_high: float) -> float:
        """Return the coefficient N of white noise in a band.

        Parameters
        ----------
        f_low, f_high : float
            Band [Hz].

        Returns
        -------
        float
            ``sqrt(density / 2)``: N is defined by the two-sided density.
        """
        inside = (self.f >= f_low) & (self.f <= f_high)
        if not inside.any():
            raise InputError(
                f"the band from {f_low:g} Hz to {f_high:g} Hz must hold a frequency of the "
                f"spectrum, which has {self.f[0]:g} Hz to {self.f[-1]:g} Hz."
            )
        return float(np.sqrt(0.5 * np.mean(self.density[inside])))


def power_density(
    y: ArrayLike, fs: float, *, segment: int | None = None, confidence: float = 0.95
) -> PowerDensity:
    """Power spectral density by averaged, half overlapping, Hann-weighted periodograms [1]_.

    Parameters
    ----------
    y : array_like, shape (n,)
        Samples at a constant rate.
    fs : float
        Sampling rate [Hz].
    segment : int, optional
        Samples per periodogram. Longer resolves lower frequencies, shorter is smoother.
        Default: a sixteenth of the record, at least 256.
    confidence : float
        Probability of the interval.

    Returns
    -------
    PowerDensity

    Raises
    ------
    InputError
        If the record is shorter than one segment.

    Notes
    -----
    Offline. A line is taken from each segment, so that a drift does not leak.
    """
    samples = as_series("y", y)
    fs = positive("fs", fs)
    in_range("confidence", confidence, 0.01, 0.9999)
    length = max(256, samples.size // 16) if segment is None else whole("segment", segment, 8)
    if samples.size < length:
        raise InputError(
            f"`y` must have at least one segment of {length} samples, got {samples.size}; "
            "record longer or give a smaller `segment`."
        )
    f, density = welch(samples, fs, window="hann", nperseg=length, detrend="linear")
    step = length - length // 2
    count = 1 + (samples.size - length) // step
    dof = _edf(length, step, count)
    tail = 0.5 * (1.0 - confidence)
    keep = slice(1, None)
    return PowerDensity(
        f=f[keep],
        density=density[keep],
        low=density[keep] * dof / chi2.ppf(1.0 - tail, dof),
        high=density[keep] * dof / chi2.ppf(tail, dof),
        edf=dof,
        confidence=confidence,
    )


def _edf(length: int, step: int, count: int) -> float:
    """Return the degrees of freedom of an average of overlapping periodograms."""
    w = get_window("hann", length)
    shared = float(w[step:] @ w[:-step]) / float(w @ w)
    return 2.0 * count / (1.0 + 2.0 * (1.0 - 1.0 / count) * shared**2)
