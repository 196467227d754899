"""The two-stage kernel against SciPy's rotations, central differences and dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import feed, quat, rotation, scalar_first, start, unit

from strapdown.attitude import TwoStage
from strapdown.kernels import memory as m
from strapdown.kernels import status as s
from strapdown.kernels import two_stage as k

G = 9.80665
FIELD_N = np.array([2e-5, 0.0, 3e-5])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])
C_UN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # NED to ENU
VARIANTS = [
    {},
    {"linearisation": "printed"},
    {"restriction": "printed"},
    {"field_model": "printed"},
    {"integration": "printed"},
]


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((4, 4))
    return scale * (a @ a.T + 0.1 * np.eye(4))


def differences(f, q):
    """Derivative of f by central differences; exact for quadratic f but for round-off."""
    h = 1e-3
    return np.transpose([(f(q + h * e) - f(q - h * e)) / (2 * h) for e in np.eye(4)])


def seen(v_u):
    """The homogeneous form of a reference vector seen in b: ``|q|^2 C(q)^T v``."""
    return lambda q: (q @ q) * rotation(q).inv().apply(v_u)


def model(q, which, *sign):
    """What a measurement model writes: h and H."""
    w = np.zeros(k.W_SIZE)
    which(w, *q, *sign)
    return w[k.W_Z : k.W_Z + 3], w[k.W_H : k.W_H + 12].reshape(3, 4)


def dense_stage(P, prior, h, H, z, r):
    """The textbook: gain of `prior`, Joseph's form for P."""
    S = H @ prior @ H.T + r * np.eye(3)
    gain = prior @ H.T @ np.linalg.inv(S)
    L = np.eye(4) - gain @ H
    return gain @ (z - h), L @ P @ L.T + r * gain @ gain.T, gain, S


QUATS = [scalar_first(r) for r in Rotation.random(6, random_state=np.random.default_rng(2))]


@pytest.mark.parametrize("q", QUATS)
def test_gravity_model_is_up_in_the_body_and_its_derivative(q):
    f = seen([0.0, 0.0, 1.0])
    h, H = model(q, k.gravity_model)
    np.testing.assert_allclose(h, f(q), atol=1e-15)
    np.testing.assert_allclose(H, differences(f, q), atol=1e-11)


@pytest.mark.parametrize("q", QUATS)
def test_field_model_is_north_in_the_body_and_its_derivative(q):
    f = seen([0.0, 1.0, 0.0])
    h, H = model(q, k.field_model, 1.0)
    np.testing.assert_allclose(h, f(q), atol=1e-15)
    np.testing.assert_allclose(H, differences(f, q), atol=1e-11)


def test_printed_field_model_differs_by_the_sign_of_its_misprints_only():
    q = QUATS[0]
    (h, H), (h_printed, H_printed) = model(q, k.field_model, 1.0), model(q, k.field_model, -1.0)
    np.testing.assert_allclose(h - h_printed, [0.0, 2 * q[2] ** 2, 0.0], atol=1e-15)
    want = np.zeros((3, 4))
    want[1, 2], want[2, 2] = 4 * q[2], 4 * q[3]
    np.testing.assert_allclose(H - H_printed, want, atol=1e-15)


def test_transition_is_the_derivative_of_the_turned_quaternion():
    for seed, q in enumerate(QUATS):
        r = np.random.default_rng(seed).uniform(-0.5, 0.5, 3)
        e = scalar_first(Rotation.from_rotvec(r))
        w = np.zeros(k.W_SIZE)
        k.transition(w, *e)
        A = w[k.W_A : k.W_A + 16].reshape(4, 4)
        want = scalar_first(rotation(q) * Rotation.from_rotvec(r))
        np.testing.assert_allclose(A @ q, want * np.sign(want @ A @ q), atol=1e-15)
        # linear in q, so its columns are what it makes of the units: those of a rotation in 4D
        np.testing.assert_allclose(A @ A.T, np.eye(4), atol=1e-15)


def test_printed_transition_is_the_identity_and_half_omega_t():
    """(4.15) and (4.29), written out."""
    wx, wy, wz, dt = 0.3, -0.8, 0.5, 0.01
    omega = np.array([[0, -wx, -wy, -wz], [wx, 0, wz, -wy], [wy, -wz, 0, wx], [wz, wy, -wx, 0]])
    w = np.zeros(k.W_SIZE)
    k.transition(w, 1.0, 0.5 * wx * dt, 0.5 * wy * dt, 0.5 * wz * dt)
    A = w[k.W_A : k.W_A + 16].reshape(4, 4)
    np.testing.assert_allclose(A, np.eye(4) + 0.5 * dt * omega, atol=1e-17)


def test_congruence_is_the_dense_product():
    P, w = some_covariance(), np.zeros(k.W_SIZE)
    A = np.random.default_rng(3).standard_normal((4, 4))
    w[k.W_A : k.W_A + 16] = A.ravel()
    want = A @ P @ A.T
    k.congruence(P, w)
    np.testing.assert_allclose(P, want, atol=1e-13)
    assert np.array_equal(P, P.T)


def test_inverse_of_a_symmetric_matrix():
    a = some_covariance(4)[:3, :3]
    low = np.tril_indices(3)
    np.testing.assert_allclose(k.inverse(*a[low]), np.linalg.inv(a)[low], rtol=1e-12)


@pytest.mark.parametrize("same", [True, False])
def test_stage_is_the_textbook_update_in_josephs_form(same):
    P, q, r = some_covariance(5), QUATS[1], 0.3
    prior = P.copy() if same else some_covariance(6)
    z = unit([0.2, -0.5, 0.9])
    h, H = seen([0.0, 0.0, 1.0])(q), differences(seen([0.0, 0.0, 1.0]), q)
    dq, want, gain, S = dense_stage(P, prior, h, H, z, r)
    if same:  # the optimal gain: then the source's short form is the same
        np.testing.assert_allclose(want, (np.eye(4) - gain @ H) @ P, atol=1e-10)
    w = np.zeros(k.W_SIZE)
    k.remember(prior, w)
    k.gravity_model(w, *q)
    k.correct(P, w, m.D_ACC, *z, r)
    np.testing.assert_allclose(w[k.W_E : k.W_E + 4], dq, atol=1e-10)
    np.testing.assert_allclose(P, want, atol=1e-10)
    assert np.array_equal(P, P.T)
    np.testing.assert_allclose(w[m.D_ACC : m.D_ACC + 3], z - h, atol=1e-15)
    np.testing.assert_allclose(w[m.D_ACC + 3 : m.D_ACC + 6], np.sqrt(np.diag(S)), rtol=1e-10)
    assert w[m.D_ACC + 6] == s.ACCEPTED


def turn_in_u(q, dq):
    """Rotation vector in u of a small change of q; the part along q turns nothing."""
    eps = 1e-7
    return (rotation(q + eps * dq) * rotation(q).inv()).as_rotvec() / eps


@pytest.mark.parametrize("q", QUATS)
def test_first_stage_turns_about_the_level_axes_only_and_the_second_about_the_vertical(q):
    dq = np.random.default_rng(7).standard_normal(4)
    whole = turn_in_u(q, dq)
    for keep, want in ((k.keep_tilt, whole * [1, 1, 0]), (k.keep_heading, whole * [0, 0, 1])):
        w = np.zeros(k.W_SIZE)
        w[k.W_E : k.W_E + 4] = dq
        keep(w, *q, 0.0)
        np.testing.assert_allclose(turn_in_u(q, w[k.W_E : k.W_E + 4]), want, atol=1e-5)


def test_printed_restriction_zeroes_components_and_agrees_where_the_body_is_level():
    dq = np.array([0.1, 0.2, 0.3, 0.4])
    one = (1.0, 0.0, 0.0, 0.0)
    for keep, want in ((k.keep_tilt, [0.1, 0.2, 0.3, 0.0]), (k.keep_heading, [0.1, 0, 0, 0.4])):
        found = []
        for q, components in ((QUATS[2], 1.0), (one, 1.0), (one, 0.0)):
            w = np.zeros(k.W_SIZE)
            w[k.W_E : k.W_E + 4] = dq
            keep(w, *q, components)
            found.append(w[k.W_E : k.W_E + 4].copy())
        assert np.array_equal(found[0], want)
        np.testing.assert_allclose(turn_in_u(one, found[1]), turn_in_u(one, found[2]), atol=1e-6)


def dense_step(flt, q_nb, P, rate, acc, mag, dt):
    """The source's steps 1 to 15 with dense matrices, SciPy and differenced H; corrected."""
    e = Rotation.from_rotvec(rate * dt)
    A = np.transpose([mul_right(row, scalar_first(e)) for row in np.eye(4)])
    P = A @ P @ A.T + flt.process_noise**2 * dt * np.eye(4)
    q = scalar_first(Rotation.from_matrix(C_UN) * rotation(q_nb) * e)
    priori, P_priori = q, P
    up, north = seen([0.0, 0.0, 1.0]), seen([0.0, 1.0, 0.0])
    z = unit(acc)
    dq, P, _, _ = dense_stage(P, P, up(q), differences(up, q), z, flt.acc_noise**2 / dt)
    about = mul_right(np.array([0.0, 0.0, 0.0, 1.0]), q)
    q = unit(q + dq - about * (about @ dq))
    at, prior = (priori, P_priori) if flt.linearisation == "printed" else (q, P)
    level = rotation(at).apply(mag) * [1, 1, 0]
    z = unit(rotation(at).inv().apply(level))
    r = flt.mag_noise**2 / dt
    dq, P, _, _ = dense_stage(P, prior, north(at), differences(north, at), z, r)
    about = mul_right(np.array([0.0, 0.0, 0.0, 1.0]), q)
    q = unit(q + about * (about @ dq))
    return Rotation.from_matrix(C_UN.T) * rotation(q), P


def mul_right(a, b):
    """Quaternion product as scalar and vector parts."""
    vec = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], vec]


@pytest.mark.parametrize("linearisation", ["sequential", "printed"])
def test_one_sample_is_the_source_with_dense_matrices(linearisation):
    flt = TwoStage(linearisation=linearisation)
    x, P = start(flt, scalar_first(TURNED))
    P[:] = some_covariance(8, scale=0.1)
    rate, dt = np.array([0.5, -0.8, 1.3]), 0.02
    off = Rotation.from_rotvec([0.3, -0.2, 0.4])
    acc, mag = (TURNED * off).inv().apply([0.4, 0.3, -G]), (TURNED * off).inv().apply(FIELD_N)
    want, want_P = dense_step(flt, scalar_first(TURNED), P.copy(), rate, acc, mag, dt)
    w = feed(flt, x, P, dt, rate, acc, mag)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-10  # H by differences
    np.testing.assert_allclose(P, want_P, atol=1e-10)
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED


def test_linearisations_differ():
    found = []
    for linearisation in ("sequential", "printed"):
        flt = TwoStage(linearisation=linearisation)
        x, P = start(flt, scalar_first(TURNED))
        off = TURNED * Rotation.from_rotvec([0.3, -0.2, 0.4])
        feed(flt, x, P, 0.01, np.zeros(3), off.inv().apply([0, 0, -G]), off.inv().apply(FIELD_N))
        found.append(rotation(quat(x)))
    assert (found[0] * found[1].inv()).magnitude() > 1e-3


@pytest.mark.parametrize("parameters", VARIANTS, ids=str)
def test_covariance_stays_symmetric_and_positive_definite(parameters):
    flt = TwoStage(acc_noise=0.001, mag_noise=0.001, **parameters)  # strong updates
    rng = np.random.default_rng(9)
    x, P = start(flt, scalar_first(TURNED))
    r_nb = TURNED
    for i in range(1, 200):
        rate = 3.0 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * 0.01)
        acc, mag = r_nb.inv().apply([0, 0, -G]), r_nb.inv().apply(FIELD_N)
        feed(flt, x, P, 0.01 * i, rate, acc, mag if i % 3 == 0 else np.empty(0))
        assert np.array_equal(P, P.T)
        assert np.linalg.eigvalsh(P)[0] > 0.0
        assert abs(np.linalg.norm(quat(x)) - 1.0) < 1e-15


def test_printed_integration_lags_by_a_third_of_the_half_angle_cubed():
    """The first order makes ``2 atan(a / 2)`` of a turn a: short by ``a^3 / 12``."""
    r = np.array([0.06, -0.10, 0.08])
    for integration, lag in (("corrected", 0.0), ("printed", np.linalg.norm(r) ** 3 / 12)):
        flt = TwoStage(integration=integration)
        x, P = start(flt, scalar_first(TURNED))
        feed(flt, x, P, 0.1, r / 0.1, np.full(3, np.inf))
        turn = (TURNED.inv() * rotation(quat(x))).as_rotvec()
        short = np.linalg.norm(r) - np.linalg.norm(turn)
        assert short == pytest.approx(lag, rel=0.01, abs=1e-14)  # next term a^5 / 80


def test_a_vertical_field_is_no_measurement():
    found = []
    for mag in ([0.0, 0.0, 5e-5], np.empty(0)):
        x, P = start(TwoStage(), [1.0, 0, 0, 0])
        w = feed(TwoStage(), x, P, 0.01, np.zeros(3), [0, 0, -G], mag)
        assert w[m.D_MAG + 6] == s.NOT_MEASURED
        found.append((x, P))
    assert np.array_equal(found[0][1], found[1][1])
    assert np.array_equal(quat(found[0][0]), quat(found[1][0]))


def test_a_slower_sensor_is_weighed_by_its_own_interval():
    flt = TwoStage()
    x, P = start(flt, scalar_first(TURNED))
    acc = TURNED.inv().apply([0.3, 0, -G])
    feed(flt, x, P, 0.01, np.zeros(3), np.full(3, np.inf))
    w = feed(flt, x, P, 0.03, np.zeros(3), acc)
    H = model(scalar_first(Rotation.from_matrix(C_UN) * TURNED), k.gravity_model)[1]
    variance = flt.variance + 0.03 * flt.process_noise**2
    want = np.sqrt(np.diag(variance * H @ H.T) + flt.acc_noise**2 / 0.03)
    np.testing.assert_allclose(w[m.D_ACC + 3 : m.D_ACC + 6], want, rtol=1e-12)
