"""``strapdown demo``: the main job on a log that is simulated on the spot."""

from pathlib import Path
from typing import Annotated

import typer

from strapdown.cli import _errors, _job, _options


def demo(
    filter: _options.Filter = None,
    set_: _options.Set = None,
    folder: _options.Folder = None,
    seconds: Annotated[float, typer.Option("--seconds", help="Length of the log.")] = 60.0,
    rate: Annotated[
        float, typer.Option("--rate", metavar="HZ", help="Samples per second.")
    ] = 100.0,
    seed: Annotated[int, typer.Option("--seed", help="Of the sensors' noise.")] = 1,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE", help="Keep the simulated log.")
    ] = None,
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Run on an embedded simulated log: no file, no device, no network needed.

    A box in a hand rests, is turned and waved about for a minute, and rests again. Its true
    attitude is known, so the errors are printed too.
    """
    from strapdown import io
    from strapdown.recording import Recording
    from strapdown.simulation.demo import recording

    def simulate() -> Recording:
        with _errors.given():
            rec = recording(seconds, rate, seed=seed)
        if save is not None:
            io.write(rec, save)
        return rec

    job = _job.Job(
        filter=filter,
        settings=tuple(set_ or ()),
        folder=folder or Path("demo.strapdown"),
        report=not no_report,
        json=json,
    )
    _job.do(job, "demo", simulate)
