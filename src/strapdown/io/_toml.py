"""TOML files that people edit: what is wrong with one is said in a sentence."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import tomlkit
from tomlkit.exceptions import TOMLKitError

from strapdown.errors import FormatError

_LARGEST_INT: Final = 2**63  # of TOML; a longer one does not fit into a double either


def read_toml(file: Path) -> dict[str, Any]:
    """Return the tables of a file.

    Raises
    ------
    FormatError
        If it is no TOML, names a key twice, or has an integer that is none of TOML's.
    """
    try:
        document: dict[str, Any] = tomlkit.parse(file.read_text(encoding="utf-8")).unwrap()
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise FormatError(f"must be TOML, got {error}", file=file) from None
    for key, value in _numbers(document, ""):
        if not -_LARGEST_INT <= value < _LARGEST_INT:
            raise FormatError(
                f"`{key}` must be a number of at most 64 bits, got {len(str(value))} digits",
                file=file,
            )
    return document


def _numbers(value: Any, key: str) -> Iterator[tuple[str, int]]:
    """Return every integer with its key."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _numbers(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        for inner in value:
            yield from _numbers(inner, key)
    elif isinstance(value, int):
        yield key, value
