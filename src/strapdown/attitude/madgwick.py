"""Madgwick's gradient-descent filter, for IMU and MARG, with both compensations."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.estimator import register
from strapdown.kernels import memory as _m


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
    (46)-(52) of the thesis, misprints corrected.

    Parameters
    ----------
    beta : float
        Size of the correction [rad/s] in quaternion rate: errors shrink at up to
        ``2 beta``. Larger trusts accelerometer and magnetometer, zero is pure integration.
        ``sqrt(3/4) w`` for a gyro error of w on each axis, see `from_gyro_error`.
    zeta : float
        Rate at which the gyro bias follows the correction [rad/s^2]. Zero switches bias
        estimation off. It winds up in a long initial transient.
    alpha : float
        Size of the step down the gradient in multiples of what the gyro turns, at least 1:
        the filter before its simplification, (37)-(42). Infinite gives the simplified one.
        Smaller holds the attitude back where the rate is small against ``2 beta / alpha``.
    dip : float, optional
        Dip of the field, positive down [rad], where its reference is to be preset. None
        rebuilds the reference from what is measured at every sample (49), so that
        disturbances reach the heading only.

    Notes
    -----
    The step down the gradient, ``mu = alpha |dq/dt| dt`` (38), has the weight ``lambda = beta
    / (mu / dt + beta)`` (42) against the integrated rate. Put into (39), all of the simplified
    step, rate and correction, is taken times ``mu / (mu + beta dt)``. At rest mu vanishes, and
    with it all corrections: only noise of the gyro lets such a filter converge.

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
    alpha: float = math.inf
    dip: float | None = None

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        _checks.positive("beta", self.beta, allow_zero=True)
        _checks.positive("zeta", self.zeta, allow_zero=True)
        _checks.in_range("alpha", self.alpha, 1.0, math.inf)
        if self.dip is not None:
            _checks.in_range("dip", self.dip, -0.5 * math.pi, 0.5 * math.pi)

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
        p[kernel.P_SLOW] = 2.0 * self.beta / self.alpha
        p[kernel.P_FIELD] = math.nan
        if self.dip is not None:
            north, east = p[_m.P_COS_D], p[_m.P_SIN_D]
            across = math.cos(self.dip)
            p[kernel.P_FIELD : kernel.P_FIELD + 3] = (
                across * north,
                across * east,
                math.sin(self.dip),
            )
        return p
