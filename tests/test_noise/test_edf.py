"""Degrees of freedom and joint covariances, against brute force and another program."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.noise import at_rest

from strapdown.noise.allan import allan_deviation
from strapdown.noise.covariance import TERMS, difference_covariance, moments
from strapdown.noise.edf import alpha_of_slope, confidence_interval, edf

LONG = dict(rtol=0.01)  # of Greenhall's truncations


@pytest.mark.parametrize(
    ("kind", "order", "overlapping", "modified"),
    [
        ("adev", 2, False, False),
        ("oadev", 2, True, False),
        ("mdev", 2, True, True),
        ("hdev", 3, False, False),
        ("ohdev", 3, True, False),
    ],
)
@pytest.mark.parametrize("alpha", [2, 0, -1, -2])
@pytest.mark.parametrize(("n", "m"), [(1000, 100), (100_000, 1000)])
def test_same_as_greenhall_in_allantools(kind, order, overlapping, modified, alpha, n, m):
    ci = pytest.importorskip("allantools.ci")
    expected = ci.edf_greenhall(alpha, order, m, n + 1, overlapping, modified)
    assert edf(kind, n, m, alpha) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("kind", "expected"), [("adev", 2.0 / 3.0), ("hdev", 18.0 / 35.0)])
def test_white_noise_one_sample(kind, expected):
    # Differences of white noise have correlations -1/2 (second: -2/3, 1/6).
    assert edf(kind, 100_000, 1, 0) == pytest.approx(expected * 100_000, rel=1e-3)


def test_slope_decides_the_noise_and_never_goes_back():
    slopes = np.array([-1.0, -0.6, -0.5, -0.1, -0.6, 0.4, 1.0])
    assert_allclose(alpha_of_slope(slopes), [2, 0, 0, -1, -1, -2, -2])


def test_interval_of_chi_square():
    low, high = confidence_interval(np.array([2.0]), np.array([10.0]), 0.95)
    # Tabulated quantiles of chi-square with 10 degrees of freedom: 3.247 and 20.483.
    assert_allclose([low[0], high[0]], 2.0 * np.sqrt([10 / 20.483, 10 / 3.247]), rtol=1e-4)


def brute_force(n, factors):
    """Sum the squared covariances over every pair of differences."""
    k = len(factors)
    parts = np.zeros((4, 4, k, k))
    for i, mi in enumerate(factors):
        for j, mj in enumerate(factors):
            count_i, count_j = n + 1 - 2 * mi, n + 1 - 2 * mj
            a, b = np.arange(count_i)[:, np.newaxis], np.arange(count_j)
            lag = (b - a).astype(float).ravel()
            C = [difference_covariance(term, lag, mi, mj) for term in range(4)]
            for p in range(4):
                for q in range(4):
                    parts[p, q, i, j] = 2.0 * np.mean(C[p] * C[q]) / (4.0 * mi**2 * mj**2)
    return parts


def test_covariance_sums_are_those_over_all_pairs():
    factors, n = (1, 3, 20, 90, 300), 1000
    found, expected = moments(n, factors).parts, brute_force(n, factors)
    for p in range(4):
        for q in range(4):
            diagonal = np.sqrt(np.abs(np.diag(expected[p, q])))
            error = (found[p, q] - expected[p, q]) / np.outer(diagonal, diagonal)
            assert np.abs(error).max() < 1e-3  # of the quadrature


def test_means_are_the_formulas_of_ieee_952():
    m = np.array([1, 10, 1000])
    expected = np.column_stack(
        (3.0 / m**2, 1.0 / m, np.full(3, 2.0 * np.log(2.0) / np.pi), m / 3.0)
    )
    assert_allclose(moments(10_000, tuple(m)).design, expected, rtol=1e-9)


def test_covariance_is_that_of_simulated_curves():
    n, runs, factors = 4096, 400, np.array([1, 8, 64, 512])
    N, B, K = 1.0, 0.08, 0.004
    curves = np.array(
        [
            allan_deviation(
                at_rest(np.random.default_rng([5, s]), n, 1.0, N=N, B=B, K=K), 1.0, factors
            ).dev
            ** 2
            for s in range(runs)
        ]
    )
    V = moments(n, tuple(factors)).covariance(np.array([0.0, N**2, B**2, K**2]))
    expected = np.sqrt(np.diag(V))
    assert_allclose(curves.std(axis=0), expected, rtol=0.2)  # 400 runs: 4 %, skewness adds
    correlation = V / np.outer(expected, expected)
    assert_allclose(np.corrcoef(curves.T), correlation, atol=0.15)  # 1/sqrt(400), three sigma


def test_terms_are_named_in_the_order_of_the_columns():
    assert TERMS == ("Q", "N", "B", "K")
