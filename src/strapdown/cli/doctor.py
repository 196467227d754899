"""``strapdown doctor``: what a log really holds."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from strapdown.cli import _console, _errors, _options
from strapdown.errors import FormatError, InputError
from strapdown.units import DEG

if TYPE_CHECKING:
    from strapdown.doctor import Finding
    from strapdown.io import RawLog
    from strapdown.recording import Recording

_RAW_OPTIONS = ("format", "columns", "units", "rate", "delimiter")


@_options.reads_log
def doctor(
    source: _options.Source,
    up: Annotated[
        str | None,
        typer.Option("--up", metavar="AXIS", help="The box's axis that is up at the start: -z."),
    ] = None,
    place: Annotated[
        str | None,
        typer.Option("--place", metavar="LAT,LON", help="Where it was, in degrees: 52.5,13.4."),
    ] = None,
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """Test units, axes, signs, times and health of a log against its own data.

    A log that cannot be read is examined as far as its columns go. The reference is not used.
    """
    from strapdown.doctor import examine

    where = None if place is None else _place(place)
    with _errors.given("--up"):
        findings = examine(_opened(source), up=up, place=where)
    if json:
        _console.print_json({"log": str(source.main), "findings": [asdict(f) for f in findings]})
    else:
        _print(str(source.main), findings)


def _place(text: str) -> tuple[float, float]:
    """Return latitude and longitude [rad] of ``52.5,13.4``."""
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--place must be LAT,LON in degrees, got {text!r}.") from None
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        raise InputError(f"--place must be on the Earth, got {text!r}.")
    return latitude * DEG, longitude * DEG


def _opened(source: _options.Source) -> "Recording | RawLog":
    """Return the recording, or the raw log where no recording can be made."""
    from strapdown import io

    try:
        return source.read()
    except FormatError as refused:
        if source.log is None:
            raise
        options = {k: v for k, v in source.options.items() if k in _RAW_OPTIONS}
        try:
            raw = io.read_raw(source.log, **options)
        except InputError:
            raise refused from None
        if not any(raw.faults()):
            raise
        return raw


def _print(log: str, findings: "tuple[Finding, ...]") -> None:
    """Print a line for each finding, and the count of those that matter."""
    rows = [
        (f.severity.value, f.check, f.stream, f"{100.0 * f.confidence:.3g} %", str(f))
        for f in findings
    ]
    _console.print_table(log, ("", "check", "stream", "sure", "finding"), rows, right=(3,))
    counts = [
        f"{n} {word}{'s' if n != 1 else ''}"
        for word in ("error", "warning", "note")
        if (n := sum(f.severity.value == word for f in findings))
    ]
    print(", ".join(counts) or "nothing to object to")


def brief(rec: "Recording") -> list[str]:
    """Return one line for other verbs, or none: the gravest alarm of a quick look.

    Parameters
    ----------
    rec : Recording
        The log.

    Returns
    -------
    list of str
        Empty if there is nothing to object to.
    """
    from strapdown.doctor import examine

    alarms = [finding for finding in examine(rec, quick=True) if finding.is_alarm]
    if not alarms:
        return []
    more = f" (and {len(alarms) - 1} more)" if len(alarms) > 1 else ""
    return [f"{alarms[0].sentence} `strapdown doctor` says what to do{more}."]
