"""What the frames differ in: how they turn, what gravity is, how position follows velocity.

For each: `*_middle` writes the turn of the frame and the change of velocity by gravity and
Coriolis for the middle of the step, to which it goes with the first half of the specific force
and the terms of the step before; `*_move` advances the position with the mean velocity.

========  ==============================================  ===========================
Frame     velocity                                        position
========  ==============================================  ===========================
inertial  ``v_i' = f + g + omega_ie x (omega_ie x r)``    ``r_i' = v_i``
ECEF      ``v_e' = f - 2 omega_ie x v + g``               ``r_e' = v_e``
NED       ``v_n' = f - (2 omega_ie + omega_en) x v + g``  latitude, longitude, height
wander    ``v_w' = f - (2 omega_ie + omega_ew) x v + g``  ``q_ew``, height
========  ==============================================  ===========================

The inertial one is (2.5.9) of [1]_ with ``v_i = v + omega_ie x r`` in place of the velocity over
ground, which leaves Newton's law.

References
----------
.. [1] Thesis E1, sections 2.5.1 to 2.5.4.
"""

from math import cos, sin

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.mechanisation.ellipsoid import gravity, normal, radii
from strapdown.kernels.mechanisation.layout import (
    E2,
    ECEF,
    FRAME,
    HEIGHT,
    HELD,
    LEAST_COSINE,
    OMEGA,
    POLE,
    POS,
    Q_EW,
    R_E,
    R_N,
    REST,
    STATUS,
    TURN,
    W_COR,
    W_EX,
    W_IN,
    G,
    U,
    V,
)
from strapdown.kernels.quat import down_in_body, normalize

# --- inertial and ECEF --------------------------------------------------------------------


@kernel
def cartesian_middle(x: Vec, p: Vec, w: Vec, h: float) -> None:
    """Terms of the inertial or Earth frame for a step of h [s]."""
    omega = p[OMEGA]
    on_earth = 1.0 if int(p[FRAME]) == ECEF else 0.0
    coriolis = 2.0 * omega * on_earth
    vx = x[V] + 0.5 * (w[U] + (x[G] + coriolis * x[V + 1]) * h)
    vy = x[V + 1] + 0.5 * (w[U + 1] + (x[G + 1] - coriolis * x[V]) * h)
    vz = x[V + 2] + 0.5 * (w[U + 2] + x[G + 2] * h)
    # way to the middle: h/2 of the mean of its two velocities
    rx = x[POS] + 0.25 * h * (x[V] + vx)
    ry = x[POS + 1] + 0.25 * h * (x[V + 1] + vy)
    rz = x[POS + 2] + 0.25 * h * (x[V + 2] + vz)
    s, c, out, height = normal(p, rx, ry, rz)
    g = gravity(p, s * s, height)
    k = -g * c / out if out > 0.0 else 0.0
    if on_earth == 0.0:
        k -= omega * omega
    x[G], x[G + 1], x[G + 2] = k * rx, k * ry, -g * s
    x[W_IN + 2] = on_earth * omega
    w[TURN], w[TURN + 1], w[TURN + 2] = 0.0, 0.0, on_earth * omega * h
    w[REST] = (x[G] + coriolis * vy) * h
    w[REST + 1] = (x[G + 1] - coriolis * vx) * h
    w[REST + 2] = x[G + 2] * h


@kernel
def cartesian_move(x: Vec, p: Vec, h: float, vx: float, vy: float, vz: float) -> None:
    """Advance ``r`` by the mean velocity."""
    x[POS] += vx * h
    x[POS + 1] += vy * h
    x[POS + 2] += vz * h
    if p[HELD] > 0.0:
        s, c, out, height = normal(p, x[POS], x[POS + 1], x[POS + 2])
        k = c / out if out > 0.0 else 0.0
        ux, uy = k * x[POS], k * x[POS + 1]
        rise = x[HEIGHT] - height
        x[POS] += rise * ux
        x[POS + 1] += rise * uy
        x[POS + 2] += rise * s
        # up has no component along omega x r, so this takes the same from v_i as from v_e
        climb = x[V] * ux + x[V + 1] * uy + x[V + 2] * s
        x[V] -= climb * ux
        x[V + 1] -= climb * uy
        x[V + 2] -= climb * s


# --- NED ------------------------------------------------------------------------------------


@kernel
def ned_middle(x: Vec, p: Vec, w: Vec, h: float) -> None:
    """Terms of the local level frame for a step of h [s]."""
    kn, ke, kd = x[W_COR], x[W_COR + 1], x[W_COR + 2]
    vn, ve, vd = x[V], x[V + 1], x[V + 2]
    vn += 0.5 * (w[U] - (ke * x[V + 2] - kd * x[V + 1]) * h)
    ve += 0.5 * (w[U + 1] - (kd * x[V] - kn * x[V + 2]) * h)
    vd += 0.5 * (w[U + 2] + (x[G + 2] - (kn * x[V + 1] - ke * x[V])) * h)
    lat = x[POS] + 0.25 * h * (x[V] + vn) / x[R_N]
    height = x[POS + 2] - 0.25 * h * (x[V + 2] + vd)
    s, c = sin(lat), cos(lat)
    if not c > p[LEAST_COSINE]:
        x[STATUS] = POLE
        c = p[LEAST_COSINE]
    along, across = radii(p, s * s)
    x[R_N] = along + height
    x[R_E] = (across + height) * c
    x[G + 2] = gravity(p, s * s, height)
    x[W_EX] = ve / (across + height)
    x[W_EX + 1] = -vn / x[R_N]
    x[W_EX + 2] = -x[W_EX] * s / c
    _level_terms(x, w, h, p[OMEGA] * c, 0.0, -p[OMEGA] * s, vn, ve, vd)


# fmt: off
@kernel
def _level_terms(
    x: Vec, w: Vec, h: float,
    ix: float, iy: float, iz: float,
    vx: float, vy: float, vz: float,
) -> None:
    """Turn and rest of a level frame from ``omega_ie`` and the velocity, both in it."""
    # fmt: on
    for i in range(3):
        x[W_IN + i] = x[W_EX + i]
    x[W_IN] += ix
    x[W_IN + 1] += iy
    x[W_IN + 2] += iz
    for i in range(3):
        w[TURN + i] = x[W_IN + i] * h
    kx, ky, kz = x[W_IN] + ix, x[W_IN + 1] + iy, x[W_IN + 2] + iz
    x[W_COR], x[W_COR + 1], x[W_COR + 2] = kx, ky, kz
    w[REST] = -(ky * vz - kz * vy) * h
    w[REST + 1] = -(kz * vx - kx * vz) * h
    w[REST + 2] = (x[G + 2] - (kx * vy - ky * vx)) * h


@kernel
def ned_move(x: Vec, h: float, vn: float, ve: float, vd: float) -> None:
    """Advance latitude, longitude and height by the mean velocity."""
    x[POS] += vn * h / x[R_N]
    x[POS + 1] += ve * h / x[R_E]
    x[POS + 2] -= vd * h


# --- wander azimuth -------------------------------------------------------------------------


@kernel
def wander_middle(x: Vec, p: Vec, w: Vec, h: float) -> None:
    """Terms of the wander frame for a step of h [s]."""
    kx, ky, kz = x[W_COR], x[W_COR + 1], x[W_COR + 2]
    vx, vy, vz = x[V], x[V + 1], x[V + 2]
    vx += 0.5 * (w[U] - (ky * x[V + 2] - kz * x[V + 1]) * h)
    vy += 0.5 * (w[U + 1] - (kz * x[V] - kx * x[V + 2]) * h)
    vz += 0.5 * (w[U + 2] + (x[G + 2] - (kx * x[V + 1] - ky * x[V])) * h)
    height = x[POS + 2] - 0.25 * h * (x[V + 2] + vz)
    # the Earth's axis in w: third row of C_ew, turned to the middle of the step
    ax, ay, az = down_in_body(x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3])
    ex, ey = 0.5 * h * x[W_EX], 0.5 * h * x[W_EX + 1]
    ax, ay, az = ax - ey * az, ay + ex * az, az - ex * ay + ey * ax
    _wander_rate(x, p, ax, ay, az, vx, vy, height)
    x[G + 2] = gravity(p, az * az, height)
    _level_terms(x, w, h, p[OMEGA] * ax, p[OMEGA] * ay, p[OMEGA] * az, vx, vy, vz)


# fmt: off
@kernel
def _wander_rate(
    x: Vec, p: Vec, ax: float, ay: float, az: float, vx: float, vy: float, height: float
) -> None:
    """Write ``omega_ew_w``, its third component zero; (ax, ay, az) is the Earth's axis in w.

    The two radii differ by the cosine squared of latitude, and the north component enters
    divided by the same: no division is left that could fail at a pole.
    """
    # fmt: on
    s2 = az * az
    along, across = radii(p, s2)
    along += height
    over = across + height
    k = across * p[E2] / ((1.0 - p[E2] * s2) * along * over) * (vx * ax + vy * ay)
    x[W_EX] = vy / over + k * ay
    x[W_EX + 1] = -vx / over - k * ax
    x[W_EX + 2] = 0.0


@kernel
def wander_move(x: Vec, p: Vec, h: float, vx: float, vy: float, vz: float) -> None:
    """Advance ``q_ew`` and height by the mean velocity."""
    ax, ay, az = down_in_body(x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3])
    ex, ey = 0.5 * h * x[W_EX], 0.5 * h * x[W_EX + 1]
    ax, ay, az = ax - ey * az, ay + ex * az, az - ex * ay + ey * ax
    _wander_rate(x, p, ax, ay, az, vx, vy, x[POS + 2] - 0.5 * h * vz)
    # q_ew exp(omega h) as a sum of q and something small, so that each component is rounded once:
    # a product rounds all steps alike, which drifts by 0.2 mm in ten minutes at 1 kHz
    ex, ey = 0.5 * h * x[W_EX], 0.5 * h * x[W_EX + 1]
    k = -0.5 * (ex * ex + ey * ey)
    qw, qx, qy, qz = x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3]
    qw, qx, qy, qz = (
        qw + (k * qw - qx * ex - qy * ey),
        qx + (k * qx + qw * ex - qz * ey),
        qy + (k * qy + qw * ey + qz * ex),
        qz + (k * qz + qx * ey - qy * ex),
    )
    n2 = qw * qw + qx * qx + qy * qy + qz * qz
    if abs(n2 - 1.0) > 1e-14:
        qw, qx, qy, qz = normalize(qw, qx, qy, qz)
    x[Q_EW], x[Q_EW + 1], x[Q_EW + 2], x[Q_EW + 3] = qw, qx, qy, qz
    x[POS + 2] -= vz * h
