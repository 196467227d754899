"""Multi-mode AHRS of the thesis "micro UAV": field and GPS course, or field and gravity."""

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.attitude._uav_ahrs import AS_PRINTED, UavAhrs
from strapdown.estimator import Estimator, Taken, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording
from strapdown.units import GAUSS

FIELD_N: Final = (0.24762, 0.0082465, 0.3865)  # of the program, north, east, down [G]


@register(
    source="thesis uav, ch. 3, A.2; Bauer, Bokor 2010",
    cost="7 states, 7x7 covariance; corrections at 25 Hz",
    uses=("mag", "gnss"),
    rank=9,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class MultiModeAhrs(UavAhrs):
    """Multi-mode AHRS: EKF of quaternion and slow gyro bias, without gravity while GPS is there.

    State: q_nb and gyro bias, a random walk. The gyroscope predicts at its own rate, 50 Hz in the
    source; its noise enters through ``V aQ V^T``, which depends on the attitude. *Mode 1*, while
    GPS is valid: the field as a vector and the course, taken for yaw. *Mode 2*: the field as a
    vector and the specific force, taken for gravity. So turns do no harm while there are fixes.
    Course is yaw only without wind or sideslip, and where the x axis looks ahead.

    Parameters are those of `UavAhrs`, and

    Parameters
    ----------
    gyr_bias_noise : tuple of 3 floats
        Rate random walk of the biases [rad/s^2/sqrt(Hz)], of P, Q and R. Larger follows faster.
    mag_noise : float
        Density of the field's error [T/sqrt(Hz)]: 8.4 mG at 25 Hz.
    mag_rate : float
        Corrections by the field [Hz]; as `acc_rate`. A fix corrects when it comes.
    course_std : float
        Standard deviation of the course of a fix [rad].
    min_speed : float
        Below this speed a fix has no course, and counts as lost [m/s].
    fix_timeout : float
        GPS is lost so long after its last fix, or at a fix without velocity [s]. A field that was
        not used for so long brings the accelerometer back, too.
    mag_reference : tuple of 2 floats, optional
        Horizontal part and part down of the field [T], as of the world magnetic model; see `at`.
        None: learned from the first fields, with the dip that the attitude makes of them.
    learn_time : float
        How long it is learned [s]. Meanwhile gravity levels and the field turns, GPS or not.
    heading_jacobian : {'exact', 'printed'}
        Of yaw. Printed: with a factor too many; then a heading near +-90 deg is not corrected by
        the course, and from 90 to 128 deg it is driven away.

    Notes
    -----
    Online. The source counts a fix as valid by a flag: here, one with a velocity. Status
    ``OUTAGE`` is a GPS that was there and is lost; ``diagnostics["course"]`` holds its
    innovations. The course is true: give `declination`, or the field pulls to magnetic north.
    Misprints corrected: the sign of gravity (3.16), the halves of (3.25), the Jacobian of yaw,
    ``V V^T`` for ``V aQ V^T``.

    References
    ----------
    .. [1] P. Bauer, J. Bokor, "Development and hardware-in-the-loop testing of an extended Kalman
           filter for attitude estimation", CINTI, 2010.

    Examples
    --------
    >>> from strapdown.simulation import load
    >>> rec = load("flight").record().between(0.0, 60.0)
    >>> sol = MultiModeAhrs.at(rec.gnss.lla[0], 2026.2).run(rec)
    >>> sorted(sol.diagnostics)
    ['acc', 'course', 'mag']
    """

    NAME: ClassVar[str] = "multi-mode-ahrs"
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "acc": ("x", "y", "z"),
        "mag": ("x", "y", "z"),
        "course": ("heading",),
    }
    DIAGNOSED: ClassVar[Mapping[str, int]] = {**Estimator.DIAGNOSED, "course": _m.W_HEAD}
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise"),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("mag_noise", "mag_noise", floor=True),
        Taken("std_gyr_bias", "gyr_bias_std"),
    )
    gyr_bias_noise: tuple[float, float, float] = (
        0.005 * math.sqrt(1.0 / 50.0), 0.005 * math.sqrt(1.0 / 50.0), 1e-4 * math.sqrt(1.0 / 50.0),
    )  # fmt: skip
    mag_noise: float = math.sqrt(7e-5 / 25.0) * GAUSS
    mag_rate: float = 25.0
    course_std: float = math.sqrt(0.001)
    min_speed: float = 2.0
    fix_timeout: float = 1.5
    mag_reference: tuple[float, float] | None = None
    learn_time: float = 5.0
    heading_jacobian: Literal["exact", "printed"] = "exact"

    def __post_init__(self) -> None:
        """Check the parameters."""
        UavAhrs.__post_init__(self)
        if not (_checks.as_vector("gyr_bias_noise", self.gyr_bias_noise) >= 0.0).all():
            raise ValueError(f"`gyr_bias_noise` must be non-negative, got {self.gyr_bias_noise}.")
        for name in ("mag_noise", "course_std", "fix_timeout"):
            _checks.positive(name, getattr(self, name))
        for name in ("min_speed", "learn_time"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        self._positive_or_infinite("mag_rate")
        _checks.one_of("heading_jacobian", self.heading_jacobian, ("exact", "printed"))
        if self.mag_reference is not None:
            horizontal, _ = _checks.as_vector("mag_reference", self.mag_reference, 2)
            _checks.positive("mag_reference", horizontal)

    @classmethod
    def as_printed(cls, **parameters: Any) -> Self:
        """Return the filter of the program of appendix A.2, with its field over Benevento.

        The program starts level and facing north, ``init(attitude=(1, 0, 0, 0))``; its first step
        is the second sample here, the first begins the interval.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        MultiModeAhrs
        """
        north, east, down = np.array(FIELD_N) * GAUSS
        field = {
            "declination": math.atan2(east, north),
            "mag_reference": (math.hypot(north, east), float(down)),
        }
        return cls(**{**AS_PRINTED, **field, "min_speed": 0.0, **parameters})

    @classmethod
    def at(cls, lla: ArrayLike, date: dt.date | float, **parameters: Any) -> Self:
        """Return the filter with the field of the world magnetic model of a place and a date.

        Parameters
        ----------
        lla : array_like, shape (3,)
            Latitude, longitude, height [rad, rad, m].
        date : date or float
            Date or decimal year.
        **parameters
            Other fields.

        Returns
        -------
        MultiModeAhrs
        """
        from strapdown.attitude.heading import reference_field

        return cls(**{**reference_field(lla, date), **parameters})

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import multi_mode_ahrs

        return multi_mode_ahrs

    def _params(self) -> FloatArray:
        from strapdown.kernels import multi_mode_ahrs as kernel
        from strapdown.kernels import uav_ahrs as k

        p = self._shared(self._kernel().P_SIZE, k.DIAGONAL)
        p[k.P_BIAS_NOISE : k.P_BIAS_NOISE + 3] = self.gyr_bias_noise
        p[k.P_MAG_NOISE] = self.mag_noise
        p[k.P_MAG_PERIOD] = 1.0 / self.mag_rate
        p[k.P_JACOBIAN] = k.AS_PRINTED if self.heading_jacobian == "printed" else k.OF_ANGLE
        p[kernel.P_STD_COURSE] = self.course_std
        p[kernel.P_TIMEOUT] = self.fix_timeout
        p[kernel.P_MIN_SPEED] = self.min_speed
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        from strapdown.kernels import multi_mode_ahrs as k

        x, P = UavAhrs._memory(self)
        x[k.T_MAG] = x[k.T_COURSE] = -math.inf
        if self.mag_reference is not None:
            x[k.REF_H], x[k.REF_D] = self.mag_reference
        else:
            x[k.LEARN] = self.learn_time
        return x, P

    def _events(self, rec: Recording) -> FloatArray:
        fixes = rec.gnss
        if fixes is None:
            return np.empty((0, 17))
        e = np.full((len(fixes), 17), np.nan)
        e[:, 0] = e[:, 3] = fixes.t
        e[:, 1:3] = _m.GNSS, 14
        e[:, 4:7] = fixes.lla
        if fixes.v_n is not None:
            e[:, 7:10] = fixes.v_n
        return e

    def _heading_reference(self, rec: Recording) -> str:
        if rec.gnss is not None and (rec.mag is None or not self.use_mag):
            return "true"
        return AttitudeEstimator._heading_reference(self, rec)
