"""The WGS 84 ellipsoid in 40-digit arithmetic, from its four defining parameters.

References
----------
.. [1] B. Hofmann-Wellenhof, H. Moritz, "Physical Geodesy", 2nd edition, Springer, 2006,
       sections 2.7 to 2.9: the closed formulas of normal gravity.
"""

import mpmath as mp

mp.mp.dps = 40

A = mp.mpf("6378137")
F = 1 / mp.mpf("298.257223563")
GM = mp.mpf("3986004.418e8")
OMEGA = mp.mpf("7292115e-11")
B = A * (1 - F)
E2 = (A**2 - B**2) / A**2
LINEAR_E = mp.sqrt(A**2 - B**2)


def ecef(lat, lon, height):
    """ECEF position of geodetic coordinates [rad, rad, m]."""
    lat, lon, height = (mp.mpf(float(x)) for x in (lat, lon, height))
    normal = A**2 / mp.sqrt((A * mp.cos(lat)) ** 2 + (B * mp.sin(lat)) ** 2)
    return [
        (normal + height) * mp.cos(lat) * mp.cos(lon),
        (normal + height) * mp.cos(lat) * mp.sin(lon),
        ((B / A) ** 2 * normal + height) * mp.sin(lat),
    ]


def gravity(lat, height):
    """Magnitude of normal gravity in space, by the closed formulas of [1]_."""
    x, _, z = ecef(lat, 0, height)
    d = x**2 + z**2 - LINEAR_E**2
    u2 = d / 2 * (1 + mp.sqrt(1 + 4 * LINEAR_E**2 * z**2 / d**2))
    u = mp.sqrt(u2)
    v2 = u2 + LINEAR_E**2
    beta = mp.atan2(z * mp.sqrt(v2), u * x)
    w = mp.sqrt((u2 + LINEAR_E**2 * mp.sin(beta) ** 2) / v2)

    def q(s):
        return ((1 + 3 * s**2 / LINEAR_E**2) * mp.atan(LINEAR_E / s) - 3 * s / LINEAR_E) / 2

    q_prime = 3 * (1 + u2 / LINEAR_E**2) * (1 - u / LINEAR_E * mp.atan(LINEAR_E / u)) - 1
    centrifugal = OMEGA**2 * A**2
    gamma_u = (
        -GM / v2
        - centrifugal * LINEAR_E / v2 * q_prime / q(B) * (mp.sin(beta) ** 2 / 2 - mp.mpf(1) / 6)
        + OMEGA**2 * u * mp.cos(beta) ** 2
    ) / w
    gamma_beta = (
        (centrifugal / mp.sqrt(v2) * q(u) / q(B) - OMEGA**2 * mp.sqrt(v2))
        * mp.sin(beta)
        * mp.cos(beta)
        / w
    )
    return mp.sqrt(gamma_u**2 + gamma_beta**2)
