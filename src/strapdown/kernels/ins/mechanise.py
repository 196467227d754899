"""Strapdown mechanisation in NED on WGS-84, one IMU sample at a time.

The gravity, the Earth's rate and the radii change slowly; `earth_terms` renews them at the rate
of the covariance (10 Hz), where a car moves 3 m and an aircraft 30 m between two of them.

References
----------
.. [1] P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
       Systems", 2nd edition, Artech House, 2013, sections 2.4 and 5.4.
"""

from math import cos, pi, sin, sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.ins.layout import (
    ACC_N,
    BA,
    BG,
    DT,
    GRAVITY,
    LLA,
    R_E,
    R_N,
    RATE,
    S_C,
    S_CF,
    S_CW,
    S_F,
    SA,
    SG,
    W_COR,
    W_IN,
    Q,
    V,
)
from strapdown.kernels.quat import dcm, exp, mul, rotate, rotate_inverse

A = 6378137.0  # semi-major axis [m]
E2 = 0.0066943799901413165  # first eccentricity squared
FLATTENING = 0.0033528106647474805
OMEGA_IE = 7.292115e-5  # [rad/s]
GAMMA_E = 9.7803253359  # normal gravity at the equator [m/s^2]
SOMIGLIANA_K = 0.00193185265241
SOMIGLIANA_M = 0.00344978650684
LEAST_COSINE = 1e-5  # 64 m from the pole, where north turns too fast to follow
SMOOTHING = 0.1  # of acceleration and rate [s]


@kernel
def earth_terms(x: Vec) -> None:
    """Renew gravity, Earth and transport rate and radii; keep longitude in (-pi, pi]."""
    if x[LLA + 1] > pi:
        x[LLA + 1] -= 2.0 * pi
    if x[LLA + 1] <= -pi:
        x[LLA + 1] += 2.0 * pi
    x[LLA] = min(max(x[LLA], -0.5 * pi), 0.5 * pi)
    height = x[LLA + 2]
    s = sin(x[LLA])
    c = max(cos(x[LLA]), LEAST_COSINE)
    s2 = s * s
    d = 1.0 - E2 * s2
    root = sqrt(d)
    x[R_N] = A * (1.0 - E2) / (d * root) + height
    normal = A / root + height
    x[R_E] = normal * c
    r = height / A
    surface = GAMMA_E * (1.0 + SOMIGLIANA_K * s2) / root
    slope = 1.0 + FLATTENING + SOMIGLIANA_M - 2.0 * FLATTENING * s2
    x[GRAVITY] = surface * (1.0 - 2.0 * slope * r + 3.0 * r * r)
    en = x[V + 1] / normal
    ee = -x[V] / x[R_N]
    ed = -en * s / c
    x[W_IN] = OMEGA_IE * c + en
    x[W_IN + 1] = ee
    x[W_IN + 2] = -OMEGA_IE * s + ed
    x[W_COR] = 2.0 * OMEGA_IE * c + en
    x[W_COR + 1] = ee
    x[W_COR + 2] = -2.0 * OMEGA_IE * s + ed


# fmt: off
@kernel
def advance(
    x: Vec, dt: float, gx: float, gy: float, gz: float, fx: float, fy: float, fz: float
) -> None:
    """Advance attitude, velocity and position by one sample, and the sums over the tick.

    The specific force acts with the attitude of the middle of the interval.
    """
    # fmt: on
    w, a, b, c = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    gx, gy, gz = gx - x[BG], gy - x[BG + 1], gz - x[BG + 2]
    _un, _ue, turn = rotate(w, a, b, c, gx, gy, gz)
    gx, gy, gz = gx - x[SG] * turn, gy - x[SG + 1] * turn, gz - x[SG + 2] * turn
    fx = (fx - x[BA]) * (1.0 - x[SA])
    fy = (fy - x[BA + 1]) * (1.0 - x[SA + 1])
    fz = (fz - x[BA + 2]) * (1.0 - x[SA + 2])
    ix, iy, iz = rotate_inverse(w, a, b, c, x[W_IN], x[W_IN + 1], x[W_IN + 2])
    half = 0.5 * dt
    dw, da, db, dc = exp((gx - ix) * half, (gy - iy) * half, (gz - iz) * half)
    w, a, b, c = mul(w, a, b, c, dw, da, db, dc)
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = dcm(w, a, b, c)
    w, a, b, c = mul(w, a, b, c, dw, da, db, dc)
    s = 1.5 - 0.5 * (w * w + a * a + b * b + c * c)  # Newton step towards unit norm
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = w * s, a * s, b * s, c * s
    fn = c0 * fx + c1 * fy + c2 * fz
    fe = c3 * fx + c4 * fy + c5 * fz
    fd = c6 * fx + c7 * fy + c8 * fz
    vn, ve, vd = x[V], x[V + 1], x[V + 2]
    kn, ke, kd = x[W_COR], x[W_COR + 1], x[W_COR + 2]
    an = fn - (ke * vd - kd * ve)
    ae = fe - (kd * vn - kn * vd)
    ad = fd - (kn * ve - ke * vn) + x[GRAVITY]
    x[V], x[V + 1], x[V + 2] = vn + an * dt, ve + ae * dt, vd + ad * dt
    x[LLA] += (vn + half * an) * dt / x[R_N]
    x[LLA + 1] += (ve + half * ae) * dt / x[R_E]
    x[LLA + 2] -= (vd + half * ad) * dt
    k = dt / (SMOOTHING + dt)
    x[ACC_N] += k * (an - x[ACC_N])
    x[ACC_N + 1] += k * (ae - x[ACC_N + 1])
    x[ACC_N + 2] += k * (ad - x[ACC_N + 2])
    x[RATE] += k * (gx - x[RATE])
    x[RATE + 1] += k * (gy - x[RATE + 1])
    x[RATE + 2] += k * (gz - x[RATE + 2])
    x[DT] += dt
    x[S_F] += fn * dt
    x[S_F + 1] += fe * dt
    x[S_F + 2] += fd * dt
    _add_columns(x, S_C, dt, dt, dt, c0, c1, c2, c3, c4, c5, c6, c7, c8)
    _add_columns(x, S_CW, turn * dt, turn * dt, turn * dt, c0, c1, c2, c3, c4, c5, c6, c7, c8)
    _add_columns(x, S_CF, fx * dt, fy * dt, fz * dt, c0, c1, c2, c3, c4, c5, c6, c7, c8)


# fmt: off
@kernel
def _add_columns(
    x: Vec, at: int, kx: float, ky: float, kz: float,
    c0: float, c1: float, c2: float, c3: float, c4: float, c5: float,
    c6: float, c7: float, c8: float,
) -> None:
    """Add ``C diag(kx, ky, kz)`` to the nine numbers from ``x[at]``."""
    # fmt: on
    x[at] += c0 * kx
    x[at + 1] += c1 * ky
    x[at + 2] += c2 * kz
    x[at + 3] += c3 * kx
    x[at + 4] += c4 * ky
    x[at + 5] += c5 * kz
    x[at + 6] += c6 * kx
    x[at + 7] += c7 * ky
    x[at + 8] += c8 * kz
