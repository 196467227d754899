"""``strapdown simulate``: a recording of a scenario, with its truth as reference."""

from pathlib import Path
from typing import Annotated

import typer

from strapdown.cli import _errors, _options
from strapdown.errors import InputError


def simulate(
    scenario: Annotated[
        str | None,
        typer.Argument(metavar="SCENARIO", help="A TOML file, or the name of a shipped one."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Log to write; default NAME.parquet."),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Same seed, same recording.")
    ] = 1,
    list_: Annotated[
        bool, typer.Option("--list", help="Say which scenarios are shipped, and stop.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    debug: _options.Debug = False,
) -> None:
    """Simulate a device in motion and write its recording, with the truth as reference."""
    from strapdown import io
    from strapdown.simulation import load, names

    if list_:
        width = max(len(name) for name in names())
        for name in names():
            typer.echo(f"{name:{width}}  {load(name).description}")
        return
    if scenario is None:
        raise InputError(
            "there is no scenario; give a TOML file or a name, see strapdown simulate --list."
        )
    with _errors.given(scenario):
        chosen = load(scenario)
        target = output or Path(f"{chosen.name}.parquet")
        if target.exists() and not force:
            raise InputError(f"{target} is there already; give --force to replace it.")
        recording = chosen.record(seed)
    io.write(recording, target)
    typer.echo(f"{target}: {', '.join(row.name for row in recording.info())}")
