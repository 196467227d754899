"""Rest detection: what rests is found, what moves is not, and the causal form is causal."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from strapdown import motion
from strapdown.units import DPS

RATE_HZ = 100.0
G = 9.81


def log(pieces, seed=0, gyr_noise=0.08 * DPS, acc_noise=0.03, bias_dps=(1.0, -3.9, 0.2)):
    """Return t, gyr, acc of pieces (seconds, moving) with a sensor like the MPU-6050."""
    rng = np.random.default_rng(seed)
    moving = np.concatenate([np.full(round(s * RATE_HZ), m) for s, m in pieces])
    n = len(moving)
    t = 5.0 + np.arange(n) / RATE_HZ
    phases = np.array([0.0, 1.0, 2.0])
    swing = np.sin(2.0 * np.pi * np.outer(t, [0.7, 1.1, 0.9]) + phases)
    gyr = np.array(bias_dps) * DPS + gyr_noise * rng.standard_normal((n, 3))
    acc = np.array([0.0, 3.0, -9.3]) + acc_noise * rng.standard_normal((n, 3))
    gyr += moving[:, np.newaxis] * 0.6 * swing
    acc += moving[:, np.newaxis] * 2.0 * swing[:, ::-1]
    return t, gyr, acc, moving


def test_each_rest_between_movements_is_one_segment_within_half_a_window():
    t, gyr, acc, _ = log([(5, 0), (4, 1), (8, 0), (3, 1), (6, 0)])
    found = motion.rest_segments(t, gyr, acc)
    edges = np.array([[s.t_start - 5.0, s.t_stop - 5.0] for s in found])
    # Half a window (0.25 s) is lost at each inner edge, and what the swing still hides.
    np.testing.assert_allclose(edges, [[0, 5], [9, 17], [20, 26]], atol=0.3)


def test_no_sample_of_a_movement_passes_for_rest():
    t, gyr, acc, moving = log([(5, 0), (30, 1), (5, 0)])
    assert not (motion.rest_mask(t, gyr, acc) & (moving > 0)).any()
    assert not (motion.rest_mask_causal(t, gyr, acc) & (moving > 0)).any()


@pytest.mark.parametrize("noise_scale", [0.02, 1.0, 5.0])
def test_threshold_follows_the_noise_of_the_sensor(noise_scale):
    t, gyr, acc, moving = log(
        [(10, 0), (10, 1), (10, 0)],
        gyr_noise=0.08 * DPS * noise_scale,
        acc_noise=0.03 * noise_scale,
    )
    mask = motion.rest_mask(t, gyr, acc)
    assert mask[moving == 0].mean() > 0.95
    assert not mask[moving > 0].any()


@pytest.mark.parametrize("find", [motion.rest_mask, motion.rest_mask_causal])
def test_a_log_that_never_rests_has_no_rest(find):
    t, gyr, acc, _ = log([(60, 1)])
    assert not find(t, gyr, acc).any()


@pytest.mark.parametrize("cut", [40, 137, 900, 1500])
def test_causal_mask_of_a_part_is_the_part_of_the_causal_mask(cut):
    t, gyr, acc, _ = log([(5, 0), (4, 1), (8, 0)])
    whole = motion.rest_mask_causal(t, gyr, acc)
    assert_array_equal(motion.rest_mask_causal(t[:cut], gyr[:cut], acc[:cut]), whole[:cut])


def test_causal_mask_sees_rest_one_window_late():
    t, gyr, acc, _ = log([(5, 0), (4, 1), (8, 0)])
    mask = motion.rest_mask_causal(t, gyr, acc)
    assert not mask[t - t[0] < 0.5].any()
    # Second rest begins at 9 s. Tolerance: the last swing may be small for some samples.
    first = t[np.flatnonzero(mask & (t > 13.5))[0]] - t[0]
    assert first == pytest.approx(9.5, abs=0.15)


def test_steady_turning_is_rest_only_without_a_limit_of_rate():
    t, gyr, acc, _ = log([(20, 0)])
    gyr = gyr + [0.0, 0.0, 200 * DPS]
    assert not motion.rest_mask(t, gyr, acc).any()
    steady = motion.RestTest(max_rate=math.inf)
    assert motion.rest_mask(t, gyr, acc, steady).mean() > 0.95


def test_tilting_within_the_limit_of_rate_is_not_rest():
    # 15 deg/s moves gravity by 0.2 m/s^2 RMS in a window of 0.5 s, against 0.03 of noise.
    t, gyr, acc, _ = log([(20, 0)])
    angle = 15.0 * DPS * (t - t[0]) * (t > t[0] + 10.0)
    acc = acc + np.column_stack((G * np.sin(angle), np.zeros_like(t), G * (1 - np.cos(angle))))
    mask = motion.rest_mask(t, gyr, acc)
    assert mask[t < 14.5].all()
    assert not mask[t > 15.4].any()


def test_coarse_resolution_that_repeats_values_is_rest():
    # 2.52 mg per count, as the ADIS16350: the next count shows in few windows only.
    t, gyr, acc, _ = log([(60, 0)], acc_noise=0.004)
    acc = np.round((acc - [0.0, 3.0, -9.3]) / 0.0247) * 0.0247 + [0.0, 3.0, -9.3]
    steps = np.any(np.diff(acc, axis=0) != 0.0, axis=1)
    assert 0.0 < steps.mean() < 0.02
    assert motion.rest_mask(t, gyr, acc).all()


def test_rests_in_different_positions_are_all_found():
    t, gyr, acc, _ = log([(10, 0), (5, 1), (10, 0)])
    acc[t - t[0] > 12.0] += [9.0, -6.0, 9.0]
    mask = motion.rest_mask(t, gyr, acc)
    assert mask[(t - t[0] < 9.7) | (t - t[0] > 15.3)].all()


def test_turning_to_and_fro_about_the_vertical_is_not_rest():
    # The accelerometer sees nothing of it.
    t, gyr, acc, _ = log([(20, 0)])
    gyr[:, 2] += 5.0 * DPS * np.sin(6.0 * t) * (t > 15.0)
    mask = motion.rest_mask(t, gyr, acc)
    assert mask[t < 14.7].all()
    assert not mask[t > 15.3].any()


def test_exact_log_without_noise_is_rest():
    t = np.arange(1000) / RATE_HZ
    gyr = np.zeros((1000, 3))
    acc = np.tile([0.1, -0.2, -9.7], (1000, 1))
    assert motion.rest_mask(t, gyr, acc).all()
    assert motion.rest_mask_causal(t, gyr, acc)[51:].all()


def test_nan_rows_and_gaps_end_a_rest():
    t, gyr, acc, _ = log([(10, 0)])
    gyr[300:500] = np.nan
    mask = motion.rest_mask(t, gyr, acc)
    assert not mask[310:490].any()
    assert mask[:270].all()
    assert mask[530:].all()
    late = np.where(t < 10.0, t, t + 7.0)
    gyr, acc = log([(10, 0)])[1:3]
    assert [s.t_start for s in motion.rest_segments(late, gyr, acc)] == [5.0, 17.0]
    # The causal window has to fill again.
    causal = motion.rest_mask_causal(late, gyr, acc)
    assert not causal[(late > 16.9) & (late < 17.5)].any()
    assert causal[late > 17.51].all()


def test_single_nan_rows_do_not_end_a_rest():
    t, gyr, acc, _ = log([(10, 0)])
    acc[::10] = np.nan
    assert motion.rest_mask(t, gyr, acc).all()


def test_segments_give_rows_and_drop_short_ones():
    t = np.arange(10.0)
    mask = np.array([1, 1, 0, 1, 1, 1, 0, 0, 1, 1], dtype=bool)
    found = motion.segments(t, mask)
    assert [(s.start, s.stop) for s in found] == [(0, 2), (3, 6), (8, 10)]
    assert [s.duration for s in found] == [1.0, 2.0, 1.0]
    assert [s.start for s in motion.segments(t, mask, 1.5)] == [3]
    assert_array_equal(t[found[1].rows], [3.0, 4.0, 5.0])


def test_empty_logs_have_no_rest():
    empty = np.empty((0, 3))
    assert motion.rest_segments([], empty, empty) == ()
    assert len(motion.rest_mask_causal([], empty, empty)) == 0


def test_inputs_are_left_alone():
    t, gyr, acc, _ = log([(5, 0), (4, 1)])
    before = gyr.copy(), acc.copy()
    motion.rest_mask(t, gyr, acc)
    motion.rest_mask_causal(t, gyr, acc)
    assert_array_equal(gyr, before[0])
    assert_array_equal(acc, before[1])


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (dict(window=0.0), "`window` must be positive"),
        (dict(factor=-1.0), "`factor` must be positive"),
        (dict(max_gyr_std=math.nan), "`max_gyr_std` must be positive"),
        (dict(max_acc_std=0.0), "`max_acc_std` must be positive"),
        (dict(max_rate=0.0), "`max_rate` must be positive, got 0"),
        (dict(min_duration=-1.0), "`min_duration` must be non-negative"),
    ],
)
def test_parameters_say_what_is_wrong(bad, message):
    with pytest.raises(ValueError, match=message):
        motion.RestTest(**bad)


def test_mask_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"`mask` must have shape \(3,\), got \(2,\)"):
        motion.segments([0.0, 1.0, 2.0], [True, False])
