"""The command `strapdown`: its verbs, and how any of them ends."""

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Annotated

import typer

from strapdown import __version__
from strapdown.cli import (
    _console,
    _errors,
    calibrate,
    characterize,
    compare,
    convert,
    demo,
    doctor,
    filters,
    info,
    outages,
    reproduce,
    run,
    simulate,
)

app = typer.Typer(
    name="strapdown",
    help="From a bare MEMS sensor to a validated navigation solution.",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
app.command("run")(run.run)
app.command("demo")(demo.demo)
app.command("info")(info.info)
app.command("doctor")(doctor.doctor)
app.command("convert")(convert.convert)
app.command("compare")(compare.compare)
app.command("outages")(outages.outages)
app.command("filters")(filters.filters)
app.command("characterize")(characterize.characterize)
app.add_typer(calibrate.app, name="calibrate")
app.command("simulate")(simulate.simulate)
app.command("reproduce")(reproduce.reproduce)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"strapdown {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    ctx: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")
    ] = False,
) -> None:
    """From a bare MEMS sensor to a validated navigation solution."""
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; errors are one line on stderr.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the command's name; what the process was called with by default.

    Returns
    -------
    int
        0, or 2 for bad input, 1 for a failed computation, 130 when interrupted.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    with _console.warnings_as_lines():
        try:
            _raise_on_termination()
            status = app(args=words, prog_name="strapdown", standalone_mode=False)
        except BrokenPipeError:  # the reader, such as `head`, has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except BaseException as error:
            if "--debug" in words and not isinstance(error, SystemExit):
                raise
            status, line = _errors.verdict(error)
            if line:
                _console.error(line)
            return status
    if status == _errors.INTERRUPTED:  # typer caught it
        _console.error(_errors.INTERRUPTED_LINE)
    return status if isinstance(status, int) else 0


def _raise_on_termination() -> None:
    """Let a polite kill unwind the stack, so that half-written folders are removed."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + signal.SIGTERM)

    try:
        signal.signal(signal.SIGTERM, stop)
    except ValueError:  # not the main thread, as in a notebook
        return
