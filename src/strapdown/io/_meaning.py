"""What the columns of a table mean: by option, by name, by the program that wrote it."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from strapdown import _checks
from strapdown.errors import FormatError
from strapdown.io._headers import Meaning, recognise_all
from strapdown.io._options import Options
from strapdown.io._raw import Finding
from strapdown.io._roles import ROLES
from strapdown.units import parse_unit, units_of

# Units of programs that state none in their headers, recognised by names that only they use.
_DIALECTS: Final[tuple[tuple[str, str, dict[str, str]], ...]] = (
    (
        "PX4",
        r"gyro_rad\[0\]|accelerometer_m_s2\[0\]|magnetometer_ga\[0\]|timestamp_sample",
        {"time": "us"},
    ),
    ("MAVLink", r"time_boot_ms|time_usec", {"gyr": "mrad_s", "acc": "mg", "mag": "mgauss"}),
    ("ArduPilot", r"TimeUS", {"gyr": "rad_s", "acc": "m_s2", "mag": "mgauss"}),
    ("Sensor Logger", r"seconds_elapsed", {"mag": "ut", "baro": "hpa"}),
)


def meanings_of(
    path: Path, names: Sequence[str], options: Options, findings: list[Finding]
) -> list[Meaning]:
    """Return what each column means; its unit is the user's, the header's, or the program's.

    Parameters
    ----------
    path : Path
        For messages.
    names : sequence of str
        Names of the columns, empty where the file gives none.
    options : Options
        The options `columns` and `units` outrank everything.
    findings : list of Finding
        Where notes and faults go.

    Raises
    ------
    FormatError
        If `columns` names one that is not there.
    """
    meanings = recognise_all(names, context=options.context)
    for role, column in options.columns.items():
        k = _column_number(path, names, role, column)
        meanings = [Meaning() if m.role == role or j == k else m for j, m in enumerate(meanings)]
        unit = recognise_all([names[k]], context=options.context)[0].unit
        fits = unit is not None and unit.quantity == ROLES[role].quantity
        meanings[k] = Meaning(role, unit if fits else None)
    dialect = next(
        (
            (program, units)
            for program, pattern, units in _DIALECTS
            if any(re.fullmatch(pattern, name) for name in names)
        ),
        ("", {}),
    )
    noted: list[Finding] = []
    out = [
        _with_unit(path, name, meaning, options, dialect, noted)
        for name, meaning in zip(names, meanings, strict=True)
    ]
    findings += list(dict.fromkeys(noted))
    return out


def _column_number(path: Path, names: Sequence[str], role: str, column: str | int) -> int:
    """Return the number of the column that the option `columns` names."""
    if isinstance(column, int) or (column not in names and column.isdigit()):
        k = int(column)
        if 0 <= k < len(names):
            return k
        raise FormatError(
            f"`columns` asks for column {k} as {role}, the file has columns 0 to {len(names) - 1}",
            file=path,
        )
    if column in names:
        return list(names).index(column)
    raise FormatError(
        f"`columns` asks for {column!r} as {role}, the file has {', '.join(names)}"
        f"{_checks.nearest(column, names)}",
        file=path,
    )


def _with_unit(
    path: Path,
    name: str,
    meaning: Meaning,
    options: Options,
    dialect: tuple[str, dict[str, str]],
    findings: list[Finding],
) -> Meaning:
    """Return the meaning with the unit that counts: the user's, the header's, the program's."""
    role = meaning.role
    if role is None:
        return meaning
    stated = options.unit_of(role)
    if stated is not None:
        if meaning.unit is not None and meaning.unit != stated:
            what = f"{name!r} is read in {stated.symbol} as asked, though its name says "
            findings.append(Finding(kind="unit", what=what + meaning.unit.symbol, file=str(path)))
        return Meaning(role, stated)
    if meaning.strange_unit is not None:
        place = ROLES[role]
        if place.group not in ("time", "gyr", "acc", "mag", "baro", "temperature"):
            return Meaning()
        findings.append(
            Finding(
                kind="unit",
                what=f"{name!r} is in {meaning.strange_unit!r}, which is no unit of "
                f"{place.quantity.replace('_', ' ')}",
                fault=True,
                file=str(path),
                hint=_units_hint(place.group, units_of(place.quantity)[0].name),
            )
        )
        return Meaning(role)
    program, units = dialect
    text = units.get(ROLES[role].group)
    if meaning.unit is None and text is not None:
        unit = parse_unit(text, ROLES[role].quantity)
        findings.append(
            Finding(
                kind="unit",
                what=f"{ROLES[role].group} is read in {unit.symbol}, as {program} writes it",
                file=str(path),
            )
        )
        return Meaning(role, unit)
    return meaning


def _units_hint(group: str, unit: str) -> str:
    """Return the way out that names the option."""
    return f'state the unit with --units {group}={unit} (units="{group}={unit}")'
