"""The noise of a device: what `characterize` finds, and what a filter needs of it."""

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from strapdown._checks import as_matrices, instance, one_of, positive
from strapdown._types import FloatArray
from strapdown.errors import InputError, MissingStream
from strapdown.noise.coefficients import Coefficient, Coefficients, Status
from strapdown.sensors import NoiseParameters

AXES: Final = ("x", "y", "z")
# Name of the SI unit of each sensor in `strapdown.units`, and its symbol.
SENSOR_UNITS: Final[Mapping[str, str]] = {"gyr": "rad_s", "acc": "m_s2", "mag": "t"}
UNIT_SYMBOLS: Final[Mapping[str, str]] = {"gyr": "rad/s", "acc": "m/s^2", "mag": "T"}
SENSOR_NAMES: Final[Mapping[str, str]] = {
    "gyr": "gyroscope",
    "acc": "accelerometer",
    "mag": "magnetometer",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisNoise:
    """Noise and level of one axis at rest, SI units.

    Attributes
    ----------
    mean, mean_std, std : float
        Mean, its standard deviation with slow noise in it, deviation of the samples.
    coefficients : Coefficients
        The noise terms.
    """

    mean: float
    mean_std: float
    std: float
    coefficients: Coefficients


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorNoise:
    """Noise of one sensor.

    Attributes
    ----------
    sensor : str
        ``"gyr"``, ``"acc"`` or ``"mag"``.
    fs, duration, start : float
        Sampling rate [Hz], length and beginning of the stretch used [s].
    axes : tuple of AxisNoise
        x, y, z.
    covariance : ndarray, shape (3, 3)
        Of the samples of the three axes.
    remarks : tuple of str
        What was left out, and the like.
    """

    sensor: str
    fs: float
    duration: float
    start: float
    axes: tuple[AxisNoise, AxisNoise, AxisNoise]
    covariance: FloatArray
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check names and shapes."""
        one_of("sensor", self.sensor, SENSOR_UNITS)
        positive("fs", self.fs)
        positive("duration", self.duration)
        covariance = as_matrices("covariance", self.covariance)
        if covariance.ndim != 2:
            raise ValueError(f"`covariance` must have shape (3, 3), got {covariance.shape}.")
        object.__setattr__(self, "covariance", covariance)

    @property
    def unit(self) -> str:
        """Symbol of the sensor's SI unit."""
        return UNIT_SYMBOLS[self.sensor]

    @property
    def mean(self) -> FloatArray:
        """Means of the axes."""
        return np.array([axis.mean for axis in self.axes])


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterNoise:
    """Noise parameters as the filters of this package take them.

    Attributes
    ----------
    gyr_noise, acc_noise, mag_noise : float
        Density of white noise, N [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)], [T/sqrt(Hz)]; NaN
        without that sensor.
    gyr_bias_noise, acc_bias_noise, mag_bias_noise : float
        Density of the random walk of the bias, K, per second.
    gyr_std, acc_std, mag_std : float
        Deviation of the samples at their rate, for filters that want R directly.
    notes : tuple of str
        Where a number is a limit, or doubtful.
    """

    gyr_noise: float = math.nan
    gyr_bias_noise: float = math.nan
    gyr_std: float = math.nan
    acc_noise: float = math.nan
    acc_bias_noise: float = math.nan
    acc_std: float = math.nan
    mag_noise: float = math.nan
    mag_bias_noise: float = math.nan
    mag_std: float = math.nan
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseRecord:
    """Noise of all sensors of a device.

    Attributes
    ----------
    sensors : mapping of str to SensorNoise
        By ``"gyr"``, ``"acc"``, ``"mag"``.
    sensor_id : str
        Which piece of hardware; empty if not known.
    source : str
        The log.
    date : datetime.date
        Day of the characterisation.
    temp_degc : float, optional
        Mean temperature of the sensor [degC].
    """

    sensors: Mapping[str, SensorNoise]
    sensor_id: str = ""
    source: str = ""
    date: dt.date = field(default_factory=dt.date.today)
    temp_degc: float | None = None

    def __post_init__(self) -> None:
        """Check that each entry is of its sensor."""
        instance("sensors", self.sensors, Mapping)
        for name, noise in self.sensors.items():
            one_of("sensors", name, SENSOR_UNITS)
            instance(f"sensors[{name!r}]", noise, SensorNoise)
            if noise.sensor != name:
                raise ValueError(f"`sensors[{name!r}]` must be of {name}, got {noise.sensor}.")

    def __getitem__(self, sensor: str) -> SensorNoise:
        """Return the noise of a sensor, or say which there are."""
        if sensor not in self.sensors:
            raise MissingStream(
                f"the noise record must hold {sensor!r}, it has {', '.join(self.sensors) or '-'}."
            )
        return self.sensors[sensor]

    def filter_noise(self, axis: str = "worst") -> FilterNoise:
        """Return the noise parameters of a filter.

        Parameters
        ----------
        axis : {'worst', 'mean', 'x', 'y', 'z'}
            The largest value of the three axes, their root mean square, or one axis.

        Returns
        -------
        FilterNoise
            Where a random walk of the bias is not observable, its number is the limit that the
            record sets, which is on the safe side; a note says so.

        Raises
        ------
        InputError
            If a white noise is not observable, so that there is no number at all.
        """
        one_of("axis", axis, ("worst", "mean", *AXES))
        values: dict[str, float] = {}
        notes: list[str] = []
        for name, noise in self.sensors.items():
            chosen = [
                (letter, noise.axes[k])
                for k, letter in enumerate(AXES)
                if axis in ("worst", "mean", letter)
            ]
            white = [_white(name, letter, a.coefficients.N, notes) for letter, a in chosen]
            walk = [_walk(name, letter, a.coefficients.K, notes) for letter, a in chosen]
            values[f"{name}_noise"] = _combined(white, axis)
            values[f"{name}_bias_noise"] = _combined(walk, axis)
            values[f"{name}_std"] = _combined([a.std for _, a in chosen], axis)
        return FilterNoise(**values, notes=tuple(notes))

    def noise_parameters(self) -> NoiseParameters:
        """Return what was observed, the largest of the axes, as ``from_sensor`` takes it.

        Returns
        -------
        NoiseParameters
            NaN for what is not observable on an axis, so that an estimator keeps its default;
            the limits that the record sets are in `filter_noise`.
        """
        names = {"N": "noise", "K": "bias_walk", "B": "bias_instability"}
        values: dict[str, float] = {}
        for sensor, noise in self.sensors.items():
            for symbol, name in names.items():
                found = [axis.coefficients[symbol] for axis in noise.axes]
                if all(c.status is not Status.NOT_OBSERVABLE for c in found):
                    values[f"{sensor}_{name}"] = max(c.value for c in found)
        return NoiseParameters(**values)


def _white(sensor: str, letter: str, c: Coefficient, notes: list[str]) -> float:
    if c.status is Status.NOT_OBSERVABLE:
        raise InputError(
            f"{sensor} {letter} must show white noise for a filter to use, but {c.remark}; "
            "record longer, or sample faster."
        )
    if c.status is Status.DOUBTFUL:
        notes.append(f"{sensor} {letter}: N is doubtful, {c.remark}")
    return c.value


def _walk(sensor: str, letter: str, c: Coefficient, notes: list[str]) -> float:
    if c.status is Status.NOT_OBSERVABLE:
        notes.append(f"{sensor} {letter}: bias random walk is the record's limit, {c.remark}")
        return c.high
    if c.status is Status.DOUBTFUL:
        notes.append(f"{sensor} {letter}: K is doubtful, {c.remark}")
    return c.value


def _combined(values: list[float], axis: str) -> float:
    if axis == "mean":
        return float(np.sqrt(np.mean(np.square(values))))
    return max(values)
