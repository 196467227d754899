"""Tilt from the accelerometer, heading from the levelled field."""

import math

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.determination.result import (
    MIN_ANGLE,
    Determination,
    Epochs,
    Observability,
    covariance_of_rows,
    epochs,
    finish,
)
from strapdown.attitude.determination.triad import anchored_covariance
from strapdown.constants import G0
from strapdown.rotation import dcm_from_quat, quat_from_rpy

_DOWN = np.array([0.0, 0.0, 1.0])


def tilt(acc: ArrayLike, *, sigma: ArrayLike = 1.0) -> Determination:
    """Roll and pitch of a box at rest from its specific force; yaw is zero by convention.

    Parameters
    ----------
    acc : array_like, shape (3,) or (n, 3)
        Specific force [m/s^2, or any other unit].
    sigma : array_like, scalar or (n,)
        Standard deviation of its direction [rad]: that of a component, over gravity.

    Returns
    -------
    Determination
        Flagged `HEADING_OPEN`; the rows and columns of down of the covariance are NaN.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single specific force is NaN or zero.

    Notes
    -----
    Vectorised. Pitch is that of ``atan2(f_x, |f_yz|)``, which keeps its digits near +-90 deg,
    where roll is what the noise makes it, and the attitude as a whole still as good.

    Examples
    --------
    >>> (tilt([0.0, -4.9, -8.5]).rpy * 180 / np.pi).round(1)
    array([30.,  0.,  0.])
    """
    f = _checks.as_vectors("acc", acc, allow_nan=True)
    if f.ndim not in (1, 2):
        raise ValueError(f"`acc` must have shape (3,) or (n, 3), got {f.shape}.")
    # a second copy of the same direction: flagged as one, which here is meant
    pair = np.stack((-f, -f), axis=-2)
    deviation = _checks.as_floats("sigma", sigma)
    data = epochs(pair, np.stack((_DOWN, _DOWN)), deviation[..., None], MIN_ANGLE)
    missing = (data.status & int(Observability.MISSING)) != 0
    if data.single and missing[0]:
        raise ValueError(f"`acc` must be a direction, got {f}.")
    status = np.where(
        missing,
        int(Observability.MISSING | Observability.ONE_DIRECTION),
        int(Observability.HEADING_OPEN),
    )
    P = np.full((len(data.b), 3, 3), np.nan)
    P[:, :2, :2] = data.sigma[:, :1, None] ** 2 * np.eye(2)
    data = data._replace(weight=data.weight * [1.0, 0.0])
    roll, pitch = _roll_pitch(data.b[:, 0])
    return finish(data, quat_from_rpy(np.stack((roll, pitch, 0.0 * roll), axis=1)), P, status)


def compass(
    acc: ArrayLike,
    mag: ArrayLike,
    *,
    declination: float = 0.0,
    sigma: ArrayLike = 1.0,
    min_angle: float = MIN_ANGLE,
) -> Determination:
    """Attitude of a box at rest: tilt, and the tilt-compensated compass.

    Parameters
    ----------
    acc : array_like, shape (3,) or (n, 3)
        Specific force [m/s^2, or any other unit].
    mag : array_like, shape (3,) or (n, 3)
        Magnetic field [T, or any other unit].
    declination : float
        Heading of magnetic north [rad]; with zero yaw is magnetic.
    sigma : array_like, scalar, (2,) or (n, 2)
        Standard deviations of the directions of specific force and field [rad].
    min_angle : float
        A field nearer to the vertical tells no heading [rad].

    Returns
    -------
    Determination
        The reference takes the dip that is measured, so that the loss is zero: dip is no
        measurement, and the field tells heading only.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has a vertical field.

    Notes
    -----
    Vectorised. The same attitude and covariance as `triad` with down first.

    Examples
    --------
    >>> found = compass([0, 0, -9.8], [0, -2e-5, 4e-5], declination=0.05)
    >>> (found.rpy * 180 / np.pi).round(2)  # magnetic east is 2.86 deg south of true east
    array([ 0.  ,  0.  , 92.86])
    """
    data = _at_rest(acc, mag, sigma, min_angle)
    down_b, field_b = data.b[:, 0], data.b[:, 1]
    roll, pitch = _roll_pitch(down_b)
    return _headed(data, roll, pitch, field_b, declination)


def master_slave(
    acc: ArrayLike,
    mag: ArrayLike,
    *,
    declination: float = 0.0,
    gravity: float = G0,
    sigma: ArrayLike = 1.0,
    min_angle: float = MIN_ANGLE,
) -> Determination:
    """Attitude by the Master-Slave scheme: gravity gives pitch and roll, the field then yaw.

    Pitch and roll are arcsines of the first two components of gravity; the third, less trusted,
    only says in which quadrant roll is.

    Parameters
    ----------
    acc : array_like, shape (3,) or (n, 3)
        Specific force [m/s^2]: gravity in b is its negative.
    mag : array_like, shape (3,) or (n, 3)
        Magnetic field [T, or any other unit].
    declination : float
        Heading of magnetic north [rad]; with zero yaw is magnetic.
    gravity : float
        Magnitude of gravity [m/s^2]: the third component is not there to give it.
    sigma : array_like, scalar, (2,) or (n, 2)
        Standard deviations of a component of the specific force over gravity, and of the
        direction of the field [rad].
    min_angle : float
        A field nearer to the vertical tells no heading. Nearer than this to a roll or pitch of
        +-90 deg the arcsines are singular [rad].

    Returns
    -------
    Determination
        `SINGULAR`, without a covariance, where roll or pitch is +-90 deg: there an error of
        the components enters the attitude with its square root.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has a vertical field.

    Notes
    -----
    Vectorised. Misprint corrected: the first sign of the source's table of roll is that of
    ``g_z``, not of ``g_x``. A component beyond `gravity` counts as equal to it.

    References
    ----------
    .. [1] Thesis GNSS/INS system, 7.6.2: (7.6.10) to (7.6.16), tables 7.1 and 7.2.

    Examples
    --------
    >>> found = master_slave([0, 0, 9.80665], [0, -2e-5, -4e-5])  # upside down
    >>> (np.abs(found.rpy) * 180 / np.pi).round(6)
    array([180.,   0.,  90.])
    """
    _checks.positive("gravity", gravity)
    data = _at_rest(acc, mag, sigma, min_angle)
    f = np.atleast_2d(_checks.as_vectors("acc", acc, allow_nan=True))
    gx, gy, gz = np.moveaxis(np.where(np.isnan(f), 0.0, -f / gravity), -1, 0)
    pitch = -np.arcsin(np.clip(gx, -1.0, 1.0))  # (7.6.11)
    cosine = np.cos(pitch)
    gy = np.clip(gy, -_checks.LARGEST, _checks.LARGEST)
    ratio = gy / np.where(cosine > 0.0, cosine, 1.0)
    roll = roll_by_quadrant(np.arcsin(np.clip(ratio, -1.0, 1.0)), gz, gy)  # (7.6.12)
    singular = (cosine < math.sin(min_angle)) | (np.abs(ratio) > math.cos(min_angle))
    status = data.status | np.where(singular, int(Observability.SINGULAR), 0)
    found = _yaw(roll, pitch, data.b[:, 1], declination)
    # errors of g_x and g_y, and of the field across the heading, as rows on phi_n
    C = dcm_from_quat(found)
    field_n = np.einsum("nij,nj->ni", C, data.b[:, 1])
    east = np.cross(_DOWN, field_n)
    norm = np.linalg.norm(east, axis=1, keepdims=True)
    east = east / np.where(norm > 0.0, norm, 1.0)
    rows = np.stack(
        (np.cross(_DOWN, C[:, :, 0]), np.cross(_DOWN, C[:, :, 1]), np.cross(field_n, east)), axis=1
    )
    variance = np.stack((data.sigma[:, 0], data.sigma[:, 0], data.sigma[:, 1]), axis=1) ** 2
    P = covariance_of_rows(rows, variance)
    return finish(_with_reference(data, field_n), found, P, status)


def roll_by_quadrant(arcsine: FloatArray, g_z: FloatArray, g_y: FloatArray) -> FloatArray:
    """Return roll of its arcsine and the signs of gravity's components: table 7.1."""
    below = np.where(g_y >= 0.0, math.pi - arcsine, -(math.pi + arcsine))
    return np.where(g_z >= 0.0, arcsine, below)


def yaw_by_quadrant(b_x: FloatArray, b_y: FloatArray) -> FloatArray:
    """Return magnetic yaw of the levelled field's components: (7.6.15) and table 7.2."""
    with np.errstate(divide="ignore", invalid="ignore"):
        arctangent = np.arctan(-b_y / b_x)
    arctangent = np.where(b_x == 0.0, -np.sign(b_y) * 0.5 * math.pi, arctangent)
    behind = np.where(b_y >= 0.0, arctangent - math.pi, arctangent + math.pi)
    return np.where(b_x >= 0.0, arctangent, behind)


def _at_rest(acc: ArrayLike, mag: ArrayLike, sigma: ArrayLike, min_angle: float) -> Epochs:
    """Return down and field in b; the reference in n follows when the attitude is known."""
    f = _checks.as_vectors("acc", acc, allow_nan=True)
    m = _checks.as_vectors("mag", mag, allow_nan=True)
    if f.ndim not in (1, 2) or m.shape != f.shape:
        raise ValueError(
            f"`acc` and `mag` must both have shape (3,) or (n, 3), got {f.shape} and {m.shape}."
        )
    pair = np.stack((-f, m), axis=-2)  # at rest f_b points up
    return epochs(pair, pair, sigma, min_angle)


def _roll_pitch(down_b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return roll and pitch of the direction down in b."""
    x, y, z = np.moveaxis(down_b, -1, 0)
    return np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))


def _yaw(
    roll: FloatArray, pitch: FloatArray, field_b: FloatArray, declination: float
) -> FloatArray:
    """Return q_nb of roll, pitch and the heading of the levelled field."""
    _checks.in_range("declination", declination, -math.pi, math.pi)
    level = dcm_from_quat(quat_from_rpy(np.stack((roll, pitch, 0.0 * roll), axis=1)))
    levelled = np.einsum("nij,nj->ni", level, field_b)  # (7.6.13)
    yaw = yaw_by_quadrant(levelled[:, 0], levelled[:, 1]) + declination  # (7.6.16)
    return quat_from_rpy(np.stack((roll, pitch, yaw), axis=1))


def _headed(
    data: Epochs, roll: FloatArray, pitch: FloatArray, field_b: FloatArray, declination: float
) -> Determination:
    """Return the attitude whose tilt is known, with the field's heading."""
    q = _yaw(roll, pitch, field_b, declination)
    field_n = np.einsum("nij,nj->ni", dcm_from_quat(q), field_b)
    down = np.broadcast_to(_DOWN, field_n.shape)
    P = anchored_covariance(down, field_n, data.sigma)
    return finish(_with_reference(data, field_n), q, P, data.status)


def _with_reference(data: Epochs, field_n: FloatArray) -> Epochs:
    """Return the epochs with down and the field as it was found for their reference."""
    down = np.broadcast_to(_DOWN, field_n.shape)
    return data._replace(n=np.stack((down, field_n), axis=1))
