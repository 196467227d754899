"""What both AHRS kernels share, against differences on the sphere, SymPy, dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start
from truth.sphere import (
    FIELD_N,
    H_STEP,
    NO_ACC,
    TURNED,
    TURNS,
    G,
    along,
    begun,
    row,
    seven,
    six,
    six_n,
    some_covariance,
    tangent,
    with_attitude,
)

from strapdown.attitude import MultiModeAhrs, StandardAhrs
from strapdown.kernels import memory as m
from strapdown.kernels import multi_mode_ahrs
from strapdown.kernels import status as s
from strapdown.kernels import uav_ahrs as k
from strapdown.systems.uav import programs

sympy = pytest.importorskip("sympy")
FILTERS = [StandardAhrs, MultiModeAhrs]


def test_measurement_surer_than_round_off_leaves_a_covariance():
    """Variance 1e-25 beside a P of 10: the update's rounding is far larger than what is left."""
    rng = np.random.default_rng(5)
    root = rng.standard_normal((7, 7))
    P, w = 10.0 * (root @ root.T + 0.1 * np.eye(7)), np.zeros(multi_mode_ahrs.W_SIZE)
    for h in rng.standard_normal((200, 4)):
        w[k.W_H : k.W_H + 4] = h
        left, expected, accepted = k.update_scalar(P, w, 0.1, 1e-25, np.inf)
        assert accepted
        assert expected >= 0.0
        assert np.isfinite(left)
        assert np.all(np.diag(P) > 0.0)
    assert np.isfinite(w).all()


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
                x[m.GNSS : m.GNSS + 2] = 1.0, i * dt
                x[m.GNSS + 5 : m.GNSS + 7] = v_n
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


@pytest.mark.parametrize("angle", [0.0, 3.0, -3.0, 4.0, -7.0, 20.0])
def test_wrap_is_within_half_a_turn(angle):
    assert k.wrap(angle) == pytest.approx(np.angle(np.exp(1j * angle)), abs=1e-14)
