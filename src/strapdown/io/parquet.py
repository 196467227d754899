"""Parquet, the native format: all streams, the reference and the metadata in one file, in SI.

The streams stand one after another in one flat table, each in row groups of its own: the column
``stream`` says which (``imu``, ``mag``, ``reference.attitude``), ``t_s`` holds its times, and
the columns of other streams are null. So one file keeps sensors of any rates bit for bit, NaN
included; a reader loads the row groups it wants; and any tool reads it without knowing this
package: ``SELECT t_s, gyr_x_rad_s FROM 'log.parquet' WHERE stream = 'imu'``. The key
``strapdown`` of the file's metadata holds the rest as JSON.

A Parquet file of another origin is one table, its columns recognised by name as those of a CSV
file are.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import FormatError, InputError
from strapdown.io._assemble import assemble
from strapdown.io._meaning import meanings_of
from strapdown.io._options import Options
from strapdown.io._raw import Column, Finding, RawLog, Table
from strapdown.io._text import unreadable
from strapdown.recording import REFERENCE_STREAMS, STREAMS, Recording, Reference, Stream
from strapdown.solution import HEADING_REFERENCES
from strapdown.units import parse_unit

NAME: Final = "parquet"
DESCRIPTION: Final = "Parquet: the native format, or a table of columns named as in CSV"
SUFFIXES: Final = (".parquet", ".pq")
TAKES: Final = frozenset(("columns", "units", "rate"))

KEY: Final = b"strapdown"
VERSION: Final = 1
_ROWS: Final = 1 << 20  # rows of a row group
_BATCH: Final = 1 << 16  # rows in memory beside the arrays while reading
_KINDS: Final[Mapping[str, type[Stream]]] = {
    **STREAMS,
    **{f"reference.{name}": kind for name, kind in REFERENCE_STREAMS.items()},
}


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether the file starts like Parquet."""
    return head.startswith(b"PAR1")


# --- reading ----------------------------------------------------------------------------


def open_file(path: Path) -> Any:
    """Return the file opened, its footer read.

    Raises
    ------
    FormatError
        If it is missing, cut off or damaged.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        return parquet.ParquetFile(path, pre_buffer=False, page_checksum_verification=True)
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, (FileNotFoundError, PermissionError)):
            raise unreadable(path, error) from None
        raise damaged(path, error) from None


def damaged(path: Path, error: BaseException) -> FormatError:
    """Return the error for a Parquet file that cannot be read to its end."""
    lines = str(error).splitlines()
    return FormatError(
        f"the Parquet file is cut off or damaged ({lines[0] if lines else type(error).__name__})",
        file=path,
        hint="copy or write it again",
    )


def header_of(file: Any, path: Path, kind: str) -> dict[str, Any] | None:
    """Return what this package wrote about the file, None if it did not.

    Raises
    ------
    FormatError
        If it is of a later version or of another kind.
    """
    text = (file.schema_arrow.metadata or {}).get(KEY)
    if text is None:
        return None
    try:
        header = json.loads(text)
        version, found = int(header["format_version"]), str(header["kind"])
        dict(header["meta"])
        _checks.one_of("heading", header.get("reference_heading", "true"), HEADING_REFERENCES)
    except (ValueError, KeyError, TypeError) as error:
        raise damaged(path, error) from None
    if version > VERSION:
        raise FormatError(
            f"the file has format version {version}, this program knows up to {VERSION}",
            file=path,
            hint="update strapdown",
        )
    if found != kind:
        reader = {"solution": "io.read_solution", "recording": "io.read"}.get(found, "another")
        raise FormatError(
            f"must hold a {kind}, it holds a {found}", file=path, hint=f"use {reader}"
        )
    return dict(header)


def load(path: Path, options: Options) -> RawLog:
    """Return the columns of a Parquet file, a table for each stream."""
    raw = RawLog(format=NAME, file=str(path))
    file = open_file(path)
    header = header_of(file, path, "recording")
    if header is None:
        raw.meta["name"] = path.stem
        raw.tables.append(_foreign_table(file, path, options, raw.findings))
        return raw
    raw.meta.update(header["meta"])
    for name, t, fields in _streams(file, header, path):
        columns = [Column(name="t_s", values=t, role="t", unit=parse_unit("s"))]
        for spec in _KINDS[name].FIELDS:
            if spec.name in fields:
                array = fields[spec.name].reshape(len(t), -1)
                columns += [
                    Column(name=column, values=array[:, j])
                    for j, column in enumerate(spec.columns)
                ]
        raw.tables.append(Table(file=str(path), columns=columns, stream=name))
    return raw


def read(path: Path, options: Options) -> tuple[Recording, RawLog]:
    """Return the recording in a Parquet file.

    Raises
    ------
    FormatError
        If the file is damaged, or holds columns that are no recording.
    """
    file = open_file(path)
    header = header_of(file, path, "recording")
    raw = RawLog(format=NAME, file=str(path))
    if header is None:
        raw = load(path, options)
        return assemble(raw, options), raw
    streams: dict[str, Any] = {}
    for name, t, fields in _streams(file, header, path):
        try:
            streams[name] = _KINDS[name](t=t, **fields)  # type: ignore[call-arg]
        except ValueError as error:
            raise FormatError(str(error), file=path, stream=name) from None
        except TypeError as error:  # a stream without a field that it needs
            raise damaged(path, error) from None
    parts = {name: streams.pop(f"reference.{name}", None) for name in REFERENCE_STREAMS}
    reference = (
        Reference(**parts, heading=header.get("reference_heading", "true"))
        if "reference_heading" in header
        else None
    )
    return Recording(**streams, reference=reference, meta=header["meta"]), raw


def _streams(
    file: Any, header: Mapping[str, Any], path: Path
) -> Iterator[tuple[str, FloatArray, dict[str, Any]]]:
    """Yield name, times and arrays of each stream, read batch by batch."""
    import pyarrow as pa

    try:
        items = [
            (name, int(entry["rows"]), set(entry["fields"]), list(entry["row_groups"]))
            for name, entry in header["streams"].items()
        ]
        for name, n, present, groups in items:
            specs = [spec for spec in _KINDS[name].FIELDS if spec.name in present]
            t = np.empty(n)
            fields: dict[str, Any] = {}
            for spec in specs:
                shape = (n,) if spec.width == 1 else (n, spec.width)
                fields[spec.name] = np.empty(shape, np.bool_ if spec.kind == "flag" else float)
            columns = ["t_s", *(column for spec in specs for column in spec.columns)]
            start = 0
            for batch in file.iter_batches(_BATCH, row_groups=groups, columns=columns):
                rows = slice(start, start + batch.num_rows)
                t[rows] = _numbers(batch, "t_s")
                for spec in specs:
                    out = fields[spec.name]
                    for j, column in enumerate(spec.columns):
                        (out if out.ndim == 1 else out[:, j])[rows] = _numbers(batch, column)
                start += batch.num_rows
            if start != n:
                raise ValueError(f"stream {name} has {start} rows, {n} were written")
            yield name, t, fields
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, IndexError) as error:
        if isinstance(error, FormatError):
            raise
        raise damaged(path, error) from None


def _numbers(batch: Any, column: str) -> Any:
    return batch.column(column).to_numpy(zero_copy_only=False)


def _foreign_table(file: Any, path: Path, options: Options, findings: list[Finding]) -> Table:
    """Return the columns of a table that this package did not write."""
    import pyarrow as pa

    names = list(file.schema_arrow.names)
    meanings = meanings_of(path, names, options, findings)
    columns: list[Column] = []
    times = 0
    for name, meaning in zip(names, meanings, strict=True):
        kind = file.schema_arrow.field(name).type
        numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        dated = pa.types.is_timestamp(kind)
        role = meaning.role
        times += role == "t"
        if role == "t" and times > 1:
            role = None
        if not (numeric or dated) or (role is None and not options.everything):
            continue
        try:
            column = file.read(columns=[name]).column(0)
            empty = np.asarray(column.is_null()) if column.null_count else None
            if dated:
                column = column.cast(pa.timestamp("ns")).cast(pa.int64())
            if pa.types.is_integer(column.type) and role == "t":
                values = column.fill_null(0).cast(pa.int64()).to_numpy()
            else:
                values = column.cast(pa.float64()).to_numpy()
        except (pa.ArrowException, OSError, ValueError) as error:
            raise damaged(path, error) from None
        unit = parse_unit("ns") if dated else meaning.unit
        columns.append(Column(name=name, values=values, role=role, unit=unit, empty=empty))
    if file.metadata.num_rows == 0:
        raise FormatError("the table has columns but no rows", file=path)
    return Table(file=str(path), columns=columns)


# --- writing ----------------------------------------------------------------------------


def save(rec: Recording, path: Path, stream: IO[bytes]) -> None:
    """Write a recording; the same recording gives the same bytes.

    Raises
    ------
    InputError
        If the metadata are not of the kind that JSON holds.
    """
    import pyarrow as pa
    from pyarrow import parquet

    parts = dict(rec.streams())
    if rec.reference is not None:
        parts |= {f"reference.{name}": part for name, part in rec.reference.streams()}
    header: dict[str, Any] = {
        "format_version": VERSION,
        "kind": "recording",
        "meta": dict(rec.meta),
        "streams": {},
    }
    if rec.reference is not None:
        header["reference_heading"] = rec.reference.heading
    kinds: dict[str, Any] = {}
    group = 0
    for name, part in parts.items():
        fields = [spec for spec in part.FIELDS if getattr(part, spec.name) is not None]
        for spec in fields:
            kind = pa.bool_() if spec.kind == "flag" else pa.float64()
            kinds |= {column: kind for column in spec.columns}
        count = -(-len(part) // _ROWS)
        header["streams"][name] = {
            "rows": len(part),
            "fields": [spec.name for spec in fields],
            "row_groups": list(range(group, group + count)),
        }
        group += count
    text = as_json(header, path)
    schema = pa.schema(
        [
            pa.field("stream", pa.dictionary(pa.int32(), pa.string())),
            pa.field("t_s", pa.float64()),
            *(pa.field(column, kind) for column, kind in kinds.items()),
        ],
        metadata={KEY: text},
    )
    with parquet.ParquetWriter(
        stream,
        schema,
        compression="zstd",
        compression_level=1,
        use_dictionary=["stream"],
        write_page_checksum=True,
    ) as writer:
        for name, part in parts.items():
            for start in range(0, len(part), _ROWS):
                rows = slice(start, min(start + _ROWS, len(part)))
                writer.write_table(_group(name, part, rows, schema), row_group_size=_ROWS)


def _group(name: str, part: Stream, rows: slice, schema: Any) -> Any:
    """Return some rows of a stream as a table with the columns of all streams."""
    import pyarrow as pa

    n = rows.stop - rows.start
    columns: dict[str, Any] = {
        "stream": pa.DictionaryArray.from_arrays(np.zeros(n, dtype=np.int32), [name]),
        "t_s": pa.array(part.t[rows]),
    }
    for spec in part.FIELDS:
        array = getattr(part, spec.name)
        if array is not None:
            for j, column in enumerate(spec.columns):
                values = array[rows] if array.ndim == 1 else array[rows, j]
                columns[column] = pa.array(np.ascontiguousarray(values), from_pandas=False)
    for kind in schema:
        if kind.name not in columns:
            columns[kind.name] = pa.nulls(n, kind.type)
    return pa.table([columns[kind.name] for kind in schema], schema=schema)


def as_json(header: Mapping[str, Any], path: Path) -> str:
    """Return metadata as JSON text.

    Raises
    ------
    InputError
        If a value is none that JSON holds.
    """
    try:
        return json.dumps(header, sort_keys=False)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{path}: `meta` must hold text, numbers, lists and mappings only ({error})."
        ) from None
