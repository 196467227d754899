"""Fewer points for display, with every spike still to be seen.

A line of a million samples is drawn on some thousand pixels. Of each bucket of consecutive
samples the lowest and the highest are kept, at their own times: an outlier of one sample stays
visible, and every point that is shown is a sample. Only figures use this, never numbers.
"""

from typing import NamedTuple

import numpy as np

from strapdown._types import BoolArray, FloatArray, IntArray

BUCKETS = 1500  # twice as many points: one bucket per pixel of a wide figure
GAP_FACTOR = 5.0  # an interval this many times the median one breaks the line


class Drawn(NamedTuple):
    """Points of a line; a NaN in `y` lifts the pen."""

    x: FloatArray
    y: FloatArray


def envelope_rows(y: FloatArray, buckets: int = BUCKETS) -> IntArray:
    """Return the rows with the lowest and highest value of each bucket, in order.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Values, none NaN.
    buckets : int
        Number of buckets of equal sample count.

    Returns
    -------
    ndarray of int, shape (m,)
        Increasing, first and last row included; all rows if there are not more than twice
        the buckets.
    """
    n = len(y)
    if n <= 2 * buckets:
        return np.arange(n)
    size = -(-n // buckets)
    whole = n // size * size
    starts = np.arange(0, whole, size)
    rows = [np.array([0, n - 1])]
    for pick in (np.argmin, np.argmax):
        rows.append(starts + pick(y[:whole].reshape(-1, size), axis=1))
        if whole < n:
            rows.append(np.array([whole + pick(y[whole:])]))
    return np.unique(np.concatenate(rows))


def line(
    x: FloatArray, y: FloatArray, *, buckets: int = BUCKETS, period: float | None = None
) -> Drawn:
    """Return the points to draw of a line over time.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Increasing times. An interval much longer than the median one breaks the line.
    y : ndarray, shape (n,)
        Values; a NaN counts as a sample that is missing.
    buckets : int
        Number of buckets.
    period : float, optional
        Length of a turn for angles that wrap: the line breaks there, instead of crossing
        the figure.

    Returns
    -------
    Drawn
    """
    there = ~np.isnan(y)
    if not there.all():
        x, y = x[there], y[there]
    rows = envelope_rows(y if period is None else _unwrapped(y, period), buckets)
    drawn = Drawn(x[rows], y[rows])
    if len(rows) < 2:
        return drawn
    cut = _gap_between(x, rows)
    if period is not None:
        cut |= np.abs(np.diff(drawn.y)) > period / 2.0
    return _lifted(drawn, cut)


def _gap_between(t: FloatArray, rows: IntArray) -> BoolArray:
    """Return whether an interval much longer than the median lies between kept rows."""
    interval = np.diff(t)
    gaps = np.concatenate(([0], np.cumsum(interval > GAP_FACTOR * np.median(interval))))
    return np.asarray(gaps[rows[1:]] > gaps[rows[:-1]])


def _lifted(drawn: Drawn, cut: BoolArray) -> Drawn:
    """Return the points with a NaN after each that ends a stroke."""
    after = np.flatnonzero(cut) + 1
    return Drawn(np.insert(drawn.x, after, drawn.x[after - 1]), np.insert(drawn.y, after, np.nan))


def _unwrapped(y: FloatArray, period: float) -> FloatArray:
    """Return angles without their jumps of a whole period."""
    return np.asarray(y - period * np.cumsum(np.round(np.diff(y, prepend=y[:1]) / period)))


def path_rows(*axes: FloatArray, buckets: int = BUCKETS) -> IntArray:
    """Return the rows that keep the extremes of each coordinate of a path, in order."""
    rows = [envelope_rows(axis, max(1, buckets // len(axes))) for axis in axes]
    return np.unique(np.concatenate(rows))


def path(t: FloatArray, x: FloatArray, y: FloatArray, buckets: int = BUCKETS) -> Drawn:
    """Return the points to draw of a path, broken at long intervals of `t`."""
    rows = path_rows(x, y, buckets=buckets)
    drawn = Drawn(x[rows], y[rows])
    return drawn if len(rows) < 2 else _lifted(drawn, _gap_between(t, rows))


def runs(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the first and the last row of each stretch in which `mask` holds."""
    edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1


def merged_spans(
    t: FloatArray, mask: BoolArray, buckets: int = BUCKETS
) -> tuple[FloatArray, FloatArray]:
    """Return starts and ends of the times in which `mask` holds, for display.

    Stretches closer than a bucket are drawn as one, and none is drawn shorter than a
    bucket, so that a single flagged sample can be seen.
    """
    first, last = runs(mask)
    if not len(first):
        return np.zeros(0), np.zeros(0)
    width = float(t[-1] - t[0]) / buckets
    starts, stops = t[first], np.maximum(t[last], t[first] + width)
    apart = np.concatenate(([True], starts[1:] - stops[:-1] > width))
    ends = np.concatenate((np.flatnonzero(apart)[1:] - 1, [len(starts) - 1]))
    return starts[apart], stops[ends]
