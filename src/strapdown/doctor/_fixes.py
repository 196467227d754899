"""GNSS fixes: latency, stale headings, absurd sigmas, jumps, velocity against position."""

from typing import Final

import numpy as np

from strapdown.doctor._course import turns_of
from strapdown.doctor._finding import Finding, Severity, short
from strapdown.doctor._log import Grid, Log
from strapdown.doctor._rest import rest_bias
from strapdown.recording import Gnss
from strapdown.units import DEG

_LAGS_S: Final = np.arange(-3.0, 3.01, 0.1)
_LATE_NOTE_S: Final = 0.15
_LATE_WARNING_S: Final = 0.4
_LEVER_M: Final = 3.0  # an antenna so far ahead of the turning point leads by this over the speed
_MOVING_M_S: Final = 3.0
_STALE_S: Final = 3.0
_JUMP_M: Final = 30.0
_WAY_S: Final = 4.0  # way and velocity are compared over this time
_GAP: Final = 2.5  # median intervals
_SIGMAS_M: Final = (1e-3, 1e3)


def gnss_findings(log: Log, grid: Grid | None, scale: float) -> list[Finding]:
    """Return what the fixes show of themselves and against the inertial sensors.

    Parameters
    ----------
    log, grid
        The sensors.
    scale : float
        Factor that the gyroscope's values need.
    """
    gnss = log.gnss
    if gnss is None or len(gnss.t) < 5:
        return []
    found = [_sigmas(gnss), _heading(gnss), _jumps(gnss), _velocity(gnss)]
    if grid is not None and "acc" in grid.fields:
        found.append(_latency(gnss, grid, scale))
    return [finding for finding in found if finding is not None]


def _finding(
    check: str, severity: Severity, sentence: str, advice: str = "", confidence: float = 0.95
) -> Finding:
    return Finding(
        check=check,
        severity=severity,
        sentence=sentence,
        advice=advice,
        confidence=confidence,
        stream="gnss",
    )


def _sigmas(gnss: Gnss) -> Finding | None:
    """Return standard deviations that cannot be: zero, negative, constant or enormous."""
    std = gnss.std_position_n
    if std is None:
        return None
    std = std[np.isfinite(std).all(axis=1)]
    low, high = _SIGMAS_M
    absurd = int(((std < low) | (std > high)).any(axis=1).sum())
    advice = "State the receiver's own figures, or give the estimator a fixed one."
    if absurd:
        text = (
            f"{absurd} of {len(std)} stated position sigmas are absurd (below 1 mm, above 1 km)."
        )
        return _finding("sigmas", Severity.WARNING, text, advice, 1.0)
    if len(std) > 20 and (np.ptp(std, axis=0) == 0.0).all():
        text = "The stated position sigmas never change: they are no estimate of the receiver."
        return _finding("sigmas", Severity.NOTE, text, advice)
    text = f"The stated position sigmas lie between {short(std.min())} and {short(std.max())} m."
    return _finding("sigmas", Severity.OK, text) if len(std) else None


def _heading(gnss: Gnss) -> Finding | None:
    """Return headings that do not follow the course."""
    if gnss.heading is None or gnss.v_n is None:
        return None
    speed = np.hypot(gnss.v_n[:, 0], gnss.v_n[:, 1])
    moving = (speed > _MOVING_M_S) & np.isfinite(gnss.heading)
    if moving.sum() < 10:
        return None
    course = np.arctan2(gnss.v_n[:, 1], gnss.v_n[:, 0])
    off = np.abs((gnss.heading - course + np.pi) % (2.0 * np.pi) - np.pi)[moving]
    stale = np.diff(gnss.heading[moving]) == 0.0
    share = float(stale.mean())
    typical = float(np.median(off))
    if share > 0.5:
        text = (
            f"The stated heading stands still in {100.0 * share:.0f} % of the fixes on the move."
        )
        return _finding("heading", Severity.WARNING, text, "Use the velocity instead of it.")
    if typical > 20.0 * DEG:
        text = f"The stated heading is {typical / DEG:.0f}° off the course over ground (median)."
        advice = "Check its unit and what it is measured from."
        return _finding("heading", Severity.WARNING, text, advice)
    at_rest = ~moving & (speed < 0.5)
    held = at_rest.sum() > 1 and (np.diff(gnss.heading[at_rest]) == 0.0).mean() > 0.5
    text = f"The stated heading follows the course within {typical / DEG:.1f}° (median)"
    text += ", and is stale at rest." if held else "."
    return _finding("heading", Severity.NOTE if held else Severity.OK, text)


def _jumps(gnss: Gnss) -> Finding | None:
    """Return fixes that lie far from where the last one and the velocity put them."""
    if gnss.v_n is None:
        return None
    from strapdown.earth import ned_from_lla

    sound = np.isfinite(gnss.lla).all(axis=1) & np.isfinite(gnss.v_n).all(axis=1)
    if sound.sum() < 5:
        return None
    t, v = gnss.t[sound], gnss.v_n[sound]
    r = ned_from_lla(gnss.lla[sound], gnss.lla[sound][0])
    dt = np.diff(t)
    off = np.linalg.norm(
        (np.diff(r, axis=0) - 0.5 * (v[1:] + v[:-1]) * dt[:, None])[:, :2], axis=1
    )
    jumps = (off > _JUMP_M) & (dt < 5.0)
    if not jumps.any():
        return None
    n, k = int(jumps.sum()), int(np.argmax(jumps))
    text = f"{n} fix{'es' if n > 1 else ''} jump{'' if n > 1 else 's'} by more than "
    text += f"{_JUMP_M:.0f} m, first at {t[k + 1]:.1f} s."
    advice = "Estimators reject single ones; leave a bad stretch out with --from and --to."
    return _finding("jumps", Severity.WARNING, text, advice)


def _velocity(gnss: Gnss) -> Finding | None:
    """Return whether velocities are the rate of the positions: units and frames."""
    if gnss.v_n is None:
        return None
    from strapdown.earth import ned_from_lla

    sound = np.isfinite(gnss.lla).all(axis=1) & np.isfinite(gnss.v_n).all(axis=1)
    t, v = gnss.t[sound], gnss.v_n[sound]
    if len(t) < 20:
        return None
    r = ned_from_lla(gnss.lla[sound], gnss.lla[sound][0])[:, :2]
    dt = np.diff(t)
    gap = dt > max(_GAP * float(np.median(dt)), 1.0)
    path = np.concatenate(
        (np.zeros((1, 2)), np.cumsum(0.5 * (v[1:] + v[:-1])[:, :2] * dt[:, None], axis=0))
    )
    # Over seconds: from fix to fix, the noise of positions is larger than the way.
    last = np.minimum(np.searchsorted(t, t + _WAY_S), len(t) - 1)
    gaps = np.concatenate(([0], np.cumsum(gap)))
    pairs = (last > np.arange(len(t))) & (gaps[last] == gaps) & (t[last] - t < 2.0 * _WAY_S)
    if not pairs.any():
        return None
    seconds = (t[last] - t)[pairs, None]
    rate = (r[last] - r)[pairs] / seconds
    mean = (path[last] - path)[pairs] / seconds
    fast = np.linalg.norm(rate, axis=1) > _MOVING_M_S
    if fast.sum() < 20:
        return None
    rate, mean = rate[fast], mean[fast]
    readings = {
        "is": mean,
        "has north and east exchanged against": mean[:, ::-1],
        "has the opposite sign of": -mean,
        "has the opposite sign in east of": mean * (1.0, -1.0),
        "has the opposite sign in north of": mean * (-1.0, 1.0),
        "is, in km/h taken for m/s,": mean / 3.6,
        "is, in m/s taken for km/h,": mean * 3.6,
    }
    off = {k: float(np.median(np.linalg.norm(rate - m, axis=1))) for k, m in readings.items()}
    best = min(off, key=lambda k: off[k])
    speed = float(np.median(np.linalg.norm(rate, axis=1)))
    if best == "is" and off[best] < 0.3 * speed:
        text = f"The velocity is the rate of the position within {short(off[best])} m/s (median)."
        return _finding("velocity", Severity.OK, text)
    if off[best] < 0.3 * speed:
        text = f"The velocity {best} the rate of the position."
        return _finding("velocity", Severity.ERROR, text, "Correct the columns with --columns.")
    text = f"The velocity is not the rate of the position: {short(off['is'])} m/s apart (median)."
    return _finding("velocity", Severity.WARNING, text, "Check its columns and frame.")


def _latency(gnss: Gnss, grid: Grid, scale: float) -> Finding | None:
    """Return the time shift at which course and gyroscope agree best."""
    gyr = scale * (grid.fields["gyr"] - rest_bias(grid, gnss))
    acc = grid.fields["acc"]
    turns = turns_of(gnss, grid.t, gyr, acc)
    if turns is None or float(np.sqrt(np.mean(turns.course**2))) < 0.03:
        return None
    scores = []
    for lag in _LAGS_S:
        shifted = turns_of(gnss, grid.t, gyr, acc, float(lag))
        if shifted is None:
            return None
        x, y = shifted.products[:, [0, 4, 8]].sum(axis=1), shifted.course
        scores.append(np.median(np.abs(y - x) / (0.02 + np.abs(y))))
    k = int(np.argmin(scores))
    if scores[k] > 0.5 or k in (0, len(scores) - 1):
        return None
    a, b, c = scores[k - 1], scores[k], scores[k + 1]
    vertex = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c > 0.0 else 0.0
    lag = float(_LAGS_S[k] + vertex * (_LAGS_S[1] - _LAGS_S[0]))
    size = abs(lag)
    speed = np.hypot(gnss.v_n[:, 0], gnss.v_n[:, 1]) if gnss.v_n is not None else np.ones(1)
    beyond = size - _LEVER_M / max(float(np.median(speed[speed > _MOVING_M_S])), _MOVING_M_S)
    text = f"The fixes are {size:.2f} s {'late' if lag > 0.0 else 'early'} against the gyroscope"
    text += ", more than an antenna off the turning point explains." if beyond > 0.0 else "."
    severity = (
        Severity.WARNING
        if beyond > _LATE_WARNING_S
        else Severity.NOTE
        if beyond > _LATE_NOTE_S
        else Severity.OK
    )
    advice = "Stamp fixes with their time of validity, not of arrival."
    return _finding("latency", severity, text, "" if severity is Severity.OK else advice, 0.9)
