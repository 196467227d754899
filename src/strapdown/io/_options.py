"""The options of `read`, as users type them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import InputError
from strapdown.io._roles import GROUP_NAMES, ROLES
from strapdown.units import Unit, parse_unit

Columns = Mapping[str, str | int] | str
Units = Mapping[str, str] | str
Axes = Mapping[str, str] | str

SENSOR_FILES: Final = ("imu", "gyr", "acc", "mag", "gnss", "baro", "temperature")
TURNED: Final = ("gyr", "acc", "mag")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What was asked for, parsed; `io.read` documents each.

    Attributes
    ----------
    columns : mapping of str
        Role to the name or number of a column.
    units : mapping of str to Unit
        By group or role.
    rate : float, optional
        Samples per second [Hz].
    repair_time : {'drop', 'sort'}, optional
    delimiter : str, optional
    files : mapping of str to Path
        One file per sensor.
    context : str, optional
        Group that a table without other hints belongs to.
    everything : bool
        Whether columns of unknown meaning are read too.
    """

    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)
    rate: float | None = None
    repair_time: str | None = None
    delimiter: str | None = None
    files: Mapping[str, Path] = field(default_factory=dict)
    context: str | None = None
    everything: bool = False

    def unit_of(self, role: str) -> Unit | None:
        """Return the unit that was stated for a role, or for its group."""
        place = ROLES[role]
        if role in self.units:
            return self.units[role]
        unit = self.units.get(place.group)
        return unit if unit is not None and unit.quantity == place.quantity else None


def parse_options(
    *,
    columns: Columns | None = None,
    units: Units | None = None,
    rate: float | None = None,
    repair_time: str | None = None,
    delimiter: str | None = None,
    files: Mapping[str, str | PathLike[str] | None] | None = None,
    everything: bool = False,
) -> Options:
    """Return the options, checked."""
    if repair_time is not None:
        _checks.one_of("repair_time", repair_time, ("drop", "sort"))
    if rate is not None:
        rate = _checks.positive("rate", rate)
    if delimiter is not None:
        delimiter = {"tab": "\t", "\\t": "\t", "space": " "}.get(delimiter, delimiter)
        if len(delimiter) != 1:
            raise ValueError(f"`delimiter` must be one character, got {delimiter!r}.")
    return Options(
        columns=_parse_columns(columns),
        units=_parse_units(units),
        rate=rate,
        repair_time=repair_time,
        delimiter=delimiter,
        files={name: Path(path) for name, path in (files or {}).items() if path is not None},
        everything=everything,
    )


def _pairs(name: str, text: Mapping[str, object] | str, separators: str) -> dict[str, str]:
    """Return ``key=value`` items of an option as a dictionary."""
    if not isinstance(text, str):
        return {str(key): str(value) for key, value in text.items()}
    for separator in separators[1:]:
        text = text.replace(separator, separators[0])
    out: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in text.split(separators[0]))):
        key, equals, value = item.partition("=")
        if not equals or not key.strip() or not value.strip():
            raise InputError(f"`{name}` must be written key=value, got {item!r}.")
        out[key.strip()] = value.strip()
    return out


def _parse_columns(columns: Columns | None) -> dict[str, str | int]:
    """Return role to column; integers count columns from 0."""
    out: dict[str, str | int] = {}
    if columns is None:
        return out
    items: Mapping[str, str | int] = (
        _pairs("columns", columns, ",") if isinstance(columns, str) else columns
    )
    for key, value in items.items():
        role = "t" if key == "time" else key
        if role not in ROLES:
            raise InputError(
                f"`columns` must name one of {', '.join(ROLES)}, got {key!r}"
                f"{_checks.nearest(key, ROLES)}."
            )
        out[role] = value
    return out


def _parse_units(units: Units | None) -> dict[str, Unit]:
    """Return group or role to unit."""
    out: dict[str, Unit] = {}
    for key, text in _pairs("units", units or {}, ",;").items():
        if key in GROUP_NAMES:
            group = GROUP_NAMES[key]
            quantity = next(r.quantity for r in ROLES.values() if r.group == group)
            out[group] = parse_unit(text, quantity)
        elif key in ROLES:
            out[key] = parse_unit(text, ROLES[key].quantity)
        else:
            choices = [*GROUP_NAMES, *ROLES]
            raise InputError(
                f"`units` must name a sensor ({', '.join(GROUP_NAMES)}) or a column such as "
                f"gyr_x or lat, got {key!r}{_checks.nearest(key, choices)}."
            )
    return out


def parse_axes(axes: Axes) -> dict[str, FloatArray]:
    """Return the turning of each sensor's axes, ``v_new = C @ v_file``.

    Parameters
    ----------
    axes : str or mapping
        ``"x,-y,-z"`` for the whole box, or by sensor, ``"mag=y,x,-z; gyr=x,-y,-z"``. Each
        item is the axis of the file that becomes the new x, y and z.

    Returns
    -------
    dict
        ``"box"``, or some of ``"gyr"``, ``"acc"``, ``"mag"``, to matrices of shape (3, 3).

    Raises
    ------
    InputError
        If it is not a signed permutation, or the whole box would be mirrored.
    """
    if isinstance(axes, str) and "=" not in axes:
        C = _signed_permutation(axes)
        if np.linalg.det(C) < 0.0:
            raise InputError(
                f"`axes` must keep the box right-handed, got {axes!r}, which mirrors it; "
                "if one sensor's axes are left-handed, give them by sensor: mag=" + axes + "."
            )
        return {"box": C}
    out: dict[str, FloatArray] = {}
    for key, text in _pairs("axes", axes, ";").items():
        if key == "imu":
            out["gyr"] = out["acc"] = _signed_permutation(text)
        elif key in TURNED:
            out[key] = _signed_permutation(text)
        else:
            raise InputError(
                f"`axes` must name imu, gyr, acc or mag, got {key!r}"
                f"{_checks.nearest(key, (*TURNED, 'imu'))}."
            )
    return out


def _signed_permutation(text: str) -> FloatArray:
    """Return the matrix of ``x,-y,-z``."""
    items = [item.strip().lower() for item in text.split(",")]
    C = np.zeros((3, 3))
    for row, item in enumerate(items[:3]):
        column = "xyz".find(item.lstrip("+-")) if len(item.lstrip("+-")) == 1 else -1
        if column >= 0 and len(item) <= 2:
            C[row, column] = -1.0 if item.startswith("-") else 1.0
    if len(items) != 3 or not math.isclose(abs(float(np.linalg.det(C))), 1.0):
        raise InputError(
            f"`axes` must name x, y and z once each, with signs, like x,-y,-z, got {text!r}."
        )
    return C
