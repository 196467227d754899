"""Noise of a sensor becomes the parameters of an estimator, and of a sensor only what it knows."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

import strapdown
from strapdown import noise, sensors
from strapdown.recording import Imu, Recording
from strapdown.sensors import NoiseParameters
from strapdown.units import DPS

G = 9.80665
ENTRIES = list(strapdown.estimators.entries())
TAKING = [e for e in ENTRIES if e.cls.FROM_SENSOR]
MPU6050 = sensors.preset("mpu6050")
N_GYR, K_GYR = 9.281e-3 * DPS, 1.389e-4 * DPS  # worst axis of thesis A, table 5.3


@pytest.fixture(params=TAKING, ids=lambda e: e.name)
def cls(request):
    return request.param.cls


@pytest.fixture(scope="module")
def record():
    """What `characterize` says of 200 s of white noise: too short to see a bias walk."""
    rng = np.random.default_rng(5)
    t = np.arange(20_000) / 100.0
    gyr = 4e-3 * rng.standard_normal((20_000, 3))  # 4e-4 rad/s/sqrt(Hz) at 100 Hz
    acc = [0.0, 0.0, -G] + 0.03 * rng.standard_normal((20_000, 3))
    return noise.characterize(Recording(imu=Imu(t=t, gyr=gyr, acc=acc))).record


def test_all_whose_parameters_are_densities_take_a_sensor():
    names = {e.name for e in TAKING}
    assert names >= {"mekf", "indirect-ekf", "robust-eskf", "two-stage", "loosely-coupled"}
    assert not names & {"gyro", "madgwick", "mahony"}


def test_what_is_taken_are_a_parameter_and_a_quantity(cls):
    own = {f.name for f in fields(cls)}
    quantities = {f.name for f in fields(NoiseParameters)}
    for taken in cls.FROM_SENSOR:
        assert taken.parameter in own
        assert taken.quantity in quantities
        # a noise goes to a noise, of the same sensor where the name says which
        for sensor in ("gyr", "acc", "mag"):
            if sensor in taken.parameter:
                assert taken.quantity.startswith(sensor)
        assert taken.factor > 0.0


def test_worst_axis_of_the_gyroscope_is_taken():
    flt = strapdown.attitude.Mekf.from_sensor(MPU6050)
    assert flt.gyr_noise == pytest.approx(N_GYR)
    assert flt.gyr_bias_noise == pytest.approx(K_GYR)


def test_platform_of_the_source_has_its_own_sensor_by_default():
    """Thesis A's filter has the noise of the gyroscope's mean axis, so defaults are near."""
    flt = strapdown.attitude.IndirectEkf.from_sensor(MPU6050)
    ours = strapdown.attitude.IndirectEkf()
    assert flt.gyr_noise == pytest.approx(ours.gyr_noise, rel=0.2)
    assert flt.gyr_bias_noise == pytest.approx(ours.gyr_bias_noise, rel=0.3)


def test_motion_is_not_forgotten_for_a_quiet_sensor(cls):
    quiet = NoiseParameters(gyr_noise=1e-9, acc_noise=1e-9, gyr_bias_walk=1e-12)
    flt, default = cls.from_sensor(quiet), cls()
    assert flt.acc_noise == default.acc_noise
    for taken in cls.FROM_SENSOR:
        if taken.floor:
            assert getattr(flt, taken.parameter) >= getattr(default, taken.parameter)


def test_noise_beyond_the_defaults_raises_them(cls):
    loud = NoiseParameters(gyr_noise=0.5, acc_noise=50.0)
    flt, default = cls.from_sensor(loud), cls()
    assert flt.acc_noise > default.acc_noise
    changed = {t.parameter for t in cls.FROM_SENSOR if t.quantity in ("gyr_noise", "acc_noise")}
    same = {f.name for f in fields(cls)} - changed
    assert {n: getattr(flt, n) for n in same} == {n: getattr(default, n) for n in same}


def test_units_of_the_two_stage_filter_are_kept():
    """Its accelerometer is a unit vector, its process noise a component of the quaternion."""
    flt = strapdown.attitude.TwoStage.from_sensor(
        NoiseParameters(gyr_noise=0.5, acc_noise=9.80665)
    )
    assert flt.acc_noise == pytest.approx(1.0)
    assert flt.process_noise == pytest.approx(0.25)


def test_given_parameters_win(cls):
    own = cls.FROM_SENSOR[0].parameter
    flt = cls.from_sensor(NoiseParameters(gyr_noise=0.5), **{own: 0.125})
    assert getattr(flt, own) == 0.125
    assert cls.from_sensor(MPU6050, max_gap=0.25).max_gap == 0.25


def test_noise_file_is_taken_as_a_preset_is(cls, record, tmp_path):
    noise.save(record, tmp_path / "noise.toml")
    loaded = noise.load(tmp_path / "noise.toml")
    assert cls.from_sensor(loaded) == cls.from_sensor(record)


def test_what_a_record_does_not_show_leaves_the_default(record):
    known = record.noise_parameters()
    assert known.gyr_noise == pytest.approx(4e-4, rel=0.05)  # largest of three, 2 % each
    assert known.acc_noise == pytest.approx(3e-3, rel=0.05)
    assert math.isnan(known.gyr_bias_walk)
    assert math.isnan(known.mag_noise)
    flt = strapdown.attitude.Mekf.from_sensor(record)
    assert flt.gyr_bias_noise == strapdown.attitude.Mekf().gyr_bias_noise
    assert flt.gyr_noise == known.gyr_noise


@pytest.mark.parametrize("name", ["madgwick", "mahony", "gyro"])
def test_gains_have_no_sensor(name):
    cls = strapdown.estimators.entry(name).cls
    with pytest.raises(ValueError, match=rf"{name} has no noise parameter .* one of .*mekf"):
        cls.from_sensor(MPU6050)


def test_sensor_that_states_no_noise_is_refused(cls):
    with pytest.raises(
        ValueError,
        match=rf"`sensor` must state a noise that {cls.NAME} takes \(.*gyr_noise.*\), got "
        "star_tracker, which states none of them",
    ):
        cls.from_sensor(sensors.preset("star_tracker"))


@pytest.mark.parametrize("wrong", ["mpu6050", "noise.toml", None, {"gyr_noise": 1.0}])
def test_names_and_files_are_not_sensors(cls, wrong):
    with pytest.raises(TypeError, match=r"`sensor` must be a device such as .*preset.* got "):
        cls.from_sensor(wrong)


def test_solution_of_the_simulated_device_is_not_worse_for_knowing_its_sensor():
    """Inclination within 3 sigma, and its error at most a tenth above the default's."""
    from strapdown.simulation import scenario

    rec = replace(scenario.load("hand_moved").record(seed=3), star=None).between(0.0, 60.0)
    for name in ("mekf", "indirect-ekf", "robust-eskf"):
        cls = strapdown.estimators.entry(name).cls
        knowing, default = (
            strapdown.evaluation.attitude_errors(flt.run(rec), rec.reference).summary()
            for flt in (cls.from_sensor(MPU6050), cls())
        )
        assert knowing["inclination_within_3sigma"] > 0.97
        assert knowing["inclination_rmse_deg"] < 1.1 * default["inclination_rmse_deg"] + 0.02
