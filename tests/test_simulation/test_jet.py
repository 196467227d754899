"""Taylor series arithmetic against high-precision arithmetic."""

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.interpolate import PPoly

from strapdown.simulation.jet import atan2, compose, jet_of, sin_cos, sqrt, time

T = np.array([-1.3, 0.2, 0.9, 2.4])


def coefficients(function, order=3):
    with mp.workdps(40):
        return np.array(
            [[float(c) for c in mp.taylor(function, mp.mpf(float(t)), order)] for t in T]
        ).T


def check(jet, function):
    # a few roundings of numbers of the size of the largest coefficient
    truth = coefficients(function, jet.order)
    np.testing.assert_allclose(jet.c, truth, rtol=0.0, atol=2e-14 * np.abs(truth).max())


CLOCK = time(T, 3)
S, C = sin_cos(CLOCK * 1.7 + 0.3)


def test_sine_and_cosine():
    check(S, lambda t: mp.sin(mp.mpf(1.7) * t + mp.mpf(0.3)))
    check(C, lambda t: mp.cos(mp.mpf(1.7) * t + mp.mpf(0.3)))


def test_sums_products_and_quotients():
    check(
        (2.0 - S) * CLOCK / (C + 3.0) + 0.5 * CLOCK,
        lambda t: (2 - mp.sin(mp.mpf(1.7) * t + mp.mpf(0.3))) * t
        / (mp.cos(mp.mpf(1.7) * t + mp.mpf(0.3)) + 3) + t / 2,
    )  # fmt: skip
    check(1.0 / (C + 2.0), lambda t: 1 / (mp.cos(mp.mpf(1.7) * t + mp.mpf(0.3)) + 2))


def test_root():
    check(sqrt(CLOCK * CLOCK + 2.0), lambda t: mp.sqrt(t * t + 2))


def test_angle_and_its_derivatives():
    check(atan2(CLOCK, CLOCK * 0.0 + 2.0), lambda t: mp.atan2(t, 2))
    turning = atan2(S, C)
    assert np.diff(turning.value) == pytest.approx(1.7 * np.diff(T), abs=1e-14)  # unwrapped
    assert turning.c[1] == pytest.approx(np.full(4, 1.7), abs=1e-14)
    assert turning.c[2:] == pytest.approx(np.zeros((2, 4)), abs=1e-13)


def test_function_of_a_function():
    cubic = PPoly(np.array([[2.0], [-1.0], [0.5], [3.0]]), np.array([0.0, 1.0]))
    inner = lambda t: mp.sin(mp.mpf(1.7) * t + mp.mpf(0.3))  # noqa: E731
    check(compose(cubic, S), lambda t: 2 * inner(t) ** 3 - inner(t) ** 2 + inner(t) / 2 + 3)


def test_derivatives_of_a_spline_are_divided_by_the_factorial():
    cubic = PPoly(np.array([[2.0], [-1.0], [0.5], [3.0]]), np.array([0.0, 1.0]))
    jet = jet_of(cubic, T, 3)
    assert jet.c[3] == pytest.approx(np.full(4, 2.0), abs=1e-15)
    assert jet.derivative().derivative().derivative().value == pytest.approx(
        np.full(4, 2.0 * math.factorial(3)), abs=1e-14
    )
