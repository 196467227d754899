"""Options of the form ``key=value``: split, checked against what there is, converted."""

import dataclasses
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from strapdown._checks import nearest
from strapdown.errors import InputError

_TRUE = ("true", "yes", "on", "1")
_FALSE = ("false", "no", "off", "0")


def pairs(option: str, texts: Iterable[str]) -> dict[str, str]:
    """Return the keys and values of ``key=value`` texts.

    Parameters
    ----------
    option : str
        Its name, for messages.
    texts : iterable of str
        What was given.

    Raises
    ------
    InputError
        If one lacks its key, ``=`` or value, or a key comes twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise InputError(f"{option} must be key=value, got {text!r}.")
        if key in found:
            raise InputError(f"{option} must name each key once, got {key!r} twice.")
        found[key] = value
    return found


def parameters(name: str, cls: type, texts: Sequence[str]) -> dict[str, Any]:
    """Return the parameters of an estimator that ``--set key=value`` options give.

    Parameters
    ----------
    name : str
        The estimator's name, for messages.
    cls : type
        Its dataclass; annotations say what a value is converted to.
    texts : sequence of str
        What was given.

    Raises
    ------
    InputError
        If the estimator has no such parameter, or the text cannot be converted.
    """
    given = pairs("--set", texts)
    if not given:
        return {}
    fields = [f.name for f in dataclasses.fields(cls) if f.init]
    hints = typing.get_type_hints(cls)
    for key in given:
        if key not in fields:
            near = nearest(key, fields) or f"; it has {', '.join(fields)}"
            raise InputError(f"--set {key}: {name} has no parameter {key!r}{near}.")
    return {key: _convert(key, text, hints[key]) for key, text in given.items()}


def _convert(key: str, text: str, hint: Any) -> Any:
    """Return `text` as the type that an annotation asks for."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return _convert_union(key, text, typing.get_args(hint))
    if origin is typing.Literal:
        choices = [str(choice) for choice in typing.get_args(hint)]
        if text not in choices:
            raise _wrong(key, f"one of {', '.join(choices)}", text)
        return typing.get_args(hint)[choices.index(text)]
    if hint is bool:
        if text.lower() not in _TRUE + _FALSE:
            raise _wrong(key, "true or false", text)
        return text.lower() in _TRUE
    if hint in (float, int):
        try:
            return hint(text)
        except ValueError:
            kind = "a number" if hint is float else "a whole number"
            raise _wrong(key, kind, text) from None
    if origin in (tuple, list) or hint in (tuple, list) or _is_array(hint):
        return _numbers(key, text, typing.get_args(hint))
    return text


def _convert_union(key: str, text: str, members: tuple[Any, ...]) -> Any:
    """Try the members in the order in which they can fail: None, then all but text."""
    if type(None) in members and text.lower() == "none":
        return None
    kinds = sorted((m for m in members if m is not type(None)), key=lambda m: m is str)
    for kind in kinds[:-1]:
        try:
            return _convert(key, text, kind)
        except InputError:
            continue
    return _convert(key, text, kinds[-1])


def _numbers(key: str, text: str, members: tuple[Any, ...]) -> tuple[float, ...]:
    """Return comma-separated numbers."""
    parts = text.strip("()[] ").split(",")
    many = Ellipsis not in members and members and all(m in (float, int) for m in members)
    count = len(members) if many else len(parts)
    try:
        numbers = tuple(float(part) for part in parts)
    except ValueError:
        numbers = ()
    if len(numbers) != count or not numbers:
        raise _wrong(key, f"{count if many else 'some'} numbers with commas between", text)
    return numbers


def _is_array(hint: Any) -> bool:
    return "ndarray" in str(typing.get_origin(hint) or hint)


def _wrong(key: str, must: str, text: str) -> InputError:
    return InputError(f"--set {key}: must be {must}, got {text!r}.")


def mapping_text(values: Mapping[str, Any]) -> str:
    """Return parameters as people type them, ``beta=0.12, zeta=0``."""
    return ", ".join(
        f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
        for key, value in values.items()
    )
