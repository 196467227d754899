"""Thesis D, appendix B: rows, verdicts, wrong inputs."""

import json

import numpy as np
import pytest
from test_systems.shown import count, missed, rows, shown

from strapdown.systems import Verdict
from strapdown.systems.uav import sensors

TABLES = [
    ("appendix B, omega_SF", 1),
    ("appendix B, A_SF", 1),
    ("appendix B, saturation", 2),
    ("4.2, constant bias", 3),
    ("(4.1), mean", 3),
    ("(4.1), swing", 3),
    ("(4.1), period", 1),
    ("appendix A.2, noise", 1),
    ("appendix A.2, variance", 2),
    ("appendix A.1, variance", 2),
    ("appendix B, H", 2),
]
MISSED = {"appendix A.1, variance of the accelerometers, commented as (0.1 g)^2"}


@pytest.mark.parametrize(("beginning", "number"), TABLES)
def test_every_printed_figure_has_its_row(beginning, number):
    assert count("uav", "sensors", beginning) == number


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_is_missed_is_what_is_documented(seed):
    assert missed("uav", "sensors", seed) == MISSED


def test_rows_say_what_they_compare_and_why():
    for row in rows("uav", "sensors").values():
        json.dumps(row.summary(), allow_nan=False)
        assert row.remark
    assert len(shown("uav", "sensors").blocks) == 1


def test_low_pass_has_the_gain_of_the_corrected_formula():
    found = rows("uav", "sensors")
    for ratio, item in (
        (0.1, "appendix B, H_gyro = omega_br / (s + omega_br), gain at omega_br / 10"),
        (1.0, "appendix B, the same, gain at omega_br"),
    ):
        # straight between samples at 400 Hz: 1e-3 at 5 Hz
        assert found[item].here == pytest.approx(1.0 / np.sqrt(1.0 + ratio**2), abs=1e-3)


def test_sigma_of_the_period_is_that_of_many_fits():
    t = np.arange(15_000) / sensors.RATE
    rng = np.random.default_rng(0)
    wave = 0.1 + 0.05 * np.sin(2.0 * np.pi * t / 150.0)
    found = [sensors._period(t, wave + 0.01 * rng.standard_normal(len(t))) for _ in range(60)]
    # phase and mean are fitted too, over two periods only: up to a fifth more than the formula
    assert np.std(found) == pytest.approx(sensors._period_sigma(len(t)), rel=0.35)
    assert np.mean(found) == pytest.approx(150.0, abs=0.05)


@pytest.mark.parametrize(
    ("name", "value", "item"),
    [
        ("BIAS", (0.1, 0.251, 0.5), "4.2, constant bias b_Q"),
        ("SWING", (0.05, 0.05, 0.001), "(4.1), swing of b_R"),
        ("SIGMA_GYR", 0.0105, "appendix A.2, noise of the gyroscopes"),
        ("VARIANCE_MAG", 7.5e-5, "appendix A.2, variance of the magnetometers"),
        ("PERIOD", 152.0, "(4.1), period of b_P"),
    ],
)
def test_a_wrong_printed_figure_is_missed(monkeypatch, name, value, item):
    t = np.arange(15_000) / sensors.RATE
    rng = np.random.default_rng(0)
    still = sensors._truth(np.zeros((15_000, 3)))
    box = sensors.preset("mnav100ca")
    gyr = box.gyr.apply(still, rng).value
    slow = gyr - np.array(sensors.BIAS) + sensors.slow_bias(t)
    mag, acc = box.mag.apply(still, rng).mag, box.acc.apply(still, rng).value
    monkeypatch.setattr(sensors, name, value)
    found = {
        row.item: row for row in [*sensors._biases(gyr, slow, t), *sensors._noise(gyr, mag, acc)]
    }
    assert found[item].verdict is Verdict.MISSED
