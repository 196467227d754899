r"""Linear change of a sensor's bias with temperature, from a log at rest.

At rest the output of a gyroscope is its bias; that of an accelerometer is its bias plus
gravity in an unchanged pose, so that only the slope is of use::

    output = p1 T + p2

References
----------
.. [1] F. Scibona, MSc thesis, Universita di Padova, 2015, section 6.6, (6.24).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import (
    as_samples,
    as_series,
    as_times,
    finite,
    instance,
    one_of,
    positive,
    same_length,
)
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import correlation_length
from strapdown.calibration.record import (
    SENSOR_NAMES,
    SENSOR_UNITS,
    TemperatureRecord,
    parameters_of,
    rms,
)
from strapdown.errors import InputError

NAMES = ("p1_x", "p1_y", "p1_z", "p2_x", "p2_y", "p2_z")
LEAST_SPAN_DEGC = 2.0


def temperature_model(
    sensor: str,
    temp_degc: ArrayLike,
    samples: ArrayLike,
    *,
    tolerances: Mapping[str, float] | None = None,
    least_span_degc: float = LEAST_SPAN_DEGC,
    **about: Any,
) -> TemperatureRecord:
    """Return the linear change of each axis with temperature.

    Parameters
    ----------
    sensor : {"gyr", "acc", "mag"}
        What is calibrated.
    temp_degc : array_like, shape (n,)
        Temperature of the sensor [degC], in order of time.
    samples : array_like, shape (n, 3)
        Output at rest in one pose, at the same times; rows of NaN are left out.
    tolerances : mapping of str to float, optional
        By parameter or kind (``p1``, ``p2``): how large a slope needs no compensation, per degC.
    least_span_degc : float
        Least range of temperatures [degC].
    **about
        ``sensor_id``, ``date`` of the record.

    Returns
    -------
    TemperatureRecord
        p1 per degC and p2 at 0 degC. Residuals: samples less the line, shape (n, 3). The
        variances are raised by the correlation of the residuals in time.

    Raises
    ------
    InputError
        If the temperature hardly changes or there are too few samples.
    """
    one_of("sensor", sensor, SENSOR_UNITS)
    what = f"temperature model of the {SENSOR_NAMES[sensor]}"
    y = as_samples("samples", samples, allow_nan=True)
    T = as_series("temp_degc", temp_degc, allow_nan=True)
    same_length(samples=y, temp_degc=T)
    good = ~(np.isnan(y).any(axis=1) | np.isnan(T))
    y, T = y[good], T[good]
    span = float(np.ptp(T)) if len(T) else 0.0
    if len(T) < 10 or not span >= positive("least_span_degc", least_span_degc):
        raise InputError(
            f"{what} must have at least 10 samples over {least_span_degc:g} degC, got {len(T)} "
            f"over {span:.2g} degC; start cold, or warm the sensor gently."
        )
    mean = float(T.mean())
    # About the mean temperature, slope and level are not correlated.
    design = np.column_stack((T - mean, np.ones_like(T)))
    at_mean = np.asarray(np.linalg.lstsq(design, y, rcond=None)[0], dtype=np.float64)
    residuals = y - design @ at_mean
    dof = len(T) - 2
    to_zero = np.array([[1.0, 0.0], [-mean, 1.0]])  # level at 0 degC
    cofactor = to_zero @ np.linalg.inv(design.T @ design) @ to_zero.T
    variance = np.array(
        [(r @ r) / dof * correlation_length(r) for r in np.ascontiguousarray(residuals.T)]
    )
    covariance = np.kron(cofactor, np.diag(variance))  # order p1 x y z, p2 x y z
    values = np.concatenate((at_mean[0], at_mean[1] - mean * at_mean[0]))
    unit = SENSOR_UNITS[sensor]
    return TemperatureRecord(
        sensor=sensor,
        method="linear temperature",
        parameters=parameters_of(
            NAMES, values, covariance, (f"{unit}_per_degc",) * 3 + (unit,) * 3, tolerances
        ),
        covariance=covariance,
        residual_rms=rms(residuals),
        residual_rms_before=rms(y - y.mean(axis=0)),
        equations=3 * len(T),
        dof=3 * dof,
        residuals=residuals,
        residuals_before=y - y.mean(axis=0),
        history=values[np.newaxis],
        quality={"span_degc": span},
        slope=at_mean[0],
        temp_mean_degc=mean,
        temp_min_degc=float(T.min()),
        temp_max_degc=float(T.max()),
        **about,
    )


def require_rest(t: ArrayLike, mask: ArrayLike, what: str, *, longest: float = 2.0) -> None:
    """Refuse a log that moves for longer than `longest` seconds, naming the time.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    mask : array_like of bool, shape (n,)
        Where the device rests, as `strapdown.motion.rest_mask` gives it.
    what : str
        What needs the rest.
    longest : float
        Longest movement that is put up with [s].
    """
    t = as_times("t", t)
    positive("longest", longest, allow_zero=True)
    moving = as_series("mask", mask, len(t)) == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate(([False], moving, [False])).astype(np.int8)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if t[stop - 1] - t[start] > longest:
            raise InputError(
                f"{what} must have a log at rest, it moves from {t[start]:.1f} s to "
                f"{t[stop - 1]:.1f} s; cut it with `--from` and `--to`, or record again."
            )


def slope_matters(record: TemperatureRecord, change_degc: float, bias_limit: float) -> bool:
    """Return whether a change of temperature moves the bias by more than a limit.

    Parameters
    ----------
    record : TemperatureRecord
        The model.
    change_degc : float
        Change of temperature in use [degC].
    bias_limit : float
        Bias that can be borne, in the sensor's unit.

    Returns
    -------
    bool
        True if any axis moves by more and its slope exceeds twice its standard deviation.
    """
    instance("record", record, TemperatureRecord)
    change_degc, bias_limit = finite("change_degc", change_degc), finite("bias_limit", bias_limit)
    slope: FloatArray = np.abs(record.slope)
    std = np.array([p.std for p in record.parameters[:3]])
    return bool(np.any((slope * change_degc > bias_limit) & (slope > 2.0 * std)))
