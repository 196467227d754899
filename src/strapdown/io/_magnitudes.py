"""Whether numbers without a unit can be what they are taken for."""

from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.io._raw import Column, Finding, Table
from strapdown.units import units_of

_ENOUGH: Final = 100_000  # samples that are looked at, evenly spread


class Range(NamedTuple):
    """Sizes in SI that a sensor can show, and the units tried when it shows others."""

    quantile: float
    low: float
    high: float
    units: tuple[str, ...]


# The norm's quantile of a log must lie in the range. Gyroscopes: 2000 deg/s is the end of what
# most MEMS sensors measure; a log in deg/s that never exceeds 36 passes, its size says nothing.
# Accelerometers: gravity is in the median of every log on the ground. The Earth's field is 22 to
# 67 uT; magnets nearby make ten times that.
RANGES: Final = {
    "gyr": Range(0.998, 0.0, 36.0, ("dps", "mdps")),
    "acc": Range(0.5, 4.0, 30.0, ("g", "mg", "cm_s2")),
    "mag": Range(0.5, 1e-6, 1e-3, ("ut", "mgauss", "nt", "gauss")),
    "baro": Range(0.5, 1e4, 1.2e5, ("hpa", "kpa", "bar")),
    "temperature": Range(0.5, -90.0, 130.0, ("k",)),
}
# Narrower, to choose the unit that is offered: what it is without magnets or falls.
_USUAL: Final = {
    "gyr": (0.02, 36.0),
    "acc": (8.0, 12.0),
    "mag": (1.5e-5, 1e-4),
    "baro": (3e4, 1.1e5),
    "temperature": (-40.0, 85.0),
}


def check_magnitude(group: str, columns: list[Column], table: Table) -> Finding | None:
    """Return a note that columns without unit are read in SI, or the fault that they cannot be.

    Parameters
    ----------
    group : str
        Key of `RANGES`; other groups get the note.
    columns : list of Column
        Columns of the group, none of which states a unit.
    table : Table
        For the message.
    """
    names = ", ".join(repr(c.name) for c in columns)
    quantity = {
        "gyr": "angular_rate",
        "acc": "acceleration",
        "mag": "magnetic_field",
        "baro": "pressure",
        "temperature": "temperature",
    }[group]
    si = units_of(quantity)[0]
    step = max(len(columns[0].values) // _ENOUGH, 1)
    values = np.stack([np.asarray(c.values[::step], dtype=np.float64) for c in columns], axis=1)
    size = values[:, 0] if values.shape[1] == 1 else np.sqrt((values * values).sum(axis=1))
    size = size[np.isfinite(size) & (size != 0.0)]
    expected = RANGES[group]
    if not len(size):
        return None
    typical = float(np.quantile(size, expected.quantile))
    if expected.low <= typical <= expected.high:
        what = f"{names} state no unit and are read in {si.symbol}"
        return Finding(kind="unit", what=what, file=table.file, stream=group)
    low, high = _USUAL[group]
    fits = [
        u
        for name in expected.units
        for u in units_of(quantity)
        if u.name == name and low <= float(u.to_si(typical)) <= high
    ]
    counts = bool((values[np.isfinite(values)] % 1.0 == 0.0).all()) and group in RANGES
    if group == "acc" and typical < expected.low and not fits:
        hint = "specific force must contain gravity; if the log is as it should be, say "
        hint += '--units acc=m_s2 (units="acc=m_s2")'
    elif fits:
        # mg and cm/s^2 differ by 2 %: both are said, the nearer to gravity first
        fits.sort(key=lambda u: abs(float(u.to_si(typical)) - G0) if group == "acc" else 0.0)
        name = f"{group}={fits[0].name}"
        looks = " or ".join(u.symbol for u in fits)
        also = "".join(f", or {group}={u.name}" for u in fits[1:])
        hint = f'they look like {looks}: state it with --units {name} (units="{name}"){also}'
    else:
        name = f"{group}={expected.units[0]}"
        looks = "they look like raw counts: scale them, or " if counts else ""
        hint = f'{looks}state the unit with --units, such as --units {name} (units="{name}")'
    word = "peak" if expected.quantile > 0.9 else "typical"
    return Finding(
        kind="unit",
        what=f"{names} state no unit and cannot be in {si.symbol}, the {word} size is "
        f"{typical:.4g}",
        fault=True,
        file=table.file,
        stream=group,
        hint=hint,
    )


def degrees_or_e7(latitude: FloatArray, longitude: FloatArray) -> str:
    """Return the unit of positions that state none: whole numbers beyond 360 are 1e-7 deg."""
    size = max(_largest(latitude), _largest(longitude))
    return "deg_1e7" if size > 720.0 else "deg"


def _largest(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else 0.0
