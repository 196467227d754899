"""Records, and the TOML files that keep them."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, UT, G

from strapdown import calibration as cal
from strapdown.calibration.record import CalibrationRecord, Parameter, TemperatureRecord
from strapdown.errors import FormatError, InputError

DAY = dt.date(2025, 3, 31)


def accelerometer(**about):
    rng = np.random.default_rng(0)
    raw = truth.distort(G * truth.directions(39), TABLE_6_1) + 0.5 * MG * rng.standard_normal(
        (39, 3)
    )
    return cal.accelerometer_from_poses(raw, **{"date": DAY, "sensor_id": "A7", **about})


def gyroscope(**about):
    axes = np.vstack((np.eye(3), -np.eye(3), truth.directions(3, 8)))
    rates = np.repeat([200 * DPS, 270 * DPS], 9)
    true = rates[:, np.newaxis] * np.tile(axes, (2, 1))
    noise = 0.02 * DPS * np.random.default_rng(1).standard_normal(true.shape)
    return cal.gyro_from_rate_table(
        truth.distort(true, TABLE_6_2) + noise, rates, **{"date": DAY, "temp_degc": 23.5, **about}
    )


def magnetometer(**about):
    noise = 0.1 * UT * np.random.default_rng(2).standard_normal((3000, 3))
    return cal.ellipsoid(50 * UT * truth.directions(3000) + 10 * UT + noise, date=DAY, **about)


def temperature(**about):
    T = np.linspace(20.0, 40.0, 500)
    noise = 1e-3 * np.random.default_rng(3).standard_normal((500, 3))
    y = np.outer(T, [1e-4, 3e-4, 0.0]) + noise
    return cal.temperature_model("gyr", T, y, **{"date": DAY, **about})


def all_four():
    return cal.Calibration.of(accelerometer(), gyroscope(), magnetometer(), temperature())


def equal(a, b):
    """Whether two records hold the same, bit for bit; long arrays may be left out."""
    for name in type(a).__dataclass_fields__:
        left, right = getattr(a, name), getattr(b, name)
        if isinstance(left, np.ndarray):
            if name in ("residuals", "residuals_before", "directions") and left.size > 1200:
                assert right.size == 0
                continue
            assert_array_equal(left, right, err_msg=name)
        else:
            assert left == right, name


# --- records -------------------------------------------------------------------------------


def test_record_refuses_what_does_not_fit():
    good = dict(sensor="acc", method="m", matrix=np.eye(3), bias=np.zeros(3))
    with pytest.raises(ValueError, match="`sensor` must be one of gyr, acc, mag, got 'accel'"):
        CalibrationRecord(**{**good, "sensor": "accel"})
    with pytest.raises(ValueError, match="`matrix` must be invertible, got determinant 0"):
        CalibrationRecord(**{**good, "matrix": np.zeros((3, 3))})
    with pytest.raises(ValueError, match=r"`bias` must have shape \(3,\), got \(2,\)"):
        CalibrationRecord(**{**good, "bias": [1.0, 2.0]})
    with pytest.raises(ValueError, match=r"`covariance` must have shape \(0, 0\), got \(1, 1\)"):
        CalibrationRecord(**good, covariance=np.eye(1))
    two = (Parameter(name="a", value=1.0, std=1.0), Parameter(name="b", value=1.0, std=1.0))
    with pytest.raises(ValueError, match="`covariance` must be symmetric"):
        CalibrationRecord(**good, parameters=two, covariance=[[1.0, 0.5], [0.0, 1.0]])
    with pytest.raises(ValueError, match=r"`temp_mean_degc` must lie between .* got 50 and 20"):
        TemperatureRecord(sensor="gyr", method="m", slope=np.zeros(3), temp_mean_degc=50.0,
                          temp_min_degc=20.0, temp_max_degc=40.0)  # fmt: skip


def test_one_sample_and_a_series_are_corrected_alike():
    record = accelerometer()
    raw = truth.directions(4)
    assert_array_equal(record.correct(raw)[2], record.correct(raw[2]))
    with pytest.raises(ValueError, match=r"`samples` must have shape \(..., 3\), got \(4, 2\)"):
        record.correct(raw[:, :2])


def test_parameters_are_found_by_name():
    assert accelerometer()["s_x"].name == "s_x"
    with pytest.raises(ValueError, match=r"`parameter` must be one of b_x, .* got 's_w'"):
        accelerometer()["s_w"]


def test_parameter_whose_sigma_exceeds_its_tolerance_is_not_determined():
    p = Parameter(name="s", value=0.5, std=0.1, tolerance=0.03)
    assert p.verdict is cal.Verdict.NOT_DETERMINED
    assert replace(p, std=0.01).verdict is cal.Verdict.OUTSIDE
    assert replace(p, std=float("nan")).verdict is cal.Verdict.NOT_DETERMINED
    assert replace(p, std=0.01, nominal=0.5).verdict is cal.Verdict.WITHIN


# --- files ---------------------------------------------------------------------------------


def test_what_is_saved_is_loaded_bit_for_bit(tmp_path):
    saved = all_four()
    saved.save(tmp_path / "imu.toml")
    loaded = cal.load(tmp_path / "imu.toml")
    assert set(loaded.records) == {"acc", "gyr", "mag"}
    for sensor, record in saved.records.items():
        equal(record, loaded.records[sensor])
    equal(saved.temperatures["gyr"], loaded.temperatures["gyr"])


def test_file_states_units_date_sensor_and_version(tmp_path):
    all_four().save(tmp_path / "imu.toml")
    text = (tmp_path / "imu.toml").read_text()
    for line in (
        'type = "strapdown calibration"', "format_version = 1", "[acc]", 'unit = "m_s2"',
        'unit = "rad_s"', 'unit = "t"', "date = 2025-03-31", 'sensor_id = "A7"',
        'verdict = "within"', "dof = 30", "[temperature.gyr]",
    ):  # fmt: skip
        assert line in text, line


def test_merging_keeps_other_tables_and_their_comments(tmp_path):
    file = tmp_path / "imu.toml"
    cal.save([accelerometer()], file)
    file.write_text(file.read_text().replace("[acc]", "# measured on the bench\n[acc]"))
    merged = cal.merge_into(file, [gyroscope()])
    assert set(merged.records) == {"acc", "gyr"}
    assert "# measured on the bench" in file.read_text()
    cal.merge_into(file, [temperature()])
    later = dt.date(2025, 4, 1)
    cal.merge_into(file, [gyroscope(date=later), temperature(date=later)])
    loaded = cal.load(file)
    assert loaded.records["gyr"].date == later
    assert loaded.temperatures["gyr"].date == later
    assert loaded.records["acc"].date == DAY


def test_merging_into_no_file_makes_one(tmp_path):
    cal.merge_into(tmp_path / "new.toml", [accelerometer()])
    assert set(cal.load(tmp_path / "new.toml").records) == {"acc"}


def test_merging_another_piece_of_hardware_is_refused(tmp_path):
    file = tmp_path / "imu.toml"
    cal.save([accelerometer()], file)
    before = file.read_bytes()
    with pytest.raises(
        InputError,
        match="'A7', but the new record is of 'B2'; write to another file",
    ):
        cal.merge_into(file, [accelerometer(sensor_id="B2")])
    assert file.read_bytes() == before


def test_failed_writing_leaves_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "imu.toml"
    cal.save([accelerometer()], file)
    before = file.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("tomlkit.dumps", fail)
    with pytest.raises(OSError, match="disk full"):
        cal.save([gyroscope()], file)
    assert file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["imu.toml"]


def edited(tmp_path, *changes):
    """A file of all sensors with pieces of text replaced."""
    file = tmp_path / "imu.toml"
    all_four().save(file)
    text = file.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('type = "strapdown calibration"', 'type = "imu"'),
         r"imu\.toml: must begin with `type = 'strapdown calibration'`, got 'imu'; give a file"),
        (("format_version = 1", "format_version = 7"), r"`format_version` must be 1, got 7"),
        (("[acc]", "[accel]"), r"unknown key 'accel' at the top; .* 'acc'"),
        (('method = "multi-position"', 'metod = "multi-position"'),
         r"unknown key 'metod' in table \[acc\]; .* 'method'"),
        (('method = "multi-position"', ""), r"the table \[acc\] must have `method`"),
        (("[temperature.gyr]", "[temperature.gyro]"),
         r"unknown key 'gyro' in table \[temperature\]; .* 'gyr'"),
        (('unit = "m_s2"', 'unit = "mg"'),
         r"`acc\.unit` must be 'm_s2', got 'mg'; multiply its bias .* by 0\.00980665 and write"),
        (('unit = "m_s2"', 'unit = "dps"'),
         r"`acc\.unit` must be 'm_s2', got 'dps': unit 'dps' measures angular rate"),
        (('unit = "m_s2"', 'unit = "furlong"'), r"`acc\.unit` .* unknown unit 'furlong'"),
        (("date = 2025-03-31", 'date = "yesterday"'), r"`acc\.date` must be a date such as"),
        (('type = "calibration"', 'type = "temperature"'), r"`acc\.type` must be 'calibration'"),
        (("bias = [", "bias = [1.0, "), r"table \[acc\]: `bias` must have shape \(3,\)"),
        (("b_x = {value", "b_x = {valu"), r"unknown key 'valu' in table \[acc\.parameters\.b_x\]"),
        (('verdict = "within"}', 'verdict = "fine"}'), r"verdict` must be one of within"),
        (("[acc.fit]", "[acc.fit]\nresidual = [1.0]"),
         r"unknown key 'residual' in table \[acc\.fit\]; .* 'residuals'"),
        (("format_version = 1", "format_version = "), r"must be TOML, got"),
        (("bias = [", "bias = [1.0, 2.0, 3.0]\nbias = ["), r'must be TOML, got Key "bias"'),
        (('sensor_id = "', f'temp_degc = {"9" * 400}\nsensor_id = "'),
         r"`acc\.temp_degc` must be a number of at most 64 bits, got 400 digits"),
    ],
)  # fmt: skip
def test_files_that_do_not_fit_are_refused_with_the_way_out(tmp_path, change, message):
    with pytest.raises(FormatError, match=message):
        cal.load(edited(tmp_path, change))


def test_file_that_is_not_there_says_so(tmp_path):
    with pytest.raises(FileNotFoundError):
        cal.load(tmp_path / "none.toml")


def test_units_are_converted_on_demand(tmp_path):
    original = gyroscope()
    text = f"""
type = "strapdown calibration"
format_version = 1
[gyr]
type = "calibration"
method = "by hand"
date = 2025-03-31
unit = "dps"
matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
bias = {(original.bias / DPS).tolist()}
residual_rms = 0.1
covariance = [[0.04, 0.001], [0.001, 0.0001]]
[gyr.parameters]
b_x = {{value = 1.5, std = 0.2, unit = "dps", tolerance = 5.0}}
s_x = {{value = 0.01, std = 0.01, unit = "1"}}
"""
    file = tmp_path / "gyr.toml"
    file.write_text(text)
    with pytest.raises(
        FormatError, match=r"multiply its bias .* by 0\.01745329252 .*convert_units"
    ):
        cal.load(file)
    record = cal.load(file, convert_units=True).records["gyr"]
    assert_allclose(record.bias, original.bias, rtol=1e-15)
    assert record["b_x"].value == pytest.approx(1.5 * DPS)
    assert record["b_x"].tolerance == pytest.approx(5.0 * DPS)
    assert record["b_x"].unit == "rad_s"
    assert record["s_x"].value == 0.01
    assert_allclose(record.covariance, [[0.04 * DPS**2, 0.001 * DPS], [0.001 * DPS, 1e-4]])
    assert record.residual_rms == pytest.approx(0.1 * DPS)


def test_a_file_written_by_hand_needs_little(tmp_path):
    file = tmp_path / "hand.toml"
    file.write_text(
        'type = "strapdown calibration"\nformat_version = 1\n[mag]\ntype = "calibration"\n'
        'method = "by hand"\ndate = 2025-03-31\nunit = "t"\n'
        "matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"
        "bias = [1e-5, 0.0, -2e-5]\n"
    )
    record = cal.load(file).records["mag"]
    assert_array_equal(record.correct([1e-5, 0.0, 0.0]), [0.0, 0.0, 2e-5])
    assert record.verdict is cal.Verdict.NO_TOLERANCE
