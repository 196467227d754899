"""Bringing estimates to the times of a reference, which has another rate and span.

Values are interpolated between the two samples that enclose a time, never extrapolated, and
never across a gap. At a time that is a sample's own the sample is returned bit for bit.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.rotation import slerp

MAX_GAP_S = 0.25  # five intervals of the slowest IMU that is of use, 20 Hz


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Match:
    """Which of the wanted times can be served, and from which samples.

    Attributes
    ----------
    rows : ndarray of int, shape (m,)
        Rows of the wanted times that can be served; the others lie outside the span or in
        a gap.
    low, high : ndarray of int, shape (m,)
        The samples that enclose each; the same one where the times are equal.
    fraction : ndarray, shape (m,)
        Way from `low` to `high`, from 0 to 1.
    outside, in_gap : int
        Wanted times left out because they lie outside the span, or in a gap.
    """

    rows: IntArray
    low: IntArray
    high: IntArray
    fraction: FloatArray
    outside: int
    in_gap: int

    def linear(self, values: FloatArray) -> FloatArray:
        """Return `values`, shape (n,) or (n, d), interpolated linearly."""
        start = values[self.low]
        fraction = self.fraction if values.ndim == 1 else self.fraction[:, np.newaxis]
        return start + fraction * (values[self.high] - start)

    def quats(self, q: FloatArray) -> FloatArray:
        """Return attitudes `q`, shape (n, 4), interpolated on the shortest arc."""
        out = q[self.low]
        between = self.fraction > 0.0
        if between.any():
            out[between] = slerp(
                q[self.low[between]], q[self.high[between]], self.fraction[between]
            )
        return out

    def both(self, mask: BoolArray) -> BoolArray:
        """Return whether `mask`, shape (n,), holds at both enclosing samples."""
        return mask[self.low] & mask[self.high]


def match(t: ArrayLike, wanted: ArrayLike, max_gap: float = MAX_GAP_S) -> Match:
    """Return how to interpolate samples at `t` to the times `wanted`.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times of the samples [s], increasing.
    wanted : array_like, shape (k,)
        Times at which values are wanted [s], increasing.
    max_gap : float
        Longest interval between samples that is bridged [s].

    Returns
    -------
    Match

    Raises
    ------
    ValueError
        If times do not increase or `max_gap` is not positive.
    """
    t = _checks.as_times("t", t)
    wanted = _checks.as_times("wanted", wanted)
    _checks.positive("max_gap", max_gap)
    if not len(t):
        empty = np.zeros(0, dtype=np.int64)
        return Match(
            rows=empty,
            low=empty,
            high=empty,
            fraction=np.zeros(0),
            outside=len(wanted),
            in_gap=0,
        )
    inside = (wanted >= t[0]) & (wanted <= t[-1])
    rows = np.flatnonzero(inside)
    low = np.searchsorted(t, wanted[rows], side="right") - 1
    exact = t[low] == wanted[rows]
    high = np.where(exact, low, low + 1)
    step = t[high] - t[low]
    near = step <= max_gap
    rows, low, high, step = rows[near], low[near], high[near], step[near]
    way = wanted[rows] - t[low]
    fraction = np.divide(way, step, out=np.zeros_like(way), where=step > 0.0)
    return Match(
        rows=rows,
        low=low,
        high=high,
        fraction=fraction,
        outside=int(np.count_nonzero(~inside)),
        in_gap=int(np.count_nonzero(~near)),
    )
