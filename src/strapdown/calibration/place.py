"""Where and when a recording was made, and what follows: gravity, field, date, sensor."""

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from strapdown import earth
from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.errors import MissingStream
from strapdown.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where and when the recordings were made, where they do not say it themselves.

    Parameters
    ----------
    lla : tuple of float, optional
        Latitude, longitude, height [rad, rad, m].
    date : datetime.date, optional
        Day of the recordings.
    """

    lla: tuple[float, float, float] | None = None
    date: dt.date | None = None


def duration_of(recs: Sequence[Recording]) -> float:
    """Return the time that the inertial samples span together [s]."""
    return float(sum(rec.imu.t[-1] - rec.imu.t[0] for rec in recs if rec.imu is not None))


def _lla(recs: Sequence[Recording], place: Place | None) -> FloatArray | None:
    if place is not None and place.lla is not None:
        return np.asarray(place.lla, dtype=np.float64)
    for rec in recs:
        meta = rec.meta
        if "lat_rad" in meta:
            return np.array([meta["lat_rad"], meta.get("lon_rad", 0.0), meta.get("height_m", 0.0)])
        if rec.gnss is not None and len(rec.gnss):
            return np.asarray(np.nanmedian(rec.gnss.lla, axis=0))
    return None


def _date(recs: Sequence[Recording], place: Place | None) -> dt.date | None:
    if place is not None and place.date is not None:
        return place.date
    for rec in recs:
        if rec.meta.get("epoch_utc"):
            return dt.datetime.fromisoformat(str(rec.meta["epoch_utc"])).date()
    return None


def gravity_of(
    recs: Sequence[Recording], gravity: float | None, place: Place | None, notes: list[str]
) -> float:
    """Return local gravity [m/s^2]: as given, of the place, or the standard one with a note."""
    if gravity is not None:
        return gravity
    lla = _lla(recs, place)
    if lla is None:
        notes.append(
            f"local gravity is not known, {G0} m/s^2 is taken: scale factors may be off by "
            "0.3 %; give `--gravity` or `--at`."
        )
        return G0
    g = float(earth.normal_gravity(lla[0], lla[2]))
    notes.append(f"gravity is {g:.5f} m/s^2 at the place of the log.")
    return g


def field_of(
    recs: Sequence[Recording], place: Place | None, notes: list[str]
) -> FloatArray | None:
    """Return the magnetic field of the place and day, NED [T]; None if they are not known."""
    lla, date = _lla(recs, place), _date(recs, place)
    if lla is None:
        return None
    if date is None:
        notes.append("the day of the log is not known; give it with `--date` to use the field's "
                     "strength from the world magnetic model.")  # fmt: skip
        return None
    return earth.magnetic_field(lla, date).field_n


def about_record(
    recs: Sequence[Recording], place: Place | None, sensor_id: str, sensor: str
) -> dict[str, Any]:
    """Return sensor, date and temperature for the record."""
    about: dict[str, Any] = {"sensor_id": sensor_id or _recorded_id(recs, sensor)}
    date = _date(recs, place)
    if date is not None:
        about["date"] = date
    temperatures = [r.temperature.temp_degc for r in recs if r.temperature is not None]
    known = np.concatenate(temperatures) if temperatures else np.empty(0)
    known = known[~np.isnan(known)]
    about["temp_degc"] = float(known.mean()) if len(known) else None
    return about


def _recorded_id(recs: Sequence[Recording], sensor: str) -> str:
    for rec in recs:
        named = rec.meta.get("sensor_id", "")
        text = str(named.get(sensor, "") if isinstance(named, Mapping) else named)
        if text:
            return text
    return ""


def reference_attitude(rec: Recording) -> tuple[FloatArray, FloatArray]:
    """Return times and quaternions of the reference where they are valid."""
    stream = None if rec.reference is None else rec.reference.attitude
    if stream is None:
        raise MissingStream(
            "the recording must have a reference attitude for this method; give one with "
            "`--reference`."
        )
    good = ~np.isnan(stream.q_nb).any(axis=1)
    if stream.valid is not None:
        good &= stream.valid
    if np.count_nonzero(good) < 2:
        raise MissingStream("the reference attitude must have valid samples, it has none.")
    return stream.t[good], stream.q_nb[good]
