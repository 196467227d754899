"""``strapdown run``: the main job."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapdown.cli import _job, _options, _output
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.report import Tiles


@_options.reads_log
def run(
    source: _options.Source,
    filter: _options.Filter = None,
    set_: _options.Set = None,
    sensor: _options.Sensor = None,
    calibration: _options.Calibration = None,
    smooth: _options.Smooth = False,
    outage: Annotated[
        list[str] | None,
        typer.Option(
            "--outage", metavar="S:S", help="Take the fixes away from then to then; repeatable."
        ),
    ] = None,
    export: Annotated[
        str | None,
        typer.Option("--export", metavar="kml,gpx,geojson,csv,tum", help="More files to write."),
    ] = None,
    tiles: Annotated[
        Path | None,
        typer.Option(
            "--tiles",
            metavar="PATH",
            help="Map below the track in the report: an MBTiles file or a folder of z/x/y.png.",
        ),
    ] = None,
    folder: _options.Folder = None,
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Find out what a log holds, estimate, compare with its reference, and report.

    Writes solution.parquet, summary.json and report.html; with --export also the track.
    """
    job = _job.Job(
        filter=filter,
        settings=tuple(set_ or ()),
        sensor=sensor,
        calibration=calibration,
        smooth=smooth,
        outages=tuple(_span(text) for text in outage or ()),
        exports=_kinds(export),
        folder=folder or _output.default_folder(source.main),
        report=not no_report,
        tiles=None if tiles is None else _tiles(tiles),
        json=json,
    )
    _job.do(job, str(source.main), source.read)


def _tiles(path: Path) -> "Tiles":
    from strapdown.report import Tiles

    return Tiles(path)


def _span(text: str) -> tuple[float, float]:
    """Return start and end [s] of ``300:360``."""
    try:
        start, stop = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"--outage must be START:END in seconds, got {text!r}.") from None
    if not start < stop:
        raise InputError(f"--outage must end after it starts, got {text!r}.")
    return start, stop


def _kinds(text: str | None) -> tuple[str, ...]:
    """Return the endings of ``kml,gpx``."""
    kinds = tuple(dict.fromkeys(k.strip().lower() for k in (text or "").split(",") if k.strip()))
    for kind in kinds:
        if kind not in _job.EXPORTS:
            raise InputError(f"--export must be of {', '.join(_job.EXPORTS)}, got {kind!r}.")
    return kinds
