"""One axis for a gyroscope and an accelerometer that were sampled apart."""

from typing import NamedTuple

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.errors import FormatError
from strapdown.io._raw import Finding
from strapdown.recording import Imu

_LONGEST_HOLD = 3.0  # median intervals; further from a sample the slower sensor is NaN


class Held(NamedTuple):
    """Samples on another axis: values, and where each was really taken."""

    values: FloatArray
    real: BoolArray


def merge(
    t_gyr: FloatArray,
    gyr: FloatArray,
    t_acc: FloatArray,
    acc: FloatArray,
    file: str,
    findings: list[Finding],
) -> Imu:
    """Return gyroscope and accelerometer on the axis of the faster one.

    ``gyr[k]`` is the rate over ``(t[k-1], t[k]]``, so a slower gyroscope's sample is held back to
    the sample before it; a slower accelerometer's sample is held until the next. Masks mark where
    a sample was taken. Farther than three intervals from a sample the held one is NaN.

    Parameters
    ----------
    t_gyr, t_acc : ndarray, shape (n,), (m,)
        Times, strictly increasing [s].
    gyr, acc : ndarray, shape (n, 3), (m, 3)
        Samples [rad/s], [m/s^2].
    file : str
        For messages.
    findings : list of Finding
        Where the note goes.

    Returns
    -------
    Imu
        Over the time that both cover.

    Raises
    ------
    FormatError
        If they do not overlap.
    """
    if len(t_gyr) == len(t_acc) and np.array_equal(t_gyr, t_acc):
        return Imu(t=t_gyr, gyr=gyr, acc=acc)
    start, stop = max(t_gyr[0], t_acc[0]), min(t_gyr[-1], t_acc[-1])
    if not start < stop:
        raise FormatError(
            "gyroscope and accelerometer must overlap in time, they span "
            f"{t_gyr[0]:.6g} to {t_gyr[-1]:.6g} s and {t_acc[0]:.6g} to {t_acc[-1]:.6g} s",
            file=file,
            stream="imu",
        )
    step_gyr, step_acc = (float(np.median(np.diff(t))) for t in (t_gyr, t_acc))
    # Of two alike, the gyroscope: its samples are what is integrated.
    gyr_leads = step_gyr <= 1.01 * step_acc
    rate = f"{1.0 / step_gyr:.4g} Hz and {1.0 / step_acc:.4g} Hz"
    if gyr_leads:
        # Rates before the first accelerometer sample would have none beside them.
        rows = slice(int(np.searchsorted(t_gyr, start, side="left")), len(t_gyr))
        t, gyr = t_gyr[rows], gyr[rows]
        held = _held_on(t, t_acc, acc, _LONGEST_HOLD * step_acc)
        imu = Imu(t=t, gyr=gyr, acc=held.values, acc_real=held.real)
        what = f"gyroscope and accelerometer have {rate}: the accelerometer is held"
    else:
        stop_row = int(np.searchsorted(t_acc, t_gyr[-1], side="right"))
        first = int(np.searchsorted(t_acc, t_gyr[0] - step_gyr, side="right"))
        t, acc = t_acc[first:stop_row], acc[first:stop_row]
        held = _held_back(t, t_gyr, gyr, _LONGEST_HOLD * step_gyr)
        imu = Imu(t=t, gyr=held.values, acc=acc, gyr_real=held.real)
        what = f"gyroscope and accelerometer have {rate}: the gyroscope is held back"
    findings.append(Finding(kind="held", what=what, file=file, stream="imu"))
    return imu


def _held_on(t: FloatArray, t_s: FloatArray, values: FloatArray, longest: float) -> Held:
    """Return the last sample at or before each time; real at the first time it is there."""
    last = np.searchsorted(t_s, t, side="right") - 1
    real = np.diff(last, prepend=-1) > 0
    out = values[np.maximum(last, 0)]
    out[(last < 0) | (t - t_s[np.maximum(last, 0)] > longest)] = np.nan
    return Held(out, real)


def _held_back(t: FloatArray, t_s: FloatArray, values: FloatArray, longest: float) -> Held:
    """Return the first sample at or after each time; real at the last time before it."""
    following = np.searchsorted(t_s, t, side="left")
    real = np.diff(following, append=len(t_s)) > 0
    index = np.minimum(following, len(t_s) - 1)
    out = values[index]
    out[(following == len(t_s)) | (t_s[index] - t > longest)] = np.nan
    return Held(out, real)
