"""Every check of the doctor fires on the fault that it is for, and not on the sound log."""

from dataclasses import replace

import numpy as np
import pytest
from test_doctor.test_examine import DEG, FIELD_N, G, by_check, changed_imu, csv_of, tumbling

import strapdown as sd
from strapdown import doctor, io
from strapdown.recording import Imu, Mag, Recording

BERLIN = (52.5 * DEG, 13.3 * DEG, 50.0)


@pytest.fixture(scope="module")
def box():
    return tumbling()


def only(rec, check, **options):
    (finding,) = by_check(rec, check, **options)
    return finding


# --- vibration ----------------------------------------------------------------------------


@pytest.mark.parametrize(("sensor", "size"), [("acc", 6.0), ("gyr", 60.0 * DEG)])
def test_vibration_up_to_half_the_rate_is_reported_as_aliasing(box, sensor, size):
    """A motor that is on for a part of the log, at 1030 Hz, seen at 100 Hz; and broad noise."""
    rng = np.random.default_rng(1)
    on = box.imu.t > 60.0
    shaken = getattr(box.imu, sensor) + on[:, None] * size * rng.standard_normal((len(on), 3))
    finding = only(changed_imu(box, **{sensor: shaken}), "aliasing")
    assert finding.severity == "note"
    assert finding.stream == sensor
    assert "up to half its rate of 100 Hz" in finding.sentence
    assert by_check(box, "aliasing") == []


def test_vibration_that_dies_out_below_half_the_rate_is_not(box):
    from scipy.signal import butter, sosfilt

    rng = np.random.default_rng(2)
    low = sosfilt(
        butter(6, 20.0, fs=100.0, output="sos"), rng.standard_normal((12_000, 3)), axis=0
    )
    on = (box.imu.t > 60.0)[:, None]
    assert by_check(changed_imu(box, acc=box.imu.acc + 20.0 * on * low), "aliasing") == []


# --- the field against the model ------------------------------------------------------------


def with_field(box, turn):
    """The same motion in a field of another size and dip."""
    down_b = -box.imu.acc / np.linalg.norm(box.imu.acc, axis=1, keepdims=True)
    m = box.mag.mag
    vertical = (m * down_b).sum(axis=1, keepdims=True)
    level = m - vertical * down_b
    factor, dip = turn
    size = np.linalg.norm(FIELD_N)
    level *= size * np.cos(dip) / np.linalg.norm(level, axis=1, keepdims=True)
    return replace(box, mag=Mag(t=box.mag.t, mag=factor * (level + size * np.sin(dip) * down_b)))


def test_field_of_another_inclination_is_reported(box):
    dip = np.arctan2(FIELD_N[2], np.hypot(*FIELD_N[:2]))
    assert only(box, "dip", place=BERLIN).severity == "ok"
    steel = with_field(box, (1.0, dip - 35.0 * DEG))
    finding = only(steel, "dip", place=BERLIN)
    assert finding.severity == "warning"
    assert f"inclined by {dip / DEG - 35.0:.0f}°" in finding.sentence
    assert "says 68° here" in finding.sentence
    assert only(with_field(box, (1.0, dip - 10.0 * DEG)), "dip", place=BERLIN).severity == "ok"


def test_dip_without_a_place_says_that_signs_cannot_be_told(box):
    finding = only(box, "dip")
    assert finding.severity == "ok"
    assert "the place is not known, so the signs cannot be told" in finding.sentence
    assert "northern" in finding.sentence


@pytest.mark.parametrize("factor", [0.6, 1.4])
def test_field_of_another_strength_is_reported(box, factor):
    weak = replace(box, mag=replace(box.mag, mag=factor * box.mag.mag))
    finding = only(weak, "strength", place=BERLIN)
    assert finding.severity == "warning"
    size = factor * np.linalg.norm(FIELD_N) * 1e6
    assert f"The field's strength is {size:.1f} µT, the model says 50.0." in finding.sentence
    assert by_check(box, "strength", place=BERLIN) == []
    assert by_check(weak, "strength") == []  # nowhere in particular


# --- units ----------------------------------------------------------------------------------

HEADERS = {unit: ",".join(["t_s", *(f"gyr_{a}_rad_s" for a in "xyz"),
           *(f"acc_{a}_{unit}" for a in "xyz")]) for unit in ("mg", "cm_s2")}  # fmt: skip
PER = {"mg": 1000.0 / 9.80665, "cm_s2": 100.0}


def acc_file(box, path, stated, true, scale=1.0):
    acc = scale * PER[true] * box.imu.acc
    return csv_of(box, path, HEADERS[stated], (box.imu.t, box.imu.gyr, acc))


@pytest.mark.parametrize(("stated", "true"), [("mg", "cm_s2"), ("cm_s2", "mg")])
def test_milli_g_and_cm_per_square_second_are_both_read_out(box, tmp_path, stated, true):
    """They differ by 2 %: which it is, only a scale known to better than that can say."""
    right = sd.read(acc_file(box, tmp_path / "right.csv", stated, stated))
    wrong = sd.read(acc_file(box, tmp_path / "wrong.csv", stated, true))
    for source, severity in ((right, "ok"), (wrong, "ok")):
        # a recording no longer knows its units
        found = [f for f in by_check(source, "units") if f.stream == "acc"]
        assert [f.severity for f in found] == [severity]
    for true_unit, severity in ((stated, "ok"), (true, "note")):
        raw = io.read_raw(acc_file(box, tmp_path / "raw.csv", stated, true_unit))
        (finding,) = [f for f in by_check(raw, "units") if f.stream == "acc"]
        assert finding.severity == severity
        symbols = {"mg": "mg", "cm_s2": "cm/s²"}
        assert f"read in {symbols[true]} instead of {symbols[stated]}" in finding.sentence
        assert (f"--units acc={true}" in finding.advice) == (severity == "note")


def test_columns_without_unit_are_offered_both(box, tmp_path):
    header = HEADERS["mg"].replace("_mg", "").replace("_rad_s", "")
    for true, first in (("mg", "acc=mg"), ("cm_s2", "acc=cm_s2")):
        path = csv_of(box, tmp_path / "a.csv", header,
                      (box.imu.t, box.imu.gyr, PER[true] * box.imu.acc))  # fmt: skip
        with pytest.raises(sd.errors.FormatError, match=rf"--units {first} .*, or acc="):
            sd.read(path)
        found = [f for f in by_check(io.read_raw(path), "units") if f.stream == "acc"]
        assert "--units acc=mg or --units acc=cm_s2" in found[0].advice


@pytest.mark.parametrize(
    ("factor", "severity", "words"),
    [(2.0, "error", "a factor of 2"), (0.5, "error", "a factor of 0.5"),
     (1.5, "warning", "no unit explains it")],
)  # fmt: skip
def test_wrong_range_or_scale_of_the_accelerometer_is_found(box, factor, severity, words):
    found = by_check(changed_imu(box, acc=factor * box.imu.acc), "units")
    (finding,) = [f for f in found if f.stream == "acc"]
    assert finding.severity == severity
    assert words in finding.sentence


def test_accelerometer_that_is_never_calm_is_not_accused_of_its_scale(box, data_dir):
    """Waved about for 40 s, no window shows gravity alone: its norm is 7 m/s^2 in the calmest."""
    waved = sd.read(data_dir / "broad" / "16_undisturbed_fast_translation_B.mat").between(101, 141)
    for rec, severity in (
        (waved, "note"),
        (changed_imu(box, acc=0.7 * box.imu.acc), "warning"),
    ):
        (finding,) = [f for f in by_check(rec, "units") if f.stream == "acc"]
        assert finding.severity == severity


def test_rates_beyond_any_sensor_are_found_where_nothing_else_tells():
    rng = np.random.default_rng(3)
    gyr = 60.0 * rng.standard_normal((3000, 3))
    rec = Recording(imu=Imu(t=np.arange(3000) / 100.0, gyr=gyr, acc=np.full((3000, 3), np.nan)))
    (finding,) = [f for f in by_check(rec, "units") if f.stream == "gyr"]
    assert finding.severity == "error"
    assert "more than such sensors measure" in finding.sentence


@pytest.mark.parametrize(
    ("factor", "severity", "words"),
    [(2.2, "note", "though the Earth's field is 22 to 67"), (4.0, "warning", "no unit explains")],
)
def test_field_that_is_not_the_earths_is_found(box, factor, severity, words):
    found = by_check(replace(box, mag=replace(box.mag, mag=factor * box.mag.mag)), "units")
    (finding,) = [f for f in found if f.stream == "mag"]
    assert finding.severity == severity
    assert words in finding.sentence


# --- motion, attitude, health -----------------------------------------------------------------


def turntable(rate=0.5, **others):
    """A box that turns about its z axis alone."""
    t = np.arange(6000) / 100.0
    rng = np.random.default_rng(4)
    gyr = np.zeros((6000, 3)) + [0.0, 0.0, rate]
    acc = np.zeros((6000, 3)) + others.get("up", [0.0, 0.0, -G])
    angle = rate * t
    mag = np.column_stack((20e-6 * np.cos(angle), -20e-6 * np.sin(angle), 0.0 * t + 43e-6))
    noise = [s * rng.standard_normal((6000, 3)) for s in (1e-3, 0.02, 2e-7)]
    return sd.from_arrays(t, gyr + noise[0], acc + noise[1], mag + noise[2])


def test_turning_about_one_axis_is_said_to_be_too_little():
    finding = only(turntable(), "motion")
    assert finding.severity == "note"
    assert "nearly all about one axis" in finding.sentence


def test_iron_cannot_be_told_from_turning_about_one_axis():
    rec = turntable()
    near = replace(rec, mag=replace(rec.mag, mag=rec.mag.mag + [15e-6, 0.0, 0.0]))
    finding = only(near, "calibration")
    assert finding.severity == "note"
    assert "not turned enough" in finding.sentence
    assert by_check(rec, "calibration") == []


@pytest.mark.parametrize(
    ("up", "severity", "words"),
    [
        ([0.0, 0.0, -G], "ok", "z axis points down"),
        ([0.0, G, 0.0], "note", "stands on its side: its y axis points up"),
        ([-G, 0.0, 0.0], "note", "stands on its side: its -x axis points up"),
        ([G / 3**0.5, -G / 3**0.5, G / 3**0.5], "note", "lies askew"),
    ],
)
def test_what_points_up_is_said(up, severity, words):
    finding = only(turntable(up=up), "up")
    assert finding.severity == severity
    assert words in finding.sentence


def test_sensor_that_repeats_one_sample_is_stuck(box):
    mag = box.mag.mag.copy()
    mag[5000:] = mag[5000]
    finding = only(replace(box, mag=replace(box.mag, mag=mag)), "stuck")
    assert finding.severity == "error"
    assert finding.sentence.startswith("The magnetometer repeats the same sample for 70")


@pytest.mark.parametrize(("sign", "word"), [(1.0, "the same"), (-1.0, "opposite")])
def test_axes_that_are_one_are_found(box, sign, word):
    acc = box.imu.acc.copy()
    acc[:, 2] = sign * acc[:, 0]
    finding = only(changed_imu(box, acc=acc), "copied")
    assert finding.severity == "error"
    assert finding.sentence == f"Axes x and z of the accelerometer are {word} in all samples."
    assert by_check(box, "copied") == []


def test_field_that_no_axes_explain_is_reported(box):
    """Clocks that differ by three seconds, while the box turns by tens of degrees per second."""
    late = replace(box, mag=box.mag.shifted(3.0))
    (finding,) = [f for f in by_check(late, "axes") if f.stream == "mag"]
    assert finding.severity == "warning"
    assert "does not explain how the magnetic field turns in the magnetometer" in finding.sentence


@pytest.mark.parametrize(("bias", "severity"), [(0.5, "ok"), (2.0, "note"), (6.0, "warning")])
def test_bias_is_weighed_by_its_size(bias, severity):
    rest = turntable(rate=0.0)
    rest = changed_imu(rest, gyr=rest.imu.gyr + [0.0, 0.0, bias * DEG])
    assert only(rest, "bias").severity == severity
    # a field that turns with the rates says that they are no bias
    assert by_check(turntable(rate=6.0 * DEG), "bias") == []


def test_box_that_repeats_a_sample_while_it_rests_is_no_stuck_sensor(box):
    """A coarse accelerometer shows one number at rest; the same in motion is a fault."""
    rest = turntable(rate=0.0)
    for rec, severity in ((rest, "note"), (box, "error")):
        acc = rec.imu.acc.copy()
        acc[2000:3000] = acc[2000]
        finding = only(changed_imu(rec, acc=acc), "stuck")
        assert finding.severity == severity
        assert ("while the box rests" in finding.sentence) == (severity == "note")


def test_magnetometer_that_was_not_turned_is_not_called_uncalibrated():
    assert by_check(turntable(rate=0.0), "calibration") == []


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_turning_about_the_vertical_says_nothing_of_the_gyroscopes_scale(scale):
    """Gravity stands still in the box, so no rate is needed to explain it: any scale will do."""
    table = replace(turntable(rate=200.0 * DEG), mag=None)
    crooked = table.imu.gyr + 0.03 * table.imu.gyr[:, [2, 0, 1]]  # axes off by 2 deg
    found = by_check(changed_imu(table, gyr=scale * crooked), "units")
    assert [f.stream for f in found if f.severity != "ok"] == []
    axes = only(changed_imu(table, gyr=scale * crooked), "axes")
    assert axes.severity == "note"


def test_samples_of_no_noise_are_called_so_and_nothing_else():
    """Coning: the specific force along the cone's axis is one number, and no sensor is stuck."""
    t = np.arange(12_000) / 200.0
    a = 2.0 * np.pi * 10.0 * t
    gyr = np.column_stack((1.1 * np.cos(a), 1.1 * np.sin(a), 0.0 * t))
    acc = np.column_stack((0.17 * np.sin(a), -0.17 * np.cos(a), 0.0 * t - 9.805))
    rec = sd.from_arrays(t, gyr, acc)
    assert only(rec, "noise").severity == "note"
    assert [f for f in doctor.examine(rec) if f.is_alarm] == []
    assert by_check(rec, "filtered") == []


def test_peak_of_a_coarse_sensor_is_no_saturation():
    """A slow swing stays on its highest count for a while; one that is cut off stays longer."""
    t = np.arange(6000) / 100.0
    swing = np.round(400.0 * np.sin(0.6 * t)) / 200.0
    gyr = np.column_stack((swing, 0.3 * swing + 0.001 * t, 0.001 * t))
    rec = sd.from_arrays(t, gyr, np.zeros((6000, 3)) + [0.0, 0.0, -G])
    assert by_check(rec, "clipped") == []
    cut = changed_imu(rec, gyr=np.clip(rec.imu.gyr, -1.8, 1.8))
    assert only(cut, "clipped").stream == "gyr"


def test_lost_samples_of_a_log_with_fixes_are_no_crash(parking_lot):
    """The course counts by time, the samples by number: they must meet."""
    rec = sd.read(parking_lot)
    keep = np.flatnonzero(np.arange(len(rec.imu)) % 12 != 5)
    rec = replace(rec, imu=rec.imu.rows(keep))
    assert [f for f in doctor.examine(rec) if f.check == "axes" and f.is_alarm] == []


# --- logs as users bring them: no crash, and nothing accepted silently -----------------------


def swapped(box, rng):
    acc = np.roll(box.imu.acc, 1, axis=1)
    return changed_imu(box, acc=acc)


def gyr_and_acc_exchanged(box, rng):
    return changed_imu(box, gyr=box.imu.acc, acc=box.imu.gyr)


def acc_and_mag_exchanged(box, rng):
    return replace(
        box, imu=replace(box.imu, acc=box.mag.mag), mag=Mag(t=box.mag.t, mag=box.imu.acc)
    )


def constant_channel(box, rng):
    gyr = box.imu.gyr.copy()
    gyr[:, rng.integers(3)] = rng.choice([0.0, 1.0, -3.5])
    return changed_imu(box, gyr=gyr)


def constant_axis_of_the_field(box, rng):
    mag = box.mag.mag.copy()
    mag[:, rng.integers(3)] = 1e-5
    return replace(box, mag=replace(box.mag, mag=mag))


def doubled_column(box, rng):
    acc = box.imu.acc.copy()
    acc[:, 1] = acc[:, 0]
    return changed_imu(box, acc=acc)


def column_of_nan(box, rng):
    gyr = box.imu.gyr.copy()
    gyr[:, 2] = np.nan
    return changed_imu(box, gyr=gyr)


def late_magnetometer(box, rng):
    return replace(box, mag=box.mag.shifted(3.0))


def reversed_rows(box, rng):
    return changed_imu(box, gyr=box.imu.gyr[::-1].copy())


FAULTS = (
    swapped, gyr_and_acc_exchanged, acc_and_mag_exchanged, constant_channel,
    constant_axis_of_the_field, doubled_column, column_of_nan, late_magnetometer, reversed_rows,
)  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("seed", range(3))
def test_spoilt_log_raises_an_alarm(box, fault, seed):
    findings = doctor.examine(fault(box, np.random.default_rng(seed)))
    assert any(f.is_alarm for f in findings), [str(f) for f in findings]
    assert all(0.0 <= f.confidence <= 1.0 and f.sentence.endswith((".", "?")) for f in findings)


@pytest.mark.parametrize("drop", range(1, 7))
def test_file_with_a_missing_column_is_refused_or_diagnosed(box, tmp_path, drop):
    names = ["t_s", *(f"gyr_{a}_rad_s" for a in "xyz"), *(f"acc_{a}_m_s2" for a in "xyz")]
    columns = np.column_stack((box.imu.t, box.imu.gyr, box.imu.acc))
    keep = [k for k in range(7) if k != drop]
    path = csv_of(box, tmp_path / "a.csv", ",".join(names[k] for k in keep), (columns[:, keep],))
    with pytest.raises(sd.errors.InputError, match=names[drop][:5]):
        sd.read(path)
    findings = doctor.examine(io.read_raw(path))
    assert any(f.check == "reading" and f.is_alarm for f in findings)


@pytest.mark.parametrize("seed", range(20))
def test_any_mixture_of_faults_is_examined_without_a_crash(box, seed):
    """Random rows lost, repeated, of no number; random channels scaled, swapped and frozen."""
    rng = np.random.default_rng(seed)
    rec = box.between(0.0, float(rng.uniform(0.05, 60.0)))
    for fault in rng.choice(len(FAULTS), 2):
        if len(rec.imu) > 1:
            rec = FAULTS[fault](rec, rng)
    n = len(rec.imu)
    rows = np.flatnonzero(rng.random(n) > rng.choice([0.0, 0.3, 0.99]))
    gyr, acc = rec.imu.gyr.copy(), rec.imu.acc.copy()
    gyr[rng.random(n) < 0.2] = np.nan
    acc *= 10.0 ** rng.uniform(-4, 4)
    imu = replace(rec.imu, gyr=gyr, acc=acc).rows(rows)
    mag = rng.choice([None, rec.mag]) if rec.mag is not None else None
    for quick in (False, True):
        for finding in doctor.examine(Recording(imu=imu, mag=mag), quick=quick, place=BERLIN):
            assert finding.sentence
            assert np.isfinite(finding.confidence)
