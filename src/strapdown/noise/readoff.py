"""Noise coefficients read off the slopes of an Allan deviation curve, as in [1]_ section 5.2.

A line of the slope of a term is laid through the part of the curve that has this slope, and
read at the term's own averaging time:

====  =====  ==================  ==============================
term  slope  read at             formula in [1]_
====  =====  ==================  ==============================
Q     -1     ``sqrt(3)`` s       (5.8)  ``Q = tau sigma / sqrt(3)``
N     -1/2   1 s                 (5.9)  ``N = sigma sqrt(tau)``
B     0      the lowest point    (5.11) ``B = sigma / 0.664``
K     +1/2   3 s                 (5.12) ``K = sigma sqrt(3 / tau)``
R     +1     ``sqrt(2)`` s       IEEE Std 952
====  =====  ==================  ==============================

Where no part of the curve has the slope, the term is not observable by this method. Neighbouring
terms add to what is read: at the lowest point white noise and random walk usually raise B by
half or more. `strapdown.noise.identify` takes them apart.

References
----------
.. [1] Thesis A (three-axis platform), section 5.2.
"""

import math
from typing import Final

import numpy as np

from strapdown._checks import instance
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.noise.allan import AllanDeviation, local_slope
from strapdown.noise.coefficients import (
    FLOOR,
    NAMES,
    READ_AT,
    SLOPES,
    Coefficient,
    Coefficients,
    Status,
)

_TOLERANCE: Final = 0.1  # of a slope
_LEAST_SPAN: Final = 2.0  # ratio of the times over which a slope must hold
_RISE: Final = 1.1  # after a lowest point, that makes it one
_LEAST_EDF: Final = 8.0  # fewer, and a slope is chance


def read_off(curve: AllanDeviation) -> Coefficients:
    """Read noise coefficients off a curve.

    Parameters
    ----------
    curve : AllanDeviation
        Of kind ``adev``, ``oadev`` or ``totdev``, with several times per octave.

    Returns
    -------
    Coefficients
        With ``method="read-off"``. Standard deviations come from the degrees of freedom of
        the points used; they do not hold what neighbouring terms add.

    Raises
    ------
    ValueError
        If the curve is of another kind, whose levels differ.
    """
    instance("curve", curve, AllanDeviation)
    if curve.kind not in ("adev", "oadev", "totdev"):
        raise ValueError(
            f"`curve` must be of kind adev, oadev or totdev, got {curve.kind!r}, "
            "whose levels are others."
        )
    slope = local_slope(curve.tau, curve.dev)
    sure = curve.edf >= _LEAST_EDF
    return Coefficients(
        Q=_line("Q", curve, slope, sure),
        N=_line("N", curve, slope, sure),
        B=_floor(curve, slope, sure),
        K=_line("K", curve, slope, sure),
        R=_line("R", curve, slope, sure),
        method="read-off",
        fs=curve.fs,
        duration=curve.duration,
        tau_min=float(curve.tau[0]),
    )


def _line(symbol: str, curve: AllanDeviation, slope: FloatArray, sure: BoolArray) -> Coefficient:
    """Return a term read where the curve has its slope."""
    rows = _longest_run((np.abs(slope - SLOPES[symbol]) <= _TOLERANCE) & sure)
    if rows.size == 0 or curve.tau[rows[-1]] < _LEAST_SPAN * curve.tau[rows[0]]:
        return Coefficient(
            symbol=symbol,
            status=Status.NOT_OBSERVABLE,
            remark=f"the curve has no stretch of slope {SLOPES[symbol]:+g}",
        )
    levels = curve.dev[rows] * (curve.tau[rows] / READ_AT[symbol]) ** -SLOPES[symbol]
    weight = curve.edf[rows] / curve.edf[rows].sum()
    value = float(np.exp(weight @ np.log(levels)))
    # Points of one stretch share most of their data: the surest of them sets the deviation.
    return _coefficient(
        symbol,
        value,
        float(curve.edf[rows].max()),
        f"slope {slope[rows].mean():+.2f} from {curve.tau[rows[0]]:.3g} s "
        f"to {curve.tau[rows[-1]]:.3g} s",
    )


def _floor(curve: AllanDeviation, slope: FloatArray, sure: BoolArray) -> Coefficient:
    """Return the bias instability read at the lowest point, if it is a lowest point."""
    lowest = int(np.argmin(np.where(sure, curve.dev, np.inf)))
    later = curve.dev[lowest:][sure[lowest:]]
    rises = later.size > 1 and later.max() > _RISE * curve.dev[lowest]
    if not (rises or abs(slope[lowest]) <= _TOLERANCE) or lowest == 0 or later.size < 2:
        return Coefficient(
            symbol="B",
            status=Status.NOT_OBSERVABLE,
            high=float(curve.dev[lowest]) / FLOOR if sure[lowest] else math.inf,
            remark=f"the curve has no flat part: its slope at its lowest sure point, "
            f"{curve.tau[lowest]:.3g} s, is {slope[lowest]:+.2f}",
        )
    return _coefficient(
        "B",
        float(curve.dev[lowest]) / FLOOR,
        float(curve.edf[lowest]),
        f"lowest point at {curve.tau[lowest]:.3g} s; {NAMES['N']} and {NAMES['K']} raise it",
    )


def _coefficient(symbol: str, value: float, dof: float, remark: str) -> Coefficient:
    std = value / math.sqrt(2.0 * dof)
    return Coefficient(
        symbol=symbol,
        status=Status.OBSERVED,
        value=value,
        std=std,
        low=max(value - 1.96 * std, 0.0),
        high=value + 1.96 * std,
        remark=remark,
    )


def _longest_run(mask: BoolArray) -> IntArray:
    """Return the rows of the longest stretch of true values."""
    rows: IntArray = np.flatnonzero(mask)
    if rows.size == 0:
        return rows
    runs: list[IntArray] = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return max(runs, key=len)
