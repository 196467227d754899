"""From an exception to an exit status and one line for people."""

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager

from strapdown._checks import nearest
from strapdown.errors import InputError, StrapdownError

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130
INTERRUPTED_LINE = "interrupted; nothing was written."

# What a machine, not an input, lacks.
_MACHINE = (errno.ENOSPC, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM)


@contextmanager
def given(place: object = "") -> Iterator[None]:
    """Mark what is raised inside as the input's fault.

    Parameters
    ----------
    place : object
        File or option that is looked at; it leads the message unless the message names it.
    """
    try:
        yield
    except StrapdownError:
        raise
    except (ValueError, TypeError) as error:
        where = f"{place}: " if str(place) and str(place) not in str(error) else ""
        raise InputError(f"{where}{error}") from error


def verdict(error: BaseException) -> tuple[int, str]:
    """Return the exit status and the line, empty if there is nothing to say."""
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else FAILED, ""
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort":
        return INTERRUPTED, INTERRUPTED_LINE
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):
        return BAD_INPUT, _usage(error)
    if isinstance(error, InputError):
        return BAD_INPUT, _one_line(str(error))
    if isinstance(error, StrapdownError):
        return FAILED, _one_line(str(error))
    if isinstance(error, OSError):
        return FAILED if error.errno in _MACHINE else BAD_INPUT, _os_line(error)
    if isinstance(error, MemoryError):
        return FAILED, "memory is exhausted; use --from and --to to take a part of the log."
    return FAILED, _one_line(
        f"unexpected {type(error).__name__}: {error}; this is a fault of strapdown, "
        "please report it with what --debug prints."
    )


def _usage(error: BaseException) -> str:
    """Return typer's complaint about the command line as one sentence."""
    text = str(error.format_message())  # type: ignore[attr-defined]
    option, options = getattr(error, "option_name", ""), getattr(error, "possibilities", None)
    if options:
        text = f"{getattr(error, 'message', text)}{nearest(option, options)}"
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "strapdown"
    text = _one_line(text).rstrip(".?")
    text = re.sub(r"\. Did you mean (.*)$", r"; did you mean \1", text)
    return f"{text[:1].lower()}{text[1:]}; see {command} --help."


def _os_line(error: OSError) -> str:
    """Return what the operating system refused, and a way out of the common refusals."""
    reason = (error.strerror or str(error) or type(error).__name__).lower()
    ways_out = {
        errno.ENOENT: "check the path",
        errno.EACCES: "check its permissions, or choose another folder with -o",
        errno.EROFS: "choose another folder with -o",
        errno.ENOSPC: "free some space, or choose another folder with -o",
    }
    way_out = ways_out.get(error.errno or 0)
    names = " -> ".join(str(n) for n in (error.filename, error.filename2) if n is not None)
    text = f"{names}: {reason}" if names else reason
    return _one_line(text + (f"; {way_out}" if way_out else "") + ".")


def _one_line(text: str) -> str:
    return " ".join(text.split())
