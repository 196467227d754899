"""The sums of squared differences, against the same sums spelled out in NumPy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from strapdown.kernels import allan as k


@pytest.fixture
def x():
    rng = np.random.default_rng(8)
    return np.cumsum(rng.standard_normal(211)) + 0.01 * np.arange(211) ** 2


# Rounding: at most 211 terms, each of a few eps.
TIGHT = dict(rtol=1e-12)


def test_integral_starts_at_zero_and_leaves_out_the_mean():
    y = np.array([1.0, 4.0, -2.0, 7.0])
    out = np.full(5, np.nan)
    k.integrate(y, 2.5, out)
    assert_array_equal(out, [0.0, -1.5, 0.0, -4.5, 0.0])


@pytest.mark.parametrize("width", [1, 7, 64, 400])
@pytest.mark.parametrize("m", [1, 2, 9, 100])
def test_second_differences(x, m, width):
    d = x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]
    found = k.second_difference_power(x[: -2 * m], x[m:-m], x[2 * m :], np.empty(width))
    assert_allclose(found, np.sum(d**2), **TIGHT)


@pytest.mark.parametrize("width", [1, 7, 64, 400])
@pytest.mark.parametrize("m", [1, 4, 70])
def test_third_differences(x, m, width):
    n = x.size
    parts = x[: n - 3 * m], x[m : n - 2 * m], x[2 * m : n - m], x[3 * m :]
    d = parts[3] - 3.0 * parts[2] + 3.0 * parts[1] - parts[0]
    assert_allclose(k.third_difference_power(*parts, np.empty(width)), np.sum(d**2), rtol=1e-11)


@pytest.mark.parametrize("m", [1, 2, 9, 70])
def test_averaged_second_differences(x, m):
    d = x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]
    sums = np.convolve(d, np.ones(m), mode="valid")
    # The running sum of the kernel rounds once more per sample.
    assert_allclose(k.averaged_second_difference_power(x, m), np.sum(sums**2), rtol=1e-11)


@pytest.mark.parametrize("m", [1, 2, 50, 105, 209])
def test_reflected_second_differences(x, m):
    before = 2.0 * x[0] - x[1:][::-1]
    after = 2.0 * x[-1] - x[:-1][::-1]
    longer = np.concatenate((before, x, after))
    inner = np.arange(1, x.size - 1) + x.size - 1
    d = longer[inner - m] - 2.0 * longer[inner] + longer[inner + m]
    assert_allclose(k.reflected_second_difference_power(x, m), np.sum(d**2), **TIGHT)
