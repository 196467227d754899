"""The indirect EKF's kernel against matrix exponentials, central differences, dense matrices."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start, unit

from strapdown.attitude import IndirectEkf
from strapdown.kernels import indirect_ekf as k
from strapdown.kernels import mekf
from strapdown.kernels import memory as m
from strapdown.kernels import status as s

mpmath = pytest.importorskip("mpmath")
G = 9.80665
FIELD_N = np.array([2.25e-5, 0.0, 4.18e-5])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])
STAR_SIGMA = 2.267e-4  # spec A 2.7.7, four digits


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((6, 6))
    return scale * (a @ a.T + 0.1 * np.eye(6))


def test_jpl_quaternion_of_n_to_b_has_the_numbers_of_the_hamilton_q_nb():
    """The matrix of the source, ``(2 q4^2 - 1) I - 2 q4 [q x] + 2 q q^T``, takes n to b."""
    q, q4 = TURNED.as_quat()[:3], TURNED.as_quat()[3]
    c_bn = (2 * q4**2 - 1) * np.eye(3) - 2 * q4 * skew(q) + 2 * np.outer(q, q)
    np.testing.assert_allclose(c_bn, TURNED.inv().as_matrix(), atol=1e-15)


@pytest.mark.parametrize("psi", [0.0, 1e-6, 0.01, 0.4, 0.999999, 1.000001, 2.5, 7.0])
def test_coefficients_have_full_digits_on_both_sides_of_the_switch(psi):
    got = k.coefficients(psi**2)
    with mpmath.workdps(150):
        y = mpmath.mpf(psi) if psi else mpmath.mpf("1e-15")
        sin, cos = mpmath.sin(y), mpmath.cos(y)
        want = [
            (1 - cos) / y**2,
            (y - sin) / y**3,
            (y**2 / 2 + cos - 1) / y**4,
            (y**3 / 3 + 2 * sin - 2 * y) / y**5,
        ]
    # at 1 rad the closed form of the last one loses a factor of 120 to cancellation
    np.testing.assert_allclose(got, [float(v) for v in want], rtol=120 * 2.2e-16)


def blocks(w):
    A, B = w[k.W_A : k.W_A + 9].reshape(3, 3), w[k.W_B : k.W_B + 9].reshape(3, 3)
    return np.block([[A, B], [np.zeros((3, 3)), np.eye(3)]])


def exact(phi, dt):
    w = np.zeros(k.W_SIZE)
    f2, f3, _, _ = k.coefficients(phi @ phi)
    k.transition_exact(w, *phi, dt, f2, f3)
    return blocks(w)


def truncated(phi, dt):
    w = np.zeros(k.W_SIZE)
    k.transition_truncated(w, *phi, dt)
    return blocks(w)


def continuous(phi, dt):
    """F_c of (7.16)."""
    return np.block([[-skew(phi / dt), -np.eye(3)], [np.zeros((3, 6))]])


TURNS = [[0.3, -0.4, 0.5], [1e-3, 2e-3, -1e-3], [1.0, -2.0, 0.5]]


@pytest.mark.parametrize("phi", TURNS)
def test_exact_transition_is_the_matrix_exponential(phi):
    phi, dt = np.array(phi), 0.02
    np.testing.assert_allclose(exact(phi, dt), expm(continuous(phi, dt) * dt), atol=2e-15)


@pytest.mark.parametrize("phi", TURNS)
def test_exact_transition_agrees_with_central_differences_on_the_manifold(phi):
    phi, dt, h = np.array(phi), 0.02, 1e-5

    def error(e):
        turn = Rotation.from_rotvec(phi - e[3:] * dt)
        truth = Rotation.from_rotvec(e[:3]) * turn
        return np.r_[(Rotation.from_rotvec(phi).inv() * truth).as_rotvec(), e[3:]]

    want = np.transpose([(error(h * e) - error(-h * e)) / (2 * h) for e in np.eye(6)])
    np.testing.assert_allclose(exact(phi, dt), want, atol=1e-9)


def noise(phi, dt, n2, k2, f=None):
    P = np.zeros((6, 6))
    _, f3, f4, f5 = k.coefficients(phi @ phi) if f is None else f
    k.add_noise(P, *phi, dt, n2, k2, f3, f4, f5)
    return P


@pytest.mark.parametrize("phi", TURNS)
def test_exact_noise_is_the_integral_of_the_propagated_density(phi):
    """By Van Loan's exponential; the bias density is large so that all blocks count."""
    phi, dt, n2, k2 = np.array(phi), 0.5, 0.3, 0.7
    F = continuous(phi, dt)
    Q = np.diag([n2] * 3 + [k2] * 3)
    big = expm(np.block([[-F, Q], [np.zeros((6, 6)), F.T]]) * dt)
    want = big[6:, 6:].T @ big[:6, 6:]
    got = noise(phi, dt, n2, k2)
    np.testing.assert_allclose(got, want, atol=1e-14)
    assert np.array_equal(got, got.T)


def test_truncated_forms_leave_out_what_is_of_second_order_in_the_turn():
    phi, dt = np.array([0.3, -0.4, 0.5]), 1.0
    off = [np.abs(truncated(c * phi, dt) - exact(c * phi, dt)).max() for c in (0.02, 0.01, 0.005)]
    # Psi is off by dt phi / 2, which is of first order in phi and of second in dt
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 2.0, rtol=0.05)
    theta = [
        np.abs((truncated(c * phi, dt) - exact(c * phi, dt))[:3, :3]).max() for c in (0.02, 0.01)
    ]
    assert theta[0] / theta[1] == pytest.approx(4.0, rel=0.05)
    plain = noise(np.zeros(3), 0.1, 0.3, 0.7)  # (8.3) to (8.5)
    eye = np.eye(3)
    want = np.block([[(0.03 + 0.7e-3 / 3) * eye, -0.0035 * eye], [-0.0035 * eye, 0.07 * eye]])
    np.testing.assert_allclose(plain, want, atol=1e-16)
    assert np.array_equal(noise(phi, 0.1, 0.3, 0.7, (0.0, 0.0, 0.0, 0.0)), plain)


@pytest.mark.parametrize(("propagation", "form"), [("exact", exact), ("truncated", truncated)])
def test_propagation_is_the_dense_congruence_of_its_form(propagation, form):
    flt = IndirectEkf(propagation=propagation, gyr_noise=0.1, gyr_bias_noise=0.3)
    phi, dt, P = np.array([0.03, -0.04, 0.05]), 0.02, some_covariance()
    f = None if propagation == "exact" else (0.0, 0.0, 0.0, 0.0)
    want = form(phi, dt) @ P @ form(phi, dt).T + noise(phi, dt, 0.1**2, 0.3**2, f)
    k.propagate(P, np.zeros(k.W_SIZE), flt._params(), *phi, dt)
    np.testing.assert_allclose(P, want, atol=1e-13)
    assert np.array_equal(P, P.T)


def test_large_turns_are_propagated_exactly_by_both():
    found = []
    for propagation in ("exact", "truncated"):
        P = some_covariance()
        p = IndirectEkf(propagation=propagation)._params()
        k.propagate(P, np.zeros(k.W_SIZE), p, 0.4, -0.3, 0.2, 0.1)
        found.append(P)
    assert np.array_equal(*found)


def rows(r_nb, v_n):
    """Derivative of a reference vector seen in b with respect to the attitude error."""
    h = 1e-5

    def seen(d):
        return (r_nb * Rotation.from_rotvec(d)).inv().apply(v_n)

    return np.transpose([(seen(h * e) - seen(-h * e)) / (2 * h) for e in np.eye(3)])


def star_rows(r_nb, star):
    """Derivative of the vector part of ``q_nb^-1 q_star`` of a true star with respect to it."""
    h = 1e-5

    def seen(d):
        return (r_nb.inv() * r_nb * Rotation.from_rotvec(d)).as_quat()[:3]

    return np.transpose([(seen(h * e) - seen(-h * e)) / (2 * h) for e in np.eye(3)])


def test_one_sample_is_the_stacked_update_of_the_source_with_dense_matrices():
    """Star tracker, gravity and field at once: a 9x6 H by differences, one gain, (7.48)-(7.57)."""
    flt = IndirectEkf(
        acc_noise=0.5, mag_factor=300.0, star_resolution=0.2, gate=np.inf,
        mag_reference=(FIELD_N[0], FIELD_N[2]), std_gyr_bias=0.05,
    )  # fmt: skip
    b0 = np.array([0.02, -0.01, 0.03])
    x, P = start(flt, scalar_first(TURNED), b0)
    P[:] = some_covariance(8, scale=1e-2)
    rate, dt, before = np.array([0.5, -0.8, 1.3]), 0.02, P.copy()
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.03])
    acc, mag = off.inv().apply([0.1, 0.2, -G]), off.inv().apply(FIELD_N + [1e-6, -2e-6, 0])
    star = off * Rotation.from_rotvec([-0.02, 0.04, 0.01])
    phi = (rate - b0) * dt
    F = expm(continuous(phi, dt) * dt)
    Qd = noise(phi, dt, flt.gyr_noise**2, flt.gyr_bias_noise**2)
    P0 = F @ before @ F.T + Qd
    r_nb = TURNED * Rotation.from_rotvec(phi)
    size = np.linalg.norm(FIELD_N)
    H = np.vstack((star_rows(r_nb, star), rows(r_nb, [0, 0, -1]), rows(r_nb, FIELD_N / size)))
    H = np.hstack((H, np.zeros((9, 3))))
    z = np.r_[
        (r_nb.inv() * star).as_quat()[:3] * np.sign((r_nb.inv() * star).as_quat()[3]),
        acc / G - r_nb.inv().apply([0, 0, -1]),
        mag / size - r_nb.inv().apply(FIELD_N / size),
    ]
    variances = (0.2**2 / 48, 0.5**2 / dt / G**2, (300.0 * 1.5e-8 / size) ** 2 / dt)
    R = np.diag(np.repeat(variances, 3))
    K = P0 @ H.T @ np.linalg.inv(H @ P0 @ H.T + R)
    dx = K @ z
    want_P = (np.eye(6) - K @ H) @ P0 @ (np.eye(6) - K @ H).T + K @ R @ K.T
    dq = np.r_[dx[:3] / 2, np.sqrt(1 - dx[:3] @ dx[:3] / 4)]
    x[m.STAR] = 1.0
    x[m.STAR + 1 : m.STAR + 5] = -scalar_first(star)  # either sign
    w = feed(flt, x, P, dt, rate, acc, mag)
    assert (rotation(quat(x)) * (r_nb * Rotation.from_quat(dq)).inv()).magnitude() < 1e-9
    np.testing.assert_allclose(bias(x), b0 + dx[3:], atol=1e-9)
    np.testing.assert_allclose(P, want_P, atol=1e-10)  # rows by differences
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED
    assert x[m.STAR] == 0.0


def test_sigma_of_the_star_tracker_is_that_of_an_encoder_step():
    p = IndirectEkf()._params()
    assert p[k.P_STD_STAR] == pytest.approx(STAR_SIGMA, rel=5e-4)


@pytest.mark.parametrize("length", [0.1, 1.9, 2.5, 40.0])
def test_correction_beyond_half_a_turn_takes_the_other_form(length):
    """(7.53) up to ``|dtheta| = 2``; beyond it (7.54), where the root would be imaginary."""
    x, _ = start(IndirectEkf(), scalar_first(TURNED))
    dtheta = length * unit([0.2, -0.5, 0.7])
    w = np.zeros(k.W_SIZE)
    w[k.W_DX : k.W_DX + 6] = *dtheta, 0.1, 0.2, 0.3
    k.inject(x, w)
    half = dtheta / 2
    dq = np.r_[half, np.sqrt(1 - half @ half) if length < 2 else 1.0]
    want = TURNED * Rotation.from_quat(dq)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(bias(x), [0.1, 0.2, 0.3])


def test_reference_is_learned_from_the_first_field_and_kept():
    flt = IndirectEkf()
    x, P = start(flt, scalar_first(TURNED))
    w = feed(flt, x, P, 0.01, np.zeros(3), np.full(3, np.inf), TURNED.inv().apply(FIELD_N))
    assert w[m.D_MAG + 6] == s.NOT_MEASURED
    np.testing.assert_allclose(x[[k.REF_H, k.REF_D]], FIELD_N[[0, 2]], rtol=1e-12)
    w = feed(flt, x, P, 0.02, np.zeros(3), np.full(3, np.inf), TURNED.inv().apply(2 * FIELD_N))
    assert w[m.D_MAG + 6] != s.NOT_MEASURED
    np.testing.assert_allclose(x[[k.REF_H, k.REF_D]], FIELD_N[[0, 2]], rtol=1e-12)
    x, P = start(flt, [1.0, 0, 0, 0])
    feed(flt, x, P, 0.01, np.zeros(3), np.full(3, np.inf), [0.0, 0.0, 5e-5])
    assert x[k.REF_H] == 0.0  # a vertical field tells no heading


@pytest.mark.parametrize("bad", [[np.nan, 0, 0, 1], [0, 0, 0, 0], [2, 0, 0, 0]])
def test_star_that_is_no_rotation_is_flagged_and_left(bad):
    found = []
    for star in (None, bad):
        x, P = start(IndirectEkf(), scalar_first(TURNED))
        if star is not None:
            x[m.STAR] = 1.0
            x[m.STAR + 1 : m.STAR + 5] = star
        feed(IndirectEkf(), x, P, 0.01, [0.1, 0, 0], [0, 0, -G])
        found.append((x, P))
    assert int(found[1][0][m.STATUS]) & s.AIDING_REJECTED
    assert np.array_equal(quat(found[0][0]), quat(found[1][0]))
    assert np.array_equal(found[0][1], found[1][1])


@pytest.mark.parametrize("propagation", ["exact", "truncated"])
def test_covariance_stays_symmetric_and_positive_definite(propagation):
    flt = IndirectEkf(acc_noise=0.01, mag_factor=1.0, propagation=propagation)
    rng = np.random.default_rng(9)
    state = flt.init()
    x, P, r_nb = state.x, state.P, TURNED
    for i in range(200):
        rate = 3.0 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * 0.01)
        acc, mag = r_nb.inv().apply([0, 0, -G]), r_nb.inv().apply(FIELD_N)
        feed(flt, x, P, 0.01 * i, rate, acc, mag if i % 3 == 0 else np.empty(0))
        assert np.array_equal(P, P.T)
        assert np.linalg.eigvalsh(P)[0] > 0.0
        assert abs(np.linalg.norm(quat(x)) - 1.0) < 1e-15


@pytest.mark.parametrize(("clipped", "gap"), [(True, False), (False, True), (False, False)])
def test_unseen_rates_widen_the_covariance(clipped, gap):
    flt = IndirectEkf(gap_rate=0.5, gyr_range=10.0, max_gap=0.4)
    x, P = start(flt, [1.0, 0, 0, 0])
    P[:] = 0.0
    dt = 0.5 if gap else 0.1
    feed(flt, x, P, dt, [0.0, 0.0, 10.0 if clipped else 9.9], np.full(3, np.inf))
    # over a gap a constant rate is unseen, beyond the range one that stays for 0.25 s
    hidden = (0.5 * dt) ** 2 if gap else (2 * 0.25 * 0.5**2 * dt if clipped else 0.0)
    want = flt.gyr_noise**2 * dt + hidden
    assert P[2, 2] == pytest.approx(want, rel=1e-4)  # and K^2 dt^3 / 3
    assert mekf.P_SIZE == k.P_STD_STAR
