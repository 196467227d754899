r"""Encoders as the reference: quadrature decoding, start offset, body rates and vectors.

Incremental encoders at the gimbals of a platform give roll, pitch and yaw relative to
start-up. Their steps are smoothed by a spline whose distance from the samples is what
rounding to whole counts leaves, ``resolution / sqrt(12)``; its derivatives give the body rates.

References
----------
.. [1] F. Scibona, MSc thesis, Universita di Padova, 2015, sections 6.3 and 8.2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, splrep

from strapdown._checks import (
    as_floats,
    as_samples,
    as_series,
    as_times,
    as_vector,
    positive,
    whole,
)
from strapdown._types import FloatArray, IntArray
from strapdown.errors import InputError
from strapdown.rotation import dcm_from_rpy
from strapdown.units import DEG

HEDM5500_RESOLUTION = 0.09 * DEG  # as the thesis states it; see Quadrature.resolution
LONGEST_COUNT = 1.0  # s; a count that stays longer is at rest
# Place of state AB in the order 11, 10, 00, 01 of a turn in the positive sense; index 2 A + B.
_ORDER = np.array([2, 3, 1, 0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quadrature:
    """Decoded counts of one encoder.

    Attributes
    ----------
    count : ndarray of int, shape (n,)
        Counts since the first sample, four per cycle.
    invalid : int
        Samples where both channels changed at once: at least two transitions were missed.
    resolution : float
        Angle per count [rad]: a turn divided by four times the cycles per turn. With the 500
        cycles of [1]_ that is 0.18 deg, where the thesis works with 0.09 deg.
    """

    count: IntArray
    invalid: int
    resolution: float

    @property
    def angle(self) -> FloatArray:
        """Angle since the first sample [rad], shape (n,)."""
        return np.asarray(self.count * self.resolution)


def decode_quadrature(a: ArrayLike, b: ArrayLike, cycles_per_turn: int = 500) -> Quadrature:
    """Return counts from the two channels of an incremental encoder, table 8.2 of [1]_.

    Parameters
    ----------
    a, b : array_like of bool, shape (n,)
        Levels of the channels, sampled or at each interrupt. The order 11, 10, 00, 01 counts
        up. No change and double changes leave the count as it is.
    cycles_per_turn : int
        Cycles of one channel in a turn.

    Returns
    -------
    Quadrature

    Examples
    --------
    >>> decode_quadrature([1, 1, 0, 0, 1], [1, 0, 0, 1, 1]).count.tolist()
    [0, 1, 2, 3, 4]
    """
    levels = []
    for name, value in (("a", a), ("b", b)):
        level = as_floats(name, value)
        if level.ndim != 1 or not np.isin(level, (0, 1)).all():
            raise ValueError(f"`{name}` must be levels 0 and 1 of shape (n,), got {level!r}.")
        levels.append(level.astype(np.int64))
    if len(levels[0]) != len(levels[1]):
        raise ValueError(
            f"`a` and `b` must have equal length, got {len(levels[0])} and {len(levels[1])}."
        )
    place = _ORDER[2 * levels[0] + levels[1]]
    change = np.diff(place) % 4
    steps = np.where(change == 1, 1, np.where(change == 3, -1, 0))
    count = np.concatenate(([0], np.cumsum(steps))) if len(place) else np.empty(0, dtype=np.int64)
    cycles = whole("cycles_per_turn", cycles_per_turn, 1)
    return Quadrature(
        count=count.astype(np.int64),
        invalid=int(np.count_nonzero(change == 2)),
        resolution=2.0 * math.pi / (4 * cycles),
    )


def start_offset(angle: ArrayLike, *, least_travel: float = 20.0 * DEG) -> float:
    """Return the offset of an incremental encoder from a visit to both mechanical stops.

    The stops lie symmetrically about level, so the offset is the mean of the largest and the
    smallest angle, (8.6) of [1]_; subtract it.

    Parameters
    ----------
    angle : array_like, shape (n,)
        Angle since start-up while the platform was moved to both stops [rad].
    least_travel : float
        Least distance between the stops [rad]; less means that one was not reached.

    Returns
    -------
    float
        Offset [rad].
    """
    angle, least_travel = as_series("angle", angle), positive("least_travel", least_travel)
    travel = float(np.ptp(angle)) if len(angle) else 0.0
    if not travel >= least_travel:
        raise InputError(
            f"`angle` must reach both stops, at least {least_travel / DEG:g} deg apart, it moves "
            f"over {travel / DEG:.3g} deg; move the platform from stop to stop."
        )
    return float(0.5 * (angle.max() + angle.min()))


def smooth_angles(
    t: ArrayLike, angle: ArrayLike, resolution: float, *, smoothing: float = 1.0
) -> BSpline:
    """Return a quintic spline through the steps of an encoder's angle.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    angle : array_like, shape (n,)
        Angle, continuous over turns [rad].
    resolution : float
        Angle of one count [rad].
    smoothing : float
        RMS distance from the samples in units of ``resolution / sqrt(12)``. Larger is smoother.

    Returns
    -------
    scipy.interpolate.BSpline
        Angle [rad] of time [s].
    """
    t = as_times("t", t)
    angle = as_series("angle", angle, len(t))
    if len(t) < 12:
        raise InputError(f"`angle` must have at least 12 samples for a spline, got {len(t)}.")
    noise = positive("resolution", resolution) * positive("smoothing", smoothing) / math.sqrt(12.0)
    levels = np.unique(angle)
    steps = np.diff(levels)
    # Angles that repeat are counts; a finer resolution would make the spline follow each step.
    if 1 < len(levels) < 0.9 * len(angle) and steps.min() > 1.5 * resolution:
        raise InputError(
            f"`resolution` must be the angle of one count, got {resolution / DEG:.4g} deg, but "
            f"the angle steps by {steps.min() / DEG:.4g} deg; give that."
        )
    if np.ptp(angle) <= resolution:  # one flickering count is no motion
        return BSpline(*splrep(t, np.full(len(t), angle.mean()), k=5, s=1.0))
    return BSpline(*splrep(t, angle, k=5, s=_moving(t, angle) * noise**2))


def _moving(t: FloatArray, angle: FloatArray) -> float:
    """Return how many samples were rounded while the angle moved.

    A count that stands still for long is a rest: its rounding does not scatter, and what the
    spline was allowed there it would take where the angle moves.
    """
    edges = np.concatenate(([0], np.flatnonzero(np.diff(angle)) + 1, [len(t)]))
    longest = LONGEST_COUNT * (len(t) - 1) / (t[-1] - t[0])
    return float(np.minimum(np.diff(edges), longest).sum())


def body_rates(
    t: ArrayLike,
    rpy: ArrayLike,
    resolution: float = HEDM5500_RESOLUTION,
    *,
    smoothing: float = 1.0,
) -> FloatArray:
    """Return the body rates that encoder angles imply.

    Each angle is smoothed by a spline; its derivatives go through the kinematics of roll, pitch
    and yaw, (6.13) of [1]_.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    rpy : array_like, shape (n, 3)
        Roll, pitch, yaw of the platform [rad], continuous over turns.
    resolution : float
        Angle of one count [rad].
    smoothing : float
        See `smooth_angles`.

    Returns
    -------
    ndarray, shape (n, 3)
        omega_nb_b [rad/s]. The ends, about 0.2 s, are worse than the middle.

    Notes
    -----
    Offline.
    """
    t = as_times("t", t)
    rpy = as_samples("rpy", rpy)
    splines = [smooth_angles(t, angle, resolution, smoothing=smoothing) for angle in rpy.T]
    roll, pitch, _ = (spline(t) for spline in splines)
    roll_rate, pitch_rate, yaw_rate = (spline(t, 1) for spline in splines)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.column_stack(
        (
            roll_rate - sp * yaw_rate,
            cr * pitch_rate + sr * cp * yaw_rate,
            -sr * pitch_rate + cr * cp * yaw_rate,
        )
    )


def body_vectors(rpy: ArrayLike, v_n: ArrayLike) -> FloatArray:
    """Return a constant vector of n in body axes, in each attitude.

    Parameters
    ----------
    rpy : array_like, shape (n, 3)
        Roll, pitch, yaw of the platform [rad].
    v_n : array_like, shape (3,)
        Specific force at rest ``(0, 0, -g)`` for an accelerometer, the magnetic field for a
        magnetometer.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    v_n = as_vector("v_n", v_n)
    # v_b = C_nb^T v_n
    return np.asarray(np.einsum("...ji,j->...i", dcm_from_rpy(as_samples("rpy", rpy)), v_n))
