"""GNSS outages: how far a solution has drifted when fixes come back, on real drives.

Windows of 10, 30 and 60 s begin at 120 s and every 120 s from there, and in a second run at 180 s
and every 120 s. The reference alone decides which count: valid at both ends, mount present, mean
speed above 2 m/s. Each length and phase is a run of its own, with the fixes of its windows taken
away. The error is taken at the antenna: for a causal estimator at the end of the window, for a
smoother in the middle. A window without a solution counts as an infinite error.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.earth import lla_from_ned, ned_from_lla
from strapdown.estimator import Estimator
from strapdown.recording import PositionReference, Recording
from strapdown.rotation import quat_conj, quat_mul, rotate
from strapdown.solution import Solution, Status

LENGTHS: Final = (10.0, 30.0, 60.0)
PHASES: Final = (120.0, 180.0)
EVERY: Final = 120.0
LEAST_SPEED: Final = 2.0  # mean speed of the reference in a window that counts [m/s]
MOTION_SPEED: Final = 1.0  # the drive begins when the reference is faster [m/s]
_NEAR: Final = 0.5  # a reference sample this near stands for an end of a window [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """One outage of one drive.

    Attributes
    ----------
    drive : str
        Name of the drive.
    length_s, start_s : float
        Length and beginning of the outage [s].
    horizontal_error_m, vertical_error_m : float
        Error at the antenna [m]; infinite without a solution. Vertical is positive upwards.
    percent_of_distance : float
        Horizontal error in percent of the way since the start of the window.
    heading_error_deg : float or None
        Heading less reference, where the reference has a valid attitude.
    solution : bool
        Whether there was a solution when the outage began and when the error was taken.
    """

    drive: str
    length_s: float
    start_s: float
    horizontal_error_m: float
    vertical_error_m: float
    percent_of_distance: float
    heading_error_deg: float | None
    solution: bool

    def as_dict(self) -> dict[str, Any]:
        """Return JSON-like values; what is infinite or not known is None."""
        return _finite(asdict(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """How soon navigation begins.

    Attributes
    ----------
    drive : str
        Name of the drive.
    first_motion_s : float
        When the reference first exceeds 1 m/s [s]; NaN if never.
    first_solution_s : float
        When the estimator first has a solution, with all fixes [s]; infinite if never.
    """

    drive: str
    first_motion_s: float
    first_solution_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OutageStudy:
    """Outages of a number of drives.

    Attributes
    ----------
    filter : str
        Registry name of the estimator.
    smoothed : bool
        Whether errors are those of the smoother in the middle of each window.
    windows : tuple of Window
        By drive, length and start.
    starts : tuple of Start
        One for each drive.
    """

    filter: str
    smoothed: bool
    windows: tuple[Window, ...]
    starts: tuple[Start, ...]

    def summary(self) -> tuple[dict[str, Any], ...]:
        """Return a row per window length: n, median, p95, max, percent of distance, heading."""
        rows = []
        for length in sorted({w.length_s for w in self.windows}):
            of = [w for w in self.windows if w.length_s == length]
            error = np.array([w.horizontal_error_m for w in of])
            share = np.array([w.percent_of_distance for w in of])
            heading = np.array(
                [abs(w.heading_error_deg) for w in of if w.heading_error_deg is not None]
            )
            rows.append(
                {
                    "length_s": length,
                    "n": len(of),
                    "without_solution": sum(not w.solution for w in of),
                    "median_m": quantile(error, 0.5),
                    "p95_m": quantile(error, 0.95),
                    "max_m": float(error.max()),
                    "median_percent_of_distance": quantile(share, 0.5),
                    "median_heading_error_deg": (
                        quantile(heading, 0.5) if len(heading) else math.nan
                    ),
                }
            )
        return tuple(rows)

    def as_dict(self) -> dict[str, Any]:
        """Return JSON-like values; what is infinite or not known is None."""
        return {
            "filter": self.filter,
            "smoothed": self.smoothed,
            "windows": [w.as_dict() for w in self.windows],
            "summary": [_finite(row) for row in self.summary()],
            "starts": [_finite(asdict(s)) for s in self.starts],
        }


def windows(reference: PositionReference, mount: Any, length: float, phase: float) -> FloatArray:
    """Return the starts of the windows of one length and phase that count.

    Parameters
    ----------
    reference : PositionReference
        With velocity, or positions that give it.
    mount : MountReference or None
        Where there is one, a window begins only once it is valid.
    length, phase : float
        Length of the windows and start of the first [s].

    Returns
    -------
    ndarray, shape (m,)
        Starts [s].
    """
    t = reference.t
    if len(t) < 2:
        return np.empty(0)
    speed = _speed(reference)
    valid = np.ones(len(t), np.bool_) if reference.valid is None else reference.valid
    starts = []
    for start in np.arange(phase, t[-1] - length + 1e-9, EVERY):
        inside = (t >= start) & (t <= start + length)
        if not (_valid_near(t, valid, start) and _valid_near(t, valid, start + length)):
            continue
        if not inside.any() or not speed[inside].mean() > LEAST_SPEED:
            continue
        if mount is not None:
            there = np.ones(len(mount), np.bool_) if mount.valid is None else mount.valid
            before = mount.t <= start
            if not (before.any() and there[before][-1]):
                continue
        starts.append(start)
    return np.array(starts)


def blank(rec: Recording, spans: Iterable[tuple[float, float]]) -> Recording:
    """Return the recording without the fixes of some spans of time, both ends included.

    Parameters
    ----------
    rec : Recording
        With a stream ``gnss``.
    spans : iterable of (float, float)
        Start and end of each [s].

    Returns
    -------
    Recording

    Raises
    ------
    MissingStream
        If there are no fixes.
    ValueError
        If a span does not end after its start.
    """
    _checks.recording("rec", rec)
    fixes = rec.need("gnss")
    keep = np.ones(len(fixes), dtype=np.bool_)
    for start, stop in spans:
        if not start < stop:
            raise ValueError(f"`spans` must end after they start, got {start:g} to {stop:g} s.")
        keep &= (fixes.t < start) | (fixes.t > stop)
    return replace(rec, gnss=fixes.rows(keep))


def outage_errors(
    sol: Solution, rec: Recording, spans: Iterable[tuple[float, float]], name: str = ""
) -> tuple[Window, ...]:
    """Return the errors of a solution in given outages.

    Causal: at the end of each. Smoothed: in the middle. Against the reference's position where
    the recording has one, else against the fixes that were withheld.

    Parameters
    ----------
    sol : Solution
        From ``blank(rec, spans)``.
    rec : Recording
        With all its fixes.
    spans : iterable of (float, float)
        Start and end of each outage [s].
    name : str
        Of the drive.

    Returns
    -------
    tuple of Window

    Raises
    ------
    ValueError
        If a span is not within the times of the reference or the fixes.
    """
    _checks.instance("sol", sol, Solution, "an estimator's `run` gives one")
    _checks.recording("rec", rec)
    reference = rec.reference.position if rec.reference is not None else None
    if reference is None:
        fixes = rec.need("gnss")
        there = np.isfinite(fixes.lla).all(axis=1)
        reference = PositionReference(t=fixes.t[there], lla=fixes.lla[there])
    found = []
    for start, stop in spans:
        first, last = (float(reference.t[0]), float(reference.t[-1])) if len(reference) else (0, 0)
        if not first <= start < stop <= last:
            raise ValueError(
                f"an outage must be within the positions to compare with, {first:.1f} to "
                f"{last:.1f} s, got {start:g} to {stop:g} s."
            )
        found.append(_window(name, sol, rec, reference, start, stop - start))
    return tuple(found)


def outage_study(
    drives: Iterable[tuple[str, Recording]],
    estimator: Estimator,
    *,
    smooth: bool = False,
    lengths: Sequence[float] = LENGTHS,
    progress: Callable[[str], None] | None = None,
) -> OutageStudy:
    """Run the study over a number of drives.

    Parameters
    ----------
    drives : iterable of (str, Recording)
        Names and recordings; each with ``imu``, ``gnss`` and a reference position.
    estimator : Estimator
        A navigation filter, the same for all drives.
    smooth : bool
        Whether to take its smoother, and errors in the middle of the windows.
    lengths : sequence of float
        Lengths of the outages [s].
    progress : callable, optional
        Told the name of each drive as its turn comes.

    Returns
    -------
    OutageStudy

    Raises
    ------
    ValueError
        If a drive has no reference position, or the estimator cannot smooth.
    """
    for length in lengths:
        _checks.positive("lengths", length)
    if smooth and not hasattr(estimator, "smooth"):
        raise ValueError(f"`estimator` must have a smoother, {estimator.NAME} has none.")
    found: list[Window] = []
    starts: list[Start] = []
    for name, rec in drives:
        if progress is not None:
            progress(name)
        if rec.reference is None or rec.reference.position is None:
            raise ValueError(f"{name} must have a reference position; the study needs one.")
        starts.append(_start(name, rec, estimator))
        for length in lengths:
            for phase in PHASES:
                found += _run(name, rec, estimator, length, phase, smooth=smooth)
    found.sort(key=lambda w: (w.drive, w.length_s, w.start_s))
    return OutageStudy(
        filter=estimator.NAME, smoothed=smooth, windows=tuple(found), starts=tuple(starts)
    )


def _run(
    name: str, rec: Recording, estimator: Any, length: float, phase: float, *, smooth: bool
) -> list[Window]:
    """Return the windows of one run."""
    assert rec.reference is not None
    reference = rec.reference.position
    assert reference is not None
    begin = windows(reference, rec.reference.mount, length, phase).tolist()
    if not begin:
        return []
    part = blank(rec, [(start, start + length) for start in begin])
    sol = estimator.smooth(part) if smooth else estimator.run(part, diagnostics=False)
    return [_window(name, sol, rec, reference, start, length) for start in begin]


def _window(
    name: str,
    sol: Solution,
    rec: Recording,
    reference: PositionReference,
    start: float,
    length: float,
) -> Window:
    """Return the error in one outage: at its end, in its middle for a smoother."""
    at = start + (length if sol.causal else 0.5 * length)
    error = _error_n(sol, reference, at) if _has_solution(sol, start, at) else None
    steps = np.linalg.norm(np.diff(ned_from_lla(reference.lla, reference.lla[0]), axis=0), axis=1)
    way = np.concatenate(([0.0], np.cumsum(steps)))
    distance = float(np.interp(at, reference.t, way) - np.interp(start, reference.t, way))
    horizontal = math.inf if error is None else math.hypot(error[0], error[1])
    return Window(
        drive=name,
        length_s=length,
        start_s=start,
        horizontal_error_m=horizontal,
        vertical_error_m=math.inf if error is None else -float(error[2]),
        percent_of_distance=100.0 * horizontal / distance if distance > 0.0 else math.nan,
        heading_error_deg=None if error is None else _heading(sol, rec, at),
        solution=error is not None,
    )


def _row(sol: Solution, t: float) -> int:
    """Last row of the solution that is not after `t`."""
    return int(np.searchsorted(sol.t, t, side="right")) - 1


def _has_solution(sol: Solution, start: float, at: float) -> bool:
    """Whether there is a solution when the outage begins and when the error is taken."""
    for t in (start, at):
        k = _row(sol, t)
        if k < 0 or sol.status[k] & Status.ALIGNING or sol.lla is None:
            return False
        if not np.isfinite(sol.lla[k]).all():
            return False
    return True


def _error_n(sol: Solution, reference: PositionReference, at: float) -> FloatArray:
    """Position of the antenna less reference at the time `at`, NED [m].

    From the last sample on, its velocity carries the solution the few milliseconds to `at`.
    """
    k = _row(sol, at)
    assert sol.lla is not None
    assert sol.v_n is not None
    arm_n = sol.v_n[k] * (at - sol.t[k])
    if sol.antenna_b is not None:
        arm_n = arm_n + rotate(sol.q_nb[k], sol.antenna_b[k])
    here = lla_from_ned(arm_n, sol.lla[k])
    truth = np.array([np.interp(at, reference.t, reference.lla[:, j]) for j in range(3)])
    return np.asarray(ned_from_lla(here, truth))


def _heading(sol: Solution, rec: Recording, at: float) -> float | None:
    """Heading error in degrees, None where the reference has none."""
    attitude = rec.reference.attitude if rec.reference is not None else None
    if attitude is None or not len(attitude):
        return None
    j = int(np.argmin(np.abs(attitude.t - at)))
    if abs(attitude.t[j] - at) > _NEAR or (attitude.valid is not None and not attitude.valid[j]):
        return None
    k = int(np.argmin(np.abs(sol.t - attitude.t[j])))
    error = quat_mul(sol.q_nb[k], quat_conj(attitude.q_nb[j]))
    heading = 2.0 * math.atan2(float(error[3]), float(error[0]))
    return math.degrees(math.remainder(heading, 2.0 * math.pi))


def _start(name: str, rec: Recording, estimator: Estimator) -> Start:
    """When the drive begins to move, and when the estimator begins to navigate."""
    assert rec.reference is not None
    reference = rec.reference.position
    assert reference is not None
    moving = np.flatnonzero(_speed(reference) > MOTION_SPEED)
    sol = estimator.run(rec, diagnostics=False)
    known = np.flatnonzero((sol.status & Status.ALIGNING) == 0)
    return Start(
        drive=name,
        first_motion_s=float(reference.t[moving[0]]) if len(moving) else math.nan,
        first_solution_s=float(sol.t[known[0]]) if len(known) else math.inf,
    )


def _speed(reference: PositionReference) -> FloatArray:
    """Horizontal speed [m/s]."""
    if reference.v_n is not None:
        return np.asarray(np.hypot(reference.v_n[:, 0], reference.v_n[:, 1]))
    ned = ned_from_lla(reference.lla, reference.lla[0])
    v = np.gradient(ned[:, :2], reference.t, axis=0)
    return np.asarray(np.hypot(v[:, 0], v[:, 1]))


def _valid_near(t: FloatArray, valid: Any, at: float) -> bool:
    """Whether the reference is valid on both sides of a time, and near it."""
    j = int(np.searchsorted(t, at))
    sides = [i for i in (j - 1, j) if 0 <= i < len(t)]
    if not sides or not all(bool(valid[i]) for i in sides):
        return False
    return min(abs(float(t[i]) - at) for i in sides) <= _NEAR


def quantile(values: FloatArray, share: float) -> float:
    """Linear quantile that is infinite where an infinite value has a part in it.

    Parameters
    ----------
    values : ndarray
        May hold infinities.
    share : float
        Between 0 and 1.

    Returns
    -------
    float
    """
    ordered = np.sort(values)
    place = share * (len(ordered) - 1)
    low = math.floor(place)
    part = place - low
    if part == 0.0:
        return float(ordered[low])
    if not math.isfinite(float(ordered[low + 1])):
        return math.inf
    return float(ordered[low] + part * (ordered[low + 1] - ordered[low]))


def _finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row with None for what JSON has no number for."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in row.items()
    }
