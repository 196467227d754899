"""What the Earth's rotation and shape add to the velocity equation, term by term."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.constants import OMEGA_IE
from strapdown.earth import dcm_ne, earth_rate_n, ecef_from_lla, gravity_n, transport_rate_n


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VelocityTerms:
    """Terms of ``v_n' = f_n + coriolis_n + transport_n + gravity_n``, each (..., 3) [m/s^2].

    Attributes
    ----------
    coriolis_n : ndarray
        ``-2 omega_ie x v``: of motion over the turning Earth.
    transport_n : ndarray
        ``-omega_en x v``: centripetal, of motion over the round Earth.
    gravity_n : ndarray
        Gravity ``g_l``, which is gravitation and centrifugal acceleration together.
    centrifugal_n : ndarray
        ``-omega_ie x (omega_ie x r)``, the part of gravity that the rotation makes.
    """

    coriolis_n: FloatArray
    transport_n: FloatArray
    gravity_n: FloatArray
    centrifugal_n: FloatArray

    @property
    def gravitation_n(self) -> FloatArray:
        """Newton's attraction alone: gravity less its centrifugal part [m/s^2]."""
        return self.gravity_n - self.centrifugal_n

    @property
    def total_n(self) -> FloatArray:
        """What has to be added to the specific force [m/s^2]."""
        return self.coriolis_n + self.transport_n + self.gravity_n


def velocity_terms(lla: ArrayLike, v_n: ArrayLike) -> VelocityTerms:
    """Return the terms of the velocity equation in the local level frame, on WGS 84.

    Parameters
    ----------
    lla : array_like, shape (..., 3)
        Latitude, longitude [rad], height [m]; not a pole.
    v_n : array_like, shape (..., 3)
        Velocity over ground, north, east, down [m/s].

    Returns
    -------
    VelocityTerms

    Notes
    -----
    Vectorised.

    References
    ----------
    .. [1] Thesis E1, sections 2.5.1 and 2.5.3.

    Examples
    --------
    An aircraft that flies east at 250 m/s on 45 degrees of latitude:

    >>> terms = velocity_terms((np.pi / 4, 0.0, 1e4), (0.0, 250.0, 0.0))
    >>> (1e3 * terms.coriolis_n).round(1)  # to the south and up, in mm/s^2
    array([-25.8,   0. , -25.8])
    >>> (1e3 * terms.transport_n).round(1)
    array([-9.8,  0. , -9.8])
    """
    place, v = _checks.as_vectors("lla", lla), _checks.as_vectors("v_n", v_n)
    gravity = gravity_n(place)
    out_e = ecef_from_lla(place) * np.array((1.0, 1.0, 0.0))  # from the Earth's axis
    return VelocityTerms(
        coriolis_n=-2.0 * np.cross(earth_rate_n(place[..., 0]), v),
        transport_n=-np.cross(transport_rate_n(place, v), v),
        gravity_n=gravity,
        centrifugal_n=OMEGA_IE**2 * np.einsum("...ij,...j->...i", dcm_ne(place), out_e),
    )
