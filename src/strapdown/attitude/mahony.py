"""Mahony's explicit complementary filter."""

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

    State: q_nb and gyro bias. The error is the sum of the cross products of measured and
    predicted directions of gravity and field. The field's reference takes the measured dip: an
    error of dip changes nothing, one of heading pulls on the tilt as well.

    Parameters
    ----------
    kp : float
        Proportional gain [1/s]. A tilt error decays as ``exp(-kp * t)``.
        Larger trusts accelerometer and magnetometer, smaller the gyroscope.
    ki : float
        Integral gain [1/s^2]. Zero switches gyro bias estimation off.

    Notes
    -----
    Online. A heading error decays as ``exp(-kp (1 - sin dip) t)`` with the dip of the field.

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
    kp: float = 0.5
    ki: float = 0.005

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        _checks.positive("kp", self.kp)
        _checks.positive("ki", self.ki, allow_zero=True)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import mahony

        return mahony

    def _params(self) -> FloatArray:
        kernel = self._kernel()
        p = self._common(kernel.P_SIZE)
        p[kernel.P_KP] = self.kp
        p[kernel.P_KI] = self.ki
        return p
