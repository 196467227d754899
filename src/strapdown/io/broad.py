"""Trials of BROAD, the Berlin Robust Orientation Estimation Assessment Dataset.

A trial is a MATLAB file of version 5 or 7.3, or an HDF5 file, with ``imu_gyr`` [rad/s],
``imu_acc`` [m/s^2], ``imu_mag`` [uT], ``opt_quat`` (sensor to ENU, scalar first), ``movement``
and ``sampling_rate`` [Hz]. The optical reference's north is the local magnetic one.

References
----------
D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation
Estimation", Data 6(7):72, 2021.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.errors import FormatError
from strapdown.io._options import Options
from strapdown.io._raw import Column, Finding, RawLog, Table
from strapdown.io._text import unreadable
from strapdown.recording import AttitudeReference, Imu, Mag, Recording, Reference
from strapdown.units import UT, Unit, parse_unit

NAME: Final = "broad"
DESCRIPTION: Final = "trials of the BROAD benchmark, .mat (5 and 7.3) and .hdf5"
SUFFIXES: Final = (".mat", ".hdf5", ".h5")
TAKES: Final[frozenset[str]] = frozenset()

_MATLAB_5: Final = b"MATLAB 5.0 MAT-file"
_MATLAB_7: Final = b"MATLAB 7.3 MAT-file"
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_WIDTHS: Final = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4, "movement": 1}
_NEEDED: Final = ("imu_gyr", "imu_acc", "sampling_rate")
_UNITS: Final = {"imu_gyr": "rad_s", "imu_acc": "m_s2", "imu_mag": "ut"}


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether the file is MATLAB's or HDF5."""
    return head.startswith((_MATLAB_5, _MATLAB_7, _HDF5))


def load(path: Path, options: Options) -> RawLog:
    """Return the variables of a trial as columns, a table for each."""
    arrays = _arrays(path)
    raw = RawLog(format=NAME, file=str(path), meta=_meta(path, arrays))
    for name, array in arrays.items():
        if name not in _WIDTHS:
            continue
        unit: Unit | None = parse_unit(_UNITS[name]) if name in _UNITS else None
        columns = [
            Column(name=f"{name}[{j}]", values=array[:, j], unit=unit)
            for j in range(array.shape[1])
        ]
        raw.tables.append(Table(file=str(path), columns=columns, stream=name))
    return raw


def read(path: Path, options: Options) -> tuple[Recording, RawLog]:
    """Return a trial.

    Raises
    ------
    FormatError
        If the file is damaged, or is no trial of BROAD.
    """
    from strapdown.rotation import quat_ned_from_enu

    arrays = _arrays(path)
    raw = RawLog(format=NAME, file=str(path), meta=_meta(path, arrays))
    rate = float(arrays["sampling_rate"].flat[0])
    n = len(arrays["imu_gyr"])
    t = np.arange(n) / rate
    for name in ("imu_gyr", "imu_acc", "imu_mag"):
        if name in arrays and n and np.isnan(arrays[name]).all():
            raise FormatError(
                f"a sensor must have numbers, all {n} are NaN", file=path, stream=name
            )
    reference: Reference | None = None
    try:
        imu = Imu(t=t, gyr=arrays["imu_gyr"], acc=arrays["imu_acc"])
        mag = Mag(t=t, mag=arrays["imu_mag"] * UT) if "imu_mag" in arrays else None
        if "opt_quat" in arrays:
            q_nb = quat_ned_from_enu(arrays["opt_quat"])
            seen: BoolArray = np.asarray(np.isfinite(q_nb).all(axis=1))
            lost = int(np.count_nonzero(~seen))
            if lost:
                what = f"the optical reference is lost in {lost} of {n} samples"
                raw.findings.append(
                    Finding(kind="nan", what=what, file=str(path), stream="opt_quat")
                )
            if "movement" in arrays:
                seen &= arrays["movement"][:, 0] != 0
            reference = Reference(
                attitude=AttitudeReference(t=t, q_nb=q_nb, valid=seen), heading="magnetic"
            )
    except ValueError as error:
        raise FormatError(str(error), file=path) from None
    return Recording(imu=imu, mag=mag, reference=reference, meta=raw.meta), raw


def _meta(path: Path, arrays: dict[str, Any]) -> dict[str, Any]:
    rate = float(arrays["sampling_rate"].flat[0])
    return {"name": path.stem, "dataset": "BROAD", "sampling_rate_hz": rate}


def _arrays(path: Path) -> dict[str, Any]:
    """Return the variables, checked, samples along the first axis."""
    try:
        with path.open("rb") as stream:
            head = stream.read(32)
    except OSError as error:
        raise unreadable(path, error) from None
    names = [*_WIDTHS, "sampling_rate"]
    found = (
        _from_matlab_5(path, names)
        if head.startswith(_MATLAB_5)
        else _from_hdf5(path, names, transposed=head.startswith(_MATLAB_7))
    )
    there = found.pop("", [])
    for name in _NEEDED:
        if name not in found:
            raise FormatError(
                f"a trial of BROAD must hold {name}, found "
                + (", ".join(sorted(there)) or "nothing"),
                file=path,
                hint="export other data as CSV",
            )
    rate = found["sampling_rate"]
    if rate.size != 1 or not (np.isfinite(rate).all() and rate.flat[0] > 0.0):
        raise FormatError("sampling_rate must be one positive number", file=path)
    n = len(found["imu_gyr"])
    if n == 0:
        raise FormatError("imu_gyr must hold samples, it is empty", file=path)
    for name, width in _WIDTHS.items():
        if name not in found:
            continue
        if width == 1 and found[name].size == n:
            found[name] = found[name].reshape(n, 1)
        if found[name].shape != (n, width):
            raise FormatError(
                f"{name} must have shape ({n}, {width}) like imu_gyr, got {found[name].shape}",
                file=path,
            )
    return found


def _from_matlab_5(path: Path, names: Iterable[str]) -> dict[str, Any]:
    """Return variables of a MATLAB 5 file, and all its names under the empty key."""
    from scipy.io import loadmat, whosmat

    try:
        found: dict[str, Any] = loadmat(path, variable_names=list(names))
        there = [] if set(_NEEDED) <= set(found) else [entry[0] for entry in whosmat(path)]
    except Exception as error:  # a damaged file makes it raise anything, TypeError to zlib.error
        raise _damaged(path, "MATLAB", error) from None
    arrays = {name: _floats(path, name, a) for name, a in found.items() if name[:2] != "__"}
    return {**arrays, "": there}


def _from_hdf5(path: Path, names: Iterable[str], *, transposed: bool) -> dict[str, Any]:
    """Return datasets or attributes of an HDF5 file; MATLAB stores them transposed."""
    import h5py

    arrays: dict[str, Any] = {}
    try:
        with h5py.File(path, "r") as file:
            there = [str(name) for name in (*file, *file.attrs)]
            for name in names:
                if name in file:
                    value = np.asarray(file[name][()])
                elif name in file.attrs:
                    value = np.asarray(file.attrs[name])
                else:
                    continue
                arrays[name] = _floats(path, name, value.T if transposed else value)
    except FormatError:
        raise
    except Exception as error:  # a damaged file makes it raise anything, KeyError to RuntimeError
        raise _damaged(path, "HDF5", error) from None
    return {**arrays, "": there}


def _floats(path: Path, name: str, value: Any) -> FloatArray:
    """Return a variable as numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise FormatError(f"{name} must hold numbers, got {array.dtype}", file=path)
    if array.ndim == 1 and name != "sampling_rate":
        array = array.reshape(-1, 1)
    return np.ascontiguousarray(array, dtype=np.float64)


def _damaged(path: Path, kind: str, error: BaseException) -> FormatError:
    text = str(error).splitlines()
    return FormatError(
        f"the {kind} file is cut off or damaged ({text[0] if text else type(error).__name__})",
        file=path,
        hint="copy it again",
    )
