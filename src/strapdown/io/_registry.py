"""The formats: one module each, found out from what a file holds."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import IO, Any, Final, NamedTuple, Protocol, cast

from strapdown import _checks
from strapdown.errors import FormatError
from strapdown.io._options import Options
from strapdown.io._raw import RawLog
from strapdown.io._text import unreadable
from strapdown.recording import Recording

# In the order in which they are asked: what any text or folder is, comes last.
_MODULES: Final = ("parquet", "broad", "drives", "folder", "csv")
_HEAD: Final = 4096
_OTHERS: Final = (
    (b"PK\x03\x04", "a zip archive: unpack it and give the folder or the file in it"),
    (b"\xb5b", "a raw u-blox recording, which io does not read"),
    (b"\xa3\x95", "an ArduPilot binary log: export it as CSV"),
    (b"ULog", "a PX4 ULog: export it as CSV"),
    (b"#ROSBAG", "a ROS bag: export its topics as CSV"),
    (b"SQLite format 3", "an SQLite database: export its tables as CSV"),
)


class FormatModule(Protocol):
    """What a format's module holds."""

    NAME: str
    DESCRIPTION: str
    SUFFIXES: tuple[str, ...]
    TAKES: frozenset[str]  # options of `read` beyond those that every format takes

    def sniff(self, path: Path, head: bytes) -> bool:
        """Tell whether the format is that of the path, whose first bytes are `head`."""
        ...

    def load(self, path: Path, options: Options) -> RawLog:
        """Return columns and findings."""
        ...

    def read(self, path: Path, options: Options) -> tuple[Recording, RawLog]:
        """Return the recording and what was found; optional, `_assemble` is the usual way."""
        ...

    def save(self, rec: Recording, path: Path, stream: IO[bytes]) -> None:
        """Write a recording to a stream that becomes the path; optional."""
        ...


class FormatInfo(NamedTuple):
    """What `formats` says of one: name, description, endings, and whether it is written."""

    name: str
    description: str
    suffixes: tuple[str, ...]
    writes: bool


def module(name: str) -> FormatModule:
    """Return a format's module; a wrong name offers the nearest."""
    _checks.one_of("format", name, _MODULES)
    return cast(FormatModule, import_module(f"strapdown.io.{name}"))


def formats() -> tuple[FormatInfo, ...]:
    """Return what formats there are."""
    modules: Sequence[Any] = [module(name) for name in _MODULES]
    return tuple(
        FormatInfo(m.NAME, m.DESCRIPTION, m.SUFFIXES, hasattr(m, "save")) for m in modules
    )


def detect(path: Path) -> FormatModule:
    """Return the format of a file or folder, found out from its content.

    Raises
    ------
    FormatError
        If there is no such path, it may not be read, is empty, or of no known format.
    """
    head = b""
    try:
        if not path.is_dir():
            with path.open("rb") as stream:
                head = stream.read(_HEAD)
    except OSError as error:
        raise unreadable(path, error) from None
    except ValueError as error:  # a zero byte in the name
        raise FormatError(f"is no path ({error})", file=str(path)) from None
    if not path.is_dir() and not head:
        raise FormatError("the file is empty", file=path)
    for magic, what in _OTHERS:
        if head.startswith(magic):
            raise FormatError(f"is {what}", file=path)
    for name in _MODULES:
        candidate = module(name)
        if candidate.sniff(path, head):
            return candidate
    raise FormatError(
        "is of no known format: neither text, Parquet, MATLAB nor HDF5", file=path,
        hint="export it as CSV",
    )  # fmt: skip


def for_suffix(path: Path) -> FormatModule:
    """Return the format in which a path is written.

    Raises
    ------
    FormatError
        If no format that is written has its ending.
    """
    name = path.name.lower()
    writable = [m for n in _MODULES if hasattr(m := module(n), "save")]
    for candidate in writable:
        if name.endswith((*candidate.SUFFIXES, *(f"{s}.gz" for s in (".txt",)))):
            return candidate
    endings = ", ".join(s for m in writable for s in m.SUFFIXES)
    raise FormatError(f"a recording is written as {endings}, got {path.name!r}", file=path)
