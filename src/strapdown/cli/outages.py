"""``strapdown outages``: how far navigation drifts while fixes are missing, on real drives."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapdown.cli import _console, _errors, _options, _settings
from strapdown.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from strapdown.evaluation.outages import OutageStudy
    from strapdown.recording import Recording


@_options.reads_logs
def outages(
    sources: _options.Sources,
    filter: _options.Filter = None,
    set_: _options.Set = None,
    smooth: _options.Smooth = False,
    lengths: Annotated[
        str, typer.Option("--lengths", metavar="S,S", help="Lengths of the outages in seconds.")
    ] = "10,30,60",
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """Take the fixes away in fixed windows of each drive, and show the error at their end.

    Windows begin every 120 s, in two runs, where the reference is valid and moves. With --smooth
    the error is that of the smoother in the middle of a window.
    """
    from strapdown import estimator as estimators
    from strapdown.evaluation.outages import outage_study

    name = filter or _navigation()
    with _errors.given("--filter"):
        entry = estimators.entry(name)
    if entry.gives != "navigation":
        raise InputError(f"--filter must be a navigation filter, {name} gives {entry.gives}.")
    with _errors.given("--set"):
        flt = entry.cls(**_settings.parameters(name, entry.cls, set_ or ()))
    try:
        seconds = [float(part) for part in lengths.split(",")]
    except ValueError:
        raise InputError(f"--lengths must be numbers with commas, got {lengths!r}.") from None

    def drives() -> "Iterator[tuple[str, Recording]]":
        for source in sources:
            yield Path(source.main).name, source.read()

    with _console.progress(len(sources)) as progress, _errors.given():
        study = outage_study(drives(), flt, smooth=smooth, lengths=seconds, progress=progress.step)
    if json:
        _console.print_json(study.as_dict())
    else:
        _print(study)


def _navigation() -> str:
    """Return the navigation filter of the highest rank."""
    from strapdown import estimator as estimators

    return max(
        (e for e in estimators.entries() if e.gives == "navigation"), key=lambda e: e.rank
    ).name


def _print(study: "OutageStudy") -> None:
    """Print the table per length, the windows without solution, and how soon it began."""
    where = "in the middle, smoothed" if study.smoothed else "at the end"
    rows = [
        (
            f"{row['length_s']:g}",
            str(row["n"]),
            str(row["without_solution"]),
            *(f"{row[key]:.2f}" for key in ("median_m", "p95_m", "max_m")),
            f"{row['median_percent_of_distance']:.2f}",
            f"{row['median_heading_error_deg']:.2f}",
        )
        for row in study.summary()
    ]
    header = (
        "outage s", "n", "no solution", "median m", "95 % m", "largest m", "% of way",
        "heading deg",
    )  # fmt: skip
    title = f"{study.filter}: horizontal error of the antenna {where}"
    _console.print_table(title, header, rows, right=range(len(header)))
    print()
    starts = [
        (s.drive, f"{s.first_motion_s:.1f}", f"{s.first_solution_s:.1f}",
         f"{s.first_solution_s - s.first_motion_s:.1f}")
        for s in study.starts
    ]  # fmt: skip
    _console.print_table(
        "", ("drive", "first motion s", "first solution s", "after s"), starts, right=(1, 2, 3)
    )
    for window in study.windows:
        if not window.solution:
            print(f"no solution: {window.drive}, {window.start_s:g} s, {window.length_s:g} s")
