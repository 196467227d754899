"""Random errors: their Allan deviation, variance and correlation, by formulas written here."""

import numpy as np
import pytest
from scipy.stats import chi2

from strapdown.sensors import Noise

DT = 0.01


def sample(n=400_000, seed=7, **what):
    return Noise(**what).sample(n, DT, np.random.default_rng(seed), 3)


def allan_variance(x, m):
    """Non-overlapping: half the mean squared difference of neighbouring means."""
    means = x[: len(x) // m * m].reshape(-1, m).mean(axis=1)
    return 0.5 * np.mean(np.diff(means) ** 2), len(means)


def band(clusters, share=2.0):
    """Bounds of the variance's ratio to its truth, 1e-6 in either tail.

    Neighbouring differences share a mean, so there are fewer degrees of freedom than
    clusters: at least half as many for any of these noises.
    """
    dof = clusters / share
    return chi2.ppf([1e-6, 1 - 1e-6], dof) / dof


@pytest.mark.parametrize("m", [10, 1000])
def test_white_noise_has_its_allan_deviation_at_both_taus(m):
    x = sample(white=(0.01, 0.02, 0.03))
    for axis, density in enumerate((0.01, 0.02, 0.03)):
        variance, clusters = allan_variance(x[:, axis], m)
        low, high = band(clusters)
        assert low < variance / (density**2 / (m * DT)) < high


@pytest.mark.parametrize("m", [100, 2000])
def test_random_walk_has_its_allan_deviation_at_both_taus(m):
    x = sample(random_walk=0.002)
    tau = m * DT
    # means over samples at m points: K^2 tau / 3 but for a share of 1 / (2 m^2)
    for axis in range(3):
        variance, clusters = allan_variance(x[:, axis], m)
        low, high = band(clusters)
        assert low < variance / (0.002**2 * tau / 3) < high


@pytest.mark.parametrize("m", [50, 1000])
def test_flicker_has_a_flat_floor_of_0_664_times_the_instability(m):
    x = sample(flicker=0.005)
    floor = 2 * np.log(2) / np.pi * 0.005**2
    for axis in range(3):
        variance, clusters = allan_variance(x[:, axis], m)
        low, high = band(clusters)
        assert low < variance / floor < high


def test_gauss_markov_bias_is_stationary_and_forgets_exponentially():
    runs = np.hstack(
        [sample(200, seed=s, gauss_markov=0.3, gauss_markov_time=0.5) for s in range(400)]
    )
    # 1200 runs: the variance is good to 4.1 %, four sigma 16 %
    for k in (0, 100, 199):
        assert runs[k].std() == pytest.approx(0.3, rel=0.08)
    late = np.mean(runs[100] * runs[150]) / 0.3**2  # half a second apart: one time constant
    assert late == pytest.approx(np.exp(-1.0), abs=0.13)


def test_turn_on_bias_is_constant_and_new_at_every_start():
    a, b = sample(5, seed=1, turn_on=0.2), sample(5, seed=2, turn_on=0.2)
    assert np.ptp(a, axis=0) == pytest.approx(np.zeros(3), abs=0)
    assert not np.allclose(a[0], b[0])
    starts = np.array([sample(1, seed=s, turn_on=0.2)[0] for s in range(500)])
    assert starts.std() == pytest.approx(0.2, rel=0.08)  # 1500 draws, four sigma


def test_switching_one_process_off_leaves_the_others_alone():
    both = sample(1000, white=0.1, random_walk=0.2, flicker=0.3)
    assert both == pytest.approx(
        sample(1000, white=0.1) + sample(1000, random_walk=0.2) + sample(1000, flicker=0.3),
        abs=1e-12,
    )


def test_silence_and_axes_apart():
    assert np.array_equal(sample(10), np.zeros((10, 3)))
    x = sample(10_000, white=0.1, flicker=0.1, gauss_markov=0.1)
    assert np.abs(np.corrcoef(x.T) - np.eye(3)).max() < 0.3
    assert Noise(white=0.1).sample(0, DT, np.random.default_rng(1)).shape == (0, 3)


def test_bad_noise_is_refused():
    with pytest.raises(ValueError, match="`white` must be non-negative"):
        Noise(white=(0.1, -0.1, 0.1))
    with pytest.raises(ValueError, match="`gauss_markov_time` must be positive"):
        Noise(gauss_markov_time=0.0)
    with pytest.raises(ValueError, match="`flicker` must hold 1 or 3 values, got 2"):
        sample(10, flicker=(0.1, 0.2))
