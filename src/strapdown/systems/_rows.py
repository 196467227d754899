"""A row of a reproduced table: what the thesis prints, what is computed here, and the verdict."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum, unique
from typing import Any

from strapdown.report.page import Block


@unique
class Verdict(StrEnum):
    """How what is computed here stands to what the thesis prints."""

    MET = "met"  # the printed figure follows from printed inputs, or a printed limit is kept
    MISSED = "missed"
    RECOVERED = "recovered"  # simulated with the printed parameters, which came back
    NOT_GIVEN = "not given"  # the thesis prints no figure
    INFO = "info"  # beside the printed figure for information; nothing is claimed


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far from the printed figure still counts as the same.

    Parameters
    ----------
    absolute : float
        Half width in the row's unit.
    relative : float
        Half width as a part of the printed figure; the larger of the two holds.
    bound : {'around', 'at most', 'at least'}
        Whether the printed figure is a value or a limit.
    """

    absolute: float = 0.0
    relative: float = 0.0
    bound: str = "around"

    def holds(self, thesis: float, here: float) -> bool:
        """Return whether `here` is within the tolerance of `thesis`.

        Parameters
        ----------
        thesis, here : float
            In the row's unit. NaN is never within.

        Returns
        -------
        bool
        """
        width = max(self.absolute, self.relative * abs(thesis))
        if self.bound == "at most":
            return here <= thesis + width
        if self.bound == "at least":
            return here >= thesis - width
        return abs(here - thesis) <= width

    def __str__(self) -> str:
        """Return it as a reader writes it: ``+-5 %``, ``at most``."""
        parts = [f"+-{self.absolute:.4g}"] if self.absolute else []
        parts += [f"+-{100.0 * self.relative:.4g} %"] if self.relative else []
        width = " or ".join(parts)
        return width if self.bound == "around" else f"{self.bound} {width}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A figure of a thesis beside the one computed here.

    Attributes
    ----------
    item : str
        Table or section and what stands there, such as ``table 5.3, gyro x, N``.
    thesis, here : float, str or None
        In `unit`; None where there is none.
    unit : str
        As a table heads it.
    tolerance : str
        What still counts as the same; empty where nothing is compared.
    verdict : Verdict
        See there.
    remark : str
        Why: where the tolerance comes from, what was simulated, why it is missed.
    """

    item: str
    thesis: float | str | None
    here: float | str | None
    unit: str
    tolerance: str
    verdict: Verdict
    remark: str = ""

    def summary(self) -> dict[str, Any]:
        """Return what ``--json`` prints of it.

        Returns
        -------
        dict
        """
        return {**asdict(self), "verdict": self.verdict.value}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What an experiment shows.

    Attributes
    ----------
    rows : sequence of Row
        Its part of the table.
    blocks : sequence of Block
        Figures for the report, where a thesis shows curves.
    """

    rows: Sequence[Row]
    blocks: Sequence[Block] = field(default_factory=tuple)


def compared(
    item: str, thesis: float, here: float, unit: str, tolerance: Tolerance, remark: str = ""
) -> Row:
    """Return a row that is met or missed: printed inputs alone lead to the figure.

    Parameters
    ----------
    item, unit, remark
        See `Row`.
    thesis, here : float
        Printed and computed figure.
    tolerance : Tolerance
        What still counts as the same.

    Returns
    -------
    Row
    """
    same = tolerance.holds(thesis, here)
    return Row(
        item=item, thesis=thesis, here=_finite(here), unit=unit, tolerance=str(tolerance),
        verdict=Verdict.MET if same else Verdict.MISSED, remark=remark,
    )  # fmt: skip


def simulated(
    item: str, thesis: float, here: float, unit: str, tolerance: Tolerance, remark: str = ""
) -> Row:
    """Return a row that is recovered or missed: data simulated with the printed parameters.

    Parameters
    ----------
    item, unit, remark
        See `Row`.
    thesis, here : float
        Printed figure and what the simulated data give back.
    tolerance : Tolerance
        What still counts as the same.

    Returns
    -------
    Row
    """
    same = tolerance.holds(thesis, here)
    return Row(
        item=item, thesis=thesis, here=_finite(here), unit=unit, tolerance=str(tolerance),
        verdict=Verdict.RECOVERED if same else Verdict.MISSED, remark=remark,
    )  # fmt: skip


def worded(
    item: str,
    thesis: str,
    here: str,
    *,
    same: bool,
    from_simulation: bool = False,
    tolerance: str = "",
    remark: str = "",
) -> Row:
    """Return a row whose statement is in words, such as ``out of tolerance``.

    Parameters
    ----------
    item, remark, tolerance
        See `Row`.
    thesis, here : str
        Both statements, with their figures and units.
    same : bool
        Whether they say the same.
    from_simulation : bool
        Whether `here` comes from simulated data: then recovered, not met.

    Returns
    -------
    Row
    """
    agreed = Verdict.RECOVERED if from_simulation else Verdict.MET
    return Row(
        item=item, thesis=thesis, here=here, unit="", tolerance=tolerance,
        verdict=agreed if same else Verdict.MISSED, remark=remark,
    )  # fmt: skip


def not_given(item: str, here: float | str | None, unit: str = "", remark: str = "") -> Row:
    """Return a row for what the thesis shows without a figure.

    Parameters
    ----------
    item, unit, remark
        See `Row`.
    here : float, str or None
        What is computed here.

    Returns
    -------
    Row
    """
    return Row(
        item=item, thesis=None, here=_finite(here), unit=unit, tolerance="",
        verdict=Verdict.NOT_GIVEN, remark=remark,
    )  # fmt: skip


def info(
    item: str,
    thesis: float | str | None,
    here: float | str | None,
    unit: str = "",
    remark: str = "",
) -> Row:
    """Return a row of which nothing is claimed.

    Parameters
    ----------
    item, unit, remark
        See `Row`.
    thesis, here : float, str or None
        Printed, and computed where it can be.

    Returns
    -------
    Row
    """
    return Row(
        item=item, thesis=thesis, here=_finite(here), unit=unit, tolerance="",
        verdict=Verdict.INFO, remark=remark,
    )  # fmt: skip


def _finite(value: float | str | None) -> float | str | None:
    """Return a plain Python value; none for a number that is not finite."""
    if value is None or isinstance(value, str):
        return value
    return float(value) if math.isfinite(value) else None
