"""All sensors of a recording: statistics, deviation curves, coefficients, in one call."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from strapdown._checks import instances, one_of, recording
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import DataGap, InputError, MissingStream
from strapdown.noise.allan import AllanDeviation, allan_deviation
from strapdown.noise.coefficients import Coefficients
from strapdown.noise.identify import LEAST_SAMPLES, identify
from strapdown.noise.readoff import read_off
from strapdown.noise.record import AXES, SENSOR_UNITS, AxisNoise, NoiseRecord, SensorNoise
from strapdown.noise.spectrum import PowerDensity, power_density
from strapdown.noise.static import StaticStatistics, full_statistics, static_statistics
from strapdown.noise.stillness import require_signal, require_still
from strapdown.recording import Recording

_LEAST_SHARE: Final = 0.5  # of a log that has to be left between gaps


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Characterization:
    """What a log at rest says of its sensors.

    Attributes
    ----------
    record : NoiseRecord
        The coefficients and statistics; this is what is saved.
    curves : mapping of str to tuple of AllanDeviation
        Overlapping Allan deviation of x, y, z by sensor.
    spectra : mapping of str to tuple of PowerDensity
        Power spectral densities.
    readings : mapping of str to tuple of Coefficients
        Coefficients read off the slopes, beside the fit.
    together : StaticStatistics, optional
        Of gyroscope, accelerometer and magnetometer at common times, with their full
        covariance; None where one inertial sensor is missing.
    """

    record: NoiseRecord
    curves: Mapping[str, tuple[AllanDeviation, ...]]
    spectra: Mapping[str, tuple[PowerDensity, ...]]
    readings: Mapping[str, tuple[Coefficients, ...]]
    together: StaticStatistics | None


def characterize(
    rec: Recording, sensors: Iterable[str] | None = None, *, sensor_id: str = ""
) -> Characterization:
    """Characterise the noise of the sensors of a device that lay still.

    Parameters
    ----------
    rec : Recording
        The log, hours long if slow noise is to show. `Recording.between` selects a part.
    sensors : iterable of str, optional
        Which of ``"gyr"``, ``"acc"``, ``"mag"``; all that there are by default.
    sensor_id : str
        Which piece of hardware, for the record.

    Returns
    -------
    Characterization

    Raises
    ------
    MissingStream
        If a sensor asked for is not there, or none is.
    InputError
        If a channel moves, is constant, clipped, or too short.
    DataGap
        If gaps leave less than half of the log in one piece.
    """
    recording("rec", rec)
    names = _wanted(rec, sensors)
    noises: dict[str, SensorNoise] = {}
    curves: dict[str, tuple[AllanDeviation, ...]] = {}
    spectra: dict[str, tuple[PowerDensity, ...]] = {}
    readings: dict[str, tuple[Coefficients, ...]] = {}
    for name in names:
        t, samples = _channels(rec, name)
        rows, remarks = _unbroken(name, t, samples)
        t, samples = t[rows], samples[rows]
        if len(t) < LEAST_SAMPLES:
            raise InputError(
                f"`{name}` must have at least {LEAST_SAMPLES} samples in one piece, "
                f"got {len(t)}; record longer."
            )
        fs = (len(t) - 1) / float(t[-1] - t[0])
        channels = [np.ascontiguousarray(samples[:, k]) for k in range(3)]
        for letter, channel in zip(AXES, channels, strict=True):
            require_signal(f"{name} {letter}", channel)
        require_still(name, samples, fs, float(t[0]))
        statistics = static_statistics(samples)
        curves[name] = tuple(allan_deviation(channel, fs) for channel in channels)
        spectra[name] = tuple(power_density(channel, fs) for channel in channels)
        readings[name] = tuple(read_off(curve) for curve in curves[name])
        x, y, z = (
            AxisNoise(
                mean=float(statistics.mean[k]),
                mean_std=float(statistics.mean_std[k]),
                std=float(statistics.std[k]),
                coefficients=identify(channel, fs, name=f"{name} {AXES[k]}"),
            )
            for k, channel in enumerate(channels)
        )
        noises[name] = SensorNoise(
            sensor=name,
            fs=fs,
            duration=len(t) / fs,
            start=float(t[0]),
            axes=(x, y, z),
            covariance=statistics.covariance,
            remarks=remarks,
        )
    record = NoiseRecord(
        sensors=noises,
        sensor_id=sensor_id,
        source=str(rec.meta.get("source", rec.meta.get("name", ""))),
        temp_degc=_temperature(rec),
    )
    return Characterization(
        record=record,
        curves=curves,
        spectra=spectra,
        readings=readings,
        together=full_statistics(rec) if {"gyr", "acc"} <= noises.keys() else None,
    )


def _wanted(rec: Recording, sensors: Iterable[str] | None) -> tuple[str, ...]:
    """Return the sensors to look at, in their usual order."""
    there = [*(("gyr", "acc") if rec.imu is not None else ()), *(["mag"] if rec.mag else [])]
    there = [name for name in there if np.isfinite(_channels(rec, name)[1]).any()]
    if sensors is None:
        if not there:
            raise MissingStream(
                "the recording must hold a gyroscope, an accelerometer or a magnetometer."
            )
        return tuple(there)
    asked = [one_of("sensors", name, SENSOR_UNITS) for name in instances("sensors", sensors, str)]
    for name in asked:
        if name not in there:
            raise MissingStream(
                f"the recording must hold {name!r}, it has {', '.join(there) or 'no such sensor'}."
            )
    return tuple(name for name in SENSOR_UNITS if name in asked)


def _channels(rec: Recording, name: str) -> tuple[FloatArray, FloatArray]:
    """Return times and real samples of a sensor; held ones are left out."""
    if name == "mag":
        assert rec.mag is not None
        return rec.mag.t, rec.mag.mag
    assert rec.imu is not None
    samples, real = (
        (rec.imu.gyr, rec.imu.gyr_real) if name == "gyr" else (rec.imu.acc, rec.imu.acc_real)
    )
    return (rec.imu.t, samples) if real is None else (rec.imu.t[real], samples[real])


def _unbroken(name: str, t: FloatArray, samples: FloatArray) -> tuple[slice, tuple[str, ...]]:
    """Return the rows of the longest stretch without a gap or a NaN, and what was left out."""
    good: BoolArray = np.asarray(np.isfinite(samples).all(axis=1))
    if len(t) < 2:
        return slice(0, len(t)), ()
    ends = np.flatnonzero(_gaps(t)) + 1
    broken = np.concatenate(
        ([0], ends, np.flatnonzero(~good), np.flatnonzero(~good) + 1, [len(t)])
    )
    borders = np.unique(broken)
    lengths = np.where(good[np.minimum(borders[:-1], len(t) - 1)], np.diff(borders), 0)
    best = int(np.argmax(lengths))
    rows = slice(int(borders[best]), int(borders[best + 1]))
    if lengths[best] == len(t):
        return rows, ()
    share = lengths[best] / len(t)
    place = f"{t[rows.start]:.1f} s to {t[rows.stop - 1]:.1f} s"
    if share < _LEAST_SHARE:
        first = int(borders[1]) if borders[1] < len(t) else 0
        raise DataGap(
            f"`{name}` must be without gaps and NaN over half of the log, got {ends.size} gaps "
            f"and {int(np.count_nonzero(~good))} rows with NaN, the first at {t[first]:.3f} s; "
            f"the longest piece is {place}."
        )
    return rows, (f"gaps or NaN: the longest unbroken piece, {place}, was used",)


def _gaps(t: FloatArray) -> BoolArray:
    """Return which intervals lack a sample; one that came late is made up by its neighbours."""
    dt = np.diff(t)
    median = float(np.median(dt))
    long = dt > 1.5 * median
    two = dt[:-1] + dt[1:]
    long[:-1] &= two > 2.5 * median
    long[1:] &= two > 2.5 * median
    return np.asarray(long)


def _temperature(rec: Recording) -> float | None:
    """Return the mean temperature, if it was recorded."""
    if rec.temperature is None or not np.isfinite(rec.temperature.temp_degc).any():
        return None
    return float(np.nanmean(rec.temperature.temp_degc))
