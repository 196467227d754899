"""Shape and gravity of the Earth for a mechanisation: ellipsoid, or sphere with ``e2 = 0``.

No angle is taken where a sine and a cosine will do, so that a pole is a point like any other.

References
----------
.. [1] B. R. Bowring, "Transformation from spatial to geographical coordinates", Survey Review
       23(181), 1976.
"""

from math import cos, sin, sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.mechanisation.layout import (
    E2,
    G_E,
    G_E2,
    G_INVERSE,
    G_K,
    G_LINEAR,
    G_LINEAR_S2,
    G_SQUARE,
    A,
)


@kernel
def radii(p: Vec, s2: float) -> tuple[float, float]:
    """Radii of curvature along and across the meridian at the sine squared of latitude [m]."""
    d = 1.0 - p[E2] * s2
    across = p[A] / sqrt(d)
    return (1.0 - p[E2]) * across / d, across


@kernel
def gravity(p: Vec, s2: float, height: float) -> float:
    """Gravity, centrifugal part included [m/s^2]."""
    g = p[G_E] * (1.0 + p[G_K] * s2) / sqrt(1.0 - p[G_E2] * s2)
    if p[G_INVERSE] > 0.0:
        r = p[A] / (p[A] + height)
        g *= r * r
    else:
        g *= 1.0 - (p[G_LINEAR] - p[G_LINEAR_S2] * s2 - p[G_SQUARE] * height) * height
    return float(g)


@kernel
def normal(p: Vec, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Sine and cosine of latitude, distance from the axis and height of a point in ECEF [m].

    Two rounds of Bowring's formula [1]_: exact to rounding, on the ground and in orbit.
    """
    a, e2 = p[A], p[E2]
    flat = sqrt(1.0 - e2)
    b = a * flat
    out = sqrt(x * x + y * y)
    up, aside = z, flat * out
    s, c = 0.0, 1.0
    for _ in range(2):
        k = 1.0 / sqrt(up * up + aside * aside)
        s, c = up * k, aside * k
        s = z + e2 / (1.0 - e2) * b * s * s * s
        c = out - e2 * a * c * c * c
        up, aside = flat * s, c
    k = 1.0 / sqrt(s * s + c * c)
    s, c = s * k, c * k
    return s, c, out, out * c + z * s - a * sqrt(1.0 - e2 * s * s)


@kernel
def ned_axes(lat: float, lon: float) -> tuple[float, float, float, float]:
    """``q_en`` at a latitude and longitude [rad]."""
    cl, sl = cos(0.5 * lon), sin(0.5 * lon)
    half = -0.5 * lat - 0.7853981633974483  # -(lat + pi/2) / 2, the turn about east
    cb, sb = cos(half), sin(half)
    return cl * cb, -sl * sb, cl * sb, sl * cb
