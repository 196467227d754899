"""Measured noise beside what the maker's datasheet says.

Datasheets use three kinds of figures for the same noise, which differ by known factors:

* noise *density* is one-sided: it is ``sqrt(2) * N``;
* angle or velocity *random walk* is N itself;
* *rms* noise is the deviation of the samples, whatever the bandwidth that made it.

A sensor whose filter passes more than half the sampling rate folds its noise: the samples hold
all of it, and N comes out larger than the density says, by ``sqrt(2 bandwidth / fs)``. With the
bandwidth given, the comparison undoes that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, unique
from typing import Final, Literal, get_args

from strapdown._checks import instance, instances, one_of, positive
from strapdown.noise.coefficients import FLOOR, Coefficients, Status

Kind = Literal["density", "random walk", "rms", "bias instability", "rate random walk"]
KINDS: Final[tuple[str, ...]] = get_args(Kind)
IN_LINE: Final = 2.0  # factor within which a typical figure of a datasheet is met


@unique
class Agreement(Enum):
    """How a measured figure stands to the datasheet's."""

    BETTER = "better"
    IN_LINE = "in line"
    WORSE = "worse"
    NOT_OBSERVABLE = "not observable"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A figure of a datasheet.

    Parameters
    ----------
    kind : {'density', 'random walk', 'rms', 'bias instability', 'rate random walk'}
        What is printed. A bias instability is taken as the lowest point of the Allan
        deviation, as makers do.
    value : float
        The figure in SI: unit/sqrt(Hz) for a density or random walk, the sensor's unit for
        rms and bias instability. Of a range, its lower end.
    upper : float, optional
        Upper end of a range.
    source : str
        Where it is printed.
    """

    kind: Kind
    value: float
    upper: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """Check kind and signs."""
        one_of("kind", self.kind, KINDS)
        positive("value", self.value)
        if self.upper is not None and not positive("upper", self.upper) >= self.value:
            raise ValueError(
                f"`upper` must not be below `value`, got {self.upper:g} and {self.value:g}."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One figure beside the measurement.

    Attributes
    ----------
    figure : Figure
        What the datasheet says.
    measured : float
        The same quantity measured; NaN where not observable.
    ratio : float
        Measured over printed; 1 inside a range.
    agreement : Agreement
        In line within a factor of two.
    remark : str
        What to know.
    """

    figure: Figure
    measured: float
    ratio: float
    agreement: Agreement
    remark: str = ""


def compare(
    measured: Coefficients,
    figures: Sequence[Figure],
    *,
    std: float = math.nan,
    bandwidth_hz: float | None = None,
) -> tuple[Comparison, ...]:
    """Compare measured noise with figures of a datasheet.

    Parameters
    ----------
    measured : Coefficients
        Of one axis.
    figures : sequence of Figure
        What the datasheet says.
    std : float
        Standard deviation of the samples, for figures of kind ``"rms"``.
    bandwidth_hz : float, optional
        Noise bandwidth of the sensor's filter [Hz]. Where it exceeds half the sampling rate,
        folded noise is taken out of the measured density.

    Returns
    -------
    tuple of Comparison
    """
    instance("measured", measured, Coefficients)
    if bandwidth_hz is not None:
        positive("bandwidth_hz", bandwidth_hz)
    found = instances("figures", figures, Figure)
    return tuple(_compare(measured, figure, std, bandwidth_hz) for figure in found)


def _compare(
    measured: Coefficients, figure: Figure, std: float, bandwidth_hz: float | None
) -> Comparison:
    remark = ""
    if figure.kind == "rms":
        value, status = std, Status.OBSERVED if math.isfinite(std) else Status.NOT_OBSERVABLE
        remark = "" if math.isfinite(std) else "the deviation of the samples was not given"
    else:
        source = {"bias instability": measured.B, "rate random walk": measured.K}
        found = source.get(figure.kind, measured.N)
        value, status, remark = found.value, found.status, found.remark
        if figure.kind == "bias instability":
            value *= FLOOR
        elif figure.kind == "density":
            value *= math.sqrt(2.0)
        if found is measured.N and bandwidth_hz is not None:
            folding = 2.0 * positive("bandwidth_hz", bandwidth_hz) / measured.fs
            if folding > 1.0:
                value /= math.sqrt(folding)
                remark = (
                    f"{remark}; " if remark else ""
                ) + f"noise folded {folding:.3g} times into half the sampling rate taken out"
    if status is Status.NOT_OBSERVABLE:
        return Comparison(
            figure=figure,
            measured=math.nan,
            ratio=math.nan,
            agreement=Agreement.NOT_OBSERVABLE,
            remark=remark,
        )
    upper = figure.value if figure.upper is None else figure.upper
    ratio = value / upper if value > upper else min(value / figure.value, 1.0)
    if figure.upper is not None:
        agreement = (
            Agreement.IN_LINE
            if ratio == 1.0
            else (Agreement.WORSE if ratio > 1.0 else Agreement.BETTER)
        )
    elif ratio > IN_LINE:
        agreement = Agreement.WORSE
    else:
        agreement = Agreement.BETTER if ratio < 1.0 / IN_LINE else Agreement.IN_LINE
    return Comparison(
        figure=figure, measured=value, ratio=ratio, agreement=agreement, remark=remark
    )
