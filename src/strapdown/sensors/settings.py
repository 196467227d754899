"""Tables of a TOML file as parameters: units in the names, unknown names refused.

A field that measures something says so in its type, ``rest: Annotated[float, Quantity("time")]``;
in a table its name carries a unit: ``rest_s``, or ``rest_min``. A field that is itself a
dataclass is a table within the table.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar, get_type_hints

from strapdown import _checks
from strapdown.errors import InputError
from strapdown.units import DEG, DPS, GAUSS, MG, QUANTITIES, UT, units_of

Made = TypeVar("Made")

# Units that no column of a log has: of derivatives and of random walks.
_MORE_UNITS: Mapping[str, Mapping[str, float]] = {
    "angular_acceleration": {"rad_s2": 1.0, "dps2": DEG},
    "angular_rate_walk": {"rad_s_sqrt_hz": 1.0, "dps_sqrt_hz": DPS},
    "acceleration_walk": {"m_s2_sqrt_hz": 1.0, "mg_sqrt_hz": MG},
    "magnetic_field_walk": {"t_sqrt_hz": 1.0, "ut_sqrt_hz": UT, "gauss_sqrt_hz": GAUSS},
}


class Quantity(NamedTuple):
    """What a field measures, as the metadata of an `Annotated` type.

    Attributes
    ----------
    name : str
        Quantity, as `strapdown.units` names it. ``@value``, ``@density`` and ``@walk`` stand for
        what the sensor measures, its noise density and its random walk.
    scaled : tuple of bool, optional
        In rows of several numbers, which of them the unit belongs to; all by default.
    """

    name: str
    scaled: tuple[bool, ...] | None = None


def from_table(base: Made, table: Mapping[str, Any], place: str, measures: str = "") -> Made:
    """Return a dataclass with the values that a table gives.

    Parameters
    ----------
    base : dataclass instance
        What the table changes; what it leaves out stays.
    table : mapping
        Keys with units, values as TOML has them.
    place : str
        File and table, for messages.
    measures : str
        Quantity that the sensor measures, for ``@value`` and its like.

    Returns
    -------
    object of the type of `base`

    Raises
    ------
    InputError
        If a key is unknown (with the nearest name), or a value is refused.
    """
    values: dict[str, Any] = {}
    known = keys(type(base), measures)
    for key, value in table.items():
        if key not in known:
            raise InputError(
                f"{place}: unknown key {key!r}{_checks.nearest(key, known)}; "
                f"known are {_listed(known)}."
            )
        entry = known[key]
        if entry.field in values:
            raise InputError(f"{place}: {key!r} is given twice, in different units.")
        old = getattr(base, entry.field)
        if dataclasses.is_dataclass(old) and not isinstance(old, type):
            if not isinstance(value, Mapping):
                raise InputError(f"{place}: {key!r} must be a table, got {value!r}.")
            values[entry.field] = from_table(old, value, f"{place}.{key}", measures)
        else:
            values[entry.field] = _converted(value, entry, f"{place}, {key}")
    try:
        changed: Made = dataclasses.replace(base, **values)  # type: ignore[type-var]
    except (ValueError, TypeError) as error:
        raise InputError(f"{place}: {error}") from error
    return changed


class Entry(NamedTuple):
    """What a key of a table stands for: field, and the way to SI."""

    field: str
    factor: float = 1.0
    offset: float = 0.0
    scaled: tuple[bool, ...] | None = None


def keys(kind: type[Any], measures: str = "") -> dict[str, Entry]:
    """Return the keys that a table of a dataclass may hold, each with what it stands for."""
    found: dict[str, Entry] = {}
    hints = get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        extras = getattr(hints[field.name], "__metadata__", ())
        quantity = next((e for e in extras if isinstance(e, Quantity)), None)
        if quantity is None:
            found[field.name] = Entry(field.name)
            continue
        for suffix, factor, offset in _units(quantity.name, measures):
            entry = Entry(field.name, factor, offset, quantity.scaled)
            found[f"{field.name}_{suffix}"] = entry
    return found


def _units(name: str, measures: str) -> list[tuple[str, float, float]]:
    """Return suffix, factor and offset of the units of a quantity."""
    derived = {"@value": "", "@density": "_density", "@walk": "_walk"}
    if name in derived:
        name = measures + derived[name]
    if name in QUANTITIES:
        return [(unit.name, unit.factor, unit.offset) for unit in units_of(name)]
    if name in _MORE_UNITS:
        return [(suffix, factor, 0.0) for suffix, factor in _MORE_UNITS[name].items()]
    return [("si", 1.0, 0.0)]  # such as the density of a pressure, which has no units here


def _listed(known: Mapping[str, Entry]) -> str:
    """Return the keys for a message: of each field the first two."""
    shown: dict[str, list[str]] = {}
    for key, entry in known.items():
        shown.setdefault(entry.field, []).append(key)
    return ", ".join(" or ".join(names[:2]) for names in shown.values())


def _converted(value: Any, entry: Entry, place: str) -> Any:
    """Return a value of a table in SI; lists become tuples."""
    if isinstance(value, list):
        if entry.scaled is not None and value and not isinstance(value[0], list):
            if len(value) != len(entry.scaled):
                raise InputError(
                    f"{place}: a row must hold {len(entry.scaled)} numbers, got {value}."
                )
            plain = Entry(entry.field)
            return tuple(
                _converted(item, entry._replace(scaled=None) if own else plain, place)
                for item, own in zip(value, entry.scaled, strict=True)
            )
        return tuple(_converted(item, entry, place) for item in value)
    if entry.factor == 1.0 and entry.offset == 0.0:
        return value
    if isinstance(value, (bool, str)) or not isinstance(value, (int, float)):
        raise InputError(f"{place}: must be a number, got {value!r}.")
    if isinstance(value, int) and abs(value) >= 2**63:
        raise InputError(f"{place}: must be a number of at most 64 bits, got one of more digits.")
    return value * entry.factor + entry.offset
