"""Extended Kalman filter of limb rates and quaternion, with or without QUEST in front."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import State, Taken, register
from strapdown.kernels import memory as _m
from strapdown.units import DEG

Measurements = Literal["quest", "vectors"]
Formula = Literal["corrected", "printed"]


@register(
    source="thesis kinematic, 4.3; Yun, Bachmann 2006",
    cost="7 states, 7x7 covariance",
    uses=("mag",),
    rank=11,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class QuestEkf(AttitudeEstimator):
    """EKF of body rates and quaternion; QUEST makes one quaternion of gravity and field.

    State: the angular rate omega_b, a first-order process that a limb's muscles drive (64), and
    q_nb (65). The gyroscope measures the rates; accelerometer and field measure the quaternion:
    through QUEST, seven measurements with ``H = I`` (66), or as vectors, nine, of which two, the
    lengths, tell no turn. The source describes both and ran neither; it prints no tuning.

    The quaternion's error is taken along the sphere, which the source neglects: three errors in
    four components, so ``R`` of QUEST's quaternion has rank three. It is that of the two
    directions' noise, and enters as three scalars without correlation. There is no bias:
    `gyr_noise` must cover it, or subtract it beforehand.

    Parameters
    ----------
    reject_disturbed : bool
        Whether a field of unusual strength or dip is left out, not only flagged.
    measurements : {'quest', 'vectors'}
        What accelerometer and field become. Where only one of them is there, both variants take
        its direction.
    gyr_noise : float
        Density of the gyroscope's error [rad/s/sqrt(Hz)], its unknown bias included: a bias b
        shows as about ``b`` times the ratio of `acc_noise` over gravity, or `mag_noise`, to this.
    acc_noise : float
        Density of the linear acceleration and the noise [m/s^2/sqrt(Hz)].
    mag_noise : float
        Density of the field direction's error [rad/sqrt(Hz)], disturbances included.
    rate_std : float
        Standard deviation of the rates of the motion [rad/s]. Larger smooths them less.
    rate_time : float
        tau, their correlation time [s].
    dip : float, optional
        Dip of the field, positive down [rad]. None: as measured, so that the field tells the
        heading only; given, it shares in roll and pitch.
    integration : {'corrected', 'printed'}
        Corrected: the rate of the interval turns the quaternion, exactly. Printed: the rate of
        the sample before does, to first order, (68); attitude then lags by an interval. A turn of
        more than 0.5 rad in a sample is taken exactly in both.
    std_tilt, std_heading : float
        Standard deviations of the first alignment [rad].
    gate : float
        Innovations beyond so many sigma are weighted down. Infinite switches it off.
    gap_rate : float
        Rate that may have gone unseen in a gap or beyond the gyro's range [rad/s]. A gap in which
        it hides more than `std_tilt` levels again, and takes the heading from the next field.
    gravity : float
        Magnitude of gravity [m/s^2].

    Notes
    -----
    Online. Steady state at the defaults: errors of tilt decay in about 3 s, of heading, where
    the field dips by 60 deg, in 10 s.

    QUEST takes directions, and an acceleration bends that of the specific force. Of accelerations
    in all directions its variance is ``acc_noise^2 / (g |f|)``, so that they average out; and what
    is entered of the quaternion are the sines of tilt and the angle of the heading.

    The example (item 40) that the source prints for the nine measurements belongs to a
    scalar-last quaternion and to the turn from sensor to Earth; its own convention is used.

    References
    ----------
    .. [1] X. Yun, E. R. Bachmann, "Design, implementation, and experimental results of a
           quaternion-based Kalman filter for human body motion tracking", IEEE Trans. Robotics
           22(6), 2006: what the source follows.
    .. [2] M. D. Shuster, S. D. Oh, "Three-axis attitude determination from vector
           observations", J. Guidance 4(1), 1981: QUEST and its covariance.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = QuestEkf(measurements="vectors").run(demo.recording())
    """

    NAME: ClassVar[str] = "quest-ekf"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "std_attitude_n")
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "acc": ("north", "east"),
        "mag": ("east", "dip"),
    }
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise", floor=True),
        Taken("acc_noise", "acc_noise", floor=True),
    )
    reject_disturbed: bool = True
    measurements: Measurements = "quest"
    gyr_noise: float = 0.05
    acc_noise: float = 1.5
    mag_noise: float = 0.25
    rate_std: float = 5.0
    rate_time: float = 0.5
    dip: float | None = None
    integration: Formula = "corrected"
    std_tilt: float = 5.0 * DEG
    std_heading: float = 10.0 * DEG
    gate: float = 4.0
    gap_rate: float = 0.5
    gravity: float = G0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in (
            "gyr_noise", "acc_noise", "mag_noise", "rate_std", "rate_time", "std_tilt",
            "std_heading", "gravity",
        ):  # fmt: skip
            _checks.positive(name, getattr(self, name))
        _checks.positive("gap_rate", self.gap_rate, allow_zero=True)
        if self.gate != math.inf:
            _checks.positive("gate", self.gate)
        if self.dip is not None:
            _checks.in_range("dip", self.dip, -1.5, 1.5)  # nearer the vertical is no heading
        _checks.one_of("measurements", self.measurements, ("quest", "vectors"))
        _checks.one_of("integration", self.integration, ("corrected", "printed"))

    def rate(self, state: State) -> FloatArray:
        """Return the estimated angular rate of a state, omega_b, shape (3,) [rad/s].

        Parameters
        ----------
        state : State
            Of this estimator.

        Returns
        -------
        ndarray, shape (3,)
        """
        from strapdown.kernels.quest_ekf_layout import RATE

        return self._own(state).x[RATE : RATE + 3].copy()

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import quest_ekf

        return quest_ekf

    def _params(self) -> FloatArray:
        from strapdown.kernels import quest_ekf_layout as k

        p = self._common(k.P_SIZE)
        p[_m.P_REALIGN] = 0.0
        p[k.P_GYR_NOISE] = self.gyr_noise
        p[k.P_ACC_NOISE] = self.acc_noise
        p[k.P_MAG_NOISE] = self.mag_noise
        p[k.P_RATE_STD] = self.rate_std
        p[k.P_RATE_TIME] = self.rate_time
        p[k.P_GRAVITY] = self.gravity
        p[k.P_GATE] = self.gate
        p[k.P_GAP_RATE] = self.gap_rate
        p[k.P_STD_TILT] = self.std_tilt
        p[k.P_STD_HEADING] = self.std_heading
        p[k.P_SIN_DIP] = math.nan if self.dip is None else math.sin(self.dip)
        p[k.P_VECTORS] = float(self.measurements == "vectors")
        p[k.P_EULER] = float(self.integration == "printed")
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        from strapdown.kernels import quest_ekf_layout as k

        head, _ = AttitudeEstimator._memory(self)
        x = np.zeros(k.X_SIZE)
        x[: _m.HEAD] = head
        x[k.Q_P] = 1.0
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi  # nothing is known
        tilt, heading = self.std_tilt**2, self.std_heading**2
        # a turn phi of the quaternion (1, 0, 0, 0) makes it (1, phi / 2)
        quarter = 0.25 * np.array([0.0, tilt, tilt, heading])
        return x, np.diag(np.concatenate((np.full(3, self.rate_std**2), quarter)))
