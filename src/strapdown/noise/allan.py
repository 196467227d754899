"""Allan deviation and its relatives, with confidence intervals.

All take rate samples (angular rate, specific force, field) at a constant rate `fs`, average
them over times ``tau = m / fs`` and compare neighbouring averages:

========  =====================================================================================
adev      Allan deviation of averages side by side, as in [1]_ (5.7)
oadev     the same from all overlapping averages: the default, best use of the data
mdev      modified: averages of averages; tells quantisation from flicker of the angle
totdev    total: the record continued by reflection, more sure at the longest times
hdev      Hadamard: second differences of averages side by side, blind to a ramp
ohdev     the same from all overlapping averages
========  =====================================================================================

References
----------
.. [1] Thesis A (three-axis platform), section 5.2; IEEE Std 952-1997, annex C.
.. [2] W. J. Riley, "Handbook of frequency stability analysis", NIST SP 1065, 2008.
"""

from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_floats, as_series, in_range, one_of, positive, whole
from strapdown._types import FloatArray, IntArray
from strapdown.errors import InputError
from strapdown.kernels import allan as _k
from strapdown.noise.edf import alpha_of_slope, confidence_interval, difference_order, edf

Kind = Literal["adev", "oadev", "mdev", "totdev", "hdev", "ohdev"]
KINDS: Final[tuple[str, ...]] = get_args(Kind)
KIND_NAMES: Final = {
    "adev": "Allan deviation",
    "oadev": "overlapping Allan deviation",
    "mdev": "modified Allan deviation",
    "totdev": "total deviation",
    "hdev": "Hadamard deviation",
    "ohdev": "overlapping Hadamard deviation",
}

_LANES = 128  # partial sums of the kernels: fits the first cache, feeds the vector unit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AllanDeviation:
    """A deviation curve.

    Attributes
    ----------
    kind : str
        Estimator, one of `KINDS`.
    fs : float
        Sampling rate [Hz].
    n : int
        Rate samples.
    m : ndarray of int, shape (k,)
        Averaging factors.
    tau : ndarray, shape (k,)
        Averaging times ``m / fs`` [s].
    dev : ndarray, shape (k,)
        Deviation, in the unit of the samples.
    count : ndarray of int, shape (k,)
        Differences that were averaged.
    alpha : ndarray of int, shape (k,)
        Exponent of the noise that the local slope shows; it decides `edf`.
    edf : ndarray, shape (k,)
        Equivalent degrees of freedom.
    low, high : ndarray, shape (k,)
        Confidence interval of the deviation.
    confidence : float
        Its probability.
    """

    kind: str
    fs: float
    n: int
    m: IntArray
    tau: FloatArray
    dev: FloatArray
    count: IntArray
    alpha: IntArray
    edf: FloatArray
    low: FloatArray
    high: FloatArray
    confidence: float

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.n / self.fs


def allan_deviation(
    y: ArrayLike,
    fs: float,
    taus: ArrayLike | None = None,
    *,
    kind: Kind = "oadev",
    quantity: Literal["rate", "angle"] = "rate",
    confidence: float = 0.95,
) -> AllanDeviation:
    """Deviation of a signal over averaging times.

    Parameters
    ----------
    y : array_like, shape (n,)
        Samples of one axis at a constant rate. With ``quantity="angle"`` their integral
        (angle, velocity, clock phase), in its unit.
    fs : float
        Sampling rate [Hz].
    taus : array_like, optional
        Averaging times [s]; each is rounded to a multiple of ``1 / fs``, and what then is
        equal is merged. Default: `default_taus`.
    kind : {'oadev', 'adev', 'mdev', 'totdev', 'hdev', 'ohdev'}
        Estimator.
    quantity : {'rate', 'angle'}
        What `y` is.
    confidence : float
        Probability of the interval.

    Returns
    -------
    AllanDeviation

    Raises
    ------
    InputError
        If an averaging time is too long for the record.
    ValueError
        If samples are not finite, or an averaging time is shorter than one sample.

    Notes
    -----
    Vectorised. Beside the samples it needs one array of their size.

    Examples
    --------
    >>> import numpy as np
    >>> y = np.random.default_rng(1).normal(0.0, 0.1, 100_000)  # N = 0.1 / sqrt(100)
    >>> curve = allan_deviation(y, 100.0, [1.0, 10.0])
    >>> curve.dev.round(4)
    array([0.0097, 0.0033])
    """
    one_of("kind", kind, KINDS)
    one_of("quantity", quantity, ("rate", "angle"))
    fs = positive("fs", fs)
    in_range("confidence", confidence, 0.01, 0.9999)
    samples = as_series("y", y)
    n = samples.size if quantity == "rate" else samples.size - 1
    m = averaging_factors(n, fs, taus, kind)
    if quantity == "rate":
        x, scale = integrated(samples), 1.0
    else:
        x, scale = samples, fs
    lanes = np.empty(_LANES)
    power, count = np.empty(m.size), np.empty(m.size, dtype=np.int64)
    for i, factor in enumerate(m):
        power[i], count[i] = _POWERS[kind](x, int(factor), lanes)
    norm = 6.0 if difference_order(kind) == 3 else 2.0
    divisor = np.sqrt(norm * count) * m * (m if kind == "mdev" else 1)
    dev = scale * np.sqrt(power) / divisor
    tau = m / fs
    alpha = alpha_of_slope(local_slope(tau, dev))
    dof = np.array([edf(kind, n, int(f), int(a)) for f, a in zip(m, alpha, strict=True)])
    low, high = confidence_interval(dev, dof, confidence)
    return AllanDeviation(
        kind=kind,
        fs=fs,
        n=n,
        m=m,
        tau=tau,
        dev=dev,
        count=count,
        alpha=alpha,
        edf=dof,
        low=low,
        high=high,
        confidence=confidence,
    )


def integrated(y: FloatArray) -> FloatArray:
    """Return the running sum of the samples less their mean, starting at 0; shape (n + 1,).

    The mean goes first: a differences' estimator does not see it, and its sum would use up
    the digits.
    """
    x = np.empty(y.size + 1)
    _k.integrate(y, float(y.mean()), x)
    return x


def longest_factor(n: int, kind: str) -> int:
    """Return the largest averaging factor that leaves two differences in n samples."""
    if kind == "totdev":
        return n // 2
    spans = {"adev": 3, "hdev": 4}  # two differences side by side need one span more
    if kind in spans:
        return n // spans[kind]
    order = difference_order(kind)
    return n // 3 if kind == "mdev" else (n - 1) // order


def default_taus(n: int, fs: float, kind: Kind = "oadev", per_decade: int = 10) -> FloatArray:
    """Averaging times evenly spaced in the logarithm, from one sample to a third of the record.

    Parameters
    ----------
    n : int
        Rate samples.
    fs : float
        Sampling rate [Hz].
    kind : str
        Estimator; Hadamard's needs longer records.
    per_decade : int
        Times per decade.

    Returns
    -------
    ndarray, shape (k,)
        Multiples of ``1 / fs`` [s].
    """
    n, fs = whole("n", n, 0, 10**15), positive("fs", fs)
    per_decade = whole("per_decade", per_decade, 1, 1_000_000)
    one_of("kind", kind, KINDS)
    last = min(longest_factor(n, kind), max(n // 3, 1))
    if last < 1:
        raise InputError(
            f"a record must have at least 4 samples for a deviation, got {n}; record longer."
        )
    points = 1 + int(np.ceil(per_decade * np.log10(last))) if last > 1 else 1
    return np.asarray(np.unique(np.round(np.geomspace(1, last, points))) / fs)


def averaging_factors(n: int, fs: float, taus: ArrayLike | None, kind: str) -> IntArray:
    """Return the averaging factors of `taus`, increasing and all possible in n samples."""
    if taus is None:
        wanted = default_taus(n, fs, kind)  # type: ignore[arg-type]
    else:
        wanted = as_series("taus", np.atleast_1d(as_floats("taus", taus)))
    if wanted.size == 0:
        raise ValueError("`taus` must hold at least one averaging time, got none.")
    if wanted.min() < (1.0 - 1e-6) / fs:
        raise ValueError(
            f"`taus` must be at least one sample, {1.0 / fs:g} s, got {wanted.min():g} s."
        )
    longest = longest_factor(n, kind)
    if wanted.max() * fs > longest + 0.5:
        raise InputError(
            f"`taus` must be at most {longest / fs:g} s for the {KIND_NAMES[kind]} of a record "
            f"of {n / fs:g} s, got {wanted.max():g} s; record longer or drop that time."
        )
    return np.asarray(np.unique(np.round(wanted * fs)).astype(np.int64))


def local_slope(tau: FloatArray, dev: FloatArray) -> FloatArray:
    """Return the slope of ``log(dev)`` over ``log(tau)``, of a line through about an octave.

    Parameters
    ----------
    tau, dev : ndarray, shape (k,)
        Averaging times, increasing, and deviations.

    Returns
    -------
    ndarray, shape (k,)
        -1/2, white noise, where a single point tells nothing.
    """
    if tau.size < 2:
        return np.full(tau.size, -0.5)
    u = np.log(tau)
    v = np.log(np.maximum(dev, np.finfo(np.float64).tiny))
    slope = np.empty(tau.size)
    for i in range(tau.size):
        near = np.abs(u - u[i]) <= 0.75  # a factor of about two to both sides
        if np.count_nonzero(near) < 3:
            near = np.abs(np.arange(tau.size) - i) <= 1
        du = u[near] - u[near].mean()
        slope[i] = (du @ v[near]) / (du @ du)
    return slope


def _adev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    return _oadev(np.ascontiguousarray(x[::m]), 1, lanes)


def _oadev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    n = x.size
    power = _k.second_difference_power(x[: n - 2 * m], x[m : n - m], x[2 * m :], lanes)
    return power, n - 2 * m


def _mdev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    return _k.averaged_second_difference_power(x, m), x.size - 3 * m + 1


def _totdev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    return _k.reflected_second_difference_power(x, m), x.size - 2


def _hdev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    return _ohdev(np.ascontiguousarray(x[::m]), 1, lanes)


def _ohdev(x: FloatArray, m: int, lanes: FloatArray) -> tuple[float, int]:
    n = x.size
    power = _k.third_difference_power(
        x[: n - 3 * m], x[m : n - 2 * m], x[2 * m : n - m], x[3 * m :], lanes
    )
    return power, n - 3 * m


_POWERS: Final = {
    "adev": _adev,
    "oadev": _oadev,
    "mdev": _mdev,
    "totdev": _totdev,
    "hdev": _hdev,
    "ohdev": _ohdev,
}
