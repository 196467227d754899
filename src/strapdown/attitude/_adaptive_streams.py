"""What enters thesis E's system besides the IMU, and the rows of diagnostics that leave it."""

import math
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.kernels import memory as _m
from strapdown.kernels import status as _s
from strapdown.recording import Recording
from strapdown.solution import Diagnostics

_AXES: Final = ("north", "east", "down")


def events(rec: Recording) -> FloatArray:
    """Return fixes and temperatures as rows for `load_events`, in order of time."""
    from strapdown.kernels.gnssins import layout as k

    parts = []
    if rec.gnss is not None:
        fixes = rec.gnss
        e = np.full((len(fixes), 17), np.nan)
        e[:, 0] = e[:, 3] = fixes.t
        e[:, 1:3] = _m.GNSS, 14
        e[:, 4:7] = fixes.lla
        for at, value in (
            (7, fixes.v_n), (10, fixes.std_position_n), (13, fixes.std_velocity_n),
        ):  # fmt: skip
            if value is not None:
                e[:, at : at + 3] = value
        parts.append(e)
    if rec.temperature is not None:
        warm = rec.temperature
        known = np.isfinite(warm.temp_degc)
        e = np.zeros((int(known.sum()), 17))
        e[:, 0] = warm.t[known]
        e[:, 1:3] = k.TEMP, 1
        e[:, 3] = warm.temp_degc[known]
        parts.append(e)
    if not parts:
        return np.empty((0, 17))
    rows = np.concatenate(parts)
    return np.ascontiguousarray(rows[np.argsort(rows[:, 0], kind="stable")])


def most_rows(t: FloatArray, before: float, period: float, events: int) -> int:
    """Return how many rows of diagnostics there may be: runs of the filter, and fixes."""
    if not len(t):
        return 0
    start = float(t[0]) if math.isnan(before) else before
    # the timer runs out half a sample early
    return min(len(t), 2 + math.ceil(2.0 * (float(t[-1]) - start) / period)) + events


def rows_of(diag: FloatArray) -> dict[str, Diagnostics]:
    """Return residuals of attitude and fixes, and what the Control Unit decided."""
    from strapdown.kernels.gnssins import layout as k

    found: dict[str, Diagnostics] = {}
    diag = diag[~np.isnan(diag[:, 0])]
    for name, first, factor, labels, unit in (
        ("attitude", 1, 2.0, _AXES, "rad"),
        ("gnss_position", 1 + k.N_ROW, 1.0, _AXES, "m"),
        ("gnss_velocity", 8 + k.N_ROW, 1.0, _AXES, "m/s"),
    ):
        code = diag[:, first + 6]
        rows = np.flatnonzero(~np.isnan(code) & (code != _s.NOT_MEASURED))
        if len(rows):
            found[name] = Diagnostics(
                t=diag[rows, 0],
                innovation=factor * diag[rows, first : first + 3],
                sigma=factor * diag[rows, first + 3 : first + 6],
                outcome=code[rows].astype(np.int64),
                labels=labels,
                unit=unit,
            )
    rows = np.flatnonzero(~np.isnan(diag[:, 8]))
    if len(rows):
        values = diag[rows, 8:12]
        found["control_unit"] = Diagnostics(
            t=diag[rows, 0],
            innovation=values,
            sigma=np.full_like(values, np.nan),
            outcome=diag[rows, 7].astype(np.int64),
            labels=("mode", "reset", "gauss_newton", "r"),
        )
    return found
