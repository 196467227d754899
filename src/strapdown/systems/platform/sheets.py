"""Tables 5.4, 5.6, 6.1 and figure 5.13: measured noise beside the makers', counts and units."""

import math
from typing import Final

import numpy as np

from strapdown.constants import G0
from strapdown.noise import Agreement, Comparison, Figure, compare, identify
from strapdown.sensors import Device, preset
from strapdown.systems._parts import Part
from strapdown.systems._rows import (
    Row,
    Shown,
    Tolerance,
    Verdict,
    compared,
    info,
    not_given,
)
from strapdown.systems.platform.allan import AXES, TABLES, Table, at_rest
from strapdown.units import DPS, GAUSS, MILLIGAUSS, UG

DLPF_188_HZ: Final = 188.0
FIGURE_5_13_MG: Final = (1.1, 2.25)
TABLE_5_4: Final = {"rms": 0.050, "low-frequency rms": 0.033, "density": 0.005}  # deg/s, /√Hz
TABLE_5_6_UG: Final = 400.0
# Declared scale factors, table 6.1: counts per unit.
COUNTS: Final = (
    ("mpu6050", "gyr", 131.0, "LSB/(deg/s)", DPS),
    ("mpu6050", "acc", 16384.0, "LSB/g", G0),
    ("hmc5883l", "mag", 1090.0, "LSB/G", GAUSS),
)
# Standard deviations of the samples derived from the printed N.
SIGMA: Final = {
    "gyr": (0.0787, 0.0928, 0.0739),
    "acc": (2.43, 2.69, 3.92),
    "mag": (1.35, 1.28, 1.33),
}
_SHOWN: Final = {"gyr": (1.0, "deg/s", 1e-4), "acc": (1e3, "mg", 0.01), "mag": (1e3, "mG", 0.01)}


def run(seed: int) -> Shown:
    """Compare the printed noise with the makers' figures, and counts with the presets.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    for table in TABLES:
        rows += [sigma_row(table, axis) for axis in range(3)]
    rows += _makers(seed)
    for name, sensor, counts, unit, size in COUNTS:
        lsb = getattr(preset(name), sensor).digital.lsb
        rows.append(
            compared(f"table 6.1, scale factor, {sensor}", counts, size / lsb, unit,
                     Tolerance(relative=1e-12), "rounding of the division")
        )  # fmt: skip
    rows += [
        _counts_and_back(preset(name), sensor, counts) for name, sensor, counts, _, _ in COUNTS
    ]
    return Shown(rows=rows)


def sigma_row(table: Table, axis: int) -> Row:
    """Return (5.10), the deviation of the samples that the printed N makes.

    Parameters
    ----------
    table : Table
        Where N is printed.
    axis : int
        Which axis.

    Returns
    -------
    Row
    """
    size, unit, digit = _SHOWN[table.sensor]
    N = table.printed[axis][0]
    assert N is not None
    return compared(
        f"(5.10), sigma_w of {table.sensor} {AXES[axis]} at {table.rate:g} Hz",
        SIGMA[table.sensor][axis], size * N * math.sqrt(table.rate), unit,
        Tolerance(absolute=0.5 * digit), "derived from the table; last digit",
    )  # fmt: skip


def _makers(seed: int) -> list[Row]:
    """Return the comparison with tables 5.4, 5.6 and figure 5.13, axis by axis."""
    rows = []
    for number, table in enumerate(TABLES):
        noise = getattr(preset("hmc5883l" if table.sensor == "mag" else "mpu6050"), table.sensor)
        for axis in range(3):
            rng = np.random.default_rng([seed, 3, number, axis])
            y = at_rest(noise.noise, axis, table.rate, rng, hours=0.5)
            found = identify(y, table.rate)
            figures = _figures(table.sensor)
            std = float(np.std(np.diff(y)) / math.sqrt(2.0))  # of the white noise alone
            bandwidth = DLPF_188_HZ if table.sensor == "gyr" else None
            for label, comparison in zip(
                _labels(table.sensor),
                compare(found, figures, std=std, bandwidth_hz=bandwidth),
                strict=True,
            ):
                rows.append(maker_row(f"{label}, {table.sensor} {AXES[axis]}", table, comparison))
    rows.append(
        info(
            "table 5.4, low-frequency noise, 1 to 10 Hz", TABLE_5_4["low-frequency rms"], None,
            "deg/s",
            "the thesis measures no noise of this band; N alone over 9 Hz makes "
            f"{_low_frequency():.3f} deg/s",
        )
    )  # fmt: skip
    return rows


def _low_frequency() -> float:
    """Return what the largest N makes of white noise from 1 to 10 Hz [deg/s]."""
    N = max(row[0] or 0.0 for row in TABLES[0].printed)
    return N * math.sqrt(2.0 * 9.0)


def _labels(sensor: str) -> tuple[str, ...]:
    return {
        "gyr": ("table 5.4, total noise", "table 5.4, density at 10 Hz"),
        "acc": ("table 5.6, density at 10 Hz",),
        "mag": ("figure 5.13, noise",),
    }[sensor]


def _figures(sensor: str) -> tuple[Figure, ...]:
    if sensor == "gyr":
        return (
            Figure(kind="rms", value=TABLE_5_4["rms"] * DPS),
            Figure(kind="density", value=TABLE_5_4["density"] * DPS),
        )
    if sensor == "acc":
        return (Figure(kind="density", value=TABLE_5_6_UG * UG),)
    low, high = FIGURE_5_13_MG
    return (Figure(kind="rms", value=low * MILLIGAUSS, upper=high * MILLIGAUSS),)


def maker_row(item: str, table: Table, found: Comparison) -> Row:
    """Return the row of one figure of a datasheet.

    Parameters
    ----------
    item : str
        What it is called.
    table : Table
        Of the sensor.
    found : Comparison
        The figure and what was measured.

    Returns
    -------
    Row
    """
    size, unit, _ = _SHOWN[table.sensor]
    scale = size / table.size
    printed, measured = found.figure.value * scale, found.measured * scale
    if found.figure.kind == "density":
        unit += "/√Hz"
    agreed = found.agreement is Agreement.IN_LINE
    thesis: float | str = printed
    if found.figure.upper is not None:
        thesis = f"{printed:g} to {found.figure.upper * scale:g}"
    return Row(
        item=item, thesis=thesis, here=measured, unit=unit,
        tolerance="factor of 2" if found.figure.upper is None else "in the range",
        verdict=Verdict.RECOVERED if agreed else Verdict.MISSED,
        remark="; ".join(("in line, as the thesis says of the noise simulated here",
                          *([found.remark] if found.remark else []))),
    )  # fmt: skip


def _counts_and_back(device: Device, sensor: str, counts: float) -> Row:
    """Return how far a signal over the range is from itself after counts and back."""
    digital = getattr(device, sensor).digital
    x = np.linspace(-0.99, 0.99, 1001) * min(digital.full_scale, 2000 * digital.lsb)
    error = float(np.abs(digital.from_counts(digital.counts(x)) - x).max() / digital.lsb)
    return not_given(
        f"checklist 30, {sensor}: to counts of {counts:g} and back", error, "LSB",
        "largest difference; half a count is rounding",
    )  # fmt: skip


PART = Part(
    name="datasheets",
    title="Makers' figures: tables 5.4, 5.6, 6.1, figure 5.13",
    source="4.4, 4.5, 5.3.2 to 5.3.4",
    run=run,
)
