"""The Allan family: published values, another program, closed forms, intervals, messages."""

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.noise import at_rest

from strapdown.errors import InputError
from strapdown.noise import KINDS, allan_deviation, default_taus
from strapdown.noise.allan import integrated, local_slope, longest_factor

# Frequency values of NBS Monograph 140, annex 8.E, and the deviations that W. J. Riley prints for
# them, "The calculation of time domain frequency stability", table I, and NIST SP 1065, 12.4.
NBS14 = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]
NBS14_DEVIATIONS = {
    "adev": [91.22945, 115.8082],
    "oadev": [91.22945, 85.95287],
    "mdev": [91.22945, 74.78849],
    "totdev": [91.22945, 93.90379],
    "hdev": [70.80607, 116.7980],
    "ohdev": [70.80607, 85.61487],
}
# The same for his 1000 points of a linear congruential generator, at 1, 10 and 100 samples.
NBS1000_DEVIATIONS = {
    "adev": [2.922319e-01, 9.965736e-02, 3.897804e-02],
    "oadev": [2.922319e-01, 9.159953e-02, 3.241343e-02],
    "mdev": [2.922319e-01, 6.172376e-02, 2.170921e-02],
    "totdev": [2.922319e-01, 9.134743e-02, 3.406530e-02],
    "hdev": [2.943883e-01, 1.052754e-01, 3.910861e-02],
    "ohdev": [2.943883e-01, 9.581083e-02, 3.237638e-02],
}


def nbs1000():
    n = [1234567890]
    for _ in range(999):
        n.append(16807 * n[-1] % 2147483647)
    return np.array(n) / 2147483647


@pytest.mark.parametrize("kind", KINDS)
def test_nbs14_values(kind):
    found = allan_deviation(NBS14, 1.0, [1.0, 2.0], kind=kind).dev
    assert_allclose(found, NBS14_DEVIATIONS[kind], rtol=5e-7)  # seven digits are printed


@pytest.mark.parametrize("kind", KINDS)
def test_riley_1000_point_values(kind):
    found = allan_deviation(nbs1000(), 1.0, [1.0, 10.0, 100.0], kind=kind).dev
    assert_allclose(found, NBS1000_DEVIATIONS[kind], rtol=3e-7)  # seven digits are printed


@pytest.mark.parametrize("kind", KINDS)
def test_same_as_allantools(kind):
    at = pytest.importorskip("allantools")
    rng = np.random.default_rng(3)
    y = at_rest(rng, 20_000, 100.0, N=0.1, B=0.02, K=0.003, bias=5.0)
    curve = allan_deviation(y, 100.0, kind=kind)
    tau, dev, _, count = getattr(at, kind)(y, rate=100.0, data_type="freq", taus=curve.tau)
    assert_allclose(curve.tau, tau, rtol=1e-14)
    assert_allclose(curve.dev, dev, rtol=1e-9)
    assert np.array_equal(curve.count, count)


@pytest.mark.parametrize("kind", KINDS)
def test_angle_and_rate_give_the_same(kind):
    y = np.random.default_rng(4).standard_normal(3000)
    angle = np.concatenate(([7.0], 7.0 + np.cumsum(y) / 50.0))
    taus = [0.02, 0.2, 1.0]
    rate = allan_deviation(y, 50.0, taus, kind=kind)
    from_angle = allan_deviation(angle, 50.0, taus, kind=kind, quantity="angle")
    assert_allclose(from_angle.dev, rate.dev, rtol=1e-10)
    assert np.array_equal(from_angle.count, rate.count)


@pytest.mark.parametrize("kind", ["adev", "oadev", "mdev"])
def test_ramp_has_exactly_tau_over_root_two(kind):
    y = 3.0 - 0.25 * np.arange(4000) / 20.0
    curve = allan_deviation(y, 20.0, [0.5, 5.0, 50.0], kind=kind)
    assert_allclose(curve.dev, 0.25 * curve.tau / np.sqrt(2.0), rtol=1e-9)


@pytest.mark.parametrize("kind", ["hdev", "ohdev"])
def test_hadamard_does_not_see_a_ramp(kind):
    y = np.random.default_rng(1).standard_normal(4000)
    flat = allan_deviation(y, 20.0, [0.5, 5.0, 50.0], kind=kind).dev
    tilted = allan_deviation(y + 0.3 * np.arange(4000), 20.0, [0.5, 5.0, 50.0], kind=kind).dev
    assert_allclose(tilted, flat, rtol=1e-6)  # the ramp's sum takes seven digits


@pytest.mark.parametrize(
    ("noise", "level"),
    [
        (dict(N=0.02), lambda tau: 0.02 / np.sqrt(tau)),
        (dict(B=0.02), lambda tau: np.sqrt(2.0 * np.log(2.0) / np.pi) * 0.02 + 0.0 * tau),
        (dict(K=0.02), lambda tau: 0.02 * np.sqrt(tau / 3.0)),
        (dict(Q=0.02), lambda tau: np.sqrt(3.0) * 0.02 / tau),
    ],
    ids=["white", "flicker", "walk", "quantised"],
)
def test_level_of_each_noise_is_that_of_ieee_952(noise, level):
    curve = allan_deviation(at_rest(np.random.default_rng(12), 400_000, 10.0, **noise), 10.0)
    long = curve.tau >= 2.0  # of the flicker, sampled noise lacks what is above fs / 2
    sigmas = (curve.dev[long] / level(curve.tau[long]) - 1.0) * np.sqrt(2.0 * curve.edf[long])
    assert np.abs(sigmas[curve.edf[long] > 20]).max() < 3.5  # of 30 correlated points


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [dict(N=1.0), dict(B=1.0), dict(K=1.0)], ids="NBK")
def test_interval_holds_the_truth_as_often_as_it_says(kind, noise):
    n, runs = 512, 400
    taus = [1.0, 8.0, 32.0, 100.0]
    curves = [
        allan_deviation(
            at_rest(np.random.default_rng([31, s]), n, 1.0, **noise), 1.0, taus, kind=kind
        )
        for s in range(runs)
    ]
    variance = np.array([c.dev for c in curves]) ** 2
    truth = np.sqrt(variance.mean(axis=0))
    inside = [(c.low < truth) & (truth < c.high) for c in curves]
    cover = np.mean(inside, axis=0)
    # 400 runs know a coverage of 95 % to 1.1 %; chi-square is an approximation, and the noise
    # that sets the degrees of freedom is guessed from the curve.
    assert np.all(cover > 0.88), cover


def test_edf_of_white_noise_side_by_side_is_two_thirds_of_the_differences():
    # var of a mean square of first differences of white noise: lag-one correlation -1/2.
    curve = allan_deviation(
        np.random.default_rng(2).standard_normal(30_000), 1.0, [1.0], kind="adev"
    )
    assert curve.edf[0] == pytest.approx(2.0 / 3.0 * 30_000, rel=1e-3)


def test_times_are_rounded_to_samples_and_merged():
    curve = allan_deviation(np.arange(1000.0) % 7, 100.0, [0.0101, 0.0104, 0.02, 1.0])
    assert_allclose(curve.tau, [0.01, 0.02, 1.0])


def test_default_times_reach_from_one_sample_to_a_third():
    taus = default_taus(30_000, 100.0)
    assert taus[0] == 0.01
    assert taus[-1] == 100.0
    assert np.all(np.diff(taus) > 0.0)
    assert allan_deviation(np.random.default_rng(0).standard_normal(10), 1.0).tau.size == 3


@pytest.mark.parametrize("kind", KINDS)
def test_longest_time_leaves_two_differences(kind):
    y = np.random.default_rng(0).standard_normal(60)
    m = longest_factor(60, kind)
    curve = allan_deviation(y, 1.0, [float(m)], kind=kind)
    assert curve.count[0] >= (1 if kind == "mdev" else 2) or kind in ("oadev", "ohdev")
    with pytest.raises(InputError, match=r"`taus` must be at most .* s for the .* record longer"):
        allan_deviation(y, 1.0, [m + 1.0], kind=kind)


def test_slope_of_a_power_is_its_exponent():
    tau = np.geomspace(0.1, 100.0, 31)
    assert_allclose(local_slope(tau, tau**-0.35), -0.35, atol=1e-12)
    assert_allclose(local_slope(tau[:1], tau[:1]), [-0.5])


def test_input_is_not_changed():
    y = np.random.default_rng(0).standard_normal(500)
    before = y.copy()
    for kind in KINDS:
        allan_deviation(y, 1.0, kind=kind)
    assert np.array_equal(y, before)


def test_large_mean_costs_no_digits():
    y = np.random.default_rng(0).standard_normal(5000)
    with_mean = np.round(y * 2**20) / 2**20  # exact with and without the mean
    assert_allclose(
        allan_deviation(with_mean + 2.0**16, 1.0).dev,
        allan_deviation(with_mean, 1.0).dev,
        rtol=1e-9,
    )


def test_memory_is_one_more_array():
    y = np.random.default_rng(0).standard_normal(1_440_000)
    taus = np.geomspace(1.0, 4e5, 100)
    allan_deviation(y[:1000], 1.0)  # compiles
    tracemalloc.start()
    allan_deviation(y, 1.0, taus)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak + y.nbytes <= 3.0 * y.nbytes
    assert integrated(y).nbytes == y.nbytes + 8


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: allan_deviation([1.0, np.nan, 2.0], 1.0), ValueError, "`y` must be finite"),
        (lambda: allan_deviation(np.ones((4, 3)), 1.0), ValueError, r"`y` must have shape \(n,\)"),
        (lambda: allan_deviation(np.ones(9), 0.0), ValueError, "`fs` must be positive"),
        (lambda: allan_deviation(np.ones(9), 1.0, kind="avar"), ValueError, "`kind` must be one"),
        (lambda: allan_deviation(np.ones(9), 1.0, [0.5]), ValueError, "at least one sample, 1 s"),
        (lambda: allan_deviation(np.ones(9), 1.0, []), ValueError, "at least one averaging time"),
        (lambda: allan_deviation(np.ones(2), 1.0), InputError, "at least 4 samples"),
        (
            lambda: allan_deviation(np.ones(9), 1.0, quantity="speed"),
            ValueError,
            "`quantity` must be one of rate, angle",
        ),
        (
            lambda: allan_deviation(np.ones(9), 1.0, confidence=95.0),
            ValueError,
            r"`confidence` must lie in \[0.01, 0.9999\]",
        ),
    ],
)
def test_messages(call, error, message):
    with pytest.raises(error, match=message):
        call()
