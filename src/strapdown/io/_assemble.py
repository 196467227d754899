"""From sensors found in tables to a recording: SI, one axis for the IMU, checked streams."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from strapdown import recording
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import FormatError
from strapdown.io import _imu
from strapdown.io._clock import iso_utc
from strapdown.io._options import Options
from strapdown.io._parts import Part, split
from strapdown.io._raw import RawLog, stacked
from strapdown.io._roles import ROLES
from strapdown.recording import Recording, Reference, Stream

_STREAMS: Final[Mapping[str, type[Stream]]] = {
    "mag": recording.Mag,
    "gnss": recording.Gnss,
    "baro": recording.Baro,
    "temperature": recording.Temperature,
    "airspeed": recording.Airspeed,
    "speed": recording.Speed,
    "encoder": recording.Encoder,
    "star": recording.Star,
}
_REFERENCES: Final[Mapping[str, type[Stream]]] = {
    "ref_attitude": recording.AttitudeReference,
    "ref_position": recording.PositionReference,
    "ref_mount": recording.MountReference,
}


def assemble(raw: RawLog, options: Options) -> Recording:
    """Return the recording that a log's columns make; the columns are used up.

    Raises
    ------
    FormatError
        For the first fault found.
    """
    raw.require_sound()
    parts, origin = split(raw, options)
    raw.require_sound()
    streams: dict[str, Any] = {}
    reference: dict[str, Any] = {}
    imu: dict[str, Part] = {}
    for part in parts:
        if part.group in ("gyr", "acc"):
            imu.setdefault(part.group, part)
        elif part.group in _REFERENCES:
            name = part.group.removeprefix("ref_")
            fields = _reference_fields(part) if name == "attitude" else fields_of(part)
            if fields is not None:
                reference[name] = make(_REFERENCES[part.group], part, fields)
        elif part.group in _STREAMS and part.group not in streams:
            streams[part.group] = make(_STREAMS[part.group], part, fields_of(part))
    if imu:
        streams["imu"] = _build_imu(imu, raw)
    if not streams and not reference:
        raise FormatError("no sensor was found, only an attitude", file=raw.file)
    meta = dict(raw.meta)
    if origin is not None:
        meta["epoch_utc"] = iso_utc(origin)
    return Recording(**streams, reference=Reference(**reference) if reference else None, meta=meta)


def _build_imu(imu: dict[str, Part], raw: RawLog) -> recording.Imu:
    """Return the IMU of its two sensors."""
    for here, other in (("gyr", "acc"), ("acc", "gyr")):
        if other not in imu:
            word = {"gyr": "gyroscope", "acc": "accelerometer"}
            raise FormatError(
                f"an IMU has a gyroscope and an accelerometer, the {word[other]} is missing",
                file=imu[here].table.file,
                stream=other,
                hint=f"give its file with {other}=FILE, or its columns with "
                f"--columns {other}_x=NAME,...",
            )
    gyr, acc = imu["gyr"], imu["acc"]
    gyr_fields, acc_fields = fields_of(gyr), fields_of(acc)
    if gyr.t is acc.t or (len(gyr.t) == len(acc.t) and np.array_equal(gyr.t, acc.t)):
        imu_stream: recording.Imu = make(recording.Imu, gyr, gyr_fields | acc_fields)
        return imu_stream
    try:
        return _imu.merge(
            gyr.t, gyr_fields["gyr"], acc.t, acc_fields["acc"], gyr.table.file, raw.findings
        )
    except ValueError as error:
        raise _as_format_error(error, gyr) from None


def make(kind: type[Any], part: Part, fields: Mapping[str, Any]) -> Any:
    """Return a stream, its own refusals turned into errors that name file and line."""
    try:
        return kind(t=part.t, **fields)
    except ValueError as error:
        raise _as_format_error(error, part, fields) from None


def _as_format_error(
    error: ValueError, part: Part, fields: Mapping[str, Any] | None = None
) -> FormatError:
    """Return a refusal with its file and the line of the first infinite number."""
    if isinstance(error, FormatError):
        return error
    row: int | None = None
    for values in (fields or {}).values():
        bad = np.isinf(values) if values.dtype.kind == "f" else np.zeros(1, np.bool_)
        if bad.any():
            k = int(np.argmax(bad.reshape(len(values), -1).any(axis=1)))
            row = part.table.line(k if part.rows is None else int(part.rows[k]))
            break
    return FormatError(str(error), file=part.table.file, stream=part.group, row=row)


def fields_of(part: Part) -> dict[str, Any]:
    """Return the arrays of a sensor in SI, by field; the columns let their values go."""
    by_field: dict[str, list[str]] = {}
    for role in ROLES:  # in the order of the components
        if role in part.columns:
            by_field.setdefault(ROLES[role].field, []).append(role)
    out: dict[str, Any] = {}
    for name, roles in by_field.items():
        columns = [part.columns[role] for role in roles]
        out[name] = stacked(columns, part.rows)
        for column in columns:
            column.values = np.empty(0)
    for name in ("gyr_real", "acc_real", "valid"):
        if name in out:
            out[name] = np.nan_to_num(out[name]) > 0.5
    return _gnss_fields(out) if part.group == "gnss" else out


def _gnss_fields(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a fix, from whatever the receiver states."""
    n = len(fields["lla"])
    upward: FloatArray | None = fields.pop("v_u", None)
    v_n = fields.get("v_n")
    if upward is not None and v_n is not None and v_n.shape == (n, 2):
        fields["v_n"] = v_n = np.column_stack((v_n, -upward))
    horizontal: FloatArray | None = fields.pop("h_acc", None)
    vertical: FloatArray | None = fields.pop("v_acc", None)
    if horizontal is not None and vertical is not None and "std_position_n" not in fields:
        std = horizontal / np.sqrt(2.0)  # receivers state the root of both components' squares
        fields["std_position_n"] = np.column_stack((std, std, vertical))
    for name in ("v_n", "std_position_n", "std_velocity_n"):
        if name in fields and fields[name].shape != (n, 3):
            del fields[name]  # one component alone says too little
    return fields


def _reference_fields(part: Part) -> dict[str, Any] | None:
    """Return attitude and mask of a reference that stands in the log itself."""
    from strapdown.rotation import quat_from_rpy

    fields = fields_of(part)
    rpy = fields.pop("rpy", None)
    if "q_nb" not in fields and rpy is not None and rpy.shape == (len(part.t), 3):
        fields["q_nb"] = quat_from_rpy(np.where(np.isfinite(rpy), rpy, np.nan))
    if "q_nb" not in fields or fields["q_nb"].shape != (len(part.t), 4):
        return None
    fields["q_nb"] = unit_quats(fields["q_nb"], part)
    return fields


def unit_quats(q: FloatArray, part: Part) -> FloatArray:
    """Return quaternions of a text file, with few digits, at unit norm; zeros become NaN.

    Raises
    ------
    FormatError
        If a norm is further from one than three digits would leave it.
    """
    norm = np.sqrt((q * q).sum(axis=1))
    zero: BoolArray = norm == 0.0
    off = np.abs(norm - 1.0) > 0.01
    off &= ~zero
    if off.any():
        k = int(np.argmax(off))
        row = k if part.rows is None else int(part.rows[k])
        raise FormatError(
            f"a quaternion must have unit norm, got norm {norm[k]:.6g}",
            file=part.table.file,
            stream=part.group,
            row=part.table.line(row),
        )
    exact = np.abs(norm - 1.0) < 1e-15
    norm[zero] = np.nan
    return np.where(exact[:, None], q, q / norm[:, None])
