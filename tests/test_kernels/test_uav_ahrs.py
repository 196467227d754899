"""Both AHRS kernels of thesis D against differences on the sphere, SymPy and dense matrices.

The truth's errors are six, (dtheta_b, db): ``q_true = q exp(dtheta_b)``. The kernel's seven follow
from ``dq = 1/2 q (0, dtheta_b)``.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start

from strapdown.attitude import MultiModeAhrs, StandardAhrs
from strapdown.kernels import memory as m
from strapdown.kernels import multi_mode_ahrs as mm
from strapdown.kernels import standard_ahrs as st
from strapdown.kernels import status as s
from strapdown.kernels import uav_ahrs as k
from strapdown.systems.uav import programs

sympy = pytest.importorskip("sympy")
G = 9.80665
FIELD_N = np.array([2.4762e-5, 8.2465e-7, 3.865e-5])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])
NO_ACC = np.full(3, np.inf)
H_STEP = 1e-5  # of central differences: off by 1e-10 of the third derivative
TURNS = [
    Rotation.from_euler("ZYX", angles)
    for angles in ([2.1, -0.4, 2.6], [-3.0, 0.9, -0.5], [1.57, 0.05, 0.2], [0.3, -1.2, 1.8])
]
FILTERS = [StandardAhrs, MultiModeAhrs]


def tangent(q):
    """What a turn dtheta_b makes of q: 4x3, ``1/2 q (0, e)`` as scalar and vector parts."""
    w, v = q[0], q[1:]
    return 0.5 * np.vstack((-v, w * np.eye(3) + np.cross(np.eye(3), v).T @ -np.eye(3)))


def seven(P6, q):
    """Covariance of the seven of that of the six."""
    T = np.block([[tangent(q), np.zeros((4, 3))], [np.zeros((3, 3)), np.eye(3)]])
    return T @ P6 @ T.T


def six(P7, q):
    """The other way: the columns of twice the tangent are orthonormal."""
    T = np.block([[4.0 * tangent(q).T, np.zeros((3, 3))], [np.zeros((3, 4)), np.eye(3)]])
    return T @ P7 @ T.T


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((6, 6))
    return scale * (a @ a.T + 0.1 * np.eye(6))


def begun(flt, b0=(0.0, 0.0, 0.0), seed=None, scale=1e-2, r_nb=TURNED):
    """Memory as after a sample at t = 0, with a covariance of one's own."""
    x, P = start(flt, scalar_first(r_nb), b0)
    if seed is not None:
        P[:] = seven(some_covariance(seed, scale), quat(x))
    return x, P


def row(w):
    return w[k.W_H : k.W_H + 4].copy()


def along(f, r_nb):
    """Derivative of a function of attitude with respect to dtheta_b, by central differences."""
    return np.transpose([
        (f(r_nb * Rotation.from_rotvec(H_STEP * e)) - f(r_nb * Rotation.from_rotvec(-H_STEP * e)))
        / (2.0 * H_STEP)
        for e in np.eye(3)
    ])  # fmt: skip


def test_tangent_is_what_a_small_turn_makes_of_the_quaternion():
    q, d = scalar_first(TURNED), 1e-6 * np.array([1.0, -2.0, 3.0])
    moved = scalar_first(TURNED * Rotation.from_rotvec(d))
    np.testing.assert_allclose(tangent(q) @ d, moved - q, atol=1e-11)  # d^2 / 8


# --- F ----------------------------------------------------------------------------------


@pytest.mark.parametrize("r", [[0.3, -0.4, 0.5], [1e-3, 2e-3, -1e-3], [0.02, 0.01, 0.03]])
def test_exact_transition_agrees_with_central_differences_on_the_sphere(r):
    flt, b0, dt = (
        StandardAhrs(gyr_noise=1e-9, gyr_bias_noise=0.0),
        np.array([0.1, -0.2, 0.3]),
        0.02,
    )
    rate = np.array(r) / dt + b0

    def after(e):
        turn = Rotation.from_rotvec((rate - b0 - e[3:]) * dt)
        return TURNED * Rotation.from_rotvec(e[:3]) * turn

    q1 = TURNED * Rotation.from_rotvec(np.array(r))
    want = np.transpose([
        np.r_[(q1.inv() * after(h)).as_rotvec() - (q1.inv() * after(-h)).as_rotvec(), 2.0 * h[3:]]
        / (2.0 * H_STEP)
        for h in H_STEP * np.eye(6)
    ])  # fmt: skip
    x, P = begun(flt, b0, seed=1, scale=1.0)
    before = six(P, scalar_first(TURNED))
    k.predict(x, P, flt._params(), np.zeros(k.W_SHARED), *rate, dt)
    assert (rotation(quat(x)) * q1.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(six(P, quat(x)), want @ before @ want.T, atol=1e-8)
    assert np.array_equal(P, P.T)
    assert np.abs(P[:4, :4] @ quat(x)).max() < 1e-14  # nothing along q


def printed_transition(q, r, dt):
    """``I + F dt`` with F of (3.25), the halves put in."""
    w, x, y, z = q
    p, u, v = r
    omega = np.array([[0, -p, -u, -v], [p, 0, v, -u], [u, -v, 0, p], [v, u, -p, 0]])
    F = np.eye(7)
    F[:4, :4] += 0.5 * omega
    F[:4, 4:] = 0.5 * dt * np.array([[x, y, z], [-w, z, -y], [-z, -w, x], [y, -x, -w]])
    return F


@pytest.mark.parametrize("cls", FILTERS)
def test_printed_transition_is_of_first_order_with_noise_on_the_diagonal(cls):
    flt, dt, r = cls.as_printed(), 0.02, np.array([0.01, -0.02, 0.03])
    x, P = start(flt, scalar_first(TURNED))
    a = np.random.default_rng(3).standard_normal((7, 7))
    P[:] = a @ a.T
    q, F = quat(x), printed_transition(quat(x), r, dt)
    want = F @ P @ F.T
    one = 1e-8 * np.ones(4)  # variances of section 9.2, per step
    if cls is MultiModeAhrs:
        moved = F[:4, :4] @ q
        one = 1e-4 * dt**2 / 4 * (1 - (moved / np.linalg.norm(moved)) ** 2)
        of_bias = dt**2 * np.array([0.25e-4, 0.25e-4, 1e-8])
    else:
        of_bias = 1e-12 * np.ones(3)
    k.predict(x, P, flt._params(), np.zeros(k.W_SHARED), *(r / dt), dt)
    np.testing.assert_allclose(P, want + np.diag(np.r_[one, of_bias]), rtol=1e-12, atol=1e-14)
    norm = np.linalg.norm(F[:4, :4] @ q) if cls is MultiModeAhrs else 1.0
    np.testing.assert_allclose(quat(x), F[:4, :4] @ q / norm, atol=1e-15)


def test_state_dependent_noise_is_v_aq_vt():
    """Section 10.3, with all of V aQ V^T: its off-diagonal elements, too."""
    flt, dt = MultiModeAhrs(), 0.02
    x, P = start(flt, scalar_first(TURNED))
    P[:] = 0.0
    k.predict(x, P, flt._params(), np.zeros(k.W_SHARED), 0.0, 0.0, 0.0, dt)
    V = np.zeros((7, 6))
    V[:4, :3], V[4:, 3:] = -dt * tangent(quat(x)), dt * np.eye(3)
    aq = np.diag([1e-4, 1e-4, 1e-4, 0.25e-4, 0.25e-4, 1e-8])
    np.testing.assert_allclose(P, V @ aq @ V.T, atol=1e-22)


# --- H ----------------------------------------------------------------------------------


@pytest.mark.parametrize("r_nb", TURNS)
@pytest.mark.parametrize("v", [[0.0, 0.0, -G], FIELD_N])
def test_row_of_a_vector_agrees_with_central_differences_on_the_sphere(r_nb, v):
    q, w = scalar_first(r_nb), np.zeros(k.W_SHARED)
    want = along(lambda r: r.inv().apply(v), r_nb)
    for i in range(3):
        h = k.vector_row(w, i, *q, *v)
        assert h == pytest.approx(r_nb.inv().apply(v)[i], abs=1e-14)
        np.testing.assert_allclose(row(w) @ tangent(q), want[i], atol=1e-9 * np.linalg.norm(v))


def test_rows_are_those_that_sympy_derives():
    """All four columns, as the source means them: quadratic forms, and an arctangent."""
    w_, x_, y_, z_ = symbols = sympy.symbols("w x y z")
    vx, vy, vz = 1.3, -0.7, 2.1
    C = sympy.Matrix([
        [w_**2 + x_**2 - y_**2 - z_**2, 2 * (x_ * y_ + w_ * z_), 2 * (x_ * z_ - w_ * y_)],
        [2 * (x_ * y_ - w_ * z_), w_**2 - x_**2 + y_**2 - z_**2, 2 * (y_ * z_ + w_ * x_)],
        [2 * (x_ * z_ + w_ * y_), 2 * (y_ * z_ - w_ * x_), w_**2 - x_**2 - y_**2 + z_**2],
    ])  # fmt: skip
    vector = (C * sympy.Matrix([vx, vy, vz])).jacobian(symbols)
    yaw = sympy.atan2(2 * (x_ * y_ + w_ * z_), 1 - 2 * (y_**2 + z_**2))
    heading = sympy.Matrix([yaw]).jacobian(symbols)
    for r_nb in TURNS:
        q = scalar_first(r_nb)
        at = dict(zip(symbols, q, strict=True))
        w = np.zeros(k.W_SHARED)
        want = np.array(vector.subs(at), dtype=float)
        for i in range(3):
            k.vector_row(w, i, *q, vx, vy, vz)
            np.testing.assert_allclose(row(w), want[i], atol=1e-14)
        x = np.zeros(m.HEAD)
        x[m.Q : m.Q + 4] = q
        assert k.heading_row(x, w, 0.0)
        want = np.array(heading.subs(at), dtype=float)[0]
        np.testing.assert_allclose(row(w), want, rtol=1e-12)


def with_attitude(r_nb):
    x = np.zeros(m.HEAD)
    x[m.Q : m.Q + 4] = scalar_first(r_nb)
    return x


@pytest.mark.parametrize("r_nb", TURNS)
def test_row_of_the_heading_agrees_with_central_differences_on_the_sphere(r_nb):
    x, w = with_attitude(r_nb), np.zeros(k.W_SHARED)
    assert k.heading_row(x, w, 0.0)
    want = along(lambda r: r.as_euler("ZYX")[:1], r_nb)[0]
    # the third derivative grows with the fourth power of 1 / cos(pitch), here 58
    np.testing.assert_allclose(row(w) @ tangent(quat(x)), want, atol=1e-7)


@pytest.mark.parametrize(
    ("yaw", "want"),
    [(0, 1.0), (30, 0.97), (60, 0.62), (90, 0.0), (120, -0.12), (-135, 0.15), (180, 1.0)],
)
def test_printed_row_does_not_see_a_turn_at_90_deg_and_sees_it_reversed_at_120(yaw, want):
    """Spec D 18: what a turn about down makes of it at a roll of 0.2 and a pitch of 0.05 rad."""
    r_nb = Rotation.from_euler("ZYX", [np.radians(yaw), 0.05, 0.2])
    x, w = with_attitude(r_nb), np.zeros(k.W_SHARED)
    down_b = r_nb.inv().apply([0.0, 0.0, 1.0])
    for printed, value in ((1.0, want), (0.0, 1.0)):
        assert k.heading_row(x, w, printed)
        seen = row(w) @ tangent(quat(x)) @ down_b
        assert seen == pytest.approx(value, abs=0.005 if printed else 1e-12)  # two digits


@pytest.mark.parametrize("pitch", [90.0, -90.0, 86.0])
def test_where_the_x_axis_is_vertical_there_is_no_yaw(pitch):
    x = with_attitude(Rotation.from_euler("ZYX", [0.3, np.radians(pitch), 0.2]))
    assert not k.heading_row(x, np.zeros(k.W_SHARED), 0.0)


@pytest.mark.parametrize("r_nb", TURNS)
def test_row_of_the_levelled_heading_agrees_with_central_differences_on_the_sphere(r_nb):
    """The measured field stays, what levels it moves: minus the slope of the innovation."""
    flt = StandardAhrs(declination=0.3)
    x, _ = begun(flt, r_nb=r_nb)
    field = r_nb.inv().apply([2e-5 * np.cos(0.3), 2e-5 * np.sin(0.3), 3e-5])
    x[m.MAG + 1 : m.MAG + 4] = field

    def left(r):
        h = r.apply(field)
        return np.array([np.angle(np.exp(1j * (0.3 - np.arctan2(h[1], h[0]))))])

    w = np.zeros(st.W_SIZE)
    st.levelled_row(x, flt._params(), w)
    np.testing.assert_allclose(row(w) @ tangent(quat(x)), -along(left, r_nb)[0], atol=1e-7)
    seen = row(w)
    # noise of the heading is no part of the row
    turned = Rotation.from_euler("Z", 0.2) * r_nb
    x[m.MAG + 1 : m.MAG + 4] = r_nb.inv().apply(turned.apply(field))
    st.levelled_row(x, flt._params(), w)
    np.testing.assert_allclose(row(w), seen, atol=1e-14)
    assert st.heading_left(x, flt._params()) == pytest.approx(-0.2, abs=1e-12)


def test_heading_levelled_as_before_is_the_compass_of_the_source():
    """(2.43) to (2.45) with other angles than the estimate's."""
    flt = StandardAhrs(declination=0.3, levelling="before")
    x, _ = begun(flt)
    roll, pitch = 0.4, -0.2
    x[st.ROLL], x[st.PITCH] = roll, pitch
    truth = Rotation.from_euler("ZYX", [-2.0, pitch, roll])
    x[m.MAG + 1 : m.MAG + 4] = truth.inv().apply([2e-5, 0.0, 4e-5])
    yaw = TURNED.as_euler("ZYX")[0]
    want = np.angle(np.exp(1j * (-2.0 + 0.3 - yaw)))
    assert st.heading_left(x, flt._params()) == pytest.approx(want, abs=1e-12)


def test_tilt_is_kept_for_the_step_after():
    flt = StandardAhrs(levelling="before")
    x, P = begun(flt)
    feed(flt, x, P, 0.02, [0.5, -0.3, 0.8], NO_ACC)
    _, pitch, roll = rotation(quat(x)).as_euler("ZYX")
    np.testing.assert_allclose(x[[st.ROLL, st.PITCH]], [roll, pitch], atol=1e-14)


# --- one sample -------------------------------------------------------------------------


def dense_update(P, q, b, z, H7, R):
    """The thesis's update with matrices, in Joseph's form; the quaternion moves on its sphere."""
    H = np.hstack((H7, np.zeros((len(H7), 3))))
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    dx = K @ z
    I_KH = np.eye(7) - K @ H
    dtheta = 4.0 * tangent(q).T @ dx[:4]
    return rotation(q) * Rotation.from_rotvec(dtheta), b + dx[4:], I_KH @ P @ I_KH.T + K @ R @ K.T


def gravity_rows(r_nb):
    """Rows on all four components; what lies along q does not matter."""
    q = scalar_first(r_nb)
    return along(lambda r: r.inv().apply([0, 0, -G]), r_nb) @ (4.0 * tangent(q).T)


def field_rows(r_nb):
    q = scalar_first(r_nb)
    return along(lambda r: r.inv().apply(FIELD_N), r_nb) @ (4.0 * tangent(q).T)


def yaw_row(r_nb):
    q = scalar_first(r_nb)
    return along(lambda r: r.as_euler("ZYX")[:1], r_nb) @ (4.0 * tangent(q).T)


def predicted(flt, x, P, rate, dt):
    """State and covariance after the prediction, which has tests of its own."""
    x, P = x.copy(), P.copy()
    k.predict(x, P, flt._params(), np.zeros(k.W_SHARED), *rate, dt)
    return quat(x), bias(x), P


def same(x, P, r_nb, b, want, atol=1e-9):
    """Rows are by differences."""
    assert (rotation(quat(x)) * r_nb.inv()).magnitude() < atol
    np.testing.assert_allclose(bias(x), b, atol=atol)
    # P is carried along with q: about the axes of n it is what it was
    for axis in np.eye(3):
        u = np.r_[0.0, axis]
        got = [side @ six_n(cov, q) @ side for side, cov, q in (
            (u[1:], P, quat(x)), (u[1:], want[0], want[1]))]  # fmt: skip
        assert got[0] == pytest.approx(got[1], abs=atol)
    np.testing.assert_allclose(P[4:, 4:], want[0][4:, 4:], atol=atol)


def six_n(P7, q):
    """Covariance of the attitude's error about the axes of n."""
    C = rotation(q).as_matrix()
    return C @ six(P7, q)[:3, :3] @ C.T


def test_standard_corrects_by_gravity_and_then_by_heading():
    flt = StandardAhrs(declination=0.1, mag_rate=25.0, gate=np.inf)
    b0, rate, dt = np.array([0.02, -0.01, 0.03]), np.array([0.5, -0.8, 1.3]), 0.04
    x, P = begun(flt, b0, seed=8)
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.03])
    acc, mag = off.inv().apply([0.1, 0.2, -G]), off.inv().apply(FIELD_N)
    q, b, P1 = predicted(flt, x, P, rate, dt)
    z = acc - rotation(q).inv().apply([0, 0, -G])
    r_acc, r_mag = 1.962361, 0.014924 * 2.5  # printed, at 25 Hz; the heading's for 10 Hz
    r1, b, P1 = dense_update(P1, q, b, z, gravity_rows(rotation(q)), r_acc * np.eye(3))

    def left(r):
        h = r.apply(mag)
        return np.array([np.angle(np.exp(1j * (0.1 - np.arctan2(h[1], h[0]))))])

    def expected(r):
        """The field as it is seen by r1 if its heading is as predicted, levelled by r."""
        h = r1.apply(mag)
        h = np.array([np.hypot(*h[:2]) * np.cos(0.1), np.hypot(*h[:2]) * np.sin(0.1), h[2]])
        h = r.apply(r1.inv().apply(h))
        return np.array([np.angle(np.exp(1j * (0.1 - np.arctan2(h[1], h[0]))))])

    q1 = scalar_first(r1)
    turn = carried(P1, q, q1)
    H = -along(expected, r1) @ (4.0 * tangent(q1).T)
    r2, b, P2 = dense_update(turn, q1, b, left(r1), H, np.array([[r_mag]]))
    w = feed(flt, x, P, dt, rate, acc, mag)
    same(x, P, r2, b, (P2, q1))
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED
    np.testing.assert_allclose(w[m.D_MAG], left(r1)[0], atol=1e-9)


def carried(P7, q, q_new):
    """Covariance whose errors stay about the axes of n while q moves."""
    T = np.zeros((7, 7))
    T[4:, 4:] = np.eye(3)
    C, C_new = rotation(q).as_matrix(), rotation(q_new).as_matrix()
    T[:4, :4] = tangent(q_new) @ C_new.T @ C @ (4.0 * tangent(q).T)
    return T @ P7 @ T.T


@pytest.mark.parametrize("mode", [1, 2])
def test_multi_mode_is_one_update_with_all_rows_stacked(mode):
    flt = MultiModeAhrs(
        declination=float(np.arctan2(FIELD_N[1], FIELD_N[0])), gate=np.inf, min_speed=1.0,
        mag_reference=(float(np.hypot(*FIELD_N[:2])), float(FIELD_N[2])), acc_rate=25.0,
    )  # fmt: skip
    b0, rate, dt = np.array([0.02, -0.01, 0.03]), np.array([0.5, -0.8, 1.3]), 0.04
    x, P = begun(flt, b0, seed=9)
    x[mm.T_MAG] = 0.0
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.03])
    acc, mag = off.inv().apply([0.1, 0.2, -G]), off.inv().apply(FIELD_N)
    q, b, P1 = predicted(flt, x, P, rate, dt)
    r_nb = rotation(q)
    course = r_nb.as_euler("ZYX")[0] + 0.04
    z, H = mag - r_nb.inv().apply(FIELD_N), field_rows(r_nb)
    R = [7e-5 * 1e-8] * 3  # printed, in T^2
    if mode == 1:
        x[m.GNSS] = 1.0
        x[m.GNSS + 1 : m.GNSS + 15] = np.nan
        x[m.GNSS + 1] = dt
        x[m.GNSS + 5 : m.GNSS + 7] = 9 * np.cos(course), 9 * np.sin(course)
        z, H, R = np.append(z, 0.04), np.vstack((H, yaw_row(r_nb))), [*R, 0.001]
    else:
        z = np.append(z, acc - r_nb.inv().apply([0, 0, -G]))
        H, R = np.vstack((H, gravity_rows(r_nb))), [*R, *[1.962361] * 3]
    want_r, want_b, want_P = dense_update(P1, q, b, z, H, np.diag(R))
    w = feed(flt, x, P, dt, rate, acc, mag)
    same(x, P, want_r, want_b, (want_P, q), atol=2e-8)
    used = (w[m.D_ACC + 6], w[mm.W_COURSE + 6])
    assert used == ((s.NOT_MEASURED, s.ACCEPTED) if mode == 1 else (s.ACCEPTED, s.NOT_MEASURED))
    assert x[m.GNSS] == 0.0


@pytest.mark.parametrize("cls", FILTERS)
def test_covariance_stays_symmetric_positive_and_on_the_sphere(cls):
    flt = cls(acc_noise=0.01, mag_noise=1e-8 if cls is MultiModeAhrs else 1e-3)
    rng = np.random.default_rng(9)
    state = flt.init()
    x, P, r_nb = state.x, state.P, TURNED
    for i in range(200):
        rate = 3.0 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * 0.01)
        acc, mag = r_nb.inv().apply([0, 0, -G]), r_nb.inv().apply(FIELD_N)
        feed(flt, x, P, 0.01 * i, rate, acc, mag if i % 3 == 0 else np.empty(0))
        assert np.array_equal(P, P.T)
        least = np.linalg.eigvalsh(P)
        assert least[0] > -1e-15 * flt.std_tilt**2  # the one along q: round-off of the start
        assert least[1] > 0.0
        assert abs(np.linalg.norm(quat(x)) - 1.0) < 1e-15
        assert np.abs(P[:, :4] @ quat(x)).max() < 1e-15 * flt.std_tilt**2


@pytest.mark.parametrize("cls", FILTERS)
def test_as_printed_is_the_program_in_dense_matrices(cls):
    """Sections 9.3 and 10.3, with inverses: both modes, headings of all quadrants."""
    rng = np.random.default_rng(5)
    n, dt = 120, programs.DT
    flt = cls.as_printed(**({"fix_timeout": 1e-3} if cls is MultiModeAhrs else {}))
    state, memory = flt.init(attitude=[1, 0, 0, 0]), programs.Memory()
    x, P, w = state.x.copy(), state.P.copy(), None
    feed(flt, x, P, 0.0, np.zeros(3), NO_ACC)  # begins the interval of the first step
    np.testing.assert_allclose(P, 0.1 * np.eye(7), atol=1e-16)
    r_nb = Rotation.from_euler("ZYX", [2.5, 0.2, -0.3])
    for i in range(1, n + 1):
        rate = np.array([0.4, -0.5, 0.9]) + 0.3 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * dt)
        acc = r_nb.inv().apply([0, 0, -9.81]) + 0.3 * rng.standard_normal(3)
        mag = r_nb.inv().apply(programs.FIELD) + 0.01 * rng.standard_normal(3)
        v_n = 9.0 * np.array([np.cos(0.9 * i * dt), np.sin(0.9 * i * dt)])
        valid = bool(i % 2 == 0 and i < 90)
        gyr = rate + [0.1, 0.25, 0.5]
        if cls is MultiModeAhrs:
            if valid:
                fix(x, i * dt, *v_n)
            programs.multi_mode(memory, mag, acc, gyr, v_n, valid=valid)
        else:
            programs.standard(memory, mag, acc, gyr)
        w = feed(flt, x, P, i * dt, gyr, acc, 1e-4 * mag)
        # round-off of some thousand operations a step, on covariances of 0.1
        np.testing.assert_allclose(quat(x), memory.x[:4], atol=1e-12)
        np.testing.assert_allclose(bias(x), memory.x[4:], atol=1e-12)
        np.testing.assert_allclose(P, memory.P, atol=1e-13)
    assert w[m.D_ACC + 6] == s.ACCEPTED


# --- schedule, gaps, what is unseen -----------------------------------------------------------


def corrected(flt, rate_hz, seconds=4.0):
    """Numbers of the samples after a given attitude at which accelerometer and field count."""
    x, P = start(flt, [1.0, 0, 0, 0])
    acc, mag = [], []
    for i in range(1, round(seconds * rate_hz) + 1):
        w = feed(flt, x, P, i / rate_hz, np.zeros(3), [0, 0, -G], FIELD_N)
        acc += [i] if w[m.D_ACC + 6] != s.NOT_MEASURED else []
        mag += [i] if w[m.D_MAG + 6] != s.NOT_MEASURED else []
    return acc, mag


def test_schedule_at_50_hz_is_that_of_the_programs():
    """Acceptance target 11: even counts, and counts 1, 6, 11, ..."""
    acc, mag = corrected(StandardAhrs(), 50.0)
    assert acc == list(range(2, 201, 2))
    assert mag == list(range(1, 201, 5))
    multi = MultiModeAhrs(mag_reference=(2.4e-5, 3.9e-5))
    assert corrected(multi, 50.0) == (list(range(2, 201, 2)),) * 2


@pytest.mark.parametrize("rate_hz", [20.0, 64.0, 100.0, 285.7, 1000.0])
def test_schedule_keeps_its_rates_at_any_rate_of_the_imu(rate_hz):
    acc, mag = corrected(StandardAhrs(), rate_hz)
    for found, rate in ((acc, 25.0), (mag, 10.0)):
        want = min(rate, rate_hz)
        assert len(found) == pytest.approx(4.0 * want, abs=1.0)
        assert np.diff(found).max() <= np.ceil(rate_hz / want)
    every = StandardAhrs(acc_rate=np.inf, mag_rate=np.inf)
    assert corrected(every, rate_hz, 0.5)[0] == list(range(1, round(0.5 * rate_hz) + 1))


@pytest.mark.parametrize("cls", FILTERS)
@pytest.mark.parametrize(("clipped", "gap"), [(True, False), (False, True), (False, False)])
def test_unseen_rates_widen_the_covariance(cls, clipped, gap):
    flt = cls(gap_rate=0.5, gyr_range=10.0, max_gap=0.4)
    x, P = start(flt, [1.0, 0, 0, 0])
    P[:] = 0.0
    dt = 0.5 if gap else 0.1
    feed(flt, x, P, dt, [0.0, 0.0, 10.0 if clipped else 9.9], NO_ACC)
    hidden = (0.5 * dt) ** 2 if gap else (2 * 0.25 * 0.5**2 * dt if clipped else 0.0)
    want = flt.gyr_noise**2 * dt + hidden
    assert x[m.STD_ATT + 2] ** 2 == pytest.approx(want, rel=1e-9)
    np.testing.assert_allclose(six_n(P, quat(x)), want * np.eye(3), atol=1e-12)


def test_a_long_gap_levels_and_the_next_field_sets_the_heading():
    flt = StandardAhrs(gap_rate=1.0, std_tilt=0.3, std_heading=0.2)
    x, P = start(flt, scalar_first(TURNED))
    x[m.ALIGNED] = m.FULL
    P[:] = seven(some_covariance(4, 1e-3), quat(x))
    of_bias = P[4:, 4:].copy()
    after = Rotation.from_euler("ZYX", [0.5, 0.1, -0.2])
    w = feed(flt, x, P, 2.0, np.zeros(3), after.inv().apply([0, 0, -G]))
    assert w[m.D_ACC + 6] == s.NOT_MEASURED  # it has levelled, that is enough
    assert x[m.ALIGNED] == m.TILT
    down = rotation(quat(x)).inv().apply([0, 0, 1])
    np.testing.assert_allclose(down, after.inv().apply([0, 0, 1]), atol=1e-12)
    feed(flt, x, P, 2.02, np.zeros(3), NO_ACC, after.inv().apply([2e-5, 0, 4e-5]))
    assert (rotation(quat(x)) * after.inv()).magnitude() < 1e-12
    assert x[m.ALIGNED] == m.FULL
    assert x[m.STD_ATT + 2] == pytest.approx(0.2, rel=1e-9)
    np.testing.assert_allclose(P[4:, 4:], of_bias, atol=1e-8)


def test_independent_heading_leaves_tilt_alone_and_forgets_its_own():
    x, P = begun(StandardAhrs(), seed=6, scale=1.0)
    before = six_n(P, quat(x))
    k.reset_heading(x, P, 0.04)
    got = six_n(P, quat(x))
    np.testing.assert_allclose(got[:2, :2], before[:2, :2], atol=1e-13)
    np.testing.assert_allclose(got[2], [0, 0, 0.04], atol=1e-13)
    assert np.array_equal(P, P.T)


# --- GPS --------------------------------------------------------------------------------


def fix(x, t, v_n, v_e):
    x[m.GNSS] = 1.0
    x[m.GNSS + 1 : m.GNSS + 15] = np.nan
    x[m.GNSS + 1] = t
    x[m.GNSS + 5], x[m.GNSS + 6] = v_n, v_e


def flying(**parameters):
    flt = MultiModeAhrs(mag_reference=(2.4e-5, 3.9e-5), fix_timeout=0.31, **parameters)
    x, P = start(flt, [1.0, 0, 0, 0])
    return flt, x, P


def modes(flt, x, P, fixes, n=60):
    """Which samples were corrected by the accelerometer; fixes by sample number."""
    used, outage = [], []
    for i in range(1, n + 1):
        if i in fixes:
            fix(x, i * 0.02, *fixes[i])
        w = feed(flt, x, P, i * 0.02, np.zeros(3), [0, 0, -G], [2.4e-5, 0, 3.9e-5])
        used += [i] if w[m.D_ACC + 6] != s.NOT_MEASURED else []
        outage += [i] if int(x[m.STATUS]) & s.OUTAGE else []
    return used, outage


def test_gravity_counts_from_the_loss_of_gps_to_its_return():
    """Fixes up to sample 20, lost 0.32 s later, one again at sample 45."""
    flt, x, P = flying()
    used, outage = modes(flt, x, P, {i: (9.0, 0.0) for i in [*range(4, 21, 2), *range(45, 61, 2)]})
    assert used == [2, 36, 38, 40, 42, 44]
    assert outage == list(range(36, 45))


@pytest.mark.parametrize("lost", [(np.nan, np.nan), (1.0, 1.0)])
def test_a_fix_without_a_course_switches_at_once(lost):
    flt, x, P = flying()
    used, outage = modes(flt, x, P, {2: (9.0, 0.0), 6: (9.0, 0.0), 8: lost}, 14)
    assert used == [8, 10, 12, 14]
    assert outage == list(range(8, 15))


def test_without_a_field_gravity_counts_although_there_is_gps():
    flt, x, P = flying(use_mag=False)
    used, _ = modes(flt, x, P, {i: (9.0, 0.0) for i in range(2, 41, 2)}, 40)
    assert used == list(range(2, 41, 2))


def test_a_late_course_is_compared_with_the_yaw_of_its_time():
    """Turning at 1 rad/s about a banked axis, the fix is 0.1 s old."""
    flt, x, P = flying(gate=np.inf)
    bank = Rotation.from_euler("X", 0.4)
    x[m.Q : m.Q + 4] = scalar_first(bank)
    rate = bank.inv().apply([0.0, 0.0, 1.0])
    fix(x, -0.08, 9.0 * np.cos(-0.08), 9.0 * np.sin(-0.08))
    w = feed(flt, x, P, 0.02, rate, NO_ACC)
    assert w[mm.W_COURSE] == pytest.approx(0.0, abs=1e-12)


def test_where_there_is_no_field_the_first_course_is_the_heading():
    flt = MultiModeAhrs()
    state = flt.init()
    x, P = state.x, state.P
    tilted = Rotation.from_euler("ZYX", [0.0, 0.1, -0.2])
    feed(flt, x, P, 0.0, np.zeros(3), tilted.inv().apply([0, 0, -G]))
    fix(x, 0.02, 0.0, -9.0)
    feed(flt, x, P, 0.02, np.zeros(3), NO_ACC)
    want = Rotation.from_euler("ZYX", [-np.pi / 2, 0.1, -0.2])
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-12
    assert x[m.STD_ATT + 2] == pytest.approx(flt.std_heading)


def test_reference_is_the_mean_of_the_first_fields_and_kept():
    """Of 0.19 s; meanwhile the heading of the field corrects, and gravity in spite of GPS."""
    flt = MultiModeAhrs(
        learn_time=0.19, gate=np.inf, reject_disturbed=False, gyr_noise=1e-9,
        gyr_bias_noise=(0.0, 0.0, 0.0),
    )  # fmt: skip
    x, P = start(flt, scalar_first(TURNED))
    P[:] = 1e-12 * P  # attitude does not move
    rng, fields = np.random.default_rng(1), []
    for i in range(1, 16):
        field_n = np.array([2e-5, 0.0, 4e-5]) + 1e-6 * rng.standard_normal(3)
        fields.append([np.hypot(*field_n[:2]), field_n[2]])
        fix(x, 0.04 * i, 9 * np.cos(2.1), 9 * np.sin(2.1))
        w = feed(flt, x, P, 0.04 * i, np.zeros(3), TURNED.inv().apply([0, 0, -G]),
                 TURNED.inv().apply(field_n))  # fmt: skip
        kept = min(i, 5)  # the first one starts the clock
        np.testing.assert_allclose(
            x[[mm.REF_H, mm.REF_D]], np.mean(fields[:kept], axis=0), rtol=1e-4
        )
        assert np.isnan(w[m.D_MAG + 1]) == (i < 6)  # one component, then three
        assert (w[m.D_ACC + 6] == s.ACCEPTED) == (i < 6)
    z = w[m.D_MAG : m.D_MAG + 3]
    want = TURNED.inv().apply(field_n - [*np.array([1.0, 0.0]) * x[mm.REF_H], x[mm.REF_D]])
    np.testing.assert_allclose(z, want, atol=1e-8)


def test_heading_counts_while_the_reference_is_learned():
    """The innovation is that of the standard filter, its variance that of the field."""
    flt = MultiModeAhrs(gate=np.inf, reject_disturbed=False)
    x, P = start(flt, scalar_first(TURNED))
    before = quat(x)
    turned = Rotation.from_euler("Z", 0.1) * TURNED
    w = feed(flt, x, P, 0.04, np.zeros(3), NO_ACC, turned.inv().apply([2e-5, 0, 4e-5]))
    assert w[m.D_MAG] == pytest.approx(0.1, abs=1e-6)
    assert w[m.D_MAG + 3] > np.sqrt(7e-5) * 1e-4 / 2e-5
    moved = (rotation(quat(x)) * rotation(before).inv()).as_rotvec()
    assert moved[2] > 0.01


def test_reference_may_be_the_first_field_alone():
    flt = MultiModeAhrs(learn_time=0.0)
    x, P = start(flt, scalar_first(TURNED))
    for i, size in ((1, 1.0), (2, 1.05)):
        feed(flt, x, P, 0.04 * i, np.zeros(3), NO_ACC, TURNED.inv().apply([size * 2e-5, 0, 4e-5]))
        np.testing.assert_allclose(x[[mm.REF_H, mm.REF_D]], [2e-5, 4e-5], rtol=1e-9)
    x, P = start(flt, [1.0, 0, 0, 0])
    feed(flt, x, P, 0.04, np.zeros(3), NO_ACC, [0.0, 0.0, 5e-5])
    assert x[mm.REF_H] == 0.0  # a vertical field tells no heading


@pytest.mark.parametrize("angle", [0.0, 3.0, -3.0, 4.0, -7.0, 20.0])
def test_wrap_is_within_half_a_turn(angle):
    assert k.wrap(angle) == pytest.approx(np.angle(np.exp(1j * angle)), abs=1e-14)


def test_gate_bounds_the_pull_of_field_and_course_but_not_of_gravity():
    """A course far off moves the state no more than one at the gate; a force has no gate."""
    found = []
    for yaw in (0.5, 2.5):
        flt, x, P = flying(gate=3.0)
        P[:] = seven(1e-4 * np.eye(6), quat(x))
        fix(x, 0.02, 9.0 * np.cos(yaw), 9.0 * np.sin(yaw))
        w = feed(flt, x, P, 0.02, np.zeros(3), NO_ACC)
        assert w[mm.W_COURSE + 6] == s.REJECTED_GATE
        assert int(x[m.STATUS]) & s.AIDING_REJECTED
        found.append(rotation(quat(x)).magnitude())
    assert 0.0 < found[1] < found[0]
    for bad, flag, sensor in (
        ([2.4e-5, 3e-5, 3.9e-5], s.MAG_REJECTED, m.D_MAG),
        (np.empty(0), 0, m.D_ACC),
    ):
        flt, x, P = flying(gate=3.0, reject_disturbed=False)
        P[:] = seven(1e-4 * np.eye(6), quat(x))
        w = feed(flt, x, P, 0.04, np.zeros(3), [50.0, 0.0, -G], bad)
        assert w[sensor + 6] == (s.REJECTED_GATE if flag else s.ACCEPTED)
        assert int(x[m.STATUS]) & s.MAG_REJECTED == flag
    flt = StandardAhrs(gate=3.0)
    x, P = start(flt, [1.0, 0, 0, 0])
    P[:] = seven(1e-4 * np.eye(6), quat(x))
    w = feed(flt, x, P, 0.02, np.zeros(3), NO_ACC, [-2.4e-5, 0.0, 3.9e-5])
    assert w[m.D_MAG + 6] == s.REJECTED_GATE
