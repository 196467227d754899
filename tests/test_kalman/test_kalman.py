"""General Kalman tools against SciPy, closed forms and each other."""

import numpy as np
import pytest
from scipy import integrate, linalg, stats

from strapdown import kalman
from strapdown.errors import NotConverged

DT = 0.3


def some_covariance(n, seed=0, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((n, n))
    return scale * (a @ a.T + 0.1 * np.eye(n))


def some_model(seed=1):
    """Three states, two looks, two noises; stable."""
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((3, 3)) - 2.0 * np.eye(3)
    return F, rng.standard_normal((3, 2)), rng.standard_normal((2, 3)), rng


# --- linear filter ---------------------------------------------------------------------------


def test_prediction_and_correction_are_the_textbook_ones():
    F, G, H, rng = some_model()
    x, P, Q, R = (
        rng.standard_normal(3),
        some_covariance(3),
        np.diag([0.1, 2.0]),
        some_covariance(2, 2),
    )
    B, u, J = rng.standard_normal((3, 1)), [0.7], rng.standard_normal((2, 2))
    ahead = kalman.predict(x, P, F, Q, G=G, B=B, u=u)
    np.testing.assert_allclose(ahead.x, F @ x + B[:, 0] * 0.7, rtol=1e-14)
    np.testing.assert_allclose(ahead.P, F @ P @ F.T + G @ Q @ G.T, rtol=1e-13)
    z = rng.standard_normal(2)
    found = kalman.update(x, P, z, H, R, J=J)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + J @ R @ J.T)
    np.testing.assert_allclose(found.K, K, rtol=1e-11)
    np.testing.assert_allclose(found.x, x + K @ (z - H @ x), rtol=1e-11)
    np.testing.assert_allclose(found.P, (np.eye(3) - K @ H) @ P, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(found.P, found.P.T)


def test_run_is_predict_and_update_in_turn_and_skips_what_is_missing():
    F, G, H, rng = some_model()
    Phi, Q, R = linalg.expm(F * DT), np.diag([0.1, 2.0]), some_covariance(2, 2)
    z, u, B = (
        rng.standard_normal((20, 2)),
        rng.standard_normal((20, 1)),
        rng.standard_normal((3, 1)),
    )
    z[4, 1], z[7:9] = np.nan, np.nan
    track = kalman.run(z, Phi, H, Q, R, np.zeros(3), np.eye(3), G=G, B=B, u=u)
    x, P = np.zeros(3), np.eye(3)
    for i in range(20):
        if i:
            x, P = kalman.predict(x, P, Phi, Q, G=G, B=B, u=u[i - 1])
        if np.isfinite(z[i]).all():
            x, P, nu, S, _ = kalman.update(x, P, z[i], H, R)
            np.testing.assert_allclose(track.innovation[i], nu, rtol=1e-12)
            np.testing.assert_allclose(track.S[i], S, rtol=1e-12)
        else:
            assert np.isnan(track.innovation[i]).all()
        np.testing.assert_allclose(track.x[i], x, rtol=1e-12)
        np.testing.assert_allclose(track.P[i], P, rtol=1e-11)


def test_josephs_form_keeps_a_covariance_where_the_short_one_fails():
    """A look 1e8 times better than what was known, where (I - K H) P loses all digits."""
    P = np.array([[1.0, 0.999999], [0.999999, 1.0]])
    found = kalman.update([0, 0], 1e8 * P, [1.0], [[1.0, 0.0]], [[1e-8]])
    assert np.linalg.eigvalsh(found.P).min() >= -1e-9
    assert found.P[0, 0] == pytest.approx(1e-8, rel=1e-6)


def test_filter_of_a_static_state_is_least_squares():
    rng = np.random.default_rng(3)
    H = rng.standard_normal((2, 3))
    H2 = rng.standard_normal((3, 3))
    truth, R = np.array([1.0, -2.0, 0.5]), 0.04
    x, P = np.zeros(3), 1e8 * np.eye(3)
    rows, looks = np.concatenate((H, H2)), []
    for part in (H, H2):
        z = part @ truth + 0.2 * rng.standard_normal(len(part))
        looks.extend(z)
        x, P, *_ = kalman.update(x, P, z, part, R * np.eye(len(part)))
    best, *_ = np.linalg.lstsq(rows, looks, rcond=None)
    np.testing.assert_allclose(x, best, atol=1e-6)  # the prior counts as 1e-8 of a look
    np.testing.assert_allclose(P, R * np.linalg.inv(rows.T @ rows), rtol=1e-5)


def simulate(Phi, H, Q, R, P0, k, rng):
    x = rng.multivariate_normal(np.zeros(len(Phi)), P0)
    states, looks = [], []
    for i in range(k):
        if i:
            x = Phi @ x + rng.multivariate_normal(np.zeros(len(Phi)), Q)
        states.append(x)
        looks.append(H @ x + rng.multivariate_normal(np.zeros(len(H)), R))
    return np.array(states), np.array(looks)


def test_squares_of_errors_and_innovations_keep_their_bounds():
    """100 runs of 30 steps on the filter's own model: 99.9 % bounds."""
    F, _, H, _ = some_model()
    Phi, Q = kalman.van_loan(F, some_covariance(3, 5), DT)
    R, P0 = some_covariance(2, 6), some_covariance(3, 7)
    errors, squares, whitened = [], [], []
    for seed in range(100):
        truth, z = simulate(Phi, H, Q, R, P0, 30, np.random.default_rng(seed))
        track = kalman.run(z, Phi, H, Q, R, np.zeros(3), P0)
        errors.append(kalman.nees(truth - track.x, track.P))
        squares.append(kalman.nis(track.innovation, track.S))
        roots = np.linalg.cholesky(track.S)
        whitened.append(np.linalg.solve(roots, track.innovation[..., None])[..., 0])
    low, high = kalman.mean_bounds(3, 100, 0.999)
    assert low < np.array(errors)[:, -1].mean() < high
    low, high = kalman.mean_bounds(2, 3000, 0.999)
    assert low < np.array(squares).mean() < high
    w = np.array(whitened)
    lagged = np.einsum("ski,skj->ij", w[:, 1:], w[:, :-1]) / 2900
    assert np.abs(lagged).max() < 4 / np.sqrt(2900)  # white


# --- nonlinear -------------------------------------------------------------------------------


def test_extended_filter_of_a_linear_model_is_the_linear_one():
    F, _, H, rng = some_model()
    Phi, Q, R = linalg.expm(F * DT), some_covariance(3, 5), some_covariance(2, 2)
    z = rng.standard_normal((15, 2))
    z[3] = np.nan
    one = kalman.run(z, Phi, H, Q, R, np.zeros(3), np.eye(3))
    two = kalman.run_extended(
        z, lambda x: Phi @ x, Phi, lambda x: H @ x, None, Q, R, np.zeros(3), np.eye(3)
    )
    nominal = np.array([np.linalg.matrix_power(Phi, i) @ [1.0, 2.0, 3.0] for i in range(15)])
    three = kalman.run_linearised(
        z, nominal, Phi, lambda x: H @ x, H, Q, R, [-1.0, -2.0, -3.0], np.eye(3)
    )
    for other in (two, three):
        # differences of a linear function: 1e-16 / 1e-6
        np.testing.assert_allclose(other.x, one.x, atol=1e-8)
        np.testing.assert_allclose(other.P, one.P, atol=1e-8)
        np.testing.assert_allclose(other.innovation, one.innovation, atol=1e-8)


def pendulum(x):
    return np.array([x[0] + 0.05 * x[1], x[1] - 0.05 * np.sin(x[0])])


def test_extended_steps_linearise_where_they_should():
    x, P = np.array([1.0, -0.3]), some_covariance(2, 8)
    ahead = kalman.extended_predict(x, P, pendulum, None, [[0.2]], G=lambda x: [[0.0], [x[0]]])
    F = np.array([[1, 0.05], [-0.05 * np.cos(1.0), 1]])
    np.testing.assert_allclose(ahead.x, pendulum(x))
    np.testing.assert_allclose(ahead.P, F @ P @ F.T + np.diag([0, 0.2]), atol=1e-9)
    found = kalman.extended_update(x, P, [0.9], lambda x: np.sin(x[:1]), None, [[0.01]])
    same = kalman.update(x, P, [0.9 - np.sin(1.0) + np.cos(1.0)], [[np.cos(1.0), 0]], [[0.01]])
    np.testing.assert_allclose(found.x, same.x, atol=1e-9)
    np.testing.assert_allclose(found.P, same.P, atol=1e-9)


def test_extended_filter_follows_what_the_linearised_one_loses():
    """A truth that leaves the nominal swing by a radian: the sine there is not its tangent."""
    truth, nominal = [np.array([1.3, 0.0])], [np.array([0.3, 0.0])]
    for _ in range(199):
        truth.append(pendulum(truth[-1]))
        nominal.append(pendulum(nominal[-1]))
    truth, nominal = np.array(truth), np.array(nominal)
    z = np.sin(truth[:, :1]) + 1e-3 * np.random.default_rng(1).standard_normal((200, 1))
    Q, R = 1e-8 * np.eye(2), [[1e-6]]
    h = lambda x: np.sin(x[:1])  # noqa: E731
    start, P0 = np.array([1.1, 0.0]), 0.04 * np.eye(2)
    one = kalman.run_extended(z, pendulum, None, h, None, Q, R, start, P0)
    F = lambda x: kalman.jacobian(pendulum, x)  # noqa: E731
    two = kalman.run_linearised(z, nominal, F, h, None, Q, R, start - nominal[0], P0)
    assert np.abs(one.x[-1] - truth[-1]).max() < 5e-3
    assert np.abs(two.x - truth)[100:].max() > 0.1


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_jacobian_falls_with_the_square_of_the_step(step):
    off = [abs(kalman.jacobian(np.exp, [0.0], k * step)[0, 0] - 1.0) for k in (1.0, 0.5)]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)


# --- information form ------------------------------------------------------------------------


def test_information_form_is_the_covariance_form():
    _, _, H, rng = some_model()
    x, P, z, R = (
        rng.standard_normal(3),
        some_covariance(3),
        rng.standard_normal(2),
        some_covariance(2, 4),
    )
    fused = kalman.fuse(
        kalman.Information.from_estimate(x, P), kalman.Information.from_measurement(z, H, R)
    ).estimate()
    found = kalman.update(x, P, z, H, R)
    np.testing.assert_allclose(fused.x, found.x, rtol=1e-11)
    np.testing.assert_allclose(fused.P, found.P, rtol=1e-10)


def test_more_looks_than_states_are_weighed_by_their_noise():
    """The source's m = H^+ z (3.3.9) would weigh three unequal looks at one number equally."""
    info = kalman.Information.from_measurement(
        [1.0, 2.0, 6.0], np.ones((3, 1)), np.diag([1, 1, 100.0])
    )
    x, P = info.estimate()
    assert x[0] == pytest.approx((1 + 2 + 0.06) / 2.01)
    assert P[0, 0] == pytest.approx(1 / 2.01)


def test_nothing_known_adds_nothing_and_is_told():
    some = kalman.Information.from_measurement([2.0], [[0.6, 0.8]], [[0.5]])
    nothing = kalman.Information(np.zeros(2), np.zeros((2, 2)))
    assert (nothing.rank, some.rank) == (0, 1)
    np.testing.assert_allclose(kalman.fuse(some, nothing).mean(), [1.2, 1.6])
    with pytest.raises(
        ValueError, match=r"`Y` must have full rank, got 1 of 2: nothing is known along"
    ):
        some.estimate()
    with pytest.raises(ValueError, match=r"`parts` must be of one state, got sizes \[1, 2\]"):
        kalman.fuse(some, kalman.Information(np.zeros(1), np.eye(1)))
    with pytest.raises(ValueError, match="`parts` must be of one state, got none"):
        kalman.fuse()


# --- discretisation --------------------------------------------------------------------------


def test_van_loan_is_the_integral_of_the_propagated_density():
    F, G, _, _ = some_model()
    Q = np.array([[0.5, 0.1], [0.1, 2.0]])
    Phi, Q_d = kalman.van_loan(F, Q, DT, G=G)
    np.testing.assert_allclose(Phi, linalg.expm(F * DT), rtol=1e-12)
    want, _ = integrate.quad_vec(
        lambda s: linalg.expm(F * s) @ G @ Q @ G.T @ linalg.expm(F * s).T, 0.0, DT, epsabs=1e-13
    )
    np.testing.assert_allclose(Q_d, want, rtol=1e-10, atol=1e-13)
    assert np.linalg.eigvalsh(Q_d).min() > 0.0


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_series_leave_out_the_next_power_of_dt(order):
    F, _, _, _ = some_model()
    Q = some_covariance(3, 9)
    off = []
    for dt in (0.02, 0.01):
        Phi, Q_d = kalman.van_loan(F, Q, dt)
        off.append(
            (
                np.abs(kalman.transition(F, dt, order) - Phi).max(),
                np.abs(kalman.noise_series(F, Q, dt, order) - Q_d).max(),
            )
        )
    assert off[0][0] / off[1][0] == pytest.approx(2.0 ** (order + 1), rel=0.1)
    assert off[0][1] / off[1][1] == pytest.approx(2.0 ** (order + 1), rel=0.1)


def test_state_transition_has_its_properties():
    """Thesis GNSS/INS theory, 3.6.3; the fifth as corrected, d Phi / dt = -Phi F."""
    F, _, _, _ = some_model()
    a, b = kalman.transition(F, 0.2), kalman.transition(F, 0.1)
    np.testing.assert_array_equal(kalman.transition(F, 0.0), np.eye(3))
    np.testing.assert_allclose(a @ b, kalman.transition(F, 0.3), rtol=1e-12)
    h = 1e-5
    earlier = (linalg.expm(F * (0.2 + h)) - linalg.expm(F * (0.2 - h))) / (-2 * h)
    np.testing.assert_allclose(earlier, -a @ F, rtol=1e-7)


def test_chain_of_integrators_is_the_toeplitz_matrix_of_powers():
    t = 0.7
    want = [[1, t, t**2 / 2, t**3 / 6], [0, 1, t, t**2 / 2], [0, 0, 1, t], [0, 0, 0, 1]]  # (3.6.7)
    np.testing.assert_allclose(kalman.transition(np.eye(4, k=1), t), want, rtol=1e-14)
    np.testing.assert_allclose(kalman.transition(np.eye(4, k=1), t, order=3), want, rtol=1e-14)


def test_damped_spring_has_the_closed_form():
    """(3.4.3) to (3.5.9): mass 2, spring 8, damping 1."""
    F = np.array([[0.0, 1.0], [-4.0, -0.5]])
    values = np.linalg.eigvals(F)
    omega = np.sqrt(4 * 2 * 8 - 1) / 4
    np.testing.assert_allclose(values.real, -0.25)
    np.testing.assert_allclose(np.abs(values.imag), omega)
    t = 1.3
    x = kalman.transition(F, t) @ [1.0, -0.25]  # starts as exp(-t / 4) cos(omega t) does
    assert x[0] == pytest.approx(np.exp(-0.25 * t) * np.cos(omega * t), rel=1e-12)


def test_input_matrix_is_the_integral_of_the_transition():
    F, _, _, rng = some_model()
    B = rng.standard_normal((3, 2))
    want, _ = integrate.quad_vec(lambda s: linalg.expm(F * s) @ B, 0.0, DT, epsabs=1e-13)
    np.testing.assert_allclose(kalman.input_matrix(F, B, DT), want, rtol=1e-10, atol=1e-12)


def test_attitude_error_of_the_platform_is_a_special_case():
    """Three-axis platform, (8.3) to (8.5) with N^2 dt and K^2 dt for the two variances."""
    n2, k2, dt = 1e-6, 1e-8, 0.01
    F = np.zeros((6, 6))
    F[:3, 3:] = -np.eye(3)
    Q = np.diag([n2] * 3 + [k2] * 3)
    _, Q_d = kalman.van_loan(F, Q, dt)
    np.testing.assert_allclose(Q_d[:3, :3], (n2 * dt + k2 * dt**3 / 3) * np.eye(3), rtol=1e-12)
    np.testing.assert_allclose(Q_d[:3, 3:], -k2 * dt**2 / 2 * np.eye(3), rtol=1e-12, atol=1e-25)
    np.testing.assert_allclose(kalman.noise_series(F, Q, dt, 3), Q_d, rtol=1e-12, atol=1e-25)


# --- noise with memory -----------------------------------------------------------------------


def test_gauss_markov_keeps_its_deviation_and_its_correlation():
    model = kalman.gauss_markov(0.5, 2.0, axes=2).discrete(DT)
    np.testing.assert_allclose(model.F, np.exp(-DT / 2.0) * np.eye(2))
    np.testing.assert_allclose(model.Q, 0.25 * (1 - np.exp(-2 * DT / 2.0)) * np.eye(2))
    P = linalg.solve_discrete_lyapunov(model.F, model.Q)
    np.testing.assert_allclose(P, model.P0, rtol=1e-12)


def test_wiener_grows_with_time_and_step_is_the_random_walk():
    model = kalman.wiener(0.2, std=0.3).discrete(DT)
    assert model.F[0, 0] == 1.0
    assert model.Q[0, 0] == pytest.approx(0.04 * DT)
    assert model.P0[0, 0] == pytest.approx(0.09)


def test_augmented_model_has_the_blocks_of_the_source():
    F, G, H, _ = some_model()
    eps, mu = kalman.gauss_markov(0.5, 2.0, axes=2), kalman.wiener(0.1, axes=2)
    found = kalman.augment(F, G, H, np.diag([1.0, 2.0]), process=eps, measurement=mu)
    zero = np.zeros
    np.testing.assert_array_equal(
        found.F,
        np.block(
            [
                [F, G, zero((3, 2))],
                [zero((2, 3)), -0.5 * np.eye(2), zero((2, 2))],
                [zero((2, 5)), zero((2, 2))],
            ]
        ),
    )
    np.testing.assert_array_equal(found.H, np.hstack((H, zero((2, 2)), np.eye(2))))
    np.testing.assert_array_equal(found.G, linalg.block_diag(G, np.eye(2), np.eye(2)))
    np.testing.assert_array_equal(found.Q, np.diag([1.0, 2.0, 0.25, 0.25, 0.1**2, 0.1**2]))


def test_correlated_process_noise_reaches_the_state_as_it_does_in_simulation():
    """Variance of an integrated Gauss-Markov rate, 2 s^2 tau (t - tau (1 - exp(-t / tau)))."""
    rate = kalman.gauss_markov(0.5, 2.0)
    model = kalman.augment([[0.0]], [[1.0]], [[1.0]], [[0.0]], process=rate)
    Phi, Q = kalman.van_loan(model.F, model.Q, 3.0, G=model.G)
    P = Phi @ np.diag([0.0, 0.25]) @ Phi.T + Q
    assert P[0, 0] == pytest.approx(2 * 0.25 * 2.0 * (3.0 - 2.0 * (1 - np.exp(-1.5))), rel=1e-12)


def test_filter_that_knows_its_noise_has_memory_is_consistent_and_the_other_is_not():
    """A constant seen through Gauss-Markov noise: white noise is trusted too much."""
    noise = kalman.gauss_markov(1.0, 20.0).discrete(1.0)
    model = kalman.augment([[1.0]], [[1.0]], [[1.0]], [[0.0]], measurement=noise)
    known, naive = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x, xi, z = rng.standard_normal(), rng.standard_normal(), []
        for _ in range(60):
            z.append([x + xi + 0.1 * rng.standard_normal()])
            xi = noise.F[0, 0] * xi + np.sqrt(noise.Q[0, 0]) * rng.standard_normal()
        one = kalman.run(z, model.F, model.H, model.Q, [[0.01]], [0, 0], np.eye(2), G=model.G)
        two = kalman.run(z, [[1]], [[1]], [[0]], [[1.01]], [0], [[1]])
        known.append(kalman.nees(x - one.x[-1, :1], one.P[-1, :1, :1]))
        naive.append(kalman.nees(x - two.x[-1], two.P[-1]))
    low, high = kalman.mean_bounds(1, 200, 0.999)
    assert low < np.mean(known) < high
    assert np.mean(naive) > 5.0


# --- constant gain ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_steady_state_is_scipys_riccati_solution(seed):
    F, _, H, _ = some_model(seed)
    Phi = linalg.expm((F + 1.5 * np.eye(3)) * DT)  # some of them unstable
    Q, R = some_covariance(3, seed + 20), some_covariance(2, seed + 30)
    found = kalman.steady_state(Phi, H, Q, R)
    P = linalg.solve_discrete_are(Phi.T, H.T, Q, R)
    np.testing.assert_allclose(found.P_before, P, rtol=1e-9, atol=1e-11)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    np.testing.assert_allclose(found.K, K, rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(found.P_after, (np.eye(3) - K @ H) @ P, rtol=1e-8, atol=1e-10)
    assert found.decay < 1.0


def test_filter_settles_at_the_steady_state_and_the_constant_gain_then_does_the_same():
    F, _, H, rng = some_model()
    Phi, Q, R = linalg.expm(F * DT), some_covariance(3, 5), some_covariance(2, 2)
    found = kalman.steady_state(Phi, H, Q, R)
    z = rng.standard_normal((200, 2))
    z[120] = np.nan
    track = kalman.run(z, Phi, H, Q, R, np.zeros(3), np.eye(3))
    np.testing.assert_allclose(track.P[100], found.P_after, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(track.S[100], found.S, rtol=1e-9)
    fixed = kalman.run_constant(z[50:120], Phi, H, found.K, Phi @ track.x[49])
    np.testing.assert_allclose(fixed, track.x[50:120], atol=1e-9)
    whole = kalman.run_constant(z, Phi, H, found.K, np.zeros(3))
    np.testing.assert_allclose(whole[120], Phi @ whole[119])


def test_what_is_neither_seen_nor_stable_has_no_steady_state():
    with pytest.raises(
        NotConverged, match=r"steady state of the filter did not converge .*seen by H"
    ):
        kalman.steady_state(np.diag([1.1, 0.5]), [[0.0, 1.0]], np.eye(2), [[1.0]])
    with pytest.raises(NotConverged, match="every state that is not stable"):
        kalman.steady_state(np.eye(2), [[1.0, 0.0]], np.eye(2), [[1.0]])
    with pytest.raises(NotConverged, match="driven by Q"):
        kalman.steady_state([[1.0]], [[1.0]], [[0.0]], [[1.0]])


# --- consistency -----------------------------------------------------------------------------


def test_bounds_are_chi_square_quantiles():
    low, high = kalman.mean_bounds(4, 25, 0.95)
    assert stats.chi2.cdf(low * 25, 100) == pytest.approx(0.025)
    assert stats.chi2.cdf(high * 25, 100) == pytest.approx(0.975)


def test_squares_do_not_depend_on_units():
    e, P = np.array([0.3, -2.0]), some_covariance(2)
    T = np.array([[1000.0, 0.0], [0.2, 0.01]])
    assert kalman.nees(T @ e, T @ P @ T.T) == pytest.approx(kalman.nees(e, P), rel=1e-9)


# --- refusals --------------------------------------------------------------------------------

EYE = np.eye(2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: kalman.predict([0, 0], EYE, np.eye(3), EYE),
            r"`Phi` must have shape \(2, 2\), got \(3, 3\)",
        ),
        (
            lambda: kalman.predict([0, 0], [[1, 2], [0, 1]], EYE, EYE),
            r"`P` must be symmetric, got 2 at \(0, 1\) and 0 at \(1, 0\)",
        ),
        (
            lambda: kalman.predict([0, 0], EYE, EYE, np.diag([1, -1])),
            "`Q` must have no negative eigenvalue, got -1; a covariance",
        ),
        (
            lambda: kalman.predict([0, 0], EYE, EYE, EYE, u=[1]),
            "`B` and `u` must be given together",
        ),
        (lambda: kalman.predict([0, np.nan], EYE, EYE, EYE), "`x` must be finite"),
        (
            lambda: kalman.predict([0, 0], EYE, EYE, [[1]], G=[[1], [1], [1]]),
            r"`G` must have shape \(2, m\), got \(3, 1\)",
        ),
        (
            lambda: kalman.update([0, 0], EYE, [1], [[1, 0, 0]], [[1]]),
            r"`H` must have shape \(1, 2\), got \(1, 3\)",
        ),
        (
            lambda: kalman.update([0, 0], EYE, [1, 1], EYE, [[1]]),
            r"`R` must have shape \(2, 2\), got \(1, 1\)",
        ),
        (
            lambda: kalman.update([0, 0], EYE, [1, 1], [[1, 0], [1, 0]], np.zeros((2, 2))),
            r"`R` must make H P H\^T \+ R invertible",
        ),
        (
            lambda: kalman.run([1, 2], [[1]], [[1]], [[1]], [[1]], [0], [[1]]),
            r"`z` must have shape \(k, m\), one measurement a row",
        ),
        (
            lambda: kalman.run([[np.inf]], [[1]], [[1]], [[1]], [[1]], [0], [[1]]),
            "`z` must be finite or NaN, got inf",
        ),
        (
            lambda: kalman.run(
                [[1]], [[1]], [[1]], [[1]], [[1]], [0], [[1]], B=[[1]], u=[[1], [2]]
            ),
            "`u` must have as many rows as `z`, got 2 and 1",
        ),
        (
            lambda: kalman.Information.from_estimate([0, 0], np.diag([1, 0])),
            "`P` must be positive definite, got a least eigenvalue of 0",
        ),
        (lambda: kalman.van_loan([[0, 1]], EYE, 1.0), "`F` must be square, got shape"),
        (lambda: kalman.van_loan(EYE, EYE, -1.0), "`dt` must be non-negative"),
        (lambda: kalman.transition(EYE, 1.0, order=-1), "`order` must be at least 0"),
        (lambda: kalman.noise_series(EYE, EYE, 1.0, 0), "`order` must be at least 1"),
        (
            lambda: kalman.augment(EYE, EYE, EYE, EYE, process=kalman.wiener(1.0)),
            r"`process` must make 2 noises, one for each .*got 1; `axes` sets it",
        ),
        (lambda: kalman.gauss_markov(1.0, 0.0), "`tau` must be positive"),
        (
            lambda: kalman.nees([1.0, 2.0], [[1.0]]),
            r"`P` must have shape \(..., n, n\) for errors",
        ),
        (
            lambda: kalman.nees([1.0, 2.0], np.zeros((2, 2))),
            "`P` must be invertible, got a singular",
        ),
        (lambda: kalman.mean_bounds(0, 10), "`dof` must be at least 1"),
    ],
)
def test_refusals_teach(call, message):
    with pytest.raises(ValueError, match=message):
        call()
