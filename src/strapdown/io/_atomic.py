"""Files that are either whole or not there."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from strapdown.errors import FormatError


@contextlib.contextmanager
def written_aside(path: Path) -> Iterator[IO[bytes]]:
    """Yield a stream to a file beside `path`, which takes its place when all went well.

    Raises
    ------
    FormatError
        If the folder is missing, may not be written, or the disk is full. What stood at `path`
        before is then unchanged, and nothing else is left behind.
    """
    if path.is_dir():
        raise FormatError("cannot be written: there is a folder of this name", file=path)
    aside: str | None = None
    try:
        handle, aside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(aside, 0o666 & ~umask)  # mkstemp makes files that nobody else may read
        os.replace(aside, path)
    except BaseException as error:
        if aside is not None:
            with contextlib.suppress(OSError):
                os.unlink(aside)
        if isinstance(error, OSError):
            raise _unwritable(path, error) from None
        raise


def _unwritable(path: Path, error: OSError) -> FormatError:
    """Return the error for a file that cannot be written."""
    if isinstance(error, PermissionError):
        return FormatError(
            "cannot be written: permission denied",
            file=path,
            hint="choose a folder that you may write to",
        )
    if isinstance(error, FileNotFoundError):
        return FormatError(
            f"cannot be written: there is no folder {str(path.parent)!r}", file=path
        )
    return FormatError(f"cannot be written: {error.strerror or error}", file=path)
