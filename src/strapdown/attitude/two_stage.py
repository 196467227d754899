"""Two-stage quaternion Kalman filter: the accelerometer levels, then the field turns."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import Taken, register
from strapdown.kernels import memory as _m

Linearisation = Literal["sequential", "printed"]
Formula = Literal["corrected", "printed"]


@register(
    source="thesis indoor, 4.2; Sabatelli",
    cost="4 states, 4x4 covariance, two 4x3 gains",
    uses=("mag",),
    rank=12,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class TwoStage(AttitudeEstimator):
    """Two-stage Kalman filter of the quaternion: first roll and pitch, then yaw.

    State: the quaternion, with a 4x4 covariance of its components. The gyroscope predicts;
    stage 1 corrects roll and pitch by the direction of the specific force, stage 2 yaw by that of
    the field. ``use_mag=False`` is the source's 6DOF, stage 2 switched off. The source thinks in
    east-north-up; q_nb is turned there and back at each sample.

    The correction of each stage is added to the quaternion, which is normalised. The covariance
    is propagated in Joseph form. It holds for a gain that nothing is taken out of, so it is a
    tuning and no standard deviation is stated. There is no bias: subtract it beforehand.

    Parameters
    ----------
    process_noise : float
        Random walk of each component of the quaternion [1/sqrt(s)]. Larger trusts the gyroscope
        less. The default is the source's variance of 1e-6 per 10 ms.
    acc_noise, mag_noise : float
        Densities of the errors of the two unit vectors [1/sqrt(Hz)]. Larger trusts the sensor
        less. The defaults are the source's variances of 2 and 1 at 100 Hz.
    variance : float
        Of each component of the quaternion at the start.
    linearisation : {'sequential', 'printed'}
        Where stage 2 takes its gain, model and residual: at what stage 1 has found, as in the
        source's program; or where stage 1 began, as in its text.
    field_model : {'corrected', 'printed'}
        Corrected: ``+q3^2`` in the second row of h2, ``+2 q3`` and ``+2 q4`` in H2, and, as the
        model knows no dip, the field is levelled first. Printed: minus signs, field as measured.
    restriction : {'corrected', 'printed'}
        How the stages are kept apart. Corrected: the correction's part that turns about the
        vertical is taken out of stage 1, and is all that is left of stage 2, at any attitude.
        Printed: component 4, and components 2 and 3, are set to zero, which is the same only
        where body and east-north-up agree; a box with z down gets no heading.
    integration : {'corrected', 'printed'}
        Corrected: the turn of a constant rate is exact. Printed: to first order.

    Notes
    -----
    Online. Steady state at the defaults: errors of tilt decay in about 7 s, and a gyro bias shows
    as that many seconds of drift. The source never normalises; without, the norm drifts.

    References
    ----------
    .. [1] S. Sabatelli, thesis, University of Pisa: the filter that the source implements.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = TwoStage(acc_noise=0.2).run(demo.recording())
    """

    NAME: ClassVar[str] = "two-stage"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb",)
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("process_noise", "gyr_noise", 0.5, floor=True),
        Taken("acc_noise", "acc_noise", 1.0 / G0, floor=True),
    )
    process_noise: float = 0.01
    acc_noise: float = math.sqrt(2.0 * 0.01)
    mag_noise: float = math.sqrt(1.0 * 0.01)
    variance: float = 0.5
    linearisation: Linearisation = "sequential"
    field_model: Formula = "corrected"
    restriction: Formula = "corrected"
    integration: Formula = "corrected"

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in ("acc_noise", "mag_noise", "variance"):
            _checks.positive(name, getattr(self, name))
        _checks.positive("process_noise", self.process_noise, allow_zero=True)
        _checks.one_of("linearisation", self.linearisation, ("sequential", "printed"))
        for name in ("field_model", "restriction", "integration"):
            _checks.one_of(name, getattr(self, name), ("corrected", "printed"))

    @classmethod
    def as_printed(cls, **parameters: Any) -> "TwoStage":
        """Return the filter with all formulas as the source prints them, but normalised.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        TwoStage
        """
        return cls(
            linearisation="printed",
            field_model="printed",
            restriction="printed",
            integration="printed",
            **parameters,
        )

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import two_stage

        return two_stage

    def _params(self) -> FloatArray:
        k = self._kernel()
        p = self._common(k.P_SIZE)
        p[k.P_PROCESS] = self.process_noise
        p[k.P_ACC_NOISE] = self.acc_noise
        p[k.P_MAG_NOISE] = self.mag_noise
        p[k.P_VARIANCE] = self.variance
        # East-north-up of magnetic north: half a turn about north-east, after declination.
        half = 0.5 * (self.declination or 0.0)
        c, s = math.cos(half), math.sin(half)
        p[k.P_Q_UN : k.P_Q_UN + 4] = np.array([0.0, c - s, c + s, 0.0]) / math.sqrt(2.0)
        p[k.P_A_PRIORI] = float(self.linearisation == "printed")
        p[k.P_YY] = -1.0 if self.field_model == "printed" else 1.0
        p[k.P_COMPONENTS] = float(self.restriction == "printed")
        p[k.P_EULER] = float(self.integration == "printed")
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        head, _ = AttitudeEstimator._memory(self)
        x = np.zeros(self._kernel().X_SIZE)
        x[: _m.HEAD] = head
        return x, self.variance * np.eye(4)
