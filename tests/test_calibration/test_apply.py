"""Calibrations applied to recordings."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from truth import triads as truth
from truth.triads import DPS, TABLE_6_1, TABLE_6_2, UT, G

from strapdown import calibration as cal
from strapdown.calibration.record import CalibrationRecord, TemperatureRecord
from strapdown.errors import InputError, MissingStream, StrapdownWarning
from strapdown.recording import Baro, Imu, Mag, Recording, Temperature

SOFT = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.02], [0.0, 0.02, 1.0]])
HARD = np.array([10.0, -20.0, 30.0]) * UT


def record(sensor, S, bias, **about):
    return CalibrationRecord(
        sensor=sensor, method="known", matrix=np.linalg.inv(S), bias=bias, **about
    )


def known(**about):
    return cal.Calibration.of(
        record("gyr", cal.distortion_matrix(TABLE_6_2), TABLE_6_2[:3], **about),
        record("acc", cal.distortion_matrix(TABLE_6_1), TABLE_6_1[:3]),
        record("mag", SOFT, HARD),
    )


def truth_and_raw(gyr_bias=TABLE_6_2[:3], rest=4.0, seed=0):
    """True samples and the recording of distorted ones; at rest for the first seconds."""
    rng = np.random.default_rng(seed)
    t = np.arange(1000) / 100.0
    moving = (t >= rest)[:, np.newaxis]
    gyr = moving * np.sin(np.outer(t, [5.0, 7.0, 6.0]))
    acc = [0.0, 0.0, -G] + 2.0 * gyr
    t_mag = t[::4]
    mag = 50 * UT * truth.directions(250)
    x = np.concatenate((gyr_bias, TABLE_6_2[3:]))
    raw = Recording(
        imu=Imu(
            t=t,
            gyr=truth.distort(gyr, x) + 1e-3 * rng.standard_normal(gyr.shape),
            acc=truth.distort(acc, TABLE_6_1) + 1e-2 * rng.standard_normal(gyr.shape),
        ),
        mag=Mag(t=t_mag, mag=mag @ SOFT.T + HARD),
        meta={"name": "bench"},
    )
    return gyr, acc, mag, raw


def test_applied_calibration_gives_the_true_samples():
    gyr, acc, mag, raw = truth_and_raw()
    rec = known().apply(raw, at_rest=False)
    # Five standard deviations of the noise.
    assert_allclose(rec.imu.gyr, gyr, atol=5e-3)
    assert_allclose(rec.imu.acc, acc, atol=5e-2)
    assert_allclose(rec.mag.mag, mag, atol=1e-12 * UT)
    assert rec.meta["name"] == "bench"
    assert rec.meta["calibration"]["acc"]["method"] == "known"


def test_raw_recording_is_left_as_it_is():
    *_, raw = truth_and_raw()
    before = raw.imu.gyr.copy(), raw.mag.mag.copy()
    known().apply(raw)
    assert_array_equal(raw.imu.gyr, before[0])
    assert_array_equal(raw.mag.mag, before[1])
    assert "calibration" not in raw.meta


def test_bias_of_this_switch_on_comes_from_the_rest_at_the_start():
    today = TABLE_6_2[:3] + np.array([0.5, -0.8, 0.3]) * DPS
    gyr, _, _, raw = truth_and_raw(gyr_bias=today)
    rec = known().apply(raw)
    assert rec.meta["calibration"]["gyr"]["turn_on_bias"] is True
    # Mean of 375 samples of 1e-3 rad/s.
    assert_allclose((rec.imu.gyr - gyr).mean(axis=0), 0.0, atol=3e-4)
    stored = known().apply(raw, at_rest=False)
    assert stored.meta["calibration"]["gyr"]["turn_on_bias"] is False
    assert np.abs((stored.imu.gyr - gyr).mean(axis=0)).max() > 0.7 * DPS


def test_log_that_begins_in_motion_keeps_the_stored_bias():
    gyr, _, _, raw = truth_and_raw(rest=0.0)
    rec = known().apply(raw)
    assert rec.meta["calibration"]["gyr"]["turn_on_bias"] is False
    assert_allclose(rec.imu.gyr, gyr, atol=5e-3)


def with_temperature(raw, temp_degc):
    n = len(temp_degc)
    t = np.linspace(0.0, 10.0, n)
    return Recording(
        imu=raw.imu, mag=raw.mag, temperature=Temperature(t=t, temp_degc=temp_degc), meta=raw.meta
    )


SLOPE = np.array([1e-3, -2e-3, 5e-4])
MODEL = TemperatureRecord(
    sensor="gyr", method="known", slope=SLOPE, temp_mean_degc=30.0, temp_min_degc=20.0,
    temp_max_degc=40.0,
)  # fmt: skip


@pytest.mark.parametrize("at_rest", [True, False])
def test_bias_follows_the_temperature(at_rest):
    gyr, _, _, raw = truth_and_raw()
    temp_degc = np.linspace(25.0, 35.0, 101)
    S = cal.distortion_matrix(TABLE_6_2)
    warm = np.interp(raw.imu.t, np.linspace(0, 10, 101), temp_degc) - 25.0
    raw = with_temperature(raw, temp_degc)
    raw = Recording(
        imu=Imu(t=raw.imu.t, gyr=raw.imu.gyr + np.outer(warm, SLOPE), acc=raw.imu.acc),
        temperature=raw.temperature,
    )
    calibration = cal.Calibration.of(record("gyr", S, TABLE_6_2[:3], temp_degc=25.0), MODEL)
    rec = calibration.apply(raw, at_rest=at_rest)
    assert_allclose((rec.imu.gyr - gyr)[-200:].mean(axis=0), 0.0, atol=4e-4)
    without = cal.Calibration.of(calibration.records["gyr"]).apply(raw, at_rest=at_rest)
    assert np.abs((without.imu.gyr - gyr)[-200:].mean(axis=0)).max() > 1e-2


def test_missing_temperature_is_said():
    *_, raw = truth_and_raw()
    calibration = known().merge([MODEL])
    with pytest.warns(StrapdownWarning, match="gyroscope has a temperature model, but the rec"):
        rec = calibration.apply(raw)
    assert_array_equal(rec.imu.gyr, known().apply(raw).imu.gyr)


def test_applying_twice_is_refused():
    *_, raw = truth_and_raw()
    once = known().apply(raw)
    with pytest.raises(InputError, match=r"gyroscope .* is corrected already \(known"):
        known().apply(once)


def test_other_sensors_are_refused_unless_told_otherwise():
    *_, raw = truth_and_raw()
    raw = Recording(imu=raw.imu, meta={"sensor_id": "B2"})
    calibration = known(sensor_id="A7")
    with pytest.raises(InputError, match=r"is for sensor 'A7', but the recording is of 'B2'"):
        calibration.apply(raw)
    calibration.apply(raw, any_sensor=True)
    known(sensor_id="B2").apply(raw)
    by_sensor = Recording(imu=raw.imu, meta={"sensor_id": {"gyr": "A7", "acc": "B2"}})
    calibration.apply(by_sensor)


def test_recording_without_any_calibrated_sensor_is_refused():
    only_mag = cal.Calibration.of(record("mag", SOFT, HARD))
    rec = Recording(baro=Baro(t=[0.0], pressure=[1e5]))
    with pytest.raises(MissingStream, match="is for magnetometer, but the recording has baro"):
        only_mag.apply(rec)


def test_what_the_recording_lacks_is_passed_over():
    *_, raw = truth_and_raw()
    rec = known().apply(Recording(mag=raw.mag))
    assert set(rec.meta["calibration"]) == {"mag"}


def test_only_records_make_a_calibration():
    with pytest.raises(TypeError, match="must hold CalibrationRecord and TemperatureRecord"):
        cal.Calibration.of(np.eye(3))
