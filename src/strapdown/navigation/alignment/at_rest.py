"""Alignment of a box at rest: level from gravity, heading from field or the Earth's rate.

With the error ``phi_n`` and biases of accelerometer and gyroscope along north and east,

``phi_north = b_a,east / g``, ``phi_east = -b_a,north / g``,

``phi_down = b_g,east / (omega_ie cos lat) - phi_north tan lat``  (gyrocompass)

``phi_down = dm_east / m_horizontal + phi_north tan dip``  (magnetic)
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.determination import triad
from strapdown.constants import G0, OMEGA_IE
from strapdown.earth import earth_rate_n
from strapdown.errors import InputError
from strapdown.motion import DEFAULT, RestTest
from strapdown.navigation.alignment.result import Alignment, Stretch, at_rest, mean_with_std
from strapdown.recording import Recording
from strapdown.rotation import quat_conj, quat_from_rpy, rotate
from strapdown.units import DEG, DEG_PER_HR, UT

UNKNOWN_HEADING = math.pi / math.sqrt(3.0)  # sigma of an angle that may be anything [rad]
_ODD_GRAVITY = 0.05  # share by which the mean specific force may differ from gravity
_LEAST_HORIZONTAL = 0.05  # share of the field that must be horizontal

Span = tuple[float, float] | None


def heading_std(gyr_bias_std: float, lat: float) -> float:
    """Return the heading sigma of a gyrocompass: gyro bias over the horizontal Earth rate.

    Parameters
    ----------
    gyr_bias_std : float
        Sigma of the bias of a horizontal gyroscope [rad/s].
    lat : float
        Latitude [rad].

    Returns
    -------
    float
        [rad]; no more than that of a heading of which nothing is known, 104 deg.

    Examples
    --------
    A navigation-grade gyroscope, and one of a telephone:

    >>> round(heading_std(0.01 * DEG_PER_HR, 45 * DEG) / DEG, 3)
    0.054
    >>> round(heading_std(1000 * DEG_PER_HR, 45 * DEG) / DEG)
    104
    """
    bias = _checks.positive("gyr_bias_std", gyr_bias_std, allow_zero=True)
    rate = OMEGA_IE * math.cos(_checks.in_range("lat", lat, -math.pi / 2, math.pi / 2))
    return min(bias / rate, UNKNOWN_HEADING)


def level(
    rec: Recording,
    *,
    span: Span = None,
    heading: float | None = None,
    heading_std: float = 0.0,
    heading_reference: str = "true",
    acc_bias_std: float = 0.02,
    test: RestTest = DEFAULT,
) -> Alignment:
    """Level a box at rest: roll and pitch from gravity, heading as given.

    Parameters
    ----------
    rec : Recording
        With ``imu``.
    span : tuple of float, optional
        From when to when the box rests [s]; the whole recording by default.
    heading : float, optional
        Known heading of the x axis [rad]. None: zero, which means nothing.
    heading_std : float
        Sigma of a known heading [rad].
    heading_reference : {'true', 'magnetic', 'arbitrary'}
        What a known heading is measured from.
    acc_bias_std : float
        Sigma of the accelerometer's bias in each axis [m/s^2].
    test : RestTest
        What counts as rest.

    Returns
    -------
    Alignment
        At the last sample of the span.

    Raises
    ------
    InputError
        If the box moves, with the time, or the mean specific force is not gravity.
    DataGap
        If the span holds no samples.

    Notes
    -----
    Offline. One tenth of a per cent of g in a bias makes 1 mrad of tilt, 0.06 deg.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> found = level(demo.recording(), span=(0.0, 3.5))
    >>> found.method, found.heading_reference
    ('level', 'arbitrary')
    """
    samples = at_rest(rec, span, test)
    known = heading is not None
    yaw = 0.0 if heading is None else _checks.finite("heading", heading)
    deviation = _checks.positive("heading_std", heading_std, allow_zero=True)
    q_nb, tilt_std = _levelled(samples, acc_bias_std, yaw)
    P = np.zeros((3, 3))
    P[0, 0] = P[1, 1] = tilt_std**2
    P[2, 2] = (deviation if known else UNKNOWN_HEADING) ** 2
    return _result(samples, q_nb, P, heading_reference if known else "arbitrary", "level", None)


def magnetic(
    rec: Recording,
    *,
    span: Span = None,
    declination: float | None = None,
    acc_bias_std: float = 0.02,
    field_std: float = 1.0 * UT,
    declination_std: float = 0.5 * DEG,
    test: RestTest = DEFAULT,
) -> Alignment:
    """Align a box at rest by gravity and the magnetic field.

    Parameters
    ----------
    rec : Recording
        With ``imu`` and a calibrated ``mag``.
    span : tuple of float, optional
        From when to when the box rests [s].
    declination : float, optional
        Heading of magnetic north, east positive [rad]: then heading is true. None: magnetic.
    acc_bias_std : float
        Sigma of the accelerometer's bias [m/s^2].
    field_std : float
        Sigma of each component of the field: what calibration and surroundings leave [T].
    declination_std : float
        Sigma of the declination, if it is given [rad].
    test : RestTest
        What counts as rest.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        If the box moves, there is no field in the span, or it is nearly vertical.

    Notes
    -----
    Offline.
    """
    samples = at_rest(rec, span, test)
    mag = rec.need("mag")
    first, last = samples.span
    rows = (mag.t >= first) & (mag.t <= last) & ~mag.nan_rows()
    if not rows.any():
        raise InputError(f"stream mag must hold a valid sample from {first:g} to {last:g} s.")
    m_b = mag.mag[rows].mean(axis=0)
    q_lb, tilt_std = _levelled(samples, acc_bias_std, 0.0)
    north, east, down = rotate(q_lb, m_b)
    across = math.hypot(north, east)
    size = math.hypot(across, down)
    if not across > _LEAST_HORIZONTAL * size:
        raise InputError(
            f"the field must have a horizontal part to give heading, it points within "
            f"{math.degrees(math.atan2(across, abs(down))):.2g} deg of the vertical; near a "
            "magnetic pole or beside steel take `gyrocompass` or `course`."
        )
    yaw = math.atan2(-east, north) + (declination or 0.0)
    q_nb, _ = _levelled(samples, acc_bias_std, yaw)
    spread = _checks.positive("field_std", field_std) / across
    offset = 0.0
    if declination is not None:
        offset = _checks.positive("declination_std", declination_std, allow_zero=True)
    P = _covariance(tilt_std, math.hypot(spread, offset), down / across)
    reference = "magnetic" if declination is None else "true"
    return _result(samples, q_nb, P, reference, "magnetic", None)


def gyrocompass(
    rec: Recording,
    lat: float,
    *,
    span: Span = None,
    gyr_bias_std: float,
    acc_bias_std: float = 0.02,
    max_heading_std: float = 5.0 * DEG,
    test: RestTest = DEFAULT,
) -> Alignment:
    """Align a box at rest by gravity and the horizontal part of the Earth's rate.

    Parameters
    ----------
    rec : Recording
        With ``imu``.
    lat : float
        Latitude [rad].
    span : tuple of float, optional
        From when to when the box rests [s]; longer averages more noise.
    gyr_bias_std : float
        Sigma of the gyroscope's bias in each axis [rad/s]. It decides: see `heading_std`.
    acc_bias_std : float
        Sigma of the accelerometer's bias [m/s^2].
    max_heading_std : float
        Greatest heading sigma that is taken [rad]; ``math.inf`` takes any and states it.
    test : RestTest
        What counts as rest.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        If the box moves, the gyroscope is too poor for the heading that is asked for, or it shows
        a rate that cannot be the Earth's with the stated bias.

    Notes
    -----
    Offline.
    """
    samples = at_rest(rec, span, test)
    rate, rate_std = _earth_rate(samples, gyr_bias_std)
    deviation = heading_std(rate_std, lat)
    _require_gyro(rate, rate_std, deviation, lat, max_heading_std)
    q_lb, tilt_std = _levelled(samples, acc_bias_std, 0.0)
    north, east, _ = rotate(q_lb, rate)
    q_nb, _ = _levelled(samples, acc_bias_std, math.atan2(-east, north))
    P = _covariance(tilt_std, deviation, -math.tan(lat))
    return _result(samples, q_nb, P, "true", "gyrocompass", lat)


def analytic(
    rec: Recording,
    lat: float,
    *,
    span: Span = None,
    gyr_bias_std: float,
    acc_bias_std: float = 0.02,
    max_heading_std: float = 5.0 * DEG,
    test: RestTest = DEFAULT,
) -> Alignment:
    """Align a box at rest by gravity and the Earth's rate as two directions (TRIAD).

    The same as `gyrocompass`, written with directions: gravity is met exactly, the Earth's axis
    gives the turn about it.

    Parameters
    ----------
    rec, lat, span, gyr_bias_std, acc_bias_std, max_heading_std, test
        See `gyrocompass`.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        As `gyrocompass`.

    Notes
    -----
    Offline.
    """
    samples = at_rest(rec, span, test)
    rate, rate_std = _earth_rate(samples, gyr_bias_std)
    deviation = heading_std(rate_std, lat)
    _require_gyro(rate, rate_std, deviation, lat, max_heading_std)
    _, tilt_std = _levelled(samples, acc_bias_std, 0.0)
    force = samples.acc.mean(axis=0)
    q_nb = triad([-force, rate], np.array([[0.0, 0.0, 1.0], earth_rate_n(lat)])).q_nb
    P = _covariance(tilt_std, deviation, -math.tan(lat))
    return _result(samples, q_nb, P, "true", "analytic", lat)


def _levelled(samples: Stretch, acc_bias_std: float, yaw: float) -> tuple[FloatArray, float]:
    """Return the attitude with a heading, and the sigma of its tilt [rad]."""
    force, noise = mean_with_std(samples.acc)
    size = float(np.linalg.norm(force))
    if not abs(size / G0 - 1.0) < _ODD_GRAVITY:
        advice = "check the units of stream imu, or calibrate the accelerometer"
        if abs(size - 1.0) < _ODD_GRAVITY:
            advice = "stream imu looks like g: multiply its acc by 9.80665"
        raise InputError(
            "the mean specific force at rest must be gravity, 9.8 m/s^2, "
            f"got {size:.4g}; {advice}."
        )
    fx, fy, fz = force
    roll = math.atan2(-fy, -fz)
    pitch = math.atan2(fx, math.hypot(fy, fz))
    bias = _checks.positive("acc_bias_std", acc_bias_std, allow_zero=True)
    return quat_from_rpy([roll, pitch, yaw]), math.hypot(bias, float(noise.max())) / size


def _covariance(tilt_std: float, heading_std: float, per_north: float) -> FloatArray:
    """Return the covariance where heading takes a share of the error about north."""
    P = np.diag([tilt_std**2, tilt_std**2, heading_std**2 + (per_north * tilt_std) ** 2])
    P[0, 2] = P[2, 0] = per_north * tilt_std**2
    return np.asarray(P)


def _earth_rate(samples: Stretch, gyr_bias_std: float) -> tuple[FloatArray, float]:
    """Return the mean rate and the sigma of each component."""
    bias = _checks.positive("gyr_bias_std", gyr_bias_std, allow_zero=True)
    rate, noise = mean_with_std(samples.gyr)
    return rate, math.hypot(bias, float(noise.max()))


def _require_gyro(
    rate: FloatArray, rate_std: float, deviation: float, lat: float, limit: float
) -> None:
    """Refuse a gyroscope that cannot see the Earth turn."""
    _checks.positive("max_heading_std", limit, allow_inf=True)
    if not deviation <= limit:
        need = limit * OMEGA_IE * math.cos(lat)
        raise InputError(
            f"the gyroscope must be good to {need / DEG_PER_HR:.2g} deg/h for a heading sigma of "
            f"{limit / DEG:.3g} deg at latitude {lat / DEG:.1f} deg, its sigma is "
            f"{rate_std / DEG_PER_HR:.3g} deg/h; take `magnetic`, or in motion `course` or "
            "`velocity_matching`, or raise `max_heading_std`."
        )
    size = float(np.linalg.norm(rate))
    if abs(size - OMEGA_IE) > 5.0 * rate_std + 1e-3 * OMEGA_IE:
        raise InputError(
            f"the mean rate at rest must be the Earth's, 15.04 deg/h, within five of the stated "
            f"sigmas of {rate_std / DEG_PER_HR:.3g} deg/h, got {size / DEG_PER_HR:.4g} deg/h; "
            "take the bias out by calibration, or state it in `gyr_bias_std`."
        )


def _result(
    samples: Stretch,
    q_nb: ArrayLike,
    P: FloatArray,
    reference: str,
    method: str,
    lat: float | None,
) -> Alignment:
    q = np.asarray(q_nb)
    bias = samples.gyr.mean(axis=0)
    if lat is not None:
        bias = bias - rotate(quat_conj(q), earth_rate_n(lat))
    return Alignment(
        t=samples.span[1],
        q_nb=q,
        covariance_n=P,
        gyr_bias=bias,
        heading_reference=reference,
        method=method,
        span=samples.span,
    )
