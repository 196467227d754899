"""Thesis E: theory, chapter 7 and chapter 9: rows and verdicts at several seeds."""

import numpy as np
import pytest
from test_systems.shown import count, missed, rows

COUNTS = [
    ("table 2.2.2", "theory", 4),
    ("figure 2.6.2", "theory", 2),
    ("2.8,", "theory", 3),
    ("(3.5.", "theory", 2),
    ("(3.6.", "theory", 2),
    ("(3.9.", "theory", 6),
    ("(3.2.6)", "theory", 1),
    ("7.6.1,", "control-unit", 10),
    ("table 7.3,", "control-unit", 3),
    ("(7.7.8),", "control-unit", 6),
    ("(7.7.22),", "control-unit", 3),
    ("ch. 7, drive,", "control-unit", 13),
    ("7.8, ", "control-unit", 7),
    ("ch. 9, at rest,", "trials", 12 + 3),
    ("ch. 7, at rest,", "trials", 4),
    ("ch. 9, car,", "trials", 7),
]


@pytest.mark.parametrize(("beginning", "part", "number"), COUNTS)
def test_every_figure_has_its_row(beginning, part, number):
    assert count("gnssins", part, beginning) == number


@pytest.mark.parametrize("part", ["theory", "control-unit", "trials"])
def test_nothing_is_missed(part):
    assert missed("gnssins", part) == set()


@pytest.mark.parametrize("seed", [1, 2])
def test_verdicts_are_not_the_luck_of_a_seed(seed):
    for part in ("theory", "control-unit"):
        assert missed("gnssins", part, seed) == set()


def test_without_filtering_the_drift_is_that_of_the_biases_left_in():
    """Kilometres: 9.8 / 6 m/s^3 times 0.6 deg/s over 100 s is 17 km, less as it turns over."""
    found = rows("gnssins", "trials")
    raw = [found[f"ch. 9, at rest, without filtering, {axis} after 100 s"].here for axis in "xyz"]
    assert 2e3 < np.linalg.norm(raw) < 2e4
    ratio = found["ch. 9, at rest, drift without filtering over that with it"].here
    assert ratio > 50.0


def test_drift_with_filtered_rates_is_the_noise_of_the_accelerometers():
    """White noise less its mean, integrated twice: sigma sqrt(T^3 / 12) / sqrt(rate)."""
    sigma = 0.035 * 9.80665 / np.sqrt(40.0) * np.sqrt(100.0**3 / 12.0)
    found = rows("gnssins", "trials")
    # medians of the largest and of the two others of three normal numbers: 1.26, 0.47 sigma,
    # known to a twelfth from 200 trials
    largest = found["ch. 9, at rest, rates filtered, axis that drifts most"].here
    others = found["ch. 9, at rest, rates filtered, the two other axes"].here
    assert largest == pytest.approx(1.26 * sigma, rel=0.2)
    assert others == pytest.approx(0.47 * sigma, rel=0.3)


def test_printed_signs_of_the_meridian_lose_kilometres_and_corrected_ones_nothing():
    found = rows("gnssins", "theory")
    assert found["table 2.2.2 as printed, height error"].here > 1e3
    for axis in ("up", "down"):
        # second order of 5 ms of a smooth climb
        assert found[f"table 2.2.2 as corrected, z {axis}, height error"].here < 1e-2


def test_feedback_keeps_the_norm():
    found = rows("gnssins", "theory")
    without = found["2.8, without eps, norm after 100 s less one"].here
    # each step lengthens by (w dt)^2 / 8
    assert without == pytest.approx(np.expm1(4000 * 0.5 / 40**2 / 8), rel=1e-2)
    for name in ("eps of (2.8.4)", "eps of (7.2.2)"):
        assert abs(found[f"2.8, {name}, norm after 100 s less one"].here) < 2e-3


def test_system_on_the_drive_is_as_good_as_its_fixes_and_printed_tables_are_not():
    found = rows("gnssins", "control-unit")
    for name in ("12 states", "9 states", "no magnetometer"):
        assert found[f"ch. 7, drive, {name}, horizontal RMSE"].here < 1.5
        assert found[f"ch. 7, drive, {name}, inclination RMSE"].here < 4.0
    assert found["ch. 7, drive, as printed, inclination RMSE"].here > 4.0
    assert found["7.1.2, automatic resets in uniform motion"].here >= 3.0
