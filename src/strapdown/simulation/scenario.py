"""Scenarios: motion, place, sensors and their settings in a TOML file; the recording they make.

::

    description = "box on a record player"
    [time]
    duration_s = 60
    rate_hz = 400            # of the truth; the sensors sample it at rates of their own
    [place]
    lat_deg = 39.36
    lon_deg = 16.23
    height_m = 250
    [motion]
    kind = "turntable"
    rate_rpm = 45
    [sensors]
    presets = ["adis16350"]
    [sensors.gyr.sampling]   # any parameter of any sensor can be set
    rate_hz = 100
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from strapdown import _checks
from strapdown.errors import FormatError, InputError
from strapdown.recording import MountReference, Recording
from strapdown.rotation import quat_from_rpy
from strapdown.sensors.device import SENSORS, Device
from strapdown.sensors.fixes import GnssFix, StarTracker
from strapdown.sensors.presets import preset, preset_names
from strapdown.sensors.scalars import AxisEncoder, Barometer, Pitot, Thermometer, Warmth
from strapdown.sensors.settings import Quantity, from_table
from strapdown.sensors.triads import Accelerometer, Gyro, Magnetometer
from strapdown.simulation import kinematics
from strapdown.simulation.kinematics import EPOCH_UTC, Motion
from strapdown.simulation.motions import (
    BangBang,
    Coning,
    HandMoved,
    Poses,
    Sculling,
    Servo,
    Static,
    Turntable,
    Waypoints,
)
from strapdown.simulation.vehicles import Drive, Flight
from strapdown.truth import Truth
from strapdown.units import DEG

MOTIONS: Mapping[str, type[Any]] = {
    "static": Static,
    "poses": Poses,
    "turntable": Turntable,
    "servo": Servo,
    "hand_moved": HandMoved,
    "waypoints": Waypoints,
    "drive": Drive,
    "flight": Flight,
    "bang_bang": BangBang,
    "coning": Coning,
    "sculling": Sculling,
}
# What each sensor is when no preset has it, and what it measures.
_KINDS: Mapping[str, tuple[type[Any], str]] = {
    "gyr": (Gyro, "angular_rate"),
    "acc": (Accelerometer, "acceleration"),
    "mag": (Magnetometer, "magnetic_field"),
    "gnss": (GnssFix, "length"),
    "baro": (Barometer, "pressure"),
    "airspeed": (Pitot, "speed"),
    "encoder": (AxisEncoder, "angle"),
    "star": (StarTracker, "angle"),
    "temperature": (Thermometer, "temperature"),
}
_TABLES = ("description", "time", "place", "motion", "mount", "temperature", "sensors")


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Length and rates.

    Parameters
    ----------
    duration : float
        Length [s].
    rate : float
        Rate of the truth [Hz]; at least that of the fastest sensor, and several times it where
        sensors average or filter.
    reference_rate : float
        Rate of the reference in the recording [Hz]; the truth's divided by a whole number.
    """

    duration: Annotated[float, Quantity("time")] = 60.0
    rate: Annotated[float, Quantity("frequency")] = 400.0
    reference_rate: Annotated[float, Quantity("frequency")] = 100.0

    def __post_init__(self) -> None:
        """Check the values."""
        _checks.positive("duration", self.duration)
        _checks.positive("rate", self.rate)
        _checks.positive("reference_rate", self.reference_rate)
        if abs(self.reference_every * self.reference_rate - self.rate) > 1e-9 * self.rate:
            raise ValueError(
                f"`reference_rate` must be `rate` divided by a whole number, got "
                f"{self.reference_rate:g} and {self.rate:g} Hz."
            )

    @property
    def reference_every(self) -> int:
        """Samples of the truth from one of the reference to the next."""
        return max(1, round(self.rate / self.reference_rate))


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where and when.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude [rad].
    height : float
        Above the ellipsoid [m].
    epoch_utc : str
        Date of ``t = 0``, ISO 8601.
    """

    lat: Annotated[float, Quantity("angle")] = 45.4 * DEG
    lon: Annotated[float, Quantity("angle")] = 11.9 * DEG
    height: Annotated[float, Quantity("length")] = 30.0
    epoch_utc: str = EPOCH_UTC


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """How the box sits in the vehicle.

    Parameters
    ----------
    rpy : tuple of float
        Roll, pitch, yaw of the box relative to the vehicle [rad].
    """

    rpy: Annotated[tuple[float, float, float], Quantity("angle")] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """All that a simulated recording depends on, but for the seed.

    Parameters
    ----------
    motion : Motion
        What moves, and how.
    device : Device
        The sensors.
    name, description : str
        What it is called, and what it shows.
    timing : Timing
        Length and rates.
    place : Place
        Where and when.
    mount : Mount
        How the box sits in the vehicle.
    warmth : Warmth
        Temperature of the box.
    individual : bool
        Whether the seed also draws the constant errors of the parts from their spread.
    """

    motion: Motion = field(default_factory=Static)
    device: Device = field(default_factory=Device)
    name: str = "scenario"
    description: str = ""
    timing: Timing = field(default_factory=Timing)
    place: Place = field(default_factory=Place)
    mount: Mount = field(default_factory=Mount)
    warmth: Warmth = field(default_factory=Warmth)
    individual: bool = False

    def truth(self) -> Truth:
        """Return the exact motion of the box."""
        number = math.floor(self.timing.duration * self.timing.rate + 1e-6) + 1
        return kinematics.truth(
            self.motion,
            np.arange(number) / self.timing.rate,
            (self.place.lat, self.place.lon, self.place.height),
            epoch_utc=self.place.epoch_utc,
            q_vb=quat_from_rpy(self.mount.rpy),
            meta={"name": self.name},
        )

    def record(self, seed: int = 1) -> Recording:
        """Return what the sensors say, with the truth as reference.

        Parameters
        ----------
        seed : int
            Same seed, same recording.

        Returns
        -------
        Recording
        """
        _checks.whole("seed", seed, 0)
        device = self.device.individual(seed) if self.individual else self.device
        truth = self.truth()
        recording = device.record(
            truth,
            seed=seed,
            temp_degc=self.warmth.at(truth.t),
            reference_every=self.timing.reference_every,
            lat_rad=self.place.lat,
            lon_rad=self.place.lon,
            height_m=self.place.height,
            description=self.description,
        )
        return _with_mount(recording, self.mount)


def load(source: str | Path) -> Scenario:
    """Return a scenario of a TOML file, or a shipped one of this name.

    Parameters
    ----------
    source : str or path
        A path, or one of `names`.

    Returns
    -------
    Scenario

    Raises
    ------
    InputError
        If there is neither such a file nor such a name, a key or a name is unknown (the nearest
        one is offered), or a value is refused.
    FormatError
        If the file is not TOML.

    Examples
    --------
    >>> rec = load("turntable_33").record(seed=3)
    >>> rec.imu.gyr.shape
    (16001, 3)
    """
    path = Path(source)
    if not path.is_file():
        known = names()
        if str(source) not in known:
            raise InputError(
                f"{source}: there is no such file, nor a scenario of this name"
                f"{_checks.nearest(str(source), known)}; shipped are {', '.join(known)}."
            )
        text = (files("strapdown.simulation") / "scenarios" / f"{source}.toml").read_text("utf-8")
    else:
        try:
            text = path.read_text("utf-8")
        except UnicodeDecodeError:
            raise FormatError("must be text in UTF-8", file=source) from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"must be TOML, {error}", file=source) from None
    return from_mapping(table, path.stem, str(source))


def from_mapping(table: Mapping[str, Any], name: str = "scenario", place: str = "") -> Scenario:
    """Return the scenario that tables describe.

    Parameters
    ----------
    table : mapping
        As a TOML file has them.
    name : str
        What to call it.
    place : str
        Where the tables come from, for messages.

    Returns
    -------
    Scenario
    """
    place = place or name
    _known(table, _TABLES, place)
    parts = {key: _table(table, key, place) for key in _TABLES if key != "description"}
    motion = dict(parts["motion"])
    kind = _name(motion.pop("kind", None), MOTIONS, f"{place} [motion], kind")
    sensors = dict(parts["sensors"])
    individual = sensors.pop("individual", False)
    if not isinstance(individual, bool):
        raise InputError(f"{place} [sensors]: `individual` must be true or false.")
    return Scenario(
        name=name,
        description=str(table.get("description", "")),
        motion=from_table(MOTIONS[kind](), motion, f"{place} [motion]"),
        device=_device(sensors, f"{place} [sensors]"),
        timing=from_table(Timing(), parts["time"], f"{place} [time]"),
        place=from_table(Place(), parts["place"], f"{place} [place]"),
        mount=from_table(Mount(), parts["mount"], f"{place} [mount]"),
        warmth=from_table(Warmth(), parts["temperature"], f"{place} [temperature]"),
        individual=individual,
    )


def names() -> tuple[str, ...]:
    """Return the names of the shipped scenarios."""
    folder = files("strapdown.simulation") / "scenarios"
    return tuple(
        sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))
    )


def _device(table: dict[str, Any], place: str) -> Device:
    """Return the device of presets and changes to them."""
    presets = table.pop("presets", [])
    if isinstance(presets, str):
        presets = [presets]
    if not isinstance(presets, list | tuple):
        raise InputError(f"{place}: `presets` must be a list of names, got {presets!r}.")
    device = Device(name=" + ".join(map(str, presets)) or "custom")
    for name in presets:
        part = preset(_name(name, preset_names(), f"{place}, presets"))
        device = device.with_sensors_of(part)
    _known(table, SENSORS, place)
    changed: dict[str, Any] = {}
    for name, (kind, measures) in _KINDS.items():
        if name in table:
            base = getattr(device, name) or kind()
            changed[name] = from_table(
                base, _table(table, name, place), f"{place[:-1]}.{name}]", measures
            )
    try:
        return device.with_sensors_of(Device(**_whole_imu(changed, device)))
    except ValueError as error:
        raise InputError(f"{place}: {error}") from error


def _whole_imu(changed: dict[str, Any], device: Device) -> dict[str, Any]:
    """Return the changes with the other half of the IMU that the device has already."""
    for name in ("gyr", "acc"):
        if name not in changed and getattr(device, name) is not None:
            changed[name] = getattr(device, name)
    return changed


def _with_mount(recording: Recording, mount: Mount) -> Recording:
    """Return the recording with its mounting in the reference, unless the box is the vehicle."""
    reference = recording.reference
    if not any(mount.rpy) or reference is None or reference.attitude is None:
        return recording
    t = reference.attitude.t
    q_vb = np.tile(quat_from_rpy(mount.rpy), (len(t), 1))
    return replace(recording, reference=replace(reference, mount=MountReference(t=t, q_vb=q_vb)))


def _table(table: Mapping[str, Any], key: str, place: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise InputError(f"{place}: {key!r} must be a table, got {value!r}.")
    return value


def _known(table: Mapping[str, Any], known: tuple[str, ...], place: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(
                f"{place}: unknown key {key!r}{_checks.nearest(key, known)}; "
                f"known are {', '.join(known)}."
            )


def _name(value: Any, known: Any, place: str) -> str:
    """Return `value` if it is one of the known names."""
    try:
        return _checks.one_of("name", value, known)
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None
