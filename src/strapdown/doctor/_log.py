"""The sensors of a recording, or of a raw log that no recording can be made of."""

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.io._raw import Column, RawLog, Table
from strapdown.recording import Gnss, Recording
from strapdown.units import Unit

SENSORS: Final = ("gyr", "acc", "mag")
_TIME_FACTORS: Final = (1.0, 1e-3, 1e-6, 1e-9)
_FASTEST_S, _SLOWEST_S = 1e-5, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """Three axes as they were recorded.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times as they stand in the log [s]; they need not advance.
    values : ndarray, shape (n, 3)
        SI if the stated unit is right.
    unit : Unit, optional
        The unit that the log states; None where it is not known.
    """

    t: FloatArray
    values: FloatArray
    unit: Unit | None = None

    def advancing(self) -> "Sensor":
        """Return the samples that have a time later than all before."""
        t = np.where(np.isfinite(self.t), self.t, -np.inf)
        later = np.r_[np.isfinite(self.t[:1]), t[1:] > np.maximum.accumulate(t)[:-1]]
        return self if later.all() else replace(self, t=self.t[later], values=self.values[later])


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """What is examined.

    Attributes
    ----------
    sensors : dict
        Of `SENSORS`, those that there are.
    gnss : Gnss, optional
        Fixes.
    faults : list of tuple
        Why `io.read` refuses the log: stream, sentence, hint.
    meta : dict
        Facts that the log states about itself.
    """

    sensors: dict[str, Sensor]
    gnss: Gnss | None = None
    faults: list[tuple[str, str, str]] = field(default_factory=list)
    meta: dict[str, Any] = field(default_factory=dict)


def log_of(source: Recording | RawLog) -> Log:
    """Return the sensors of a recording or of a raw log."""
    return _from_raw(source) if isinstance(source, RawLog) else _from_recording(source)


def _from_recording(rec: Recording) -> Log:
    sensors: dict[str, Sensor] = {}
    if rec.imu is not None:
        for name, values, real in (
            ("gyr", rec.imu.gyr, rec.imu.gyr_real),
            ("acc", rec.imu.acc, rec.imu.acc_real),
        ):
            rows: Any = slice(None) if real is None else real
            sensors[name] = Sensor(rec.imu.t[rows], values[rows])
    if rec.mag is not None:
        sampled = ~np.isnan(rec.mag.mag).all(axis=1)
        rows = slice(None) if sampled.all() else sampled
        sensors["mag"] = Sensor(rec.mag.t[rows], rec.mag.mag[rows])
    sensors = {name: sensor for name, sensor in sensors.items() if len(sensor.t)}
    return Log(sensors, rec.gnss, meta=dict(rec.meta))


def _from_raw(raw: RawLog) -> Log:
    sensors: dict[str, Sensor] = {}
    for table in raw.tables:
        stream = table.stream or ""
        if stream.startswith(("ref", "opt")) or not len(table):
            continue
        times = _times(table, raw.meta)
        for name in SENSORS:
            columns = _triad(table, name)
            if columns is None or times is None or name in sensors:
                continue
            unit = columns[0].unit
            factor = 1.0 if unit is None else unit.factor
            values = factor * np.column_stack([np.asarray(c.values, float) for c in columns])
            sensors[name] = Sensor(times, values, unit)
    faults = [(fault.stream or "", fault.what, fault.hint or "") for fault in raw.faults()]
    return Log(sensors, _gnss(raw), faults, dict(raw.meta))


def _triad(table: Table, name: str) -> list[Column] | None:
    """Return the three columns of a sensor, by role or, in packed files, by the table's name."""
    columns = [table.by_role(f"{name}_{axis}") for axis in "xyz"]
    found = [column for column in columns if column is not None]
    if len(found) == 3:
        return found
    if table.stream in (name, f"imu_{name}") and len(table.columns) == 3:
        return table.columns
    return None


def _times(table: Table, meta: dict[str, Any]) -> FloatArray | None:
    """Return times in seconds after the first, in the unit stated or the one that is possible."""
    column = table.by_role("t")
    if column is None:
        rate = meta.get("sampling_rate_hz")
        return None if rate is None else np.arange(len(table)) / float(rate)
    values = column.values - column.values[0] if len(column.values) else column.values
    t = np.asarray(values, dtype=np.float64)
    if column.unit is not None:
        return np.asarray(t * column.unit.factor)
    step = float(np.nanmedian(np.abs(np.diff(t)))) if len(t) > 1 else 0.0
    fits = [k for k in _TIME_FACTORS if _FASTEST_S <= step * k <= _SLOWEST_S]
    return np.asarray(t * (fits[0] if fits else 1.0))


def _gnss(raw: RawLog) -> Gnss | None:
    """Return the fixes of a raw log if they make a stream, else None."""
    for table in raw.tables:
        columns = {c.role: c for c in table.columns if c.role is not None}
        if (table.stream or "").startswith("ref") or not {"lat", "lon", "height"} <= set(columns):
            continue
        t = _times(table, raw.meta)

        def si(*roles: str, columns: dict[str, Column] = columns) -> FloatArray | None:
            if not all(role in columns for role in roles):
                return None
            parts = [
                (1.0 if c.unit is None else c.unit.factor) * np.asarray(c.values, float)
                for c in (columns[role] for role in roles)
            ]
            return np.column_stack(parts) if len(parts) > 1 else parts[0]

        if t is None:
            return None
        try:
            return Gnss(
                t=t,
                lla=si("lat", "lon", "height"),  # type: ignore[arg-type]
                v_n=si("v_n", "v_e", "v_d"),
                std_position_n=si("std_n", "std_e", "std_d"),
                std_velocity_n=si("std_v_n", "std_v_e", "std_v_d"),
                heading=si("heading"),
            )
        except ValueError:  # the time checks name what is wrong with it
            return None
    return None


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Sensors on the gyroscope's axis, averaged to about 100 Hz.

    Attributes
    ----------
    t, dt
        Times and their interval [s].
    fields : dict
        Sensor to samples, shape (n, 3).
    bad : ndarray, shape (n,)
        Where a sample is missing or beside a gap.
    """

    t: FloatArray
    dt: float
    fields: dict[str, FloatArray]
    bad: BoolArray


def grid_of(log: Log, longest_s: float) -> Grid | None:
    """Return the sensors on one axis, or None without a gyroscope that can be used.

    Parameters
    ----------
    log : Log
        The sensors.
    longest_s : float
        Of a longer log, its first part of this length is taken.
    """
    from strapdown.doctor._turning import averaged

    if "gyr" not in log.sensors:
        return None
    gyr = log.sensors["gyr"].advancing()
    gyr = replace(gyr, t=(t := gyr.t[gyr.t < gyr.t[0] + longest_s]), values=gyr.values[: len(t)])
    if len(t) < 100 or not t[-1] > t[0]:
        return None
    step = float(np.median(np.diff(t)))
    bad = ~np.isfinite(gyr.values).all(axis=1)
    bad |= np.diff(t, prepend=t[0] - step) > 3.0 * step
    fields = {"gyr": np.nan_to_num(gyr.values, posinf=0.0, neginf=0.0)}
    for name in ("acc", "mag"):
        if name not in log.sensors:
            continue
        other = log.sensors[name].advancing()
        sound = np.isfinite(other.values).all(axis=1)
        to, vo = other.t[sound], other.values[sound]
        if len(to) < 10:
            continue
        if len(to) == len(t) and np.array_equal(to, t):
            fields[name] = vo
            continue
        fields[name] = np.column_stack([np.interp(t, to, vo[:, j]) for j in range(3)])
        apart = np.median(np.diff(to))
        k = np.clip(np.searchsorted(to, t), 1, len(to) - 1)
        bad |= (to[k] - to[k - 1] > 3.0 * max(apart, step)) | (t < to[0]) | (t > to[-1])
    flag = np.repeat(bad[:, None].astype(float), 3, axis=1)
    tg, *parts, flags = averaged(t, *fields.values(), flag)
    names = list(fields)
    return Grid(
        tg,
        float(np.median(np.diff(tg))),
        dict(zip(names, parts, strict=True)),
        np.asarray(flags[:, 0] > 0.0),
    )
