"""The likelihood of the fit, against dense matrices; its intervals, against their promise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from strapdown.noise.covariance import difference_covariance, moments
from strapdown.noise.fit import Data, Fit, _Problem
from strapdown.noise.identify import octaves

N, BLOCK = 4096, 64
THETA = np.array([0.2, 1.0, 0.03, 1e-4])  # squares of Q, N, B, K, times in samples


def drawn(rng, theta=THETA, ramp=0.0):
    """Data of the model itself: the two views drawn from their own distributions."""
    factors = octaves(N)
    m = moments(N, tuple(int(f) for f in factors))
    lags = np.arange(N // BLOCK - 1) * float(BLOCK)
    columns = [difference_covariance(a, lags, BLOCK, BLOCK) / BLOCK**2 for a in range(4)]
    V = toeplitz(sum(t * c for t, c in zip(theta, columns, strict=True)))
    steps = np.linalg.cholesky(V) @ rng.standard_normal(lags.size) + ramp * BLOCK
    mean = m.design @ theta
    curve = mean + np.linalg.cholesky(m.covariance(theta)) @ rng.standard_normal(factors.size)
    curve = np.maximum(curve, 0.05 * mean) + 0.5 * (ramp * factors) ** 2
    return Data(curve=curve, factors=factors, moments=m, steps=steps, block=BLOCK), V


@pytest.fixture
def problem():
    data, V = drawn(np.random.default_rng(5))
    return _Problem(data, 1.0), data, V


def test_loss_is_minus_twice_the_log_likelihood(problem):
    p, data, V = problem
    p.freeze(THETA)
    other = np.array([0.05, 0.8, 6e-3, 1e-5])
    lags = np.arange(data.steps.size) * float(BLOCK)
    V_other = toeplitz(
        sum(
            t * difference_covariance(a, lags, BLOCK, BLOCK) / BLOCK**2
            for a, t in enumerate(other)
        )
    )
    long = [multivariate_normal(cov=cov).logpdf(data.steps) for cov in (V, V_other)]
    s = data.factors <= BLOCK // 2
    weight = np.linalg.inv(data.moments.covariance(THETA)[np.ix_(s, s)])
    rest = [(data.curve - data.moments.design @ theta)[s] for theta in (THETA, other)]
    expected = -2.0 * (long[1] - long[0]) + rest[1] @ weight @ rest[1] - rest[0] @ weight @ rest[0]
    assert p.loss(other) - p.loss(THETA) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("ramp", [False, True])
def test_scoring_step_points_down_the_loss(problem, ramp):
    p = problem[0]
    p.ramp = ramp
    p.freeze(THETA)
    M, h = p._step_equations(THETA)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-4 * THETA[k]
        slope = (p.loss(THETA + step) - p.loss(THETA - step)) / (2.0 * step[k])
        assert (h - M @ THETA)[k] == pytest.approx(-0.5 * slope, rel=1e-4)


def test_information_is_the_mean_curvature():
    curvatures = []
    for seed in range(60):
        p = _Problem(drawn(np.random.default_rng([1, seed]))[0], 1.0)
        p.freeze(THETA)
        step = 0.02 * THETA
        around = [p.loss(THETA + f * step * np.eye(4)[3]) for f in (-1, 0, 1)]
        curvatures.append((around[0] - 2.0 * around[1] + around[2]) / step[3] ** 2 / 2.0)
    expected = p.information(THETA)[3, 3]
    assert np.mean(curvatures) == pytest.approx(expected, rel=0.2)  # 60 runs


def test_estimates_are_unbiased_and_as_sure_as_stated():
    results = [Fit(drawn(np.random.default_rng([2, s]))[0]).result() for s in range(120)]
    squares = np.array([r.squares for r in results])
    std = np.array([r.std for r in results])
    for k in (1, 2, 3):
        seen = squares[:, k] > 0.0
        assert seen.mean() > 0.8
        error = squares[:, k] - THETA[k]
        # Terms that cannot be negative push at each other; 120 runs know a mean to 0.09 sigma.
        assert abs(error.mean()) < 0.4 * error.std()
        # The curvature at a small estimate is too steep; the middle one is fair.
        assert error.std() == pytest.approx(np.nanmedian(std[seen, k]), rel=0.35)


def test_intervals_hold_the_truth_as_often_as_they_say():
    results = [Fit(drawn(np.random.default_rng([3, s]))[0]).result() for s in range(150)]
    for k in (1, 2, 3):
        held = np.mean([r.low[k] <= THETA[k] <= r.high[k] for r in results])
        assert held > 0.89  # nominally 0.95; 150 runs know it to 0.018, three of these less


def test_limits_of_absent_terms_are_kept_and_the_terms_are_not_claimed():
    theta = np.array([0.0, 1.0, 0.0, 0.0])
    results = [Fit(drawn(np.random.default_rng([4, s]), theta)[0]).result() for s in range(100)]
    claimed = np.array([r.shown for r in results])
    assert claimed[:, 1].all()
    assert claimed[:, [0, 2, 3]].sum(axis=0).max() <= 3
    # At 1 % of the power of each sample, a walk could not hide: the limits are below it.
    walk = np.array([r.high[3] for r in results])
    assert np.median(walk) < 0.01


def test_limits_hold_what_is_too_weak_to_be_shown():
    theta = np.array([0.0, 1.0, 0.0, 1e-6])
    results = [Fit(drawn(np.random.default_rng([9, s]), theta)[0]).result() for s in range(150)]
    unseen = [r for r in results if not r.shown[3]]
    assert len(unseen) > 100
    held = np.mean([r.high[3] >= theta[3] for r in unseen])
    assert held > 0.9  # nominally 0.95 of all records; those that miss low are among these


def test_ramp_is_found_and_taken_out_of_the_curve():
    for seed in range(10):
        data, _ = drawn(np.random.default_rng([6, seed]), ramp=2e-3)
        result = Fit(data).result()
        assert result.has_ramp
        assert result.ramp == pytest.approx(2e-3, abs=4.0 * result.ramp_std)
        assert result.model_error == 0.0
        assert result.squares[3] < 10.0 * THETA[3]


def test_noise_alone_is_no_ramp():
    found = [Fit(drawn(np.random.default_rng([7, s]))[0]).result() for s in range(100)]
    assert sum(r.has_ramp for r in found) <= 1
    z = np.array([r.ramp / r.ramp_std for r in found])
    assert 0.4 < z.std() < 1.1  # the strongest walk that could hide makes it unsure, not more


def test_curve_that_no_sum_describes_gets_a_model_error():
    data, _ = drawn(np.random.default_rng(8))
    wrong = data.curve * (1.0 + 0.3 * np.sin(1.5 * np.arange(data.curve.size)))
    result = Fit(
        Data(
            curve=wrong,
            factors=data.factors,
            moments=data.moments,
            steps=data.steps,
            block=data.block,
        )
    ).result()
    assert 0.05 < result.model_error < 0.6
    assert result.chi_square > 3.0 * result.dof
    plain = Fit(data).result()
    assert plain.model_error == 0.0
    assert result.std[1] > 3.0 * plain.std[1]
    assert_allclose(plain.squares[1], THETA[1], rtol=0.1)
