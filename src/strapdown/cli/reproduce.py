"""``strapdown reproduce``: the experiments of a thesis, printed tables beside computed ones."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapdown.cli import _console, _errors, _options

if TYPE_CHECKING:
    from strapdown.systems import Part, Row, Shown


def reproduce(
    system: Annotated[
        str, typer.Argument(help="platform, kinematic, indoor, uav or gnssins.", metavar="SYSTEM")
    ],
    part: Annotated[
        str | None, typer.Option("--part", metavar="NAME", help="One experiment only.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of all that is simulated.", min=0)] = 0,
    report: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Write a report, as HTML."),
    ] = None,
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """Run the experiments of a thesis and print each figure beside the printed one.

    met: follows from printed inputs. recovered: came back from data simulated with the printed
    parameters. missed: did not, the remark says why. not given: the thesis prints no figure.
    """
    from strapdown import systems

    with _errors.given():
        chosen = systems.parts(system, part)
    found: list[tuple[Part, Shown]] = []
    with _console.progress(len(chosen) + 1) as progress:
        for experiment in chosen:
            progress.step(f"{system}: {experiment.title}")
            found.append((experiment, experiment.run(seed)))
        if report is not None:
            from strapdown.systems import page

            progress.step("writing the report")
            page.write(system, found, report)
    rows = [row for _, shown in found for row in shown.rows]
    if json:
        _console.print_json({"system": system, "rows": [row.summary() for row in rows]})
        return
    for experiment, shown in found:
        _print(f"{experiment.title} ({experiment.source})", shown.rows)
    print(", ".join(f"{_count(rows, v)} {v.value}" for v in systems.Verdict))
    if report is not None:
        print(report)


def _count(rows: "list[Row]", verdict: str) -> int:
    return sum(row.verdict == verdict for row in rows)


def _print(title: str, rows: "Sequence[Row]") -> None:
    """Print the rows of an experiment."""
    cells = [
        (
            row.item,
            _cell(row.thesis),
            _cell(row.here),
            row.unit,
            row.tolerance,
            row.verdict.value,
            row.remark,
        )
        for row in rows
    ]
    header = ("item", "thesis", "here", "unit", "tolerance", "verdict", "remark")
    _console.print_table(title, header, cells, right=(1, 2))
    print()


def _cell(value: float | str | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.4g}"
