"""Overlapping Allan deviation beside allantools: time per axis and memory, one thread each."""

import tracemalloc

import allantools
import numpy as np
import pytest

from strapdown.noise import allan_deviation, identify

N, FS = 1_440_000, 100.0  # four hours at 100 Hz


@pytest.fixture(scope="module")
def axis():
    rng = np.random.default_rng(4)
    return 0.08 * rng.standard_normal(N) + 1e-5 * np.cumsum(rng.standard_normal(N))


@pytest.fixture(scope="module")
def taus():
    factors = np.unique(np.round(np.geomspace(1, N // 3, 111)).astype(int))
    assert 95 <= factors.size <= 105
    return factors[:100] / FS


def test_overlapping_deviation_at_100_taus(axis, taus, take_turns, table):
    times = take_turns(
        7,
        here=lambda: allan_deviation(axis, FS, taus),
        allantools=lambda: allantools.oadev(axis, rate=FS, data_type="freq", taus=taus),
    )
    ratio = times["here"] / times["allantools"]
    table(
        "`allan_deviation`, overlapping, 1.44 M samples, 100 times",
        f"{1e3 * times['here']:.0f} ms",
        f"allantools `oadev` {1e3 * times['allantools']:.0f} ms: {ratio:.2f} times",
        "0.3 times",
    )
    here = allan_deviation(axis, FS, taus)
    beside = allantools.oadev(axis, rate=FS, data_type="freq", taus=taus)
    np.testing.assert_allclose(here.dev, beside[1], rtol=1e-9)
    assert ratio <= 0.3


def test_memory_is_at_most_three_times_the_data(axis, taus, table):
    allan_deviation(axis[:1000], FS)
    tracemalloc.start()
    allan_deviation(axis, FS, taus)
    peak = tracemalloc.get_traced_memory()[1] + axis.nbytes
    tracemalloc.stop()
    table(
        "the same, peak memory with the samples, over the samples",
        f"{peak / axis.nbytes:.2f}",
        "",
        "3",
    )
    assert peak <= 3.0 * axis.nbytes


def test_identification_of_four_hours(axis, take_turns, table):
    times = take_turns(3, here=lambda: identify(axis, FS))
    table("`identify`, 1.44 M samples", f"{times['here']:.2f} s", "", "")
