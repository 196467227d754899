"""The Earth: its shape, rotation, gravity and magnetic field.

Frames: e is Earth-centred Earth-fixed (ECEF), n is north-east-down (NED) at a point of the
ellipsoid's normal. ``lla`` is geodetic latitude [rad], longitude [rad] and height above the
WGS 84 ellipsoid [m]. All functions take any leading shape; a NaN makes its own row NaN.

References
----------
.. [1] NIMA TR8350.2, "Department of Defense World Geodetic System 1984", third edition, 2000.
.. [2] P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
       Systems", 2nd edition, Artech House, 2013, chapter 2.
.. [3] B. R. Bowring, "Transformation from spatial to geographical coordinates",
       Survey Review 23(181), 1976.
"""

import datetime as dt
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import LARGEST, as_floats, as_vector, as_vectors, finite, same_shape
from strapdown._types import FloatArray
from strapdown.constants import (
    GAMMA_E,
    OMEGA_IE,
    SOMIGLIANA_K,
    SOMIGLIANA_M,
    WGS84_A,
    WGS84_B,
    WGS84_E2,
    WGS84_EP2,
    WGS84_F,
)
from strapdown.errors import ModelExpiredWarning
from strapdown.units import DEG, KM, NT

if TYPE_CHECKING:
    from pygeomag import GeoMag

POLE_COSINE = 1e-8  # cosine of latitude below which east has no meaning: 6 cm from the pole
CORE_RADIUS = 100e3  # geodetic latitude is not unique near the centre: stop here [m]


# --- shape ------------------------------------------------------------------------------


def meridian_radius(lat: ArrayLike) -> FloatArray:
    """Return R_N [m], the radius of curvature along the meridian, at latitude [rad]."""
    s2 = np.sin(_latitude("lat", lat)) ** 2
    return np.asarray(WGS84_A * (1.0 - WGS84_E2) / (1.0 - WGS84_E2 * s2) ** 1.5)


def transverse_radius(lat: ArrayLike) -> FloatArray:
    """Return R_E [m], the radius of curvature across the meridian, at latitude [rad]."""
    s2 = np.sin(_latitude("lat", lat)) ** 2
    return np.asarray(WGS84_A / np.sqrt(1.0 - WGS84_E2 * s2))


def ecef_from_lla(lla: ArrayLike) -> FloatArray:
    """Return the ECEF position of geodetic coordinates.

    Parameters
    ----------
    lla : array_like, shape (..., 3)
        Latitude in [-pi/2, pi/2], longitude, of any number of turns [rad], and height [m].

    Returns
    -------
    ndarray, shape (..., 3)
        ``r_e`` [m].
    """
    lat, lon, height = _lla("lla", lla)
    normal = transverse_radius(lat)
    p = (normal + height) * np.cos(lat)
    z = ((1.0 - WGS84_E2) * normal + height) * np.sin(lat)
    return np.stack((p * np.cos(lon), p * np.sin(lon), z), axis=-1)


def lla_from_ecef(r_e: ArrayLike) -> FloatArray:
    """Return the geodetic coordinates of an ECEF position.

    Bowring's formula [3]_ is repeated until nothing changes.

    Parameters
    ----------
    r_e : array_like, shape (..., 3)
        Positions [m], at least 100 km from the Earth's centre.

    Returns
    -------
    ndarray, shape (..., 3)
        Latitude in [-pi/2, pi/2] and longitude in [-pi, pi] [rad], height [m]. On the axis
        the longitude is zero.

    Raises
    ------
    ValueError
        If a point is nearer to the centre, where the latitude is not unique.

    Examples
    --------
    >>> from strapdown.units import DEG
    >>> r_e = ecef_from_lla([45 * DEG, 7 * DEG, 250.0])
    >>> (lla_from_ecef(r_e) / [DEG, DEG, 1.0]).round(6)
    array([ 45.,   7., 250.])
    """
    r = as_vectors("r_e", r_e, allow_nan=True)
    x, y, z = np.moveaxis(r, -1, 0)
    p = np.hypot(x, y)
    if (np.hypot(p, z) < CORE_RADIUS).any():
        raise ValueError(
            f"`r_e` must lie at least {CORE_RADIUS / KM:g} km from the Earth's centre, got "
            f"{np.nanmin(np.hypot(p, z)):.6g} m; is it really ECEF in metres?"
        )
    tangent_up, tangent_out = z * WGS84_A, p * WGS84_B  # of the reduced latitude
    lat = np.arctan2(tangent_up, tangent_out)
    for _ in range(20):
        reduced = np.hypot(tangent_up, tangent_out)
        sine, cosine = tangent_up / reduced, tangent_out / reduced
        before = lat
        lat = np.arctan2(
            z + WGS84_EP2 * WGS84_B * sine**3,
            p - WGS84_E2 * WGS84_A * cosine**3,
        )
        tangent_up, tangent_out = (1.0 - WGS84_F) * np.sin(lat), np.cos(lat)
        if not (np.abs(lat - before) > 4e-16).any():
            break
    s, c = np.sin(lat), np.cos(lat)
    height = p * c + z * s - WGS84_A * np.sqrt(1.0 - WGS84_E2 * s * s)
    return np.stack((lat, np.arctan2(y, x), height), axis=-1)


def dcm_ne(lla: ArrayLike) -> FloatArray:
    """Return ``C_ne``, shape (..., 3, 3): its rows are north, east and down seen in e.

    ``v_n = C_ne @ v_e``. At a pole, north is what the given longitude makes it.
    """
    lat, lon, _ = _lla("lla", lla)
    sp, cp, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(sp)
    rows = (-sp * cl, -sp * sl, cp, -sl, cl, zero, -cp * cl, -cp * sl, -sp)
    return np.stack(rows, axis=-1).reshape(*sp.shape, 3, 3)


def ned_from_ecef(r_e: ArrayLike, lla_ref: ArrayLike) -> FloatArray:
    """Return positions in the local tangent plane of a reference point.

    Parameters
    ----------
    r_e : array_like, shape (..., 3)
        ECEF positions [m].
    lla_ref : array_like, shape (3,)
        Origin of the tangent plane: latitude, longitude [rad], height [m].

    Returns
    -------
    ndarray, shape (..., 3)
        North, east and down of each point from the origin [m]. The plane does not bend with
        the Earth: 10 km away the ground lies 7.8 m below it.
    """
    origin = _reference(lla_ref)
    offset = as_vectors("r_e", r_e, allow_nan=True) - ecef_from_lla(origin)
    return np.asarray(offset @ dcm_ne(origin).T)


def ecef_from_ned(r_n: ArrayLike, lla_ref: ArrayLike) -> FloatArray:
    """Return the ECEF position [m] of points in the tangent plane; undoes `ned_from_ecef`."""
    origin = _reference(lla_ref)
    offset = as_vectors("r_n", r_n, allow_nan=True) @ dcm_ne(origin)
    return np.asarray(offset + ecef_from_lla(origin))


def ned_from_lla(lla: ArrayLike, lla_ref: ArrayLike) -> FloatArray:
    """Return north, east, down [m], shape (..., 3), of geodetic points from an origin.

    Parameters
    ----------
    lla, lla_ref : array_like, shape (..., 3) and (3,)
        Latitude, longitude [rad], height [m] of the points and of the tangent plane's origin.
    """
    return ned_from_ecef(ecef_from_lla(lla), lla_ref)


def lla_from_ned(r_n: ArrayLike, lla_ref: ArrayLike) -> FloatArray:
    """Return geodetic coordinates of tangent-plane points; undoes `ned_from_lla`."""
    return lla_from_ecef(ecef_from_ned(r_n, lla_ref))


# --- rotation ---------------------------------------------------------------------------


def earth_rate_n(lat: ArrayLike) -> FloatArray:
    """Return ``omega_ie_n`` [rad/s], shape (..., 3), at latitude [rad], shape (...)."""
    latitude = _latitude("lat", lat)
    return OMEGA_IE * np.stack(
        (np.cos(latitude), np.zeros_like(latitude), -np.sin(latitude)), axis=-1
    )


def transport_rate_n(lla: ArrayLike, v_n: ArrayLike) -> FloatArray:
    """Return ``omega_en_n``, the turn of n that motion over the curved Earth causes.

    Parameters
    ----------
    lla : array_like, shape (..., 3)
        Latitude, longitude [rad], height [m].
    v_n : array_like, shape (..., 3)
        Velocity over ground in NED [m/s].

    Returns
    -------
    ndarray, shape (..., 3)
        Rate of n relative to e, resolved in n [rad/s].

    Raises
    ------
    ValueError
        At a pole, where north turns infinitely fast.
    """
    lat, _, height = _lla("lla", lla)
    v = as_vectors("v_n", v_n, allow_nan=True)
    if (np.cos(lat) < POLE_COSINE).any():
        raise ValueError(
            "`lla` must not be a pole, where NED has no north and turns infinitely fast; "
            "navigate in ECEF or with a wander azimuth there."
        )
    same_shape(lla=lat, v_n=v[..., 0])
    north = v[..., 0] / (meridian_radius(lat) + height)
    east = v[..., 1] / (transverse_radius(lat) + height)
    return np.stack((east, -north, -east * np.tan(lat)), axis=-1)


# --- gravity ----------------------------------------------------------------------------


def normal_gravity(lat: ArrayLike, height: ArrayLike = 0.0) -> FloatArray:
    """Return normal gravity, the gravity of the ellipsoid model.

    Somigliana's formula on the ellipsoid, continued upwards by the second-order series of
    [1]_. The series differs from the closed formula by at most 0.11 um/s^2 up to 1 km of
    height, 0.7 um/s^2 up to 10 km and 11 um/s^2 up to 40 km; real gravity differs from the
    ellipsoid's by up to some 1000 um/s^2.

    Parameters
    ----------
    lat : array_like, shape (...)
        Geodetic latitude [rad].
    height : array_like, shape (...)
        Height above the ellipsoid [m].

    Returns
    -------
    ndarray, shape (...)
        Magnitude of gravity, centrifugal part included [m/s^2].

    Examples
    --------
    >>> from strapdown.units import DEG
    >>> round(float(normal_gravity(45 * DEG)), 5)
    9.8062
    """
    latitude, above = _latitude("lat", lat), as_floats("height", height)
    if (np.abs(above) > LARGEST).any():
        raise ValueError("`height` must be finite or NaN, got inf.")
    same_shape(lat=latitude, height=above)
    s2 = np.sin(latitude) ** 2
    h = above / WGS84_A
    surface = GAMMA_E * (1.0 + SOMIGLIANA_K * s2) / np.sqrt(1.0 - WGS84_E2 * s2)
    linear = 2.0 * (1.0 + WGS84_F + SOMIGLIANA_M - 2.0 * WGS84_F * s2)
    return np.asarray(surface * (1.0 - (linear - 3.0 * h) * h))


def gravity_n(lla: ArrayLike) -> FloatArray:
    """Return ``g_n = (0, 0, +g)`` [m/s^2], shape (..., 3), of `normal_gravity` at ``lla``."""
    lat, _, height = _lla("lla", lla)
    g = normal_gravity(lat, height)
    return np.stack((np.zeros_like(g), np.zeros_like(g), g), axis=-1)


# --- magnetic field ---------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MagneticField:
    """The Earth's magnetic field at a point and a date, by the world magnetic model.

    Attributes
    ----------
    field_n : ndarray, shape (3,)
        Flux density in NED, north being true north [T].
    declination : float
        Angle from true to magnetic north, positive to the east [rad].
    inclination : float
        Angle of the field below the horizon, positive downwards [rad].
    declination_std : float
        One-sigma uncertainty of the declination that the model's authors state [rad];
        NaN before 2015 and after the model's last year. Near the magnetic poles it is large.
    model : str
        Name of the coefficients, such as ``"WMM-2025"``.
    year : float
        The date as a decimal year.
    """

    field_n: FloatArray
    declination: float
    inclination: float
    declination_std: float
    model: str
    year: float


# Epochs of the coefficients; each holds for five years.
_WMM_FILES = {
    2010: "wmm/WMM_2010.COF",
    2015: "wmm/WMM_2015v2.COF",
    2020: "wmm/WMM_2020.COF",
    2025: "wmm/WMM_2025.COF",
}
_WMM_SPAN = 5


def magnetic_field(lla: ArrayLike, date: dt.date | float) -> MagneticField:
    """Return the Earth's magnetic field by the world magnetic model (WMM).

    Parameters
    ----------
    lla : array_like, shape (3,)
        Latitude, longitude [rad], height from -1 km to 850 km [m].
    date : datetime.date, datetime.datetime or float
        The day, or a decimal year such as 2025.5.

    Returns
    -------
    MagneticField
        Field vector, declination, inclination.

    Raises
    ------
    ValueError
        If the height is out of the model's range or the date more than five years out of
        the years 2010 to 2030 that the models cover.

    Warns
    -----
    ModelExpiredWarning
        If the date is out of these years: the nearest model is then extrapolated.

    Notes
    -----
    The WMM describes the field of the core. Rocks and buildings add to it: some tenths of a
    degree in declination in the open, tens of degrees beside steel.

    Examples
    --------
    >>> from strapdown.units import DEG, UT
    >>> field = magnetic_field([52.5 * DEG, 13.3 * DEG, 50.0], 2026.0)
    >>> round(field.declination / DEG, 1), round(field.inclination / DEG, 1)
    (5.0, 68.1)
    >>> (field.field_n / UT).round(1)
    array([18.6,  1.6, 46.4])
    """
    point = as_vector("lla", lla)
    _latitude("lla", point[0])
    if not -1.0 * KM <= point[2] <= 850.0 * KM:
        raise ValueError(f"height of `lla` must lie in [-1000, 850000] m, got {point[2]:g}.")
    year = _decimal_year(date)
    first, end = min(_WMM_FILES), max(_WMM_FILES) + _WMM_SPAN
    if not first - _WMM_SPAN <= year <= end + _WMM_SPAN:
        raise ValueError(
            f"`date` must lie within five years of {first} to {end}, which the magnetic models "
            f"cover, got {year:.2f}."
        )
    model = _wmm(max((epoch for epoch in _WMM_FILES if epoch <= year), default=first))
    if not first <= year <= end:
        warnings.warn(
            f"the magnetic models cover {first} to {end}, got {year:.2f}: {model.model} is "
            "extrapolated, and its declination may be off by a degree; "
            "update the package pygeomag or give the declination yourself.",
            ModelExpiredWarning,
            stacklevel=2,
        )
    result: Any = model.calculate(
        glat=float(point[0] / DEG),
        glon=float(point[1] / DEG),
        alt=float(point[2] / KM),
        time=year,
        allow_date_outside_lifespan=True,
    )
    known = 2015.0 <= year <= end
    return MagneticField(
        field_n=NT * np.array((result.x, result.y, result.z)),
        declination=float(result.d * DEG),
        inclination=float(result.i * DEG),
        declination_std=float(result.calculate_uncertainty().d * DEG) if known else float("nan"),
        model=str(model.model),
        year=year,
    )


@lru_cache(maxsize=len(_WMM_FILES))
def _wmm(epoch: int) -> "GeoMag":
    from pygeomag import GeoMag

    return GeoMag(coefficients_file=_WMM_FILES[epoch])


def _decimal_year(date: dt.date | float) -> float:
    """Return the date as a decimal year; a date without a time zone is UTC."""
    if not isinstance(date, dt.date):
        return finite("date", date)
    moment = (
        date if isinstance(date, dt.datetime) else dt.datetime(date.year, date.month, date.day)
    )
    if moment.tzinfo is not None:
        moment = moment.astimezone(dt.UTC).replace(tzinfo=None)
    start = dt.datetime(moment.year, 1, 1)
    return moment.year + (moment - start) / (dt.datetime(moment.year + 1, 1, 1) - start)


# --- checks -----------------------------------------------------------------------------


def _latitude(name: str, value: ArrayLike) -> FloatArray:
    """Return latitudes [rad]; beyond the poles they are most likely degrees."""
    lat = as_floats(name, value)
    # one rounding beyond pi/2 happens when degrees are converted
    bad = np.abs(lat) > np.pi / 2 * (1.0 + 1e-15)
    if bad.any():
        worst = float(lat[bad].flat[0]) if lat.ndim else float(lat)
        raise ValueError(
            f"latitude in `{name}` must lie in [-pi/2, pi/2] rad, got {worst:g}; "
            "if it is in degrees, multiply it by DEG."
        )
    return lat


def _lla(name: str, value: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude and height of a checked array."""
    lla = as_vectors(name, value, allow_nan=True)
    return _latitude(name, lla[..., 0]), lla[..., 1], lla[..., 2]


def _reference(lla_ref: ArrayLike) -> FloatArray:
    """Return one finite point with a latitude in range."""
    point = as_vector("lla_ref", lla_ref)
    _latitude("lla_ref", point[0])
    return point
