"""How the errors of an inertial system grow: in closed form, and by its linear error model.

Three views of the same thing, each with its span:

* `drift`: the formula of the theses, for seconds to some minutes, before the Earth's curvature
  acts back on the platform.
* `schuler_error`, `foucault_error`: one horizontal channel, or two, on the round Earth: errors
  oscillate with 84.4 min instead of growing.
* `stationary_error`: all nine errors of a system at rest on the turning Earth, which adds the
  period of a day and, unless it is held, the vertical channel's instability.

Errors of position and velocity are *estimate less truth*; an attitude error ``phi_n`` turns the
estimate to the truth, as in `strapdown.conventions`.
"""

import math
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.constants import G0, OMEGA_IE, WGS84_A
from strapdown.earth import meridian_radius, normal_gravity, transverse_radius

MEAN_RADIUS: Final = 6_371_008.8  # of the Earth: (2 a + b) / 3 of WGS 84 [m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """Position errors by their causes, each of the shape of the times [m].

    Attributes
    ----------
    position, velocity : ndarray
        What is left of the error at the start, and the way of the velocity error there.
    acc_bias, gyr_bias : ndarray
        Of the sensors' residual biases: with the square and the cube of time.
    tilt : ndarray
        Of the horizontal misalignment: gravity in the wrong axis.
    heading : ndarray
        Of the azimuth misalignment: the way gone in the wrong direction.
    acc_scale, gyr_scale : ndarray
        Of the residual scale errors.
    """

    position: FloatArray
    velocity: FloatArray
    acc_bias: FloatArray
    gyr_bias: FloatArray
    tilt: FloatArray
    heading: FloatArray
    acc_scale: FloatArray
    gyr_scale: FloatArray

    @property
    def total(self) -> FloatArray:
        """Their sum, which is that of signed errors of one axis [m]."""
        return np.asarray(sum(getattr(self, part.name) for part in fields(self)))

    @property
    def root_sum_square(self) -> FloatArray:
        """Root of the sum of squares, for sigmas of independent causes [m]."""
        return np.asarray(np.sqrt(sum(getattr(self, part.name) ** 2 for part in fields(self))))


def drift(
    t: ArrayLike,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    acc_bias: float = 0.0,
    gyr_bias: float = 0.0,
    tilt: float = 0.0,
    heading: float = 0.0,
    acc_scale: float = 0.0,
    gyr_scale: float = 0.0,
    speed: float = 0.0,
    specific_force: float = 0.0,
    heading_change: float = 0.0,
    gravity: float = G0,
) -> Drift:
    """Return the approximate drift of one horizontal position, formula (6.1.3) of thesis E2.

    ``dp = dp0 + dv0 t + b_a t^2/2 + b_g g t^3/6 + tilt g t^2/2 + heading V t + s_a f t^2/2
    + s_g dH V t``

    Parameters
    ----------
    t : array_like
        Time since the start [s].
    position, velocity : float
        Errors at the start [m], [m/s].
    acc_bias, gyr_bias : float
        Residual biases [m/s^2], [rad/s].
    tilt, heading : float
        Horizontal and azimuth misalignment at the start [rad].
    acc_scale, gyr_scale : float
        Residual scale errors, as parts of one.
    speed : float
        Mean speed V of the carrier [m/s].
    specific_force : float
        Mean specific force f along the axis [m/s^2].
    heading_change : float
        Change of azimuth dH over the time [rad].
    gravity : float
        [m/s^2].

    Returns
    -------
    Drift

    Notes
    -----
    Vectorised. Good for a few minutes: the Earth's curvature makes the terms of `schuler_error` of
    them, which differ by ``(t / 1400 s)^2`` of themselves, twelve times less for the bias.

    References
    ----------
    .. [1] Thesis E2, section 6.1, formula (6.1.3), after Syed, Aggarwal, Goodall, Niu,
           El-Sheimy 2007.

    Examples
    --------
    One milli-g for 100 s:

    >>> from strapdown.units import MG
    >>> round(float(drift(100.0, acc_bias=1 * MG).total), 1)
    49.0
    """
    time, gravity = _times(t), _checks.finite("gravity", gravity)
    way = _checks.finite("speed", speed) * time
    half_square = 0.5 * time**2
    return Drift(
        position=_checks.finite("position", position) * np.ones_like(time),
        velocity=_checks.finite("velocity", velocity) * time,
        acc_bias=_checks.finite("acc_bias", acc_bias) * half_square,
        gyr_bias=_checks.finite("gyr_bias", gyr_bias) * gravity * time**3 / 6.0,
        tilt=_checks.finite("tilt", tilt) * gravity * half_square,
        heading=_checks.finite("heading", heading) * way,
        acc_scale=_checks.finite("acc_scale", acc_scale)
        * _checks.finite("specific_force", specific_force)
        * half_square,
        gyr_scale=_checks.finite("gyr_scale", gyr_scale)
        * _checks.finite("heading_change", heading_change)
        * way,
    )


def _times(t: ArrayLike) -> FloatArray:
    """Return times of any shape, all finite [s]."""
    time = _checks.as_floats("t", t)
    return _checks.as_series("t", time.ravel()).reshape(time.shape)


def schuler_period(gravity: float = G0, radius: float = MEAN_RADIUS) -> float:
    """Return the period of a horizontal channel, ``2 pi sqrt(R / g)`` [s].

    Parameters
    ----------
    gravity : float
        [m/s^2].
    radius : float
        Of the Earth's curvature at the system [m].

    Returns
    -------
    float

    Examples
    --------
    >>> round(schuler_period() / 60.0, 1)
    84.4
    """
    return (
        2.0
        * math.pi
        * math.sqrt(_checks.positive("radius", radius) / _checks.positive("gravity", gravity))
    )


def foucault_period(lat: float) -> float:
    """Return the time in which the plane of a Schuler oscillation turns once round [s].

    Parameters
    ----------
    lat : float
        Latitude [rad]; infinite on the equator.

    Returns
    -------
    float

    Examples
    --------
    >>> from strapdown.units import DEG
    >>> round(foucault_period(30 * DEG) / 3600.0, 2)  # twice a sidereal day
    47.87
    """
    rate = OMEGA_IE * abs(math.sin(_checks.in_range("lat", lat, -math.pi / 2, math.pi / 2)))
    return 2.0 * math.pi / rate if rate > 0.0 else math.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelError:
    """Errors of one horizontal channel.

    Attributes
    ----------
    t : ndarray
        Time [s].
    position, velocity : ndarray
        Estimate less truth [m], [m/s].
    tilt : ndarray
        By which the platform leans so that gravity adds to the acceleration [rad].
    """

    t: FloatArray
    position: FloatArray
    velocity: FloatArray
    tilt: FloatArray


def schuler_error(
    t: ArrayLike,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    tilt: float = 0.0,
    acc_bias: float = 0.0,
    gyr_bias: float = 0.0,
    gravity: float = G0,
    radius: float = MEAN_RADIUS,
) -> ChannelError:
    """Return the errors of one horizontal channel on the round Earth, its rotation left out.

    ``v' = g tilt + acc_bias``, ``tilt' = gyr_bias - v / R``, ``p' = v``. Only a gyro bias makes a
    position error that grows without bound, and that with ``R gyr_bias t``.

    Parameters
    ----------
    t : array_like
        Time [s].
    position, velocity, tilt : float
        Errors at the start [m], [m/s], [rad]; a positive tilt takes gravity for acceleration.
    acc_bias, gyr_bias : float
        [m/s^2], [rad/s].
    gravity, radius : float
        [m/s^2], [m].

    Returns
    -------
    ChannelError

    Notes
    -----
    Vectorised.

    References
    ----------
    .. [1] D. H. Titterton, J. L. Weston, "Strapdown Inertial Navigation Technology", 2nd edition,
           IEE, 2004, section 12.3.

    Examples
    --------
    >>> from strapdown.units import MG
    >>> error = schuler_error(schuler_period() / 2, acc_bias=0.1 * MG)
    >>> round(float(error.position))  # never more than twice bias R / g
    1274
    """
    time = _times(t)
    position, velocity = _checks.finite("position", position), _checks.finite("velocity", velocity)
    tilt = _checks.finite("tilt", tilt)
    acc_bias, gyr_bias = _checks.finite("acc_bias", acc_bias), _checks.finite("gyr_bias", gyr_bias)
    w = 2.0 * math.pi / schuler_period(gravity, radius)
    c, s = np.cos(w * time), np.sin(w * time)
    one_less_c = 2.0 * np.sin(0.5 * w * time) ** 2
    push = acc_bias + gravity * tilt
    return ChannelError(
        t=time,
        position=position + (velocity * s + push * one_less_c / w) / w
        + gyr_bias * radius * (time - s / w),
        velocity=velocity * c + push * s / w + gyr_bias * radius * one_less_c,
        tilt=tilt * c - velocity * s / (w * radius) - acc_bias / gravity * one_less_c
        + gyr_bias * s / w,
    )  # fmt: skip


def foucault_error(
    t: ArrayLike,
    lat: float,
    *,
    position_n: ArrayLike = (0.0, 0.0),
    velocity_n: ArrayLike = (0.0, 0.0),
    gravity: float = G0,
    radius: float = MEAN_RADIUS,
) -> tuple[FloatArray, FloatArray]:
    """Return the errors of both horizontal channels of an aligned system on the turning Earth.

    The Coriolis force couples the channels: the oscillation keeps its plane in inertial space
    and so turns over the ground like Foucault's pendulum, clockwise in the northern hemisphere.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s].
    lat : float
        Latitude [rad].
    position_n, velocity_n : array_like, shape (2,)
        Errors at the start, north and east [m], [m/s]. The platform leans as the position error
        makes it, so that a position error oscillates too.
    gravity, radius : float
        [m/s^2], [m].

    Returns
    -------
    position_n, velocity_n : ndarray, shape (n, 2)
        Errors north and east [m], [m/s].

    Notes
    -----
    Vectorised. ``z'' - 2 i omega_ie sin(lat) z' + z g / R = 0`` for ``z = north + i east``.

    Examples
    --------
    >>> p, v = foucault_error([0.0, 600.0], 0.8, velocity_n=(1.0, 0.0))
    >>> p.round(0)
    array([[  0.,   0.],
           [546.,  17.]])
    """
    time = _checks.as_series("t", t)
    north, east = _checks.as_vector("position_n", position_n, 2)
    z0 = complex(north, east)
    north, east = _checks.as_vector("velocity_n", velocity_n, 2)
    z1 = complex(north, east)
    turn = OMEGA_IE * math.sin(_checks.in_range("lat", lat, -math.pi / 2, math.pi / 2))
    w = math.hypot(2.0 * math.pi / schuler_period(gravity, radius), turn)
    # z = exp(i turn t) (a cos wt + b sin wt)
    b = (z1 - 1j * turn * z0) / w
    c, s, plane = np.cos(w * time), np.sin(w * time), np.exp(1j * turn * time)
    z = plane * (z0 * c + b * s)
    dz = 1j * turn * z + plane * w * (b * c - z0 * s)
    return np.stack((z.real, z.imag), axis=-1), np.stack((dz.real, dz.imag), axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StationaryError:
    """Errors of a system at rest.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s].
    position_n, velocity_n : ndarray, shape (n, 3)
        Estimate less truth, north, east, down [m], [m/s].
    phi_n : ndarray, shape (n, 3)
        Attitude error about north, east, down [rad].
    """

    t: FloatArray
    position_n: FloatArray
    velocity_n: FloatArray
    phi_n: FloatArray


def stationary_error(
    t: ArrayLike,
    lla: ArrayLike,
    *,
    position_n: ArrayLike = (0.0, 0.0, 0.0),
    velocity_n: ArrayLike = (0.0, 0.0, 0.0),
    phi_n: ArrayLike = (0.0, 0.0, 0.0),
    gyr_bias_n: ArrayLike = (0.0, 0.0, 0.0),
    acc_bias_n: ArrayLike = (0.0, 0.0, 0.0),
    height: str = "held",
) -> StationaryError:
    """Return how all errors of a system at rest on the turning ellipsoid develop, to first order.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time since the start [s].
    lla : array_like, shape (3,)
        Place [rad, rad, m]; not a pole.
    position_n, velocity_n, phi_n : array_like, shape (3,)
        Errors at the start [m], [m/s], [rad].
    gyr_bias_n, acc_bias_n : array_like, shape (3,)
        Constant biases, measured less true, along north, east and down [rad/s], [m/s^2].
    height : {'held', 'free'}
        As in `Mechanisation`: held, the errors down are zero; free, they grow with
        ``exp(t / 570 s)``.

    Returns
    -------
    StationaryError

    Notes
    -----
    Vectorised; exact for the linear model: matrix exponential of `error_dynamics` with the biases
    as states.

    Examples
    --------
    >>> from strapdown.units import DEG_PER_HR
    >>> error = stationary_error([3600.0], (0.8, 0, 0), gyr_bias_n=(0, 0.01 * DEG_PER_HR, 0))
    >>> (error.position_n[0] / 1852.0).round(2)  # nautical miles: the grade's mile an hour
    array([-0.72, -0.09,  0.  ])
    """
    from scipy.linalg import expm

    time = _checks.as_series("t", t)
    _checks.one_of("height", height, ("held", "free"))
    given = [
        _checks.as_vector(name, value)
        for name, value in (
            ("position_n", position_n), ("velocity_n", velocity_n), ("phi_n", phi_n),
            ("gyr_bias_n", gyr_bias_n), ("acc_bias_n", acc_bias_n),
        )
    ]  # fmt: skip
    F = np.zeros((15, 15))
    F[:9, :9] = error_dynamics(lla, height=height)
    F[6:9, 9:12] = -np.eye(3)
    F[3:6, 12:15] = np.eye(3)
    x0 = np.concatenate(given)
    if height == "held":
        F[5, 14] = x0[2] = x0[5] = 0.0
    x = np.stack([expm(F * float(now)) @ x0 for now in time]) if len(time) else np.empty((0, 15))
    return StationaryError(t=time, position_n=x[:, :3], velocity_n=x[:, 3:6], phi_n=x[:, 6:9])


def error_dynamics(lla: ArrayLike, *, height: str = "held") -> FloatArray:
    """Return the matrix F of the errors of a system at rest: ``dx' = F dx``.

    Parameters
    ----------
    lla : array_like, shape (3,)
        Place [rad, rad, m]; not a pole.
    height : {'held', 'free'}
        See `stationary_error`.

    Returns
    -------
    ndarray, shape (9, 9)
        Rows and columns are position [m], velocity [m/s] and ``phi_n`` [rad], each north, east,
        down. Its eigenvalues show the periods: 84.4 min, the day, and the vertical channel.

    References
    ----------
    .. [1] D. H. Titterton, J. L. Weston, "Strapdown Inertial Navigation Technology", 2nd edition,
           IEE, 2004, section 12.3.

    Examples
    --------
    >>> w = np.abs(np.linalg.eigvals(error_dynamics((0.8, 0.0, 0.0))).imag)
    >>> (2 * np.pi / w[w > 1e-3] / 60).round(1)
    array([81. , 81. , 88.1, 88.1])
    """
    lat, _, above = (float(part) for part in _checks.as_vector("lla", lla))
    _checks.one_of("height", height, ("held", "free"))
    if not math.cos(lat) > 1e-3:
        raise ValueError(
            f"`lla` must not be near a pole, where the errors of north and east have no meaning, "
            f"got latitude {math.degrees(lat):.6g} deg."
        )
    s, c = math.sin(lat), math.cos(lat)
    along = float(meridian_radius(lat)) + above
    across = float(transverse_radius(lat)) + above
    g = float(normal_gravity(lat, above))
    north, down = OMEGA_IE * c, -OMEGA_IE * s
    F = np.zeros((9, 9))
    F[0, 3] = F[1, 4] = F[2, 5] = 1.0
    F[3, 7], F[4, 6] = g, -g
    # -2 omega_ie x v
    F[3, 4], F[4, 3], F[4, 5], F[5, 4] = 2.0 * down, -2.0 * down, 2.0 * north, -2.0 * north
    # turn of n: by its transport, and by the Earth's rate at another latitude
    F[6, 4], F[7, 3], F[8, 4] = 1.0 / across, -1.0 / along, -s / c / across
    F[6, 0], F[8, 0] = down / along, -north / along
    # -omega_in x phi
    F[6, 7], F[7, 6], F[7, 8], F[8, 7] = down, -down, north, -north
    if height == "held":
        F[:, 2] = F[:, 5] = 0.0
        F[2], F[5] = 0.0, 0.0
    else:
        F[5, 2] = 2.0 * g / math.sqrt(along * across)
    return F


def unstable_growth(t: ArrayLike, gravity: float = G0, radius: float = WGS84_A) -> FloatArray:
    """Return by what factor a height error has grown where height is free: ``cosh(t / tau)``.

    Gravity falls with height, so that too great a height makes the system believe that it rises:
    ``tau = sqrt(R / 2 g)``, 570 s.

    Parameters
    ----------
    t : array_like
        Time [s].
    gravity, radius : float
        [m/s^2], [m].

    Returns
    -------
    ndarray

    Examples
    --------
    >>> unstable_growth([0.0, 600.0, 3600.0]).round(1)
    array([  1. ,   1.6, 275.8])
    """
    rate = math.sqrt(
        2.0 * _checks.positive("gravity", gravity) / _checks.positive("radius", radius)
    )
    return np.cosh(rate * _times(t))
