"""What the two filters of the thesis "micro UAV" have in common."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.kernels import memory as _m

# The programs' variances hold for a sample of the gyroscope at 50 Hz, and for a correction.
GYR_NOISE: Final = 0.01 * math.sqrt(1.0 / 50.0)
ACC_NOISE: Final = math.sqrt(1.962361 / 25.0)
PRINTED_GRAVITY: Final = 9.81


@dataclass(frozen=True, slots=True, kw_only=True)
class UavAhrs(AttitudeEstimator):
    """Extended Kalman filter of q_nb and gyro bias, predicted by every sample of the gyroscope.

    Parameters
    ----------
    reject_disturbed : bool
        Whether a field of unusual strength or dip is left out, not only flagged.
    gyr_noise : float
        Angle random walk [rad/s/sqrt(Hz)]. Larger trusts the gyroscope less.
    acc_noise : float
        Density of the accelerometer's error, manoeuvres included [m/s^2/sqrt(Hz)].
    acc_rate : float
        Corrections by the accelerometer [Hz]. It takes the sample nearest to the time due;
        infinite takes every one. A correction stands for its period, so more of them do not trust
        the accelerometer more.
    propagation : {'exact', 'printed'}
        Exact: a constant rate is integrated exactly, and the quaternion's covariance stays on the
        sphere. Printed: both to first order, and only the diagonal of the noise.
    std_tilt, std_heading : float
        Standard deviations of the first alignment [rad]. The default is the printed P_0 of 0.1 of
        each component; as printed, `std_tilt` is that of all three axes.
    std_gyr_bias : float
        Standard deviation of the first bias [rad/s].
    gate : float
        Innovations of field and course beyond so many sigma are weighted down. Infinite, as in
        the source, switches it off. The accelerometer has none: what motion adds is in its noise,
        and a gate would take a large error of the filter for one of the sensor.
    gap_rate : float
        Rate that may have gone unseen in a gap or beyond the gyro's range [rad/s]. A gap in which
        it hides more than `std_tilt` levels again, and takes the heading from what comes next.
    gravity : float
        Magnitude of gravity [m/s^2].
    """

    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias")
    reject_disturbed: bool = True
    gyr_noise: float = GYR_NOISE
    acc_noise: float = ACC_NOISE
    acc_rate: float = 25.0
    propagation: Literal["exact", "printed"] = "exact"
    std_tilt: float = math.sqrt(0.4)
    std_heading: float = math.sqrt(0.4)
    std_gyr_bias: float = math.sqrt(0.1)
    gate: float = 5.0
    gap_rate: float = 0.5
    gravity: float = G0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in ("gyr_noise", "acc_noise", "std_tilt", "std_heading", "gravity"):
            _checks.positive(name, getattr(self, name))
        for name in ("std_gyr_bias", "gap_rate"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        for name in ("gate", "acc_rate"):
            self._positive_or_infinite(name)
        _checks.one_of("propagation", self.propagation, ("exact", "printed"))

    def _positive_or_infinite(self, name: str) -> None:
        if getattr(self, name) != math.inf:
            _checks.positive(name, getattr(self, name))

    def _shared(self, size: int, printed: float) -> FloatArray:
        """Return a parameter vector with the shared cells filled."""
        from strapdown.kernels import uav_ahrs as k

        p = self._common(size)
        p[_m.P_REALIGN] = 0.0
        p[k.P_GYR_NOISE] = self.gyr_noise
        p[k.P_ACC_NOISE] = self.acc_noise
        p[k.P_ACC_PERIOD] = 1.0 / self.acc_rate
        p[k.P_GRAVITY] = self.gravity
        p[k.P_GATE] = self.gate
        p[k.P_GAP_RATE] = self.gap_rate
        p[k.P_STD_TILT] = self.std_tilt
        p[k.P_STD_HEADING] = self.std_heading
        p[k.P_PROPAGATION] = printed if self.propagation == "printed" else k.EXACT
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        head, _ = AttitudeEstimator._memory(self)
        x = np.zeros(self._kernel().X_SIZE)
        x[: _m.HEAD] = head
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi  # nothing is known
        x[_m.STD_BG : _m.STD_BG + 3] = self.std_gyr_bias
        P = np.zeros((7, 7))
        P[:4, :4] = 0.25 * self.std_tilt**2 * np.eye(4)
        P[4:, 4:] = self.std_gyr_bias**2 * np.eye(3)
        return x, P


# What the programs have in place of the defaults.
AS_PRINTED: Final[dict[str, Any]] = {
    "propagation": "printed",
    "heading_jacobian": "printed",
    "gate": math.inf,
    "reject_disturbed": False,
    "gravity": PRINTED_GRAVITY,
}
