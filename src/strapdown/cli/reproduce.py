"""``strapdown reproduce``: the experiments of a thesis, printed tables beside computed ones."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapdown.cli import _console, _errors, _options

HEADER = ("item", "thesis", "here", "unit", "tolerance", "verdict", "remark")

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
    """Print the rows of an experiment, each remark once below them.

    Widths are those of the rows, not of the terminal: a line that is folded into columns of a few
    letters cannot be read, one that is too long can be scrolled.
    """
    notes = list(dict.fromkeys(row.remark for row in rows if row.remark))
    cells = [HEADER]
    for row in rows:
        note = f"[{notes.index(row.remark) + 1}]" if row.remark else ""
        figures = (_cell(row.thesis, 6), _cell(row.here, 5), row.unit)
        cells.append((row.item, *figures, row.tolerance, row.verdict.value, note))
    widths = [max(len(line[k]) for line in cells) for k in range(len(HEADER))]
    print(title)
    for n, line in enumerate(cells):
        text = "  ".join(
            cell.rjust(width) if k in (1, 2) else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        print(text.rstrip())
        if n == 0:
            print("-" * (sum(widths) + 2 * (len(widths) - 1)))
    for number, remark in enumerate(notes, 1):
        print(f"[{number}] {remark}")
    print()


def _cell(value: float | str | None, digits: int) -> str:
    """Return a figure; the thesis's keeps all that is printed."""
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.{digits}g}"
