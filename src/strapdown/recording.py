"""What sensors said: named streams, each on its own time axis, SI units, axes as recorded.

Every stream checks itself on construction: shapes, finite and strictly increasing times.
Samples may hold NaN, which estimators skip and flag; `Recording.info` counts them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import MissingStream


class Field(NamedTuple):
    """One array of a stream: its name, its SI columns, and whether it may be absent."""

    name: str
    columns: tuple[str, ...]
    optional: bool = False
    kind: str = "samples"  # or "quat" (unit norm), or "flag" (bool)

    @property
    def width(self) -> int:
        """Components per sample; 1 stands for an array of shape (n,)."""
        return len(self.columns)


class Stream:
    """Base of all streams: `t`, the arrays that `FIELDS` lists, and their checks."""

    __slots__ = ()
    FIELDS: ClassVar[tuple[Field, ...]] = ()
    t: FloatArray

    def __post_init__(self) -> None:
        """Check and normalise every array."""
        label = type(self).__name__.lower()
        t = _checks.as_times(f"{label}.t", self.t)
        object.__setattr__(self, "t", t)
        for spec in self.FIELDS:
            value = getattr(self, spec.name)
            name = f"{label}.{spec.name}"
            if value is None and spec.optional:
                continue
            array: Any
            if spec.kind == "flag":
                array = np.ascontiguousarray(value, dtype=np.bool_)
                if array.ndim != 1:
                    raise ValueError(f"`{name}` must have shape (n,), got {array.shape}.")
            elif spec.width == 1:
                array = _checks.as_series(name, value, allow_nan=True)
            elif spec.kind == "quat":
                array = _checks.as_samples(name, value, spec.width, allow_nan=True)
                array = _checks.as_quats(name, array, allow_nan=True)
            else:
                array = _checks.as_samples(name, value, spec.width, allow_nan=True)
            if len(array) != len(t):
                raise ValueError(
                    f"`{name}` must have as many rows as `{label}.t`, "
                    f"got {len(array)} and {len(t)}."
                )
            object.__setattr__(self, spec.name, array)

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float, stop: float) -> Self:
        """Return the samples with ``start <= t < stop``; arrays are views."""
        low, high = np.searchsorted(self.t, (start, stop))
        return self.rows(slice(int(low), int(high)))

    def rows(self, rows: slice | BoolArray) -> Self:
        """Return the samples that `rows` selects."""
        parts = {
            spec.name: getattr(self, spec.name)[rows]
            for spec in self.FIELDS
            if getattr(self, spec.name) is not None
        }
        return replace(self, t=self.t[rows], **parts)  # type: ignore[type-var]

    def shifted(self, seconds: float) -> Self:
        """Return the stream with `seconds` added to its times."""
        return replace(self, t=self.t + seconds)  # type: ignore[type-var]

    def nan_rows(self) -> BoolArray:
        """Return which samples hold a NaN in any array that is present."""
        bad = np.zeros(len(self.t), dtype=np.bool_)
        for spec in self.FIELDS:
            value = getattr(self, spec.name)
            if value is not None and spec.kind != "flag":
                nan = np.isnan(value)
                bad |= nan if nan.ndim == 1 else nan.any(axis=1)
        return bad


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Imu(Stream):
    """Gyroscope and accelerometer on one time axis.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s]. ``gyr[k]`` covers ``(t[k-1], t[k]]``.
    gyr : ndarray, shape (n, 3)
        Angular rate omega_ib_b [rad/s].
    acc : ndarray, shape (n, 3)
        Specific force f_b [m/s^2].
    gyr_real, acc_real : ndarray of bool, shape (n,), optional
        Where the two sensors differ in rate, the faster one gives the axis, the slower one
        is held, and its mask marks the real samples. None: all are real.
    """

    FIELDS: ClassVar[tuple[Field, ...]] = (
        Field("gyr", ("gyr_x_rad_s", "gyr_y_rad_s", "gyr_z_rad_s")),
        Field("acc", ("acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2")),
        Field("gyr_real", ("gyr_real",), optional=True, kind="flag"),
        Field("acc_real", ("acc_real",), optional=True, kind="flag"),
    )
    t: FloatArray
    gyr: FloatArray
    acc: FloatArray
    gyr_real: BoolArray | None = None
    acc_real: BoolArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mag(Stream):
    """Magnetometer: `t` [s] and `mag`, shape (n, 3) [T], sensor axes of the box."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("mag", ("mag_x_t", "mag_y_t", "mag_z_t")),)
    t: FloatArray
    mag: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gnss(Stream):
    """GNSS fixes, of the antenna.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time of validity [s].
    lla : ndarray, shape (n, 3)
        Latitude, longitude, ellipsoidal height [rad, rad, m].
    v_n : ndarray, shape (n, 3), optional
        Velocity over ground, north, east, down [m/s].
    std_position_n, std_velocity_n : ndarray, shape (n, 3), optional
        Standard deviations that the receiver states, north, east, down [m], [m/s].
    heading : ndarray, shape (n,), optional
        Heading or course that the receiver states [rad]; often stale at rest.
    """

    FIELDS: ClassVar[tuple[Field, ...]] = (
        Field("lla", ("lat_rad", "lon_rad", "height_m")),
        Field("v_n", ("v_n_m_s", "v_e_m_s", "v_d_m_s"), optional=True),
        Field("std_position_n", ("std_n_m", "std_e_m", "std_d_m"), optional=True),
        Field("std_velocity_n", ("std_v_n_m_s", "std_v_e_m_s", "std_v_d_m_s"), optional=True),
        Field("heading", ("heading_rad",), optional=True),
    )
    t: FloatArray
    lla: FloatArray
    v_n: FloatArray | None = None
    std_position_n: FloatArray | None = None
    std_velocity_n: FloatArray | None = None
    heading: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Baro(Stream):
    """Barometer: `t` [s] and static `pressure`, shape (n,) [Pa]."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("pressure", ("pressure_pa",)),)
    t: FloatArray
    pressure: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Temperature(Stream):
    """Thermometer of the sensor: `t` [s] and `temp_degc`, shape (n,) [degC]."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("temp_degc", ("temp_degc",)),)
    t: FloatArray
    temp_degc: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Airspeed(Stream):
    """Pitot tube: `t` [s] and `airspeed`, shape (n,) [m/s]."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("airspeed", ("airspeed_m_s",)),)
    t: FloatArray
    airspeed: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Speed(Stream):
    """Wheel speed or odometer: `t` [s] and forward `speed`, shape (n,) [m/s]."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("speed", ("speed_m_s",)),)
    t: FloatArray
    speed: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Encoder(Stream):
    """Axis encoder: `t` [s] and `angle`, shape (n,) [rad], continuous over turns."""

    FIELDS: ClassVar[tuple[Field, ...]] = (Field("angle", ("angle_rad",)),)
    t: FloatArray
    angle: FloatArray


_Q_NB = Field("q_nb", ("q_nb_w", "q_nb_x", "q_nb_y", "q_nb_z"), kind="quat")
_VALID = Field("valid", ("valid",), optional=True, kind="flag")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Star(Stream):
    """Star tracker: `t` [s] and attitude `q_nb`, shape (n, 4)."""

    FIELDS: ClassVar[tuple[Field, ...]] = (_Q_NB,)
    t: FloatArray
    q_nb: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AttitudeReference(Stream):
    """Reference attitude of the box: `t` [s], `q_nb` (n, 4), `valid` (n,) or None for all."""

    FIELDS: ClassVar[tuple[Field, ...]] = (_Q_NB, _VALID)
    t: FloatArray
    q_nb: FloatArray
    valid: BoolArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionReference(Stream):
    """Reference position: `t` [s], `lla` (n, 3), `v_n` (n, 3) or None, `valid` or None."""

    FIELDS: ClassVar[tuple[Field, ...]] = (
        Field("lla", ("lat_rad", "lon_rad", "height_m")),
        Field("v_n", ("v_n_m_s", "v_e_m_s", "v_d_m_s"), optional=True),
        _VALID,
    )
    t: FloatArray
    lla: FloatArray
    v_n: FloatArray | None = None
    valid: BoolArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MountReference(Stream):
    """Reference mounting: `t` [s], `q_vb` (n, 4) box to vehicle, `valid` (n,) or None."""

    FIELDS: ClassVar[tuple[Field, ...]] = (
        Field("q_vb", ("q_vb_w", "q_vb_x", "q_vb_y", "q_vb_z"), kind="quat"),
        _VALID,
    )
    t: FloatArray
    q_vb: FloatArray
    valid: BoolArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """What another, better instrument said; estimators never see it.

    Attributes
    ----------
    attitude : AttitudeReference, optional
    position : PositionReference, optional
    mount : MountReference, optional
    heading : str
        What the reference's heading is measured from: ``"true"``, ``"magnetic"`` or
        ``"arbitrary"``.
    """

    attitude: AttitudeReference | None = None
    position: PositionReference | None = None
    mount: MountReference | None = None
    heading: str = "true"

    def __post_init__(self) -> None:
        """Check the kind of heading."""
        _checks.one_of("heading", self.heading, ("true", "magnetic", "arbitrary"))

    def streams(self) -> Iterator[tuple[str, Stream]]:
        """Yield the name and the stream of each part that is present."""
        for name in ("attitude", "position", "mount"):
            stream = getattr(self, name)
            if stream is not None:
                yield name, stream

    def between(self, start: float, stop: float) -> "Reference":
        """Return the samples with ``start <= t < stop``."""
        parts: dict[str, Any] = {name: s.between(start, stop) for name, s in self.streams()}
        return replace(self, **parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamInfo:
    """What `Recording.info` says of one stream.

    Attributes
    ----------
    name : str
        Name of the stream; parts of the reference are ``reference.attitude`` and so on.
    samples, nan_samples, gaps : int
        Samples, those holding NaN, and intervals longer than 1.5 times the median one.
    start_s, stop_s, rate_hz, longest_gap_s : float
        First and last time [s], one over the median interval [Hz], longest interval [s].
    columns : tuple of str
        SI columns that are present.
    """

    name: str
    samples: int
    start_s: float
    stop_s: float
    rate_hz: float
    gaps: int
    longest_gap_s: float
    nan_samples: int
    columns: tuple[str, ...]


def _stream_info(name: str, stream: Stream) -> StreamInfo:
    t = stream.t
    dt = np.diff(t)
    median = float(np.median(dt)) if len(dt) else float("nan")
    return StreamInfo(
        name=name,
        samples=len(t),
        start_s=float(t[0]) if len(t) else float("nan"),
        stop_s=float(t[-1]) if len(t) else float("nan"),
        rate_hz=1.0 / median,
        gaps=int(np.count_nonzero(dt > 1.5 * median)),
        longest_gap_s=float(dt.max()) if len(dt) else float("nan"),
        nan_samples=int(np.count_nonzero(stream.nan_rows())),
        columns=tuple(
            column
            for spec in stream.FIELDS
            if getattr(stream, spec.name) is not None
            for column in spec.columns
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Named sensor streams with one common time origin, SI units, axes of the box.

    Attributes
    ----------
    imu : Imu, optional
        Gyroscope and accelerometer; every estimator needs it, a logger's file of one other
        sensor may lack it.
    mag, gnss, baro, temperature, airspeed, speed, encoder, star
        Aiding streams, each present or None.
    reference : Reference, optional
        What a better instrument said.
    meta : mapping of str
        JSON-like facts about the log: ``name``, ``source``, ``epoch_utc`` (ISO 8601 of
        ``t = 0``), ``lat_rad``, ``lon_rad``, ``height_m`` of a device that stays in one
        place, and whatever a format adds.
    """

    imu: Imu | None = None
    mag: Mag | None = None
    gnss: Gnss | None = None
    baro: Baro | None = None
    temperature: Temperature | None = None
    airspeed: Airspeed | None = None
    speed: Speed | None = None
    encoder: Encoder | None = None
    star: Star | None = None
    reference: Reference | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that each stream is of its type."""
        for name, kind in STREAMS.items():
            stream = getattr(self, name)
            if stream is not None and not isinstance(stream, kind):
                raise TypeError(
                    f"`{name}` must be a {kind.__name__}, got {type(stream).__name__}."
                )

    def streams(self) -> Iterator[tuple[str, Stream]]:
        """Yield the name and the stream of each sensor that is present."""
        for name in STREAMS:
            stream = getattr(self, name)
            if stream is not None:
                yield name, stream

    def need(self, name: str) -> Any:
        """Return the stream `name`, or say which ones there are.

        Raises
        ------
        MissingStream
            If the recording lacks it.
        """
        stream = getattr(self, _checks.one_of("name", name, STREAMS))
        if stream is None:
            there = ", ".join(n for n, _ in self.streams()) or "nothing"
            raise MissingStream(f"the recording must have the stream {name!r}, it has {there}.")
        return stream

    def between(self, start: float, stop: float) -> "Recording":
        """Return the part with ``start <= t < stop`` of every stream; times stay as they are.

        Parameters
        ----------
        start, stop : float
            Limits [s].

        Returns
        -------
        Recording
            Its arrays are views.
        """
        if not start <= stop:
            raise ValueError(f"`start` must not be after `stop`, got {start} and {stop}.")
        parts: dict[str, Any] = {n: s.between(start, stop) for n, s in self.streams()}
        if self.reference is not None:
            parts["reference"] = self.reference.between(start, stop)
        return replace(self, **parts)

    def info(self) -> tuple[StreamInfo, ...]:
        """Return rate, span, gaps and NaN count of every stream, the reference's too."""
        rows = [_stream_info(name, stream) for name, stream in self.streams()]
        if self.reference is not None:
            rows += [_stream_info(f"reference.{n}", s) for n, s in self.reference.streams()]
        return tuple(rows)


# The sensor streams by name, in the order in which they are listed.
STREAMS: Mapping[str, type[Stream]] = {
    "imu": Imu,
    "mag": Mag,
    "gnss": Gnss,
    "baro": Baro,
    "temperature": Temperature,
    "airspeed": Airspeed,
    "speed": Speed,
    "encoder": Encoder,
    "star": Star,
}
REFERENCE_STREAMS: Mapping[str, type[Stream]] = {
    "attitude": AttitudeReference,
    "position": PositionReference,
    "mount": MountReference,
}


def from_arrays(
    t: ArrayLike,
    gyr: ArrayLike,
    acc: ArrayLike,
    mag: ArrayLike | None = None,
    **meta: Any,
) -> Recording:
    """Return a recording of arrays that share one time axis.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s], strictly increasing.
    gyr : array_like, shape (n, 3)
        Angular rate [rad/s].
    acc : array_like, shape (n, 3)
        Specific force [m/s^2].
    mag : array_like, shape (n, 3), optional
        Magnetic field [T]; rows of NaN where the magnetometer was not sampled.
    **meta
        Facts to keep with the recording.

    Returns
    -------
    Recording
    """
    imu = Imu(t=t, gyr=gyr, acc=acc)  # type: ignore[arg-type]
    field_b = None if mag is None else Mag(t=imu.t, mag=mag)  # type: ignore[arg-type]
    return Recording(imu=imu, mag=field_b, meta=meta)
