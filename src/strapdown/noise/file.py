"""Noise files: TOML that people read, with units, checked when it is loaded.

One table per sensor, ``[gyr]``, ``[acc]``, ``[mag]``, one per axis below it, and in it one line
per noise term with its unit. Keys that are not known and other units are refused.
"""

import datetime as dt
import math
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomlkit

from strapdown._checks import instance, nearest
from strapdown.errors import FormatError
from strapdown.io._atomic import written_aside
from strapdown.io._toml import read_toml
from strapdown.noise.coefficients import (
    SYMBOLS,
    Coefficient,
    Coefficients,
    Status,
    coefficient_unit,
)
from strapdown.noise.record import (
    AXES,
    SENSOR_UNITS,
    UNIT_SYMBOLS,
    AxisNoise,
    NoiseRecord,
    SensorNoise,
)

FILE_TYPE: Final = "strapdown noise"
FORMAT_VERSION: Final = 1

_HEAD = {"type", "format_version", "date", "sensor_id", "source", "temp_degc"}
_SENSOR = {"unit", "rate_hz", "duration_s", "start_s", "covariance", "remarks", *AXES}
_AXIS = {"mean", "mean_std", "std", "method", "tau_min_s", "model_error", *SYMBOLS}
_TERM = {"status", "value", "std", "low", "high", "unit", "remark"}


def save(record: NoiseRecord, path: str | PathLike[str]) -> None:
    """Write a noise record to a TOML file.

    Parameters
    ----------
    record : NoiseRecord
        What is written.
    path : str or path
        The file; written aside and then renamed.
    """
    instance("record", record, NoiseRecord)
    document = tomlkit.document()
    document.add(tomlkit.comment("noise at rest; N, B, K, R, Q are for two-sided densities"))
    document["type"] = FILE_TYPE
    document["format_version"] = FORMAT_VERSION
    document["date"] = record.date
    document["sensor_id"] = record.sensor_id
    document["source"] = record.source
    if record.temp_degc is not None:
        document["temp_degc"] = float(record.temp_degc)
    for name, noise in record.sensors.items():
        document[name] = _sensor_table(noise)
    text = tomlkit.dumps(document)
    with written_aside(Path(path)) as stream:
        stream.write(text.encode("utf-8"))


def load(path: str | PathLike[str]) -> NoiseRecord:
    """Return the noise record that a TOML file holds.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    NoiseRecord

    Raises
    ------
    FormatError
        If the file is no noise record, of another version, or has keys, units or shapes that
        it should not have.
    """
    file = Path(path)
    document = read_toml(file)
    if document.get("type") != FILE_TYPE:
        raise FormatError(
            f"must begin with `type = {FILE_TYPE!r}`, got {document.get('type')!r}",
            file=file,
            hint="give a file that `strapdown characterize` wrote",
        )
    if document.get("format_version") != FORMAT_VERSION:
        raise FormatError(
            f"`format_version` must be {FORMAT_VERSION}, got {document.get('format_version')!r}",
            file=file,
            hint="characterize again, or use the version of strapdown that wrote it",
        )
    _check_keys(document, _HEAD | SENSOR_UNITS.keys(), "", file)
    date = document.get("date")
    if not isinstance(date, dt.date):
        raise FormatError(f"`date` must be a date such as 2025-03-31, got {date!r}", file=file)
    try:
        return NoiseRecord(
            sensors={
                name: _sensor(name, document[name], file)
                for name in SENSOR_UNITS
                if name in document
            },
            sensor_id=str(document.get("sensor_id", "")),
            source=str(document.get("source", "")),
            date=date.date() if isinstance(date, dt.datetime) else date,
            temp_degc=document.get("temp_degc"),
        )
    except KeyError as error:
        raise FormatError(f"the key {error} is missing", file=file) from None
    except FormatError:
        raise
    except (TypeError, ValueError) as error:
        raise FormatError(str(error), file=file) from None


# --- writing ----------------------------------------------------------------------------


def _sensor_table(noise: SensorNoise) -> Any:
    table = tomlkit.table()
    table["unit"] = SENSOR_UNITS[noise.sensor]
    table["rate_hz"] = float(noise.fs)
    table["duration_s"] = float(noise.duration)
    table["start_s"] = float(noise.start)
    table["covariance"] = noise.covariance.tolist()
    table["remarks"] = list(noise.remarks)
    for letter, axis in zip(AXES, noise.axes, strict=True):
        table[letter] = _axis_table(axis, UNIT_SYMBOLS[noise.sensor])
    return table


def _axis_table(axis: AxisNoise, unit: str) -> Any:
    c = axis.coefficients
    table = tomlkit.table()
    table["mean"], table["mean_std"], table["std"] = axis.mean, axis.mean_std, axis.std
    table["method"] = c.method
    table["tau_min_s"] = c.tau_min
    table["model_error"] = c.model_error
    for term in c:
        row = tomlkit.inline_table()
        row["status"] = term.status.value
        for name in ("value", "std", "low", "high"):
            number = float(getattr(term, name))
            if math.isfinite(number):
                row[name] = number
        row["unit"] = coefficient_unit(term.symbol, unit)
        if term.remark:
            row["remark"] = term.remark
        table[term.symbol] = row
    return table


# --- reading ----------------------------------------------------------------------------


def _check_keys(table: Any, known: Any, place: str, file: Path) -> None:
    if not isinstance(table, Mapping):
        raise FormatError(f"`{place}` must be a table, got {table!r}", file=file)
    for key in table:
        if key not in known:
            where = f"in [{place}]" if place else "at the top"
            raise FormatError(f"unknown key {key!r} {where}{nearest(key, known)}", file=file)


def _sensor(name: str, table: Any, file: Path) -> SensorNoise:
    _check_keys(table, _SENSOR, name, file)
    _check_unit(table["unit"], SENSOR_UNITS[name], f"{name}.unit", file)
    fs, duration = float(table["rate_hz"]), float(table["duration_s"])
    x, y, z = (_axis(name, letter, table[letter], fs, duration, file) for letter in AXES)
    return SensorNoise(
        sensor=name,
        fs=fs,
        duration=duration,
        start=float(table["start_s"]),
        axes=(x, y, z),
        covariance=np.asarray(table["covariance"], dtype=np.float64),
        remarks=tuple(str(text) for text in table.get("remarks", ())),
    )


def _axis(name: str, letter: str, table: Any, fs: float, duration: float, file: Path) -> AxisNoise:
    place = f"{name}.{letter}"
    _check_keys(table, _AXIS, place, file)
    Q, N, B, K, R = (_term(name, place, symbol, table[symbol], file) for symbol in SYMBOLS)
    return AxisNoise(
        mean=float(table["mean"]),
        mean_std=float(table["mean_std"]),
        std=float(table["std"]),
        coefficients=Coefficients(
            Q=Q,
            N=N,
            B=B,
            K=K,
            R=R,
            method=str(table["method"]),
            fs=fs,
            duration=duration,
            tau_min=float(table["tau_min_s"]),
            model_error=float(table["model_error"]),
        ),
    )


def _term(name: str, place: str, symbol: str, table: Any, file: Path) -> Coefficient:
    place = f"{place}.{symbol}"
    _check_keys(table, _TERM, place, file)
    unit = coefficient_unit(symbol, UNIT_SYMBOLS[name])
    _check_unit(table["unit"], unit, f"{place}.unit", file)
    statuses = [status.value for status in Status]
    if table["status"] not in statuses:
        raise FormatError(
            f"`{place}.status` must be one of {', '.join(statuses)}, got {table['status']!r}",
            file=file,
        )
    return Coefficient(
        symbol=symbol,
        status=Status(table["status"]),
        value=float(table.get("value", math.nan)),
        std=float(table.get("std", math.nan)),
        low=float(table.get("low", math.nan)),
        high=float(table.get("high", math.inf)),
        remark=str(table.get("remark", "")),
    )


def _check_unit(found: Any, expected: str, place: str, file: Path) -> None:
    if found != expected:
        raise FormatError(
            f"`{place}` must be {expected!r}, got {found!r}",
            file=file,
            hint="noise files are in SI; convert the numbers, then write that unit",
        )
