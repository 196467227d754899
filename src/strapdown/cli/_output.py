"""The folder of results: made aside, then renamed; its own is replaced, a foreign one never."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from strapdown.errors import InputError

SUMMARY = "summary.json"
MARK = "made_by"  # key of the summary by which a folder is recognised


def default_folder(log: Path) -> Path:
    """Return ``./<log-stem>.strapdown`` for a file or folder of any suffixes."""
    name = log.resolve().name
    if not log.is_dir():
        name = name.split(".")[0] if name.endswith(".gz") else Path(name).stem
    return Path(f"{name or 'log'}.strapdown")


@contextmanager
def made_aside(folder: Path) -> Iterator[Path]:
    """Give a fresh folder beside `folder`, which takes its place when all went well.

    Raises
    ------
    InputError
        If `folder` is there and holds what this program did not write.
    OSError
        If its parent cannot be written.
    """
    target = folder.resolve()
    _require_own(folder, target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:  # name the folder, not the random name inside it
        raise type(error)(error.errno, error.strerror, str(target.parent)) from None
    try:
        aside.chmod(0o777 & ~_umask())  # mkdtemp makes private folders
        yield aside
        _take_place(aside, target)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file with a newline at its end."""
    path.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def _require_own(folder: Path, target: Path) -> None:
    """Refuse a target that is a file or holds other people's files."""
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"-o must name a folder, {folder} is a file; choose another name.")
    inside = {entry.name for entry in target.iterdir()}
    if not inside:
        return
    written = _written(target / SUMMARY)
    if written is None:
        raise InputError(
            f"{folder} is not empty and was not made by strapdown, so it is not replaced; "
            "choose another folder with -o."
        )
    foreign = sorted(inside - written)
    if foreign:
        raise InputError(
            f"{folder} holds {foreign[0]!r}, which strapdown did not write, so it is not "
            "replaced; move that away or choose another folder with -o."
        )


def _written(summary: Path) -> set[str] | None:
    """Return the names that a summary of this program lists, or None if it is none."""
    try:
        content: Any = json.loads(summary.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or not str(content.get(MARK, "")).startswith("strapdown "):
        return None
    outputs = content.get("outputs")
    paths = outputs.values() if isinstance(outputs, dict) else ()
    return {SUMMARY, *(Path(path).name for path in paths if isinstance(path, str))}


def _take_place(aside: Path, target: Path) -> None:
    """Rename `aside` to `target`; what was there goes only when the new one is in place."""
    if not target.exists():
        aside.rename(target)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        target.rename(old / "old")
        try:
            aside.rename(target)
        except OSError:
            (old / "old").rename(target)
            raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
