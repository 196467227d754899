"""The simulated bench: motion, sensors with the printed errors, encoders, systematic residual."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from strapdown.simulation.motions import BangBang, Poses
from strapdown.systems.platform import bench
from strapdown.systems.platform.replay import (
    RESIDUAL_G,
    STILL_SAMPLES,
    Trial,
    calibration,
    rates_of,
    replay,
    residual,
)

DEG = np.pi / 180
G = 9.80665
SHORT = Trial("short", 60.0, (4.0, 7.0, 8.0), (0.0, 0.0, 0.0), 55.0)


def test_the_frame_does_not_turn_and_the_centre_rests():
    pose = Poses(rpy=((0.3, -0.2, 1.0),))
    found = bench.truth(pose, 1.0)
    assert_allclose(found.omega_ib_b, 0.0, atol=1e-18)  # no Earth rate of 7e-5 rad/s
    down_b = Rotation.from_euler("ZYX", [1.0, -0.2, 0.3]).inv().apply([0, 0, -G])
    assert_allclose(found.f_b, np.tile(down_b, (100, 1)), atol=1e-12)
    assert_allclose(found.m_n, np.tile([2.25e-5, 0.0, 4.18e-5], (100, 1)))


def test_rate_of_a_turn_is_the_derivative_of_its_attitude():
    found = bench.truth(BangBang(start=0.5, half=1.0), 4.0, 100.0)
    r_nb = Rotation.from_quat(found.q_nb[:, [1, 2, 3, 0]])
    between = (r_nb[:-1].inv() * r_nb[1:]).as_rotvec() * 100.0
    mean = 0.5 * (found.omega_ib_b[1:] + found.omega_ib_b[:-1])
    assert_allclose(between, mean, atol=1e-3)  # 0.1551 rad/s^2 over a step with a corner


@pytest.mark.parametrize("rms", [(4.0, 7.33, 8.09), (7.05, 8.56, 12.84)])
def test_hand_motion_has_the_rms_asked_for_and_keeps_off_the_stops(rms):
    motion = bench.hand_motion(np.random.default_rng(5), rms)
    found = bench.truth(motion, 180.0)
    rates = np.sqrt(np.mean((found.omega_ib_b / DEG) ** 2, axis=0))
    assert_allclose(rates, rms, rtol=1e-3)
    assert np.abs(bench.encoders(found)[:, :2]).max() < 40.0 * DEG


def test_encoders_round_to_counts_and_make_the_star_tracker():
    found = bench.truth(bench.hand_motion(np.random.default_rng(1), (5.0, 5.0, 5.0)), 30.0)
    rpy = bench.encoders(found)
    true = Rotation.from_quat(found.q_nb[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
    assert np.abs(rpy - true).max() < 0.0451 * DEG
    counts = rpy / (0.09 * DEG)
    assert_allclose(counts, np.round(counts), atol=1e-9)
    star = bench.star_tracker(found.t, rpy)
    assert_allclose(star.t, np.arange(10) * 3.0)
    seen = Rotation.from_quat(star.q_nb[:, [1, 2, 3, 0]])
    assert_allclose(seen.as_euler("ZYX")[:, ::-1], rpy[::300], atol=1e-12)


@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_sensors_have_the_errors_that_the_printed_matrix_undoes(sensor):
    """Without noise, C (y, 1) is the truth; written out with the printed numbers."""
    C, size = bench.MATRICES[sensor]
    part = getattr(bench.device(), sensor)
    x = np.array([[0.3, -0.7, 0.9], [-1.1, 0.2, 0.4]]) * size
    y = part.linear.apply(x)
    assert_allclose(np.column_stack((y / size, [1.0, 1.0])) @ np.array(C).T, x / size, atol=1e-12)


def test_euler_rates_become_body_rates():
    rpy, slopes = np.array([[0.3, -0.4, 2.0]]), np.array([[0.7, 0.2, -0.5]])
    h = 1e-6
    after, before = (
        Rotation.from_euler("ZYX", (rpy + d * slopes)[0, ::-1]) for d in (0.5 * h, -0.5 * h)
    )
    want = (before.inv() * after).as_rotvec() / h
    assert_allclose(rates_of(rpy, slopes)[0], want, atol=1e-9)  # round-off over h


def test_residual_has_the_rms_of_table_6_4():
    turns = Rotation.random(4000, random_state=np.random.default_rng(2)).as_quat()[:, [3, 0, 1, 2]]
    found = residual(turns, np.random.default_rng(0)) * 1e4
    assert_allclose(np.sqrt(np.mean(found**2, axis=0)), RESIDUAL_G, rtol=1e-12)


def test_a_replay_is_calibrated_and_knows_its_bias():
    log = replay(SHORT, 0)
    printed = -np.array([-1.0767, 3.8961, -0.1604])  # -fourth column of C, deg/s
    assert_allclose(log.bias / DEG, -printed, atol=0.05)  # 1 s of 0.08 deg/s, and the fit's own
    still = slice(0, STILL_SAMPLES)
    assert_allclose(log.rec.imu.acc[still].mean(axis=0), [0.0, 0.0, -G], atol=0.02)
    assert_allclose(log.rec.mag.mag[still].mean(axis=0), bench.FIELD_N, atol=5e-8)
    inner = slice(100, -100)
    error = (log.rates - log.true_rates)[inner]
    assert np.sqrt(np.mean(error**2)) < 0.06 * DEG  # what counts of 0.09 deg leave
    assert calibration(0) is calibration(0)


def test_same_seed_same_log_and_another_number_another_motion():
    one, two = replay(SHORT, 3), replay(SHORT, 3)
    assert np.array_equal(one.rec.imu.gyr, two.rec.imu.gyr)
    assert not np.array_equal(one.true_rates, replay(SHORT, 3, 1).true_rates)
