"""Grades of inertial systems and gyroscopes, as the tables of thesis E1 have them.

They serve to name what one has; nothing is computed from a grade (parts come from their data
sheets, `strapdown.sensors`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown.constants import G0
from strapdown.units import DEG_PER_HR, DEG_PER_SQRT_HR, HOUR, NAUTICAL_MILE

NMI_PER_HR: Final = NAUTICAL_MILE / HOUR


@dataclass(frozen=True, slots=True, kw_only=True)
class InsGrade:
    """A row of table 1.1: performance of inertial systems for accelerations of about 1 g.

    Attributes
    ----------
    cep_rate : float
        Growth of the radius that holds half of all position errors [m/s].
    gyr_bias : float
        Gyro error [rad/s].
    acc_bias : float
        Accelerometer error [m/s^2].
    """

    cep_rate: float
    gyr_bias: float
    acc_bias: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroGrade:
    """A column of table 1.2: from, to.

    Attributes
    ----------
    max_input : tuple of float
        Greatest rate that can be measured [rad/s].
    scale_error : tuple of float
        Parts of one.
    bias_stability : tuple of float
        Systematic part that appears at switch-on [rad/s].
    bias_drift : tuple of float
        Random part [(rad/s)/sqrt(Hz)].
    """

    max_input: tuple[float, float]
    scale_error: tuple[float, float]
    bias_stability: tuple[float, float]
    bias_drift: tuple[float, float]


# Thesis E1, table 1.1, after the U.S. Air Force. "High" is at most, "low" at least; the table
# prints "at most" for the accelerometers of low performance, a misprint.
INS_GRADES: Final[Mapping[str, InsGrade]] = {
    "high": InsGrade(cep_rate=0.1 * NMI_PER_HR, gyr_bias=1e-3 * DEG_PER_HR, acc_bias=1e-7 * G0),
    "medium": InsGrade(cep_rate=1.0 * NMI_PER_HR, gyr_bias=1e-2 * DEG_PER_HR, acc_bias=1e-6 * G0),
    "low": InsGrade(cep_rate=10.0 * NMI_PER_HR, gyr_bias=1e-1 * DEG_PER_HR, acc_bias=1e-5 * G0),
}


def _gyro(
    scale: tuple[float, float], bias_deg_per_hr: tuple[float, float],
    drift_deg_per_sqrt_hr: tuple[float, float],
) -> GyroGrade:  # fmt: skip
    def times(unit: float, pair: tuple[float, float]) -> tuple[float, float]:
        return unit * pair[0], unit * pair[1]

    return GyroGrade(
        max_input=times(DEG_PER_HR, (1e2, 1e6)),
        scale_error=scale,
        bias_stability=times(DEG_PER_HR, bias_deg_per_hr),
        bias_drift=times(DEG_PER_SQRT_HR, drift_deg_per_sqrt_hr),
    )


# Thesis E1, table 1.2; units are printed as "deg/vh".
GYRO_GRADES: Final[Mapping[str, GyroGrade]] = {
    "inertial": _gyro((1e-6, 1e-4), (1e-4, 1e-2), (1e-4, 1e-3)),
    "intermediate": _gyro((1e-4, 1e-3), (1e-2, 10.0), (1e-2, 1e-1)),
    "moderate": _gyro((1e-3, 1e-2), (10.0, 100.0), (1.0, 10.0)),
}


def ins_grade(cep_rate: float) -> str:
    """Return the grade of an inertial system by the growth of its position error.

    Parameters
    ----------
    cep_rate : float
        Growth of the circle of equal probability [m/s]; see `cep_rate`.

    Returns
    -------
    str
        ``"high"`` up to 0.1 nautical miles per hour, ``"low"`` from 10 on, else ``"medium"``.

    Examples
    --------
    >>> ins_grade(0.8 * NMI_PER_HR)
    'medium'
    """
    rate = _checks.positive("cep_rate", cep_rate, allow_zero=True)
    if rate <= INS_GRADES["high"].cep_rate:
        return "high"
    return "low" if rate >= INS_GRADES["low"].cep_rate else "medium"


def gyro_grade(bias_stability: float) -> str | None:
    """Return the grade of a gyroscope by its bias stability; None beyond the table.

    Parameters
    ----------
    bias_stability : float
        [rad/s].

    Returns
    -------
    str or None
        ``"inertial"`` up to 0.01 deg/h, ``"intermediate"`` up to 10, ``"moderate"`` up to 100.

    Examples
    --------
    >>> gyro_grade(25 * DEG_PER_HR)
    'moderate'
    """
    bias = _checks.positive("bias_stability", bias_stability, allow_zero=True)
    for name, grade in GYRO_GRADES.items():
        if bias <= grade.bias_stability[1]:
            return name
    return None


def cep_rate(t: ArrayLike, errors_n: ArrayLike) -> float:
    """Return the growth of the circle of equal probability over repeated runs.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time since the start [s].
    errors_n : array_like, shape (runs, n, 2)
        Errors north and east of each run [m].

    Returns
    -------
    float
        Slope of the line through zero that fits the median radius best [m/s].

    Examples
    --------
    >>> cep_rate([1.0, 2.0], [[[3.0, 4.0], [6.0, 8.0]]])
    5.0
    """
    time = _checks.as_series("t", t)
    errors = _checks.as_vectors("errors_n", errors_n, 2)
    if errors.ndim != 3 or errors.shape[1] != len(time) or not errors.shape[0]:
        raise ValueError(f"`errors_n` must have shape (runs, {len(time)}, 2), got {errors.shape}.")
    if not time.any():
        raise ValueError("`t` must hold a time other than zero.")
    radius = np.median(np.linalg.norm(errors, axis=2), axis=0)
    return float(radius @ time / (time @ time))
