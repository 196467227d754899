"""What a record says of one noise: its coefficient, how sure it is, or why it is not known."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import Enum, unique
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_floats, finite, instance, one_of
from strapdown._types import FloatArray

SYMBOLS: Final = ("Q", "N", "B", "K", "R")
NAMES: Final = {
    "Q": "quantisation",
    "N": "random walk",
    "B": "bias instability",
    "K": "rate random walk",
    "R": "rate ramp",
}
# Slopes of the Allan deviation, and where a line of that slope reads the coefficient [s].
SLOPES: Final = {"Q": -1.0, "N": -0.5, "B": 0.0, "K": 0.5, "R": 1.0}
READ_AT: Final = {"Q": math.sqrt(3.0), "N": 1.0, "B": math.nan, "K": 3.0, "R": math.sqrt(2.0)}
FLOOR: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)  # Allan deviation of flicker, B = 1: 0.664

# Unit of a coefficient, from the unit of the samples times seconds to a power.
_TIME_POWER: Final = {"Q": 1.0, "N": 0.5, "B": 0.0, "K": -0.5, "R": -1.0}


@unique
class Status(Enum):
    """Whether a noise was seen."""

    OBSERVED = "observed"
    NOT_OBSERVABLE = "not observable"  # in this record
    DOUBTFUL = "doubtful"  # a number came out, but the curve does not have that slope


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """One noise coefficient.

    Attributes
    ----------
    symbol : str
        ``"Q"``, ``"N"``, ``"B"``, ``"K"`` or ``"R"``.
    status : Status
        Whether the noise was seen.
    value, std : float
        Estimate and standard deviation; NaN where it is not observable. The ramp has a sign.
    low, high : float
        Interval of 95 %. Where it is not observable, `high` is the limit that the record
        sets, infinite if none.
    remark : str
        What to know before the number is used; the reason where there is none.
    """

    symbol: str
    status: Status
    value: float = math.nan
    std: float = math.nan
    low: float = math.nan
    high: float = math.inf
    remark: str = ""

    @property
    def name(self) -> str:
        """The noise in words."""
        return NAMES[self.symbol]

    @property
    def observed(self) -> bool:
        """Whether the number can be used as it stands."""
        return self.status is Status.OBSERVED


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """All noise coefficients of one channel.

    Attributes
    ----------
    Q, N, B, K, R : Coefficient
        Quantisation, random walk (of angle or velocity), bias instability, rate random walk,
        rate ramp.
    method : str
        ``"fit"`` or ``"read-off"``.
    fs, duration : float
        Sampling rate [Hz] and length of the record [s].
    tau_min : float
        Shortest averaging time that took part [s].
    model_error : float
        Relative error of the deviation that the model needs to describe the curve; 0 if none.
    """

    Q: Coefficient
    N: Coefficient
    B: Coefficient
    K: Coefficient
    R: Coefficient
    method: str
    fs: float
    duration: float
    tau_min: float
    model_error: float = 0.0

    def __iter__(self) -> Iterator[Coefficient]:
        """Yield the coefficients from the steepest fall to the steepest rise."""
        for field in fields(self)[: len(SYMBOLS)]:
            yield getattr(self, field.name)

    def __getitem__(self, symbol: str) -> Coefficient:
        """Return the coefficient of this symbol."""
        if symbol not in SYMBOLS:
            raise KeyError(symbol)
        found: Coefficient = getattr(self, symbol)
        return found

    def deviation(self, tau: ArrayLike) -> FloatArray:
        """Return the Allan deviation of all terms that have a value, together."""
        times = as_floats("tau", tau)
        total = np.zeros(times.shape)
        for c in self:
            if math.isfinite(c.value):
                total = total + line(c.symbol, abs(c.value), times) ** 2
        return np.asarray(np.sqrt(total))


def line(symbol: str, value: float, tau: ArrayLike) -> FloatArray:
    """Return the Allan deviation of one term over averaging times.

    Parameters
    ----------
    symbol : str
        Which term.
    value : float
        Its coefficient.
    tau : array_like
        Averaging times [s].

    Returns
    -------
    ndarray
    """
    one_of("symbol", symbol, _TIME_POWER)
    value, times = finite("value", value), as_floats("tau", tau)
    if not (times > 0.0).all():
        raise ValueError("`tau` must be positive, got a time that is not.")
    if symbol == "B":
        return np.asarray(np.full(times.shape, FLOOR * value))
    return np.asarray(value * (times / READ_AT[symbol]) ** SLOPES[symbol])


def coefficient_unit(symbol: str, unit: str) -> str:
    """Return the unit of a coefficient.

    Parameters
    ----------
    symbol : str
        Which term.
    unit : str
        Unit of the samples, such as ``"rad/s"``.

    Returns
    -------
    str

    Examples
    --------
    >>> coefficient_unit("N", "rad/s"), coefficient_unit("K", "rad/s")
    ('rad/s/sqrt(Hz)', 'rad/s*sqrt(Hz)')
    """
    one_of("symbol", symbol, _TIME_POWER)
    instance("unit", unit, str)
    tail = {1.0: "*s", 0.5: "/sqrt(Hz)", 0.0: "", -0.5: "*sqrt(Hz)", -1.0: "/s"}
    return unit + tail[_TIME_POWER[symbol]]
