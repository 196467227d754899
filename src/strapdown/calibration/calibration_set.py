"""The calibrations of one device together, and their application to a recording."""

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

import numpy as np

from strapdown._types import FloatArray
from strapdown.calibration.record import (
    SENSOR_NAMES,
    CalibrationRecord,
    Fit,
    TemperatureRecord,
)
from strapdown.calibration.turn_on import TurnOnBias, turn_on_bias
from strapdown.errors import InputError, MissingStream, StrapdownWarning
from strapdown.recording import Recording

APPLIED = "calibration"  # key in the recording's metadata: what has been applied


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """Records of one device: at most one calibration and one temperature model per sensor.

    Parameters
    ----------
    records : mapping of str to CalibrationRecord
        By sensor: ``"gyr"``, ``"acc"``, ``"mag"``.
    temperatures : mapping of str to TemperatureRecord
        By sensor.
    """

    records: Mapping[str, CalibrationRecord] = field(default_factory=dict)
    temperatures: Mapping[str, TemperatureRecord] = field(default_factory=dict)

    @classmethod
    def of(cls, *fits: Fit) -> "Calibration":
        """Return the set of these records; a later one replaces an earlier of its kind."""
        return cls().merge(fits)

    def __iter__(self) -> Iterator[Fit]:
        yield from self.records.values()
        yield from self.temperatures.values()

    def merge(self, fits: Iterable[Fit]) -> "Calibration":
        """Return the set with the records of `fits` added; they replace those of their kind.

        Parameters
        ----------
        fits : Calibration or iterable of Fit
            What is added.

        Returns
        -------
        Calibration

        Raises
        ------
        InputError
            If a record is of another piece of hardware than the one of the same sensor here.
        """
        records, temperatures = dict(self.records), dict(self.temperatures)
        for fit in fits:
            if not isinstance(fit, (CalibrationRecord, TemperatureRecord)):
                raise TypeError(
                    "`fits` must hold CalibrationRecord and TemperatureRecord, got "
                    f"{type(fit).__name__}."
                )
            for other in (records.get(fit.sensor), temperatures.get(fit.sensor)):
                if other is not None:
                    _require_same(
                        fit.sensor_id,
                        other.sensor_id,
                        fit.sensor,
                        "the new record",
                        f"write to another file, or remove the table {fit.sensor!r} first",
                    )
            if isinstance(fit, CalibrationRecord):
                records[fit.sensor] = fit
            else:
                temperatures[fit.sensor] = fit
        return Calibration(records=records, temperatures=temperatures)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the records to a TOML file; see `strapdown.calibration.file`."""
        from strapdown.calibration.file import save

        save(self, path)

    def apply(
        self, rec: Recording, *, at_rest: bool = True, any_sensor: bool = False
    ) -> Recording:
        """Return the recording with its sensors corrected.

        Parameters
        ----------
        rec : Recording
            Raw. What it lacks is passed over.
        at_rest : bool
            Take the gyroscope's bias from the rest at the start of the log, if it begins with
            one, in place of the stored one: it changes at each switch-on. False keeps the
            stored bias.
        any_sensor : bool
            True applies the calibration even if the recording names another sensor.

        Returns
        -------
        Recording
            Its metadata ``calibration`` says what was applied, by sensor.

        Raises
        ------
        MissingStream
            If the recording has none of the calibrated sensors.
        InputError
            If it is corrected already, or names another sensor.

        Warns
        -----
        StrapdownWarning
            If there is a temperature model but no temperature in the recording.
        """
        done: dict[str, Any] = dict(rec.meta.get(APPLIED, {}))
        notes = list(rec.meta.get("notes", ()))
        imu, mag = rec.imu, rec.mag
        for sensor, record in self.records.items():
            stream = rec.mag if sensor == "mag" else rec.imu
            if stream is None:
                continue
            if sensor in done:
                raise InputError(
                    f"the {SENSOR_NAMES[sensor]} of this recording is corrected already "
                    f"({done[sensor]['method']}, {done[sensor]['date']}); read the raw log again."
                )
            if not any_sensor:
                _require_same(
                    _recorded_id(rec, sensor),
                    record.sensor_id,
                    sensor,
                    "the recording",
                    "use the calibration of that sensor, or `any_sensor=True` if both names mean "
                    "the same",
                )
            raw: FloatArray = getattr(stream, sensor)
            turn_on = self._turn_on(rec) if sensor == "gyr" and at_rest else None
            if turn_on is not None:
                notes.append(
                    f"the gyroscope's bias is from the rest at {turn_on.t_start:.1f} s to "
                    f"{turn_on.t_stop:.1f} s, in place of the calibrated one."
                )
            bias = self._bias(rec, sensor, stream.t, turn_on)
            corrected = record.correct(raw, bias)
            if sensor == "mag":
                mag = replace(mag, mag=corrected)  # type: ignore[type-var]
            else:
                imu = replace(imu, **{sensor: corrected})  # type: ignore[type-var]
            done[sensor] = {
                "method": record.method,
                "date": record.date.isoformat(),
                "sensor_id": record.sensor_id,
                "turn_on_bias": turn_on is not None,
            }
        if not any(sensor in done for sensor in self.records):
            wanted = ", ".join(SENSOR_NAMES[s] for s in self.records) or "nothing"
            there = ", ".join(name for name, _ in rec.streams()) or "nothing"
            raise MissingStream(
                f"the calibration is for {wanted}, but the recording has {there}; use a "
                "calibration of its sensors."
            )
        meta = {**rec.meta, APPLIED: done, **({"notes": notes} if notes else {})}
        return replace(rec, imu=imu, mag=mag, meta=meta)

    def _turn_on(self, rec: Recording) -> TurnOnBias | None:
        """Return the bias from the rest at the start, None if the log begins in motion."""
        if rec.imu is None or not len(rec.imu):
            return None
        try:
            return turn_on_bias(
                rec.imu.t, rec.imu.gyr, rec.imu.acc, expected=self.records["gyr"].bias
            )
        except InputError:
            return None

    def _bias(
        self, rec: Recording, sensor: str, t: FloatArray, turn_on: TurnOnBias | None
    ) -> FloatArray:
        """Return the bias at each time, or one for all."""
        record = self.records[sensor]
        bias = record.bias if turn_on is None else turn_on.bias
        model = self.temperatures.get(sensor)
        if model is None:
            return bias
        thermometer = rec.temperature
        known = None if thermometer is None else ~np.isnan(thermometer.temp_degc)
        if thermometer is None or known is None or not known.any():
            warnings.warn(
                f"the calibration of the {SENSOR_NAMES[sensor]} has a temperature model, but the "
                "recording has no temperature: the bias is taken as constant; record the "
                "temperature, or leave the model out of the file.",
                StrapdownWarning,
                stacklevel=3,
            )
            return bias
        temp_degc = np.interp(t, thermometer.t[known], thermometer.temp_degc[known])
        if turn_on is None:
            return bias + model.bias_change(temp_degc, record.temp_degc)
        used = (t >= turn_on.t_start) & (t <= turn_on.t_stop)
        return bias + model.bias_change(temp_degc, float(temp_degc[used].mean()))


def _recorded_id(rec: Recording, sensor: str) -> str:
    """Return the hardware that the recording names for a sensor, or nothing."""
    named = rec.meta.get("sensor_id", "")
    return str(named.get(sensor, "") if isinstance(named, Mapping) else named)


def _require_same(found: str, wanted: str, sensor: str, who: str, way_out: str) -> None:
    if found and wanted and found != wanted:
        raise InputError(
            f"the calibration of the {SENSOR_NAMES[sensor]} is for sensor {wanted!r}, but {who} "
            f"is of {found!r}; {way_out}."
        )
