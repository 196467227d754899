"""What goes into a mechanisation: where it begins, and samples fit for integration."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray, IntArray
from strapdown.errors import DataGap
from strapdown.kernels.status import ACC_INVALID, GYR_INVALID
from strapdown.recording import Imu, Recording
from strapdown.solution import Solution
from strapdown.truth import Truth

Samples = Recording | Imu | tuple[ArrayLike, ArrayLike, ArrayLike]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where a mechanisation begins.

    Parameters
    ----------
    lla : array_like, shape (3,)
        Latitude, longitude [rad] and height [m]; on a spherical Earth the latitude is that of
        the sphere.
    q_nb : array_like, shape (4,)
        Attitude, body to NED.
    v_n : array_like, shape (3,)
        Velocity over ground, north, east, down [m/s].
    t : float, optional
        Time of all this [s]; that of the first sample by default.
    """

    lla: ArrayLike
    q_nb: ArrayLike
    v_n: ArrayLike = (0.0, 0.0, 0.0)
    t: float | None = None

    def __post_init__(self) -> None:
        """Check shapes and values."""
        lla = _checks.as_vector("lla", self.lla)
        if abs(lla[0]) > math.pi / 2 * (1.0 + 1e-15):
            raise ValueError(
                f"latitude in `lla` must lie in [-pi/2, pi/2] rad, got {lla[0]:g}; "
                "if it is in degrees, multiply it by DEG."
            )
        q_nb = _checks.as_quats("q_nb", _checks.as_vector("q_nb", self.q_nb, 4))
        object.__setattr__(self, "lla", lla)
        object.__setattr__(self, "q_nb", q_nb)
        object.__setattr__(self, "v_n", _checks.as_vector("v_n", self.v_n))
        if self.t is not None:
            object.__setattr__(self, "t", _checks.finite("t", self.t))

    @classmethod
    def of(cls, sol: Solution | Truth, row: int = 0) -> "Start":
        """Return the start that a row of a navigation solution or of a truth gives.

        Parameters
        ----------
        sol : Solution or Truth
            With position and velocity.
        row : int
            Which row; -1 is the last.

        Returns
        -------
        Start
        """
        if not isinstance(sol, Solution | Truth):
            raise TypeError(f"`sol` must be a Solution or a Truth, got {type(sol).__name__}.")
        if sol.lla is None or sol.v_n is None:
            raise ValueError("`sol` must have position and velocity, this one has attitude only.")
        return cls(t=float(sol.t[row]), lla=sol.lla[row], v_n=sol.v_n[row], q_nb=sol.q_nb[row])


class Valid(NamedTuple):
    """Samples without NaN.

    Attributes
    ----------
    t, gyr, acc : ndarray, shapes (n,), (n, 3), (n, 3)
        Times [s], rates [rad/s], specific forces [m/s^2].
    flags : ndarray of int, shape (n + 1,)
        `Status` bits of what was left out before each sample, and after the last.
    """

    t: FloatArray
    gyr: FloatArray
    acc: FloatArray
    flags: IntArray


def samples_of(rec: Samples) -> Valid:
    """Return the samples of whatever holds them, those with NaN left out."""
    if isinstance(rec, Recording):
        rec = rec.need("imu")
    if isinstance(rec, Imu):
        t, gyr, acc = rec.t, rec.gyr, rec.acc
    elif isinstance(rec, tuple) and len(rec) == 3:
        gyr = _checks.as_samples("gyr", rec[1], allow_nan=True)
        acc = _checks.as_samples("acc", rec[2], allow_nan=True)
        t = _checks.as_times("t", rec[0])
        _checks.same_length(t=t, gyr=gyr, acc=acc)
    else:
        raise TypeError(
            "`rec` must be a Recording, an Imu or a tuple (t, gyr, acc), "
            f"got {type(rec).__name__}."
        )
    bits: IntArray = np.where(np.isnan(gyr).any(axis=1), GYR_INVALID, 0)
    bits |= np.where(np.isnan(acc).any(axis=1), ACC_INVALID, 0)
    good = bits == 0
    flags = np.zeros(int(good.sum()) + 1, dtype=np.int64)
    np.bitwise_or.at(flags, np.cumsum(good)[~good], bits[~good])  # the next good one takes them
    t, gyr, acc = (np.ascontiguousarray(part[good]) for part in (t, gyr, acc))
    return Valid(t, gyr, acc, flags)


def samples_after(samples: Valid, start: float, max_gap: float) -> Valid:
    """Return the samples after a time; refuse a gap among them."""
    first = int(np.searchsorted(samples.t, start, side="right"))
    t, gyr, acc, flags = samples
    left = Valid(t[first:], gyr[first:], acc[first:], flags[first:])
    steps = np.diff(left.t, prepend=start)
    if len(left.t) and steps.max() > max_gap:
        row = int(np.argmax(steps > max_gap))
        raise DataGap(
            f"stream imu has no valid samples for {steps[row]:.3g} s before {left.t[row]:g} s, "
            f"longer than `max_gap` of {max_gap:g} s; begin again after the gap, or raise "
            "`max_gap` to take the motion in it as uniform."
        )
    return left
