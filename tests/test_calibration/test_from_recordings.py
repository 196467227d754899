"""What is taken from recordings: place, day, reference, and what is left out."""

import datetime as dt

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from truth import triads as truth
from truth.triads import DPS, TABLE_6_2, UT, G

from strapdown import calibration as cal
from strapdown import earth
from strapdown.calibration import from_recordings
from strapdown.calibration.place import Place
from strapdown.errors import InputError, MissingStream
from strapdown.recording import AttitudeReference, Encoder, Imu, Mag, Recording, Reference

PADOVA = (45.4165 * DPS, 11.8828 * DPS, 20.0)


def platform(seconds=60.0, valid=None, speed=1.0):
    """A platform turned about three axes, its true rates, and the reference attitude."""
    t = np.arange(round(seconds * 100)) / 100.0
    w = speed * np.array([0.7, 0.9, 0.5])
    rpy = np.radians([60.0, 40.0, 150.0]) * np.sin(np.outer(t, w) + [0, 1, 2])
    q_nb = Rotation.from_euler("ZYX", rpy[:, ::-1])
    # gyr[k] covers (t[k-1], t[k]]
    rate = (q_nb[:-1].inv() * q_nb[1:]).as_rotvec() * 100.0
    rate = np.vstack((rate[0], rate))
    attitude = AttitudeReference(t=t, q_nb=q_nb.as_quat(scalar_first=True), valid=valid)
    return t, q_nb, rate, Reference(attitude=attitude)


def test_gyro_and_reference_are_compared_over_windows_without_loss():
    t, q_nb, rate, reference = platform()
    raw = truth.distort(rate, TABLE_6_2)
    rec = Recording(imu=Imu(t=t, gyr=raw, acc=q_nb.inv().apply([0, 0, -G])), reference=reference)
    (record,) = from_recordings.gyroscope([rec]).records
    true = truth.directions(50)
    # Rotations of 0.1 rad do not quite commute: 1e-3 of a rate of 1 rad/s.
    assert_allclose(record.correct(truth.distort(true, TABLE_6_2)), true, atol=1e-3)
    assert record.method == "reference"


def test_windows_where_the_reference_is_not_valid_do_not_count():
    n = 6000
    valid = np.ones(n, dtype=bool)
    valid[2000:3500] = False
    t, q_nb, rate, reference = platform(valid=valid)
    raw = truth.distort(rate, TABLE_6_2)
    raw[100:110] = np.nan
    raw[2100:3400] += 5.0  # seen by nobody
    rec = Recording(imu=Imu(t=t, gyr=raw, acc=q_nb.inv().apply([0, 0, -G])), reference=reference)
    (record,) = from_recordings.gyroscope([rec]).records
    true = truth.directions(50)
    assert_allclose(record.correct(truth.distort(true, TABLE_6_2)), true, atol=1.5e-3)


def test_encoder_steps_of_a_reference_are_smoothed():
    t, q_nb, rate, _ = platform(25.0, speed=0.3)
    lsb = 0.09 * DPS
    rpy = np.round(q_nb.as_euler("ZYX")[:, ::-1] / lsb) * lsb
    stepped = Rotation.from_euler("ZYX", rpy[:, ::-1]).as_quat(scalar_first=True)
    rec = Recording(
        imu=Imu(t=t, gyr=truth.distort(rate, TABLE_6_2), acc=np.tile([0, 0, -G], (len(t), 1))),
        reference=Reference(attitude=AttitudeReference(t=t, q_nb=stepped)),
    )
    smooth = from_recordings.gyroscope([rec], resolution=lsb).records[0]
    stepwise = from_recordings.gyroscope([rec]).records[0]
    assert smooth.residual_rms < 0.1 * DPS
    assert smooth.residual_rms < 0.3 * stepwise.residual_rms


def test_magnetometer_against_the_field_of_the_place_and_day():
    t, q_nb, _, reference = platform()
    day = dt.date(2025, 3, 31)
    field_n = earth.magnetic_field(PADOVA, day).field_n
    soft = np.array([[1.1, 0.1, 0.0], [-0.05, 0.9, 0.02], [0.0, 0.02, 1.0]])
    hard = np.array([10.0, -20.0, 30.0]) * UT
    raw = q_nb.inv().apply(field_n) @ soft.T + hard
    rec = Recording(mag=Mag(t=t, mag=raw), reference=reference)
    outcome = from_recordings.magnetometer(
        [rec], method="reference", place=Place(lla=PADOVA, date=day)
    )
    (record,) = outcome.records
    assert_allclose(record.bias, hard, atol=1e-12)
    assert_allclose(record.matrix, np.linalg.inv(soft), atol=1e-7)
    assert record.date == day


def test_strength_of_the_field_comes_from_place_and_day():
    raw = 50 * UT * truth.directions(2000)
    rec = Recording(
        mag=Mag(t=np.arange(2000.0), mag=raw),
        meta={
            "lat_rad": PADOVA[0],
            "lon_rad": PADOVA[1],
            "height_m": PADOVA[2],
            "epoch_utc": "2025-03-31T10:00:00Z",
        },
    )
    outcome = from_recordings.magnetometer([rec])
    strength = np.linalg.norm(earth.magnetic_field(PADOVA, dt.date(2025, 3, 31)).field_n)
    assert outcome.records[0].reference == pytest.approx(strength, rel=1e-6)
    assert f"{strength / UT:.2f} uT" in outcome.notes[0]
    without = Recording(mag=rec.mag, meta={"lat_rad": PADOVA[0], "lon_rad": PADOVA[1]})
    assert "give it with `--date`" in from_recordings.magnetometer([without]).notes[0]


def test_gravity_is_that_of_the_place_or_the_standard_one_with_a_note():
    t, gyr, acc, _, _ = truth.hand_held_log(poses=15, duration=150.0)
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc))
    here = from_recordings.accelerometer([rec], place=Place(lla=PADOVA))
    assert here.records[0].reference == pytest.approx(9.80653, abs=1e-3)
    standard = from_recordings.accelerometer([rec])
    assert standard.records[0].reference == 9.80665
    assert "may be off by 0.3 %" in standard.notes[0]


def test_poses_of_several_logs_are_put_together():
    logs = []
    for seed in (0, 1):
        t, gyr, acc, _, _ = truth.hand_held_log(poses=10, duration=100.0, seed=seed)
        logs.append(Recording(imu=Imu(t=t, gyr=gyr, acc=acc)))
    outcome = from_recordings.accelerometer(logs, gravity=G)
    assert outcome.records[0].equations == 20
    assert "20 poses found in 200 s" in outcome.notes[0]


def test_accelerometer_against_a_reference_attitude_keeps_its_axes():
    rng = np.random.default_rng(0)
    # Level, holding every 10 s one of 12 attitudes, the platform's own angles known.
    t = np.arange(12_000) / 100.0
    angles = Rotation.random(12, random_state=1)
    hold = np.minimum((t / 10.0).astype(int), 11)
    q_nb = angles[hold]
    C = np.array([[1.01, 0.02, -0.01], [-0.03, 0.99, 0.0], [0.01, 0.0, 1.02]])  # turned and scaled
    moving = (t % 10.0 > 8.0)[:, np.newaxis]
    acc = q_nb.inv().apply([0, 0, -G]) @ C.T + 0.2 + 0.02 * rng.standard_normal((len(t), 3))
    acc = acc + 3.0 * moving * rng.standard_normal((len(t), 3))
    gyr = (1e-3 + 0.5 * moving) * rng.standard_normal((len(t), 3))
    reference = AttitudeReference(t=t, q_nb=q_nb.as_quat(scalar_first=True))
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), reference=Reference(attitude=reference))
    (record,) = from_recordings.accelerometer([rec], method="reference", gravity=G).records
    # Means of some 700 samples in 12 poses: 1e-3 / g per element.
    assert_allclose(record.matrix, np.linalg.inv(C), atol=4e-4)
    assert_allclose(record.bias, 0.2, atol=3e-3)


def test_rates_that_are_not_those_of_the_table_are_refused():
    rng = np.random.default_rng(0)
    t = np.arange(1000) / 100.0
    gyr = [0, 0, 200 * DPS] + 0.1 * DPS * rng.standard_normal((1000, 3))
    acc = [0, 0, -G] + 0.02 * rng.standard_normal((1000, 3))
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc))
    with pytest.raises(InputError, match=r"turns at 200 deg/s .* nearest rate .* is 100 deg/s"):
        from_recordings.gyroscope([rec], table_rates=[100 * DPS])
    with pytest.raises(InputError, match="rates must be known; give them with `--rates 200,270`"):
        from_recordings.gyroscope([rec], method="table")


def test_encoder_of_the_table_gives_the_rate():
    rng = np.random.default_rng(0)
    t = np.arange(1000) / 100.0
    logs = []
    for axis in np.vstack((np.eye(3), -np.eye(3), truth.directions(5))):
        gyr = 3.0 * axis + 1e-3 * rng.standard_normal((1000, 3))
        acc = -G * axis + 0.02 * rng.standard_normal((1000, 3))
        encoder = Encoder(t=t, angle=3.0 * t)
        logs.append(Recording(imu=Imu(t=t, gyr=gyr, acc=acc), encoder=encoder))
    (record,) = from_recordings.gyroscope(logs).records
    assert record.method == "multi-position"
    assert_allclose(record.matrix, np.eye(3), atol=1e-4)


def test_missing_references_are_named():
    t = np.arange(1000) / 100.0
    imu = Imu(t=t, gyr=np.zeros((1000, 3)), acc=np.tile([0, 0, -G], (1000, 1)))
    with pytest.raises(MissingStream, match="must have a reference attitude"):
        from_recordings.gyroscope([Recording(imu=imu)], method="reference")
    with pytest.raises(MissingStream, match="stream 'mag'"):
        from_recordings.magnetometer([Recording(imu=imu)])
    with pytest.raises(MissingStream, match="stream 'temperature'"):
        from_recordings.temperature(Recording(imu=imu))


def test_gyro_of_a_real_log_agrees_with_its_optical_reference(broad_02):
    import strapdown as sd

    rec = sd.read(broad_02)
    (record,) = from_recordings.gyroscope([rec]).records
    # A calibrated commercial sensor: scale within 1 %, axes within 0.5 deg, bias under 0.5 deg/s.
    assert record.verdict is cal.Verdict.WITHIN
    assert_allclose(np.diag(record.matrix), 1.0, atol=0.01)
    assert_allclose(record.matrix - np.diag(np.diag(record.matrix)), 0.0, atol=0.5 * DPS)
    assert np.abs(record.bias).max() < 0.5 * DPS
