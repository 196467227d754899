"""What goes to the terminal: results to stdout, everything else to stderr."""

import json
import math
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TextIO

from strapdown.errors import StrapdownWarning


def error(line: str) -> None:
    """Print the one line of a failure."""
    print(f"strapdown: {line}", file=sys.stderr)


def note(line: str) -> None:
    """Print what the user should know, but need not act on."""
    print(f"note: {line}", file=sys.stderr)


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Show the package's own warnings as one line each; those of libraries are not for users."""

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, StrapdownWarning):
            print(f"warning: {' '.join(str(message).split())}", file=sys.stderr)

    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", StrapdownWarning)
        warnings.showwarning = show
        yield


@contextmanager
def progress(total: int) -> Iterator["Progress"]:
    """Show which of `total` steps is under way, on stderr and only if that is a terminal."""
    if not sys.stderr.isatty():
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(20), TextColumn("{task.description}"), TimeElapsedColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        yield Progress(bar, bar.add_task("", total=total))


class Progress:
    """Names the steps of a command; silent without a bar."""

    def __init__(self, bar: Any = None, task: Any = None) -> None:
        self._bar, self._task = bar, task
        self._begun = False

    def step(self, text: str) -> None:
        """Begin the next step."""
        if self._bar is not None:
            self._bar.update(self._task, description=text, advance=1 if self._begun else 0)
        self._begun = True

    def note(self, line: str) -> None:
        """Print a note above the bar."""
        if self._bar is not None:
            self._bar.console.print(f"note: {line}", markup=False, highlight=False)
        else:
            note(line)


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object; a number that is not finite becomes null."""
    print(to_json(value))


def to_json(value: Mapping[str, Any]) -> str:
    """Return the text of a JSON object."""
    return json.dumps(_jsonable(value), indent=2, allow_nan=False)


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_jsonable(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return _jsonable(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


def print_fact(name: str, value: Any) -> None:
    """Print one line below a table."""
    text = value if isinstance(value, str) else json.dumps(_jsonable(value))
    print(f"  {name}: {text}")


def print_table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, right: Iterable[int] = ()
) -> None:
    """Print a table.

    Parameters
    ----------
    title : str
        Line above it; empty for none.
    header : sequence of str
        Names of the columns; all empty for none.
    rows : sequence of sequence of str
        Cells.
    right : iterable of int
        Columns of numbers, aligned at the right.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    numbers = set(right)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, show_header=any(header))
    for column, name in enumerate(header):
        table.add_column(
            name,
            justify="right" if column in numbers else "left",
            no_wrap=column == 0 or column in numbers,
            overflow="fold",
        )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    if title:
        print(title)
    sys.stdout.flush()  # the console writes to the same stream by itself
    width = None if sys.stdout.isatty() else 120
    Console(file=sys.stdout, width=width, highlight=False).print(table)
