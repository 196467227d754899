"""Where nothing that a log holds speaks against rest, and the gyroscope's bias there.

A steady turn of a smooth vehicle, or of a turntable, is as quiet as rest. What tells them apart
is the speed of the fixes, and fields that turn.
"""

from typing import Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.doctor._log import Grid
from strapdown.recording import Gnss

_BLOCK_S: Final = 1.0
_STILL_M_S: Final = 1.0  # some receivers show half of it at rest
_STALE_S: Final = 3.0  # between fixes, beyond which the speed is not known
_TURN: Final = 0.02  # of a field, from one second to the next: 1.1 deg


def velocity_at(gnss: Gnss | None, t: FloatArray) -> FloatArray | None:
    """Return the fixes' velocity at some times, NaN where it is not known, or None."""
    if gnss is None or gnss.v_n is None:
        return None
    sound = np.isfinite(gnss.v_n).all(axis=1)
    if sound.sum() < 2:
        return None
    tg, v = gnss.t[sound], gnss.v_n[sound]
    out = np.column_stack([np.interp(t, tg, v[:, j]) for j in range(3)])
    k = np.clip(np.searchsorted(tg, t), 1, len(tg) - 1)
    out[(tg[k] - tg[k - 1] > _STALE_S) | (t < tg[0]) | (t > tg[-1])] = np.nan
    return out


def may_rest(grid: Grid, gnss: Gnss | None) -> BoolArray:
    """Return where the box may be at rest: no field turns and the fixes stand still."""
    quiet = ~grid.bad
    m = max(round(_BLOCK_S / grid.dt), 1)
    count = len(quiet) // m
    for name in ("acc", "mag"):
        if name not in grid.fields or count < 2:
            continue
        means = grid.fields[name][: count * m].reshape(count, m, 3).mean(axis=1)
        size = float(np.median(np.linalg.norm(means, axis=1)))
        change = np.linalg.norm(np.diff(means, axis=0), axis=1)
        turns = np.concatenate(([0.0], change)) > _TURN * size
        turns |= np.concatenate((change, [0.0])) > _TURN * size
        quiet[: count * m] &= ~np.repeat(turns, m)
    if gnss is None or gnss.v_n is None:
        return np.asarray(quiet)
    speed = np.linalg.norm(gnss.v_n, axis=1)
    known = np.isfinite(speed)
    if not known.any():
        return np.asarray(quiet)
    return np.asarray(quiet & (np.interp(grid.t, gnss.t[known], speed[known]) < _STILL_M_S))


def rest_bias(grid: Grid, gnss: Gnss | None = None) -> FloatArray:
    """Return the rate on which the quietest seconds agree, else zero, shape (3,).

    At rest they do; in a slow, smooth motion the quietest are those of the largest rates.
    """
    m = max(round(_BLOCK_S / grid.dt), 1)
    gyr = grid.fields["gyr"]
    count = len(gyr) // m
    rest = may_rest(grid, gnss)[: count * m].reshape(count, m).all(axis=1)
    if not rest.any():
        return np.zeros(3)
    blocks = gyr[: count * m].reshape(count, m, 3)[rest]
    noise = np.linalg.norm(blocks.std(axis=1), axis=1)
    quiet = noise <= 2.0 * np.quantile(noise, 0.05)
    means = blocks.mean(axis=1)[quiet]
    bias = np.median(means, axis=0)
    spread = float(np.median(np.linalg.norm(means - bias, axis=1)))
    size = float(np.linalg.norm(bias))
    return np.asarray(bias if spread < 0.6 * size else np.zeros(3))
