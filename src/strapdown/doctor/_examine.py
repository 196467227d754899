"""All checks of a log, in order."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from strapdown._checks import as_floats, as_vector, in_range, one_of, recording
from strapdown._types import BoolArray
from strapdown.doctor import _axes, _field, _fixes, _health, _scales, _time
from strapdown.doctor._finding import Finding, Severity, worst_first
from strapdown.doctor._log import Grid, Log, grid_of, log_of
from strapdown.doctor._rest import may_rest
from strapdown.io._raw import RawLog
from strapdown.motion import RestTest, rest_mask
from strapdown.recording import Gnss, Recording
from strapdown.units import DPS

_LONGEST_S: Final = 1800.0  # of a longer log, its first part of this length is asked about axes
_QUICK_S: Final = 100.0
_LARGEST_BIAS: Final = 12.0 * DPS  # a larger mean rate is taken for motion
_REST_S: Final = 3.0  # of rest in all, for a bias


def examine(
    source: Recording | RawLog,
    *,
    quick: bool = False,
    up: str | None = None,
    place: Sequence[float] | None = None,
) -> tuple[Finding, ...]:
    """Return what the data say about a log, the gravest first.

    Parameters
    ----------
    source : Recording or RawLog
        What `io.read` or `io.read_raw` returned. Its reference is not looked at.
    quick : bool
        Whether to ask for units and axes only, on the first 100 s.
    up : {'x', '-x', 'y', '-y', 'z', '-z'}, optional
        The box's axis that points up at the start; it settles the accelerometer's sign.
    place : sequence of float, optional
        Latitude and longitude [rad], and height [m] if known, of a log that does not state them;
        they settle the sign of the magnetometer against the accelerometer.

    Returns
    -------
    tuple of Finding
        One for each question that could be asked.

    Raises
    ------
    ValueError
        If `up` names no axis or `place` is not on the Earth.
    """
    if up is not None:
        one_of("up", up, _field.UP_AXES)
    if not isinstance(source, RawLog):
        recording("source", source)
    log = log_of(source)
    if place is not None:
        log = _placed(log, place)
    findings = [*_faults(log), *_units(log)]
    grid = grid_of(log, _QUICK_S if quick else _LONGEST_S)
    scale = 1.0
    if grid is not None:
        relations = _axes.relations(log, grid, quick=quick)
        scale = next((r.scale for r in relations if r.scale != 1.0), 1.0)
        findings += _axes.axes_findings(log, relations)
    if not any(f.check == "units" and f.stream == "gyr" for f in findings):
        large = _scales.gyr_magnitude(log)
        findings += [large] if large is not None else []
    if quick:
        return worst_first(findings)
    findings += _time.time_findings(log)
    findings += _health.health_findings(log)
    if grid is not None:
        findings += _seen_on_grid(log, grid, scale, up)
    findings += _fixes.gnss_findings(log, grid, scale)
    return worst_first(findings)


def _placed(log: Log, place: Sequence[float]) -> Log:
    """Return the log with a place in its metadata, which outranks its fixes."""
    point = as_floats("place", place)
    if point.shape not in ((2,), (3,)):
        raise ValueError(
            "`place` must be latitude and longitude, and height if known, "
            f"got shape {point.shape}."
        )
    point = as_vector("place", [*point, 0.0][:3])
    in_range("place[0]", float(point[0]), -0.5 * np.pi, 0.5 * np.pi)
    names = ("lat_rad", "lon_rad", "height_m")
    return replace(log, meta={**log.meta, **dict(zip(names, point.tolist(), strict=True))})


def _seen_on_grid(log: Log, grid: Grid, scale: float, up: str | None) -> list[Finding]:
    """Return what needs the sensors on one axis."""
    found = [
        _field.motion_finding(grid, scale),
        _field.up_finding(grid, up),
        _field.mag_calibration(grid),
        *_field.dip_findings(log, grid),
    ]
    rest = _rest(grid, log.gnss, scale)
    if rest is not None:
        gyr = scale * grid.fields["gyr"][rest]
        found.append(_health.bias_finding(gyr.mean(axis=0), len(gyr) * grid.dt))
    return [finding for finding in found if finding is not None]


def _rest(grid: Grid, gnss: Gnss | None, scale: float) -> BoolArray | None:
    """Return where the box rests, or None if it hardly ever does."""
    if "acc" not in grid.fields:
        return None
    gyr, acc = scale * grid.fields["gyr"], grid.fields["acc"]
    rest = rest_mask(grid.t, gyr, acc, RestTest(max_rate=_LARGEST_BIAS)) & may_rest(grid, gnss)
    return rest if rest.sum() * grid.dt > _REST_S else None


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
