"""Intervals, gaps and skipped samples of a report."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.report import health, streams
from strapdown.solution import Status


def test_the_histogram_counts_every_interval():
    t = np.cumsum(np.random.default_rng(1).normal(0.01, 0.001, 5000))
    t[3000:] += 2.0  # a gap: counted in the last bar
    bars = streams.interval_panel("imu", t).items[0]
    assert bars.y.sum() == len(t) - 1
    assert bars.x[np.argmax(bars.y)] == pytest.approx(10.0, abs=0.7)  # ms, bars of 0.4


def test_an_even_clock_is_one_bar_at_its_interval():
    bars = streams.interval_panel("imu", np.arange(1000) / 286.0).items[0]
    assert bars.y.tolist() == [999.0]
    assert bars.x == pytest.approx([1e3 / 286.0], rel=1e-12)


def test_gaps_are_listed_with_what_is_missing_longest_first():
    t = np.delete(np.arange(1000) * 0.01, np.r_[100:103, 500:700])
    rows = streams.gap_rows("mag", t)
    assert [(row[0], row[3]) for row in rows] == [("mag", 200), ("mag", 3)]
    assert [row[1] for row in rows] == pytest.approx([4.99, 0.99], abs=1e-9)
    assert [row[2] for row in rows] == pytest.approx([2.01, 0.04], abs=1e-9)
    assert streams.gap_rows("mag", t[:2]) == []


def test_skipped_samples_are_counted_by_reason(run):
    sol, _ = run(1000)
    (block,) = health.skipped_blocks(sol)
    assert "GYR_INVALID" in block.html
    assert '<td class="number">3</td>' in block.html
    (none,) = health.skipped_blocks(replace(sol, status=np.zeros(1000, np.int64)))
    assert "No sample was skipped" in none.html


def test_every_flag_has_its_meaning():
    assert set(health.FLAGS) == set(Status)


def test_innovations_can_be_seen_beside_a_sigma_that_dwarfs_them(run):
    sol, _ = run(1000)
    d = sol.diagnostics["acc"]
    used = np.abs(d.innovation[d.outcome == 1, 0]).max()
    for sigma, gate, limit in (
        (1.0, None, max(3.0, used)),
        (1.0, 5.5, 5.5),
        (1e4, None, used),
        (np.nan, None, used),
    ):
        low, high = health._innovation_limits(replace(d, sigma=sigma * d.sigma), 0, gate)
        assert (low, high) == pytest.approx((-1.1 * limit, 1.1 * limit), rel=1e-12)
