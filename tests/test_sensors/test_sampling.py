"""Rates, low-pass, delay, means, jitter and losses, against closed forms."""

import numpy as np
import pytest
from scipy.signal import butter, freqs

from strapdown.sensors import Digital, Sampling

T = np.arange(0.0, 4.0, 1e-3)


def sampled(sampling, signal, t=T, seed=1):
    ticks = sampling.ticks(t, np.random.default_rng(seed))
    return ticks, sampling.sample(t, np.column_stack((signal, -2.0 * signal)), ticks)[:, 0]


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("hz", [5.0, 20.0])
def test_low_pass_passes_a_sine_as_a_butterworth_filter_does(order, hz):
    w = 2 * np.pi * hz
    _, y = sampled(Sampling(bandwidth=20.0, order=order), np.sin(w * T))
    _, response = freqs(*butter(order, 2 * np.pi * 20.0, analog=True), worN=[w])
    late = T > 1.0  # the start has died away: exp(-2 pi 20 * 0.38) of order 4
    expected = np.abs(response[0]) * np.sin(w * T + np.angle(response[0]))
    # the signal is straight between samples: (w dt)^2 / 8
    assert y[late] == pytest.approx(expected[late], abs=(w * 1e-3) ** 2 / 6)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_ramp_comes_late_by_the_delay_of_the_low_pass(order):
    sampling = Sampling(bandwidth=10.0, order=order)
    _, y = sampled(sampling, T)
    assert (T - y)[-1] == pytest.approx(sampling.filter_delay, abs=1e-9)
    w = 2 * np.pi * 10.0
    _, response = freqs(*butter(order, w, analog=True), worN=[1e-3])
    assert sampling.filter_delay == pytest.approx(-np.angle(response[0]) / 1e-3, rel=1e-6)


@pytest.mark.parametrize(("bandwidth", "delay"), [(0.0, 0.0019), (98.0, 0.0028), (5.0, 0.0186)])
def test_ramp_comes_late_by_the_delay_of_the_datasheet(bandwidth, delay):
    # 5 Hz with 18.6 ms is less than a filter of second order has: 45 ms
    sampling = Sampling(bandwidth=bandwidth, delay=delay, rate=100.0)
    ticks, y = sampled(sampling, T)
    inner = (ticks.t > 1.0) & (ticks.t < 3.9)
    assert (ticks.t - y)[inner] == pytest.approx(np.full(inner.sum(), delay), abs=1e-6)


def test_mean_of_a_sine_over_the_interval_that_ends_at_the_sample():
    w = 2 * np.pi * 7.0
    ticks, y = sampled(Sampling(rate=50.0, average=True), np.sin(w * T))
    t, h = ticks.t[1:], 0.02
    expected = (np.cos(w * (t - h)) - np.cos(w * t)) / (w * h)
    # cubic splines: 5/384 w^4 dt^4, more at the ends
    assert y[1:] == pytest.approx(expected, abs=1e-6)
    assert y[0] == 0.0


def test_sampling_between_the_truths_samples_follows_a_spline():
    w = 2 * np.pi * 7.0
    ticks, y = sampled(Sampling(rate=119.0), np.sin(w * T))
    assert len(y) == 476
    assert np.diff(ticks.t) == pytest.approx(np.full(475, 1 / 119.0), abs=1e-12)
    assert y == pytest.approx(np.sin(w * ticks.t), abs=1e-7)


def test_sampling_on_the_truths_samples_is_exact():
    _, y = sampled(Sampling(rate=250.0), np.sin(T))
    assert np.array_equal(y, np.sin(T)[::4])
    _, y = sampled(Sampling(), np.sin(T))
    assert np.array_equal(y, np.sin(T))


def test_jitter_moves_stamps_but_never_turns_them_round():
    ticks, _ = sampled(Sampling(rate=100.0, jitter=0.001), T)
    assert (ticks.stamp - ticks.t).std() == pytest.approx(0.001, rel=0.15)  # 400 stamps
    wild, _ = sampled(Sampling(rate=100.0, jitter=0.1), T)
    assert np.diff(wild.stamp).min() > 0.0


@pytest.mark.parametrize(("share", "length"), [(0.05, 1.0), (0.2, 8.0)])
def test_losses_have_their_share_and_length(share, length):
    t = np.arange(0.0, 1000.0, 0.01)
    ticks, _ = sampled(Sampling(dropout=share, dropout_length=length), t, t)
    lost = ~ticks.kept
    runs = np.count_nonzero(lost[1:] & ~lost[:-1])
    # some thousand runs: 5 %
    assert lost.mean() == pytest.approx(share, rel=0.15)
    assert lost.sum() / runs == pytest.approx(length, rel=0.1)


def test_bad_sampling_is_refused():
    with pytest.raises(ValueError, match=r"`dropout` must lie in \[0, 0.99\]"):
        Sampling(dropout=1.0)
    with pytest.raises(ValueError, match="`rate` must be non-negative"):
        Sampling(rate=-1.0)
    with pytest.raises(ValueError, match="at least twice the bandwidth of 600 Hz, got 1000 Hz"):
        sampled(Sampling(bandwidth=600.0), T)
    with pytest.raises(ValueError, match="must be evenly spaced for a low-pass"):
        sampled(Sampling(bandwidth=10.0), T[:3], np.array([0.0, 0.01, 0.03]))


# --- converter --------------------------------------------------------------------------


def test_counts_and_values_there_and_back():
    converter = Digital(lsb=0.25, full_scale=10.0, bits=8, zero=1.0)
    x = np.array([-9.5, 0.0, 1.0, 1.13, 3.0, 50.0])
    counts = converter.counts(x)
    assert counts.tolist() == [-40, -4, 0, 1, 8, 40]
    assert converter.from_counts(counts) == pytest.approx(converter.apply(x), abs=0)
    assert np.abs(converter.apply(x[:-1])[1:] - x[1:-1]).max() <= 0.125


def test_word_limits_the_range_where_it_is_the_narrower():
    converter = Digital(lsb=1.0, bits=8)
    assert converter.counts([-1e9, 1e9]).tolist() == [-128, 127]
    assert converter.saturated([-128.0, -127.0, 126.0, 127.0]).tolist() == [
        True,
        False,
        False,
        True,
    ]


def test_rounding_has_the_variance_of_a_uniform_error():
    x = np.random.default_rng(1).uniform(-100.0, 100.0, 20_000)
    assert (Digital(lsb=0.5).apply(x) - x).std() == pytest.approx(0.5 / np.sqrt(12), rel=0.02)


def test_bad_converters_are_refused():
    with pytest.raises(ValueError, match="`full_scale` must be greater than `lsb`"):
        Digital(lsb=1.0, full_scale=0.5)
    with pytest.raises(ValueError, match="`lsb` must be positive for raw counts"):
        Digital().counts([1.0])
    with pytest.raises(ValueError, match="`x` must be finite to have counts"):
        Digital(lsb=1.0).counts([np.nan])
    assert np.isnan(Digital(lsb=1.0).apply([np.nan])).all()
