"""``strapdown convert``: from one format to another."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from strapdown.cli import _options
from strapdown.errors import InputError


@_options.reads_log
def convert(
    source: _options.Source,
    target: Annotated[
        Path | None, typer.Argument(help="File to write; its suffix says how.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    debug: _options.Debug = False,
) -> None:
    """Read a log and write it in another format: .parquet keeps everything, bit for bit.

    The solution.parquet of a run becomes .csv, .kml, .gpx, .geojson or .tum (for evo).
    """
    from strapdown import io

    if target is None and source.files:  # with one file per sensor, TARGET is the only path
        source, target = replace(source, log=None), source.log
    if target is None:
        raise InputError("there is no file to write to; see strapdown convert --help.")
    if target.exists() and not force:
        raise InputError(f"{target} is there already; give --force to replace it.")
    if source.log is not None and io.holds_solution(source.log):
        sol = io.read_solution(source.log)
        io.write_solution(sol, target)
        typer.echo(f"{target}: {sol.filter}, {len(sol)} samples")
        return
    rec = source.read()
    io.write(rec, target)
    typer.echo(f"{target}: {', '.join(row.name for row in rec.info())}")
