"""Find the poses of a calibration in one continuous log: hold still, turn, hold still.

Rests come from `strapdown.motion`; here they become poses. How much tremor a rest may have is
found from the log: on a table none, in the hand ten times the sensor's noise, and one log can
hold both. So the test runs with several thresholds, and the one that finds most orientations is
taken. A rest in which gravity wanders, as it does when the hand tires, is cut to its
steadiest part, and two rests that a short jolt has split are one pose again.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from strapdown import motion
from strapdown._checks import as_samples, as_times, instance, positive, same_length
from strapdown._types import FloatArray, IntArray
from strapdown.calibration.sphere import unit_vectors
from strapdown.units import DEG, DPS

HAND_HELD = motion.RestTest(max_gyr_std=10.0 * DPS, max_acc_std=1.0)
TURNTABLE = motion.RestTest(max_rate=math.inf)
_LOOSENESS = tuple(2.0**k for k in range(7))  # multiples of the test's factor that are tried
_JOLT = 3.0  # longest interruption of one pose [s]
_DISTINCT = 5.0 * DEG  # orientations closer than this count once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Poses:
    """Stretches in which the device was held still, or turned steadily.

    Attributes
    ----------
    t_start, t_stop : ndarray, shape (n,)
        Times of the first and the last sample used [s].
    acc, gyr : ndarray, shape (n, 3)
        Mean raw specific force [m/s^2] and angular rate [rad/s].
    mag : ndarray, shape (n, 3), or None
        Mean raw magnetic field [T], where the log has one; NaN without a sample in the pose.
    samples : ndarray, shape (n,)
        Samples in each mean.
    acc_std, gyr_std : float
        Standard deviation of a mean of one axis, typical of all poses, if the noise were white.
    """

    t_start: FloatArray
    t_stop: FloatArray
    acc: FloatArray
    gyr: FloatArray
    mag: FloatArray | None
    samples: FloatArray
    acc_std: float
    gyr_std: float

    def __len__(self) -> int:
        return len(self.t_start)


def find_poses(
    t: ArrayLike,
    gyr: ArrayLike,
    acc: ArrayLike,
    t_mag: ArrayLike | None = None,
    mag: ArrayLike | None = None,
    *,
    rest: motion.RestTest = HAND_HELD,
    wander: float = 2.0 * DEG,
    loosest: float = math.inf,
) -> Poses:
    """Return the poses of a continuous log.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    gyr, acc : array_like, shape (n, 3)
        Raw samples [rad/s], [m/s^2].
    t_mag, mag : array_like, optional
        Time [s], shape (m,), and raw field [T], shape (m, 3).
    rest : RestTest
        What counts as rest. Its factor is the strictest one that is tried.
    wander : float
        How far gravity may turn within a pose [rad].
    loosest : float
        How many times that factor may be exceeded, for tremor; 1 allows none.

    Returns
    -------
    Poses
        In order of time; empty if the device never rests.

    Notes
    -----
    Offline.
    """
    t = as_times("t", t)
    gyr = as_samples("gyr", gyr, allow_nan=True)
    acc = as_samples("acc", acc, allow_nan=True)
    same_length(t=t, gyr=gyr, acc=acc)
    positive("wander", wander)
    positive("loosest", loosest, allow_inf=True)
    instance("rest", rest, motion.RestTest)
    tried = [
        _pose_segments(t, gyr, acc, replace(rest, factor=k * rest.factor), wander)
        for k in _LOOSENESS
        if k <= max(loosest, 1.0)
    ]
    # Most orientations; then the fewest interruptions; then the strictest.
    joined = max(tried, key=lambda poses: (_distinct(acc, poses), -sum(map(len, poses))))
    rows = [np.concatenate([np.arange(s.start, s.stop) for s in pose]) for pose in joined]
    field = None
    if t_mag is not None and mag is not None:
        field = _field_means(
            as_times("t_mag", t_mag), as_samples("mag", mag, allow_nan=True), joined
        )
    return Poses(
        t_start=np.array([pose[0].t_start for pose in joined]),
        t_stop=np.array([pose[-1].t_stop for pose in joined]),
        acc=_means(acc, rows),
        gyr=_means(gyr, rows),
        mag=field,
        samples=np.array([float(len(r)) for r in rows]),
        acc_std=_std_of_mean(acc, rows),
        gyr_std=_std_of_mean(gyr, rows),
    )


def find_turntable_positions(t: ArrayLike, gyr: ArrayLike, acc: ArrayLike) -> Poses:
    """Return the stretches of steady rotation, or rest, on a table of vertical axis.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    gyr, acc : array_like, shape (n, 3)
        Raw samples [rad/s], [m/s^2].

    Returns
    -------
    Poses
        In order of time; both speeds in one position are two of them.
    """
    return find_poses(t, gyr, acc, rest=TURNTABLE, loosest=1.0)


def _pose_segments(
    t: FloatArray, gyr: FloatArray, acc: FloatArray, rest: motion.RestTest, wander: float
) -> list[list[motion.Segment]]:
    """Return the rests of each pose for one threshold."""
    found = motion.rest_segments(t, gyr, acc, rest)
    steady = (_steady_part(t, acc, s, rest.window, wander) for s in found)
    return _joined(gyr, acc, [s for s in steady if s.duration >= rest.min_duration], wander)


def _distinct(acc: FloatArray, poses: list[list[motion.Segment]]) -> int:
    """Return how many orientations the poses have."""
    kept: list[FloatArray] = []
    for pose in poses:
        (direction,) = unit_vectors("acc", np.nanmean(acc[pose[0].rows], axis=0)[np.newaxis])
        if all(float(direction @ other) < math.cos(_DISTINCT) for other in kept):
            kept.append(direction)
    return len(kept)


def _means(samples: FloatArray, rows: list[IntArray]) -> FloatArray:
    return np.array([np.nanmean(samples[r], axis=0) for r in rows]).reshape(-1, 3)


def _std_of_mean(samples: FloatArray, rows: list[IntArray]) -> float:
    if not rows:
        return math.nan
    variances = [float(np.nanvar(samples[r], axis=0).mean()) / len(r) for r in rows]
    return math.sqrt(float(np.mean(variances)))


def _field_means(
    t_mag: FloatArray, mag: FloatArray, joined: list[list[motion.Segment]]
) -> FloatArray:
    good = ~np.isnan(mag).any(axis=1)
    means = np.full((len(joined), 3), np.nan)
    for k, pose in enumerate(joined):
        inside = np.zeros(len(t_mag), dtype=np.bool_)
        for s in pose:
            inside |= (t_mag >= s.t_start) & (t_mag <= s.t_stop)
        if (inside & good).any():
            means[k] = mag[inside & good].mean(axis=0)
    return means


def _steady_part(
    t: FloatArray, acc: FloatArray, segment: motion.Segment, window: float, wander: float
) -> motion.Segment:
    """Return the longest part of a rest in which gravity turns by less than `wander`."""
    blocks = np.floor((t[segment.rows] - segment.t_start) / window).astype(np.int64)
    starts = np.flatnonzero(np.diff(blocks, prepend=-1)) + segment.start
    stops = np.append(starts[1:], segment.stop)
    rows = [np.arange(a, b) for a, b in zip(starts, stops, strict=True)]
    rows = [r for r in rows if not np.isnan(acc[r]).any(axis=1).all()]
    directions = unit_vectors("acc", _means(acc, rows))
    first, best = 0, (0, 0)
    near = math.cos(wander)
    for last in range(len(rows)):
        while (directions[first : last + 1] @ directions[last]).min() < near:
            first += 1
        if last + 1 - first > best[1] - best[0]:
            best = (first, last + 1)
    if best[1] - best[0] == len(rows):
        return segment
    start, stop = int(rows[best[0]][0]), int(rows[best[1] - 1][-1]) + 1
    return motion.Segment(start, stop, float(t[start]), float(t[stop - 1]))


def _joined(
    gyr: FloatArray, acc: FloatArray, found: list[motion.Segment], wander: float
) -> list[list[motion.Segment]]:
    """Return the rests as poses: those that a jolt has split belong together."""
    poses: list[list[motion.Segment]] = []
    for segment in found:
        if poses:
            before = poses[-1][-1]
            f = unit_vectors(
                "acc",
                [np.nanmean(acc[before.rows], axis=0), np.nanmean(acc[segment.rows], axis=0)],
            )
            rates = [np.nanmean(gyr[s.rows], axis=0) for s in (before, segment)]
            if (
                segment.t_start - before.t_stop <= _JOLT
                and float(f[0] @ f[1]) >= math.cos(wander)
                and float(np.linalg.norm(rates[1] - rates[0])) <= 1.0 * DEG  # per second
            ):
                poses[-1].append(segment)
                continue
        poses.append([segment])
    return poses
