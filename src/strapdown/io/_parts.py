"""Which rows of a table belong to which sensor, and whether they are sound.

A combined log may hold sensors of different rates in one table: cells are empty where a sensor
has no sample, or its last value is repeated. Each sensor becomes a part with rows of its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from strapdown._types import BoolArray, FloatArray
from strapdown.io._clock import advancing, axis_of, common_origin
from strapdown.io._headers import missing_parts
from strapdown.io._magnitudes import RANGES, check_magnitude, degrees_or_e7
from strapdown.io._options import Options
from strapdown.io._raw import Column, Finding, RawLog, Table
from strapdown.io._roles import NEEDED, ROLES
from strapdown.units import parse_unit

IMU_GROUPS: Final = ("gyr", "acc")


@dataclass(slots=True, kw_only=True)
class Part:
    """One sensor's samples in a table.

    Attributes
    ----------
    group : str
        Sensor, a group of `ROLES`.
    table : Table
        Where the columns are.
    t : ndarray, shape (n,)
        Times of its samples [s].
    rows : ndarray of int, shape (n,), or None
        Its rows; None for all.
    columns : dict
        By role.
    """

    group: str
    table: Table
    t: FloatArray
    rows: NDArray[np.int64] | None
    columns: dict[str, Column]


def split(raw: RawLog, options: Options) -> tuple[list[Part], int | None]:
    """Return the sensors of a log and the date of ``t = 0``; findings go to ``raw.findings``.

    Returns
    -------
    list of Part
        In the order of the tables.
    int or None
        ns after 1970, None without dates.
    """
    axes, tables = [], []
    for table in raw.tables:
        if len(table) and any(c.role not in (None, "t") for c in table.columns):
            axis = axis_of(table, options.rate, options.repair_time, raw.findings)
            if axis is not None:
                axes.append(axis)
                tables.append(table)
    origin = common_origin(axes, raw.findings, raw.file)
    parts: list[Part] = []
    for table, axis in zip(tables, axes, strict=True):
        parts += _parts_of(table, axis.t, options, raw.findings)
    if not parts and not any(raw.faults()):
        raw.findings.append(_nothing_known(raw))
    return parts, origin


def _nothing_known(raw: RawLog) -> Finding:
    """Return the fault of a log of which no column is recognised."""
    names = [c.name for table in raw.tables for c in table.columns]
    return Finding(
        kind="columns",
        what="no column is known as one of a sensor"
        + (f", found {', '.join(names)[:200]}" if names else ""),
        fault=True,
        file=raw.file,
        hint="say what the columns are with --columns t=NAME,gyr_x=NAME,... "
        '(columns={"t": "NAME", ...}), or name them like t_s, gyr_x_dps, acc_x_g, mag_x_ut',
    )


def _parts_of(
    table: Table, t: FloatArray, options: Options, findings: list[Finding]
) -> list[Part]:
    """Return the sensors of one table."""
    groups: dict[str, dict[str, Column]] = {}
    for column in table.columns:
        if column.role not in (None, "t"):
            groups.setdefault(ROLES[column.role].group, {})[column.role] = column
    for group in list(groups):
        missing = missing_parts(group, list(groups[group]))
        if not missing:
            continue
        fault = group in ("gyr", "acc", "mag")
        findings.append(
            Finding(
                kind="columns",
                what=f"{group} needs {', '.join(NEEDED[group])}, "
                f"found only {', '.join(repr(c.name) for c in groups[group].values())}"
                + ("" if fault else ": left out"),
                fault=fault,
                file=table.file,
                stream=group,
                hint="name the others with --columns (columns={...})" if fault else None,
            )
        )
        del groups[group]
    present = {group: _present(columns.values()) for group, columns in groups.items()}
    rows = _rows_by_group(present, len(t))
    parts = []
    orders: dict[int | None, Any] = {}  # sensors that share rows share their times
    for group, columns in groups.items():
        chosen = rows[group]
        if chosen is not None and not chosen.any():
            what = f"the columns of {group} are empty, there is no such stream"
            findings.append(Finding(kind="empty", what=what, file=table.file, stream=group))
            continue
        numbers = None if chosen is None else np.flatnonzero(chosen)
        if group == "gnss":
            numbers = _new_fixes(columns, numbers, table, findings)
        _check_units(group, columns, table, findings)
        if group in NEEDED and _all_nan(columns, NEEDED[group], numbers, group, table, findings):
            continue
        shared = None if numbers is None else id(chosen)
        if shared not in orders or group == "gnss":
            orders[shared] = _times(table, t, numbers, group, options, findings)
        times, numbers = orders[shared]
        parts.append(Part(group=group, table=table, t=times, rows=numbers, columns=columns))
    return parts


def _times(
    table: Table,
    t: FloatArray,
    numbers: NDArray[np.int64] | None,
    group: str,
    options: Options,
    findings: list[Finding],
) -> tuple[FloatArray, NDArray[np.int64] | None]:
    """Return times and rows of a sensor, repaired where that was asked for."""
    times = t if numbers is None else t[numbers]

    def line(row: int) -> int:
        return table.line(row if numbers is None else int(numbers[row]))

    order = advancing(
        times,
        repair=options.repair_time,
        file=table.file,
        stream="imu" if group in IMU_GROUPS else group,
        line=line,
        findings=findings,
    )
    if order is None:
        return times, numbers
    return times[order], order if numbers is None else numbers[order]


def _present(columns: Iterable[Column]) -> BoolArray | None:
    """Return the rows where any of the columns has a cell, None when all have."""
    empty: Any = None
    for column in columns:
        if column.empty is None:
            return None
        empty = column.empty if empty is None else empty & column.empty
    return None if empty is None else ~empty


def _rows_by_group(present: dict[str, BoolArray | None], n: int) -> dict[str, BoolArray | None]:
    """Return which rows are samples of each sensor, None for all.

    An aiding sensor has a sample where it has a cell. The gyroscope and the accelerometer share
    rows unless each has most of its cells alone; a row where both are empty is a lost sample,
    unless it belongs to another sensor that never shares rows with them.
    """
    rows: dict[str, BoolArray | None] = dict(present)
    gyr, acc = present.get("gyr"), present.get("acc")
    imu = [present[g] for g in IMU_GROUPS if g in present]
    if not imu or any(p is None for p in imu):
        both_full = all(p is None for p in imu)
        if not imu or both_full or len(imu) < 2:
            return rows
        slower = gyr if gyr is not None else acc
        # One of the two has every row: a few empty cells of the other are lost samples.
        if slower is not None and 2 * np.count_nonzero(slower) > n:
            rows["gyr"] = rows["acc"] = None
        return rows
    either = np.zeros(n, dtype=np.bool_)
    for p in imu:
        if p is not None:
            either |= p
    if gyr is not None and acc is not None:
        shared = np.count_nonzero(gyr & acc)
        if 2 * shared < max(np.count_nonzero(gyr), np.count_nonzero(acc)):
            return rows
    foreign = np.zeros(n, dtype=np.bool_)
    for group, p in present.items():
        if group in IMU_GROUPS or p is None:
            continue
        if 2 * np.count_nonzero(p & either) < np.count_nonzero(p):
            foreign |= p
    keep = either | ~foreign if foreign.any() else None
    for group in IMU_GROUPS:
        if group in present:
            rows[group] = keep if keep is not None and not keep.all() else None
    return rows


def _new_fixes(
    columns: dict[str, Column],
    rows: NDArray[np.int64] | None,
    table: Table,
    findings: list[Finding],
) -> NDArray[np.int64] | None:
    """Return the rows where a fix is new, when the last one is repeated in between."""
    n = len(table) if rows is None else len(rows)
    if n < 10:
        return rows
    changed = np.zeros(n, dtype=np.bool_)
    changed[0] = True
    for column in columns.values():
        values = column.values if rows is None else column.values[rows]
        with np.errstate(invalid="ignore"):
            step = values[1:] != values[:-1]
        changed[1:] |= step & ~(np.isnan(values[1:]) & np.isnan(values[:-1]))
    fixes = int(np.count_nonzero(changed))
    # A receiver at rest repeats a fix now and then; a held one is repeated most of the time.
    if 2 * fixes > n:
        return rows
    findings.append(
        Finding(
            kind="held",
            what=f"each fix is repeated on {n / fixes:.3g} rows on average; a fix is where a "
            f"value changes, {fixes} in all",
            file=table.file,
            stream="gnss",
        )
    )
    kept = np.flatnonzero(changed)
    return kept if rows is None else rows[kept]


def _check_units(
    group: str, columns: dict[str, Column], table: Table, findings: list[Finding]
) -> None:
    """Refuse mixed units; without any, note that SI is assumed, or say why it cannot be."""
    by_field: dict[tuple[str, str], list[Column]] = {}
    lat, lon, height = (columns.get(role) for role in ("lat", "lon", "height"))
    if lat and lon and height and {lat.unit, lon.unit, height.unit} == {None}:
        lat.unit = lon.unit = parse_unit(degrees_or_e7(lat.values, lon.values))
        # MAVLink and older PX4 logs: 1e-7 degrees go with millimetres
        height.unit = parse_unit("mm" if lat.unit.name == "deg_1e7" else "m")
        findings.append(
            Finding(
                kind="unit",
                what=f"{lat.name!r}, {lon.name!r} and {height.name!r} state no unit and are read "
                f"in {lat.unit.symbol} and {height.unit.symbol}",
                file=table.file,
                stream=group,
            )
        )
    for role, column in columns.items():
        place = ROLES[role]
        by_field.setdefault((place.field, place.quantity), []).append(column)
    for (_, quantity), members in by_field.items():
        stated = {c.unit.name if c.unit else "none" for c in members}
        if len(stated) > 1:
            said = ", ".join(
                f"{c.name!r} {c.unit.symbol if c.unit else 'without a unit'}" for c in members
            )
            name = group if group in RANGES else "gyr"
            findings.append(
                Finding(
                    kind="unit",
                    what=f"columns of one sensor must have one unit, found {said}",
                    fault=True,
                    file=table.file,
                    stream=group,
                    hint=f"state it with --units {name}=UNIT, or correct the header",
                )
            )
            continue
        if members[0].unit is not None or quantity == "dimensionless":
            continue
        if group in RANGES:
            finding = check_magnitude(group, members, table)
            if finding is not None:
                findings.append(finding)
        else:
            _assume(group, quantity, members, table, findings)


def _assume(
    group: str, quantity: str, members: list[Column], table: Table, findings: list[Finding]
) -> None:
    """Set the unit that is usual where none is stated; positions are in degrees."""
    si = {"angle": "rad", "length": "m", "speed": "m_s"}.get(quantity)
    if si is None:
        return
    unit = parse_unit(si)
    if quantity == "angle" and len(members) > 1:
        unit = parse_unit(degrees_or_e7(members[0].values, members[-1].values))
    elif quantity == "angle" and group in ("gnss", "attitude", "ref_attitude", "encoder"):
        finite = members[0].values[np.isfinite(members[0].values)]
        if len(finite) and float(np.abs(finite).max()) > 7.0:  # beyond 2 pi
            unit = parse_unit("deg")
    for column in members:
        column.unit = unit
    findings.append(
        Finding(
            kind="unit",
            what=f"{', '.join(repr(c.name) for c in members)} state no unit and are read in "
            f"{unit.symbol}",
            file=table.file,
            stream=group,
        )
    )


def _all_nan(
    columns: dict[str, Column],
    needed: tuple[str, ...],
    rows: NDArray[np.int64] | None,
    group: str,
    table: Table,
    findings: list[Finding],
) -> bool:
    """Report a column of a sensor that holds no number at all."""
    for role in needed:
        column = columns[role]
        values = column.values if rows is None else column.values[rows]
        if len(values) and np.isnan(values).all():
            findings.append(
                Finding(
                    kind="nan",
                    what=f"a sensor must have numbers, all {len(values)} samples of "
                    f"{column.name!r} are NaN",
                    fault=True,
                    file=table.file,
                    stream=group,
                    hint="leave the columns of a sensor that was off out, or empty",
                )
            )
            return True
    return False
