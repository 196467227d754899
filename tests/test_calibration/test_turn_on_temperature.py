"""Bias at switch-on and its change with temperature."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.triads import DPS, G

from strapdown import calibration as cal
from strapdown import motion
from strapdown.errors import InputError

BIAS = np.array([1.0, -3.9, 0.2]) * DPS


def log(rest=3.0, move=5.0, seed=0, drift=0.0):
    rng = np.random.default_rng(seed)
    t = 100.0 + np.arange(round((rest + move) * 100)) / 100.0
    moving = (t - 100.0 >= rest)[:, np.newaxis]
    swing = np.sin(np.outer(t, [5.0, 7.0, 6.0]))
    gyr = BIAS + 0.08 * DPS * rng.standard_normal((len(t), 3)) + moving * swing
    acc = [0.0, 0.0, -G] + 0.03 * rng.standard_normal((len(t), 3)) + moving * 2.0 * swing
    return t, gyr, acc


def test_bias_is_the_mean_of_the_rest_with_its_sigma():
    found = cal.turn_on_bias(*log())
    # 280 samples of 0.08 deg/s: 0.005 deg/s
    assert_allclose(found.std / DPS, 0.005, rtol=0.5)
    assert (np.abs(found.bias - BIAS) < 4 * found.std).all()
    assert found.t_start == 100.0
    assert found.t_stop == pytest.approx(102.75, abs=0.1)
    assert found.samples == pytest.approx(275, abs=10)


def test_only_the_first_part_of_a_long_rest_counts():
    found = cal.turn_on_bias(*log(rest=60.0), longest=5.0)
    assert found.t_stop == pytest.approx(105.0)


def test_log_that_begins_in_motion_is_refused_naming_the_time():
    t, gyr, acc = log()
    with pytest.raises(InputError, match=r"starts at 100.00 s and is never at rest; leave the"):
        cal.turn_on_bias(t[300:] - 3.0, gyr[300:], acc[300:])
    back = slice(None, None, -1)
    with pytest.raises(InputError, match=r"is at rest from 105\.\d\d s on"):
        cal.turn_on_bias(t, gyr[back], acc[back])


def test_a_turning_table_is_not_taken_for_rest():
    t, gyr, acc = log(rest=10.0, move=0.0)
    with pytest.raises(InputError, match="never at rest"):
        cal.turn_on_bias(t, gyr + [0, 0, 200 * DPS], acc)
    with pytest.raises(InputError, match=r"within 10 deg/s of the calibrated .* is 15 deg/s"):
        cal.turn_on_bias(t, gyr + [0, 0, 15 * DPS], acc, expected=BIAS)


def test_shorter_rests_than_a_second_are_refused():
    t, gyr, acc = log(rest=0.95)
    with pytest.raises(InputError, match=r"must last 1 s, it lasts 0\.\d\d s"):
        cal.turn_on_bias(t, gyr, acc, rest=motion.RestTest(min_duration=0.1))


# --- temperature -----------------------------------------------------------------------------

P1 = np.array([4.339e-3, 2.039e-2, -5.197e-4]) * DPS  # Scibona 2015, table 6.5, test 1
P2 = np.array([0.934, 3.216, 0.153]) * DPS


def warm_up(seed=0, n=6000, noise=0.08 * DPS):
    rng = np.random.default_rng(seed)
    T = 20.0 + 20.0 * np.linspace(0, 1, n) ** 0.7
    return T, np.outer(T, P1) + P2 + noise * rng.standard_normal((n, 3))


def test_slope_and_intercept_of_table_6_5_are_recovered():
    record = cal.temperature_model("gyr", *warm_up())
    values = np.array([p.value for p in record.parameters])
    std = np.array([p.std for p in record.parameters])
    assert (np.abs(values - np.concatenate((P1, P2))) < 3.5 * std).all()
    assert_allclose(record.slope, values[:3])
    # sigma / (sqrt(n) * spread of T)
    assert std[0] / DPS == pytest.approx(0.08 / (np.sqrt(6000) * warm_up()[0].std()), rel=0.1)
    assert record.temp_min_degc == pytest.approx(20.0)
    assert record.temp_max_degc == pytest.approx(40.0)


def test_sigma_is_honest_over_many_draws():
    nees = []
    for seed in range(80):
        record = cal.temperature_model("gyr", *warm_up(seed, 500))
        e = [p.value for p in record.parameters] - np.concatenate((P1, P2))
        nees.append(e @ np.linalg.solve(record.covariance, e))
    # Chi-square of 6, standard deviation of the mean of 80 draws 0.39.
    assert 4.8 < np.mean(nees) < 7.2


def test_slow_drift_beside_the_temperature_raises_the_sigma():
    T, y = warm_up()
    drift = 0.05 * DPS * np.sin(np.arange(len(T)) / 300.0)[:, np.newaxis]
    still = cal.temperature_model("gyr", T, y)
    moving = cal.temperature_model("gyr", T, y + drift)
    assert moving["p1_x"].std > 5 * still["p1_x"].std


def test_change_of_bias_is_about_the_temperature_of_the_calibration():
    record = cal.temperature_model("gyr", *warm_up(noise=0.0))
    assert_allclose(record.bias_change([25.0, 30.0], 25.0), [[0, 0, 0], 5 * P1], atol=1e-12)
    mean = record.temp_mean_degc
    assert_allclose(record.bias_change([mean + 1.0]), [P1], atol=1e-12)


def test_thesis_conclusion_no_compensation_for_one_degree():
    record = cal.temperature_model("gyr", *warm_up())
    # 0.02 deg/s per degC on y: under the 0.1 deg/s that matter, for 1 degC; not for 20.
    assert not cal.slope_matters(record, 1.0, 0.1 * DPS)
    assert cal.slope_matters(record, 20.0, 0.1 * DPS)


def test_constant_temperature_is_refused():
    with pytest.raises(InputError, match=r"samples over 2 degC, got 100 over 0\.5 degC"):
        cal.temperature_model("acc", np.linspace(23, 23.5, 100), np.zeros((100, 3)))


def test_movement_in_a_log_at_rest_is_refused_with_its_time_span():
    t, gyr, acc = log(rest=10.0, move=6.0)
    mask = motion.rest_mask(t, gyr, acc)
    with pytest.raises(InputError, match=r"it moves from 109\.\d s to 116\.0 s; cut it"):
        cal.require_rest(t, mask, "temperature calibration")
    cal.require_rest(t[:900], mask[:900], "temperature calibration")
