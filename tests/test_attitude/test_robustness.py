"""Bad samples, gaps, strange starts: every estimator stays finite and says what happened."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth import faults, hand, streams

import strapdown
from strapdown.recording import Imu, Mag, Recording
from strapdown.solution import Outcome, Status

NAMES = [
    name
    for name in strapdown.estimators.names()
    if strapdown.estimators.entry(name).gives == "attitude"
]
G = 9.80665
RATE = 100.0


def log(seconds=6.0, start=(0.0, 0.0, 0.0), rest=1.0):
    """Ideal nine axes at 100 Hz, and the truth."""
    t = np.arange(round(seconds * RATE)) / RATE
    r_nb, gyr, acc, mag = hand.sensors(t, rest=rest, start=start)
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag)), r_nb


def spoiled(rec, sensor, rows, value):
    """The recording with some samples of one sensor replaced."""
    stream = rec.mag if sensor == "mag" else rec.imu
    array = getattr(stream, sensor).copy()
    array[rows] = value
    part = {"mag" if sensor == "mag" else "imu": replace(stream, **{sensor: array})}
    return replace(rec, **part)


def assert_sound(sol):
    """Finite everywhere, unit quaternions, deviations not negative."""
    for name in streams.CELLS:
        value = getattr(sol, name)
        assert value is None or np.isfinite(value).all(), name
    # a step leaves 3 e^2 / 8 of an error e of the norm: nothing but round-off
    np.testing.assert_allclose(np.linalg.norm(sol.q_nb, axis=1), 1.0, rtol=0, atol=1e-12)
    for value in (sol.std_attitude_n, sol.std_gyr_bias):
        assert value is None or (value >= 0.0).all()


@pytest.fixture(params=NAMES)
def flt(request):
    return strapdown.estimators.create(request.param)


FLAGS = {"gyr": Status.GYR_INVALID, "acc": Status.ACC_INVALID, "mag": Status.MAG_INVALID}


@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("rows", [[300], list(range(300, 350)), [0, 1, 2], [599]])
def test_nan_is_flagged_where_it_is_and_hardly_moves_the_rest(flt, sensor, rows):
    rec, _ = log()
    clean = flt.run(rec)
    sol = flt.run(spoiled(rec, sensor, rows, np.nan))
    assert_sound(sol)
    flagged = np.flatnonzero(sol.status & FLAGS[sensor])
    assert flagged.tolist() == rows
    off = hand.degrees_off(sol.q_nb, Rotation.from_quat(clean.q_nb[:, [1, 2, 3, 0]]))
    # half a second of a hand's motion unseen by the gyro: tens of degrees for a while at most
    assert off[-1] < (25.0 if sensor == "gyr" and len(rows) == 50 else 5.0)


def test_nan_in_one_component_is_enough(flt):
    rec, _ = log()
    for sensor in ("gyr", "acc", "mag"):
        for axis in range(3):
            sol = flt.run(spoiled(rec, sensor, (slice(200, 201), axis), np.nan))
            assert np.flatnonzero(sol.status & FLAGS[sensor]).tolist() == [200]
            assert_sound(sol)


@pytest.mark.parametrize("sensor", ["acc", "mag"])
def test_zero_vectors_are_flagged(flt, sensor):
    rec, _ = log()
    sol = flt.run(spoiled(rec, sensor, slice(250, 300), 0.0))
    assert_sound(sol)
    assert np.flatnonzero(sol.status & FLAGS[sensor]).tolist() == list(range(250, 300))


@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_a_sensor_that_says_nothing_at_all_leaves_all_finite(flt, sensor):
    rec, _ = log(2.0)
    sol = flt.run(spoiled(rec, sensor, slice(None), np.nan))
    assert_sound(sol)
    if sensor != "mag":
        assert np.all(sol.status & Status.ALIGNING)


@pytest.mark.parametrize("value", [1e4, -1e30, 9e74])  # recordings take less than 1e75
@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_absurd_numbers_leave_all_finite(flt, sensor, value):
    rec, _ = log(3.0)
    rows = np.random.default_rng(1).integers(0, 300, 60)
    assert_sound(flt.run(spoiled(rec, sensor, rows, value)))


def test_noise_without_sense_leaves_all_finite(flt):
    rng = np.random.default_rng(2)
    t = np.cumsum(10.0 ** rng.uniform(-6, 1, 3000))
    wild = [10.0 ** rng.uniform(-8, 8, (3000, 1)) * rng.standard_normal((3000, 3)) for _ in "gam"]
    for array in wild:
        array[rng.random(3000) < 0.1] = np.nan
        array[rng.random(3000) < 0.1] = 0.0
    rec = Recording(imu=Imu(t=t, gyr=wild[0], acc=wild[1]), mag=Mag(t=t, mag=wild[2]))
    assert_sound(flt.run(rec))


@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_recordings_refuse_infinity(sensor):
    rec, _ = log(1.0)
    with pytest.raises(
        ValueError, match=rf"`(imu|mag)\.{sensor}` must be finite or NaN, got .*inf"
    ):
        spoiled(rec, sensor, 7, np.inf)


def test_before_alignment_attitude_is_the_identity_and_says_so(flt):
    rec, _ = log()
    sol = flt.run(spoiled(rec, "acc", slice(0, 120), np.nan))
    aligning = (sol.status & Status.ALIGNING) > 0
    assert np.flatnonzero(aligning).tolist() == list(range(120))
    assert np.array_equal(sol.q_nb[:120], np.tile([1.0, 0, 0, 0], (120, 1)))
    state = flt.init()
    assert state.status == Status.ALIGNING
    assert np.isnan(state.t)


STARTS = {
    "upside down": (np.pi, 0.0, 0.7),
    "nose up": (0.3, np.pi / 2, 0.7),
    "nose down": (0.3, -np.pi / 2, 0.7),
    "on its side": (np.pi / 2, 0.2, -2.0),
    "facing south": (0.0, 0.0, np.pi),
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_any_start_is_found_at_the_first_sample_and_kept(flt, start):
    rec, r_nb = log(6.0, start=start, rest=3.0)
    sol = flt.run(rec)
    assert_sound(sol)
    off = hand.degrees_off(sol.q_nb, r_nb)
    assert off[0] < 1e-4  # ideal sensors at rest: the track's acceleration is zero to 1e-6
    assert off[:300].max() < 0.5
    assert off.max() < 8.0  # the hand accelerates by up to 0.1 g


def test_a_gap_is_flagged_and_recovered_from(flt):
    """Two seconds are missing, in which the box turns about all axes; then it rests."""
    t = np.concatenate((np.arange(0.0, 3.0, 0.01), np.arange(5.0, 25.0, 0.01)))
    before = Rotation.from_euler("ZYX", [0.5, 0.1, -0.2])
    after = Rotation.from_euler("ZYX", [2.0, -0.4, 0.6])
    n = np.count_nonzero(t < 4.0)
    turns = Rotation.concatenate([before] * n + [after] * (len(t) - n))
    rec = Recording(
        imu=Imu(t=t, gyr=np.zeros((len(t), 3)), acc=turns.inv().apply([0, 0, -G])),
        mag=Mag(t=t, mag=turns.inv().apply(hand.FIELD_N)),
    )
    sol = flt.run(rec)
    assert_sound(sol)
    assert np.flatnonzero(sol.status & Status.GAP).tolist() == [n]
    off = hand.degrees_off(sol.q_nb, turns)
    assert off[n - 1] < 0.1
    if sol.std_attitude_n is None:  # no covariance: it aligned again at once
        assert off[n] < 1e-4
        assert off[-1] < 0.2  # the Madgwick filter chatters by 2 beta dt = 0.09 deg
    else:  # 20 s of a field that counts 14 deg over the root of one second
        assert off[-1] < 5.0
        assert (sol.std_attitude_n[n] > sol.std_attitude_n[n - 1]).all()


def test_bias_is_kept_over_a_gap(flt):
    rec, _ = log(20.0, rest=30.0)  # at rest all the time
    t = rec.imu.t.copy()
    t[1500:] += 5.0
    rec = Recording(
        imu=replace(rec.imu, t=t, gyr=rec.imu.gyr + [0.01, 0.02, -0.01]),
        mag=Mag(t=t, mag=rec.mag.mag),
    )
    sol = flt.run(rec)
    if sol.gyr_bias is not None:
        np.testing.assert_allclose(sol.gyr_bias[1500], sol.gyr_bias[1499], atol=1e-3)


def test_interval_of_the_gap_is_a_parameter(flt):
    rec, _ = log(3.0)
    rec = replace(rec, imu=rec.imu.rows(np.r_[0:150, 180:300]))
    assert not np.any(flt.run(rec).status & Status.GAP)
    narrow = replace(flt, max_gap=0.2)
    assert np.flatnonzero(narrow.run(rec).status & Status.GAP).tolist() == [150]


def test_ends_of_the_sensors_ranges_are_flagged(flt):
    rec, _ = log(4.0)
    limited = replace(flt, gyr_range=20.0, acc_range=60.0)
    rec = spoiled(rec, "gyr", (slice(300, 305), 1), -20.0)
    sol = limited.run(spoiled(rec, "acc", (slice(320, 323), 2), 60.0))
    assert_sound(sol)
    want = [300, 301, 302, 303, 304, 320, 321, 322]
    assert np.flatnonzero(sol.status & Status.SATURATED).tolist() == want


@pytest.mark.parametrize("name", ["madgwick", "mahony", "mekf"])
def test_rejected_samples_stand_in_the_diagnostics_without_an_innovation(name):
    flt = strapdown.estimators.create(name)
    rec, _ = log(3.0)
    rec = spoiled(spoiled(rec, "acc", [100], np.nan), "mag", [120, 121], 0.0)
    found = flt.run(rec).diagnostics
    for sensor, rows in (("acc", [100]), ("mag", [120, 121])):
        bad = found[sensor].outcome == Outcome.REJECTED_INVALID
        np.testing.assert_allclose(found[sensor].t[bad], np.array(rows) / RATE)
        assert np.isnan(found[sensor].innovation[bad]).all()


def test_heading_reference_is_said_and_declination_turns_the_heading_by_itself(flt):
    rec, _ = log(4.0)
    noise = np.random.default_rng(3).standard_normal(rec.imu.acc.shape)
    # without noise the Madgwick filter's gradient would be round-off
    rec = replace(rec, imu=replace(rec.imu, acc=rec.imu.acc + 0.1 * noise))
    magnetic, d = flt.run(rec), 0.3
    true = replace(flt, declination=d).run(rec)
    assert magnetic.heading_reference == "magnetic"
    assert true.heading_reference == "true"
    assert flt.run(replace(rec, mag=None)).heading_reference == "arbitrary"
    assert replace(flt, use_mag=False).run(rec).heading_reference == "arbitrary"
    silent = flt.run(spoiled(rec, "mag", slice(None), np.nan))
    assert silent.heading_reference == "arbitrary"
    turned = Rotation.from_euler("Z", d) * Rotation.from_quat(magnetic.q_nb[:, [1, 2, 3, 0]])
    # the same filter seen from a frame turned about down
    assert hand.degrees_off(true.q_nb, turned).max() < 1e-9


def test_without_its_field_a_filter_is_the_one_that_does_not_use_it(flt):
    rec, _ = log(3.0)
    blind, none = replace(flt, use_mag=False).run(rec), flt.run(replace(rec, mag=None))
    streams.assert_same_bits(blind, {n: getattr(none, n) for n in (*streams.CELLS, "status")})


def test_two_streams_through_one_estimator_do_not_mix(flt):
    """The estimator keeps no state: interleaved trackers agree with separate ones."""
    one, _ = log(1.0)
    two, _ = log(1.0, start=(1.0, 0.5, -2.0))
    trackers = [flt.tracker(), flt.tracker()]
    for samples in zip(streams.samples(one), streams.samples(two), strict=True):
        for trk, sample in zip(trackers, samples, strict=True):
            trk.update(*sample)
    for trk, rec in zip(trackers, (one, two), strict=True):
        assert np.array_equal(trk.q_nb, flt.run(rec).q_nb[-1])


# --- faults of the shipped scenario, against the same filter on the untouched log ------------


def outcome(flt, name):
    return faults.judge(flt, faults.cases()[name])


def test_faults_are_those_that_are_named():
    assert tuple(faults.cases()) == faults.NAMES


@pytest.mark.parametrize("name", faults.NAMES)
def test_fault_leaves_all_finite_and_a_flag_tells(flt, name):
    found = outcome(flt, name)
    assert found.finite
    asked = faults.cases()[name].flags
    assert not asked or found.flags & asked


@pytest.mark.parametrize("name", [n for n in faults.NAMES if n.startswith("one NaN")])
def test_one_bad_sample_moves_hardly_anything(flt, name):
    assert outcome(flt, name).largest < 0.3  # 40 deg/s unseen for 10 ms, and what mends it


def test_lost_samples_with_true_times_cost_less_than_half_a_degree(flt):
    assert outcome(flt, faults.LOST).extra < 0.5


def test_jittered_times_that_are_known_do_not_matter(flt):
    found = outcome(flt, "sampling times off by up to 4 ms, and known")
    assert found.extra < 0.5
    assert found.at_end < 1.0


@pytest.mark.parametrize("name", [n for n in faults.NAMES if n.startswith("start")])
def test_motion_is_followed_from_any_start_as_from_a_level_one(flt, name):
    # The same filter in turned axes. Only where a Jacobian is of first order, or scalars of an
    # update enter one after the other, do the axes of the box matter.
    assert outcome(flt, name).largest < 0.5


@pytest.mark.parametrize("name", faults.NAMES)
def test_spoiled_samples_one_by_one_and_in_pieces_are_the_run(flt, name):
    """Twelve seconds around the fault; pieces end within it."""
    case = faults.cases()[name]
    first = max(0.0, min(case.start, 100.0) - 1.0)
    rec = case.rec.between(first, first + 12.0)
    flt = replace(flt, **case.parameters)
    whole = flt.run(rec)
    trk, states = flt.tracker(), []
    for t, gyr, acc, mag in streams.samples(rec):
        trk.update(t, gyr, acc, mag)
        states.append(trk.state)
    streams.assert_same_bits(whole, streams.collect(states))
    state, done = flt.init(), 0
    cuts = (first, first + 1.3, first + 3.0, first + 13.0)
    for start, end in pairwise(cuts):
        part, state = flt.advance(state, rec.between(start, end))
        streams.assert_same_bits(whole, part, rows=slice(done, done + len(part)))
        done += len(part)
    assert done == len(whole)
