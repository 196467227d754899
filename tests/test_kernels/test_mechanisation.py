"""Leaf functions of the mechanisations against closed forms, exact fractions, SciPy and pyproj."""

from fractions import Fraction
from itertools import combinations, pairwise
from math import comb, factorial

import numpy as np
import pyproj
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.kernels.mechanisation import attitude, ellipsoid, frames, increments, plane
from strapdown.kernels.mechanisation import layout as k
from strapdown.navigation.mechanisation import coning_sculling, earth_model
from strapdown.navigation.mechanisation import increments as weights

WGS84_A, WGS84_INV_F = 6378137.0, 298.257223563
E2 = (2 - 1 / WGS84_INV_F) / WGS84_INV_F
OMEGA = 7.292115e-5


def parameters(frame=k.NED, kind=k.QUATERNION, samples=2, earth="wgs84", gravity=None):
    p = np.zeros(k.P_SIZE)
    p[k.FRAME], p[k.ATTITUDE] = frame, kind
    earth_model.fill(p, earth, gravity)
    weights.fill(p, samples, compensate=True)
    return p


def cross(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


# --- weights of the samples, in exact fractions --------------------------------------------


def polynomials(m):
    """Coefficients, lowest first, of the rate of degree m - 1 with mean 1 m in one of m parts."""
    parts = [Fraction(i, m) for i in range(m + 1)]
    rows = [
        [(b ** (n + 1) - a ** (n + 1)) / (n + 1) for n in range(m)] for a, b in pairwise(parts)
    ]
    inverse = solve(rows)
    return [[inverse[n][i] for n in range(m)] for i in range(m)]


def solve(rows):
    """Inverse of a matrix of fractions by Gauss and Jordan."""
    n = len(rows)
    a = [list(row) + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(rows)]
    for i in range(n):
        pivot = next(r for r in range(i, n) if a[r][i] != 0)
        a[i], a[pivot] = a[pivot], a[i]
        a[i] = [x / a[i][i] for x in a[i]]
        for r in range(n):
            if r != i:
                a[r] = [x - a[r][i] * y for x, y in zip(a[r], a[i], strict=True)]
    return [row[n:] for row in a]


def monomial(n):
    """Coefficients of (t - 1/2)^n, lowest first."""
    return [Fraction(comb(n, i)) * Fraction(-1, 2) ** (n - i) for i in range(n + 1)]


def cells(f, m):
    """Integrals of a polynomial over the m parts of (0, 1)."""
    whole = [
        sum(c * Fraction(i, m) ** (n + 1) / (n + 1) for n, c in enumerate(f)) for i in range(m + 1)
    ]
    return [b - a for a, b in pairwise(whole)]


def half_integral(f, g):
    """1/2 of the integral over (0, 1) of (integral of f) times g."""
    return sum(
        x / (i + 1) * y / (i + j + 2) for i, x in enumerate(f) for j, y in enumerate(g)
    ) / Fraction(2)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_rates_at_start_middle_and_end_are_those_of_the_polynomial_through_the_samples(m):
    p = parameters(samples=m)
    basis = polynomials(m)
    for at, time in ((k.AT_START, 0), (k.AT_MIDDLE, Fraction(1, 2)), (k.AT_END, 1)):
        exact = [sum(c * Fraction(time) ** n for n, c in enumerate(f)) for f in basis]
        assert p[at : at + m] == pytest.approx([float(x) for x in exact], rel=1e-15)


@pytest.mark.parametrize(("m", "degree"), [(2, 1), (3, 1), (4, 2)])
def test_products_are_exact_for_rates_of_low_degree(m, degree):
    p = parameters(samples=m)
    for n, o in combinations(range(degree + 1), 2):
        f, g = monomial(n), monomial(o)
        exact = half_integral(f, g) - half_integral(g, f)
        F, G = cells(f, m), cells(g, m)
        found = sum(
            p[k.CONING + 4 * i + j] * float(F[i] * G[j] - G[i] * F[j])
            for i, j in combinations(range(m), 2)
        )
        assert found == pytest.approx(float(exact), rel=1e-13)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_products_null_the_first_terms_of_the_coning_error(m):
    """Of a circle in steps of angle m x: 4 sin(x/2)^2 sin(l x) per product at distance l."""
    p = parameters(samples=m)
    sums = [sum(p[k.CONING + 5 * i + d] for i in range(m - d)) for d in range(1, m)]
    # the error's series in x, from the third power on; 4 sin(x/2)^2 = 2 - 2 cos x
    for n in range(1, m):
        power = 2 * n + 1
        sign = (-1) ** n / float(factorial(power))
        found = sum(
            weight * sign * (2 * d**power - (d + 1) ** power - (d - 1) ** power)
            for d, weight in enumerate(sums, 1)
        )
        assert found == pytest.approx(-0.5 * sign * m**power, rel=1e-12)


def test_weights_with_the_sample_before_are_those_of_the_line_through_both():
    p = parameters(samples=1)
    # means a - b over (-1, 0) and a + b... of a rate a + b (t - 1/2): before a - b, now a
    a, b = np.array([0.1, -0.2, 0.3]), np.array([0.4, 0.1, -0.2])
    before, now = a - b, a
    assert p[k.CONING + 1] * np.cross(before, now) == pytest.approx(np.cross(a, b) / 12, rel=1e-14)
    for at, time in ((k.AT_START, 0.0), (k.AT_MIDDLE, 0.5), (k.AT_END, 1.0)):
        assert p[at] * before + p[at + 1] * now == pytest.approx(a + b * (time - 0.5), rel=1e-14)


# --- rotation and velocity of a step ----------------------------------------------------------


def moved(rate, force, h):
    """Rotation matrix and velocity over (0, h) by an eighth-order integrator."""

    def slope(t, y):
        C = y[:9].reshape(3, 3)
        return np.concatenate(((C @ cross(rate(t))).ravel(), C @ force(t)))

    y0 = np.concatenate((np.eye(3).ravel(), np.zeros(3)))
    y = solve_ivp(slope, (0.0, h), y0, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return y[:9].reshape(3, 3), y[9:]


def parts(function, h, m):
    """Exact increments of the m parts of (0, h), by Gauss-Legendre."""
    x, w = np.polynomial.legendre.leggauss(12)
    ends = np.linspace(0.0, h, m + 1)
    return np.array(
        [
            sum(
                0.5 * (b - a) * wi * function(0.5 * (a + b) + 0.5 * (b - a) * xi)
                for xi, wi in zip(x, w, strict=True)
            )
            for a, b in pairwise(ends)
        ]
    )


def rate(t):
    return np.array([2 * np.sin(3 * t + 0.3), 1.5 * np.cos(2 * t), 1 - np.sin(4 * t)])


def force(t):
    return np.array([5 * np.cos(3 * t), -9.8 + 3 * np.sin(2 * t), 4 * np.sin(5 * t + 1)])


@pytest.mark.parametrize(("m", "order"), [(1, 3), (2, 5), (3, 5), (4, 5)])
def test_a_step_of_turning_under_changing_force_has_its_local_order(m, order):
    found = []
    for h in (0.1, 0.05):
        phi, dvel = coning_sculling(parts(rate, h, m), parts(force, h, m))
        C, v = moved(rate, force, h)
        turn = (Rotation.from_matrix(C).inv() * Rotation.from_rotvec(phi)).magnitude()
        found.append((turn, np.linalg.norm(dvel - v)))
    fall = np.log2(np.array(found[0]) / found[1])
    assert fall == pytest.approx([order, order], abs=0.35)


@pytest.mark.parametrize("size", [1e-9, 0.05, 0.0999, 0.1001, 2.0, 3.1])
def test_constant_rate_and_force_are_exact_at_any_angle(size):
    phi = size * np.array([0.6, -0.48, 0.64])
    s = np.array([3.0, -1.0, 9.0])
    J = expm(np.block([[cross(phi), s[:, None]], [np.zeros((1, 4))]]))  # upper right: J s
    assert increments.left_jacobian(*phi, *s) == pytest.approx(J[:3, 3], rel=1e-14)
    C = np.array(increments.rotation_matrix(*phi)).reshape(3, 3)
    assert np.abs(C - Rotation.from_rotvec(phi).as_matrix()).max() < 4e-16


@pytest.mark.parametrize(("m", "power"), [(1, 2), (2, 4), (3, 6), (4, 8)])
def test_coning_drift_falls_as_miller_says(m, power):
    """A cone of angle a at the rate w: uncompensated drift is a^2 w (1 - sin(wT) / wT) / 2.

    What m samples leave of it is in proportion to ``(w T)^(2 m)``.
    """
    angle, w = 2e-3, 2 * np.pi

    def body(t):  # turned by the angle about an axis that goes round y and z
        return Rotation.from_rotvec(angle * np.array([0.0, np.cos(w * t), np.sin(w * t)]))

    def cone(t):
        return np.array(
            [-2 * w * np.sin(angle / 2) ** 2,
             -w * np.sin(angle) * np.sin(w * t), w * np.sin(angle) * np.cos(w * t)]
        )  # fmt: skip

    left = []
    for h in (0.5, 0.25):
        phi, _ = coning_sculling(parts(cone, h, m), np.zeros((m, 3)))
        true = (body(0.0).inv() * body(h)).as_rotvec()
        left.append(abs(phi[0] - true[0]) / h)
        if m == 1:  # all of it is left
            whole = 0.5 * angle**2 * w * (1 - np.sin(w * h) / (w * h))
            assert left[-1] == pytest.approx(whole, rel=1e-3)
    assert np.log2(left[0] / left[1]) == pytest.approx(power, abs=0.6)  # at w T of pi and pi/2


@pytest.mark.parametrize(("m", "left"), [(1, 1.0), (2, 0.05), (3, 0.003), (4, 2e-4)])
def test_sculling_is_compensated(m, left):
    """Rolling and shaking sideways in step: a mean acceleration of half the product."""
    angle, shake, w, h = 0.01, 1.0, 2 * np.pi, 0.1
    error = 0.0
    for i in range(10):
        dtheta = parts(lambda t, i=i: np.array([angle * w * np.cos(w * (t + i * h)), 0, 0]), h, m)
        dvel = parts(lambda t, i=i: np.array([0, shake * np.sin(w * (t + i * h)), 0]), h, m)
        _, v = coning_sculling(dtheta, dvel)
        start = angle * np.sin(w * i * h)
        error += v[2] * np.cos(start) + v[1] * np.sin(start)
    # true mean of f_n down is angle * shake / 2, to second order of the angle
    missing = abs(error - 0.5 * angle * shake)
    x = w * h
    whole = 0.5 * angle * shake * (1 - np.sin(x) / x)
    assert missing < 1.02 * left * whole
    if m == 1:
        assert missing == pytest.approx(whole, rel=0.02)


def test_sub_samples_are_one_to_four():
    with pytest.raises(ValueError, match="1 to 4 sub-samples, got 5"):
        coning_sculling(np.zeros((5, 3)), np.zeros((5, 3)))
    with pytest.raises(ValueError, match="equal length"):
        coning_sculling(np.zeros((2, 3)), np.zeros((3, 3)))


# --- Earth --------------------------------------------------------------------------------------

PLACES = [(-60.0, 20.0, 100.0), (0.0, -120.0, 0.0), (30.0, 179.9, 9000.0), (89.9, 5.0, -50.0),
          (-90.0, 0.0, 300.0), (45.0, 0.0, 80e3), (-37.0, 77.0, 2e7)]  # fmt: skip


@pytest.mark.parametrize(("lat", "lon", "h"), PLACES)
def test_latitude_and_height_are_those_of_pyproj(lat, lon, h):
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978")
    s, c, out, height = ellipsoid.normal(parameters(), *to_ecef.transform(lat, lon, h))
    assert height == pytest.approx(h, abs=8e-9)  # two units in the last place
    assert np.degrees(np.arctan2(s, c)) == pytest.approx(lat, abs=2e-14)
    assert out >= 0.0


@pytest.mark.parametrize(("lat", "lon", "h"), PLACES)
def test_axes_are_north_east_down(lat, lon, h):
    geod = pyproj.Geod(ellps="WGS84")
    a, o = np.radians(lat), np.radians(lon)
    w, x, y, z = ellipsoid.ned_axes(a, o)
    north, east, down = Rotation.from_quat([x, y, z, w]).as_matrix().T
    up = [np.cos(a) * np.cos(o), np.cos(a) * np.sin(o), np.sin(a)]
    assert -down == pytest.approx(up, abs=1e-15)
    assert east == pytest.approx([-np.sin(o), np.cos(o), 0.0], abs=1e-15)
    assert np.cross(north, east) == pytest.approx(down, abs=1e-15)
    # a step to the north is one along the meridian
    along, across = ellipsoid.radii(parameters(), np.sin(a) ** 2)
    if abs(lat) < 80:
        lon2, lat2, _ = geod.fwd(lon, lat, 0.0, 1.0)
        assert np.radians(lat2 - lat) * along == pytest.approx(1.0, rel=1e-6)
        lon2, lat2, _ = geod.fwd(lon, lat, 90.0, 1.0)
        turned = np.radians((lon2 - lon + 180) % 360 - 180)
        assert turned * across * np.cos(a) == pytest.approx(1.0, rel=1e-6)


def closed_gravity(lat, h):
    """Normal gravity from the gravity potential of the ellipsoid, by its derivative in height.

    The potential is that of Heiskanen and Moritz, section 2.7, in ellipsoidal coordinates.
    """
    a, gm = WGS84_A, 3.986004418e14
    b = a * (1 - 1 / WGS84_INV_F)
    e = np.sqrt(a * a - b * b)

    def q(u):
        return 0.5 * ((1 + 3 * u * u / e**2) * np.arctan(e / u) - 3 * u / e)

    def potential(h):
        n = a / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        x, z = (n + h) * np.cos(lat), (n * (1 - E2) + h) * np.sin(lat)
        r2 = x * x + z * z - e * e
        u = np.sqrt(0.5 * r2 * (1 + np.sqrt(1 + 4 * e * e * z * z / r2**2)))
        beta = np.arctan2(z * np.sqrt(u * u + e * e), u * x)
        return (
            gm / e * np.arctan(e / u)
            + 0.5 * OMEGA**2 * a * a * q(u) / q(b) * (np.sin(beta) ** 2 - 1 / 3)
            + 0.5 * OMEGA**2 * (u * u + e * e) * np.cos(beta) ** 2
        )

    d = 200.0
    return (potential(h - d) - potential(h + d)) / (2 * d)


@pytest.mark.parametrize("lat", [-60.0, 0.0, 37.0, 90.0])
@pytest.mark.parametrize(
    ("gravity", "h", "near"),
    [(None, 0.0, 1e-6), (None, 5e3, 2e-6), ("gradient", 0.0, 1e-6), ("gradient", 5e3, 2e-5)],
)
def test_gravity_is_that_of_the_ellipsoid(lat, gravity, h, near):
    a = np.radians(lat)
    found = ellipsoid.gravity(parameters(gravity=gravity), np.sin(a) ** 2, h)
    # the linear gradient leaves out 3 g (h / a)^2, 1.8e-5 m/s^2 at 5 km
    assert found == pytest.approx(closed_gravity(a, h), abs=near)


def test_gravity_of_a_sphere_falls_with_the_square_of_the_distance():
    p = parameters(earth="spherical")
    assert ellipsoid.gravity(p, 0.3, 0.0) == 9.80665
    assert ellipsoid.gravity(p, 0.3, WGS84_A) == pytest.approx(9.80665 / 4)
    assert ellipsoid.gravity(parameters(gravity=9.81), 0.3, 500.0) == 9.81


# --- frames -------------------------------------------------------------------------------------


SHORT = 1e-6  # step [s] in which the velocity stays the same


def level_rates(module, x, p, v):
    w = np.zeros(k.W_SIZE)
    x[k.V : k.V + 3] = v
    x[k.R_N] = 1.0
    for _ in range(2):
        module(x, p, w, 0.0)
    module(x, p, w, SHORT)
    return x[k.W_EX : k.W_EX + 3], w


@pytest.mark.parametrize(("lat", "lon", "h"), PLACES[:3])
def test_transport_rate_is_the_turn_between_two_places(lat, lon, h):
    """Of NED and of the wander frame, whose third component is zero."""
    a, o = np.radians(lat), np.radians(lon)
    v, dt = np.array([120.0, -200.0, 3.0]), 1.0
    along = WGS84_A * (1 - E2) / (1 - E2 * np.sin(a) ** 2) ** 1.5 + h
    across = WGS84_A / np.sqrt(1 - E2 * np.sin(a) ** 2) + h

    def axes(t):
        lat2, lon2 = a + v[0] * t / along, o + v[1] * t / across / np.cos(a)
        w, *xyz = ellipsoid.ned_axes(lat2, lon2)
        return Rotation.from_quat([*xyz, w])

    turn = (axes(-dt).inv() * axes(dt)).as_rotvec() / (2 * dt)
    x, p = np.zeros(k.X_SIZE), parameters()
    p[k.LEAST_COSINE] = 1e-3
    x[k.POS : k.POS + 3] = a, o, h
    found, w = level_rates(frames.ned_middle, x, p, v)
    assert found == pytest.approx(turn, abs=1e-12)
    earth = OMEGA * np.array([np.cos(a), 0.0, -np.sin(a)])
    assert w[k.TURN : k.TURN + 3] / SHORT == pytest.approx(earth + turn, abs=1e-12)
    x, p = np.zeros(k.X_SIZE), parameters(frame=k.WANDER)
    angle = 0.8  # of the wander axes, clockwise from north
    back = Rotation.from_rotvec([0, 0, -angle])
    q_ew = axes(0.0) * back.inv()
    xyz = q_ew.as_quat()
    x[k.Q_EW : k.Q_EW + 4] = xyz[3], *xyz[:3]
    x[k.POS + 2] = h
    found, w = level_rates(frames.wander_middle, x, p, back.apply(v))
    assert found == pytest.approx(back.apply(turn * [1, 1, 0]), abs=1e-12)
    assert w[k.TURN : k.TURN + 3] / SHORT == pytest.approx(back.apply(earth) + found, abs=1e-12)


# --- attitude -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [k.QUATERNION, k.DCM, k.EULER])
def test_attitude_turns_with_the_body_and_against_the_frame(kind):
    p = parameters(kind=kind, samples=2)
    x, w = np.zeros(k.X_SIZE), np.zeros(k.W_SIZE)
    C = Rotation.from_euler("ZYX", [2.0, -0.7, 0.4])
    if kind == k.EULER:
        x[k.ATT : k.ATT + 3] = 0.4, -0.7, 2.0
    elif kind == k.DCM:
        x[k.ATT : k.ATT + 9] = C.as_matrix().ravel()
    else:
        xyz = C.as_quat()
        x[k.ATT : k.ATT + 4] = xyz[3], *xyz[:3]
    h, turn = 0.01, np.array([3e-6, -2e-6, 5e-6])
    dtheta = parts(rate, h, 2)
    x[k.TH : k.TH + 6] = dtheta.ravel()
    phi, _ = coning_sculling(dtheta, dtheta)
    w[k.PHI : k.PHI + 3], w[k.TURN : k.TURN + 3] = phi, turn
    attitude.advance(x, p, w, 2)
    attitude.matrix_of(x, p, w, k.C1)
    want = Rotation.from_rotvec(-turn) * C * Rotation.from_rotvec(phi)
    # angles: the fifth order of 0.03 rad, over the cosine of pitch; others: rounding
    tolerance = 1e-9 if kind == k.EULER else 4e-16
    assert np.abs(w[k.C1 : k.C1 + 9].reshape(3, 3) - want.as_matrix()).max() < tolerance
    q = attitude.quat_of(x, p)
    assert (Rotation.from_quat([*q[1:], q[0]]).inv() * want).magnitude() < max(tolerance, 2e-15)


def test_matrix_is_kept_orthogonal():
    p, x, w = parameters(kind=k.DCM), np.zeros(k.X_SIZE), np.zeros(k.W_SIZE)
    C = Rotation.from_euler("ZYX", [2.0, -0.7, 0.4]).as_matrix()
    x[k.ATT : k.ATT + 9] = (C + 1e-4 * np.array([[1, 2, 3], [-1, 0, 2], [0, 1, 1]])).ravel()
    for _ in range(3):
        attitude.advance(x, p, w, 2)
    C = x[k.ATT : k.ATT + 9].reshape(3, 3)
    assert np.abs(C.T @ C - np.eye(3)).max() < 1e-15


def test_gimbal_lock_is_flagged():
    p, x, w = parameters(kind=k.EULER), np.zeros(k.X_SIZE), np.zeros(k.W_SIZE)
    x[k.ATT + 1] = np.pi / 2 - 5e-4
    attitude.advance(x, p, w, 2)
    assert x[k.STATUS] == k.GIMBAL_LOCK


# --- plane --------------------------------------------------------------------------------------


def test_plane_turns_about_y():
    x, p = np.zeros(plane.X_SIZE), np.zeros(plane.P_SIZE)
    x[plane.THETA] = 0.3
    plane.step(x, p, 0.5, 0.0, 2.0, -1.0)
    f = Rotation.from_rotvec([0, 0.3, 0]).apply([2.0, 0.0, -1.0])
    assert (x[plane.VX], x[plane.VZ]) == pytest.approx((0.5 * f[0], 0.5 * f[2]))
    assert (x[plane.X], x[plane.Z]) == pytest.approx((0.125 * f[0], 0.125 * f[2]))
