"""The page of a calibration: verdicts, errors before and after, coverage, convergence."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from strapdown._types import FloatArray, IntArray
from strapdown.calibration.record import (
    SENSOR_NAMES,
    CalibrationRecord,
    Fit,
    Parameter,
    TemperatureRecord,
)
from strapdown.report import page
from strapdown.report.figures import (
    ALARM,
    ESTIMATE,
    MUTED,
    REFERENCE,
    Figure,
    Panel,
    Series,
    grid_figure,
)
from strapdown.report.page import Block, Page, Section
from strapdown.units import DEG, DPS, MG, UT

# How people read each unit: symbol and size in SI.
SHOWN = {
    "rad_s": ("deg/s", DPS),
    "m_s2": ("mg", MG),
    "t": ("µT", UT),
    "rad": ("deg", DEG),
    "1": ("", 1.0),
    "rad_s_per_degc": ("deg/s/°C", DPS),
    "m_s2_per_degc": ("mg/°C", MG),
    "t_per_degc": ("µT/°C", UT),
}
_MOST_POINTS = 4000  # of a cloud; more hide each other


def write(records: Sequence[Fit], path: str | os.PathLike[str], notes: Sequence[str] = ()) -> Path:
    """Write the report of calibrations: one HTML file that opens anywhere.

    Parameters
    ----------
    records : sequence of Fit
        Fresh from their fits, with residuals and history.
    path : str or path
        The HTML file; one that is there is replaced.
    notes : sequence of str
        What was assumed.

    Returns
    -------
    Path
        The file.
    """
    return page.write(compose(records, notes), path)


def compose(records: Sequence[Fit], notes: Sequence[str] = ()) -> Page:
    """Return the page that `write` writes."""
    names = ", ".join(dict.fromkeys(SENSOR_NAMES[r.sensor] for r in records))
    sections: list[Section] = []
    for record in records:
        title = SENSOR_NAMES[record.sensor].capitalize()
        if isinstance(record, TemperatureRecord):
            title += ", temperature"
        sections.append(
            Section(title=title, blocks=_blocks(record), intro=f"Method: {record.method}.")
        )
    if notes:
        sections.append(Section(title="Notes", blocks=[page.listed("Assumed and found", notes)]))
    return Page(title=f"Calibration: {names}", subtitle=_subtitle(records), sections=sections)


def shown(parameter: Parameter) -> tuple[float, float, float | None, str]:
    """Return value, standard deviation, tolerance and unit of a parameter as people read them."""
    symbol, size = SHOWN[parameter.unit]
    tolerance = None if parameter.tolerance is None else parameter.tolerance / size
    return parameter.value / size, parameter.std / size, tolerance, symbol


def _subtitle(records: Sequence[Fit]) -> str:
    first = records[0]
    parts = [first.date.isoformat()]
    if first.sensor_id:
        parts.append(f"sensor {first.sensor_id}")
    return " · ".join(parts)


def _blocks(record: Fit) -> list[Block]:
    blocks = [page.cards(_cards(record)), page.beside(*_tables(record))]
    blocks.append(page.plot(_residual_figure(record), "Errors before and after the calibration."))
    if len(record.directions):
        blocks.append(
            page.plot(
                _sphere_figure(record.directions),
                "Directions of the input that the sensor was shown, on a map of equal areas: "
                "empty regions were not seen.",
            )
        )
    if len(record.history) > 1:
        blocks.append(
            page.plot(
                _history_figure(record),
                "Parameters by iteration, from the start to the solution.",
            )
        )
    return blocks


def _cards(record: Fit) -> list[tuple[str, str, str]]:
    symbol, size = SHOWN[record.unit]
    cards = [
        ("verdict", record.verdict.value, ""),
        ("residual before", page.number(record.residual_rms_before / size, 3), symbol),
        ("residual after", page.number(record.residual_rms / size, 3), symbol),
        ("equations", page.number(record.equations), ""),
        ("degrees of freedom", page.number(record.dof), ""),
    ]
    if "coverage" in record.quality:
        cards.append(("coverage", f"{100.0 * record.quality['coverage']:.0f}", "%"))
    return cards


def _tables(record: Fit) -> list[Block]:
    rows = []
    for parameter in record.parameters:
        value, std, tolerance, symbol = shown(parameter)
        rows.append((parameter.name, value, std, symbol, tolerance, parameter.verdict.value))
    tables = [
        page.table(
            ("parameter", "value", "sigma", "unit", "tolerance", "verdict"),
            rows,
            caption="Parameters",
        )
    ]
    if isinstance(record, CalibrationRecord):
        symbol, size = SHOWN[record.unit]
        tables.append(
            page.table(
                ("", "x", "y", "z", f"bias [{symbol}]"),
                [
                    (axis, *(float(c) for c in row), float(bias / size))
                    for axis, row, bias in zip("xyz", record.matrix, record.bias, strict=True)
                ],
                caption="corrected = matrix · (raw − bias)",  # noqa: RUF001 - a minus sign
                digits=6,
            )
        )
    if record.quality:
        tables.append(
            page.table(
                ("figure", "value"),
                [(name.replace("_", " "), float(v)) for name, v in record.quality.items()],
                caption="Figures of the method, SI unless named",
            )
        )
    return tables


def _residual_figure(record: Fit) -> Figure:
    symbol, size = SHOWN[record.unit]
    after, before = record.residuals / size, record.residuals_before / size
    panels = []
    axes = "xyz" if after.ndim == 2 else ("",)
    for k, axis in enumerate(axes):
        y_after = after[:, k] if after.ndim == 2 else after
        y_before = before[:, k] if before.ndim == 2 else before
        rows = _thinned(len(y_after))
        number = rows.astype(np.float64)
        items = [
            Series(x=number, y=y_before[rows], name="before", color=REFERENCE, kind="points",
                   width=4.0),
            Series(x=number, y=y_after[rows], name="after", color=ESTIMATE, kind="points",
                   width=4.0),
        ]  # fmt: skip
        label = f"error {axis} [{symbol}]" if axis else f"error of the norm [{symbol}]"
        panels.append(Panel(y_label=label, items=items, x_label="equation", height=170))
    return grid_figure(panels, columns=len(panels))


def _sphere_figure(directions: FloatArray) -> Figure:
    """Return a cylindrical equal-area map of unit vectors."""
    d = directions[_thinned(len(directions))]
    longitude = np.degrees(np.arctan2(d[:, 1], d[:, 0]))
    points = Series(x=longitude, y=d[:, 2], name="input", color=ESTIMATE, kind="points", width=4.0)
    x = np.array([-180.0, -90.0, 0.0, 90.0, 180.0, 0.0, 0.0])
    y = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0])
    axes = Series(x=x, y=y, name="axes of the sensor", color=ALARM, kind="points", width=7.0)
    panel = Panel(
        y_label="z component",
        items=[points, axes],
        x_label="angle about z, from x towards y [deg]",
        height=260,
        x_range=(-185.0, 185.0),
        y_range=(-1.08, 1.08),
    )
    return grid_figure([panel])


def _history_figure(record: Fit) -> Figure:
    panels = []
    iteration = np.arange(len(record.history), dtype=np.float64)
    for k, parameter in enumerate(record.parameters):
        symbol, size = SHOWN[parameter.unit]
        y = record.history[:, k] / size
        label = f"{parameter.name} [{symbol}]" if symbol else parameter.name
        last = float(y[-1])
        if np.ptp(y) < 0.01 * abs(last):  # ticks of many equal digits cannot be read
            y = y - last
            label = f"{parameter.name} less {last:.6g} [{symbol}]".replace(" []", "")
        final = np.full(2, y[-1])
        items = [
            Series(x=iteration[[0, -1]], y=final, name="solution", color=MUTED, dash="dot"),
            Series(x=iteration, y=y, name="estimate", color=ESTIMATE),
            Series(x=iteration, y=y, name="estimate", color=ESTIMATE, kind="points", width=5.0),
        ]
        panels.append(Panel(y_label="", title=label, items=items, x_label="iteration", height=120))
    return grid_figure(panels, columns=3)


def _thinned(n: int) -> IntArray:
    """Return rows spread evenly, at most `_MOST_POINTS`."""
    return np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).round().astype(np.int64))
