"""The estimator that only integrates: its contract, and its errors on simulated logs."""

from dataclasses import replace

import drive
import numpy as np
import pytest

import strapdown as sd
from strapdown.errors import MissingStream
from strapdown.navigation import DeadReckoning, Start, error_growth, mechanise
from strapdown.recording import Recording
from strapdown.rotation import quat_from_dcm, rpy_from_dcm
from strapdown.solution import Status
from strapdown.units import UG

ARRAYS = ("q_nb", "gyr_bias", "lla", "v_n", "status")


@pytest.fixture(scope="module")
def perfect():
    """A drive after 20 s of rest, without any sensor error."""
    return drive.simulate(
        seed=2, noise=0.0, duration=90.0, C_vb=drive.rotation((1, 2, -1), 0.8),
        antenna_v=(0, 0, 0),
    )  # fmt: skip


def heading_of(d):
    return float(rpy_from_dcm(d.C_nb[0])[2])


@pytest.fixture(scope="module")
def rough():
    """The same with noise, samples that are missing and a gap."""
    d = drive.simulate(seed=2, duration=40.0)
    imu = d.rec.imu
    gyr, acc = imu.gyr.copy(), imu.acc.copy()
    gyr[500], gyr[2500:2503], acc[700], acc[2600:2610] = np.nan, np.nan, np.nan, np.nan
    keep = (imu.t < 30.0) | (imu.t > 31.5)
    rec = replace(d.rec, imu=replace(imu, gyr=gyr, acc=acc).rows(keep))
    return replace(d, rec=rec)


def test_a_drive_without_sensor_errors_is_followed(perfect):
    sol = DeadReckoning(heading=heading_of(perfect)).run(perfect.rec)
    error = drive.ned_error(sol.lla[-1], perfect.lla[-1])
    # 80 s from a start whose level is exact to the mean of the samples
    assert np.abs(error).max() < 0.5
    assert np.abs(drive.attitude_error(sol.q_nb[-1], perfect.C_nb[-1])).max() < 2e-4
    assert np.abs(sol.gyr_bias[-1]).max() < 1e-7  # the Earth's rate is taken out
    assert sol.heading_reference == "true"


def test_it_is_the_mechanisation_from_its_start_on(perfect):
    sol = DeadReckoning(heading=heading_of(perfect)).run(perfect.rec)
    begin = int(np.flatnonzero(np.isfinite(sol.lla[:, 0]))[0])
    imu = perfect.rec.imu
    same = mechanise(
        (imu.t, imu.gyr - sol.gyr_bias[-1], imu.acc), Start.of(sol, begin), frame="wander"
    )
    assert np.abs(drive.ned_error(same.lla[-1], sol.lla[-1])).max() < 1e-3


def test_it_begins_after_the_rest_at_a_fix_and_says_so(perfect):
    flt = DeadReckoning(align_time=5.0)
    sol = flt.run(perfect.rec)
    known = np.isfinite(sol.lla).all(axis=1)
    begin = int(np.argmax(known))
    assert sol.t[begin] == pytest.approx(5.0, abs=0.02)
    assert known[begin:].all()
    assert (sol.status[begin:] & Status.OUTAGE).all()
    assert not (sol.status[:begin] & Status.OUTAGE).any()
    assert sol.heading_reference == "arbitrary"
    fixes = perfect.rec.gnss
    last = int(np.searchsorted(fixes.t, sol.t[begin], side="right")) - 1
    assert np.abs(drive.ned_error(sol.lla[begin], fixes.lla[last])).max() < 1e-6
    assert np.array_equal(sol.v_n[begin], np.zeros(3))


def test_later_fixes_change_nothing(perfect):
    flt = DeadReckoning(heading=0.3)
    fixes = perfect.rec.gnss
    some = replace(perfect.rec, gnss=fixes.rows(fixes.t < 11.0))
    assert np.array_equal(flt.run(perfect.rec).lla, flt.run(some).lla, equal_nan=True)


def test_a_given_attitude_begins_in_motion(perfect):
    flt = DeadReckoning()
    cut = 40.0
    rec = perfect.rec.between(cut, 90.0)
    first = int(np.searchsorted(perfect.t, rec.gnss.t[0]))
    state = flt.init(attitude=quat_from_dcm(perfect.C_nb[int(np.searchsorted(perfect.t, cut))]))
    sol, _ = flt.advance(state, rec)
    begin = int(np.flatnonzero(np.isfinite(sol.lla[:, 0]))[0])
    assert sol.t[begin] == pytest.approx(perfect.t[first], abs=0.011)
    assert np.linalg.norm(sol.v_n[begin] - perfect.v_n[first]) < 0.1
    assert np.abs(drive.ned_error(sol.lla[-1], perfect.lla[-1])).max() < 2.0


@pytest.mark.parametrize("seed", range(3))
def test_any_split_gives_the_bits_of_run(rough, seed):
    flt = DeadReckoning()
    whole, end = flt.advance(flt.init(), rough.rec)
    cuts = np.sort(np.random.default_rng(seed).uniform(0.0, 40.0, 5))
    state, parts = flt.init(), []
    for first, last in zip([-np.inf, *cuts], [*cuts, np.inf], strict=True):
        sol, state = flt.advance(state, rough.rec.between(first, last))
        parts.append(sol)
    for name in ARRAYS:
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True), name
    assert np.array_equal(state.x, end.x, equal_nan=True)


def test_steps_give_the_bits_of_run(rough):
    flt = DeadReckoning(align_time=2.0)
    rec = rough.rec.between(0.0, 6.0)
    sol, state = flt.run(rec), flt.init()
    fixes, at = rec.gnss, 0
    for k in range(len(rec.imu)):
        t = float(rec.imu.t[k])
        aiding = {}
        while at < len(fixes) and fixes.t[at] <= t:
            none = np.full(7, np.nan)
            aiding["gnss"] = np.concatenate(([fixes.t[at]], fixes.lla[at], fixes.v_n[at], none))
            at += 1
        state = flt.step(state, t, rec.imu.gyr[k], rec.imu.acc[k], **aiding)
        assert np.array_equal(state.q_nb, sol.q_nb[k])
    assert np.isfinite(sol.lla[-1]).all()
    assert np.array_equal(flt.advance(flt.init(), rec)[1].x, state.x, equal_nan=True)


def test_what_is_missing_is_flagged_and_bridged(rough):
    sol = DeadReckoning(heading=0.7).run(rough.rec)
    counts = sol.status_counts()
    assert counts["GYR_INVALID"] == 4
    assert counts["ACC_INVALID"] >= 11
    assert counts["GAP"] == 1
    assert np.isfinite(sol.q_nb).all()
    assert np.isfinite(sol.lla[-1]).all()


def test_an_accelerometer_bias_drifts_as_foretold():
    """100 s at rest: the bias was taken for tilt, and hides behind it."""
    d = drive.simulate(seed=5, noise=0.0, duration=110.0, ramps=(), antenna_v=(0, 0, 0))
    imu = d.rec.imu
    bias = 500 * UG
    later = np.where(imu.t > 10.5, bias, 0.0)[:, None] * [0.0, 1.0, 0.0]
    rec = replace(d.rec, imu=replace(imu, acc=imu.acc + later))
    sol = DeadReckoning(heading=heading_of(d)).run(rec)
    moved = np.linalg.norm(drive.ned_error(sol.lla[-1], d.lla[-1])[:2])
    assert moved == pytest.approx(error_growth.drift(99.5, acc_bias=bias).total, rel=0.02)
    always = replace(d.rec, imu=replace(imu, acc=imu.acc + [0.0, bias, 0.0]))
    sol = DeadReckoning(heading=heading_of(d)).run(always)
    assert np.linalg.norm(drive.ned_error(sol.lla[-1], d.lla[-1])[:2]) < 0.02 * moved


def test_level_and_bias_are_means_over_the_rest():
    """Noise of 0.1 m/s^2 and a bias of half a degree per second; the first sample is as good."""
    bias, rng = np.array([0.01, -0.006, 0.008]), np.random.default_rng(6)
    d = drive.simulate(
        seed=5, noise=0.0, duration=15.0, ramps=(), antenna_v=(0, 0, 0),
        C_vb=drive.rotation((1, 2, -1), 0.8),
    )  # fmt: skip
    imu = d.rec.imu
    gyr = imu.gyr + bias + 0.001 * rng.standard_normal(imu.gyr.shape)
    acc = imu.acc + 0.1 * rng.standard_normal(imu.acc.shape)
    rec = replace(d.rec, imu=replace(imu, gyr=gyr, acc=acc))
    sol = DeadReckoning(heading=heading_of(d)).run(rec)
    begin = int(np.flatnonzero(np.isfinite(sol.lla[:, 0]))[0])
    first = drive.attitude_error(sol.q_nb[0], d.C_nb[0])
    level = drive.attitude_error(sol.q_nb[begin], d.C_nb[begin])
    # 0.1 / 9.81 of a radian in one sample, over the root of a thousand in their mean
    assert np.abs(level[:2]).max() < 5 * 0.0102 / np.sqrt(1000)
    assert np.abs(first[:2]).max() > 0.003
    assert sol.gyr_bias[-1] == pytest.approx(bias, abs=5 * 0.001 / np.sqrt(1000))
    # 4.9 s later: half a degree per second left in would have turned it by 2.5 deg
    end = drive.attitude_error(sol.q_nb[-1], d.C_nb[-1])
    assert np.abs(end - level).max() < 1e-3


def test_held_height_stays():
    d = drive.simulate(seed=5, duration=60.0)
    sol = DeadReckoning(height="held").run(d.rec)
    known = np.isfinite(sol.lla[:, 0])
    assert np.ptp(sol.lla[known, 2]) < 1e-9


def test_registry_knows_it_and_prefers_every_filter():
    entry = sd.estimators.entry("dead-reckoning")
    assert entry.gives == "navigation"
    assert entry.needs == ("gnss",)
    assert not entry.smooths
    d = drive.simulate(seed=1, duration=5.0)
    assert sd.estimators.preferred(d.rec) != "dead-reckoning"
    with pytest.raises(MissingStream, match="gnss"):
        DeadReckoning().run(Recording(imu=d.rec.imu))


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"align_time": -1.0}, "`align_time` must be non-negative"),
        ({"heading": 90.0}, "`heading` must lie in"),
        ({"height": "fixed"}, "`height` must be one of free, held"),
        ({"earth": "flat"}, "`earth` must be one of wgs84, spherical"),
    ],
)
def test_parameters_are_checked(bad, message):
    with pytest.raises(ValueError, match=message):
        DeadReckoning(**bad)
