r"""Turn-on bias of a gyroscope, from the rest at the start of a log.

The bias of a MEMS gyroscope changes at each switch-on, scale factors and misalignments hardly.
So a stored calibration keeps its matrix, and the bias comes from the first seconds at rest:
the mean of the raw samples. Multiplied by the matrix it is (6.18) of [1]_.

References
----------
.. [1] F. Scibona, MSc thesis, Universita di Padova, 2015, section 6.3.1: 2 s; section 9.2.1
       says 1 s.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strapdown import motion
from strapdown._checks import as_samples, as_times, as_vector, positive
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import correlation_length
from strapdown.errors import InputError
from strapdown.units import DPS

LEAST_DURATION = 1.0  # [s]
LONGEST_DURATION = 30.0  # [s], later the bias has drifted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TurnOnBias:
    """Mean of the gyroscope at rest.

    Attributes
    ----------
    bias : ndarray, shape (3,)
        In raw samples [rad/s]; the Earth's rate, up to 0.004 deg/s, is part of it.
    std : ndarray, shape (3,)
        Standard deviation of the mean [rad/s].
    t_start, t_stop : float
        The rest that was used [s].
    samples : int
        Samples in it.
    """

    bias: FloatArray
    std: FloatArray
    t_start: float
    t_stop: float
    samples: int


def turn_on_bias(
    t: ArrayLike,
    gyr: ArrayLike,
    acc: ArrayLike,
    *,
    expected: ArrayLike = (0.0, 0.0, 0.0),
    max_change: float = 10.0 * DPS,
    longest: float = LONGEST_DURATION,
    rest: motion.RestTest = motion.DEFAULT,
) -> TurnOnBias:
    """Return the bias of a gyroscope from the rest at the start of a log.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    gyr, acc : array_like, shape (n, 3)
        Raw samples [rad/s], [m/s^2].
    expected : array_like, shape (3,)
        Bias of the last calibration [rad/s].
    max_change : float
        Largest change against it [rad/s]. More is a steady turn, which has no more noise
        than rest.
    longest : float
        Longest part of the rest that is averaged [s].
    rest : RestTest
        What counts as rest.

    Returns
    -------
    TurnOnBias

    Raises
    ------
    InputError
        If the log does not begin with a rest of at least one second.
    """
    t = as_times("t", t)
    gyr = as_samples("gyr", gyr, allow_nan=True)
    found = motion.rest_segments(t, gyr, acc, rest)
    if not found or found[0].t_start > t[0] + LEAST_DURATION:
        begin = f"at rest from {found[0].t_start:.2f} s on" if found else "never at rest"
        raise InputError(
            f"the log must begin with a rest for the turn-on bias, it starts at "
            f"{t[0] if len(t) else math.nan:.2f} s and is {begin}; leave the device still for 2 s "
            "after switching on."
        )
    first = found[0]
    if first.duration < LEAST_DURATION:
        raise InputError(
            f"the rest at the start must last {LEAST_DURATION:g} s, it lasts "
            f"{first.duration:.2f} s; leave the device still for 2 s after switching on."
        )
    stop = int(np.searchsorted(t, first.t_start + positive("longest", longest), side="right"))
    rows = slice(first.start, min(first.stop, stop))
    still = gyr[rows]
    still = still[~np.isnan(still).any(axis=1)]
    bias = still.mean(axis=0)
    change = float(np.linalg.norm(bias - as_vector("expected", expected)))
    if not change <= positive("max_change", max_change):
        raise InputError(
            f"the mean rate at the start must be within {max_change / DPS:g} deg/s of the "
            f"calibrated bias, it is {change / DPS:.3g} deg/s from it; if the device did stand "
            "still, calibrate the gyroscope again."
        )
    correlation = np.array([correlation_length(c) for c in np.ascontiguousarray(still.T)])
    std = still.std(axis=0, ddof=1) * np.sqrt(correlation / len(still))
    return TurnOnBias(
        bias=bias,
        std=std,
        t_start=float(t[rows.start]),
        t_stop=float(t[rows.stop - 1]),
        samples=len(still),
    )
