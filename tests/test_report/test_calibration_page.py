"""The page of a calibration shows what the records hold."""

import numpy as np
import pytest
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, UT, G

from strapdown import calibration as cal
from strapdown.report import calibration as page


def records():
    rng = np.random.default_rng(0)
    true = G * truth.directions(30)
    acc = cal.accelerometer_from_poses(
        truth.distort(true, TABLE_6_1) + 0.5 * MG * rng.standard_normal(true.shape), sensor_id="A7"
    )
    mag = cal.ellipsoid(50 * UT * truth.directions(2000) + 10 * UT)
    B = 0.3 * rng.standard_normal((200, 3))
    gyr = cal.against_reference("gyr", 1.01 * B + 1e-3 * rng.standard_normal(B.shape), B)
    T = np.linspace(20, 40, 300)
    warm = np.outer(T, [1e-4, 0, 0]) + 1e-3 * rng.standard_normal((300, 3))
    return [acc, mag, gyr, cal.temperature_model("gyr", T, warm)]


def test_every_kind_of_record_has_its_section():
    composed = page.compose(records(), ["gravity is assumed."])
    assert [s.title for s in composed.sections] == [
        "Accelerometer", "Magnetometer", "Gyroscope", "Gyroscope, temperature", "Notes",
    ]  # fmt: skip
    assert composed.subtitle.endswith("sensor A7")


def test_values_are_in_the_units_that_people_read():
    acc, mag, _, temperature = records()
    value, std, tolerance, unit = page.shown(acc["b_x"])
    assert (value, std, unit) == (acc["b_x"].value / MG, acc["b_x"].std / MG, "mg")
    assert tolerance is None
    assert page.shown(acc["theta_zx"])[0] == pytest.approx(np.degrees(acc["theta_zx"].value))
    assert page.shown(acc["s_x"])[2:] == (0.03, "")
    assert page.shown(mag["b_x"])[0] == pytest.approx(10.0, abs=0.01)
    assert page.shown(temperature["p1_x"])[0] == pytest.approx(1e-4 / DPS, rel=0.2)


def test_page_draws_errors_coverage_and_iterations_and_is_one_file(tmp_path):
    file = page.write(records(), tmp_path / "calibration.html")
    text = file.read_text(encoding="utf-8")
    for words in (
        "Errors before and after", "map of equal areas", "by iteration", "corrected = matrix",
        "within", "residual before",
    ):  # fmt: skip
        assert words in text, words
    assert "<script src" not in text


def test_direct_solutions_have_no_iterations_to_draw():
    gyr = records()[2]
    blocks = page.compose([gyr]).sections[0].blocks
    assert not any("by iteration" in block.html for block in blocks)


def test_long_clouds_are_thinned_and_keep_their_ends():
    rows = page._thinned(100_000)
    assert len(rows) == 4000
    assert rows[0] == 0
    assert rows[-1] == 99_999
