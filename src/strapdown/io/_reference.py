"""A reference from another file: its clock and its frames found from the turning of both.

A reference states the attitude ``q_ws`` of its own body s in its own world w, on its own clock.
The box turns with it, so the size of the angular rate tells the clock offset (correlation), the
rates' directions tell ``q_sb`` (least squares between vectors), and mean specific force and mean
magnetic field in w tell ``q_nw``. Then ``q_nb = q_nw * q_ws * q_sb``: the hand-eye problem with
the sensors themselves on one side. Offline.

References
----------
W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
Crystallographica A32, 1976.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from strapdown import rotation
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import FormatError
from strapdown.io._assemble import fields_of, unit_quats
from strapdown.io._clock import iso_utc, ns_of_iso
from strapdown.io._options import Options
from strapdown.io._parts import Part, split
from strapdown.io._raw import Finding, RawLog
from strapdown.io._registry import detect
from strapdown.recording import (
    AttitudeReference,
    Imu,
    PositionReference,
    Recording,
    Reference,
)
from strapdown.units import DPS

_GRID_S: Final = 0.02  # rates are compared as means over cells of this length, or longer ones
_MOST_CELLS: Final = 30_000
_CORRELATED: Final = 0.5  # below, it may be another motion
_ALIKE: Final = 0.9  # two gyroscopes on one box
_LEAST_TURNING: Final = 2.0 * DPS  # RMS
# Of the turning about the second axis, as a share of that about the first; directions of a
# single axis leave the rotation about it open.
_SECOND_AXIS: Final = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """What a reference file holds; its ``q_nb`` is ``q_ws`` unless it is of the box to NED."""

    attitude: AttitudeReference | None = None
    is_ned: bool = False
    heading: str = "arbitrary"
    position: PositionReference | None = None
    epoch_utc: str | None = None


def with_reference(
    rec: Recording, path: Path, findings: list[Finding]
) -> tuple[Recording, dict[str, Any]]:
    """Return the recording with the reference in a file, and what was estimated for it.

    Parameters
    ----------
    rec : Recording
        With an IMU.
    path : Path
        A table of times and quaternions or roll, pitch, yaw; or a log that has a reference.
    findings : list of Finding
        Where notes go.

    Returns
    -------
    Recording
        Its ``reference`` on the clock of the log, attitude of the box to NED.
    dict
        ``clock_offset_s`` (to be added to the file's times), ``q_sb`` and ``q_nw``
        (reference's body from the box, NED from its world), ``correlation`` of the rates'
        sizes and ``rate_residual_dps`` after alignment.

    Raises
    ------
    FormatError
        If the file holds no reference, or one of another motion.
    """
    found = _load(path, findings)
    shift = 0.0
    if found.epoch_utc is not None and "epoch_utc" in rec.meta:
        shift = (ns_of_iso(found.epoch_utc) - ns_of_iso(rec.meta["epoch_utc"])) * 1e-9
    facts: dict[str, Any] = {"file": str(path)}
    attitude: AttitudeReference | None = None
    heading = found.heading
    if found.attitude is not None:
        attitude, heading, shift, aligned = _aligned(
            rec, found.attitude, found, shift, path, findings
        )
        facts |= aligned
    else:
        findings.append(
            Finding(
                kind="clock",
                what="the reference has no attitude to compare clocks by, "
                + ("their dates are used" if shift else "it is taken to be on the log's clock"),
                file=str(path),
            )
        )
        facts["clock_offset_s"] = shift
    position = found.position.shifted(shift) if found.position is not None else None
    reference = Reference(attitude=attitude, position=position, heading=heading)
    return replace(rec, reference=reference), facts


def _load(path: Path, findings: list[Finding]) -> _Found:
    """Return what the file holds."""
    handler: Any = detect(path)
    if handler.NAME not in ("csv", "folder") and hasattr(handler, "read"):
        rec, _ = handler.read(path, Options())
        reference = rec.reference
        if reference is None or (reference.attitude is None and reference.position is None):
            raise FormatError("must hold a reference, it has sensors only", file=path)
        return _Found(
            attitude=reference.attitude,
            is_ned=True,
            heading=reference.heading,
            position=reference.position,
            epoch_utc=rec.meta.get("epoch_utc"),
        )
    raw: RawLog = handler.load(path, Options(context="attitude"))
    parts, origin = split(raw, Options())
    raw.require_sound()
    findings += raw.findings
    epoch = iso_utc(origin) if origin is not None else None
    by_group = {part.group: part for part in parts}
    position = _position(by_group)
    for group in ("ref_attitude", "attitude"):
        part = by_group.get(group)
        q_ws = _quats(part) if part is not None else None
        if part is not None and q_ws is not None:
            return _Found(
                attitude=AttitudeReference(t=part.t, q_nb=q_ws),
                is_ned=group == "ref_attitude",
                heading="true" if group == "ref_attitude" else "arbitrary",
                position=position,
                epoch_utc=epoch,
            )
    if position is None:
        there = [c.name for table in raw.tables for c in table.columns]
        raise FormatError(
            "a reference must hold quaternions (qw, qx, qy, qz) or roll, pitch, yaw, or a "
            f"position, found {', '.join(there)}",
            file=path,
        )
    return _Found(position=position, epoch_utc=epoch)


def _quats(part: Part) -> FloatArray | None:
    """Return the quaternions of a table, from roll, pitch and yaw if need be."""
    fields = fields_of(part)
    n = len(part.t)
    q = fields.get("q", fields.get("q_nb"))
    if q is not None and q.shape == (n, 4):
        return unit_quats(q, part)
    rpy = fields.get("rpy")
    if rpy is not None and rpy.shape == (n, 3):
        return rotation.quat_from_rpy(np.where(np.isfinite(rpy), rpy, np.nan))
    return None


def _position(by_group: Mapping[str, Part]) -> PositionReference | None:
    """Return the positions of a table."""
    part = by_group.get("ref_position") or by_group.get("gnss")
    if part is None:
        return None
    fields = fields_of(part)
    return PositionReference(
        t=part.t, lla=fields["lla"], v_n=fields.get("v_n"), valid=fields.get("valid")
    )


def _aligned(
    rec: Recording,
    given: AttitudeReference,
    found: _Found,
    shift: float,
    path: Path,
    findings: list[Finding],
) -> tuple[AttitudeReference, str, float, dict[str, Any]]:
    """Return the reference attitude of the box, its heading, the shift, and the estimates."""
    imu: Imu = rec.need("imu")
    seen: BoolArray = ~given.nan_rows()
    if given.valid is not None:
        seen &= given.valid
    t_s, q_ws = given.t[seen] + shift, given.q_nb[seen]
    steps = np.diff(t_s)
    if len(t_s) < 20 or len(imu) < 20:
        raise FormatError(f"must hold at least 20 attitudes, got {len(t_s)}", file=path)
    least = max(_GRID_S, 1.5 * float(np.median(steps)), 1.5 * float(np.median(np.diff(imu.t))))
    turning = _Turning(imu)
    # A reference that smooths agrees only in the mean of longer cells.
    trials = [(*_clock_offset(turning, t_s, q_ws, k * least, path), k * least) for k in (1, 6, 25)]
    good = [trial for trial in trials if trial[1] > _ALIKE]
    offset, correlation, cell = good[0] if good else max(trials, key=lambda trial: trial[1])
    if correlation < _CORRELATED:
        raise FormatError(
            f"must turn as the log does, its angular rate correlates by {correlation:.2f} at best",
            file=path,
            hint="give the reference of this log, with some turning in it",
        )
    offset, C_sb, residual = _refined(turning, t_s, q_ws, cell, offset, path, findings)
    q_sb = rotation.quat_from_dcm(C_sb)
    t = given.t + shift + offset
    q_wb = rotation.quat_mul(given.q_nb, q_sb)
    q_nw, heading = np.array([1.0, 0.0, 0.0, 0.0]), found.heading
    if not found.is_ned:
        q_nw, heading = _world(rec, imu, t[seen], q_wb[seen])
        if heading == "arbitrary":
            what = "without a magnetometer the heading of the reference is arbitrary"
            findings.append(Finding(kind="clock", what=what, file=str(path)))
    facts = {
        "clock_offset_s": shift + offset,
        "correlation": correlation,
        "rate_residual_dps": residual / DPS,
        "q_sb": [float(x) for x in q_sb],
        "q_nw": [float(x) for x in q_nw],
    }
    attitude = AttitudeReference(t=t, q_nb=rotation.quat_mul(q_nw, q_wb), valid=seen)
    return attitude, heading, shift + offset, facts


class _Turning:
    """Mean angular rate of the box over any interval, from the integral of its gyroscope."""

    def __init__(self, imu: Imu) -> None:
        sound = ~np.isnan(imu.gyr).any(axis=1)
        self.t, gyr = imu.t[sound], imu.gyr[sound]
        steps = np.diff(self.t, prepend=self.t[:1])[:, None]
        self._integral = np.cumsum(gyr * steps, axis=0)  # gyr[k] covers (t[k-1], t[k]]

    def rates(self, edges: FloatArray) -> FloatArray:
        """Return the mean rates between neighbouring times, shape (n - 1, 3) [rad/s]."""
        at = [np.interp(edges, self.t, self._integral[:, j]) for j in range(3)]
        return np.diff(np.column_stack(at), axis=0) / np.diff(edges)[:, None]


def _reference_rates(edges: FloatArray, t_s: FloatArray, q_ws: FloatArray) -> FloatArray:
    """Return the reference's mean rates in s between neighbouring times [rad/s]."""
    q = rotation.interpolate(np.clip(edges, t_s[0], t_s[-1]), t_s, q_ws)
    turned = rotation.quat_mul(rotation.quat_conj(q[:-1]), q[1:])
    return rotation.rotvec_from_quat(turned) / np.diff(edges)[:, None]


def _covered(edges: FloatArray, t_s: FloatArray) -> BoolArray:
    """Return for each cell whether the reference has no gap in it or beside it."""
    after = np.clip(np.searchsorted(t_s, edges), 1, len(t_s) - 1)
    steps = np.diff(t_s)
    sound = steps[after - 1] < 3.0 * float(np.median(steps))
    sound &= (edges >= t_s[0]) & (edges <= t_s[-1])
    return np.asarray(sound[1:] & sound[:-1])


def _clock_offset(
    turning: _Turning, t_s: FloatArray, q_ws: FloatArray, cell: float, path: Path
) -> tuple[float, float]:
    """Return what to add to the reference's times, to a cell, and the correlation there."""
    from scipy.signal import correlate

    def sizes(rates: FloatArray, sound: BoolArray | None = None) -> FloatArray:
        size = np.sqrt((rates * rates).sum(axis=1))
        if sound is None:
            return np.asarray(size - size.mean())
        return np.where(sound, size - size[sound].mean(), 0.0) if sound.any() else 0.0 * size

    edges_b = np.arange(turning.t[0], turning.t[-1], cell)
    edges_s = np.arange(t_s[0], t_s[-1], cell)
    if min(len(edges_b), len(edges_s)) < 20:
        raise FormatError(
            f"must overlap the log, it spans {t_s[0]:.6g} to {t_s[-1]:.6g} s", file=path
        )
    size_b = sizes(turning.rates(edges_b))
    size_s = sizes(_reference_rates(edges_s, t_s, q_ws), _covered(edges_s, t_s))
    lag = int(np.argmax(correlate(size_b, size_s, mode="full", method="fft"))) - len(size_s) + 1
    first, last = max(lag, 0), min(len(size_b), len(size_s) + lag)
    here = _covered(edges_s, t_s)[first - lag : last - lag]
    a, b = size_b[first:last][here], size_s[first - lag : last - lag][here]
    if len(a) < 20:
        return 0.0, 0.0
    scale = float(a.std() * b.std())
    correlation = float(np.mean((a - a.mean()) * (b - b.mean())) / scale) if scale > 0.0 else 0.0
    return float(edges_b[0] + lag * cell - edges_s[0]), correlation


def _refined(
    turning: _Turning,
    t_s: FloatArray,
    q_ws: FloatArray,
    cell: float,
    offset: float,
    path: Path,
    findings: list[Finding],
) -> tuple[float, FloatArray, float]:
    """Return the offset to a fraction of a cell, the alignment, and the residual [rad/s]."""
    from scipy.optimize import minimize_scalar

    margin = 2.0 * cell
    start = max(turning.t[0], t_s[0] + offset) + margin
    stop = min(turning.t[-1], t_s[-1] + offset) - margin
    edges = np.arange(start, min(stop, start + _MOST_CELLS * cell), cell)
    omega_b = turning.rates(edges)

    def fit(shift: float) -> tuple[FloatArray, float, FloatArray]:
        cells = _covered(edges - shift, t_s)
        omega_s = _reference_rates(edges - shift, t_s, q_ws)[cells]
        omega = omega_b[cells]
        u, sizes, vt = np.linalg.svd(omega_s.T @ omega)
        C_sb = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        apart = omega_s - omega @ C_sb.T
        return C_sb, float(np.sqrt((apart * apart).sum(axis=1).mean())), sizes

    best = minimize_scalar(
        lambda shift: fit(shift)[1],
        bounds=(offset - 1.5 * cell, offset + 1.5 * cell),
        method="bounded",
        options={"xatol": 1e-5},
    )
    offset = float(best.x)
    C_sb, residual, sizes = fit(offset)
    turning_rms = float(np.sqrt((omega_b * omega_b).sum(axis=1).mean()))
    if turning_rms < _LEAST_TURNING or sizes[1] < _SECOND_AXIS * sizes[0]:
        findings.append(
            Finding(
                kind="clock",
                what="the log turns too little, or about one axis only, to find how the "
                "reference is mounted: its axes are taken to be those of the box",
                file=str(path),
            )
        )
        C_sb = np.eye(3)
    return offset, C_sb, residual


def _world(rec: Recording, imu: Imu, t: FloatArray, q_wb: FloatArray) -> tuple[FloatArray, str]:
    """Return ``q_nw`` from mean specific force and field in w, and what heading then means."""
    inside = (t >= imu.t[0]) & (t <= imu.t[-1])
    t, q_wb = t[inside], q_wb[inside]
    up_w = _mean_in_world(imu.t, imu.acc, t, q_wb)
    up_w /= np.linalg.norm(up_w)
    q_nw = _least_rotation(up_w)
    if rec.mag is None or not len(rec.mag):
        return q_nw, "arbitrary"
    field_n = rotation.rotate(q_nw, _mean_in_world(rec.mag.t, rec.mag.mag, t, q_wb))
    yaw = float(np.arctan2(field_n[1], field_n[0]))
    north = rotation.quat_from_rpy([0.0, 0.0, -yaw])
    return rotation.quat_mul(north, q_nw), "magnetic"


def _mean_in_world(
    t_v: FloatArray, v_b: FloatArray, t: FloatArray, q_wb: FloatArray
) -> FloatArray:
    """Return the mean in w of a vector measured in b."""
    sound = ~np.isnan(v_b).any(axis=1)
    at = np.column_stack([np.interp(t, t_v[sound], v_b[sound, j]) for j in range(3)])
    return np.asarray(rotation.rotate(q_wb, at).mean(axis=0))


def _least_rotation(up_w: FloatArray) -> FloatArray:
    """Return the least rotation from w to a frame whose z is down; from ENU where z is up."""
    enu = up_w[2] > 0.5
    base = rotation.quat_ned_from_enu([1.0, 0.0, 0.0, 0.0]) if enu else np.array([1.0, 0, 0, 0])
    up = rotation.rotate(base, up_w)
    axis = np.cross(up, (0.0, 0.0, -1.0))
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, -up[2]))
    turn = axis / sine * angle if sine > 0.0 else np.zeros(3)
    return rotation.quat_mul(rotation.quat_from_rotvec(turn), base)
