"""Thinning for display keeps the extremes, the gaps, and nothing but samples."""

import numpy as np
import pytest

from strapdown.report import decimate


def test_one_outlier_in_a_million_samples_stays_visible():
    n = 1_000_000
    y = np.random.default_rng(1).normal(size=n)
    y[[123_456, 777_777]] = 99.0, -88.0
    drawn = decimate.line(np.arange(n) / 286.0, y)
    assert drawn.y.max() == 99.0
    assert drawn.y.min() == -88.0
    assert drawn.x[np.argmax(drawn.y)] == 123_456 / 286.0
    assert len(drawn.x) <= 2 * decimate.BUCKETS + 4


def test_every_bucket_keeps_its_own_extremes():
    rng = np.random.default_rng(2)
    y = np.cumsum(rng.normal(size=30_000))
    rows = decimate.envelope_rows(y, buckets=100)
    for block, kept in zip(
        y.reshape(100, 300), np.split(rows, np.searchsorted(rows, np.arange(300, 30_000, 300))),
        strict=True,
    ):  # fmt: skip
        assert y[kept].max() == block.max()
        assert y[kept].min() == block.min()


@pytest.mark.parametrize("n", [0, 1, 2, 299, 300, 301, 1999, 20_001])
def test_every_point_is_a_sample_in_order(n):
    y = np.sin(np.arange(n) ** 1.3)
    rows = decimate.envelope_rows(y, buckets=150)
    assert np.all(np.diff(rows) > 0)
    assert len(rows) <= 2 * 150 + 4
    if n:
        assert (rows[0], rows[-1]) == (0, n - 1)
    if n <= 300:
        assert len(rows) == n


def test_a_gap_lifts_the_pen():
    t = np.concatenate((np.arange(0, 10, 0.01), np.arange(15, 20, 0.01)))
    drawn = decimate.line(t, np.ones(len(t)), buckets=50)
    lifted = np.flatnonzero(np.isnan(drawn.y))
    assert len(lifted) == 1
    assert drawn.x[lifted[0] - 1] < 15 <= drawn.x[lifted[0] + 1]


def test_few_missing_samples_are_bridged_and_many_are_a_gap():
    t = np.arange(1000) * 0.01
    y = np.cos(t)
    y[100:103] = np.nan  # as a sensor that is read less often
    y[500:600] = np.nan
    drawn = decimate.line(t, y)
    lifted = np.flatnonzero(np.isnan(drawn.y))
    assert len(lifted) == 1
    assert drawn.x[lifted[0] + 1] == t[600]


def test_an_angle_that_wraps_does_not_cross_the_figure():
    t = np.arange(20_000) * 0.01
    angle = np.mod(40.0 * t + 180.0, 360.0) - 180.0  # a turn every 9 s
    drawn = decimate.line(t, angle, buckets=500, period=360.0)
    step = np.abs(np.diff(drawn.y))
    assert np.nanmax(step) < 180.0
    wraps = np.count_nonzero(np.abs(np.diff(angle)) > 180.0)
    assert np.count_nonzero(np.isnan(drawn.y)) == wraps
    assert np.nanmax(np.abs(decimate.line(t, angle, buckets=500).y)) <= 180.0


def test_nothing_and_nan_alone_draw_nothing():
    empty = np.zeros(0)
    assert len(decimate.line(empty, empty).x) == 0
    assert len(decimate.line(np.arange(5.0), np.full(5, np.nan)).x) == 0


def test_a_path_keeps_the_corners_of_its_box():
    a = np.linspace(0, 2 * np.pi, 100_000)
    x, y = 3 * np.cos(a), 2 * np.sin(3 * a)
    drawn = decimate.path(a, x, y, buckets=200)
    assert len(drawn.x) <= 2 * (200 + 4)
    for kept, all_of in ((drawn.x, x), (drawn.y, y)):
        assert (kept.min(), kept.max()) == (all_of.min(), all_of.max())


def test_runs_are_first_and_last_rows():
    first, last = decimate.runs(np.array([True, True, False, True, False, False, True]))
    assert first.tolist() == [0, 3, 6]
    assert last.tolist() == [1, 3, 6]
    assert [len(part) for part in decimate.runs(np.zeros(4, bool))] == [0, 0]


def test_a_single_flagged_sample_is_wide_enough_to_see():
    t = np.arange(100_000) * 0.01
    mask = np.zeros(len(t), bool)
    mask[50_000] = True
    starts, stops = decimate.merged_spans(t, mask, buckets=1000)
    assert starts.tolist() == [500.0]
    assert stops[0] - starts[0] == pytest.approx(t[-1] / 1000, rel=1e-12)


def test_flicker_is_drawn_as_one_stretch():
    t = np.arange(100_000) * 0.01
    mask = np.zeros(len(t), bool)
    mask[10_000:20_000:2] = True
    mask[70_000:70_100] = True
    starts, stops = decimate.merged_spans(t, mask)
    assert starts.tolist() == [100.0, 700.0]
    assert stops == pytest.approx([t[19_998] + t[-1] / 1500, t[70_099]], abs=0.7)
