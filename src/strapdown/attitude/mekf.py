"""Multiplicative extended Kalman filter: quaternion and gyro bias."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import Taken, register
from strapdown.kernels import memory as _m
from strapdown.units import DEG


@register(
    source="Lefferts, Markley, Shuster 1982; Markley 2003",
    cost="7 states, 6x6 covariance",
    uses=("mag",),
    rank=20,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class Mekf(AttitudeEstimator):
    """Multiplicative EKF: attitude and gyro bias from accelerometer and field directions.

    State: q_nb and gyro bias; error state ``(dtheta_b, dbg)`` with
    ``q_nb_true = q_nb exp(dtheta_b)``. The bias is a random walk. Measurements enter as scalars in
    Joseph form: three of the direction of gravity, one of the field's heading. The specific force
    is scaled by gravity, not normalised, so that linear accelerations average out. The field's
    reference takes the measured dip, so that dip is no measurement. An innovation beyond `gate`
    sigma is weighted down until it lies on the gate, and flagged: its pull is bounded, and the
    filter always recovers.

    Parameters
    ----------
    reject_disturbed : bool
        Whether a field of unusual strength or dip is left out, not only flagged.
    gyr_noise : float
        Angle random walk [rad/s/sqrt(Hz)]. Larger trusts the gyroscope less.
    gyr_bias_noise : float
        Rate random walk of the bias [rad/s^2/sqrt(Hz)]. Zero: the bias is constant.
    acc_noise : float
        Density of the linear acceleration and the noise [m/s^2/sqrt(Hz)]. Motion dominates: a
        linear acceleration of sigma a and correlation time tau counts ``a sqrt(2 tau)``.
    mag_noise : float
        Density of the field direction's error [rad/sqrt(Hz)], disturbances included.
    std_tilt, std_heading : float
        Standard deviations of the first alignment [rad].
    std_gyr_bias : float
        Standard deviation of the turn-on bias [rad/s]. Zero: the bias is known to be zero.
    gate : float
        Innovations beyond so many sigma are weighted down. Infinite switches it off.
    gap_rate : float
        Rate that may have gone unseen in a gap or beyond the gyro's range [rad/s]. A gap in which
        it hides more than `std_tilt` levels again, and takes the heading from the next field.
    gravity : float
        Magnitude of gravity [m/s^2].

    Notes
    -----
    Online.

    References
    ----------
    .. [1] E. J. Lefferts, F. L. Markley, M. D. Shuster, "Kalman filtering for spacecraft
           attitude estimation", J. Guidance 5(5), 1982.
    .. [2] F. L. Markley, "Attitude error representations for Kalman filtering",
           J. Guidance 26(2), 2003.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = Mekf(acc_noise=1.0).run(demo.recording())
    """

    NAME: ClassVar[str] = "mekf"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias")
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {"acc": ("x", "y", "z"), "mag": ("heading",)}
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise"),
        Taken("gyr_bias_noise", "gyr_bias_walk"),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("std_gyr_bias", "gyr_bias_std"),
    )
    reject_disturbed: bool = True
    gyr_noise: float = 3e-4
    gyr_bias_noise: float = 3e-5
    acc_noise: float = 1.5
    mag_noise: float = 0.25
    std_tilt: float = 5.0 * DEG
    std_heading: float = 10.0 * DEG
    std_gyr_bias: float = 1.0 * DEG
    gate: float = 4.0
    gap_rate: float = 0.5
    gravity: float = G0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in ("gyr_noise", "acc_noise", "mag_noise", "std_tilt", "std_heading", "gravity"):
            _checks.positive(name, getattr(self, name))
        for name in ("gyr_bias_noise", "std_gyr_bias", "gap_rate"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        if self.gate != math.inf:
            _checks.positive("gate", self.gate)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import mekf

        return mekf

    def _params(self) -> FloatArray:
        k = self._kernel()
        p = self._common(k.P_SIZE)
        p[_m.P_REALIGN] = 0.0
        p[k.P_GYR_NOISE] = self.gyr_noise
        p[k.P_BIAS_NOISE] = self.gyr_bias_noise
        p[k.P_ACC_NOISE] = self.acc_noise
        p[k.P_MAG_NOISE] = self.mag_noise
        p[k.P_GRAVITY] = self.gravity
        p[k.P_GATE] = self.gate
        p[k.P_GAP_RATE] = self.gap_rate
        p[k.P_STD_TILT] = self.std_tilt
        p[k.P_STD_HEADING] = self.std_heading
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        head, _ = AttitudeEstimator._memory(self)
        k = self._kernel()
        x = np.zeros(k.X_SIZE)
        x[: _m.HEAD] = head
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi  # nothing is known
        x[_m.STD_BG : _m.STD_BG + 3] = self.std_gyr_bias
        P = np.zeros((6, 6))
        P[:3, :3] = self.std_tilt**2 * np.eye(3)
        P[3:, 3:] = self.std_gyr_bias**2 * np.eye(3)
        return x, P
