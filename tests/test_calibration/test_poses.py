"""Poses found by themselves in continuous logs."""

import numpy as np
import pytest
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, UT

from strapdown import calibration as cal


def inside(poses, holds, slack=0.6):
    """Which hold each pose lies in, -1 for none; tremor may blur the edges a little."""
    out = []
    for start, stop in zip(poses.t_start, poses.t_stop, strict=True):
        hit = np.flatnonzero((start > holds[:, 0] - slack) & (stop < holds[:, 1] + slack))
        out.append(int(hit[0]) if len(hit) else -1)
    return out


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("tremor_deg", [0.0, 0.05, 0.15])
def test_thirty_hand_held_poses_of_ten_minutes_are_found(seed, tremor_deg):
    t, gyr, acc, _, holds = truth.hand_held_log(seed=seed, tremor=tremor_deg * DPS)
    poses = cal.find_poses(t, gyr, acc)
    assert inside(poses, holds) == list(range(30))


@pytest.mark.parametrize("seed", range(3))
def test_table_6_1_is_recovered_from_one_continuous_log(seed):
    t, gyr, acc, _, _ = truth.hand_held_log(seed=seed)
    poses = cal.find_poses(t, gyr, acc)
    record = cal.accelerometer_from_poses(poses.acc)
    error = np.abs([p.value for p in record.parameters] - TABLE_6_1)
    assert (error[:3] < 0.3 * MG).all()
    assert (error[3:] < 6e-4).all()
    assert record.residual_rms < 0.4 * MG
    assert record.residual_rms_before > 20 * MG


def test_a_table_at_the_start_does_not_spoil_hand_held_poses():
    t, gyr, acc, _, holds = truth.hand_held_log(seed=5, tremor=0.15 * DPS)
    rng = np.random.default_rng(0)
    n = 3000
    still_gyr = np.array([1.0, -3.9, 0.2]) * DPS + 0.08 * DPS * rng.standard_normal((n, 3))
    still_acc = acc[:200].mean(axis=0) + 3 * MG * rng.standard_normal((n, 3))
    t = np.concatenate((np.arange(n) / 100.0 - 30.0, t))
    poses = cal.find_poses(t, np.vstack((still_gyr, gyr)), np.vstack((still_acc, acc)))
    assert set(inside(poses, holds)) >= set(range(1, 30))


def test_field_is_averaged_over_the_same_poses_and_the_axes_are_aligned():
    C = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # magnetometer turned
    t, gyr, acc, mag, _ = truth.hand_held_log(
        mag_matrix=C, mag_bias=np.array([20.0, -10.0, 5.0]) * UT, tremor=0.05 * DPS
    )
    poses = cal.find_poses(t, gyr, acc, t, mag)
    accelerometer = cal.accelerometer_from_poses(poses.acc)
    magnetometer = cal.ellipsoid(mag)
    assert np.linalg.norm(magnetometer.bias / UT - [20, -10, 5]) < 0.1
    found = cal.align_to_accelerometer(
        magnetometer.correct(poses.mag), accelerometer.correct(poses.acc)
    )
    angle = np.degrees(np.arccos((np.trace(found.C_am @ C) - 1) / 2))
    assert angle < 0.35


def test_positions_of_a_turntable_are_found_and_calibrate_the_gyroscope():
    rng = np.random.default_rng(3)
    axes = np.vstack((np.eye(3), -np.eye(3), truth.directions(3, 8)))
    pieces, accs = [], []
    for axis in axes:
        for rate in (200 * DPS, 270 * DPS):
            pieces += [np.tile(rate * axis, (800, 1)), np.linspace(0.3, 1.0, 200)[:, None] * axis]
            accs += [np.tile(-9.8 * axis, (800, 1)), np.tile(-9.8 * axis, (200, 1))]
    true = np.vstack(pieces)
    gyr = truth.distort(true, TABLE_6_2) + 0.6 * DPS * rng.standard_normal(true.shape)
    acc = np.vstack(accs) + 0.03 * rng.standard_normal(true.shape)
    t = np.arange(len(true)) / 100.0
    poses = cal.find_turntable_positions(t, gyr, acc)
    assert len(poses) == 18
    rates = np.tile([200 * DPS, 270 * DPS], 9)
    # 0.6 deg/s over 750 samples
    assert poses.gyr_std / DPS == pytest.approx(0.022, rel=0.05)
    record = cal.gyro_from_rate_table(poses.gyr, rates, std=poses.gyr_std)
    for p, value in zip(record.parameters, TABLE_6_2, strict=True):
        assert abs(p.value - value) < 4 * p.std, p.name


def test_a_rest_whose_gravity_wanders_is_cut_to_its_steadiest_part():
    rng = np.random.default_rng(0)
    t = np.arange(3000) / 100.0
    angle = np.where(t < 20.0, 0.0, 1.5 * DPS * (t - 20.0))  # sinks slowly after 20 s
    acc = 9.81 * np.column_stack((np.sin(angle), 0 * t, -np.cos(angle)))
    acc += 0.03 * rng.standard_normal(acc.shape)
    gyr = 0.08 * DPS * rng.standard_normal(acc.shape)
    poses = cal.find_poses(t, gyr, acc)
    assert len(poses) == 1
    assert poses.t_start[0] == 0.0
    assert 20.0 < poses.t_stop[0] < 22.5


def test_a_jolt_does_not_make_two_poses_of_one():
    rng = np.random.default_rng(0)
    t = np.arange(2000) / 100.0
    jolt = (np.abs(t - 10.0) < 0.2)[:, np.newaxis]
    acc = [0.0, 0.0, -9.81] + 0.03 * rng.standard_normal((2000, 3)) * (1 + 50 * jolt)
    gyr = 0.08 * DPS * rng.standard_normal((2000, 3)) * (1 + 50 * jolt)
    poses = cal.find_poses(t, gyr, acc)
    assert len(poses) == 1
    assert poses.samples[0] == pytest.approx(2000 - 90, abs=10)


def test_a_log_that_never_rests_has_no_poses():
    t = np.arange(2000) / 100.0
    swing = np.sin(np.outer(t, [5.0, 7.0, 6.0]))
    poses = cal.find_poses(t, 2.0 * swing, 9.0 * swing, t, swing)
    assert len(poses) == 0
    assert poses.acc.shape == (0, 3)
    assert poses.mag.shape == (0, 3)
