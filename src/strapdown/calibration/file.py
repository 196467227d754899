"""Calibration files: TOML that people read and edit, and that is checked when it is loaded.

The file has one table per sensor, ``[gyr]``, ``[acc]``, ``[mag]``, and one per temperature model,
``[temperature.gyr]`` and so on. Each states its unit; keys that are not known, missing keys and
other units are refused, with the way out. Writing into an existing file keeps its other tables
and their comments.
"""

import datetime as dt
import math
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomlkit

from strapdown._checks import nearest
from strapdown._types import FloatArray
from strapdown.calibration.calibration_set import Calibration
from strapdown.calibration.record import (
    SENSOR_UNITS,
    CalibrationRecord,
    Fit,
    Parameter,
    TemperatureRecord,
    Verdict,
)
from strapdown.errors import FormatError, InputError
from strapdown.io._atomic import written_aside
from strapdown.io._toml import read_toml
from strapdown.units import UNITS, parse_unit

FILE_TYPE: Final = "strapdown calibration"
FORMAT_VERSION: Final = 1
_LARGEST_ARRAY = 1200  # numbers; longer residuals and directions are left out of the file

_COMMON = {
    "type", "method", "sensor_id", "date", "unit", "residual_rms", "residual_rms_before",
    "equations", "dof", "verdict", "covariance", "parameters", "quality", "fit",
}  # fmt: skip
_KEYS = {
    "calibration": _COMMON | {"matrix", "bias", "temp_degc", "reference"},
    "temperature": _COMMON | {"slope", "temp_mean_degc", "temp_min_degc", "temp_max_degc"},
}
_OPTIONAL = {"sensor_id", "temp_degc", "reference", "quality", "fit", "verdict", "parameters",
             "covariance", "residual_rms", "residual_rms_before", "equations", "dof"}  # fmt: skip
_PARAMETER_KEYS = {"value", "std", "unit", "tolerance", "nominal", "verdict"}
_FIT_KEYS = {"residuals", "residuals_before", "history", "directions"}


def load(path: str | PathLike[str], *, convert_units: bool = False) -> Calibration:
    """Return the calibration that a TOML file holds.

    Parameters
    ----------
    path : str or path
        The file.
    convert_units : bool
        True converts a table whose unit is not SI, such as a gyroscope in deg/s.

    Returns
    -------
    Calibration

    Raises
    ------
    FormatError
        If the file is no calibration, of another version, or a table has keys, units or shapes
        that it should not have. The message says what to write.
    """
    file = Path(path)
    document = read_toml(file)
    _check_head(document, file)
    fits: list[Fit] = []
    for key, table in document.items():
        if key in SENSOR_UNITS:
            fits.append(_fit(key, table, "calibration", key, file, convert_units))
        elif key == "temperature":
            for sensor, inner in _table(table, key, file).items():
                place = f"temperature.{sensor}"
                if sensor not in SENSOR_UNITS:
                    raise _unknown(sensor, SENSOR_UNITS, "temperature", file)
                fits.append(_fit(sensor, inner, "temperature", place, file, convert_units))
        elif key not in ("type", "format_version"):
            raise _unknown(key, (*SENSOR_UNITS, "temperature"), None, file)
    return Calibration().merge(fits)


def save(calibration: Iterable[Fit], path: str | PathLike[str]) -> None:
    """Write records to a TOML file, replacing it.

    Parameters
    ----------
    calibration : Calibration or iterable of Fit
        What is written.
    path : str or path
        The file; written aside and then renamed.
    """
    document = tomlkit.document()
    document.add(tomlkit.comment("corrected = matrix @ (raw - bias); see `strapdown calibrate`"))
    document["type"] = FILE_TYPE
    document["format_version"] = FORMAT_VERSION
    _write(document, _records("calibration", calibration), Path(path))


def merge_into(
    path: str | PathLike[str], fits: Iterable[Fit], *, convert_units: bool = False
) -> Calibration:
    """Add records to a TOML file, made if it is not there; return what it then holds.

    Parameters
    ----------
    path : str or path
        The file. Its other tables stay as they are, comments included.
    fits : Calibration or iterable of Fit
        Records; each replaces the one of its sensor and kind.
    convert_units : bool
        As for `load`.

    Returns
    -------
    Calibration
    """
    file, fits = Path(path), _records("fits", fits)
    if not file.exists():
        save(fits, file)
        return Calibration().merge(fits)
    merged = load(file, convert_units=convert_units).merge(fits)
    _write(tomlkit.parse(file.read_text(encoding="utf-8")), fits, file)
    return merged


def _records(name: str, fits: Iterable[Fit]) -> tuple[Fit, ...]:
    """Return the records, refusing what is none."""
    found = tuple(fits) if isinstance(fits, Iterable) else (fits,)
    for fit in found:
        if not isinstance(fit, CalibrationRecord | TemperatureRecord):
            raise TypeError(
                f"`{name}` must hold calibration records, got {type(fit).__name__}; "
                "the calibrating functions return them."
            )
    return found


# --- writing ----------------------------------------------------------------------------


def _write(document: tomlkit.TOMLDocument, fits: Iterable[Fit], file: Path) -> None:
    for fit in fits:
        if isinstance(fit, CalibrationRecord):
            document[fit.sensor] = _calibration_table(fit)
        elif isinstance(fit, TemperatureRecord):
            if "temperature" not in document:
                document["temperature"] = tomlkit.table(is_super_table=True)
            document["temperature"][fit.sensor] = _temperature_table(fit)
    text = tomlkit.dumps(document)
    with written_aside(file) as stream:
        stream.write(text.encode("utf-8"))


def _calibration_table(record: CalibrationRecord) -> Any:
    table = _head(record, "calibration")
    table["matrix"] = _numbers(record.matrix)
    table["bias"] = _numbers(record.bias)
    if record.temp_degc is not None:
        table["temp_degc"] = float(record.temp_degc)
    if record.reference is not None:
        table["reference"] = float(record.reference)
    return _tail(table, record)


def _temperature_table(record: TemperatureRecord) -> Any:
    table = _head(record, "temperature")
    table["slope"] = _numbers(record.slope)
    for name in ("temp_mean_degc", "temp_min_degc", "temp_max_degc"):
        table[name] = float(getattr(record, name))
    return _tail(table, record)


def _head(record: Fit, kind: str) -> Any:
    table = tomlkit.table()
    table["type"] = kind
    table["method"] = record.method
    table["sensor_id"] = record.sensor_id
    table["date"] = record.date
    table["unit"] = record.unit
    return table


def _tail(table: Any, record: Fit) -> Any:
    table["verdict"] = record.verdict.value
    table["residual_rms"] = float(record.residual_rms)
    table["residual_rms_before"] = float(record.residual_rms_before)
    table["equations"] = int(record.equations)
    table["dof"] = int(record.dof)
    table["covariance"] = _numbers(record.covariance)
    parameters = tomlkit.table()
    for p in record.parameters:
        row = tomlkit.inline_table()
        row["value"], row["std"], row["unit"] = p.value, p.std, p.unit
        row["nominal"] = p.nominal
        if p.tolerance is not None:
            row["tolerance"] = p.tolerance
        row["verdict"] = p.verdict.value
        parameters[p.name] = row
    table["parameters"] = parameters
    quality = tomlkit.table()
    for name, value in record.quality.items():
        quality[name] = float(value)
    table["quality"] = quality
    fit = tomlkit.table()
    for name in sorted(_FIT_KEYS):
        array: FloatArray = getattr(record, name)
        if 0 < array.size <= _LARGEST_ARRAY:
            fit[name] = _numbers(array)
    table["fit"] = fit
    return table


def _numbers(array: FloatArray) -> Any:
    if array.ndim < 2:
        return tomlkit.item(array.tolist())
    rows = tomlkit.array()
    for row in array.tolist():
        rows.append(row)
    return rows.multiline(True)


# --- reading ----------------------------------------------------------------------------


def _check_head(document: Mapping[str, Any], file: Path) -> None:
    if document.get("type") != FILE_TYPE:
        raise FormatError(
            f"must begin with `type = {FILE_TYPE!r}`, got {document.get('type')!r}",
            file=file,
            hint="give a file that `strapdown calibrate` wrote",
        )
    version = document.get("format_version")
    if version != FORMAT_VERSION:
        raise FormatError(
            f"`format_version` must be {FORMAT_VERSION}, got {version!r}",
            file=file,
            hint="calibrate again, or use the version of strapdown that wrote it",
        )


def _fit(
    sensor: str, raw: Any, kind: str, place: str, file: Path, convert_units: bool
) -> CalibrationRecord | TemperatureRecord:
    """Return the record of one table."""
    table = _table(raw, place, file)
    for key in table:
        if key not in _KEYS[kind]:
            raise _unknown(key, _KEYS[kind], place, file)
    missing = sorted(_KEYS[kind] - _OPTIONAL - table.keys())
    if missing:
        raise FormatError(
            f"the table [{place}] must have {', '.join(f'`{key}`' for key in missing)}",
            file=file,
            hint="calibrate again, or add what is missing",
        )
    if table["type"] != kind:
        raise FormatError(f"`{place}.type` must be {kind!r}, got {table['type']!r}", file=file)
    factor = _unit_factor(sensor, table["unit"], place, file, convert_units)
    try:
        values = _common(table, sensor, factor, place, file)
        if kind == "calibration":
            reference = table.get("reference")
            return CalibrationRecord(
                **values,
                matrix=np.asarray(table["matrix"], dtype=np.float64),
                bias=factor * np.asarray(table["bias"], dtype=np.float64),
                temp_degc=table.get("temp_degc"),
                reference=None if reference is None else factor * float(reference),
            )
        return TemperatureRecord(
            **values,
            slope=factor * np.asarray(table["slope"], dtype=np.float64),
            temp_mean_degc=float(table["temp_mean_degc"]),
            temp_min_degc=float(table["temp_min_degc"]),
            temp_max_degc=float(table["temp_max_degc"]),
        )
    except FormatError:
        raise
    except (TypeError, ValueError) as error:
        raise FormatError(f"table [{place}]: {error}", file=file) from None


def _common(
    table: Mapping[str, Any], sensor: str, factor: float, place: str, file: Path
) -> dict[str, Any]:
    """Return the fields that all records share."""
    date = table["date"]
    if not isinstance(date, dt.date):
        raise FormatError(
            f"`{place}.date` must be a date such as 2025-03-31, got {date!r}", file=file
        )
    rows = _table(table.get("parameters", {}), f"{place}.parameters", file)
    parameters = tuple(
        _parameter(name, row, table["unit"], sensor, factor, place, file)
        for name, row in rows.items()
    )
    scale = np.array([_factor_of(row["unit"], table["unit"], factor) for row in rows.values()])
    count = len(parameters)
    covariance = np.asarray(table.get("covariance", []), dtype=np.float64)
    if covariance.size == 0:
        covariance = np.full((count, count), np.nan)
    if covariance.shape == (count, count):
        covariance = covariance * np.outer(scale, scale)
    fit = _table(table.get("fit", {}), f"{place}.fit", file)
    for key in fit:
        if key not in _FIT_KEYS:
            raise _unknown(key, _FIT_KEYS, f"{place}.fit", file)
    history = np.asarray(fit.get("history", np.empty((0, count))), dtype=np.float64)
    if history.ndim != 2 or history.shape[1] != count:
        raise FormatError(
            f"`{place}.fit.history` must have {count} columns, got shape {history.shape}",
            file=file,
        )
    return {
        "sensor": sensor,
        "method": str(table["method"]),
        "sensor_id": str(table.get("sensor_id", "")),
        "date": date.date() if isinstance(date, dt.datetime) else date,
        "parameters": parameters,
        "covariance": covariance,
        "residual_rms": factor * float(table.get("residual_rms", math.nan)),
        "residual_rms_before": factor * float(table.get("residual_rms_before", math.nan)),
        "equations": table.get("equations", 0),
        "dof": table.get("dof", 0),
        "residuals": factor * np.asarray(fit.get("residuals", []), dtype=np.float64),
        "residuals_before": factor * np.asarray(fit.get("residuals_before", []), dtype=np.float64),
        "history": history * scale if count else history,
        "directions": np.asarray(fit.get("directions", np.empty((0, 3))), dtype=np.float64),
        "quality": {k: float(v) for k, v in table.get("quality", {}).items()},
    }


def _parameter(
    name: str, raw: Any, unit: str, sensor: str, factor: float, place: str, file: Path
) -> Parameter:
    row = _table(raw, f"{place}.parameters.{name}", file)
    for key in row:
        if key not in _PARAMETER_KEYS:
            raise _unknown(key, _PARAMETER_KEYS, f"{place}.parameters.{name}", file)
    for key in ("value", "std", "unit"):
        if key not in row:
            raise FormatError(f"`{place}.parameters.{name}` must have `{key}`", file=file)
    verdicts = [v.value for v in Verdict]
    if row.get("verdict", verdicts[0]) not in verdicts:
        raise FormatError(
            f"`{place}.parameters.{name}.verdict` must be one of {', '.join(verdicts)}, got "
            f"{row['verdict']!r}",
            file=file,
        )
    by = _factor_of(row["unit"], unit, factor)
    tolerance = row.get("tolerance")
    return Parameter(
        name=name,
        value=by * float(row["value"]),
        std=by * float(row["std"]),
        unit=str(row["unit"]).replace(unit, SENSOR_UNITS[sensor]) if by != 1.0 else row["unit"],
        tolerance=None if tolerance is None else by * float(tolerance),
        nominal=by * float(row.get("nominal", 0.0)),
    )


def _factor_of(unit: str, table_unit: str, factor: float) -> float:
    """Return the factor to SI of a parameter's unit: the table's, or that per degree."""
    return factor if unit in (table_unit, f"{table_unit}_per_degc") else 1.0


def _unit_factor(sensor: str, text: Any, place: str, file: Path, convert_units: bool) -> float:
    """Return the factor from the table's unit to SI; refuse other units unless they convert."""
    si = SENSOR_UNITS[sensor]
    if text == si:
        return 1.0
    quantity = next(unit.quantity for unit in UNITS if unit.name == si)
    try:
        unit = parse_unit(str(text), quantity)
    except InputError as error:
        raise FormatError(
            f"`{place}.unit` must be {si!r}, got {text!r}: {str(error).rstrip('.')}", file=file
        ) from None
    if unit.name == si or convert_units:
        return unit.factor
    raise FormatError(
        f"`{place}.unit` must be {si!r}, got {text!r}",
        file=file,
        hint=f"multiply its bias and the like by {unit.factor:.10g} and write unit = {si!r}, or "
        "load it with `convert_units=True`",
    )


def _table(raw: Any, place: str, file: Path) -> dict[str, Any]:
    if not isinstance(raw, dict):
        raise FormatError(f"`{place}` must be a table, got {raw!r}", file=file)
    return raw


def _unknown(key: str, known: Iterable[str], place: str | None, file: Path) -> FormatError:
    names = sorted(known)
    where = f"in table [{place}]" if place else "at the top"
    return FormatError(
        f"unknown key {key!r} {where}{nearest(key, names)}; known are {', '.join(names)}",
        file=file,
        hint="correct or remove it",
    )
