"""From a motion to what it means on the turning, curved Earth.

A motion says where the vehicle is and how it is turned, as functions of time that know their
derivatives. Velocity, angular rate and specific force follow from these in closed form:

``v_n = ((R_N + h) lat', (R_E + h) cos(lat) lon', -h')``

``f_n = v_n' + (2 omega_ie_n + omega_en_n) x v_n - g_n``

``omega_ib_b = omega_nb_b + C_bn (omega_ie_n + omega_en_n)``, ``omega_nb_b = 2 q_nb* q_nb'``

Earth rate, transport rate and Somigliana's gravity are those of `strapdown.earth`.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_quats, as_times, as_vector
from strapdown._types import FloatArray
from strapdown.constants import WGS84_A, WGS84_E2
from strapdown.earth import (
    earth_rate_n,
    gravity_n,
    magnetic_field,
    meridian_radius,
    transport_rate_n,
    transverse_radius,
)
from strapdown.rotation import dcm_from_quat, quat_normalize
from strapdown.simulation.jet import Jet, atan2, constant, sin_cos, sqrt
from strapdown.truth import Truth

EPOCH_UTC = "2026-03-20T12:00:00Z"  # of `t = 0`, unless a scenario says otherwise

Quat = tuple[Jet, Jet, Jet, Jet]


class Pose(NamedTuple):
    """Where the vehicle is and how it is turned.

    Attributes
    ----------
    path : tuple of three Jet, at least of order 2
        North, east and down [m], measured along the Earth's surface from the place: north on
        the meridian's circle of curvature there, east on the parallel's, down from its height.
    q_nv : tuple of four Jet, at least of order 1, or None
        Attitude of the vehicle relative to the NED axes of where it is.
    tangent : tuple of three Jet, at least of order 1, optional
        Where there is no `q_nv`: direction of the path, of any length but zero, measured like
        the path. The vehicle's x axis follows it.
    roll : Jet, optional
        Roll about that axis [rad].
    """

    path: tuple[Jet, Jet, Jet]
    q_nv: Quat | None
    tangent: tuple[Jet, Jet, Jet] | None = None
    roll: Jet | None = None


class Motion(Protocol):
    """A motion in closed form."""

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        ...


def truth(
    motion: Motion,
    t: ArrayLike,
    place: ArrayLike,
    *,
    epoch_utc: str = EPOCH_UTC,
    m_n: ArrayLike | None = None,
    q_vb: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    meta: Mapping[str, Any] | None = None,
) -> Truth:
    """Return the exact motion of the box at the given times.

    Parameters
    ----------
    motion : Motion
        What moves, and how.
    t : array_like, shape (n,)
        Times, strictly increasing [s].
    place : array_like, shape (3,)
        Latitude, longitude [rad] and height [m] from which the path is measured; not a pole.
    epoch_utc : str
        Date of ``t = 0``, ISO 8601, for the magnetic field.
    m_n : array_like, shape (3,), optional
        Magnetic field, NED [T]; that of the world magnetic model at the place by default. It
        is the same along the whole path.
    q_vb : array_like, shape (4,)
        How the box sits in the vehicle.
    meta : mapping, optional
        Facts to keep with the truth.

    Returns
    -------
    Truth
        Attitude, rate, specific force, position and velocity of one and the same motion,
        consistent to rounding.

    Raises
    ------
    ValueError
        If the place is a pole, times do not increase, or `epoch_utc` is no date.

    Examples
    --------
    >>> from strapdown.simulation.motions import Static
    >>> truth(Static(), [0.0, 1.0], [0.8, 0.2, 500.0]).f_b.round(3)
    array([[ 0.   ,  0.   , -9.805],
           [ 0.   ,  0.   , -9.805]])
    """
    if not callable(getattr(motion, "pose", None)):
        raise TypeError(
            f"`motion` must be a motion with a method `pose`, got {type(motion).__name__}; "
            "`simulation.motions` has some."
        )
    times, origin = as_times("t", t), as_vector("place", place)
    mount = as_quats("q_vb", q_vb)
    if np.cos(origin[0]) < 1e-6:
        raise ValueError("`place` must not be a pole, where the path has no north and no east.")
    pose = motion.pose(times)
    lla, v_n, a_n, scale = _on_the_ellipsoid(pose.path, origin)
    omega_ie_n, omega_en_n = earth_rate_n(lla[:, 0]), transport_rate_n(lla, v_n)
    f_n = a_n + np.cross(2.0 * omega_ie_n + omega_en_n, v_n) - gravity_n(lla)

    q_nv = _attitude(pose, scale)
    q = _mul(q_nv, _constant_quat(mount, q_nv[0]))
    q_nb = np.stack([part.value for part in q], axis=1)
    rate = _mul(_conj(q), tuple(part.derivative() for part in q))
    omega_nb_b = 2.0 * np.stack([part.value for part in rate[1:]], axis=1)
    C_nb = dcm_from_quat(q_nb)
    if m_n is None:
        field = magnetic_field(origin, datetime.fromisoformat(epoch_utc)).field_n
    else:
        field = as_vector("m_n", m_n)
    return Truth(
        t=times,
        q_nb=quat_normalize(q_nb),
        omega_ib_b=omega_nb_b + _to_body(C_nb, omega_ie_n + omega_en_n),
        f_b=_to_body(C_nb, f_n),
        lla=lla,
        v_n=v_n,
        m_n=np.tile(field, (len(times), 1)),
        meta={"epoch_utc": epoch_utc, **(meta or {})},
    )


def _on_the_ellipsoid(
    path: tuple[Jet, Jet, Jet], origin: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[Jet, Jet]]:
    """Return position, velocity, its derivative, and metres per metre of the path's axes."""
    north, east, down = (part.to(2) for part in path)
    north_radius = float(meridian_radius(origin[0])) + origin[2]
    east_radius = (float(transverse_radius(origin[0])) + origin[2]) * np.cos(origin[0])
    lat = north / north_radius + origin[0]
    lon = east / east_radius + origin[1]
    height = origin[2] - down
    sine, cosine = sin_cos(lat)
    w = 1.0 - WGS84_E2 * sine * sine
    transverse = WGS84_A / sqrt(w)  # R_E
    meridian = (1.0 - WGS84_E2) * transverse / w  # R_N
    on_meridian, on_parallel = meridian + height, (transverse + height) * cosine
    velocity = (
        on_meridian * lat.derivative(),
        on_parallel * lon.derivative(),
        -height.derivative(),
    )
    lla = np.stack((lat.value, lon.value, height.value), axis=1)
    v_n = np.stack([part.value for part in velocity], axis=1)
    a_n = np.stack([part.derivative().value for part in velocity], axis=1)
    return lla, v_n, a_n, (on_meridian / north_radius, on_parallel / east_radius)


def _attitude(pose: Pose, scale: tuple[Jet, Jet]) -> Quat:
    """Return the given attitude, or that of the path."""
    if pose.q_nv is not None:
        return pose.q_nv
    if pose.tangent is None or pose.roll is None:
        raise ValueError("a pose must have `q_nv`, or `tangent` and `roll`, got neither.")
    ahead, aside, below = pose.tangent
    ahead, aside = ahead * scale[0], aside * scale[1]
    pitch = atan2(-below, sqrt(ahead * ahead + aside * aside))
    return quat_from_angles(pose.roll, pitch, atan2(aside, ahead))


def quat_from_angles(roll: Jet, pitch: Jet, yaw: Jet) -> Quat:
    """Return the quaternion of roll, pitch and yaw [rad]."""
    (sr, cr), (sp, cp), (sy, cy) = (sin_cos(angle * 0.5) for angle in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _constant_quat(q: FloatArray, like: Jet) -> Quat:
    w, x, y, z = (constant(float(part), like) for part in q)
    return w, x, y, z


def _conj(q: Quat) -> Quat:
    return q[0], -q[1], -q[2], -q[3]


def _mul(a: Quat, b: tuple[Jet, ...]) -> Quat:
    """Hamilton product."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _to_body(C_nb: FloatArray, v_n: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("kji,kj->ki", C_nb, v_n))
