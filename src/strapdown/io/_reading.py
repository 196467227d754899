"""`read` and `read_raw`: the way from a path to a recording."""

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import FormatError, InputError
from strapdown.io import folder
from strapdown.io._assemble import assemble
from strapdown.io._clock import ns_of_iso
from strapdown.io._options import (
    SENSOR_FILES,
    TURNED,
    Axes,
    Columns,
    Options,
    Units,
    parse_axes,
    parse_options,
)
from strapdown.io._parts import split
from strapdown.io._raw import RawLog
from strapdown.io._registry import FormatModule, detect, module
from strapdown.recording import STREAMS, Recording, Reference

_ROUNDING = 1e-9  # of a latitude at a pole [rad]: 6 mm

AnyPath = str | PathLike[str]


def read(
    path: AnyPath | None = None,
    format: str | None = None,
    *,
    columns: Columns | None = None,
    units: Units | None = None,
    axes: Axes | None = None,
    rate: float | None = None,
    start: float | None = None,
    stop: float | None = None,
    reference: AnyPath | None = None,
    repair_time: str | None = None,
    delimiter: str | None = None,
    imu: AnyPath | None = None,
    gyr: AnyPath | None = None,
    acc: AnyPath | None = None,
    mag: AnyPath | None = None,
    gnss: AnyPath | None = None,
    baro: AnyPath | None = None,
    temperature: AnyPath | None = None,
) -> Recording:
    """Return the recording in a file or folder.

    Parameters
    ----------
    path : str or path, optional
        The log. It may be left out when `imu`, or `gyr` and `acc`, are given.
    format : str, optional
        Name of a format (see `formats`); by default found out from the content.
    columns : mapping or str, optional
        What columns mean, where their names do not say so: ``{"gyr_x": "G1", "t": 0}`` or
        ``"gyr_x=G1,t=0"``. Keys are those of `ROLES`; a number counts columns from 0.
    units : mapping or str, optional
        Units of sensors, ``"gyr=dps,acc=g,time=us"``; they outrank those in the header. CSV
        columns without a unit are read as SI, with a note, unless their size contradicts it.
    axes : str or mapping, optional
        Axes of the file that become x, y and z: ``"x,-y,-z"`` for the whole box, the reference
        and the mount with it, or ``"mag=y,x,-z"`` for one sensor.
    rate : float, optional
        Samples per second [Hz], where there is no column of times; outranks one.
    start, stop : float, optional
        Only samples with ``start <= t < stop`` [s].
    reference : str or path, optional
        File with a reference attitude, or another log; its clock offset and its two constant
        alignments are estimated and told in ``rec.meta["reference"]``.
    repair_time : {'drop', 'sort'}, optional
        What to do where times repeat or go back: leave those samples out, or sort. By default
        that is an error.
    delimiter : str, optional
        What separates columns of text; by default found out.
    imu, gyr, acc, mag, gnss, baro, temperature : str or path, optional
        A file for one sensor; it outranks that sensor in `path`.

    Returns
    -------
    Recording
        SI, axes as recorded. ``meta["source"]`` and ``meta["format"]`` tell where it is from,
        ``meta["notes"]`` what was noticed; of a native Parquet file, all is as it was written.

    Raises
    ------
    FormatError
        If there is no such file, or it holds no sound recording; the message says what, where
        and the way out.
    InputError
        If an option cannot be understood.
    ValueError
        If an option is out of range.
    """
    options = parse_options(
        columns=columns,
        units=units,
        rate=rate,
        repair_time=repair_time,
        delimiter=delimiter,
        files={"imu": imu, "gyr": gyr, "acc": acc, "mag": mag, "gnss": gnss, "baro": baro,
               "temperature": temperature},
    )  # fmt: skip
    turns = parse_axes(axes) if axes is not None else {}
    window = _window(start, stop)
    rec, raw = _read_all(path, format, options)
    _on_the_earth(rec, raw.file)
    if turns:
        rec = _turned(rec, turns)
    meta = dict(rec.meta)
    if reference is not None:
        from strapdown.io._reference import with_reference

        # Before the cut: the longer both are, the better their clocks can be compared.
        rec, meta["reference"] = with_reference(rec, Path(reference), raw.findings)
    if start is not None or stop is not None:
        rec = rec.between(*window)
        if all(len(stream) == 0 for _, stream in rec.streams()):
            raise FormatError(
                f"no sample lies between {window[0]:g} and {window[1]:g} s", file=raw.file
            )
    if notes := raw.notes():
        meta["notes"] = notes
    return replace(rec, meta=meta)


def read_raw(
    path: AnyPath,
    format: str | None = None,
    *,
    columns: Columns | None = None,
    units: Units | None = None,
    rate: float | None = None,
    delimiter: str | None = None,
) -> RawLog:
    """Return a file's columns and what was noticed in them, without judging.

    Parameters
    ----------
    path : str or path
        The log.
    format, columns, units, rate, delimiter
        As in `read`.

    Returns
    -------
    RawLog
        Columns as they stand in the file, units unconverted, those of unknown meaning among
        them. Its findings hold the faults for which `read` would refuse the log.

    Raises
    ------
    FormatError
        If there is no such file, or nothing in it can be read.
    """
    options = parse_options(
        columns=columns, units=units, rate=rate, delimiter=delimiter, everything=True
    )
    target = Path(path)
    handler = module(format) if format is not None else detect(target)
    _check_takes(handler, options)
    raw: RawLog = _guarded(handler.load, target, options)
    if all(table.stream is None for table in raw.tables):
        split(raw, options)
    return raw


def _on_the_earth(rec: Recording, file: Any) -> None:
    """Refuse positions beyond the poles."""
    theirs = rec.reference.position if rec.reference is not None else None
    for name, stream in (("gnss", rec.gnss), ("reference.position", theirs)):
        if stream is None:
            continue
        beyond = np.flatnonzero(np.abs(stream.lla[:, 0]) > np.pi / 2 + _ROUNDING)
        if len(beyond):
            raise FormatError(
                "latitude must lie between -90 and 90 deg, got "
                f"{np.degrees(stream.lla[beyond[0], 0]):.6g} deg",
                file=file,
                stream=name,
                row=int(beyond[0]),
                hint="check that latitude and longitude are not swapped and which unit they "
                "have, or leave the row out",
            )


def _guarded(function: Any, path: Path, options: Options) -> Any:
    """Call a format; turn what the system refuses into an error that names the path."""
    from strapdown.io._text import unreadable

    try:
        return function(path, options)
    except OSError as error:
        raise unreadable(path, error) from None
    except MemoryError:
        raise FormatError("does not fit into memory", file=path) from None


def _check_takes(handler: FormatModule, options: Options) -> None:
    """Refuse options that a format has no use for."""
    for name in ("columns", "units", "rate", "delimiter"):
        if getattr(options, name) and name not in handler.TAKES:
            raise InputError(
                f"the format {handler.NAME} takes no option `{name}`; it states all of it itself."
            )


def _read_all(
    path: AnyPath | None, format: str | None, options: Options
) -> tuple[Recording, RawLog]:
    """Return the recording in the path, or in the files of single sensors, or in both."""
    if path is None:
        if not options.files:
            raise InputError("`path` must name a log, or a file must be given for each sensor.")
        first = next(iter(options.files.values()))
        raw = RawLog(format="folder", file=str(first), meta={"name": first.stem})
        return _from_files(raw, options), raw
    target = Path(path)
    handler = module(format) if format is not None else detect(target)
    if format is not None and not target.exists():
        detect(target)  # says that there is no such file
    _check_takes(handler, options)
    if options.files and handler.NAME in ("csv", "folder"):
        raw = _guarded(handler.load, target, options)
        for table in raw.tables:  # what is given apart outranks what is there
            for column in table.columns:
                if column.role is not None and _group_given(column.role, options):
                    column.role = None
        rec = _from_files(raw, options)
    elif hasattr(handler, "read"):
        rec, raw = _guarded(handler.read, target, options)
        if options.files:
            extra = RawLog(format="folder", file=str(target))
            rec = _joined(rec, _from_files(extra, options))
            raw.findings += extra.findings
    else:
        raw = _guarded(handler.load, target, options)
        rec = assemble(raw, options)
    if handler.NAME == "parquet" and not raw.tables:
        return rec, raw  # written by this package: what it says of itself stands
    meta = {"source": str(path), "format": handler.NAME, **rec.meta}
    return replace(rec, meta=meta), raw


def _group_given(role: str, options: Options) -> bool:
    from strapdown.io._roles import ROLES

    group = ROLES[role].group
    return group in options.files or (group in ("gyr", "acc") and "imu" in options.files)


def _from_files(raw: RawLog, options: Options) -> Recording:
    """Return the recording of the raw tables and the files of single sensors."""
    others: list[tuple[str, Recording]] = []
    texts: list[tuple[str, Path]] = []
    for name in SENSOR_FILES:
        if name not in options.files:
            continue
        file = options.files[name]
        handler = detect(file)
        if handler.NAME == "csv":
            texts.append((name, file))
        else:
            rec, _ = _read_all(file, None, replace(options, files={}))
            others.append((name, rec))
    tables, findings = folder.load_files(texts, options)
    raw.findings += findings
    raw.tables += tables
    rec = assemble(raw, options) if raw.tables else Recording(meta=raw.meta)
    for name, other in others:
        if name not in STREAMS:
            raise InputError(f"`{name}` must be a text file; give imu= for other formats.")
        part = Recording(**{name: other.need(name)}, meta=other.meta)
        rec = _joined(rec, part) if any(True for _ in rec.streams()) else part
    return rec


def _joined(rec: Recording, other: Recording) -> Recording:
    """Return a recording with the streams of another in their places, on its clock."""
    shift = 0.0
    if "epoch_utc" in rec.meta and "epoch_utc" in other.meta:
        apart = ns_of_iso(other.meta["epoch_utc"]) - ns_of_iso(rec.meta["epoch_utc"])
        shift = apart * 1e-9
    streams: dict[str, Any] = {
        name: stream.shifted(shift) if shift else stream for name, stream in other.streams()
    }
    return replace(rec, **streams)


def _window(start: float | None, stop: float | None) -> tuple[float, float]:
    """Return the limits of time, infinite where not given."""
    low = -np.inf if start is None else _checks.finite("start", start)
    high = np.inf if stop is None else _checks.finite("stop", stop)
    if not low < high:
        raise InputError(f"`start` must be before `stop`, got {low:g} and {high:g}.")
    return float(low), float(high)


def _turned(rec: Recording, turns: dict[str, FloatArray]) -> Recording:
    """Return the recording in other axes of the box, or of single sensors."""
    from strapdown.rotation import quat_from_dcm, quat_mul

    box = turns.get("box")
    C = turns if box is None else dict.fromkeys(TURNED, box)
    parts: dict[str, Any] = {}
    if rec.imu is not None:
        changed = {n: getattr(rec.imu, n) @ C[n].T for n in ("gyr", "acc") if n in C}
        parts["imu"] = replace(rec.imu, **changed)
    if rec.mag is not None and "mag" in C:
        parts["mag"] = replace(rec.mag, mag=rec.mag.mag @ C["mag"].T)
    if box is not None:
        q_old_new = quat_from_dcm(box.T)
        if rec.star is not None:
            parts["star"] = replace(rec.star, q_nb=quat_mul(rec.star.q_nb, q_old_new))
        if rec.reference is not None:
            parts["reference"] = _turned_reference(rec.reference, q_old_new)
    return replace(rec, **parts)


def _turned_reference(reference: Reference, q_old_new: FloatArray) -> Reference:
    """Return the reference of the box in its new axes."""
    from strapdown.rotation import quat_mul

    parts: dict[str, Any] = {}
    if reference.attitude is not None:
        q_nb = quat_mul(reference.attitude.q_nb, q_old_new)
        parts["attitude"] = replace(reference.attitude, q_nb=q_nb)
    if reference.mount is not None:
        parts["mount"] = replace(reference.mount, q_vb=quat_mul(reference.mount.q_vb, q_old_new))
    return replace(reference, **parts)
