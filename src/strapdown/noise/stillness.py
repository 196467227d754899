"""Whether a channel can be characterised at all: alive, inside its range, and still.

References
----------
.. [1] Thesis A (three-axis platform), section 5.3: four hours, sensor at rest.
"""

import itertools
from typing import Final

import numpy as np

from strapdown._checks import as_floats, as_series, positive
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import InputError

_WINDOW: Final = 1.0  # length over which motion is looked for [s]
_LEAST_WINDOW: Final = 16  # samples
_LEAST_WINDOWS: Final = 8
_STD_FACTOR: Final = 3.0  # a window this much noisier than the median one is motion
_STEP_FACTOR: Final = 10.0  # so is a step between windows of so many usual ones
_SHORT_REST: Final = 10  # windows
_CLIPPED_SHARE: Final = 1e-3  # of the samples at one end of the range
_LEAST_LEVELS: Final = 8  # fewer values are coarse resolution, and tell nothing of clipping


def require_signal(name: str, y: FloatArray) -> None:
    """Refuse a channel that is constant, or clipped at an end of its range.

    Parameters
    ----------
    name : str
        Name of the channel for the message.
    y : ndarray, shape (n,)
        Samples.

    Raises
    ------
    InputError
        Naming the value and how many samples have it.
    """
    y = as_series(name, y)
    if not y.size:
        raise InputError(f"`{name}` must hold samples, got none.")
    low, high = float(y.min()), float(y.max())
    if low == high:
        raise InputError(
            f"`{name}` must vary, got {low:g} in all {y.size} samples; "
            "the sensor is stuck, asleep or not connected."
        )
    step = 1e-9 * (high - low)  # values this near are one level, printed or scaled twice
    for end, count in (
        ("lowest", int(np.count_nonzero(y <= low + step))),
        ("highest", int(np.count_nonzero(y >= high - step))),
    ):
        if count < max(10, _CLIPPED_SHARE * y.size):
            continue
        levels = np.unique(y)
        starts = np.flatnonzero(np.diff(levels, prepend=-np.inf) > step)
        if starts.size < _LEAST_LEVELS:
            continue
        if end == "lowest":
            inner = np.count_nonzero(y < levels[starts[2]]) - count
        else:
            inner = np.count_nonzero(y >= levels[starts[-2]]) - count
        if count > 3 * inner:
            raise InputError(
                f"`{name}` must not be clipped, got {count} of {y.size} samples at its {end} "
                f"value {low if end == 'lowest' else high:g}; choose a wider range of the sensor."
            )


def moving(y: FloatArray, fs: float) -> BoolArray:
    """Return where a channel is not still, window by window.

    A window moves if it is much noisier than the median one, or if the mean steps at its
    border by much more than it usually does. Slow drift, flicker noise and random walk pass.

    Parameters
    ----------
    y : ndarray, shape (n,) or (n, k)
        Samples of one or more channels.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of bool, shape (n,)
        All false in a record of fewer than eight windows, which has no usual window.
    """
    y = as_floats("y", y)
    if y.ndim not in (1, 2) or y.shape[-1] == 0:
        raise ValueError(f"`y` must have shape (n,) or (n, k), got {y.shape}.")
    fs = positive("fs", fs)
    samples = y[:, np.newaxis] if y.ndim == 1 else y
    width = max(_LEAST_WINDOW, round(_WINDOW * fs))
    count = len(samples) // width
    moves = np.zeros(len(samples), dtype=np.bool_)
    if count < _LEAST_WINDOWS:
        return moves
    windows = samples[: count * width].reshape(count, width, -1)
    mean, std = windows.mean(axis=1), windows.std(axis=1)
    usual = np.median(std, axis=0)
    step = np.diff(mean, axis=0)
    step = np.abs(step - np.median(step, axis=0))
    # White noise alone makes steps of this size; coarse channels may show no step at all.
    least = usual * np.sqrt(2.0 / width)
    scale = np.maximum(1.4826 * np.median(step, axis=0), least)
    noisy = (std > _STD_FACTOR * usual).any(axis=1) & (usual > 0.0).any()
    stepped = (step > _STEP_FACTOR * scale).any(axis=1)
    stepped &= ~(noisy[:-1] | noisy[1:])  # else that window explains it
    noisy[:-1] |= stepped
    noisy[1:] |= stepped
    # A steady turn shows at its ends alone: short rests between two motions are none.
    hits = np.flatnonzero(noisy)
    for first, last in itertools.pairwise(hits):
        if last - first <= _SHORT_REST:
            noisy[first:last] = True
    moves[: count * width] = np.repeat(noisy, width)
    moves[count * width :] = noisy[-1]
    return moves


def require_still(name: str, y: FloatArray, fs: float, start: float = 0.0) -> None:
    """Refuse a log that moves, naming when, and which part of it is still.

    Parameters
    ----------
    name : str
        Name of the sensor for the message.
    y : ndarray, shape (n,) or (n, k)
        Samples.
    fs : float
        Sampling rate [Hz].
    start : float
        Time of the first sample [s].

    Raises
    ------
    InputError
        With the span of the motion and the longest still stretch.
    """
    moves = moving(y, fs)
    if not moves.any():
        return
    start = 0.0 if abs(start) < 0.05 else start  # no "-0.0 s"
    first, last = _runs(moves)
    longest_first, longest_last = _runs(~moves)
    where = f"from {start + first[0] / fs:.1f} s to {start + last[0] / fs:.1f} s"
    if first.size > 1:
        where += f" and {first.size - 1} more times, last until {start + last[-1] / fs:.1f} s"
    if longest_first.size:
        best = int(np.argmax(longest_last - longest_first))
        low, high = start + longest_first[best] / fs, start + longest_last[best] / fs
        way_out = f"the longest still stretch is {low:.1f} s to {high:.1f} s, take that alone"
    else:
        way_out = "record with the device lying still"
    raise InputError(f"`{name}` must be still throughout, it moves {where}; {way_out}.")


def _runs(mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the first row of each run of true values, and the row after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edges[::2].astype(np.float64), edges[1::2].astype(np.float64)
