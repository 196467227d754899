"""A folder with one CSV file per sensor, as phones and loggers export.

Which sensor a file holds is told by its name (``Gyroscope.csv``, ``acc.csv.gz``,
``log_vehicle_magnetometer_0.csv``) and its columns. Gyroscope and accelerometer of different
rates share the faster one's axis (see `_imu`).
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from strapdown.errors import FormatError
from strapdown.io import csv
from strapdown.io._options import Options
from strapdown.io._raw import Finding, RawLog, Table
from strapdown.io._roles import NEEDED, ROLES
from strapdown.io._text import unreadable

NAME: Final = "folder"
DESCRIPTION: Final = "a folder with one CSV file per sensor"
SUFFIXES: Final[tuple[str, ...]] = ()
TAKES: Final = frozenset(("units", "rate", "delimiter"))

# Words of file names, the more telling first. Gravity is taken off in "linear" and "user".
_WORDS: Final = (
    ("gyr", r"gyro|^gyr|rotation.?rate|angular"),
    ("acc", r"acc(el)?(ero)?|acceleration|specific.?force"),
    ("mag", r"mag(net)?|compass"),
    ("baro", r"baro|pressure"),
    ("temperature", r"temperature|thermo"),
    ("gnss", r"gps|gnss|location|position"),
    ("attitude", r"reference|truth|mocap|optical|vicon|optitrack"),
)
_NOT_RAW: Final = re.compile(r"linear|user|gravity|free|estimat|setpoint|bias|status|meta|annot")
# Of two files of one sensor the better comes first.
_BETTER: Final = (r"total", r"combined|imu|raw", r"^(?!.*uncal)")
_TEXT: Final = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether the path is a folder."""
    return path.is_dir()


def load(path: Path, options: Options) -> RawLog:
    """Return the columns of a folder's files, a table for each that is used.

    Raises
    ------
    FormatError
        If no file is of use.
    """
    try:
        files = sorted(
            file
            for file in path.iterdir()
            if file.is_file()
            and file.name.lower().endswith(_TEXT)
            and not file.name.startswith(".")
        )
    except OSError as error:
        raise unreadable(path, error) from None
    if not files:
        raise FormatError(
            "the folder must hold manifest.json, or a CSV file for each sensor, found "
            + (", ".join(sorted(f.name for f in path.iterdir()))[:200] or "nothing"),
            file=path,
        )
    raw = RawLog(format=NAME, file=str(path), meta={"name": path.name})
    tables: list[Table] = []
    for file in files:
        if _NOT_RAW.search(file.name.lower()):
            continue
        found: list[Finding] = []
        context = context_of(file.name)
        if context == "attitude":
            continue
        try:
            table = csv.load_table(file, replace(options, context=context), found)
        except FormatError as error:
            found.append(Finding(kind="empty", what=error.what, fault=True, file=str(file)))
            table = Table(file=str(file), columns=[])
        if any(c.role not in (None, "t") for c in table.columns) or context is not None:
            tables.append(table)
            raw.findings += found
        elif options.everything:
            tables.append(table)
    raw.tables = choose(tables, path, raw.findings)
    _share_time_units(raw.tables, raw.findings)
    return raw


def _share_time_units(tables: Sequence[Table], findings: list[Finding]) -> None:
    """Give times without a unit that of another file's times of the same name."""
    times = [column for table in tables if (column := table.by_role("t")) is not None]
    known = {column.name: column.unit for column in times if column.unit is not None}
    for table in tables:
        column = table.by_role("t")
        if column is not None and column.unit is None and column.name in known:
            column.unit = known[column.name]
            what = f"{column.name!r} is read in {column.unit.symbol} as in the other files"
            findings.append(Finding(kind="unit", what=what, file=table.file))


def load_files(
    files: Iterable[tuple[str, Path]], options: Options
) -> tuple[list[Table], list[Finding]]:
    """Return the tables of files whose sensors were named, ``imu`` among them."""
    tables: list[Table] = []
    findings: list[Finding] = []
    for sensor, file in files:
        context = sensor if sensor != "imu" else None
        table = csv.load_table(file, replace(options, context=context), findings)
        wanted = ("gyr", "acc") if sensor == "imu" else (sensor,)
        for column in table.columns:
            if column.role not in (None, "t") and ROLES[column.role].group not in wanted:
                column.role = None
        if not any(c.role not in (None, "t") for c in table.columns) and table.columns:
            needed = [role for group in wanted for role in NEEDED[group]]
            findings.append(
                Finding(
                    kind="columns",
                    what=f"must hold {', '.join(needed)}, found "
                    + ", ".join(repr(c.name) for c in table.columns),
                    fault=True,
                    file=str(file),
                    stream=sensor,
                    hint="name the columns like gyr_x_dps, acc_x_g, mag_x_ut",
                )
            )
        tables.append(table)
    return tables, findings


def context_of(name: str) -> str | None:
    """Return the group that a file's name tells, or None."""
    stem = csv.stem(Path(name)).lower()
    spaced = re.sub(r"[^a-z0-9]+", " ", stem)
    hits = [group for group, pattern in _WORDS if re.search(pattern, spaced)]
    if {"gyr", "acc"} <= set(hits):
        return None
    return hits[0] if hits else None


def _groups(table: Table) -> set[str]:
    """Return the sensors of which a table has all columns."""
    roles = {c.role for c in table.columns}
    return {group for group, needed in NEEDED.items() if set(needed) <= roles}


def _rank(table: Table) -> tuple[int, ...]:
    """Return the order in which files of one sensor are preferred, less is better."""
    name = csv.stem(Path(table.file)).lower()
    both = {"gyr", "acc"} <= _groups(table)
    return (0 if both else 1, *(0 if re.search(word, name) else 1 for word in _BETTER))


def choose(tables: Sequence[Table], path: Path, findings: list[Finding]) -> list[Table]:
    """Return the tables of which each sensor comes from one; note what is left out.

    Two files that hold both gyroscope and accelerometer are two recordings, unless their names
    tell which is the better one.
    """
    whole = [t for t in tables if {"gyr", "acc"} <= _groups(t)]
    if len(whole) > 1 and len({_rank(t) for t in whole}) < len(whole):
        findings.append(
            Finding(
                kind="columns",
                what="the folder must hold one recording, these are several: "
                + ", ".join(Path(t.file).name for t in whole),
                fault=True,
                file=str(path),
                hint="name the one to read",
            )
        )
        return list(tables)
    used: set[str] = set()
    chosen = []
    for table in sorted(tables, key=_rank):
        fresh = _groups(table) - used
        for column in table.columns:
            group = ROLES[column.role].group if column.role else "time"
            if group in used:
                column.role = None
        if fresh or any(c.role not in (None, "t") for c in table.columns):
            chosen.append(table)
            used |= fresh
        elif table.columns:
            findings.append(
                Finding(
                    kind="columns",
                    what="is not used, another file holds its sensor",
                    file=table.file,
                )
            )
    return chosen
