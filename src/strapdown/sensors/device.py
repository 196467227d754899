"""A whole device: its sensors, what its datasheet says, and the recording it makes."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import whole
from strapdown._types import BoolArray, FloatArray
from strapdown.recording import (
    AttitudeReference,
    Imu,
    PositionReference,
    Recording,
    Reference,
)
from strapdown.sensors.datasheet import Datasheet
from strapdown.sensors.fixes import GnssFix, StarTracker
from strapdown.sensors.noise import PerAxis
from strapdown.sensors.sampling import Ticks
from strapdown.sensors.scalars import AxisEncoder, Barometer, Pitot, Thermometer
from strapdown.sensors.triads import Accelerometer, Gyro, Magnetometer, Samples, Triad
from strapdown.truth import Truth


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseParameters:
    """Noise of a device as estimators take it: the largest of the three axes, NaN if unknown.

    Attributes
    ----------
    gyr_noise, acc_noise, mag_noise : float
        Density of the white noise [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)], [T/sqrt(Hz)].
    gyr_bias_walk, acc_bias_walk, mag_bias_walk : float
        Random walk of the bias [rad/s sqrt(Hz)], [m/s^2 sqrt(Hz)], [T sqrt(Hz)].
    gyr_bias_instability, acc_bias_instability, mag_bias_instability : float
        Bias instability B [rad/s], [m/s^2], [T].
    gyr_bias_std, acc_bias_std, mag_bias_std : float
        Standard deviation of the bias at the start: spread of the parts and turn-on
        together [rad/s], [m/s^2], [T].
    """

    gyr_noise: float = math.nan
    acc_noise: float = math.nan
    mag_noise: float = math.nan
    gyr_bias_walk: float = math.nan
    acc_bias_walk: float = math.nan
    mag_bias_walk: float = math.nan
    gyr_bias_instability: float = math.nan
    acc_bias_instability: float = math.nan
    mag_bias_instability: float = math.nan
    gyr_bias_std: float = math.nan
    acc_bias_std: float = math.nan
    mag_bias_std: float = math.nan

    def noise_parameters(self) -> "NoiseParameters":
        """Return itself: what a device and a noise record make, an estimator takes as well."""
        return self

    def known(self, *names: str, **renamed: str) -> dict[str, float]:
        """Return the known ones of some parameters, as arguments of an estimator.

        Parameters
        ----------
        *names : str
            Parameters that the estimator calls the same.
        **renamed : str
            ``its_name="our_name"`` for the others.

        Returns
        -------
        dict of str to float

        Examples
        --------
        >>> NoiseParameters(gyr_noise=1e-4).known("gyr_noise", gyr_bias_noise="gyr_bias_walk")
        {'gyr_noise': 0.0001}
        """
        pairs = {**{name: name for name in names}, **renamed}
        values = {theirs: float(getattr(self, ours)) for theirs, ours in pairs.items()}
        return {name: value for name, value in values.items() if not math.isnan(value)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Device:
    """Sensors that share one box.

    Parameters
    ----------
    name : str
        Name of the type.
    gyr : Gyro, optional
        Gyroscope; needs an accelerometer beside it.
    acc : Accelerometer, optional
        Accelerometer; needs a gyroscope beside it.
    mag : Magnetometer, optional
        Magnetometer.
    gnss : GnssFix, optional
        GNSS receiver.
    baro : Barometer, optional
        Barometer.
    airspeed : Pitot, optional
        Pitot tube.
    encoder : AxisEncoder, optional
        Encoder of an axis.
    star : StarTracker, optional
        Star tracker.
    temperature : Thermometer, optional
        Thermometer of the box.
    datasheet : Datasheet, optional
        The figures that it was made of.
    assumed : tuple of str
        What no source gives and was chosen.
    """

    name: str = "device"
    gyr: Gyro | None = None
    acc: Accelerometer | None = None
    mag: Magnetometer | None = None
    gnss: GnssFix | None = None
    baro: Barometer | None = None
    airspeed: Pitot | None = None
    encoder: AxisEncoder | None = None
    star: StarTracker | None = None
    temperature: Thermometer | None = None
    datasheet: Datasheet | None = None
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that an IMU is whole."""
        if (self.gyr is None) != (self.acc is None):
            raise ValueError("a device must have both `gyr` and `acc` or neither, got one.")

    def individual(self, seed: int) -> "Device":
        """Return one part of this type, its constant errors drawn from the spread."""
        rng = np.random.default_rng(seed)
        triads = {
            name: part.individual(rng)
            for name, part in (("gyr", self.gyr), ("acc", self.acc), ("mag", self.mag))
            if part is not None
        }
        return replace(self, **triads)  # type: ignore[arg-type]

    def with_sensors_of(self, other: "Device") -> "Device":
        """Return this device with the sensors of another added; the other's win."""
        parts = {name: getattr(other, name) for name in SENSORS if getattr(other, name)}
        return replace(self, **parts)

    def noise_parameters(self) -> NoiseParameters:
        """Return the noise of the triads as estimators take it."""
        values: dict[str, float] = {}
        for name in ("gyr", "acc", "mag"):
            triad: Triad | None = getattr(self, name)
            if triad is None:
                continue
            noise = triad.noise
            bias = math.hypot(_largest(noise.turn_on), triad.spread.bias)
            for key, value in (
                ("noise", _largest(noise.white)),
                ("bias_walk", _largest(noise.random_walk)),
                ("bias_instability", _largest(noise.flicker)),
                ("bias_std", bias),
            ):
                values[f"{name}_{key}"] = value if value > 0.0 else math.nan
        return NoiseParameters(**values)

    def record(
        self,
        truth: Truth,
        *,
        seed: int = 1,
        temp_degc: ArrayLike = 25.0,
        reference_every: int = 1,
        **meta: Any,
    ) -> Recording:
        """Return what the device says of a motion, with the truth as reference.

        Parameters
        ----------
        truth : Truth
            The motion.
        seed : int
            Same seed, same recording. Each sensor has a stream of random numbers of its own:
            what one draws leaves the others alone.
        temp_degc : array_like, scalar or shape (n,)
            Temperature of the box at the truth's times [degC].
        reference_every : int
            The reference has every so many samples of the truth, from the first on.
        **meta
            Facts to keep with the recording.

        Returns
        -------
        Recording
        """
        streams = np.random.SeedSequence(seed).spawn(len(SENSORS))
        rng = {n: np.random.default_rng(s) for n, s in zip(SENSORS, streams, strict=True)}
        parts: dict[str, Any] = {}
        if self.gyr is not None and self.acc is not None:
            parts["imu"] = _imu(self.gyr, self.acc, truth, rng, temp_degc)
        if self.mag is not None:
            parts["mag"] = self.mag.apply(truth, rng["mag"], temp_degc=temp_degc)
        for name in ("gnss", "baro", "airspeed", "encoder", "star"):
            if (part := getattr(self, name)) is not None:
                parts[name] = part.apply(truth, rng[name])
        if self.temperature is not None:
            parts["temperature"] = self.temperature.apply(truth, rng["temperature"], temp_degc)
        rows = slice(None, None, whole("reference_every", reference_every, 1))
        t = truth.t[rows]
        return Recording(
            **parts,
            reference=Reference(
                attitude=AttitudeReference(t=t, q_nb=truth.q_nb[rows]),
                position=PositionReference(t=t, lla=truth.lla[rows], v_n=truth.v_n[rows]),
                heading="true",
            ),
            meta={**truth.meta, "source": "simulated", "device": self.name, "seed": seed, **meta},
        )


# The order fixes which random numbers each sensor gets: new ones go to the end.
SENSORS = ("gyr", "acc", "mag", "gnss", "baro", "airspeed", "encoder", "star", "temperature")


def _imu(
    gyr: Gyro,
    acc: Accelerometer,
    truth: Truth,
    rng: dict[str, np.random.Generator],
    temp_degc: ArrayLike,
) -> Imu:
    """Return both sensors on the axis of the faster one."""
    same = all(
        getattr(gyr.sampling, name) == getattr(acc.sampling, name)
        for name in ("rate", "jitter", "dropout", "dropout_length")
    )
    # one chip reads both at once: they share stamps and losses
    ticks: Ticks | None = None
    if same:
        ticks = gyr.sampling.ticks(truth.t, rng["gyr"].spawn(1)[0])
    gyr_samples = gyr.apply(truth, rng["gyr"], temp_degc=temp_degc, ticks=ticks)
    acc_samples = acc.apply(truth, rng["acc"], temp_degc=temp_degc, ticks=ticks)
    if same:
        return Imu(t=gyr_samples.t, gyr=gyr_samples.value, acc=acc_samples.value)
    if gyr.sampling.step(truth.t) <= acc.sampling.step(truth.t):
        held, real = _held(gyr_samples.t, acc_samples)
        return Imu(t=gyr_samples.t, gyr=gyr_samples.value, acc=held, acc_real=real)
    held, real = _held(acc_samples.t, gyr_samples)
    return Imu(t=acc_samples.t, gyr=held, acc=acc_samples.value, gyr_real=real)


def _held(t: FloatArray, slow: Samples) -> tuple[FloatArray, BoolArray]:
    """Return the latest sample at each time, and where it is a new one; NaN before the first."""
    # stamps of one instant may differ by rounding
    latest = np.searchsorted(slow.t, t + 1e-9, side="right") - 1
    value = np.where((latest >= 0)[:, np.newaxis], slow.value[np.maximum(latest, 0)], np.nan)
    real = (np.diff(latest, prepend=-1) > 0) & (latest >= 0)
    return value, real


def _largest(value: PerAxis) -> float:
    return float(np.max(value))
