"""Mahony's explicit complementary filter."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.estimator import register


@register(
    source="Mahony, Hamel, Pflimlin 2008",
    cost="7 states, no matrix",
    uses=("mag",),
)
@dataclass(frozen=True, slots=True, kw_only=True)
class Mahony(AttitudeEstimator):
    """Mahony filter: a proportional-integral pull along the cross product of directions.

    State: q_nb and gyro bias. The error is the cross product of measured and predicted
    direction of gravity, and that of the field taken about the vertical.

    Two things differ from [1]_. The whole cross product of the field would pull on the tilt, and
    turn the heading at ``kp (1 - sin dip)`` only: here it turns the heading alone, as quickly as
    gravity the tilt. And the pull of the accelerometer is limited: unlimited, accelerations
    of a few tenths of g wind up tilt and bias.

    Parameters
    ----------
    reject_disturbed : bool
        Whether a field of unusual strength or dip is left out, not only flagged.
    kp : float
        Proportional gain [1/s]. Errors of tilt and heading decay as ``exp(-kp * t)``.
        Larger trusts accelerometer and magnetometer, smaller the gyroscope.
    ki : float
        Integral gain [1/s^2]. Zero switches gyro bias estimation off.
    limit : float
        Sine of the angle beyond which an error of gravity's direction pulls no harder. Infinite
        switches it off.

    Notes
    -----
    Online. A tilt error beyond `limit` decays by ``kp * limit`` per second.

    References
    ----------
    .. [1] R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on
           the special orthogonal group", IEEE TAC 53(5), 2008.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = Mahony(kp=1.0).run(demo.recording())
    """

    NAME: ClassVar[str] = "mahony"
    reject_disturbed: bool = True
    kp: float = 0.5
    ki: float = 0.005
    limit: float = 0.1

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        _checks.positive("kp", self.kp)
        _checks.positive("ki", self.ki, allow_zero=True)
        if self.limit != math.inf:
            _checks.positive("limit", self.limit)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import mahony

        return mahony

    def _params(self) -> FloatArray:
        kernel = self._kernel()
        p = self._common(kernel.P_SIZE)
        p[kernel.P_KP] = self.kp
        p[kernel.P_KI] = self.ki
        p[kernel.P_LIMIT] = self.limit
        return p
