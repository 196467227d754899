"""Toeplitz systems, against the dense matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

from strapdown.kernels import toeplitz as k


def covariances(n):
    lags = np.arange(n, dtype=float)
    return {
        "decaying": 0.8**lags,
        "oscillating": 0.9**lags * np.cos(1.3 * lags) + (lags == 0),
        "blue": 2.0 * (lags == 0) - 0.99 * (lags == 1),
    }


@pytest.mark.parametrize("name", ["decaying", "oscillating", "blue"])
@pytest.mark.parametrize("n", [1, 2, 3, 8, 31])
def test_solution_determinant_and_inverse(name, n):
    r = covariances(n)[name]
    T = toeplitz(r)
    y = np.random.default_rng(n).standard_normal(n)
    a, x, sums = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    log_det, error = k.solve(r, y, a, x)
    close = dict(rtol=1e-10, atol=1e-12)  # conditions up to 1e3
    assert_allclose(T @ x, y, **close)
    assert_allclose(log_det, np.linalg.slogdet(T)[1], **close)
    inverse = np.linalg.inv(T)
    assert_allclose(a / error, inverse[:, 0], **close)
    k.inverse_diagonals(a, error, sums)
    assert_allclose(sums, [np.trace(inverse, j) for j in range(n)], **close)


@pytest.mark.parametrize("r", [[0.0, 0.0], [-1.0, 0.0], [1.0, 1.2], [1.0, 0.9, -0.9]])
def test_matrix_that_is_not_positive_definite_gives_nan(r):
    n = len(r)
    found = k.solve(np.array(r), np.ones(n), np.empty(n), np.empty(n))
    assert np.isnan(found).all()


def test_lagged_products():
    x = np.array([1.0, -2.0, 3.0, 0.5])
    sums = np.empty(4)
    k.lagged_products(x, sums)
    assert_allclose(sums, np.correlate(x, x, mode="full")[3:], rtol=1e-14)
