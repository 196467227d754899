"""Attitude from the gyroscope alone: what every filter is to be compared with."""

from dataclasses import dataclass
from typing import Any, ClassVar

from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.estimator import register
from strapdown.kernels import memory as _m


@register(
    source="thesis kinematic, 2.9.1 and figure 12",
    cost="4 states",
    uses=("mag",),
)
@dataclass(frozen=True, slots=True, kw_only=True)
class GyroIntegration(AttitudeEstimator):
    """Integrated gyroscope, aligned once and then left alone.

    State: q_nb. The rate is taken as constant over a sampling interval, for which
    ``q_nb exp(omega dt)`` is exact; where samples are missing, as linear between them.
    Accelerometer and magnetometer serve the first alignment only. A constant gyro bias b makes
    an error that grows as ``b t``.

    See `AttitudeEstimator` for the parameters.

    Notes
    -----
    Online.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = GyroIntegration().run(demo.recording())
    """

    NAME: ClassVar[str] = "gyro"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb",)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import integration

        return integration

    def _params(self) -> FloatArray:
        return self._common(_m.P_HEAD)
