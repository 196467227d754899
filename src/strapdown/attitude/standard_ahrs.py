"""Standard AHRS of the thesis "micro UAV": the accelerometer levels, the field turns."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._uav_ahrs import AS_PRINTED, UavAhrs
from strapdown.estimator import Taken, register


@register(
    source="thesis uav, 2.4, A.1; Jang, Liccardo 2006",
    cost="7 states, 7x7 covariance; corrections at 25 and 10 Hz",
    uses=("mag",),
    rank=11,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class StandardAhrs(UavAhrs):
    """Standard AHRS: EKF of quaternion and constant gyro bias, corrected at 25 and 10 Hz.

    State: q_nb and gyro bias. The gyroscope predicts at its own rate, 50 Hz in the source. At
    `acc_rate` the specific force, taken for gravity, corrects roll and pitch; at `mag_rate` the
    heading of the field, levelled by the estimate, corrects yaw. Every correction moves all seven
    states. It is made for uniform motion and for biases that stay: in turns it is off in roll, and
    a bias that changes is not followed.

    Parameters are those of `UavAhrs`, and

    Parameters
    ----------
    gyr_bias_noise : float
        Rate random walk of the bias [rad/s^2/sqrt(Hz)]. The default is the printed variance of
        1e-12 per 20 ms: nearly constant.
    mag_noise : float
        Density of the heading's error [rad/sqrt(Hz)]: 7 deg at 10 Hz.
    mag_rate : float
        Corrections by the field [Hz]; as `acc_rate`.
    heading_jacobian : {'levelled', 'exact', 'printed'}
        Levelled: an error of tilt turns the levelled field, too, and is corrected with it. Exact:
        that of the yaw angle alone, which the source means. Printed: with a factor too many; then
        a heading near +-90 deg is not corrected, and from 90 to 128 deg it is driven away.
    levelling : {'now', 'before'}
        Whether roll and pitch of this step level the field, or, as printed, of the step before.

    Notes
    -----
    Online. Misprints corrected: the sign of gravity (2.33), the element 2 g q1 of (2.37), the
    halves of (2.35), the Jacobian of yaw (2.38), the declination, which the program leaves out.

    References
    ----------
    .. [1] J. S. Jang, D. Liccardo, "Automation of small UAVs using a low cost MEMS sensor and
           embedded computing platform", 25th DASC, 2006.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = StandardAhrs(acc_rate=50.0).run(demo.recording())
    """

    NAME: ClassVar[str] = "standard-ahrs"
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {"acc": ("x", "y", "z"), "mag": ("heading",)}
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise"),
        Taken("gyr_bias_noise", "gyr_bias_walk"),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("std_gyr_bias", "gyr_bias_std"),
    )
    gyr_bias_noise: float = math.sqrt(1e-12 * 50.0)
    mag_noise: float = math.sqrt(0.014924 / 10.0)
    mag_rate: float = 10.0
    heading_jacobian: Literal["levelled", "exact", "printed"] = "levelled"
    levelling: Literal["now", "before"] = "now"

    def __post_init__(self) -> None:
        """Check the parameters."""
        UavAhrs.__post_init__(self)
        _checks.positive("gyr_bias_noise", self.gyr_bias_noise, allow_zero=True)
        _checks.positive("mag_noise", self.mag_noise)
        self._positive_or_infinite("mag_rate")
        _checks.one_of("heading_jacobian", self.heading_jacobian, _JACOBIANS)
        _checks.one_of("levelling", self.levelling, ("now", "before"))

    @classmethod
    def as_printed(cls, **parameters: Any) -> "StandardAhrs":
        """Return the filter of the program of appendix A.1.

        The program starts level and facing north, ``init(attitude=(1, 0, 0, 0))``; its first step
        is the second sample here, the first begins the interval.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        StandardAhrs
        """
        return cls(**{**AS_PRINTED, "levelling": "before", **parameters})

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import standard_ahrs

        return standard_ahrs

    def _params(self) -> FloatArray:
        from strapdown.kernels import uav_ahrs as k

        p = self._shared(self._kernel().P_SIZE, k.CONSTANT)
        p[k.P_BIAS_NOISE : k.P_BIAS_NOISE + 3] = self.gyr_bias_noise
        p[k.P_MAG_NOISE] = self.mag_noise
        p[k.P_MAG_PERIOD] = 1.0 / self.mag_rate
        p[k.P_JACOBIAN] = (k.LEVELLED, k.OF_ANGLE, k.AS_PRINTED)[
            _JACOBIANS.index(self.heading_jacobian)
        ]
        p[self._kernel().P_BEFORE] = float(self.levelling == "before")
        return p


_JACOBIANS = ("levelled", "exact", "printed")
