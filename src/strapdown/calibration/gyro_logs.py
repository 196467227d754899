"""What recordings hold for the gyroscope: turntable positions, reference rates, rests."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from strapdown import motion
from strapdown._types import BoolArray, FloatArray
from strapdown.calibration.encoder import body_rates
from strapdown.calibration.place import reference_attitude
from strapdown.calibration.poses import find_turntable_positions
from strapdown.calibration.record import CalibrationRecord, Parameter, rms
from strapdown.errors import InputError
from strapdown.recording import Recording
from strapdown.rotation import interpolate, quat_conj, quat_mul, rotvec_from_quat, rpy_from_quat
from strapdown.units import DEG, DPS

_RATE_WINDOW = 0.1  # [s], longest over which gyroscope and reference are compared
_WINDOW_TURN = 0.1  # [rad] in a window: rotations of this size nearly commute
_TURNED = 5.0 * DEG  # less than that is no motion to calibrate on
_STANDING = 10.0 * DPS  # a slower turntable stands; bias alone may show as much


def usual_method(recs: Sequence[Recording], table_rates: Sequence[float]) -> str:
    """Return the method that needs most of what the recordings have."""
    if table_rates or all(rec.encoder is not None for rec in recs):
        return "table"
    if all(rec.reference is not None and rec.reference.attitude is not None for rec in recs):
        return "reference" if any(_turns(rec) for rec in recs) else "rest"
    return "rest"


def _turns(rec: Recording) -> bool:
    """Return whether the reference attitude leaves where it began."""
    q_nb = reference_attitude(rec)[1]
    known = q_nb[np.isfinite(q_nb).all(axis=1)]
    return bool(len(known)) and bool((np.abs(known @ known[0]) < math.cos(0.5 * _TURNED)).any())


def table_positions(
    recs: Sequence[Recording], table_rates: Sequence[float]
) -> tuple[FloatArray, FloatArray, float | None]:
    """Return mean rates, the table's rates, and the standard deviation of a mean."""
    means, rates, stds = [], [], []
    known = np.abs(np.asarray([*table_rates, 0.0], dtype=np.float64))
    for rec in recs:
        imu = rec.need("imu")
        poses = find_turntable_positions(imu.t, imu.gyr, imu.acc)
        stds += [poses.gyr_std] if len(poses) else []
        for start, stop, mean in zip(poses.t_start, poses.t_stop, poses.gyr, strict=True):
            size = float(np.linalg.norm(mean))
            if rec.encoder is not None:
                ends = np.interp([start, stop], rec.encoder.t, rec.encoder.angle)
                rate = abs(float(ends[1] - ends[0])) / (stop - start)
            elif table_rates:
                rate = float(known[np.argmin(np.abs(known - size))])
            else:
                raise InputError(
                    "the turntable's rates must be known; give them with `--rates 200,270` in "
                    "deg/s, or log the table's encoder."
                )
            if abs(rate - size) > max(0.2 * rate, _STANDING):
                raise InputError(
                    f"the gyroscope turns at {size / DPS:.4g} deg/s from {start:.1f} s to "
                    f"{stop:.1f} s, but the nearest rate of the table is {rate / DPS:.4g} deg/s; "
                    "check units and rates, or cut that part out."
                )
            means.append(mean)
            rates.append(rate if rate > 0.1 * _STANDING else 0.0)
    if not means:
        raise InputError(
            "the log must hold steady rotation or rest for a second in each position, none was "
            "found; let the table reach its speed in each."
        )
    return np.array(means).reshape(-1, 3), np.array(rates), max(stds, default=None)


def rates_and_reference(rec: Recording, resolution: float | None) -> tuple[FloatArray, FloatArray]:
    """Return mean gyroscope rates and those of the reference attitude, window by window."""
    imu, (t, q_nb) = rec.need("imu"), reference_attitude(rec)
    known = _between_samples(imu.t, t)
    if resolution is not None:
        rpy = np.unwrap(rpy_from_quat(q_nb), axis=0)
        rates = body_rates(t, rpy, resolution)
        at = imu.t[known]
        true = np.column_stack([np.interp(at, t, rates[:, i]) for i in range(3)])
        return imu.gyr[known], true
    # gyr[k] covers (t[k-1], t[k]], so its sum over a window is the turn between two samples.
    speed = float(np.sqrt(np.nanmean(np.sum(imu.gyr**2, axis=1))))
    window = min(_RATE_WINDOW, _WINDOW_TURN / max(speed, 1e-9))
    step = max(1, round(window / float(np.median(np.diff(imu.t)))))
    rows = np.arange(0, len(imu.t), step)
    whole = known & ~np.isnan(imu.gyr).any(axis=1)
    lost = np.concatenate(([0], np.cumsum(~whole)))
    good = lost[rows[1:] + 1] == lost[rows[:-1]]
    first, last = rows[:-1][good], rows[1:][good]
    if not len(first):
        raise InputError("the reference attitude must overlap the gyroscope in time; it does not.")
    turn = rotvec_from_quat(
        quat_mul(quat_conj(interpolate(imu.t[first], t, q_nb)), interpolate(imu.t[last], t, q_nb))
    )
    span = (imu.t[last] - imu.t[first])[:, np.newaxis]
    weighted = np.nan_to_num(imu.gyr[1:]) * np.diff(imu.t)[:, np.newaxis]
    sums = np.vstack((np.zeros((1, 3)), np.cumsum(weighted, axis=0)))
    return (sums[last] - sums[first]) / span, turn / span


def _between_samples(t: FloatArray, t_reference: FloatArray) -> BoolArray:
    """Return which times lie between two reference samples that follow on each other."""
    after = np.searchsorted(t_reference, t, side="left")
    inside = (after < len(t_reference)) & (t >= t_reference[0])
    after = np.clip(after, 1, len(t_reference) - 1)
    gap = t_reference[after] - t_reference[after - 1]
    return np.asarray(
        inside & (gap <= max(_RATE_WINDOW, 3.0 * float(np.median(np.diff(t_reference)))))
    )


def bias_at_rest(recs: Sequence[Recording], about: Mapping[str, Any]) -> CalibrationRecord:
    """Return the mean of all rests, with the identity as matrix."""
    parts = []
    for rec in recs:
        imu = rec.need("imu")
        parts += [imu.gyr[s.rows] for s in motion.rest_segments(imu.t, imu.gyr, imu.acc)]
    if not parts:
        raise InputError(
            "the gyroscope's bias needs a rest of a second, the log has none; leave the device "
            "still for some seconds."
        )
    still = np.vstack(parts)
    still = still[~np.isnan(still).any(axis=1)]
    bias = still.mean(axis=0)
    residuals = still - bias
    covariance = np.diag(residuals.var(axis=0, ddof=1) / len(still))
    return CalibrationRecord(
        sensor="gyr",
        method="rest",
        matrix=np.eye(3),
        bias=bias,
        parameters=tuple(
            Parameter(name=f"b_{axis}", value=float(b), std=float(np.sqrt(variance)), unit="rad_s")
            for axis, b, variance in zip("xyz", bias, np.diag(covariance), strict=True)
        ),
        covariance=covariance,
        residual_rms=rms(residuals),
        residual_rms_before=rms(still),
        equations=still.size,
        dof=still.size - 3,
        residuals=residuals,
        residuals_before=still,
        history=bias[np.newaxis],
        **about,
    )
