"""``strapdown run --sensor``: presets and noise files fill the noise parameters."""

import json
import re

import numpy as np
import pytest
from test_cli import logs

import strapdown as sd


@pytest.fixture
def log(tmp_path):
    return logs.write(tmp_path / "log.csv")


def parameters(done):
    assert done.status == 0, done.err
    return json.loads(done.out)["parameters"]


def test_preset_is_what_from_sensor_makes_of_it(command, log):
    done = command("run", log, "--filter", "mekf", "--sensor", "mpu6050", "--json", "--no-report")
    found = parameters(done)
    want = sd.attitude.Mekf.from_sensor(sd.sensors.preset("mpu6050"))
    finite = {k: v for k, v in want.parameters().items() if v != np.inf}  # null in JSON
    assert {k: found[k] for k in finite} == finite
    assert found["gyr_noise"] < sd.attitude.Mekf().gyr_noise


def test_presets_share_a_box_and_set_wins(command, log):
    options = ("--filter", "indirect-ekf", "--set", "gyr_noise=0.001", "--json", "--no-report")
    found = parameters(command("run", log, "--sensor", "mpu6050, hmc5883l", *options))
    box = sd.sensors.preset("mpu6050").with_sensors_of(sd.sensors.preset("hmc5883l"))
    assert found["gyr_noise"] == 0.001
    assert found["mag_noise"] == box.noise_parameters().mag_noise


def test_noise_file_of_characterize_is_taken(command, log, tmp_path):
    rows = logs.table(6000)
    rng = np.random.default_rng(1)
    rows[:, 1:4] = 0.2 * rng.standard_normal((6000, 3))  # dps
    rows[:, 4:7] = (0.3, -0.2, 9.8) + 0.02 * rng.standard_normal((6000, 3))
    rows[:, 7:10] = (20.0, 5.0, -40.0) + 0.2 * rng.standard_normal((6000, 3))
    done = command("characterize", logs.write(tmp_path / "rest.csv", rows), "--no-report")
    assert done.status == 0, done.err
    done = command("run", log, "--filter", "mekf", "--sensor", "noise.toml", "--json")
    white = np.deg2rad(0.2) * np.sqrt(0.01)
    assert parameters(done)["gyr_noise"] == pytest.approx(white, rel=0.1)


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ("mpu6500", r"--sensor must be a preset \(.*\) or a noise file .*, got 'mpu6500'; the "),
        ("mpu6050,", r"--sensor must be a preset .* got ''"),
        ("absent.toml", r"absent\.toml"),
        ("log.csv", r"log\.csv: must be TOML"),
        ("star_tracker", r"--sensor star_tracker: `sensor` must state a noise that mekf takes"),
    ],
)
def test_wrong_sensors_are_named_before_the_log_is_read(command, log, sensor, message):
    done = command("run", log, "--filter", "mekf", "--sensor", sensor)
    assert done.status == 2
    assert re.search(message, done.line), done.line
    assert "reading" not in done.err


def test_calibration_file_is_not_a_noise_file(command, log, tmp_path):
    (tmp_path / "imu.toml").write_text('type = "strapdown calibration"\n')
    done = command("run", log, "--sensor", "imu.toml")
    assert done.status == 2
    assert "must begin with `type = 'strapdown noise'`" in done.line
    assert "characterize" in done.line


def test_filter_of_gains_says_that_it_takes_no_sensor(command, log):
    done = command("run", log, "--filter", "madgwick", "--sensor", "mpu6050")
    assert done.status == 2
    assert "madgwick has no noise parameter that a sensor could fill" in done.line
