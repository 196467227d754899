"""What the doctor says of whole logs: sound ones, spoilt ones, and those that cannot be read."""

from dataclasses import replace

import numpy as np
import pytest
from test_doctor.faults import remedy, signed_permutations, spoilt

import strapdown as sd
from strapdown import doctor, io
from strapdown.recording import Imu, Mag, Recording

DEG = np.pi / 180.0
G = 9.81
FIELD_N = np.array([18.6e-6, 1.6e-6, 46.4e-6])  # Berlin


def tumbling(duration=120.0, rate=100.0, bias=0.0):
    """A box that tumbles about all axes, exact but for white noise, by small rotations in NED."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(7)
    n = int(duration * rate)
    t = np.arange(n) / rate
    omega = np.column_stack(
        (0.9 * np.sin(0.7 * t), 0.7 * np.cos(0.45 * t + 1.0), 0.8 * np.sin(0.31 * t + 2.0))
    )
    C_nb = np.empty((n, 3, 3))
    here = Rotation.identity()
    for k in range(n):
        here = here * Rotation.from_rotvec(omega[k] / rate)
        C_nb[k] = here.as_matrix()
    acc = np.einsum("kji,j->ki", C_nb, [0.0, 0.0, -G])
    mag = np.einsum("kji,j->ki", C_nb, FIELD_N)
    imu = Imu(
        t=t,
        gyr=omega + bias + 1e-3 * rng.standard_normal((n, 3)),
        acc=acc + 0.02 * rng.standard_normal((n, 3)),
    )
    return Recording(imu=imu, mag=Mag(t=t, mag=mag + 2e-7 * rng.standard_normal((n, 3))))


@pytest.fixture(scope="module")
def box():
    return tumbling()


def by_check(rec, check, **options):
    return [f for f in doctor.examine(rec, **options) if f.check == check]


def alarms(source, **options):
    return [str(f) for f in doctor.examine(source, **options) if f.is_alarm]


def changed_imu(rec, **fields):
    return replace(rec, imu=replace(rec.imu, **fields))


def test_sound_log_has_no_alarm(box):
    assert alarms(box) == []


@pytest.mark.parametrize(
    "name", sorted(set(sd.simulation.names()) - {"static_4h", "servo"})
)  # the servo's accelerometer, of a thesis without noise figures, shows one number all the time
def test_shipped_scenario_has_no_alarm(name):
    log = sd.simulation.load(name).record(seed=11)
    assert alarms(log) == []
    part = log.between(0.25 * log.imu.t[-1], 0.9 * log.imu.t[-1])
    assert alarms(part) == []
    assert alarms(replace(part, gnss=None)) == []


def test_gravest_finding_comes_first(box):
    findings = doctor.examine(spoilt(box, "acc", 1.0 / G))
    ranks = [f.severity.rank for f in findings]
    assert ranks == sorted(ranks, reverse=True)
    assert findings[0].severity == "error"


def test_all_gyroscope_faults_of_a_simulated_box_are_named(box):
    for S in signed_permutations()[1:]:
        (finding,) = by_check(spoilt(box, "gyr", S), "axes")
        assert finding.severity == "error"
        assert f"--axes {remedy('gyr', S)}." in finding.advice


def test_without_magnetometer_a_turned_pair_is_reported_with_every_reading(box):
    S = signed_permutations()[9]
    S = S * np.linalg.det(S)
    (finding,) = by_check(replace(spoilt(box, "gyr", S), mag=None), "axes")
    assert finding.severity == "error"
    assert "disagree" in finding.sentence
    # the gyroscope turned one way is the accelerometer turned the other
    for option in (remedy("gyr", S), remedy("acc", S.T), remedy("acc", -S.T)):
        assert f"--axes {option}" in finding.advice


def test_two_wrong_sensors_are_not_accepted(box):
    spoilt_twice = spoilt(
        spoilt(box, "gyr", signed_permutations()[10]), "mag", np.diag([1, -1, 1])
    )
    (finding,) = by_check(spoilt_twice, "axes")
    assert finding.severity == "error"
    assert "No two" in finding.sentence


@pytest.mark.parametrize(("sensor", "where"), [("acc", {"up": "-z"}), ("mag", {})])
def test_sign_of_a_field_is_settled_by_place(box, sensor, where):
    opposite = spoilt(box, sensor, -1.0)
    assert by_check(opposite, "sign") == []  # turning alone cannot see it
    (finding,) = by_check(opposite, "sign", place=(52.5 * DEG, 13.3 * DEG, 50.0))
    assert finding.severity == "error"
    assert f"--axes {sensor}=-x,-y,-z" in finding.advice
    assert by_check(box, "sign", place=(52.5 * DEG, 13.3 * DEG, 50.0)) == []
    # on the other hemisphere the field points up
    assert by_check(box, "sign", place=(-52.5 * DEG, -13.3 * DEG, 50.0)) != []


def test_sign_of_gravity_is_settled_by_what_is_up(box):
    assert [f.severity for f in by_check(box, "sign", up="-z")] == ["ok"]
    (finding,) = by_check(spoilt(box, "acc", -1.0), "sign", up="-z")
    assert finding.severity == "error"
    assert "--axes acc=-x,-y,-z" in finding.advice
    (finding,) = by_check(box, "sign", up="x")
    assert "another axis" in finding.sentence


def test_z_up_is_a_note(box):
    turned = spoilt(spoilt(spoilt(box, "acc", np.diag([1, -1, -1])), "gyr", np.diag([1, -1, -1])),
                    "mag", np.diag([1, -1, -1]))  # fmt: skip
    assert alarms(turned) == []
    (finding,) = by_check(turned, "up")
    assert finding.severity == "note"
    assert "z-up" in finding.sentence


def test_gyroscope_of_slow_log_in_degrees_is_found_by_physics_alone(box):
    # a third of a degree per second, in deg/s, is a rate that any sensor may show in rad/s
    slow = replace(box, imu=replace(box.imu, t=10.0 * box.imu.t, gyr=0.1 * box.imu.gyr))
    slow = replace(slow, mag=replace(slow.mag, t=10.0 * slow.mag.t))
    wrong = spoilt(slow, "gyr", 1.0 / DEG)
    assert np.linalg.norm(wrong.imu.gyr, axis=1).max() < 36.0  # [rad/s]
    (finding,) = [f for f in by_check(wrong, "units") if f.stream == "gyr"]
    assert finding.severity == "error"
    assert "--units gyr=dps" in finding.advice
    assert alarms(slow) == []


def test_log_at_rest_claims_nothing_of_axes():
    rng = np.random.default_rng(3)
    n = 6000
    rest = sd.from_arrays(
        np.arange(n) / 100.0,
        1e-3 * rng.standard_normal((n, 3)),
        np.array([0.0, 0.0, -G]) + 0.01 * rng.standard_normal((n, 3)),
        FIELD_N + 2e-7 * rng.standard_normal((n, 3)),
    )
    axes = by_check(rest, "axes")
    assert {f.severity.value for f in axes} == {"note"}
    assert all("not observable from this motion" in f.sentence for f in axes)
    assert "too little" in by_check(rest, "motion")[0].sentence
    assert by_check(rest, "bias")[0].severity == "ok"


def test_linear_acceleration_is_no_specific_force(box):
    rng = np.random.default_rng(4)
    (finding,) = [
        f
        for f in by_check(changed_imu(box, acc=rng.normal(0.0, 0.7, box.imu.acc.shape)), "units")
        if f.stream == "acc"
    ]
    assert "no gravity" in finding.sentence


def test_uncalibrated_magnetometer_is_found(box):
    rec = replace(box, mag=replace(box.mag, mag=box.mag.mag + [60e-6, -30e-6, 20e-6]))
    (finding,) = by_check(rec, "calibration")
    assert finding.severity == "warning"
    assert "not calibrated" in finding.sentence


def test_bias_of_a_resting_gyroscope_is_reported():
    rng = np.random.default_rng(5)
    n = 3000
    gyr = np.array([0.0, 8.0, 0.0]) * DEG + 1e-3 * rng.standard_normal((n, 3))
    acc = np.array([0.0, 0.0, -G]) + 0.01 * rng.standard_normal((n, 3))
    (finding,) = by_check(sd.from_arrays(np.arange(n) / 100.0, gyr, acc), "bias")
    assert finding.severity == "warning"
    assert "8.0" in finding.sentence


def test_stuck_axis_is_found(box):
    gyr = box.imu.gyr.copy()
    gyr[3000:4000, 1] = gyr[3000, 1]
    (finding,) = by_check(changed_imu(box, gyr=gyr), "stuck")
    assert finding.severity == "error"
    assert finding.sentence == "Axis y of the gyroscope stands still for 9.99 s from 30 s on."


def test_saturated_axis_is_found(box):
    gyr = np.clip(box.imu.gyr, -0.65, 0.65)
    (finding,) = by_check(changed_imu(box, gyr=gyr), "clipped")
    assert finding.severity == "warning"
    assert finding.stream == "gyr"
    assert by_check(box, "clipped") == []


def test_samples_that_are_only_held_are_found_and_are_not_clipping(box):
    held = np.repeat(box.mag.mag[::4], 4, axis=0)
    rec = replace(box, mag=replace(box.mag, mag=held))
    (finding,) = by_check(rec, "held")
    assert "about 25 Hz and logged at 100 Hz" in finding.sentence
    assert by_check(rec, "clipped") == []


def test_heavy_low_pass_is_found(box):
    from scipy.signal import butter, sosfilt

    sos = butter(4, 3.0, fs=100.0, output="sos")
    acc = sosfilt(sos, box.imu.acc, axis=0)
    rng = np.random.default_rng(6)
    noisy = sosfilt(sos, acc + 0.3 * rng.standard_normal(acc.shape), axis=0)
    (finding,) = by_check(changed_imu(box, acc=noisy), "filtered")
    assert finding.severity == "note"
    assert by_check(box, "filtered") == []


def test_lost_samples_are_counted(box):
    keep = np.ones(len(box.imu), np.bool_)
    keep[2000:3000] = False
    rec = Recording(imu=box.imu.rows(keep))
    (finding,) = [f for f in by_check(rec, "time") if f.stream == "gyr"]
    assert finding.severity == "warning"
    assert "1 gap, the longest 10 s" in finding.sentence
    assert by_check(rec, "axes")[0].severity == "ok"  # the gap is no rotation


def test_missing_numbers_are_counted_and_skipped(box):
    gyr = box.imu.gyr.copy()
    gyr[500:520] = np.nan
    rec = changed_imu(box, gyr=gyr)
    assert by_check(rec, "missing")[0].sentence.startswith("20 samples (0.17 %) of the gyroscope")
    assert by_check(rec, "axes")[0].severity == "ok"


def test_axis_and_place_are_checked(box):
    with pytest.raises(ValueError, match="`up` must be one of x, -x, y"):
        doctor.examine(box, up="up")
    with pytest.raises(ValueError, match=r"`place\[0\]` must lie in"):
        doctor.examine(box, place=(52.5, 13.3))


def csv_of(rec, path, header, columns, rows=None):
    table = np.column_stack(columns)
    np.savetxt(path, table if rows is None else table[rows], delimiter=",", header=header,
               comments="", fmt="%.9g")  # fmt: skip
    return path


HEADER = "t_s,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z"


def test_log_that_read_refuses_is_diagnosed_raw(box, tmp_path):
    # two rows exchanged, and gravity in g: `read` refuses both
    rows = np.arange(len(box.imu))
    rows[[700, 701]] = rows[[701, 700]]
    columns = (box.imu.t, box.imu.gyr, box.imu.acc / 9.80665)
    path = csv_of(box, tmp_path / "log.csv", HEADER, columns, rows)
    with pytest.raises(sd.errors.FormatError):
        sd.read(path)
    findings = doctor.examine(io.read_raw(path))
    text = " ".join(str(f) for f in findings if f.is_alarm)
    assert "1 of 12000 times steps back, first in sample 701" in text
    assert "--units acc=g" in text
    assert any(f.check == "axes" and f.severity == "ok" for f in findings)


def test_raw_log_and_recording_say_the_same(broad_02):
    whole, raw = sd.read(broad_02), io.read_raw(broad_02)
    for check in ("units", "axes", "time", "calibration"):
        assert [str(f) for f in by_check(whole, check)] == [str(f) for f in by_check(raw, check)]


def test_reference_is_not_looked_at(broad_02):
    rec = sd.read(broad_02)
    assert doctor.examine(rec) == doctor.examine(replace(rec, reference=None))
