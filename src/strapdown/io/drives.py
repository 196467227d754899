"""Road drives: a folder with manifest.json and a gzipped CSV file for each sensor.

``imu`` [rad/s, m/s^2, axes of the box as mounted], ``gnss`` fixes, and a better receiver's fused
``reference_position``, ``reference_attitude`` of the vehicle, and ``reference_mount``. The
reference attitude of a recording is the box's: ``q_nb = q_nv * q_vb``, with
``C_vb = diag(1, -1, -1) Rzyx(yaw, pitch, roll)`` of the mount at that time.

What of the reference counts is found from the data (`_valid_position`, `_valid_attitude`): it
is another receiver's estimate, with an alignment phase and glitches of its own.
"""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.errors import FormatError
from strapdown.io._assemble import assemble
from strapdown.io._clock import advancing
from strapdown.io._options import Options
from strapdown.io._raw import Column, Finding, RawLog, Table, stacked
from strapdown.io._text import unreadable
from strapdown.io.csv import load_table
from strapdown.recording import (
    AttitudeReference,
    Gnss,
    Imu,
    MountReference,
    PositionReference,
    Recording,
    Reference,
)

NAME: Final = "drives"
DESCRIPTION: Final = "a folder with manifest.json and csv.gz files: imu, gnss, reference"
SUFFIXES: Final[tuple[str, ...]] = ()
TAKES: Final[frozenset[str]] = frozenset()

MANIFEST: Final = "manifest.json"

# Where the reference position is a glitch: this far from a fix, or this unlike its velocity.
_GLITCH_M: Final = 8.0
_GLITCH_SIGMAS: Final = 4.0
_GLITCH_M_S: Final = 6.0
_GAP_S: Final = 0.5
_MARGIN_S: Final = 3.0  # left out before and after each glitch and gap
_ONE_GLITCH_S: Final = 10.0  # what is less apart is one: its worst part may lack fixes
# A road vehicle gains at most 30 m/s in this time, which tilts the mean specific force by 6 deg.
_TILT_WINDOW_S: Final = 30.0
_TILT_MAX_RAD: Final = np.deg2rad(10.0)


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether the path is a folder with a manifest."""
    return path.is_dir() and (path / MANIFEST).is_file()


def load(path: Path, options: Options) -> RawLog:
    """Return the columns of the files that the manifest names, a table for each."""
    manifest = _manifest(path)
    raw = RawLog(format=NAME, file=str(path))
    raw.meta["name"] = str(manifest.get("dataset_id") or path.name)
    for key in ("title", "description"):
        if isinstance(manifest.get(key), str):
            raw.meta[key] = manifest[key]
    for name, entry in manifest["files"].items():
        file = path / str(entry["path"])
        table = load_table(file, Options(everything=True), raw.findings)
        table.stream = str(name)
        expected = entry.get("rows")
        if table.columns and isinstance(expected, int) and len(table) != expected:
            raw.findings.append(
                Finding(
                    kind="row",
                    what=f"the manifest promises {expected} rows, found {len(table)}",
                    fault=True,
                    file=str(file),
                    hint="copy the folder again",
                )
            )
        raw.tables.append(table)
    return raw


def _manifest(path: Path) -> dict[str, Any]:
    """Return the manifest, its list of files checked."""
    file = path / MANIFEST
    try:
        manifest: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreadable(file, error) from None
    except ValueError as error:
        raise FormatError(f"must be JSON ({error})", file=file) from None
    files = manifest.get("files") if isinstance(manifest, dict) else None
    if not isinstance(files, dict) or not all(
        isinstance(entry, dict) and isinstance(entry.get("path"), str) for entry in files.values()
    ):
        raise FormatError('must list the files as "files": {"imu": {"path": ...}}', file=file)
    if "imu" not in files:
        raise FormatError(f"must list imu, found {', '.join(files) or 'nothing'}", file=file)
    return manifest


def read(path: Path, options: Options) -> tuple[Recording, RawLog]:
    """Return a drive.

    Raises
    ------
    FormatError
        If a file is missing, damaged, or lacks columns.
    """
    raw = load(path, options)
    raw.require_sound()
    tables = {table.stream: table for table in raw.tables}
    sensors = [tables[name] for name in ("imu", "gnss") if name in tables]
    inner = RawLog(format=NAME, file=raw.file, tables=sensors, meta=raw.meta)
    rec = assemble(inner, options)
    raw.findings += inner.findings
    if rec.imu is None:
        raise FormatError("must hold gyroscope and accelerometer", file=path, stream="imu")
    position = _position(tables.get("reference_position"), rec.gnss, options, raw)
    mount = _mount(tables.get("reference_mount"), options, raw)
    attitude = _attitude(tables.get("reference_attitude"), mount, options, raw)
    if attitude is not None:
        attitude = _valid_attitude(attitude, position, rec.imu, raw)
    if position is None and attitude is None:
        return rec, raw
    reference = Reference(attitude=attitude, position=position, mount=mount, heading="true")
    return (
        Recording(imu=rec.imu, gnss=rec.gnss, reference=reference, meta=dict(rec.meta)),
        raw,
    )


def _samples(
    table: Table, names: tuple[str, ...], options: Options, raw: RawLog
) -> tuple[FloatArray, FloatArray]:
    """Return times and the named columns in SI."""
    columns: list[Column] = []
    for name in ("t_s", *names):
        column = table.by_name(name)
        if column is None:
            there = ", ".join(c.name for c in table.columns)
            raise FormatError(f"must have the column {name}, found {there}", file=table.file)
        columns.append(column)
    t = np.asarray(columns[0].values, dtype=np.float64)
    order = advancing(
        t,
        repair=options.repair_time,
        file=table.file,
        stream=table.stream or "",
        line=table.line,
        findings=raw.findings,
    )
    raw.require_sound()
    values = stacked(columns[1:], order)
    return t if order is None else t[order], values


def _rpy(table: Table, options: Options, raw: RawLog) -> tuple[FloatArray, FloatArray]:
    """Return times and roll, pitch, yaw [rad]."""
    t, rpy = _samples(table, ("roll_deg", "pitch_deg", "yaw_deg"), options, raw)
    return t, np.where(np.isfinite(rpy), rpy, np.nan)


def _stated(rpy: FloatArray) -> BoolArray:
    """Return where the angles are known: before it knows any, the reference writes zeros."""
    return np.asarray(np.isfinite(rpy).all(axis=1) & (rpy != 0.0).any(axis=1))


def _position(
    table: Table | None, gnss: Gnss | None, options: Options, raw: RawLog
) -> PositionReference | None:
    """Return the reference position, with its mask."""
    if table is None or not table.columns:
        return None
    t, lla = _samples(table, ("lat_deg", "lon_deg", "height_m"), options, raw)
    _, v_n = _samples(table, ("vn_mps", "ve_mps", "vd_mps"), options, raw)
    valid = np.ones(len(t), np.bool_) if gnss is None else _valid_position(t, lla, v_n, gnss)
    lost = int(np.count_nonzero(~valid))
    if lost:
        what = f"{lost} of {len(t)} samples contradict the fixes or stand beside a gap: not valid"
        raw.findings.append(
            Finding(kind="nan", what=what, file=raw.file, stream="reference.position")
        )
    return PositionReference(t=t, lla=lla, v_n=v_n, valid=valid)


def _valid_position(t: FloatArray, lla: FloatArray, v_n: FloatArray, gnss: Gnss) -> BoolArray:
    """Return where the reference position is no glitch.

    A glitch is where it is farther than max(8 m, 4 sigma) from a fix, or its velocity differs
    by more than 6 m/s, or its own samples have a gap of more than 0.5 s; 3 s before and after
    are left out too. Receivers share their outages, so the fixes alone cannot vouch for both.
    """
    from strapdown.earth import ned_from_lla

    valid = np.ones(len(t), dtype=np.bool_)
    common = (gnss.t >= t[0]) & (gnss.t <= t[-1]) & ~np.isnan(gnss.lla).any(axis=1)
    at = gnss.t[common]
    if len(at):
        here = np.column_stack([np.interp(at, t, lla[:, j]) for j in range(3)])
        apart = ned_from_lla(gnss.lla[common], lla[0]) - ned_from_lla(here, lla[0])
        limit = np.full((len(at), 1), _GLITCH_M)
        if gnss.std_position_n is not None:
            sigma = gnss.std_position_n[common].max(axis=1, keepdims=True)
            limit = np.maximum(limit, _GLITCH_SIGMAS * np.nan_to_num(sigma))
        bad = np.linalg.norm(apart, axis=1) > limit[:, 0]
        if gnss.v_n is not None:
            v_here = np.column_stack([np.interp(at, t, v_n[:, j]) for j in range(3)])
            bad |= np.linalg.norm(gnss.v_n[common] - v_here, axis=1) > _GLITCH_M_S
        _leave_out(valid, t, at[bad], at[bad])
    gaps = np.flatnonzero(np.diff(t) > _GAP_S)
    _leave_out(valid, t, t[gaps], t[gaps + 1])
    return valid


def _leave_out(valid: BoolArray, t: FloatArray, starts: FloatArray, stops: FloatArray) -> None:
    """Clear the mask from before each start until after each stop, and between near ones."""
    near = np.flatnonzero(starts[1:] - stops[:-1] < _ONE_GLITCH_S)
    starts = np.concatenate((starts, stops[near]))
    stops = np.concatenate((stops, starts[near + 1]))
    low = np.searchsorted(t, starts - _MARGIN_S, side="left")
    high = np.searchsorted(t, stops + _MARGIN_S, side="right")
    for first, last in zip(low, high, strict=True):
        valid[first:last] = False


def _mount(table: Table | None, options: Options, raw: RawLog) -> MountReference | None:
    """Return the mount, valid from where it is not zero."""
    from strapdown.rotation import dcm_from_rpy, quat_from_dcm

    if table is None or not table.columns:
        return None
    t, rpy = _rpy(table, options, raw)
    C_vb = np.diag([1.0, -1.0, -1.0]) @ dcm_from_rpy(rpy)
    return MountReference(t=t, q_vb=quat_from_dcm(C_vb), valid=_stated(rpy))


def _attitude(
    table: Table | None, mount: MountReference | None, options: Options, raw: RawLog
) -> AttitudeReference | None:
    """Return the attitude of the box: that of the vehicle after the mount at each time."""
    from strapdown.rotation import interpolate, quat_from_rpy, quat_mul

    if table is None or not table.columns or mount is None or mount.valid is None:
        return None
    t, rpy = _rpy(table, options, raw)
    known = mount.valid
    if not known.any():
        what = "the mount never appears, there is no reference attitude of the box"
        raw.findings.append(
            Finding(kind="empty", what=what, file=raw.file, stream="reference.mount")
        )
        return None
    t_known, q_known = mount.t[known], mount.q_vb[known]
    # The mount is constant but for its estimate's progress: its ends are held.
    q_vb = interpolate(np.clip(t, t_known[0], t_known[-1]), t_known, q_known)
    q_nb = quat_mul(quat_from_rpy(rpy), q_vb)
    valid = _stated(rpy) & (t >= t_known[0])
    return AttitudeReference(t=t, q_nb=q_nb, valid=valid)


def _valid_attitude(
    attitude: AttitudeReference, position: PositionReference | None, imu: Imu, raw: RawLog
) -> AttitudeReference:
    """Return the attitude without its glitches and without what gravity contradicts.

    The receiver states a mount long before it has found it. While that is wrong, the box's
    attitude is too, and the mean specific force of half a minute does not point up.
    """
    valid = attitude.valid if attitude.valid is not None else np.ones(len(attitude), np.bool_)
    stated = int(np.count_nonzero(valid))
    if position is not None and position.valid is not None:
        nearest = np.clip(np.searchsorted(position.t, attitude.t), 0, len(position) - 1)
        valid = valid & position.valid[nearest]
    valid = valid & (_tilt(attitude, imu) < _TILT_MAX_RAD)
    lost = stated - int(np.count_nonzero(valid))
    if lost:
        what = (
            f"{lost} of {stated} samples are not valid: glitches of the position, "
            "or a mount that gravity contradicts"
        )
        raw.findings.append(
            Finding(kind="nan", what=what, file=raw.file, stream="reference.attitude")
        )
    return AttitudeReference(t=attitude.t, q_nb=attitude.q_nb, valid=valid)


def _tilt(attitude: AttitudeReference, imu: Imu) -> FloatArray:
    """Return the angle between up and the mean specific force around each time [rad]."""
    from strapdown.rotation import rotate

    # Mean over each reference interval, then turned to n, then the mean over the window.
    sound = ~np.isnan(imu.acc).any(axis=1)
    t_acc, acc = imu.t[sound], imu.acc[sound]
    sums = np.concatenate((np.zeros((1, 3)), np.cumsum(acc, axis=0)))
    edges = np.searchsorted(t_acc, attitude.t)
    low = np.concatenate((edges[:1], edges[:-1]))
    count = np.maximum(edges - low, 1)[:, None]
    f_n = rotate(attitude.q_nb, (sums[edges] - sums[low]) / count)
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(np.nan_to_num(f_n), axis=0)))
    first = np.searchsorted(attitude.t, attitude.t - 0.5 * _TILT_WINDOW_S, side="left")
    last = np.searchsorted(attitude.t, attitude.t + 0.5 * _TILT_WINDOW_S, side="right")
    mean = total[last] - total[first]
    return np.arctan2(np.hypot(mean[:, 0], mean[:, 1]), -mean[:, 2])
