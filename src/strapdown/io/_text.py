"""Text files: opening them, whatever their packing, and finding out how they are laid out."""

import codecs
import gzip
import io
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

from strapdown.errors import FormatError
from strapdown.units import parse_unit

HEAD: Final = 1 << 18  # bytes of which the layout is found out
GZIP_MAGIC: Final = b"\x1f\x8b"
_BOMS: Final = ((codecs.BOM_UTF8, "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))
COMMENT: Final = re.compile(r"^\s*(#|%|//)")
_DELIMITERS: Final = ("\t", ";", "|", ",", " ")

ISO_DATE: Final = re.compile(
    r"^\d{4}-\d\d-\d\d([ T]\d\d:\d\d(:\d\d(\.\d{1,9})?)?(Z|[+-]\d\d:?(\d\d)?)?)?$"
)
CLOCK_TIME: Final = re.compile(r"^\d\d:\d\d:\d\d(\.\d{1,9})?$")


class _Transcoded(io.RawIOBase):
    """Text of another encoding as UTF-8 bytes, lone carriage returns as line feeds."""

    def __init__(self, inner: BinaryIO, encoding: str, carriage_returns: bool) -> None:
        self._inner = inner
        self._decoder = codecs.getincrementaldecoder(encoding)("replace")
        self._carriage_returns = carriage_returns
        self._pending = b""

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; return the number of bytes, 0 at the end."""
        while not self._pending:
            block = self._inner.read(HEAD)
            text = self._decoder.decode(block, final=not block)
            if self._carriage_returns:
                text = text.replace("\r", "\n")
            self._pending = text.encode()
            if not block:
                break
        part, self._pending = self._pending[: len(buffer)], self._pending[len(buffer) :]
        buffer[: len(part)] = part
        return len(part)

    def close(self) -> None:
        """Close the file below."""
        self._inner.close()
        super().close()


def open_text(path: Path) -> BinaryIO:
    """Return a stream of the file's text, unpacked, in UTF-8 or a like encoding.

    Raises
    ------
    FormatError
        If there is no such file, it may not be read, or it is damaged.
    """
    stream: BinaryIO | None = None
    try:
        with path.open("rb") as packed:
            magic = packed.read(2)
        stream = cast(BinaryIO, gzip.GzipFile(path)) if magic == GZIP_MAGIC else path.open("rb")
        head = stream.read(HEAD)
        stream.seek(0)
    except (OSError, EOFError, zlib.error) as error:
        if stream is not None:
            stream.close()
        raise unreadable(path, error) from None
    encoding = next((name for bom, name in _BOMS if head.startswith(bom)), None)
    lone_returns = b"\r" in head and b"\n" not in head
    if encoding == "utf-8":
        stream.read(len(codecs.BOM_UTF8))
    elif encoding is not None:
        stream.read(2)
    if lone_returns or encoding in ("utf-16-le", "utf-16-be"):
        name = encoding or "latin-1"
        return io.BufferedReader(_Transcoded(stream, name, lone_returns))
    return stream


def unreadable(path: Path, error: BaseException) -> FormatError:
    """Return the error for a file that cannot be opened or unpacked."""
    if isinstance(error, FileNotFoundError):
        return FormatError("there is no such file or folder", file=path)
    if isinstance(error, PermissionError):
        return FormatError("may not be read: permission denied", file=path)
    if isinstance(error, IsADirectoryError):
        return FormatError("must be a file, it is a folder", file=path)
    if isinstance(error, (gzip.BadGzipFile, EOFError, zlib.error)):
        return FormatError(
            f"the gzip packing is damaged or cut off ({error})", file=path, hint="copy it again"
        )
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return FormatError(f"cannot be read: {reason}", file=path)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How the text is laid out.

    Attributes
    ----------
    delimiter : str
        One character; a space stands for any white space.
    decimal : str
        Decimal point or comma.
    names : list of str
        Header, or made-up names ``column 0`` and so on where there is none.
    header : bool
        Whether the names are the file's own.
    data_line : int
        Line of the first row of numbers, counted from 1; 0 if there is none.
    sample : list of list of str
        Cells of the first rows.
    remarks : list of str
        Comment lines before the data.
    """

    delimiter: str
    decimal: str
    names: list[str]
    header: bool
    data_line: int
    sample: list[list[str]]
    remarks: list[str]


def decode(head: bytes) -> str:
    """Return text of bytes in UTF-8, or Latin-1 where they are not."""
    try:
        return codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return head.decode("latin-1")


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without quotes and outer blanks."""
    if delimiter == " ":
        cells = re.findall(r'"[^"]*"|\S+', line)
    elif '"' in line:
        cells, cell, quoted = [], "", False
        for letter in line:
            if letter == '"':
                quoted = not quoted
            if letter == delimiter and not quoted:
                cells.append(cell)
                cell = ""
            else:
                cell += letter
        cells.append(cell)
    else:
        cells = line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def is_number(cell: str, decimal: str = ".") -> bool:
    """Tell whether a cell is a number, ``nan`` and ``inf`` included."""
    text = cell.replace(",", ".") if decimal == "," else cell
    if "_" in text:  # Python's own way to write 1_000
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True


def is_time_text(cell: str) -> bool:
    """Tell whether a cell is a date and time or a time of day."""
    return bool(ISO_DATE.match(cell) or CLOCK_TIME.match(cell))


def _numeric_row(cells: Sequence[str], decimal: str) -> bool:
    """Tell whether a row looks like samples: mostly numbers and times, blanks aside."""
    filled = [cell for cell in cells if cell]
    numbers = sum(is_number(cell, decimal) for cell in filled)
    times = sum(is_time_text(cell) for cell in filled)
    return numbers > 0 and 2 * (numbers + times) >= len(filled)


def _is_units_row(cells: Sequence[str]) -> bool:
    """Tell whether a row under the header names units."""
    known = 0
    for cell in cells:
        try:
            parse_unit(cell.strip("[](){}"))
        except ValueError:
            continue
        known += 1
    return 2 * known >= len([cell for cell in cells if cell]) > 0


def _choose_delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter that splits most lines into the same number of cells."""
    best, best_score = ",", 0.0
    for delimiter in _DELIMITERS:
        counts = [len(split_cells(line, delimiter)) for line in lines]
        wide = [count for count in counts if count > 1]
        if not wide:
            continue
        usual = max(set(wide), key=wide.count)
        score = wide.count(usual) / len(lines)
        if delimiter == "," and _decimal_commas(lines):
            score = 0.0
        if delimiter == " ":
            score *= 0.9  # blanks also stand in names and after commas
        if score > best_score + 0.05:
            best, best_score = delimiter, score
    return best


def _decimal_commas(lines: Sequence[str]) -> bool:
    """Tell whether commas are decimal ones: every cell between other delimiters has one."""
    for delimiter in ("\t", ";", " "):
        rows = [split_cells(line, delimiter) for line in lines[1:]]
        cells = [cell for row in rows if len(row) > 1 for cell in row if cell]
        if cells and all(re.match(r"^[+-]?\d+(,\d+)?([eE][+-]?\d+)?$", cell) for cell in cells):
            return any("," in cell for cell in cells)
    return False


def find_layout(path: Path, delimiter: str | None = None) -> Layout:
    """Return how the file is laid out, found out from its first lines.

    Raises
    ------
    FormatError
        If the file is empty or no text.
    """
    with open_text(path) as stream:
        try:
            head = stream.read(HEAD)
            complete = len(head) < HEAD and not stream.read(1)
        except (OSError, EOFError, zlib.error) as error:
            raise unreadable(path, error) from None
    if b"\x00" in head:
        raise FormatError("must be text, it holds zero bytes", file=path)
    lines = [line.rstrip("\r") for line in decode(head).split("\n")]
    if not complete and len(lines) > 1:
        lines.pop()  # cut in the middle
    if not any(line.strip() for line in lines):
        raise FormatError("the file is empty", file=path)
    remarks = [line for line in lines[:200] if COMMENT.match(line)]
    plain = [(k, line) for k, line in enumerate(lines) if line.strip() and not COMMENT.match(line)]
    if delimiter is None:
        delimiter = _choose_delimiter([line for _, line in plain[:60]] or remarks[-1:])
    decimal = (
        "," if delimiter != "," and _decimal_commas([line for _, line in plain[:60]]) else "."
    )
    rows = [(k, split_cells(line, delimiter)) for k, line in plain[:200]]
    widest = max((len(cells) for _, cells in rows), default=0)
    first = next(
        (
            j
            for j, (_, cells) in enumerate(rows)
            if _numeric_row(cells, decimal) and (len(cells) > 1 or widest == 1)
        ),
        None,
    )
    if first is None:
        names = rows[-1][1] if rows else []
        return Layout(
            delimiter=delimiter, decimal=decimal, names=names, header=bool(names), data_line=0,
            sample=[], remarks=remarks,
        )  # fmt: skip
    width = len(rows[first][1])
    names = _header(rows[:first], remarks, delimiter, width, lines, rows[first][0])
    header = bool(names)
    if header and rows[first][1][-1] == "" and len(names) == width - 1:
        names = [*names, ""]  # rows end with a delimiter, the header does not
    sample = [cells for _, cells in rows[first : first + 50]]
    return Layout(
        delimiter=delimiter,
        decimal=decimal,
        names=names or [f"column {k}" for k in range(width)],
        header=header,
        data_line=rows[first][0] + 1,
        sample=sample,
        remarks=remarks,
    )


def _header(
    above: Sequence[tuple[int, list[str]]],
    remarks: Sequence[str],
    delimiter: str,
    width: int,
    lines: Sequence[str],
    data_index: int,
) -> list[str]:
    """Return the names above the data, in the text or in the last comment; or nothing."""
    fitting = [cells for _, cells in above if len(cells) in (width, width - 1)]
    commented = [
        split_cells(COMMENT.sub("", line, count=1), delimiter)
        for line in lines[:data_index]
        if COMMENT.match(line)
    ]
    fitting = fitting or [cells for cells in commented if len(cells) in (width, width - 1)]
    fitting = [cells for cells in fitting if any(cell and not is_number(cell) for cell in cells)]
    if not fitting:
        return []
    if len(fitting) > 1 and _is_units_row(fitting[-1]):
        names, units = fitting[-2], fitting[-1]
        if len(names) == len(units):
            return [
                f"{name} [{unit.strip('[](){}')}]" if unit else name
                for name, unit in zip(names, units, strict=True)
            ]
    return fitting[-1]
