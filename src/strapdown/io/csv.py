"""CSV, TSV and the like: any delimiter, header names and units in common spellings.

Reading takes a text file, gzipped or not; the columns are recognised by name (see `_headers`)
or by the option ``columns``. Writing makes one file of all streams: a row for each time that
any stream has, empty cells where a stream has no sample, and the unit in every column's name.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from strapdown.errors import InputError
from strapdown.io._blocks import read_numbers
from strapdown.io._headers import Meaning
from strapdown.io._meaning import meanings_of
from strapdown.io._options import Options
from strapdown.io._raw import Column, Finding, RawLog, Table
from strapdown.io._text import (
    CLOCK_TIME,
    GZIP_MAGIC,
    ISO_DATE,
    Layout,
    find_layout,
    is_number,
    is_time_text,
    open_text,
)
from strapdown.recording import Recording, Stream
from strapdown.units import Unit, parse_unit

NAME: Final = "csv"
DESCRIPTION: Final = "CSV, TSV and other columns of text, gzipped or not"
SUFFIXES: Final = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz")
TAKES: Final = frozenset(("columns", "units", "rate", "delimiter", "files"))


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file may be text: not a folder, no zero bytes except in UTF-16."""
    if path.is_dir():
        return False
    if head.startswith(GZIP_MAGIC):
        with open_text(path) as stream:
            try:
                head = stream.read(4096)
            except (OSError, EOFError):
                return True  # reading says what is wrong with it
    return head.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\x00" not in head


def load(path: Path, options: Options) -> RawLog:
    """Return the columns of one text file and what was noticed in them."""
    raw = RawLog(format=NAME, file=str(path), meta={"name": stem(path)})
    raw.tables.append(load_table(path, options, raw.findings))
    return raw


def stem(path: Path) -> str:
    """Return the name of a file without its endings ``.csv.gz`` and the like."""
    return re.sub(r"(\.(csv|tsv|txt|dat|log))?(\.gz)?$", "", path.name, flags=re.IGNORECASE)


def load_table(path: Path, options: Options, findings: list[Finding]) -> Table:
    """Return one text file as a table; findings are appended.

    Raises
    ------
    FormatError
        If the file is empty, no text, or damaged.
    """
    layout = find_layout(path, options.delimiter)
    meanings = _one_time(layout, _meanings(path, layout, options, findings))
    if layout.data_line == 0:
        what = (
            f"the file holds a header ({', '.join(filter(None, layout.names))[:80]}) "
            "but no row of numbers"
            if layout.header
            else "the file holds no row of numbers"
        )
        findings.append(Finding(kind="empty", what=what, fault=True, file=str(path)))
        return Table(file=str(path), columns=[])
    wanted, roles = [], []
    for k, meaning in enumerate(meanings):
        kind = _kind(layout, k, meaning.role)
        if kind is not None and (meaning.role is not None or options.everything):
            wanted.append((k, kind))
            roles.append(meaning)
    names = [layout.names[k] for k, _ in wanted]
    if not wanted:
        return Table(file=str(path), columns=[], line=lambda row: row + layout.data_line)
    numbers = read_numbers(path, layout, wanted, names)
    findings += numbers.findings
    columns = []
    for j, (name, meaning) in enumerate(zip(names, roles, strict=True)):
        kind = wanted[j][1]
        unit = parse_unit("ns") if kind in ("date", "clock") else meaning.unit
        values = numbers.values[j]
        if kind == "clock":
            values = _past_midnight(values)
        if kind == "date" and not re.search(
            r"(Z|[+-]\d\d:?(\d\d)?)$", layout.sample[0][wanted[j][0]][10:]
        ):
            findings.append(
                Finding(
                    kind="clock",
                    what=f"dates in {name!r} without a time zone are taken as UTC",
                    file=str(path),
                )
            )
        columns.append(
            Column(name=name, values=values, role=meaning.role, unit=unit, empty=numbers.empty[j])
        )
    return Table(file=str(path), columns=columns, line=numbers.line)


def _past_midnight(values: Any) -> Any:
    """Return times of day [ns] that go on after midnight."""
    day = 86_400 * 10**9
    back = np.diff(values, prepend=values[:1]) < -day // 2
    return values + day * np.cumsum(back)


def _kind(layout: Layout, k: int, role: str | None) -> str | None:
    """Return how a column's cells are read, or None for text."""
    cells = [row[k] for row in layout.sample if k < len(row) and row[k]]
    if role == "t":
        if cells and ISO_DATE.match(cells[0]):
            return "date"
        if cells and CLOCK_TIME.match(cells[0]):
            return "clock"
        # Nanoseconds since 1970 have 19 digits, more than float64 keeps.
        if cells and all(re.fullmatch(r"[+-]?\d{1,19}", cell) for cell in cells):
            return "int" if len(cells[0]) > 15 else "float"
        return "float"
    if role is None and not all(is_number(cell, layout.decimal) for cell in cells):
        return None
    return "float"


def _meanings(
    path: Path, layout: Layout, options: Options, findings: list[Finding]
) -> list[Meaning]:
    """Return what each column means; without a header only the option `columns` tells."""
    if layout.header:
        return meanings_of(path, layout.names, options, findings)
    if not options.columns:
        findings.append(
            Finding(
                kind="columns",
                what=f"the file has no header, only {len(layout.names)} columns of numbers",
                fault=True,
                file=str(path),
                hint="say what they are with --columns t=0,gyr_x=1,... "
                '(columns={"t": 0, "gyr_x": 1, ...})',
            )
        )
    return meanings_of(path, layout.names, options, findings)


def _one_time(layout: Layout, meanings: Sequence[Meaning]) -> list[Meaning]:
    """Return the meanings with one time column, the first that advances in the sample."""
    chosen: int | None = None
    for k, meaning in enumerate(meanings):
        if meaning.role != "t" or chosen is not None:
            continue
        cells = [row[k] for row in layout.sample if k < len(row) and row[k]]
        usable = all(is_number(c, layout.decimal) or is_time_text(c) for c in cells)
        moving = len(set(cells)) > 1 or len(cells) < 2
        if cells and usable and moving:
            chosen = k
    if chosen is None:
        chosen = next((k for k, m in enumerate(meanings) if m.role == "t"), None)
    return [Meaning() if m.role == "t" and k != chosen else m for k, m in enumerate(meanings)]


# --- writing ----------------------------------------------------------------------------

# Units of written columns, by the SI ending of the field's column; other columns stay SI.
_WRITTEN: Final = (("_rad_s", "dps"), ("_t", "ut"), ("lat_rad", "deg"), ("lon_rad", "deg"))
_RENAMED: Final = {
    "attitude": {f"q_nb_{axis}": f"ref_q_nb_{axis}" for axis in "wxyz"} | {"valid": "ref_valid"},
    "position": {
        "lat_rad": "ref_lat_rad",
        "lon_rad": "ref_lon_rad",
        "height_m": "ref_height_m",
        "v_n_m_s": "ref_v_n_m_s",
        "v_e_m_s": "ref_v_e_m_s",
        "v_d_m_s": "ref_v_d_m_s",
        "valid": "ref_position_valid",
    },
    "mount": {f"q_vb_{axis}": f"ref_q_vb_{axis}" for axis in "wxyz"}
    | {"valid": "ref_mount_valid"},
    "star": {f"q_nb_{axis}": f"star_q_{axis}" for axis in "wxyz"},
}


def _outside(name: str) -> tuple[str, Unit | None]:
    """Return the name and the unit with which an SI column is written."""
    for ending, unit_name in _WRITTEN:
        if name.endswith(ending):
            unit = parse_unit(unit_name)
            suffix = "_rad" if ending.endswith("_rad") else ending
            return name.removesuffix(suffix) + "_" + unit_name, unit
    return name, None


def _streams(rec: Recording) -> Iterator[tuple[str, Stream]]:
    yield from rec.streams()
    if rec.reference is not None:
        yield from rec.reference.streams()


def save(rec: Recording, path: Path, stream: IO[bytes]) -> None:
    """Write all streams as one table, comma separated, or tab separated for ``.tsv``.

    Raises
    ------
    InputError
        If the recording holds no stream.
    """
    import gzip

    import pyarrow as pa
    from pyarrow import csv

    streams = list(_streams(rec))
    if not streams:
        raise InputError("the recording must hold a stream to be written, it holds none.")
    t = streams[0][1].t
    for _, part in streams[1:]:
        if part.t is not t and not np.array_equal(part.t, t):
            t = np.union1d(t, part.t)
    columns: dict[str, Any] = {"t_s": t}
    for name, part in streams:
        rows = None if len(part.t) == len(t) else np.searchsorted(t, part.t)
        for label, values in _cells(name, part):
            columns[label] = _spread(values, rows, len(t))
    suffixes = [suffix.lower() for suffix in path.suffixes]
    options = csv.WriteOptions(delimiter="\t" if ".tsv" in suffixes else ",", quoting_style="none")
    table = pa.table(columns)
    if suffixes and suffixes[-1] == ".gz":
        # mtime 0: the same recording gives the same bytes
        with gzip.GzipFile(fileobj=stream, mode="wb", compresslevel=6, mtime=0) as packed:
            csv.write_csv(table, packed, options)
    else:
        csv.write_csv(table, stream, options)


def _cells(name: str, part: Stream) -> Iterator[tuple[str, Any]]:
    """Yield the written name and the values of each column of a stream."""
    for spec in part.FIELDS:
        array = getattr(part, spec.name)
        if array is None:
            continue
        for j, column in enumerate(spec.columns):
            values = array if array.ndim == 1 else array[:, j]
            label, unit = _outside(_RENAMED.get(name, {}).get(column, column))
            if spec.kind == "flag":
                yield label, values.astype(np.int8)
            else:
                yield label, values if unit is None else unit.from_si(values)


def _spread(values: Any, rows: Any, n: int) -> Any:
    """Return values as a column of n cells, empty where the stream has no sample."""
    import pyarrow as pa

    values = np.ascontiguousarray(values)
    if rows is None:
        return pa.array(values)  # NaN stays NaN: a sample that was taken and failed
    spread = np.zeros(n, dtype=values.dtype)
    empty = np.ones(n, dtype=np.bool_)
    spread[rows] = values
    empty[rows] = False
    return pa.array(spread, mask=empty)
