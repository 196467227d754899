"""The page of a noise characterisation: deviation curves with fits and bands, spectra, tables."""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from strapdown.noise.allan import AllanDeviation
from strapdown.noise.characterize import Characterization
from strapdown.noise.coefficients import NAMES, Coefficient, Coefficients, Status, line
from strapdown.noise.record import AXES, SENSOR_NAMES, SensorNoise
from strapdown.noise.spectrum import PowerDensity
from strapdown.report import page
from strapdown.report.figures import (
    AXIS_COLORS,
    ESTIMATE,
    MUTED,
    REFERENCE,
    Band,
    Figure,
    Panel,
    Series,
    grid_figure,
)
from strapdown.report.page import Block, Page, Section
from strapdown.units import DPS, MG, UT

# How people read each sensor: symbol and size in SI.
SHOWN: Final = {"gyr": ("deg/s", DPS), "acc": ("mg", MG), "mag": ("µT", UT)}
_TERM_COLORS: Final = {
    "Q": "#cc79a7",
    "N": "#e69f00",
    "B": "#009e73",
    "K": "#56b4e9",
    "R": "#d55e00",
}
_SPECTRUM_POINTS: Final = 600


def write(found: Characterization, path: str | os.PathLike[str]) -> Path:
    """Write the report of a characterisation: one HTML file that opens anywhere.

    Parameters
    ----------
    found : Characterization
        What `strapdown.noise.characterize` returned.
    path : str or path
        The HTML file; one that is there is replaced.

    Returns
    -------
    Path
        The file.
    """
    return page.write(compose(found), path)


def compose(found: Characterization) -> Page:
    """Return the page that `write` writes."""
    record = found.record
    parts = [record.date.isoformat(), record.source]
    if record.sensor_id:
        parts.append(f"sensor {record.sensor_id}")
    if record.temp_degc is not None:
        parts.append(f"{record.temp_degc:.1f} °C")
    sections = [
        Section(
            title=SENSOR_NAMES[name].capitalize(),
            intro=f"{noise.duration:.0f} s at {noise.fs:.4g} Hz, from {noise.start:.1f} s.",
            blocks=_blocks(found, name, noise),
        )
        for name, noise in record.sensors.items()
    ]
    if found.together is not None:
        sections.append(_together(found))
    notes = _notes(found)
    if notes:
        sections.append(Section(title="Notes", blocks=[page.listed("Before use", notes)]))
    return Page(
        title="Noise: " + ", ".join(SENSOR_NAMES[name] for name in record.sensors),
        subtitle=" · ".join(part for part in parts if part),
        sections=sections,
    )


def cell(c: Coefficient, size: float = 1.0) -> str:
    """Return a coefficient as a short text: value and uncertainty, or the limit.

    Parameters
    ----------
    c : Coefficient
        What was found.
    size : float
        The unit in which it is shown, in SI.

    Returns
    -------
    str
    """
    if c.status is Status.NOT_OBSERVABLE:
        return f"< {c.high / size:.2g}" if math.isfinite(c.high) else "not observable"
    text = f"{c.value / size:.4g} ± {c.std / size:.1g}"
    return text + " (doubtful)" if c.status is Status.DOUBTFUL else text


def _blocks(found: Characterization, name: str, noise: SensorNoise) -> list[Block]:
    symbol, size = SHOWN[name]
    curves, spectra = found.curves[name], found.spectra[name]
    panels = [
        _deviation_panel(letter, curve, axis.coefficients, symbol, size)
        for letter, curve, axis in zip(AXES, curves, noise.axes, strict=True)
    ]
    return [
        _coefficient_table(noise, symbol, size),
        page.plot(
            grid_figure(panels, columns=3),
            "Overlapping Allan deviation with its 95 % interval; the fit in black, its terms as "
            "thin lines. A term that is not observable has no line.",
        ),
        page.beside(
            _readings_table(noise, found.readings[name], symbol, size),
            _statistics_table(noise, symbol, size),
        ),
        page.plot(
            _spectrum_figure(spectra, noise, symbol, size),
            "One-sided amplitude density, and the level of the white noise found, sqrt(2) N.",
        ),
    ]


def _deviation_panel(
    letter: str, curve: AllanDeviation, c: Coefficients, symbol: str, size: float
) -> Panel:
    """Return measured deviation, its band, the fit and the fit's terms."""
    tau = np.geomspace(curve.tau[0], curve.tau[-1], 80)
    items: list[Series | Band] = [
        Band(x=curve.tau, low=curve.low / size, high=curve.high / size, name="95 %")
    ]
    floor = 0.3 * float(curve.dev.min())
    for term in c:
        if term.status is Status.NOT_OBSERVABLE:
            continue
        level = line(term.symbol, abs(term.value), tau)
        shown = level > floor  # a line far below the curve would only stretch the axis
        items.append(
            Series(
                x=tau[shown],
                y=level[shown] / size,
                name=f"{term.symbol} {NAMES[term.symbol]}",
                color=_TERM_COLORS[term.symbol],
                kind="path",  # a line would break where logarithmic steps grow
                dash="dash" if term.observed else "dot",
            )
        )
    fitted = tau[tau >= c.tau_min]
    items.append(
        Series(
            x=fitted,
            y=c.deviation(fitted) / size,
            name="fit",
            color="#000",
            kind="path",
            width=1.6,
        )
    )
    items.append(
        Series(
            x=curve.tau,
            y=curve.dev / size,
            name="measured",
            color=ESTIMATE,
            kind="points",
            width=5.0,
        )
    )
    return Panel(
        x_label="averaging time [s]",
        y_label=f"{letter}: deviation [{symbol}]",
        items=items,
        height=300,
        log_x=True,
        log_y=True,
    )


def _spectrum_figure(
    spectra: Sequence[PowerDensity], noise: SensorNoise, symbol: str, size: float
) -> Figure:
    items: list[Series | Band] = []
    for k, (letter, spectrum) in enumerate(zip(AXES, spectra, strict=True)):
        rows = np.unique(
            np.round(np.geomspace(1, spectrum.f.size, _SPECTRUM_POINTS)).astype(np.int64) - 1
        )
        items.append(
            Series(
                x=spectrum.f[rows],
                y=spectrum.amplitude[rows] / size,
                name=letter,
                color=AXIS_COLORS[k],
                kind="path",
                width=1.0,
            )
        )
    for k, axis in enumerate(noise.axes):
        white = axis.coefficients.N
        if white.status is Status.NOT_OBSERVABLE:
            continue
        ends = spectra[k].f[[0, -1]]
        items.append(
            Series(
                x=ends,
                y=np.full(2, math.sqrt(2.0) * white.value / size),
                name="sqrt(2) N",
                color=REFERENCE if white.observed else MUTED,
                kind="path",
                dash="dash",
            )
        )
    return grid_figure(
        [
            Panel(
                x_label="frequency [Hz]",
                y_label=f"density [{symbol}/√Hz]",
                items=items,
                height=260,
                log_x=True,
                log_y=True,
            )
        ]
    )


# --- tables -----------------------------------------------------------------------------


def _coefficient_table(noise: SensorNoise, symbol: str, size: float) -> Block:
    heads = (
        "axis",
        f"N random walk [{symbol}/√Hz]",
        f"B bias instability [{symbol}]",
        f"K rate random walk [{symbol}·√Hz]",
        f"R rate ramp [{symbol}/s]",
        f"Q quantisation [{symbol}·s]",
        "fit off by",
        "from [s]",
    )
    rows = [
        (
            letter,
            *(cell(axis.coefficients[s], size) for s in "NBKRQ"),
            f"{100.0 * axis.coefficients.model_error:.1f} %",
            axis.coefficients.tau_min,
        )
        for letter, axis in zip(AXES, noise.axes, strict=True)
    ]
    return page.table(heads, rows, caption="Coefficients by maximum likelihood, ± 1 sigma")


def _readings_table(
    noise: SensorNoise, readings: Sequence[Coefficients], symbol: str, size: float
) -> Block:
    heads = ("axis", f"N [{symbol}/√Hz]", f"B [{symbol}]", f"K [{symbol}·√Hz]")
    rows = [
        (letter, *(cell(reading[s], size) for s in "NBK"))
        for letter, reading in zip(AXES, readings, strict=True)
    ]
    return page.table(heads, rows, caption="Read off the slopes; neighbouring terms add to B")


def _statistics_table(noise: SensorNoise, symbol: str, size: float) -> Block:
    heads = ("axis", f"mean [{symbol}]", "± 1 sigma", f"std [{symbol}]", f"variance [({symbol})²]")
    rows = [
        (
            letter,
            axis.mean / size,
            axis.mean_std / size,
            axis.std / size,
            float(noise.covariance[k, k]) / size**2,
        )
        for k, (letter, axis) in enumerate(zip(AXES, noise.axes, strict=True))
    ]
    return page.table(heads, rows, caption="At rest")


def _together(found: Characterization) -> Section:
    """Return the correlations of all channels at common times."""
    assert found.together is not None
    names = ["gyr", "acc", "mag"][: len(found.together.mean) // 3]
    channels = [f"{name} {letter}" for name in names for letter in AXES]
    std = np.where(found.together.std > 0.0, found.together.std, np.nan)
    correlation = found.together.covariance / np.outer(std, std)
    rows = [
        (name, *(float(value) for value in row))
        for name, row in zip(channels, correlation, strict=True)
    ]
    return Section(
        title="Between sensors",
        intro=f"Correlations of {found.together.n} samples at common times; chance alone reaches "
        f"{3.0 / math.sqrt(found.together.n):.2g}.",
        blocks=[page.table(("", *channels), rows, digits=2)],
    )


def _notes(found: Characterization) -> list[str]:
    """Return every remark on a number that is given, and on what was left out."""
    notes = []
    for name, noise in found.record.sensors.items():
        notes += [f"{name}: {remark}" for remark in noise.remarks]
        for letter, axis in zip(AXES, noise.axes, strict=True):
            notes += [
                f"{name} {letter}, {c.symbol} ({c.status.value}): {c.remark}"
                for c in axis.coefficients
                if c.remark and c.status is not Status.NOT_OBSERVABLE
            ]
    return notes
