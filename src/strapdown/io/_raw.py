"""What a file holds before anybody judges it: columns, their meaning, and findings."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapdown._types import BoolArray
from strapdown.errors import FormatError
from strapdown.units import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something that was noticed in a file.

    Attributes
    ----------
    kind : str
        ``"unit"``, ``"columns"``, ``"text"``, ``"row"``, ``"time"``, ``"empty"``, ``"nan"``,
        ``"clock"``, ``"rate"`` or ``"held"``.
    what : str
        What must be and what was found, or what was done.
    fault : bool
        Whether `read` refuses the file because of it. Otherwise it is a note.
    file, stream, row, hint
        As in `errors.FormatError`; rows of text files are lines, counted from 1 as an
        editor counts them.
    """

    kind: str
    what: str
    fault: bool = False
    file: str | None = None
    stream: str | None = None
    row: int | None = None
    hint: str | None = None

    def error(self) -> FormatError:
        """Return the finding as the error that `read` raises."""
        return FormatError(
            self.what, file=self.file, stream=self.stream, row=self.row, hint=self.hint
        )

    def __str__(self) -> str:
        """One sentence, the same as the error's."""
        return str(self.error())


@dataclass(slots=True, kw_only=True, eq=False)
class Column:
    """One column of numbers, as it stands in the file.

    Attributes
    ----------
    name : str
        Name in the file.
    values : ndarray, shape (n,)
        Numbers in the file's unit, float64, or int64 where a time needs all its digits.
    role : str, optional
        What the column is taken for: a key of `io.ROLES`, such as ``"gyr_x"``; None when
        its name says nothing.
    unit : Unit, optional
        Unit of the values where one is stated; None where it is not.
    empty : ndarray of bool, optional
        Cells with nothing in them, which are NaN in `values`; None when there are none.
    """

    name: str
    values: NDArray[Any]
    role: str | None = None
    unit: Unit | None = None
    empty: BoolArray | None = None


def _no_line(row: int) -> int:
    """Return the row itself, for files without lines."""
    return row


@dataclass(slots=True, kw_only=True, eq=False)
class Table:
    """Columns of equal length from one file.

    Attributes
    ----------
    file : str
        Where they come from.
    columns : list of Column
        In the order of the file.
    stream : str, optional
        The stream that all columns belong to, where the format says so.
    line : callable
        Row in the file of a sample's index, for messages.
    """

    file: str
    columns: list[Column]
    stream: str | None = None
    line: Callable[[int], int] = _no_line

    def __len__(self) -> int:
        return len(self.columns[0].values) if self.columns else 0

    def by_role(self, role: str) -> Column | None:
        """Return the column with this role, or None."""
        return next((column for column in self.columns if column.role == role), None)

    def by_name(self, name: str) -> Column | None:
        """Return the column with this name in the file, or None."""
        return next((column for column in self.columns if column.name == name), None)


@dataclass(slots=True, kw_only=True, eq=False)
class RawLog:
    """Columns and findings of a log, not judged.

    Attributes
    ----------
    format : str
        Registry name of the format.
    file : str
        What was read.
    tables : list of Table
        One for each file, or each stream of a packed file.
    findings : list of Finding
        What was noticed, in the order in which it was.
    meta : dict
        Facts that the file states about itself.
    """

    format: str
    file: str
    tables: list[Table] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    meta: dict[str, Any] = field(default_factory=dict)

    def faults(self) -> Iterator[Finding]:
        """Yield the findings for which `read` refuses the log."""
        return (finding for finding in self.findings if finding.fault)

    def require_sound(self) -> None:
        """Raise the first fault, if there is one.

        Raises
        ------
        FormatError
            It says what, where and the way out.
        """
        for finding in self.faults():
            raise finding.error()

    def notes(self) -> list[str]:
        """Return the findings that are no faults, each once."""
        return list(dict.fromkeys(str(f) for f in self.findings if not f.fault))

    def table(self, stream: str) -> Table | None:
        """Return the table of a stream, or None."""
        return next((table for table in self.tables if table.stream == stream), None)


def stacked(columns: list[Column], rows: BoolArray | NDArray[np.int64] | None) -> NDArray[Any]:
    """Return the selected rows of some columns in SI, shape (n, k), or (n,) for one column."""
    n = len(columns[0].values) if rows is None else len(columns[0].values[rows])
    out = np.empty((n, len(columns)))
    for j, column in enumerate(columns):
        values = column.values if rows is None else column.values[rows]
        if column.unit is None:
            out[:, j] = values
        else:
            np.multiply(values, column.unit.factor, out=out[:, j])
            if column.unit.offset:
                out[:, j] += column.unit.offset
    return out if len(columns) > 1 else out[:, 0]
