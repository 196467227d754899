"""``strapdown calibrate``: from logs to a file that ``run`` applies."""

import json

import numpy as np
import pytest
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, UT, G

import strapdown as sd
from strapdown.recording import (
    AttitudeReference,
    Encoder,
    Imu,
    Mag,
    Recording,
    Reference,
    Temperature,
)


@pytest.fixture(scope="module")
def hand_held(tmp_path_factory):
    """Ten minutes with thirty poses held by hand, in a native file."""
    t, gyr, acc, mag, _ = truth.hand_held_log(
        mag_matrix=np.array([[1.05, 0.12, -0.04], [-0.03, 0.94, 0.1], [0.02, -0.06, 1.02]]),
        mag_bias=np.array([20.0, -10.0, 5.0]) * UT,
    )
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=acc),
        mag=Mag(t=t, mag=mag),
        temperature=Temperature(t=t[::100], temp_degc=np.full(len(t[::100]), 24.5)),
        meta={"sensor_id": "A7", "epoch_utc": "2025-03-31T10:00:00Z"},
    )
    path = tmp_path_factory.mktemp("logs") / "hand.parquet"
    sd.write(rec, path)
    return path


def turntable(encoder=False):
    rng = np.random.default_rng(0)
    axes = np.vstack((np.eye(3), -np.eye(3), truth.directions(3, 8)))
    pieces, accs, angle = [], [], [0.0]
    for axis in axes:
        for rate in (200 * DPS, 270 * DPS):
            pieces += [np.tile(rate * axis, (600, 1)), np.linspace(0.3, 1.0, 200)[:, None] * axis]
            accs.append(np.tile(-9.8 * axis, (800, 1)))
    true = np.vstack(pieces)
    t = np.arange(len(true)) / 100.0
    gyr = truth.distort(true, TABLE_6_2) + 0.3 * DPS * rng.standard_normal(true.shape)
    acc = np.vstack(accs) + 0.03 * rng.standard_normal(true.shape)
    angle = np.cumsum(np.linalg.norm(true, axis=1)) * 0.01
    return Recording(
        imu=Imu(t=t, gyr=gyr, acc=acc), encoder=Encoder(t=t, angle=angle) if encoder else None
    )


def test_acc_finds_the_poses_and_recovers_table_6_1(command, hand_held, tmp_path):
    done = command("calibrate", "acc", hand_held, "--gravity", G, "--json")
    assert done.status == 0, done.err
    assert "30 poses found in 600 s" in done.err
    summary = json.loads(done.out)
    (record,) = summary["records"]
    values = np.array([p["value"] for p in record["parameters"].values()])
    error = np.abs(values - TABLE_6_1)
    assert (error[:3] < 0.3 * MG).all()
    assert (error[3:] < 6e-4).all()
    assert record["verdict"] == "within"
    assert record["sensor_id"] == "A7"
    assert record["date"] == "2025-03-31"
    loaded = sd.calibration.load(tmp_path / "imu.toml").records["acc"]
    assert loaded.temp_degc == 24.5
    page = (tmp_path / "imu.acc.html").read_text()
    assert "Calibration: accelerometer" in page
    for title in ("theta_zx", "residual before", "map of equal areas", "by iteration"):
        assert title in page


def test_all_sensors_go_into_one_file_and_run_applies_it(command, hand_held, tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    sd.write(turntable(), logs / "table.parquet")
    for words in (
        ("acc", hand_held, "--at", "45.4,11.9,20"),
        ("gyro", logs / "table.parquet", "--rates", "200,270"),
        ("mag", hand_held),
    ):
        done = command("calibrate", *words, "--no-report", "-o", "my.toml")
        assert done.status == 0, done.err
    assert set(sd.calibration.load(tmp_path / "my.toml").records) == {"acc", "gyr", "mag"}
    assert not list(tmp_path.glob("*.html"))
    done = command(
        "run", hand_held, "--calibration", "my.toml", "--no-report", "--filter", "madgwick"
    )
    assert done.status == 0, done.err


def test_mag_is_turned_into_the_axes_of_the_accelerometer(command, hand_held, tmp_path):
    # The raw accelerometer, off by 2 deg, does not tell the axes; a calibrated one does.
    done = command("calibrate", "mag", hand_held, "--no-report")
    assert "Calibrate the accelerometer into the same file first" in done.err
    command("calibrate", "acc", hand_held, "--no-report")
    done = command("calibrate", "mag", hand_held, "--no-report")
    assert done.status == 0, done.err
    assert "into the accelerometer's axes" in done.err
    assert "inclination 65." in done.err
    soft = np.array([[1.05, 0.12, -0.04], [-0.03, 0.94, 0.1], [0.02, -0.06, 1.02]])
    record = sd.calibration.load(tmp_path / "imu.toml").records["mag"]
    assert np.linalg.norm(record.bias / UT - [20.0, -10.0, 5.0]) < 0.05
    u = truth.directions(200)
    c = record.correct(u @ soft.T * 48 * UT + np.array([20.0, -10.0, 5.0]) * UT)
    cosine = np.sum(c * u, axis=1) / np.linalg.norm(c, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.35


@pytest.mark.parametrize("encoder", [False, True])
def test_gyro_on_a_turntable_by_rates_or_by_its_encoder(command, tmp_path, encoder):
    sd.write(turntable(encoder), "table.parquet")
    rates = () if encoder else ("--rates", "200,270")
    done = command("calibrate", "gyro", "table.parquet", *rates, "--no-report", "--json")
    assert done.status == 0, done.err
    (record,) = json.loads(done.out)["records"]
    assert record["method"] == "multi-position"
    for value, p in zip(TABLE_6_2, record["parameters"].values(), strict=True):
        assert abs(p["value"] - value) < 4 * p["std"]


def test_gyro_against_a_reference_attitude(command, tmp_path):
    from scipy.spatial.transform import Rotation

    t = np.arange(6000) / 100.0
    rpy = np.radians([60.0, 40.0, 150.0]) * np.sin(np.outer(t, [0.7, 0.9, 0.5]) + [0, 1, 2])
    q = Rotation.from_euler("ZYX", rpy[:, ::-1])
    rate = np.vstack((np.zeros(3), (q[:-1].inv() * q[1:]).as_rotvec() * 100.0))
    noise = 0.1 * DPS * np.random.default_rng(0).standard_normal(rate.shape)
    gyr = truth.distort(rate, TABLE_6_2) + noise
    reference = AttitudeReference(t=t, q_nb=q.as_quat(scalar_first=True))
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=q.inv().apply([0, 0, -G])),
        reference=Reference(attitude=reference),
    )
    sd.write(rec, "ref.parquet")
    done = command("calibrate", "gyro", "ref.parquet", "--no-report")
    assert done.status == 0, done.err
    record = sd.calibration.load("imu.toml").records["gyr"]
    assert record.method == "reference"
    true = truth.directions(50)
    raw = truth.distort(true, TABLE_6_2)
    assert np.abs(record.correct(raw) - true).max() < 1e-3


def test_gyro_at_rest_gives_the_bias_though_the_log_has_a_reference(command, tmp_path):
    """A reference attitude that stands still tells no scale factors."""
    sd.write(sd.simulation.load("static").record(seed=3), "rest.parquet")
    done = command("calibrate", "gyro", "rest.parquet", "--no-report")
    assert done.status == 0, done.err
    assert "bias alone" in done.err
    done = command("calibrate", "gyro", "rest.parquet", "--method", "reference", "--no-report")
    assert done.status == 2
    assert "must excite all axes" in done.err


def test_gyro_at_rest_gives_the_bias_alone(command, tmp_path):
    rng = np.random.default_rng(0)
    bias = np.array([1.0, -3.9, 0.2]) * DPS
    t = np.arange(2000) / 100.0
    rec = Recording(
        imu=Imu(
            t=t,
            gyr=bias + 0.08 * DPS * rng.standard_normal((2000, 3)),
            acc=[0.0, 0.0, -G] + 0.03 * rng.standard_normal((2000, 3)),
        )
    )
    sd.write(rec, "rest.parquet")
    done = command("calibrate", "gyro", "rest.parquet", "--no-report")
    assert done.status == 0, done.err
    assert "bias alone" in done.err
    record = sd.calibration.load("imu.toml").records["gyr"]
    np.testing.assert_allclose(record.bias, bias, atol=4 * 0.08 * DPS / np.sqrt(2000))
    np.testing.assert_array_equal(record.matrix, np.eye(3))


def warm_log(moving=False):
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 300.0, 0.05)
    T = 20.0 + t / 15.0
    swing = (np.abs(t - 150.0) < 5.0)[:, np.newaxis] * moving * np.sin(np.outer(t, [5, 6, 7]))
    gyr = np.outer(T, [1e-4, 3e-4, 0.0]) + 1e-3 * rng.standard_normal((len(t), 3)) + swing
    acc = [0.0, 0.0, -G] + 0.03 * rng.standard_normal((len(t), 3)) + 3 * swing
    return Recording(
        imu=Imu(t=t, gyr=gyr, acc=acc), temperature=Temperature(t=t[::20], temp_degc=T[::20])
    )


def test_temperature_gives_slopes_of_both_sensors(command, tmp_path):
    sd.write(warm_log(), "warm.parquet")
    done = command("calibrate", "temperature", "warm.parquet")
    assert done.status == 0, done.err
    found = sd.calibration.load("imu.toml").temperatures
    np.testing.assert_allclose(found["gyr"].slope, [1e-4, 3e-4, 0.0], atol=1e-5)
    np.testing.assert_allclose(found["acc"].slope, 0.0, atol=3e-4)
    assert (tmp_path / "imu.temperature.html").exists()


def test_moving_log_is_refused_with_the_time_span(command):
    sd.write(warm_log(moving=True), "warm.parquet")
    done = command("calibrate", "temperature", "warm.parquet")
    assert done.status == 2
    assert "must have a log at rest, it moves from 144." in done.line
    assert "s to 155." in done.line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("acc", "{log}", "--at", "95,11"), "--at must be degrees, latitude first"),
        (("acc", "{log}", "--at", "somewhere"), "--at must be numbers with commas"),
        (("acc", "{log}", "--at", "1"), "--at must be latitude,longitude[,height]"),
        (("acc", "{log}", "--date", "monday"), "--date must be a day such as 2025-03-31"),
        (("acc", "{log}", "--tolerance", "s=big"), "--tolerance s must be a number"),
        (("acc", "{log}", "--method", "magic"), "`method` must be one of poses, six"),
        (("acc", "{log}", "--to", "60"), "unknowns, got "),
        (("acc", "{log}", "--method", "six"), "six-position calibration must have every pose"),
        (("acc", "{log}", "--method", "reference"), "must have a reference attitude"),
        (("mag", "{log}", "--method", "reference"), "needs the field of the place"),
        (("mag", "{log}", "--to", "8"), "% of its radius, as they do in one pose"),
        (("gyro", "{log}", "--rates", "200"), "steady rotation or rest for a second"),
        (("temperature", "{log}", "{log}"), "takes one log"),
        (("acc", "{log}", "-o", "bad.toml"), "bad.toml: must begin with `type ="),
        (("acc",), "there is no log to read"),
    ],
)
def test_bad_input_ends_with_one_line_and_status_2(command, hand_held, tmp_path, words, message):
    (tmp_path / "bad.toml").write_text("a = 1\n")
    done = command("calibrate", *(w.format(log=hand_held) for w in words))
    assert done.status == 2, done.err
    assert message in done.line
    assert done.out == ""
    assert {p.name for p in tmp_path.iterdir()} == {"bad.toml"}


def test_without_a_sensor_it_shows_what_there_is(command):
    done = command("calibrate")
    assert done.status == 0
    for name in ("acc", "gyro", "mag", "temperature"):
        assert name in done.out
