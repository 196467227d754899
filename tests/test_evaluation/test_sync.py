"""Estimates at the times of a reference: exact on samples, nothing from beyond or across gaps."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from strapdown.evaluation import match


def test_a_sample_at_its_own_time_is_returned_bit_for_bit():
    t = np.cumsum(np.random.default_rng(1).uniform(0.009, 0.011, 500))
    values = np.random.default_rng(2).normal(size=(500, 3))
    found = match(t, t[::3])
    assert np.array_equal(found.linear(values), values[::3])
    assert np.array_equal(found.linear(values[:, 0]), values[::3, 0])


def test_a_nan_neighbour_does_not_reach_a_time_that_is_a_samples_own():
    values = np.array([1.0, np.nan, 3.0])
    assert match([0.0, 0.1, 0.2], [0.0, 0.2]).linear(values) == pytest.approx([1.0, 3.0], abs=0)


def test_linear_interpolation_is_that_of_numpy():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.01, 0.05, 200))
    y = rng.normal(size=200)
    wanted = np.sort(rng.uniform(t[0], t[-1], 77))
    # both formulas round a few times: 4 eps of values around 3
    assert match(t, wanted).linear(y) == pytest.approx(np.interp(wanted, t, y), abs=3e-15)


def test_attitude_interpolation_is_that_of_scipy():
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.01, 0.05, 50))
    steps = Rotation.from_rotvec(rng.normal(scale=0.3, size=(50, 3)))
    path = [steps[0]]
    for step in steps[1:]:
        path.append(path[-1] * step)
    rotations = Rotation.concatenate(path)
    q = np.roll(rotations.as_quat(), 1, axis=1)
    q[::7] *= -1.0  # either sign is the same attitude
    wanted = np.sort(rng.uniform(t[0], t[-1], 40))
    found = match(t, wanted).quats(q)
    apart = Rotation.from_quat(np.roll(found, -1, axis=1)).inv() * Slerp(t, rotations)(wanted)
    assert apart.magnitude().max() < 1e-14 * 50  # round-off of some fifty operations


def test_nothing_is_extrapolated():
    found = match([1.0, 1.1, 1.2], [0.9, 1.0, 1.15, 1.2, 1.3, 2.0])
    assert found.rows.tolist() == [1, 2, 3]
    assert (found.outside, found.in_gap) == (3, 0)


def test_a_gap_is_not_bridged_but_its_ends_are_served():
    t = [0.0, 0.1, 0.2, 5.0, 5.1]
    found = match(t, [0.15, 0.2, 0.3, 4.9, 5.0, 5.05], max_gap=0.5)
    assert found.rows.tolist() == [0, 1, 4, 5]
    assert (found.outside, found.in_gap) == (0, 2)


def test_both_neighbours_must_satisfy_a_mask():
    found = match([0.0, 0.1, 0.2], [0.0, 0.05, 0.1, 0.15])
    assert found.both(np.array([True, False, True])).tolist() == [True, False, False, False]


def test_no_samples_serve_no_time():
    found = match([], [0.0, 1.0])
    assert len(found.rows) == 0
    assert found.outside == 2


def test_times_that_go_back_are_refused():
    with pytest.raises(ValueError, match=r"`wanted` must increase, got 0\.5 after 1\.0 in row 1"):
        match([0.0, 2.0], [1.0, 0.5])
    with pytest.raises(ValueError, match="`max_gap` must be positive"):
        match([0.0, 2.0], [1.0], max_gap=0.0)
