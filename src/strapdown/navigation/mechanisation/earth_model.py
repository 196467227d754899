"""The Earth that a mechanisation goes by: the ellipsoid or a sphere, and its gravity."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.constants import (
    G0,
    GAMMA_E,
    OMEGA_IE,
    SOMIGLIANA_K,
    SOMIGLIANA_M,
    WGS84_A,
    WGS84_E2,
    WGS84_F,
)
from strapdown.kernels.mechanisation import layout as k

GRAVITIES: Final = ("somigliana", "gradient", "spherical")


@dataclass(frozen=True, slots=True, kw_only=True)
class SphericalEarth:
    """A sphere that turns, with gravity towards its centre: the Earth of the theses.

    Parameters
    ----------
    radius : float
        Radius R0 [m].
    gravity : float
        On its surface, centrifugal part included [m/s^2].
    rate : float
        Rate of rotation [rad/s]. Zero makes it stand still.
    """

    radius: float = WGS84_A
    gravity: float = G0
    rate: float = OMEGA_IE

    def __post_init__(self) -> None:
        """Check the parameters."""
        _checks.positive("radius", self.radius)
        _checks.positive("gravity", self.gravity)
        _checks.finite("rate", self.rate)


def fill(p: FloatArray, earth: str | SphericalEarth, gravity: str | float | None) -> None:
    """Write shape, rotation and gravity into a kernel's parameters."""
    if isinstance(earth, str):
        _checks.one_of("earth", earth, ("wgs84", "spherical"))
    elif not isinstance(earth, SphericalEarth):
        raise TypeError(
            f"`earth` must be 'wgs84', 'spherical' or a SphericalEarth, got {earth!r}."
        )
    sphere = None
    if earth == "wgs84":
        p[k.A], p[k.E2], p[k.OMEGA] = WGS84_A, WGS84_E2, OMEGA_IE
    else:
        sphere = earth if isinstance(earth, SphericalEarth) else SphericalEarth()
        p[k.A], p[k.E2], p[k.OMEGA] = sphere.radius, 0.0, sphere.rate
    if gravity is None:
        gravity = "somigliana" if sphere is None else "spherical"
    if isinstance(gravity, str):
        _checks.one_of("gravity", gravity, GRAVITIES)
    else:  # one value everywhere
        p[k.G_E] = _checks.positive("gravity", gravity, allow_zero=True)
        return
    if gravity == "spherical":
        p[k.G_E] = G0 if sphere is None else sphere.gravity
        p[k.G_INVERSE] = 1.0
        return
    p[k.G_E], p[k.G_K], p[k.G_E2] = GAMMA_E, SOMIGLIANA_K, WGS84_E2
    p[k.G_LINEAR] = 2.0 * (1.0 + WGS84_F + SOMIGLIANA_M) / WGS84_A
    p[k.G_LINEAR_S2] = 4.0 * WGS84_F / WGS84_A
    p[k.G_SQUARE] = 3.0 / WGS84_A**2 if gravity == "somigliana" else 0.0


def ecef_from_lla(p: FloatArray, lla: FloatArray) -> FloatArray:
    """Return the ECEF position of a point on the Earth of a kernel's parameters."""
    s, c = np.sin(lla[0]), np.cos(lla[0])
    across = p[k.A] / np.sqrt(1.0 - p[k.E2] * s * s)
    out = (across + lla[2]) * c
    z = ((1.0 - p[k.E2]) * across + lla[2]) * s
    return np.array((out * np.cos(lla[1]), out * np.sin(lla[1]), z))
