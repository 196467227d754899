"""``strapdown filters``: what there is, what each needs, where it comes from."""

import dataclasses
import inspect
import re
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapdown.cli import _console, _errors, _options

if TYPE_CHECKING:
    from strapdown.estimator import Entry

_MULTILINE = re.MULTILINE | re.DOTALL
_HEADER = ("filter", "needs", "uses", "gives", "offline twin", "source", "cost per sample")


def filters(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="Show the parameters of this one."),
    ] = None,
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """List the estimators, or show what one of them is and takes."""
    from strapdown import estimator as estimators

    if name is None:
        rows = [_facts(entry) for entry in estimators.entries()]
        if json:
            _console.print_json({"filters": rows})
        else:
            _list(rows)
        return
    with _errors.given("NAME"):
        entry = estimators.entry(name)
    if json:
        _console.print_json({**_facts(entry), "parameters": _parameters(entry)})
    else:
        _show(entry)


def _facts(entry: "Entry") -> dict[str, Any]:
    """Return what the registry knows, as JSON has it."""
    return {
        "name": entry.name,
        "summary": entry.summary,
        "needs": ["imu", *entry.needs],
        "uses": list(entry.uses),
        "gives": entry.gives,
        "causal": True,  # `run` always is; the offline twin is not
        "smooths": entry.smooths,
        "source": entry.source,
        "cost": entry.cost,
    }


def _parameters(entry: "Entry") -> dict[str, Any]:
    """Return the parameters and their defaults."""
    return {f.name: f.default for f in dataclasses.fields(entry.cls)}  # type: ignore[arg-type]


def _list(rows: list[dict[str, Any]]) -> None:
    cells = [
        (
            row["name"],
            " ".join(row["needs"]),
            " ".join(row["uses"]),
            row["gives"],
            "yes" if row["smooths"] else "no",
            row["source"],
            row["cost"],
        )
        for row in rows
    ]
    _console.print_table("", _HEADER, cells)
    print("\nstrapdown filters NAME shows the parameters of one; --set KEY=VALUE sets them.")


def _show(entry: "Entry") -> None:
    text = inspect.cleandoc(entry.cls.__doc__ or entry.name)
    print(text.partition("\nParameters\n")[0].rstrip())
    print(f"\nSource: {entry.source}\n")
    meanings: dict[str, str] = {}
    for cls in entry.cls.__mro__:
        meanings = _meanings(inspect.cleandoc(cls.__doc__ or "")) | meanings
    rows = [
        (key, _text(value), meanings.get(key, "")) for key, value in _parameters(entry).items()
    ]
    _console.print_table("", ("parameter", "default", "meaning"), rows)


def _meanings(docstring: str) -> dict[str, str]:
    """Return what a numpydoc docstring says of each parameter."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", docstring, _MULTILINE)
    found: dict[str, str] = {}
    for item in re.finditer(
        r"^(\S.*?) : .*\n((?:[ ]+.*\n?|\n)*)", section[1] if section else "", re.MULTILINE
    ):
        for name in item[1].split(","):
            found[name.strip()] = " ".join(item[2].split())
    return found


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
