"""Barometer, Pitot tube, encoder and thermometer: sensors of one number."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray, IntArray
from strapdown.constants import G0, STANDARD_ATMOSPHERE
from strapdown.recording import Airspeed, Baro, Encoder, Temperature
from strapdown.rotation import rpy_from_quat
from strapdown.sensors.digital import Digital
from strapdown.sensors.noise import Noise
from strapdown.sensors.sampling import Sampling
from strapdown.sensors.settings import Quantity
from strapdown.truth import Truth

# ISO 2533, the standard atmosphere up to 11 km.
SEA_LEVEL_K = 288.15
LAPSE_K_M = 0.0065
GAS_J_KG_K = 287.05287
_EXPONENT = G0 / (GAS_J_KG_K * LAPSE_K_M)

_ANGLES = ("roll", "pitch", "yaw")


def pressure_from_height(height: ArrayLike, sea_level: float = STANDARD_ATMOSPHERE) -> FloatArray:
    """Return the static pressure of the standard atmosphere [Pa] at a height up to 11 km [m]."""
    h = _checks.as_floats("height", height)
    if (h > 11_000.0).any() or (h < -2_000.0).any():
        raise ValueError("`height` must lie in [-2000, 11000] m, where the formula holds.")
    return np.asarray(sea_level * (1.0 - LAPSE_K_M * h / SEA_LEVEL_K) ** _EXPONENT)


def height_from_pressure(
    pressure: ArrayLike, sea_level: float = STANDARD_ATMOSPHERE
) -> FloatArray:
    """Return the height in the standard atmosphere [m]; undoes `pressure_from_height`."""
    p = _checks.as_floats("pressure", pressure)
    return np.asarray(SEA_LEVEL_K / LAPSE_K_M * (1.0 - (p / sea_level) ** (1.0 / _EXPONENT)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scalar:
    """What sensors of one number have in common: ``y = scale x + bias + noise``.

    Parameters
    ----------
    bias : float
        Constant offset [SI].
    scale : float
        Output per input.
    noise : Noise
        Random errors.
    sampling : Sampling
        Rate, low-pass, delay, jitter, dropouts.
    digital : Digital
        Range and counts.
    """

    bias: Annotated[float, Quantity("@value")] = 0.0
    scale: float = 1.0
    noise: Noise = field(default_factory=Noise)
    sampling: Sampling = field(default_factory=Sampling)
    digital: Digital = field(default_factory=Digital)

    def __post_init__(self) -> None:
        """Check bias and scale."""
        _checks.finite("bias", self.bias)
        _checks.positive("scale", self.scale)

    def undo(self, y: ArrayLike) -> FloatArray:
        """Return the input behind outputs [SI]: bias and scale undone."""
        return np.asarray((_checks.as_floats("y", y) - self.bias) / self.scale)

    def _output(
        self, t: FloatArray, x: FloatArray, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        tick_rng, noise_rng, early_rng = rng.spawn(3)
        ticks = self.sampling.ticks(t, tick_rng)
        signal, noise = (self.scale * x + self.bias)[:, np.newaxis], self.noise
        if self.sampling.filters_noise and len(t) > 1:
            step = float(np.median(np.diff(t)))
            signal = signal + Noise(white=noise.white).sample(len(t), step, early_rng, 1)
            noise = noise.without_white()
        seen = self.sampling.sample(t, signal, ticks)
        seen = seen + noise.sample(len(seen), self.sampling.step(t), noise_rng, 1)
        return ticks.stamp[ticks.kept], self.digital.apply(seen[:, 0])[ticks.kept]


@dataclass(frozen=True, slots=True, kw_only=True)
class Barometer(Scalar):
    """Static pressure in the standard atmosphere.

    Parameters
    ----------
    sea_level : float
        Pressure at height zero [Pa]. Height above the ellipsoid is taken for that above the
        sea.
    """

    sea_level: Annotated[float, Quantity("pressure")] = STANDARD_ATMOSPHERE

    def apply(self, truth: Truth, rng: np.random.Generator) -> Baro:
        """Return the pressure along a motion [Pa]."""
        true = pressure_from_height(truth.lla[:, 2], self.sea_level)
        t, pressure = self._output(truth.t, true, rng)
        return Baro(t=t, pressure=pressure)

    def height(self, pressure: ArrayLike) -> FloatArray:
        """Return the height behind pressures [m]: errors and atmosphere undone."""
        return height_from_pressure(self.undo(pressure), self.sea_level)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pitot(Scalar):
    """Airspeed of a Pitot tube.

    Parameters
    ----------
    wind_n : tuple of float
        Velocity of the air over ground, north, east, down [m/s].
    lowest : float
        Below this airspeed the tube says zero [m/s].
    """

    wind_n: Annotated[tuple[float, float, float], Quantity("speed")] = (0.0, 0.0, 0.0)
    lowest: Annotated[float, Quantity("speed")] = 0.0

    def apply(self, truth: Truth, rng: np.random.Generator) -> Airspeed:
        """Return the airspeed along a motion [m/s]."""
        wind = _checks.as_vector("wind_n", self.wind_n)
        t, speed = self._output(truth.t, np.linalg.norm(truth.v_n - wind, axis=1), rng)
        return Airspeed(t=t, airspeed=np.where(speed < max(self.lowest, 0.0), 0.0, speed))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisEncoder(Scalar):
    """Incremental encoder of one gimbal axis.

    Parameters
    ----------
    axis : str
        Which angle of the box it measures: ``"roll"``, ``"pitch"`` or ``"yaw"``.
    incremental : bool
        Whether it counts from where it was switched on.
    """

    axis: str = "yaw"
    incremental: bool = True

    def __post_init__(self) -> None:
        """Check the axis too."""
        Scalar.__post_init__(self)
        _checks.one_of("axis", self.axis, _ANGLES)

    def apply(self, truth: Truth, rng: np.random.Generator) -> Encoder:
        """Return the angle along a motion [rad], continuous over turns."""
        angle = np.unwrap(rpy_from_quat(truth.q_nb)[:, _ANGLES.index(self.axis)])
        if self.incremental and len(angle):
            angle = angle - angle[0]
        t, seen = self._output(truth.t, angle, rng)
        return Encoder(t=t, angle=seen)

    def channels(self, angle: ArrayLike) -> IntArray:
        """Return the state of the two channels at angles, as ``2 A + B``.

        Upwards they run 11, 10, 00, 01 (thesis A, table 8.2), one step per count.

        Parameters
        ----------
        angle : array_like, shape (n,)
            Angles [rad].

        Returns
        -------
        ndarray of int64, shape (n,)
        """
        cycle = np.array([3, 2, 0, 1], dtype=np.int64)
        return cycle[self.digital.counts(angle) % 4]


@dataclass(frozen=True, slots=True, kw_only=True)
class Warmth:
    """Temperature of a sensor that warms up after it is switched on.

    ``T(t) = settled + (start - settled) exp(-(t - t_0) / time_constant)``.

    Parameters
    ----------
    start, settled : float
        Temperature at first and at last [degC].
    time_constant : float
        Time to come closer by the factor e [s].
    """

    start: Annotated[float, Quantity("temperature")] = 25.0
    settled: Annotated[float, Quantity("temperature")] = 25.0
    time_constant: Annotated[float, Quantity("time")] = 600.0

    def __post_init__(self) -> None:
        """Check the values."""
        _checks.finite("start", self.start)
        _checks.finite("settled", self.settled)
        _checks.positive("time_constant", self.time_constant)

    def at(self, t: ArrayLike) -> FloatArray:
        """Return the temperature [degC] at times [s], the first being the start."""
        times = _checks.as_series("t", t)
        since = times - times[0] if len(times) else times
        return np.asarray(
            self.settled + (self.start - self.settled) * np.exp(-since / self.time_constant)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermometer(Scalar):
    """Thermometer of a sensor.

    Parameters are those of `Scalar`.
    """

    def apply(
        self, truth: Truth, rng: np.random.Generator, temp_degc: ArrayLike = 25.0
    ) -> Temperature:
        """Return the reading [degC] of the temperature at the truth's times."""
        temp: Any = _checks.as_floats("temp_degc", temp_degc)
        t, seen = self._output(truth.t, np.broadcast_to(temp, truth.t.shape), rng)
        return Temperature(t=t, temp_degc=seen)
