"""What attitude estimators have in common beyond the protocol."""

import math
from dataclasses import dataclass

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.estimator import Estimator
from strapdown.kernels import memory as _m
from strapdown.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeEstimator(Estimator):
    """Parameters of every attitude estimator.

    Parameters
    ----------
    use_mag : bool
        Whether to use the magnetometer where there is one. False: heading is arbitrary.
    declination : float, optional
        Heading of magnetic north, east positive [rad]. Given, heading is true; None, magnetic.
    reject_disturbed : bool
        Whether a field whose strength is a fifth, or whose dip is 11 deg off the usual one is
        left out, not only flagged. What stays the same for half a minute becomes usual; a field
        that is off again and again is a magnetometer to be calibrated, and is used.
    max_gap : float
        A longer interval between samples [s] is a gap: covariance is widened, or, where there
        is none, attitude is aligned again and the bias kept.
    gyr_range, acc_range : float
        Ends of the sensors' ranges [rad/s], [m/s^2]: a sample there is flagged, and such an
        acceleration is not used. Infinite switches the test off.
    """

    use_mag: bool = True
    declination: float | None = None
    reject_disturbed: bool = False
    max_gap: float = 1.0
    gyr_range: float = math.inf
    acc_range: float = math.inf

    def __post_init__(self) -> None:
        """Check the parameters."""
        for name in ("use_mag", "reject_disturbed"):
            value = getattr(self, name)
            if not isinstance(value, bool):
                raise TypeError(f"`{name}` must be True or False, got {value!r}.")
        if self.declination is not None:
            _checks.in_range("declination", self.declination, -math.pi, math.pi)
        _checks.positive("max_gap", self.max_gap)
        for name in ("gyr_range", "acc_range"):
            value = getattr(self, name)
            if value != math.inf:
                _checks.positive(name, value)

    def _common(self, size: int) -> FloatArray:
        """Return a parameter vector with the common cells filled."""
        p = np.zeros(size)
        p[_m.P_MAX_GAP] = self.max_gap
        p[_m.P_USE_MAG] = float(self.use_mag)
        p[_m.P_COS_D] = math.cos(self.declination or 0.0)
        p[_m.P_SIN_D] = math.sin(self.declination or 0.0)
        p[_m.P_GYR_RANGE] = self.gyr_range
        p[_m.P_ACC_RANGE] = self.acc_range
        p[_m.P_REALIGN] = 1.0
        p[_m.P_REJECT] = float(self.reject_disturbed)
        return p

    def _heading_reference(self, rec: Recording) -> str:
        """Return what the heading of a solution is measured from."""
        if rec.mag is None or not self.use_mag or not _says_something(rec.mag.mag):
            return "arbitrary"
        return "magnetic" if self.declination is None else "true"


def _says_something(field: FloatArray) -> bool:
    """Whether a sample is whole; nearly always the first ones are."""
    return any(
        bool(np.isfinite(rows).all(axis=1).any())
        for rows in (field[:100], field[100:])
        if len(rows)
    )
