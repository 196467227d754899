"""From samples to noise coefficients: the fit, its verdicts, and what it will not say.

A number is only given for what the record shows. A term is *observed* when the likelihood
asks for it and it is known better than to a factor of two; else it is *not observable*, with
the limit that the record sets. Where no sum of the terms describes the whole curve, a term is
only believed if the curve surely has its slope somewhere; else it is *doubtful*: the number
stands, with its reason.

References
----------
.. [1] Thesis A (three-axis platform), section 5.2.
.. [2] IEEE Std 952-1997, annex C.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from strapdown._checks import as_series, positive
from strapdown._types import FloatArray, IntArray
from strapdown.errors import InputError
from strapdown.noise.allan import AllanDeviation, allan_deviation, integrated
from strapdown.noise.coefficients import (
    NAMES,
    SLOPES,
    Coefficient,
    Coefficients,
    Status,
)
from strapdown.noise.covariance import TERMS, moments
from strapdown.noise.fit import CurveFit, Data, Fit
from strapdown.noise.stillness import require_signal

LEAST_SAMPLES: Final = 256
_BLOCKS: Final = 192  # block means for the long times
_LEAST_BLOCK: Final = 8  # samples; shorter times are left to the curve
_WIDEST: Final = 0.5  # relative deviation of a coefficient above which it is no number
_OCTAVES_TO_DROP: Final = 6  # of shortest times, where a low-pass filter bends the curve
_LEAST_OCTAVES: Final = 6  # that stay
_GOOD_FIT: Final = 0.01  # relative error of the deviation that leaves the terms their names
# How near a slope of the curve must come to speak for a term, and how sure it must be.
_SLOPE_TOLERANCE: Final = {"Q": 0.05, "N": 0.05, "B": 0.1, "K": 0.1}
_SLOPE_STD: Final = {"Q": 0.03, "N": 0.03, "B": 0.1, "K": 0.2}


def identify(y: ArrayLike, fs: float, *, name: str = "y") -> Coefficients:
    """Identify the noise of one channel at rest.

    Parameters
    ----------
    y : array_like, shape (n,)
        Samples at a constant rate: angular rate, specific force or field.
    fs : float
        Sampling rate [Hz].
    name : str
        Name of the channel for messages.

    Returns
    -------
    Coefficients
        In the unit of `y` and seconds: N in unit/sqrt(Hz), B in unit, K in unit*sqrt(Hz),
        R in unit/s, Q in unit*s.

    Raises
    ------
    InputError
        If the record is too short, constant or clipped.

    Notes
    -----
    Offline. The densities are two-sided, as in [2]_: white noise of deviation sigma sampled at
    fs has ``N = sigma / sqrt(fs)``. A datasheet's noise density is one-sided, ``sqrt(2) * N``.

    Examples
    --------
    >>> import numpy as np
    >>> found = identify(np.random.default_rng(1).normal(0.0, 0.1, 100_000), 100.0)
    >>> round(found.N.value, 4), found.K.status.value
    (0.0099, 'not observable')
    """
    samples = as_series(name, y)
    fs = positive("fs", fs)
    n = samples.size
    if n < LEAST_SAMPLES:
        raise InputError(
            f"`{name}` must have at least {LEAST_SAMPLES} samples to tell noises apart, got {n}; "
            "record longer."
        )
    require_signal(name, samples)
    factors = octaves(n)
    curve = allan_deviation(samples, fs, factors / fs)
    block = max(n // _BLOCKS, _LEAST_BLOCK)
    x = integrated(samples)
    means = np.diff(x[::block]) / block
    steps = np.diff(means)

    whole = moments(n, tuple(int(m) for m in factors))

    def data(drop: int) -> Data:
        return Data(
            curve=curve.dev[drop:] ** 2,
            factors=factors[drop:],
            moments=whole.without_shortest(drop),
            steps=steps,
            block=block,
        )

    drop, fit = _fit_without_filter(data, factors.size)
    return _verdicts(fit, curve, drop)


def octaves(n: int) -> IntArray:
    """Return averaging factors by powers of two below a third of n samples."""
    last = n // 3
    count = last.bit_length()
    return np.unique(last >> np.arange(count))


def _fit_without_filter(data: Callable[[int], Data], count: int) -> tuple[int, CurveFit]:
    """Return the fit, and how many octaves of shortest times it leaves out.

    A low-pass filter bends the curve at times near a sample, and no term describes that. The
    least number is left out that makes the rest fit about as well as it can.
    """
    fits = []
    for drop in range(min(_OCTAVES_TO_DROP, max(count - _LEAST_OCTAVES, 0)) + 1):
        fits.append(Fit(data(drop)))
        if fits[-1].model_error <= 2.0 * _GOOD_FIT:
            break
    limit = max(2.0 * _GOOD_FIT, 1.25 * min(fit.model_error for fit in fits))
    best = next(drop for drop, fit in enumerate(fits) if fit.model_error <= limit)
    return best, fits[best].result()


def _verdicts(fit: CurveFit, curve: AllanDeviation, drop: int) -> Coefficients:
    """Return what the fit says, term by term."""
    dt = 1.0 / curve.fs
    # Squared coefficients come in samples; time scales them.
    scale = {"Q": dt, "N": math.sqrt(dt), "B": 1.0, "K": 1.0 / math.sqrt(dt)}
    Q, N, B, K = (
        _verdict(symbol, k, fit, scale[symbol], curve, drop) for k, symbol in enumerate(TERMS)
    )
    return Coefficients(
        Q=Q,
        N=N,
        B=B,
        K=K,
        R=_ramp(fit, curve),
        method="fit",
        fs=curve.fs,
        duration=curve.duration,
        tau_min=float(curve.tau[drop]),
        model_error=0.5 * fit.model_error,
    )


def _verdict(
    symbol: str, k: int, fit: CurveFit, scale: float, curve: AllanDeviation, drop: int
) -> Coefficient:
    """Return one term with its status."""
    value = math.sqrt(fit.squares[k]) * scale
    std = 0.5 * fit.std[k] / math.sqrt(fit.squares[k]) * scale if value > 0.0 else math.nan
    low, high = math.sqrt(max(fit.low[k], 0.0)) * scale, math.sqrt(fit.high[k]) * scale
    if not fit.shown[k] or not std <= _WIDEST * value:
        limit = f"below {high:.3g}" if math.isfinite(high) else "without a limit"
        return Coefficient(
            symbol=symbol,
            status=Status.NOT_OBSERVABLE,
            high=high,
            remark=f"{NAMES[symbol]} {limit} does not show in a record of {curve.duration:g} s",
        )
    status, remark = Status.OBSERVED, ""
    described = drop == 0 and 0.5 * fit.model_error <= _GOOD_FIT
    # A mixture need not show the slopes of its middle terms, but its steep start should.
    if (symbol in "QN" or not described) and not _has_slope(curve, drop, symbol):
        status = Status.OBSERVED if described else Status.DOUBTFUL
        remark = _slope_remark(symbol, curve, drop)
    return Coefficient(
        symbol=symbol, status=status, value=value, std=std, low=low, high=high, remark=remark
    )


def _ramp(fit: CurveFit, curve: AllanDeviation) -> Coefficient:
    """Return the rate ramp."""
    ramp, std = fit.ramp * curve.fs, fit.ramp_std * curve.fs
    reach = float(norm.ppf(0.975)) * std
    if not fit.has_ramp:
        limit = abs(ramp) + reach
        return Coefficient(
            symbol="R",
            status=Status.NOT_OBSERVABLE,
            high=limit,
            remark=f"a rate ramp below {limit:.3g} does not show beside the other noise",
        )
    return Coefficient(
        symbol="R",
        status=Status.OBSERVED,
        value=ramp,
        std=std,
        low=ramp - reach,
        high=ramp + reach,
        remark="often the temperature that drifts",
    )


def _slopes(curve: AllanDeviation, drop: int) -> tuple[FloatArray, FloatArray]:
    """Return slopes over two octaves, and their standard deviations."""
    log, u = np.log(curve.dev[drop:]), np.log(curve.tau[drop:])
    variance = 0.5 / curve.edf[drop:]  # of the logarithm of a deviation
    run = u[2:] - u[:-2]
    return (log[2:] - log[:-2]) / run, np.sqrt(variance[2:] + variance[:-2]) / run


def _has_slope(curve: AllanDeviation, drop: int, symbol: str) -> bool:
    """Return whether the curve surely has the slope of a term over two octaves."""
    slopes, std = _slopes(curve, drop)
    near = np.abs(slopes - SLOPES[symbol]) <= _SLOPE_TOLERANCE[symbol] + std
    return bool(np.any(near & (std <= _SLOPE_STD[symbol])))


def _slope_remark(symbol: str, curve: AllanDeviation, drop: int) -> str:
    """Return in words which slope the curve has where it comes nearest to that of the term."""
    slopes, std = _slopes(curve, drop)
    off = np.abs(slopes - SLOPES[symbol]) + np.where(std <= _SLOPE_STD[symbol], 0.0, np.inf)
    k = int(np.argmin(off))
    if not math.isfinite(off[k]):
        return f"the record is too short to show the slope {SLOPES[symbol]:+g} of {NAMES[symbol]}"
    return (
        f"the curve does not have the slope {SLOPES[symbol]:+g} of {NAMES[symbol]}: the nearest "
        f"is {slopes[k]:+.2f}, from {curve.tau[drop + k]:.3g} s to {curve.tau[drop + k + 2]:.3g} s"
    )
