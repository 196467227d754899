"""Calibration records: what a calibration found, how sure it is, and how to apply it.

All calibrations of a triad end in the same correction::

    corrected = matrix @ (raw - bias)

with the bias in the unit of the sensor and a matrix without unit. How matrix and bias follow
from the physical parameters (scale factors, misalignments, soft iron) is the method's matter;
the record keeps these parameters with their covariance, the residuals, the degrees of freedom
and the verdict against tolerances. `strapdown.calibration.file` writes records to TOML.
"""

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, unique
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_floats, as_matrices, as_series, as_vector, finite, one_of, whole
from strapdown._types import FloatArray
from strapdown.errors import InputError

# Each sensor with the name of its SI unit in `strapdown.units` and what to call it.
SENSOR_UNITS: Final[Mapping[str, str]] = {"gyr": "rad_s", "acc": "m_s2", "mag": "t"}
SENSOR_NAMES: Final[Mapping[str, str]] = {
    "gyr": "gyroscope",
    "acc": "accelerometer",
    "mag": "magnetometer",
}


@unique
class Verdict(Enum):
    """How a parameter stands to its tolerance."""

    WITHIN = "within"
    OUTSIDE = "outside"
    NOT_DETERMINED = "not determined"  # its standard deviation exceeds the tolerance
    NO_TOLERANCE = "no tolerance"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One physical parameter with its uncertainty and its tolerance.

    Parameters
    ----------
    name : str
        Symbol in the method's equations, such as ``"theta_yz"``.
    value : float
        Estimate, in `unit`.
    std : float
        Its standard deviation; NaN where the data cannot tell.
    unit : str
        Name of the unit: ``"1"``, ``"rad"``, or the sensor's.
    tolerance : float, optional
        How far the value may be from `nominal`.
    nominal : float
        Value of a perfect sensor.
    """

    name: str
    value: float
    std: float
    unit: str = "1"
    tolerance: float | None = None
    nominal: float = 0.0

    @property
    def verdict(self) -> Verdict:
        """Whether the value lies within its tolerance, if the data can tell."""
        if self.tolerance is None:
            return Verdict.NO_TOLERANCE
        if not self.std <= self.tolerance:
            return Verdict.NOT_DETERMINED
        inside = abs(self.value - self.nominal) <= self.tolerance
        return Verdict.WITHIN if inside else Verdict.OUTSIDE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """What every calibration reports, whatever its method.

    Attributes
    ----------
    sensor : str
        ``"gyr"``, ``"acc"`` or ``"mag"``.
    method : str
        Name of the method.
    sensor_id : str
        Which piece of hardware; empty if not known.
    date : datetime.date
        Day of the calibration.
    parameters : tuple of Parameter
        Physical parameters, in the order of `covariance`.
    covariance : ndarray, shape (p, p)
        Their covariance, in the products of their units.
    residual_rms, residual_rms_before : float
        RMS of the residuals after and before the calibration, in the sensor's unit.
    equations, dof : int
        Equations, and equations less unknowns.
    residuals, residuals_before : ndarray
        Residual of each equation in the sensor's unit, one row per pose or sample, after and
        before the calibration. Empty when loaded from a file that left them out for their number.
    history : ndarray, shape (k, p)
        Parameters at the start and after each iteration; one row for a direct solution.
    directions : ndarray, shape (m, 3)
        Unit vectors of the input that the sensor was shown, its axes. May be empty.
    quality : mapping of str to float
        Figures of the method, such as ``coverage`` or ``iterations``.
    """

    sensor: str
    method: str
    sensor_id: str = ""
    date: dt.date = field(default_factory=dt.date.today)
    parameters: tuple[Parameter, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    residual_rms: float = math.nan
    residual_rms_before: float = math.nan
    equations: int = 0
    dof: int = 0
    residuals: FloatArray = field(default_factory=lambda: np.empty(0))
    residuals_before: FloatArray = field(default_factory=lambda: np.empty(0))
    history: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    directions: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    quality: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check names, shapes and symmetry."""
        one_of("sensor", self.sensor, SENSOR_UNITS)
        p = len(self.parameters)
        covariance = as_floats("covariance", self.covariance)
        if covariance.shape != (p, p):
            raise ValueError(f"`covariance` must have shape ({p}, {p}), got {covariance.shape}.")
        if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=0.0, equal_nan=True):
            raise ValueError("`covariance` must be symmetric.")
        object.__setattr__(self, "covariance", covariance)
        for name in ("residuals", "residuals_before", "history", "directions"):
            object.__setattr__(self, name, as_floats(name, getattr(self, name)))
        whole("equations", self.equations, 0)
        whole("dof", self.dof, 0)

    @property
    def unit(self) -> str:
        """Name of the sensor's unit."""
        return SENSOR_UNITS[self.sensor]

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all parameters that have a tolerance."""
        found = {parameter.verdict for parameter in self.parameters}
        for verdict in (Verdict.OUTSIDE, Verdict.NOT_DETERMINED, Verdict.WITHIN):
            if verdict in found:
                return verdict
        return Verdict.NO_TOLERANCE

    def __getitem__(self, name: str) -> Parameter:
        """Return the parameter of this name."""
        by_name = {parameter.name: parameter for parameter in self.parameters}
        return by_name[one_of("parameter", name, by_name)]

    def with_tolerances(self, tolerances: Mapping[str, float]) -> Self:
        """Return the record with these tolerances, by parameter or by kind.

        Parameters
        ----------
        tolerances : mapping of str to float
            By the name of a parameter (``"s_x"``) or by its kind: what its name begins with
            (``"s"``, ``"theta"``, ``"b"``). A name goes before its kind.

        Returns
        -------
        Fit
            Same values, new verdicts.
        """
        kinds = {p.name.split("_")[0] for p in self.parameters}
        names = {p.name for p in self.parameters} | kinds
        for key, value in tolerances.items():
            one_of("tolerances", key, sorted(names))
            finite(f"tolerances[{key!r}]", value)
        parameters = tuple(
            replace(p, tolerance=tolerances.get(p.name, tolerances.get(p.name.split("_")[0])))
            for p in self.parameters
        )
        return replace(self, parameters=parameters)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationRecord(Fit):
    """A calibrated triad: ``corrected = matrix @ (raw - bias)``.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Scale factors and misalignments, undone.
    bias : ndarray, shape (3,)
        Output at no input, in the sensor's unit and along its axes. Hard iron of a
        magnetometer.
    temp_degc : float, optional
        Temperature of the sensor during the calibration [degC].
    reference : float, optional
        Magnitude of the input that was taken as known: gravity [m/s^2] or field strength [T].
    """

    matrix: FloatArray
    bias: FloatArray
    temp_degc: float | None = None
    reference: float | None = None

    def __post_init__(self) -> None:
        """Check shapes; the matrix must be invertible."""
        # Without arguments, super() refers to the class before slots were added.
        super(CalibrationRecord, self).__post_init__()
        matrix = as_matrices("matrix", self.matrix)
        if matrix.ndim != 2:
            raise ValueError(f"`matrix` must have shape (3, 3), got {matrix.shape}.")
        if not abs(np.linalg.det(matrix)) > 1e-6:
            raise ValueError(
                f"`matrix` must be invertible, got determinant {np.linalg.det(matrix):g}."
            )
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "bias", as_vector("bias", self.bias))

    def correct(self, samples: ArrayLike, bias: ArrayLike | None = None) -> FloatArray:
        """Return corrected samples.

        Parameters
        ----------
        samples : array_like, shape (..., 3)
            Raw samples in the sensor's SI unit; NaN stays NaN.
        bias : array_like, shape (3,) or like `samples`, optional
            Bias to take in place of the record's, such as one that follows the temperature.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        raw = as_floats("samples", samples)
        if raw.shape[-1:] != (3,):
            raise ValueError(f"`samples` must have shape (..., 3), got {raw.shape}.")
        offset = self.bias if bias is None else as_floats("bias", bias)
        x, y, z = np.moveaxis(np.asarray(raw - offset), -1, 0)
        # Not a matrix product, whose rounding depends on how many samples there are.
        return np.stack([m[0] * x + m[1] * y + m[2] * z for m in self.matrix], axis=-1)

    def distort(self, samples: ArrayLike) -> FloatArray:
        """Return the raw samples that `correct` would take to these; its inverse."""
        true = as_floats("samples", samples)
        return np.asarray(true @ np.linalg.inv(self.matrix).T + self.bias)

    def rotated(self, C_bs: ArrayLike) -> "CalibrationRecord":
        """Return the record whose corrected samples are turned from s to b axes."""
        return replace(self, matrix=as_matrices("C_bs", C_bs) @ self.matrix)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TemperatureRecord(Fit):
    """Linear change of a triad's bias with temperature: ``bias = p1 * T + p2``.

    Attributes
    ----------
    slope : ndarray, shape (3,)
        p1, change of the bias per degC, in the sensor's unit.
    temp_mean_degc, temp_min_degc, temp_max_degc : float
        Temperatures of the test [degC].
    """

    slope: FloatArray
    temp_mean_degc: float
    temp_min_degc: float
    temp_max_degc: float

    def __post_init__(self) -> None:
        """Check shapes and the order of the temperatures."""
        super(TemperatureRecord, self).__post_init__()
        object.__setattr__(self, "slope", as_vector("slope", self.slope))
        for name in ("temp_mean_degc", "temp_min_degc", "temp_max_degc"):
            finite(name, getattr(self, name))
        if not self.temp_min_degc <= self.temp_mean_degc <= self.temp_max_degc:
            raise ValueError(
                "`temp_mean_degc` must lie between `temp_min_degc` and `temp_max_degc`, got "
                f"{self.temp_mean_degc:g} and {self.temp_min_degc:g} to {self.temp_max_degc:g}."
            )

    def bias_change(self, temp_degc: ArrayLike, from_degc: float | None = None) -> FloatArray:
        """Return by how much the bias differs from that at `from_degc`.

        Parameters
        ----------
        temp_degc : array_like, shape (n,)
            Temperature of the sensor [degC].
        from_degc : float, optional
            Temperature at which the bias was calibrated; default is the mean of the test.

        Returns
        -------
        ndarray, shape (n, 3)
            In the sensor's unit.
        """
        origin = self.temp_mean_degc if from_degc is None else finite("from_degc", from_degc)
        return np.outer(as_series("temp_degc", temp_degc, allow_nan=True) - origin, self.slope)


def parameters_of(
    names: tuple[str, ...],
    values: FloatArray,
    covariance: FloatArray,
    units: tuple[str, ...],
    tolerances: Mapping[str, float] | None = None,
    nominal: float = 0.0,
) -> tuple[Parameter, ...]:
    """Return the parameters of a solution; tolerances by name or kind, as `with_tolerances`."""
    limits = tolerances or {}
    return tuple(
        Parameter(
            name=name,
            value=float(values[k]),
            std=float(np.sqrt(covariance[k, k])),
            unit=units[k],
            tolerance=limits.get(name, limits.get(name.split("_")[0])),
            nominal=nominal if units[k] == "1" else 0.0,
        )
        for k, name in enumerate(names)
    )


def rms(values: ArrayLike) -> float:
    """Return the root mean square of all elements."""
    return float(np.sqrt(np.mean(np.square(values))))


def require_poses(count: int, unknowns: int, what: str, advice: str) -> None:
    """Refuse fewer poses than unknowns."""
    if count < unknowns:
        raise InputError(
            f"{what} has {unknowns} unknowns, got {count} "
            f"pose{'' if count == 1 else 's'}; {advice}."
        )
