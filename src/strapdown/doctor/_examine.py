"""All checks of a log, in order."""

from typing import Final

from strapdown.doctor import _axes, _scales
from strapdown.doctor._finding import Finding, Severity, worst_first
from strapdown.doctor._log import Log, grid_of, log_of
from strapdown.io._raw import RawLog
from strapdown.recording import Recording

_LONGEST_S: Final = 1800.0  # of a longer log, its first part of this length is asked about axes
_QUICK_S: Final = 100.0


def examine(source: Recording | RawLog, *, quick: bool = False) -> tuple[Finding, ...]:
    """Return what the data say about a log, the gravest first.

    Parameters
    ----------
    source : Recording or RawLog
        What `io.read` or `io.read_raw` returned. Its reference is not looked at.
    quick : bool
        Whether to leave out what takes long: units and axes are asked on the first 100 s only.

    Returns
    -------
    tuple of Finding
        One for each question that could be asked.
    """
    log = log_of(source)
    findings = [*_faults(log), *_units(log)]
    grid = grid_of(log, _QUICK_S if quick else _LONGEST_S)
    if grid is not None:
        findings += _axes.axes_findings(log, _axes.relations(log, grid, quick=quick))
    if not any(f.check == "units" and f.stream == "gyr" for f in findings):
        large = _scales.gyr_magnitude(log)
        findings += [large] if large is not None else []
    return worst_first(findings)


def _faults(log: Log) -> list[Finding]:
    """Return why `io.read` refuses the log."""
    return [
        Finding(
            check="reading",
            severity=Severity.ERROR,
            sentence=f"`read` refuses the log: {what}.",
            advice=hint,
            stream=stream,
        )
        for stream, what, hint in log.faults
    ]


def _units(log: Log) -> list[Finding]:
    found = (_scales.acc_units(log), _scales.mag_units(log))
    return [finding for finding in found if finding is not None]
