"""Road drives: little but yaw happens; the course over ground helps, and fixes are examined."""

from dataclasses import replace

import numpy as np
import pytest
from test_doctor.faults import remedy, signed_permutations, spoilt

import strapdown as sd
from strapdown import doctor


@pytest.fixture(scope="module")
def drive(parking_lot):
    return sd.read(parking_lot)


def by_check(rec, check):
    return [f for f in doctor.examine(rec) if f.check == check]


def with_fixes(rec, **fields):
    return replace(rec, gnss=replace(rec.gnss, **fields))


def accepted(rec, sensor, S):
    """Whether wrong axes pass without an alarm or the word that they cannot be observed."""
    (finding,) = by_check(spoilt(rec, sensor, S), "axes")
    named = f"--axes {remedy(sensor, S)}" in finding.advice
    return not (named or finding.is_alarm or "not observable" in finding.sentence)


@pytest.mark.parametrize("sensor", ["gyr", "acc"])
def test_wrong_axes_are_not_accepted_silently(drive, sensor):
    faults = [*signed_permutations()[5::9], -np.eye(3)]
    assert not any(accepted(drive, sensor, S) for S in faults)


def test_opposite_of_the_specific_force_is_seen_by_the_course(drive):
    (finding,) = by_check(spoilt(drive, "acc", -1.0), "axes")
    assert finding.severity == "error"
    assert "--axes acc=-x,-y,-z." in finding.advice
    assert "confirms the sign" in by_check(drive, "axes")[0].sentence


@pytest.mark.parametrize("factor", [180.0 / np.pi, np.pi / 180.0])
def test_degrees_and_radians_are_told_by_the_course(drive, factor):
    (finding,) = [f for f in by_check(spoilt(drive, "gyr", factor), "units") if f.stream == "gyr"]
    assert finding.severity == "error"
    assert f"--units gyr={'dps' if factor > 1.0 else 'rad_s'}" in finding.advice


@pytest.mark.slow
def test_untouched_drives_and_trials_raise_no_alarm(data_dir):
    logs = [*sorted((data_dir / "broad").glob("*.mat")), *sorted((data_dir / "drives").iterdir())]
    for path in logs:
        rec = sd.read(path)
        for quick in (False, True):
            findings = doctor.examine(rec, quick=quick)
            assert [str(f) for f in findings if f.is_alarm] == [], path.stem


def test_untouched_drive_raises_no_alarm(drive):
    assert [str(f) for f in doctor.examine(drive) if f.is_alarm] == []


@pytest.mark.parametrize("late", [2.0, -2.0])
def test_late_fixes_are_found(drive, late):
    before = by_check(drive, "latency")[0]
    assert before.severity == "ok"
    (finding,) = by_check(replace(drive, gnss=drive.gnss.shifted(late)), "latency")
    assert finding.severity == "warning"
    assert ("late" if late > 0.0 else "early") in finding.sentence


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (lambda v: v[:, [1, 0, 2]], "north and east exchanged"),
        (lambda v: -v, "has the opposite sign of the"),
        (lambda v: 3.6 * v, "km/h taken for m/s"),
    ],
)
def test_velocity_that_is_not_the_rate_of_position_is_found(drive, turn, words):
    (finding,) = by_check(with_fixes(drive, v_n=turn(drive.gnss.v_n)), "velocity")
    assert finding.severity == "error"
    assert words in finding.sentence
    assert by_check(drive, "velocity")[0].severity == "ok"


def test_noise_of_positions_does_not_hide_their_rate(drive):
    """A receiver whose positions scatter by metres from fix to fix, as cheap ones do at 10 Hz."""
    rng = np.random.default_rng(2)
    lla = drive.gnss.lla + rng.normal(0.0, 2.0, drive.gnss.lla.shape) * [1.6e-7, 2e-7, 1.0]
    (finding,) = by_check(with_fixes(drive, lla=lla), "velocity")
    assert finding.severity == "ok"
    exchanged = with_fixes(drive, lla=lla, v_n=drive.gnss.v_n[:, [1, 0, 2]])
    (finding,) = by_check(exchanged, "velocity")
    assert finding.severity == "error"


def test_one_fix_at_rest_says_nothing_of_a_stale_heading(drive):
    speed = np.hypot(drive.gnss.v_n[:, 0], drive.gnss.v_n[:, 1])
    keep = (speed > 0.5) | (np.arange(len(speed)) == int(np.argmax(speed < 0.5)))
    (finding,) = by_check(replace(drive, gnss=drive.gnss.rows(np.flatnonzero(keep))), "heading")
    assert "stale at rest" not in finding.sentence


def test_fixes_lost_under_a_bridge_are_a_note(drive):
    t = drive.gnss.t
    rec = replace(drive, gnss=drive.gnss.rows(np.flatnonzero((t < 60.0) | (t > 90.0))))
    (finding,) = [f for f in by_check(rec, "time") if f.stream == "gnss"]
    assert finding.severity == "note"
    assert "1 gap" in finding.sentence


def test_absurd_sigmas_stale_heading_and_jumps_are_found(drive):
    lla = drive.gnss.lla.copy()
    lla[150:, 0] += 100.0 / 6.4e6  # 100 m north from then on
    rec = with_fixes(
        drive,
        std_position_n=np.zeros_like(drive.gnss.lla),
        heading=np.ones(len(drive.gnss)),
        lla=lla,
    )
    for check, words in (
        ("sigmas", "302 of 302 stated position sigmas are absurd"),
        ("heading", "stands still in 100 %"),
        ("jumps", "1 fix jumps by more than 30 m"),
    ):
        (finding,) = by_check(rec, check)
        assert finding.severity == "warning"
        assert words in finding.sentence
