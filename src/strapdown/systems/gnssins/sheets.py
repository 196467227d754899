"""Datasheets of the ADIS16350 and ADIS16405: what the simulated sensors give back.

The presets were made of the printed figures; each figure that a sensor model has is measured
here on simulated data: noise is identified, a range driven into its stop, a coefficient found
from two temperatures, a tolerance from 2000 parts. What no model has stands as information.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.navigation.grades import GYRO_GRADES, INS_GRADES, NMI_PER_HR, gyro_grade
from strapdown.noise import identify
from strapdown.sensors import (
    Datasheet,
    Digital,
    Figure,
    Gyro,
    Noise,
    Sampling,
    preset,
)
from strapdown.sensors.presets import ALLAN_FLOOR
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, info, simulated
from strapdown.systems.gnssins import catalogue
from strapdown.truth import Truth
from strapdown.units import DEG_PER_HR, DEG_PER_SQRT_HR

HOURS: Final = 4.0
NOISE_RATE: Final = 20.0  # densities do not depend on the rate [Hz]
PARTS_DRAWN: Final = 2000
EXACT: Final = Tolerance(relative=1e-9)
EXACT_REMARK: Final = "preset without noise; rounding"

# Why a figure has no number here; the first words that its quantity begins with count.
WHY: Final = {
    "bandwidth": "above half of the 200 Hz that were read out: left out of the preset",
    "output noise": "follows from density and bandwidth, and that is left out",
    "rate noise density": "the preset takes the random walk for it",
    "noise density": "the preset takes the random walk for it",
    "bias voltage sensitivity": "supply of 5.0 V: left out of the preset",
}

Key = tuple[str, str, str]  # sensor, quantity, word of the condition


class Measured(NamedTuple):
    """What a simulated sensor shows of one figure, in SI."""

    value: float
    tolerance: Tolerance
    remark: str


def run(seed: int) -> Shown:
    """Measure the presets, and show the grades of chapter 1.

    Parameters
    ----------
    seed : int
        Of the noise and of the parts drawn.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    for number, (name, table) in enumerate((("adis16350", "6.3.1"), ("adis16405", "table 1"))):
        rows += _device(name, table, np.random.default_rng([seed, number]))
    return Shown(rows=[*rows, *_grades(), *catalogue.rows()])


def _device(name: str, table: str, rng: np.random.Generator) -> list[Row]:
    """Return a row for each figure of a datasheet."""
    device: Any = preset(name)
    sheet: Datasheet = device.datasheet
    part = name.upper()
    found: dict[Key, Measured] = {}
    rows: list[Row] = []
    for sensor in ("gyr", "acc", "mag"):
        if (triad := getattr(device, sensor)) is not None:
            found |= dict(_triad(triad, sensor, sheet, part, rng))
            rows.append(_scale_limits(triad, sensor, sheet, f"{table}, {part}", rng))
    lsb = device.temperature.digital.lsb
    found["temperature", "scale factor", ""] = Measured(lsb, EXACT, "steps of the output")
    for figure in sheet.figures:
        item = f"{table}, {part} {_words(figure)}"
        measured = _measured(figure, found)
        if measured is not None:
            rows.append(_row(item, figure, measured))
        else:
            rows.append(info(item, _printed(figure), None, figure.unit, _why(figure, part)))
    return rows


def _measured(figure: Figure, found: dict[Key, Measured]) -> Measured | None:
    """Return what stands for a figure; a measured quantity stands for its first figure only."""
    for key in found:
        sensor, quantity, word = key
        if (sensor, quantity) == (figure.sensor, figure.quantity) and word in figure.condition:
            return found.pop(key)
    return None


def _why(figure: Figure, part: str) -> str:
    if figure.condition.startswith("ADIS") and figure.condition != part:
        return "of another type of the family"
    if figure.quantity == "sensitivity":
        return "of another range, see above"
    for words, reason in WHY.items():
        if figure.quantity.startswith(words):
            return reason
    return "not part of the sensor model"


def _words(figure: Figure) -> str:
    condition = f" ({figure.condition})" if figure.condition else ""
    return f"{figure.sensor} {figure.quantity}{condition}"


def _printed(figure: Figure) -> float | str | None:
    """Return the figure as printed: the typical value, or its limits."""
    limits = [v for v in (figure.least, figure.typical, figure.most) if v is not None]
    if len(limits) == 1:
        return limits[0]
    return ", ".join(f"{v:g}" for v in limits) or None


def _row(item: str, figure: Figure, measured: Measured) -> Row:
    """Return the row of a figure that was measured, in the printed unit."""
    order = (figure.typical, figure.most, figure.least)
    given = next(v for v in order if v is not None)
    unit = figure.value / given
    least_counts = measured.tolerance.bound == "at least" and figure.least is not None
    printed = figure.least if least_counts else given
    tolerance = replace(measured.tolerance, absolute=measured.tolerance.absolute / unit)
    return simulated(item, float(printed or 0.0), measured.value / unit, figure.unit, tolerance,
                     measured.remark)  # fmt: skip


# --- what is measured -------------------------------------------------------------------


def _triad(
    triad: Any, sensor: str, sheet: Datasheet, part: str, rng: np.random.Generator
) -> Iterator[tuple[Key, Measured]]:
    """Yield what a triad shows of its figures."""
    yield from _noise(triad, sensor, sheet, rng)
    conditions = {f.condition for f in sheet.figures if f.sensor == sensor}
    own = part if part in conditions else ""
    bare = replace(triad, noise=Noise(), digital=Digital(), sampling=Sampling())
    plain = replace(bare, linear=type(bare.linear)())
    size = {"gyr": 1.0, "acc": G0, "mag": 4e-5}[sensor]
    cold, warm = (_output(plain, sensor, size, degc) for degc in (25.0, 35.0))
    zero = _output(plain, sensor, 0.0, 35.0)
    yield (sensor, "bias temperature coefficient", own), Measured(zero / 10.0, EXACT, EXACT_REMARK)
    yield (
        (sensor, "sensitivity temperature coefficient", own),
        Measured((warm - zero - cold) / (10.0 * size), EXACT, EXACT_REMARK),
    )
    digital: Digital = triad.digital
    steps = np.unique(digital.apply(np.linspace(0.0, 50.0 * digital.lsb, 5001)))
    step = float(np.median(np.diff(steps)))
    yield (sensor, "sensitivity", ""), Measured(step, EXACT, "steps of the output; rounding")
    stop = float(digital.apply(3.0 * digital.full_scale))
    yield (
        (sensor, "dynamic range", ""),
        Measured(
            stop,
            Tolerance(absolute=digital.lsb, bound="at least"),
            "driven into its stop; one count",
        ),
    )
    if sensor == "gyr":
        yield (sensor, "linear acceleration effect", ""), _g_effect(plain)
    yield from _spread(triad, sensor, sheet, rng)


def _truth(sensor: str, x: FloatArray, f_b: FloatArray | None = None) -> Truth:
    """Return a motion in which a sensor sees these inputs, attitude being the identity."""
    zero = np.zeros((len(x), 3))
    seen = {"gyr": "omega_ib_b", "acc": "f_b", "mag": "m_n"}[sensor]
    arrays: dict[str, Any] = {"omega_ib_b": zero, "f_b": zero, "m_n": zero, seen: x}
    if f_b is not None:
        arrays["f_b"] = f_b
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (len(x), 1))
    return Truth(t=np.arange(len(x)) / 100.0, q_nb=q_nb, lla=zero, v_n=zero, **arrays)


def _output(triad: Any, sensor: str, x: float, degc: float) -> float:
    """Return the x axis of a triad without noise at a constant input on all axes."""
    truth = _truth(sensor, np.full((2, 3), x))
    out = triad.apply(truth, np.random.default_rng(0), temp_degc=degc)
    return float((out.mag if sensor == "mag" else out.value)[0, 0])


def _g_effect(plain: Gyro) -> Measured:
    truth = _truth("gyr", np.zeros((2, 3)), np.full((2, 3), 1.0))
    out = plain.apply(truth, np.random.default_rng(0)).value[0, 0]
    return Measured(float(out), EXACT, "bias per force along the axis; rounding")


def _noise(
    triad: Any, sensor: str, sheet: Datasheet, rng: np.random.Generator
) -> Iterator[tuple[Key, Measured]]:
    """Yield the coefficients identified from four hours at rest."""
    n = round(HOURS * 3600.0 * NOISE_RATE)
    y = triad.noise.sample(n, 1.0 / NOISE_RATE, rng, width=1)[:, 0]
    found = identify(y, NOISE_RATE)
    names = {figure.quantity for figure in sheet.figures if figure.sensor == sensor}
    for quantity, symbol, factor in (
        ("angular random walk", "N", 1.0),
        ("velocity random walk", "N", 1.0),
        ("noise density", "N", 1.0),
        ("in-run bias stability", "B", ALLAN_FLOOR),
    ):
        if quantity not in names or (
            quantity == "noise density" and "velocity random walk" in names
        ):
            continue
        c = found[symbol]
        half = factor * max(c.high - c.value, c.value - c.low)
        if math.isfinite(half):
            remark = f"{HOURS:g} h at rest, identified; 95 % interval, left in one of twenty seeds"
            yield (
                (sensor, quantity, ""),
                Measured(factor * c.value, Tolerance(absolute=half), remark),
            )


def _scale_limits(
    triad: Any, sensor: str, sheet: Datasheet, where: str, rng: np.random.Generator
) -> Row:
    """Return the row of the limits of the sensitivity, least and most."""
    figure = sheet.find(sensor, "sensitivity")[0]
    least, typical, most = (float(v or 0.0) for v in (figure.least, figure.typical, figure.most))
    tolerance = 100.0 * max(typical - least, most - typical) / typical
    nominal = replace(triad, linear=type(triad.linear)())
    scales = [np.diag(nominal.individual(rng).linear.matrix) for _ in range(PARTS_DRAWN)]
    return simulated(
        f"{where} {sensor} sensitivity, {least:g} to {most:g}, largest deviation", tolerance,
        100.0 * float(np.abs(np.array(scales) - 1.0).max()), "%", Tolerance(relative=0.02),
        f"largest of {PARTS_DRAWN} parts, drawn evenly",
    )  # fmt: skip


def _spread(
    triad: Any, sensor: str, sheet: Datasheet, rng: np.random.Generator
) -> Iterator[tuple[Key, Measured]]:
    """Yield what 2000 parts show of tolerances: each is its largest deviation."""
    nominal = replace(triad, linear=type(triad.linear)())
    parts = [nominal.individual(rng).linear for _ in range(PARTS_DRAWN)]
    matrices = np.array([linear.matrix for linear in parts])
    rows = matrices / np.linalg.norm(matrices, axis=2, keepdims=True)
    off = np.abs(rows[:, ~np.eye(3, dtype=bool)]).max()
    between = np.abs(np.einsum("kij,klj->kil", rows, rows)[:, ~np.eye(3, dtype=bool)]).max()
    most = f"largest of {PARTS_DRAWN} parts, drawn evenly"
    reach = Tolerance(relative=0.02)
    frame = "frame" if sensor != "mag" and sheet.name == "adis16405" else ""
    yield (sensor, "misalignment", frame), Measured(float(off), reach, most)
    apart = Measured(float(between), reach, most)
    yield (sensor, "misalignment", "axis to axis"), apart
    yield (sensor, "axis non-orthogonality", ""), apart
    quadratic = np.array([linear.quadratic for linear in parts])
    bend = 0.5 * np.abs(quadratic).max() * triad.digital.full_scale
    yield (sensor, "non-linearity", ""), Measured(float(bend), reach, most + "; of full scale")
    biases = np.array([linear.bias for linear in parts])
    std = float(biases.std())
    share = 4.0 / math.sqrt(2.0 * biases.size)
    for quantity in ("initial bias error", "zero-g offset"):
        yield (
            (sensor, quantity, ""),
            Measured(std, Tolerance(relative=share), f"std over {PARTS_DRAWN} parts; 4 sigma"),
        )


# --- grades -----------------------------------------------------------------------------


def _grades() -> list[Row]:
    """Return the rows of tables 1.1 and 1.2, and of where the sensors of the thesis stand."""
    rows = [
        info(f"table 1.1, {name}, {what}", value, grade, unit,
             "`strapdown.navigation.grades`; a classification, nothing is computed")
        for name, entry in INS_GRADES.items()
        for what, value, grade, unit in (
            ("CEP rate", {"high": 0.1, "medium": 1.0, "low": 10.0}[name],
             entry.cep_rate / NMI_PER_HR, "nmi/h"),
            ("gyros", {"high": 1e-3, "medium": 1e-2, "low": 1e-1}[name],
             entry.gyr_bias / DEG_PER_HR, "deg/h"),
            ("accelerometers", {"high": 1e-7, "medium": 1e-6, "low": 1e-5}[name],
             entry.acc_bias / G0, "g"),
        )
    ]  # fmt: skip
    for name, grade in GYRO_GRADES.items():
        for what, pair, unit, size in (
            ("max input", grade.max_input, "deg/h", DEG_PER_HR),
            ("scale factor", grade.scale_error, "1", 1.0),
            ("bias stability", grade.bias_stability, "deg/h", DEG_PER_HR),
            ("bias drift", grade.bias_drift, "deg/sqrt(h)", DEG_PER_SQRT_HR),
        ):
            rows.append(info(f"table 1.2, {name}, {what}", _PRINTED[name, what],
                             f"{pair[0] / size:.0e} to {pair[1] / size:.0e}", unit,
                             "a classification, nothing is computed"))  # fmt: skip
    for name in ("adis16350", "adis16405"):
        stability = preset(name).datasheet.value("gyr", "in-run bias stability")  # type: ignore[union-attr]
        rows.append(info(f"table 1.2, grade of the {name.upper()}", None,
                         gyro_grade(stability) or "worse than moderate", "",
                         f"in-run bias stability {stability / DEG_PER_HR:.0f} deg/h"))  # fmt: skip
    return rows


_PRINTED: Final = {
    ("inertial", "max input"): "10^2 - 10^6",
    ("inertial", "scale factor"): "10^-6 - 10^-4",
    ("inertial", "bias stability"): "10^-4 - 10^-2",
    ("inertial", "bias drift"): "10^-4 - 10^-3",
    ("intermediate", "max input"): "10^2 - 10^6",
    ("intermediate", "scale factor"): "10^-4 - 10^-3",
    ("intermediate", "bias stability"): "10^-2 - 10",
    ("intermediate", "bias drift"): "10^-2 - 10^-1",
    ("moderate", "max input"): "10^2 - 10^6",
    ("moderate", "scale factor"): "10^-3 - 10^-2",
    ("moderate", "bias stability"): "10 - 10^2",
    ("moderate", "bias drift"): "1 - 10",
}

PART: Final = Part(
    name="sheets",
    title="Datasheets of ADIS16350 and ADIS16405 on simulated sensors; grades, catalogue",
    source="1.3.3, 1.5.3, 4.1 to 4.5, 6.3.1; items 1, 2, F10, F42 to F44",
    run=run,
)
