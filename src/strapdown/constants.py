"""Physical constants, SI units.

The WGS 84 values are the four defining parameters and what follows from them,
as printed in the standard; the tests derive the second kind from the first.

References
----------
.. [1] NIMA TR8350.2, "Department of Defense World Geodetic System 1984", third
       edition, amendment 1, 2000, chapters 3 and 4.
.. [2] BIPM, "The International System of Units (SI)", 9th edition, 2019.
"""

from typing import Final

# --- WGS 84, defining parameters [1]_ ------------------------------------------------
WGS84_A: Final = 6_378_137.0  # semi-major axis [m]
WGS84_INV_F: Final = 298.257223563  # reciprocal of the flattening
WGS84_GM: Final = 3.986004418e14  # gravitational parameter, atmosphere included [m^3/s^2]
OMEGA_IE: Final = 7.292115e-5  # rate of the Earth relative to inertial space [rad/s]

# --- WGS 84, derived ------------------------------------------------------------------
WGS84_F: Final = 1.0 / WGS84_INV_F  # flattening
WGS84_B: Final = WGS84_A * (1.0 - WGS84_F)  # semi-minor axis [m]
WGS84_E2: Final = WGS84_F * (2.0 - WGS84_F)  # first eccentricity squared
WGS84_EP2: Final = WGS84_E2 / (1.0 - WGS84_E2)  # second eccentricity squared
GAMMA_E: Final = 9.7803253359  # normal gravity at the equator [m/s^2]
GAMMA_P: Final = 9.8321849378  # normal gravity at the poles [m/s^2]
SOMIGLIANA_K: Final = 0.00193185265241  # b gamma_p / (a gamma_e) - 1
SOMIGLIANA_M: Final = 0.00344978650684  # omega^2 a^2 b / GM

# --- Conventional values [2]_ ---------------------------------------------------------
G0: Final = 9.80665  # standard acceleration of free fall [m/s^2]
SPEED_OF_LIGHT: Final = 299_792_458.0  # [m/s]
STANDARD_ATMOSPHERE: Final = 101_325.0  # [Pa]
ZERO_CELSIUS: Final = 273.15  # 0 degC [K]
