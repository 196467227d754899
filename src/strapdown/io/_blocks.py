"""Numbers out of text, block by block: never more of the text in memory than one block.

pyarrow parses a block at a time, on all cores. When it refuses one, the block is gone through
cell by cell, to say which line is at fault and what stands there.
"""

import gzip
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from strapdown._types import BoolArray
from strapdown.io._raw import Finding
from strapdown.io._text import COMMENT, Layout, open_text, split_cells, unreadable

BLOCK: Final = 1 << 22  # 4 MiB of text: large enough for all cores, small beside the arrays
_EMPTY_CELLS: Final = ("", "NA", "N/A", "null", "NULL", "None", "-", "--")
_REMARKS: Final = (b"#", b"%", b"//")

# How a column's cells are read: numbers, whole numbers with all digits, dates, times of day.
KINDS: Final = ("float", "int", "date", "clock")


@dataclass(slots=True)
class _Lines:
    """Line of the file for each row, kept block by block."""

    first_rows: list[int] = field(default_factory=list)
    first_lines: list[int] = field(default_factory=list)
    kept: list[NDArray[np.int64] | None] = field(default_factory=list)

    def __call__(self, row: int) -> int:
        """Return the line, counted from 1, of a row counted from 0."""
        block = max(bisect_right(self.first_rows, row) - 1, 0)
        if not self.first_rows:
            return row + 1
        k = row - self.first_rows[block]
        kept = self.kept[block]
        return self.first_lines[block] + (k if kept is None else int(kept[min(k, len(kept) - 1)]))


@dataclass(slots=True)
class Numbers:
    """Columns that were read, in the order asked for.

    Attributes
    ----------
    values : list of ndarray, shape (n,)
        float64, or int64: whole numbers, and dates and times of day in ns.
    empty : list of ndarray of bool, or None
        Cells with nothing in them.
    line : callable
        Line of a row.
    findings : list of Finding
        Text among the numbers, rows of another width.
    """

    values: list[NDArray[Any]]
    empty: list[BoolArray | None]
    line: _Lines
    findings: list[Finding]


class _NotWhole(Exception):
    """A column of whole numbers holds another number."""


def read_numbers(
    path: Path, layout: Layout, wanted: Sequence[tuple[int, str]], names: Sequence[str]
) -> Numbers:
    """Return some columns of a text file.

    Parameters
    ----------
    path : Path
        The file.
    layout : Layout
        How it is laid out.
    wanted : sequence of (int, str)
        Number and kind, one of `KINDS`, of each column.
    names : sequence of str
        Names of the wanted columns, for messages.

    Returns
    -------
    Numbers
        With NaN, or zero among whole numbers, in empty cells and for text.
    """
    try:
        return _Reader(path, layout, wanted, names).read()
    except _NotWhole:  # such as 1.69e18 further down
        floats = [(k, "float" if kind == "int" else kind) for k, kind in wanted]
        return _Reader(path, layout, floats, names).read()


class _Reader:
    """State of one pass over a file."""

    def __init__(
        self,
        path: Path,
        layout: Layout,
        wanted: Sequence[tuple[int, str]],
        names: Sequence[str],
    ) -> None:
        import pyarrow as pa
        from pyarrow import csv

        self.path, self.layout, self.wanted, self.names = path, layout, wanted, names
        self.width = len(layout.names)
        types = {
            "float": pa.float64(),
            "int": pa.int64(),
            "clock": pa.time64("ns"),
            "date": pa.timestamp("ns", tz="UTC" if self._zoned() else None),
        }
        labels = [f"c{k}" for k in range(self.width)]
        columns = [labels[k] for k, _ in wanted]
        self._read = csv.ReadOptions(column_names=labels)
        self._parse = csv.ParseOptions(
            delimiter=layout.delimiter, invalid_row_handler=self._odd_row
        )
        self._convert = csv.ConvertOptions(
            column_types={labels[k]: types[kind] for k, kind in wanted},
            include_columns=columns,
            null_values=list(_EMPTY_CELLS),
            decimal_point=layout.decimal,
        )
        self._as_text = csv.ConvertOptions(
            column_types={label: pa.binary() for label in columns}, include_columns=columns
        )
        self._values: list[NDArray[Any]] = [
            np.empty(0, np.float64 if kind == "float" else np.int64) for _, kind in wanted
        ]
        self._share = 0.0  # of the file that has been read
        self._empty: list[list[tuple[int, NDArray[np.int64]]]] = [[] for _ in wanted]
        self._rows = 0
        self._odd: list[str] = []
        self.lines = _Lines()
        self.findings: list[Finding] = []
        self._text_cells: dict[int, int] = {}

    def _zoned(self) -> bool:
        """Tell whether the dates of the sample name their zone."""
        dates = [k for k, kind in self.wanted if kind == "date"]
        return any(
            row[k].endswith("Z") or "+" in row[k] or row[k].rfind("-") > 9
            for row in self.layout.sample
            for k in dates
            if k < len(row)
        )

    def read(self) -> Numbers:
        """Go through the file."""
        with open_text(self.path) as stream:
            try:
                line = 1
                for _ in range(self.layout.data_line - 1):
                    stream.readline()
                    line += 1
                size = max(self.path.stat().st_size, 1)
                packed = isinstance(stream, gzip.GzipFile)
                read = 0
                for block in _text_blocks(stream):
                    read += len(block)
                    self._share = 0.0 if packed else min(read / size, 1.0)
                    breaks = int(np.count_nonzero(np.frombuffer(block, np.uint8) == 10))
                    self._add(block, line, breaks)
                    line += breaks
            except (OSError, EOFError, zlib.error) as error:
                raise unreadable(self.path, error) from None
        # pyarrow holds the reader by its row handler: what it read must not stay with it.
        values, self._values = self._values, []
        return Numbers(
            values=[column[: self._rows] for column in values],
            empty=[self._mask(k) for k in range(len(self.wanted))],
            line=self.lines,
            findings=self.findings,
        )

    def _room(self, k: int, rows: int) -> NDArray[Any]:
        """Return a column's array with room for more rows.

        It is made as long as the file will need, by the share that has been read, since pieces
        that are joined at the end would need the memory twice.
        """
        values = self._values[k]
        needed = self._rows + rows
        if needed > len(values):
            share = 1.02 * needed / self._share if self._share > 0.0 else 0.0
            self._values[k] = np.empty(int(max(share, 1.5 * len(values), needed)), values.dtype)
            self._values[k][: self._rows] = values[: self._rows]
        return self._values[k]

    def _mask(self, k: int) -> BoolArray | None:
        """Return which cells of a column are empty."""
        if not self._empty[k]:
            return None
        mask = np.zeros(self._rows, dtype=np.bool_)
        for start, rows in self._empty[k]:
            mask[start + rows] = True
        return mask

    def _odd_row(self, row: Any) -> str:
        """Take note of a row of another width; pyarrow leaves it out."""
        if row.text.strip():
            self._odd.append(row.text)
        return "skip"

    def _add(self, block: bytes, line: int, breaks: int) -> None:
        """Read one block, which starts on `line` and holds so many line breaks."""
        import pyarrow as pa
        from pyarrow import csv

        text, kept = self._clean(_as_utf8(block))
        if not text or text.isspace():
            return
        self._odd.clear()
        buffer = pa.BufferReader(text)
        exact = True
        try:
            table = csv.read_csv(
                buffer,
                read_options=self._read,
                parse_options=self._parse,
                convert_options=self._convert,
            )
        except pa.ArrowInvalid as error:
            if any(kind == "int" for _, kind in self.wanted):
                raise _NotWhole from None
            self._odd.clear()
            exact = False
            try:
                table = csv.read_csv(
                    pa.BufferReader(text),
                    read_options=self._read,
                    parse_options=self._parse,
                    convert_options=self._as_text,
                )
            except pa.ArrowInvalid:
                self.findings.append(
                    Finding(
                        kind="row",
                        what=f"the rows cannot be taken apart ({error})",
                        fault=True,
                        file=str(self.path),
                        row=line,
                    )
                )
                return
        if self._odd:
            self._report_odd(text, kept, line)
        if kept is None and table.num_rows != breaks + (not text.endswith(b"\n")):
            kept = _filled_lines(text, self.layout.delimiter, self.width)
        self.lines.first_rows.append(self._rows)
        self.lines.first_lines.append(line)
        self.lines.kept.append(kept)
        for k, column in enumerate(table.columns):
            self._take(k, column if exact else self._forgiving(k, column))
        self._rows += table.num_rows

    def _take(self, k: int, column: Any) -> None:
        """Keep one block of a column."""
        import pyarrow as pa

        if pa.types.is_temporal(column.type):
            column = column.cast(pa.int64())
        if column.null_count:
            rows = np.flatnonzero(np.asarray(column.is_null()))
            self._empty[k].append((self._rows, rows))
            if pa.types.is_integer(column.type):
                column = column.fill_null(0)
        out = self._room(k, len(column))
        start = self._rows
        for piece in column.chunks:
            out[start : start + len(piece)] = piece.to_numpy(zero_copy_only=False)
            start += len(piece)

    def _forgiving(self, k: int, column: Any) -> Any:
        """Return a column of text as numbers, with NaN and a finding for what is none."""
        import pyarrow as pa

        kind = self.wanted[k][1]
        out: list[Any] = []
        for row, cell in enumerate(column.to_pylist()):
            text = (cell or b"").decode("utf-8", "replace").strip().strip('"').strip()
            if text in _EMPTY_CELLS:
                out.append(None)
                continue
            try:
                out.append(self._convert_cell(text, kind))
            except ValueError:
                if self.wanted[k][0] not in self._text_cells:
                    self.findings.append(
                        Finding(
                            kind="text",
                            what=f"must hold {_WORDS[kind]}, got {text[:40]!r}",
                            fault=True,
                            file=str(self.path),
                            stream=self.names[k],
                            row=self.lines(self._rows + row),
                            hint="correct the cell, or leave it empty for a missing sample",
                        )
                    )
                self._text_cells[self.wanted[k][0]] = row
                out.append(None)
        return pa.chunked_array([pa.array(out, pa.float64() if kind == "float" else pa.int64())])

    def _convert_cell(self, text: str, kind: str) -> float | int:
        """Return the number in a cell; ValueError where there is none."""
        if kind == "float":
            if "_" in text:
                raise ValueError
            return float(text.replace(",", ".") if self.layout.decimal == "," else text)
        stamp = datetime.fromisoformat(text if kind == "date" else f"1970-01-01T{text}")
        if stamp.tzinfo is None:
            stamp = stamp.replace(tzinfo=UTC)
        since = stamp - datetime(1970, 1, 1, tzinfo=UTC)
        nanoseconds = (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
        if abs(nanoseconds) > 2**62:
            raise ValueError
        return nanoseconds

    def _report_odd(self, text: bytes, kept: NDArray[np.int64] | None, line: int) -> None:
        """Report the first row of another width; a cut last line is only a note."""
        rows = text.split(b"\n")
        first = self._odd[0]
        k = next(
            (
                k
                for k, row in enumerate(rows)
                if row.decode("utf-8", "replace").rstrip("\r") == first
            ),
            0,
        )
        here = line + (k if kept is None else int(kept[min(k, len(kept) - 1)]))
        cells = split_cells(first, self.layout.delimiter)
        last = len(self._odd) == 1 and k >= len(rows) - 2 and len(cells) < self.width
        self.findings.append(
            Finding(
                kind="row",
                what=(
                    f"the last line is cut off after {len(cells)} of {self.width} cells, "
                    "it is left out"
                    if last
                    else f"every row must have {self.width} cells like the header, "
                    f"got {len(cells)}"
                ),
                fault=not last,
                file=str(self.path),
                row=here,
                hint=None if last else "correct or delete the line",
            )
        )

    def _clean(self, block: bytes) -> tuple[bytes, NDArray[np.int64] | None]:
        """Return the block without comment lines and runs of blanks, and the lines kept."""
        # One letter is found ten times faster than two, and most files hold none of them.
        remarks = any(
            m[:1] in block and (block.startswith(m) or b"\n" + m in block) for m in _REMARKS
        )
        indented = self.layout.delimiter == " "
        if not remarks and not indented:
            return block, None
        lines = block.split(b"\n")
        if indented:
            lines = [b" ".join(line.split()) for line in lines]
        if not remarks and all(lines[:-1]):
            return b"\n".join(lines), None
        kept = [
            k
            for k, row in enumerate(lines)
            if row.strip() and not COMMENT.match(row[:80].decode("latin-1"))
        ]
        text = b"\n".join(lines[k] for k in kept)
        return text, np.asarray(kept, dtype=np.int64)


_WORDS: Final = {
    "float": "numbers",
    "int": "whole numbers",
    "date": "dates like 2024-05-31T12:00:00.000Z",
    "clock": "times like 12:00:00.000",
}


def _filled_lines(text: bytes, delimiter: str, width: int) -> NDArray[np.int64]:
    """Return the numbers of the lines that are rows."""
    return np.asarray(
        [
            k
            for k, row in enumerate(text.split(b"\n"))
            if row.strip()
            and len(split_cells(row.decode("utf-8", "replace").rstrip("\r"), delimiter)) == width
        ],
        dtype=np.int64,
    )


def _as_utf8(block: bytes) -> bytes:
    """Return a block that pyarrow can decode: what is no UTF-8 is taken for Latin-1."""
    if block.isascii():
        return block
    try:
        block.decode()
    except UnicodeDecodeError:
        return block.decode("latin-1").encode()
    return block


def _text_blocks(stream: BinaryIO) -> Iterator[bytes]:
    """Yield blocks of whole lines."""
    rest = b""
    while True:
        block = stream.read(BLOCK)
        if not block:
            break
        cut = block.rfind(b"\n") + 1
        if cut == 0:
            rest += block
            continue
        yield rest + block[:cut]
        rest = block[cut:]
    if rest:
        yield rest
