"""Madgwick's gradient-descent filter, for IMU and MARG, with both compensations."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.estimator import register


@register(
    source="thesis kinematic, 4.2; Madgwick 2010",
    cost="7 states, no matrix",
    uses=("mag",),
    rank=10,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class Madgwick(AttitudeEstimator):
    """Madgwick filter: gyro integration pulled down the gradient of the vector errors.

    State: q_nb and, with `zeta`, the gyro bias. Each sample turns the attitude with the
    compensated rate and against the normalised gradient of the squared difference between
    predicted and measured directions of gravity and field: equations (25), (28)-(36) and
    (46)-(52) of the thesis, misprints corrected. The field's reference is rebuilt from the
    measured dip at every sample (49), so that disturbances reach the heading only.

    Parameters
    ----------
    beta : float
        Size of the correction [rad/s] in quaternion rate: errors shrink at up to
        ``2 beta``. Larger trusts accelerometer and magnetometer, zero is pure integration.
        ``sqrt(3/4) w`` for a gyro error of w on each axis, see `from_gyro_error`.
    zeta : float
        Rate at which the gyro bias follows the correction [rad/s^2]. Zero switches bias
        estimation off. It winds up in a long initial transient.

    Notes
    -----
    Online. The gradient is normalised: the attitude chatters by about ``beta dt``, and the
    correction slews at a rate that does not depend on the size of the error.

    The authors of the BROAD benchmark use Madgwick's own C code, which deviates from these
    equations in the magnetometer part; the page "accuracy and speed" says by how much.

    References
    ----------
    .. [1] S. O. H. Madgwick, "An efficient orientation filter for inertial and
           inertial/magnetic sensor arrays", report, University of Bristol, 2010.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = Madgwick(beta=0.1).run(demo.recording())
    """

    NAME: ClassVar[str] = "madgwick"
    beta: float = 0.0756
    zeta: float = 0.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        _checks.positive("beta", self.beta, allow_zero=True)
        _checks.positive("zeta", self.zeta, allow_zero=True)

    @classmethod
    def from_gyro_error(
        cls, gyr_error: float, gyr_bias_drift: float = 0.0, **parameters: Any
    ) -> "Madgwick":
        """Return the filter for a gyro of known error, (43).

        Parameters
        ----------
        gyr_error : float
            Zero-mean error of each axis [rad/s].
        gyr_bias_drift : float
            Drift rate of each axis' bias [rad/s^2].
        **parameters
            Other fields.

        Returns
        -------
        Madgwick
        """
        k = math.sqrt(0.75)
        error = _checks.positive("gyr_error", gyr_error, allow_zero=True)
        drift = _checks.positive("gyr_bias_drift", gyr_bias_drift, allow_zero=True)
        return cls(beta=k * error, zeta=k * drift, **parameters)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import madgwick

        return madgwick

    def _params(self) -> FloatArray:
        kernel = self._kernel()
        p = self._common(kernel.P_SIZE)
        p[kernel.P_BETA] = self.beta
        p[kernel.P_ZETA] = self.zeta
        return p
