"""Attitude blocks of thesis E's system against SciPy, dense matrices and central differences."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from truth.kernel_step import rotation, scalar_first

from strapdown.kernels import memory as m
from strapdown.kernels.gnssins import attitude as k
from strapdown.kernels.gnssins import compensation, quaternion, update, vertical
from strapdown.kernels.gnssins import layout as lay

QUATS = [scalar_first(r) for r in Rotation.random(5, random_state=np.random.default_rng(1))]
RATE = np.array([0.7, -1.1, 0.4])
NORTH, EAST, DOWN, NORM = range(4)


def product(a, b):
    """Hamilton product, written out."""
    return np.array(
        [
            a[0] * b[0] - a[1:] @ b[1:],
            *(a[0] * np.asarray(b[1:]) + b[0] * np.asarray(a[1:]) + np.cross(a[1:], b[1:])),
        ]
    )


def rate_of_change(q, w, law):
    """(7.2.1) with the normalisation of (2.8.4), law 2, or (7.2.2), law 1."""
    eps = {2: 1.0 - q @ q, 1: 1.0 / np.linalg.norm(q) - 1.0}[law]
    return 0.5 * product(q, np.array([0.0, *w])) + eps * q


def differences(f, x, h=1e-5):
    return np.transpose([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(len(x))])


def covariance(n, seed=2):
    a = np.random.default_rng(seed).standard_normal((n, n))
    return a @ a.T + 0.1 * np.eye(n)


def scratch():
    return np.zeros(lay.W_SIZE)


# --- compensation ----------------------------------------------------------------------


def test_compensation_inverts_the_sensor_and_takes_its_warmth_off():
    rng = np.random.default_rng(3)
    S = np.eye(3) + 0.02 * rng.standard_normal((3, 3))
    offset, slope, true = rng.standard_normal((3, 3))
    p = np.zeros(lay.P_SIZE)
    p[lay.P_ACC : lay.P_ACC + 15] = *np.linalg.inv(S).ravel(), *offset, *slope
    measured = S @ (true + slope * (37.0 - 25.0)) + offset
    args = (p, lay.P_ACC, np.inf)
    warm = compensation.compensate(*args, 1.0, 37.0, *measured)
    np.testing.assert_allclose(warm, true, atol=1e-13)
    unknown = compensation.compensate(*args, 0.0, 37.0, *measured)
    np.testing.assert_allclose(unknown, true + 12.0 * slope, atol=1e-13)
    assert np.isinf(compensation.compensate(*args, 1.0, 37.0, *[np.inf] * 3)).all()


def test_sample_at_the_end_of_the_range_is_left_alone():
    p = np.zeros(lay.P_SIZE)
    p[lay.P_GYR : lay.P_GYR + 9] = np.diag([0.9, 0.9, 0.9]).ravel()
    args = (p, lay.P_GYR, 5.0, 0.0, 0.0)
    for at_the_end in ((5.0, 1.0, 1.0), (1.0, -5.0, 1.0), (1.0, 1.0, 6.0)):
        assert compensation.compensate(*args, *at_the_end) == at_the_end
    np.testing.assert_allclose(compensation.compensate(*args, 4.9, 1.0, 1.0), (4.41, 0.9, 0.9))


# --- quaternion ------------------------------------------------------------------------


@pytest.mark.parametrize("law", [1, 2])
@pytest.mark.parametrize("q", QUATS)
def test_f_and_d_are_the_derivatives_of_the_equation(q, law):
    w = scratch()
    quaternion.write_f(w, *q, *RATE, float(law))
    quaternion.write_d(w, *q)
    F, D = w[lay.W_F : lay.W_F + 16].reshape(4, 4), w[lay.W_D : lay.W_D + 12].reshape(4, 3)
    # central differences of a smooth function: h^2 and round-off / h, both below 1e-9
    np.testing.assert_allclose(
        F, differences(lambda x: rate_of_change(x, RATE, law), q), atol=1e-9
    )
    np.testing.assert_allclose(
        D, differences(lambda x: rate_of_change(q, x, law), RATE), atol=1e-9
    )


def test_f_is_the_printed_matrix():
    """(7.2.8), row by row."""
    a, b, c, d = QUATS[0]
    p, q, r = RATE
    w = scratch()
    quaternion.write_f(w, a, b, c, d, p, q, r, 2.0)
    want = [
        [-2 * a * a, -p / 2 - 2 * a * b, -q / 2 - 2 * a * c, -r / 2 - 2 * a * d],
        [p / 2 - 2 * a * b, -2 * b * b, r / 2 - 2 * b * c, -q / 2 - 2 * b * d],
        [q / 2 - 2 * a * c, -r / 2 - 2 * b * c, -2 * c * c, p / 2 - 2 * c * d],
        [r / 2 - 2 * a * d, q / 2 - 2 * b * d, -p / 2 - 2 * c * d, -2 * d * d],
    ]
    np.testing.assert_allclose(w[lay.W_F : lay.W_F + 16].reshape(4, 4), want, atol=1e-15)


@pytest.mark.parametrize("law", [1, 2])
def test_first_order_step_is_eulers_and_of_first_order(law):
    q = 0.98 * QUATS[1]
    got = quaternion.step_first_order(*q, *RATE, 0.01, float(law))
    np.testing.assert_allclose(got, q + 0.01 * rate_of_change(q, RATE, law), atol=1e-15)
    errors = []
    for n in (100, 200):
        x = QUATS[1]
        for _ in range(n):
            x = np.array(quaternion.step_first_order(*x, *RATE, 1.0 / n, float(law)))
        true = rotation(QUATS[1]) * Rotation.from_rotvec(RATE)
        errors.append((rotation(x / np.linalg.norm(x)) * true.inv()).magnitude())
    # the angle of Euler's step is atan(w dt / 2): second order per turn, but the axis is kept
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize(("law", "rate"), [(1, 1.0), (2, 2.0)])
def test_feedback_brings_the_norm_back_to_one(law, rate):
    """Near one its error decays as exp(-t) and exp(-2 t): what each law adds to F."""
    x, n, dt = 1.001 * QUATS[2], 1000, 1e-3
    for _ in range(n):
        x = np.array(quaternion.step_first_order(*x, 0.0, 0.0, 0.0, dt, float(law)))
    # second order of the deviation of 1e-3, and of rate dt in Euler's step
    assert np.linalg.norm(x) - 1.0 == pytest.approx(1e-3 * np.exp(-rate), rel=4e-3)


def test_without_a_law_the_norm_is_left_alone():
    assert quaternion.feedback(0.5, 0.5, 0.5, 0.6, 0.0) == 0.0


@pytest.mark.parametrize("q", QUATS)
def test_series_is_the_exponential_of_f_and_its_integral_over_d(q):
    w, dt = scratch(), 1.0
    quaternion.write_f(w, *q, *RATE, 2.0)
    quaternion.write_d(w, *q)
    F, D = w[lay.W_F : lay.W_F + 16].reshape(4, 4), w[lay.W_D : lay.W_D + 12].reshape(4, 3)
    whole = np.zeros((7, 7))
    whole[:4, :4], whole[:4, 4:] = F, -D  # the rate is what was measured less the bias
    want = expm(whole * dt)
    quaternion.transition_series(w, dt, 12)
    A, B = w[lay.W_A : lay.W_A + 16].reshape(4, 4), w[lay.W_B : lay.W_B + 12].reshape(4, 3)
    # ||F|| dt = 2: the first term left out is 2^13 / 13! = 1e-6
    np.testing.assert_allclose(A, want[:4, :4], atol=2e-6)
    np.testing.assert_allclose(B, want[:4, 4:], atol=2e-6)


@pytest.mark.parametrize("q", QUATS)
def test_transition_of_a_sample_is_the_derivative_of_the_normalised_turn(q):
    dt = 0.01

    def turned(x):
        e = scalar_first(Rotation.from_rotvec((RATE - x[4:]) * dt))
        n = product(x[:4], e)
        return n / np.linalg.norm(n)

    bias = np.array([0.02, -0.01, 0.03])
    e = scalar_first(Rotation.from_rotvec((RATE - bias) * dt))
    w = scratch()
    quaternion.transition_step(w, *product(q, e), *e, dt)
    A, B = w[lay.W_A : lay.W_A + 16].reshape(4, 4), w[lay.W_B : lay.W_B + 12].reshape(4, 3)
    want = differences(turned, np.concatenate((q, bias)))
    np.testing.assert_allclose(A, want[:, :4], atol=1e-9)
    # of the turn to first order: the next term is (w dt)^2 / 6 of dt / 2 = 2e-7
    np.testing.assert_allclose(B, want[:, 4:], atol=2e-7)
    # on the manifold: what moves the norm of q moves nothing
    np.testing.assert_allclose(A @ q, 0.0, atol=1e-15)


# --- Kalman filter ---------------------------------------------------------------------


def test_prediction_is_the_dense_product():
    rng = np.random.default_rng(4)
    w, P = scratch(), np.zeros((19, 19))
    P[:7, :7] = covariance(7)
    P[7:, 7:] = covariance(12)
    rest = P[7:].copy()
    A, B = rng.standard_normal((4, 4)), rng.standard_normal((4, 3))
    w[lay.W_A : lay.W_A + 16], w[lay.W_B : lay.W_B + 12] = A.ravel(), B.ravel()
    phi = np.block([[A, B], [np.zeros((3, 4)), np.eye(3)]])
    want = phi @ P[:7, :7] @ phi.T
    k.predict(P, w)
    np.testing.assert_allclose(P[:7, :7], want, atol=1e-12)
    assert np.array_equal(P, P.T)
    assert np.array_equal(P[7:], rest)


@pytest.mark.parametrize("q", QUATS)
def test_noise_is_that_of_rates_and_of_a_walking_bias(q):
    """(7.2.30)."""
    w, P = scratch(), covariance(7)
    quaternion.write_d(w, *q)
    D = np.zeros((7, 6))
    D[:4, :3], D[4:, 3:] = w[lay.W_D : lay.W_D + 12].reshape(4, 3), np.eye(3)
    want = P + D @ np.diag([0.3] * 3 + [0.02] * 3) @ D.T
    k.add_noise(P, *q, 0.3, 0.02)
    np.testing.assert_allclose(P, want, atol=1e-15)
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize(("axis", "n"), [(NORTH, 0), (EAST, 1), (DOWN, 2)])
@pytest.mark.parametrize("q", QUATS)
def test_directions_are_those_in_which_turns_in_n_move_the_quaternion(q, axis, n):
    w = scratch()
    k.write_direction(w, axis, *q)

    def turned(x):
        e = np.array([np.cos(x[0] / 2), 0.0, 0.0, 0.0])
        e[1 + n] = np.sin(x[0] / 2)
        return product(e, q)

    half = differences(turned, np.zeros(1))[:, 0]
    np.testing.assert_allclose(w[lay.W_H : lay.W_H + 4], 2.0 * half, atol=1e-9)


def test_directions_and_the_norm_are_an_orthogonal_frame():
    w, rows = scratch(), []
    for axis in (NORTH, EAST, DOWN, NORM):
        k.write_direction(w, axis, *QUATS[3])
        rows.append(w[lay.W_H : lay.W_H + 4].copy())
    np.testing.assert_allclose(np.array(rows) @ np.array(rows).T, np.eye(4), atol=1e-15)


@pytest.mark.parametrize("free", [7, 4])
def test_correction_is_josephs_form_with_the_unit_matrix_for_h(free):
    """(7.7.4) to (7.7.6); where the bias waits, its rows of the gain are zero."""
    P, w, q, r = covariance(7), scratch(), QUATS[0], 0.3
    x = np.zeros(lay.X_SIZE)
    x[m.Q : m.Q + 4] = q
    x[m.BG : m.BG + 3] = bias = np.array([0.1, 0.2, -0.3])
    residual = np.array([0.02, -0.01, 0.03, 0.015])
    H = np.eye(4, 7)
    gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + r * np.eye(4))
    dx, L = gain @ residual, np.eye(7) - gain @ H
    want = L @ P @ L.T + r * gain @ gain.T
    k.correct(x, P, w, lay.W_ROW, *residual, r, True, free)
    assert np.array_equal(P, P.T)
    if free == 7:
        np.testing.assert_allclose(P, want, atol=1e-12)
        np.testing.assert_allclose(x[m.BG : m.BG + 3], bias + dx[4:], atol=1e-13)
        moved = q + dx[:4]
        np.testing.assert_allclose(x[m.Q : m.Q + 4], moved / np.linalg.norm(moved), atol=1e-13)
    else:
        assert np.array_equal(x[m.BG : m.BG + 3], bias)
        np.testing.assert_allclose(P[:4, :4], want[:4, :4], atol=1e-12)
        assert np.linalg.eigvalsh(P).min() > 0.0
        assert np.diag(P)[4:] == pytest.approx(np.diag(covariance(7))[4:], abs=1e-12)


def test_without_a_heading_turns_about_down_stay():
    P, w, q = 0.01 * np.eye(7), scratch(), QUATS[1]
    x = np.zeros(lay.X_SIZE)
    x[m.Q : m.Q + 4] = q
    measured = scalar_first(Rotation.from_rotvec([0.02, -0.03, 0.2]) * rotation(q))
    residual = measured * np.sign(measured @ q) - q
    k.correct(x, P, w, lay.W_ROW, *residual, 0.01, False, 7)
    turn = (rotation(x[m.Q : m.Q + 4]) * rotation(q).inv()).as_rotvec()
    assert abs(turn[2]) < 1e-3  # second order in angles of 0.2 rad halved
    assert turn[0] == pytest.approx(0.01, abs=1e-3)
    np.testing.assert_allclose(np.isnan(w[lay.W_ROW : lay.W_ROW + 3]), False)
    k.write_direction(w, DOWN, *q)
    assert k.variance(P, w) == pytest.approx(0.01, abs=1e-12)


def test_scalar_update_is_the_textbook_one_in_its_block_only():
    P, w = np.zeros((19, 19)), scratch()
    P[:7, :7], P[7:, 7:] = covariance(7), covariance(12, 5)
    first, size, at = 7, 12, 3
    before = P.copy()
    h = np.zeros(12)
    h[3:5] = w[lay.W_H : lay.W_H + 2] = 0.6, -1.2
    block = P[7:, 7:].copy()
    s = h @ block @ h + 0.4
    assert update.expect(P, w, first, size, at, 2, 0.4) == pytest.approx(s, rel=1e-14)
    w[lay.W_DX : lay.W_DX + 12] = already = np.linspace(-0.2, 0.3, 12)
    left = update.update(P, w, first, size, at, 2, 0.7, s, 12)
    assert left == pytest.approx(0.7 - h @ already, rel=1e-13)
    gain = block @ h / s
    np.testing.assert_allclose(w[lay.W_DX : lay.W_DX + 12], already + gain * left, atol=1e-13)
    L = np.eye(12) - np.outer(gain, h)
    np.testing.assert_allclose(P[7:, 7:], L @ block @ L.T + 0.4 * np.outer(gain, gain), atol=1e-12)
    assert np.array_equal(P[:7], before[:7])


@pytest.mark.parametrize("has_heading", [True, False])
def test_reset_sets_the_covariance_of_what_was_measured(has_heading):
    P, w, q, new = covariance(7), scratch(), QUATS[0], QUATS[4]
    x = np.zeros(lay.X_SIZE)
    x[m.Q : m.Q + 4] = q
    bias = P[4:, 4:].copy()
    k.write_direction(w, DOWN, *q)
    down = k.variance(P, w)
    k.reset_covariance(x, P, w, *new, 1e-3, has_heading)
    assert np.array_equal(x[m.Q : m.Q + 4], new)
    assert np.array_equal(P[4:, 4:], bias)
    assert not P[:4, 4:].any()
    assert not P[4:, :4].any()
    for axis, want in ((NORTH, 1e-3), (EAST, 1e-3), (DOWN, 1e-3 if has_heading else down)):
        k.write_direction(w, axis, *new)
        assert k.variance(P, w) == pytest.approx(want, rel=1e-12)
    k.write_direction(w, NORM, *new)
    assert k.variance(P, w) < 1e-15
    x[m.BG : m.BG + 3] = 0.0
    k.write_std(x, P, w)
    assert x[m.STD_ATT] == pytest.approx(2.0 * np.sqrt(1e-3), rel=1e-12)
    np.testing.assert_allclose(x[m.STD_BG : m.STD_BG + 3], np.sqrt(np.diag(bias)))


@pytest.mark.parametrize("root", [False, True])
def test_adaptive_r_is_the_formula_in_both_readings(root):
    """(7.7.8) with the column "GPS inactive" of table 7.3."""
    exponent = 3.0 * 0.8
    want = 1e-2 * 10.0 ** (np.sqrt(exponent) if root else exponent) * 6.0**0.5
    for off_g, rate in ((0.8, 0.5), (-0.8, -0.5)):
        got = k.adaptive_r(1e-2, 3.0, 6.0, off_g, rate, float(root))
        assert got == pytest.approx(want, rel=1e-12)
    assert k.adaptive_r(1e-9, 0.0, 1.0, 4.0, 2.0, float(root)) == pytest.approx(1e-9)
    assert np.isfinite(k.adaptive_r(1e-2, 3.0, 6.0, 1e5, 1e4, float(root)))


# --- vertical reference ----------------------------------------------------------------


def test_acceleration_of_a_vehicle_is_the_derivative_of_its_velocity_in_turns():
    """(7.5.9): speed along x, any attitude; the box turned in the vehicle."""
    mount = Rotation.from_euler("ZYX", [0.4, -0.2, 0.3])
    p = np.zeros(lay.P_SIZE)
    p[lay.P_C_VB : lay.P_C_VB + 9] = mount.as_matrix().ravel()
    w_v = np.array([0.2, -0.3, 0.7])

    def v_n(t):
        return Rotation.from_rotvec(w_v * t).apply([8.0 + 1.5 * t, 0.0, 0.0])

    a_v = (v_n(1e-4) - v_n(-1e-4)) / 2e-4  # at t = 0 the vehicle's axes are those of n
    got = vertical.vehicle_acceleration(p, lay.P_C_VB, *mount.inv().apply(w_v), 8.0, 1.5)
    np.testing.assert_allclose(got, mount.inv().apply(a_v), atol=1e-6)
