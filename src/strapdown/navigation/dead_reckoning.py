"""Dead reckoning from a fix: what every navigation filter is to be compared with."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.estimator import Estimator, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording


@register(
    source="thesis E1, section 2.5.4, without aiding",
    cost="no covariance, mechanisation at the IMU's rate",
    needs=("gnss",),
    uses=("mag",),
    gives="navigation",
    rank=-10,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class DeadReckoning(AttitudeEstimator):
    """Strapdown mechanisation from the first fix on, without any aiding.

    The box rests at the start: level is averaged, the mean rate less that of the Earth is the
    gyro's bias. Heading is what is given, or what the field says, or nothing. At the first fix
    after that it begins there, standing, and no later fix is looked at. `Mechanisation` is the
    same with any start, frame and representation of attitude; this one integrates a quaternion in
    the wander frame. The status has ``OUTAGE`` from the start on: nothing bounds the error.

    Parameters
    ----------
    align_time : float
        How long the box rests at the start [s]. Zero: level from the first sample, no bias, and
        the velocity of the fix. The same holds for an attitude that `init` is given.
    heading : float, optional
        Known heading of the x axis at the start [rad], in place of the field's.
    height : {'free', 'held'}
        ``'held'`` keeps the height of the start; free, its error grows without bound.
    earth : {'wgs84', 'spherical'}
        Shape and gravity.

    Notes
    -----
    Online. The first field sample makes the magnetic heading. See `AttitudeEstimator` for the
    other parameters; a gap is bridged with the mean rate and force of its ends.

    Examples
    --------
    >>> DeadReckoning(align_time=30.0, heading=0.5).init().status
    1
    """

    NAME: ClassVar[str] = "dead-reckoning"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "lla", "v_n")
    align_time: float = 10.0
    heading: float | None = None
    height: Literal["free", "held"] = "free"
    earth: Literal["wgs84", "spherical"] = "wgs84"

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        _checks.positive("align_time", self.align_time, allow_zero=True)
        _checks.one_of("height", self.height, ("free", "held"))
        _checks.one_of("earth", self.earth, ("wgs84", "spherical"))
        if self.heading is not None:
            _checks.in_range("heading", self.heading, -math.pi, 2.0 * math.pi)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import dead_reckoning

        return dead_reckoning

    def _params(self) -> FloatArray:
        from strapdown.kernels.mechanisation import layout as k
        from strapdown.navigation.mechanisation import earth_model, increments

        kernel = self._kernel()
        p = self._common(kernel.P_COUNT)
        p[_m.P_REALIGN] = 0.0
        p[k.FRAME], p[k.ATTITUDE] = k.WANDER, k.QUATERNION
        p[k.HELD] = float(self.height == "held")
        earth_model.fill(p, self.earth, None)
        increments.fill(p, 1, compensate=True)
        p[kernel.P_ALIGN_TIME] = self.align_time
        p[kernel.P_HEADING] = math.nan if self.heading is None else self.heading
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        head, P = Estimator._memory(self)
        x = np.zeros(self._kernel().SIZE)
        x[: len(head)] = head
        x[_m.LLA : _m.LLA + 3] = x[_m.V : _m.V + 3] = np.nan
        return x, P

    def _events(self, rec: Recording) -> FloatArray:
        fixes = rec.need("gnss")
        e = np.full((len(fixes), 17), np.nan)
        e[:, 0] = e[:, 3] = fixes.t
        e[:, 1:3] = _m.GNSS, 14
        e[:, 4:7] = fixes.lla
        if fixes.v_n is not None:
            e[:, 7:10] = fixes.v_n
        return e

    def _heading_reference(self, rec: Recording) -> str:
        if self.heading is not None:
            return "true"
        return AttitudeEstimator._heading_reference(self, rec)
