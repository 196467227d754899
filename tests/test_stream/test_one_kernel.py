"""Batch, pieces, single samples and the tracker give the same bits, for every estimator."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from truth import streams

import strapdown
from strapdown.recording import Recording

NAMES = [
    name
    for name in strapdown.estimators.names()
    if strapdown.estimators.entry(name).gives == "attitude"
]
LOG = streams.rough_log()
RAD_10_DEG = np.array([np.cos(np.pi / 36), 0.6 * np.sin(np.pi / 36), 0.8 * np.sin(np.pi / 36), 0])


@pytest.fixture(params=NAMES)
def flt(request):
    return strapdown.estimators.create(request.param)


def in_pieces(flt, rec, cuts, state=None):
    """Solutions of the pieces between the cut times, and the last state."""
    state = flt.init() if state is None else state
    edges = [-np.inf, *cuts, np.inf]
    parts = []
    for start, stop in pairwise(edges):
        sol, state = flt.advance(state, rec.between(start, stop))
        parts.append(sol)
    return parts, state


def joined(parts):
    """Arrays of several solutions, one after the other."""
    names = [n for n in (*streams.CELLS, "status") if getattr(parts[0], n) is not None]
    return {name: np.concatenate([getattr(p, name) for p in parts]) for name in names}


def test_steps_one_by_one_give_the_bits_of_run(flt):
    state, states = flt.init(), []
    for sample in streams.samples(LOG):
        state = flt.step(state, *sample)
        states.append(state)
    streams.assert_same_bits(flt.run(LOG), streams.collect(states))


def test_tracker_gives_the_bits_of_run(flt):
    trk, states = flt.tracker(), []
    for sample in streams.samples(LOG):
        trk.update(*sample)
        states.append(trk.state)
        assert np.array_equal(trk.q_nb, trk.state.q_nb)
        assert np.array_equal(trk.gyr_bias, trk.state.gyr_bias)
        assert trk.status == trk.state.status
    streams.assert_same_bits(flt.run(LOG), streams.collect(states))


def test_tracker_takes_what_is_no_float64_array(flt):
    rec = LOG.between(0.0, 2.0)
    trk, want = flt.tracker(), flt.run(rec)
    for t, gyr, acc, field in streams.samples(rec):
        frozen = acc.copy()
        frozen.flags.writeable = False
        column = None if field is None else np.asfortranarray(np.stack([field, field]))[1]
        trk.update(t, gyr.tolist(), frozen, column)
    assert np.array_equal(trk.q_nb, want.q_nb[-1])


def test_tracker_goes_on_from_a_state(flt):
    _, half = in_pieces(flt, LOG.between(0.0, 4.0), [])
    trk = flt.tracker(half)
    for sample in streams.samples(LOG.between(4.0, 13.0)):
        trk.update(*sample)
    assert np.array_equal(trk.q_nb, flt.run(LOG).q_nb[-1])


def test_any_split_gives_the_bits_of_run(flt):
    rng = np.random.default_rng(2)
    whole, (want, end) = flt.run(LOG), flt.advance(flt.init(), LOG)
    for _ in range(30):
        cuts = np.sort(rng.uniform(-1.0, 13.0, rng.integers(1, 9)))
        parts, state = in_pieces(flt, LOG, cuts)
        streams.assert_same_bits(whole, joined(parts))
        assert np.array_equal(state.x, end.x, equal_nan=True)
        assert np.array_equal(state.P, end.P)
    streams.assert_same_bits(whole, want)


def test_diagnostics_of_any_split_are_those_of_run(flt):
    rng = np.random.default_rng(3)
    whole = flt.run(LOG).diagnostics
    for _ in range(5):
        parts, _ = in_pieces(flt, LOG, np.sort(rng.uniform(0.0, 12.0, 4)))
        for name, want in whole.items():
            found = [p.diagnostics[name] for p in parts if name in p.diagnostics]
            for key in ("t", "innovation", "sigma", "outcome"):
                got = np.concatenate([getattr(d, key) for d in found])
                assert np.array_equal(got, getattr(want, key), equal_nan=True), (name, key)


def test_split_between_a_field_sample_and_its_imu_sample_keeps_the_field(flt):
    """The field sample lies in the first piece, the IMU sample at which it counts in the next."""
    whole = flt.run(LOG)
    for t_mag in LOG.mag.t[[0, 1, 40, 90]]:
        cut = np.nextafter(t_mag, np.inf)
        assert not np.any(LOG.imu.t == t_mag)
        parts, _ = in_pieces(flt, LOG, [cut])
        streams.assert_same_bits(whole, joined(parts))


def test_pieces_may_hold_field_samples_alone(flt):
    whole = flt.run(LOG)
    for t_mag in LOG.mag.t[[1, 2, 40]]:
        parts, _ = in_pieces(flt, LOG, [t_mag, np.nextafter(t_mag, np.inf)])
        assert len(parts[1]) == 0
        streams.assert_same_bits(whole, joined(parts))


def test_empty_pieces_change_nothing(flt):
    _, state = flt.advance(flt.init(), LOG.between(0.0, 3.0))
    empty = LOG.between(3.5, 3.5)
    sol, after = flt.advance(state, empty)
    assert len(sol) == 0
    assert sol.q_nb.shape == (0, 4)
    assert np.array_equal(after.x, state.x)
    assert np.array_equal(after.P, state.P)
    sol, after = flt.advance(flt.init(), empty)
    assert np.isnan(after.t)


@pytest.mark.parametrize("stop", [0.01, 1.31, 2.0, 6.99, 8.6, 11.0])
def test_run_on_the_first_part_is_the_first_part_of_run(flt, stop):
    part = LOG.between(-1.0, stop)
    rows = slice(0, len(part.imu))
    streams.assert_same_bits(flt.run(LOG), joined([flt.run(part)]), rows)


def test_state_survives_a_file(flt, tmp_path):
    _, state = flt.advance(flt.init(), LOG.between(0.0, 5.0))
    np.savez(tmp_path / "state.npz", **state._asdict())
    with np.load(tmp_path / "state.npz") as file:
        restored = type(state)(**file)
    rest = LOG.between(5.0, 13.0)
    streams.assert_same_bits(flt.advance(state, rest)[0], joined([flt.advance(restored, rest)[0]]))
    stepped = flt.step(restored, 20.0, [0, 0, 0], [0, 0, -9.8])
    assert stepped.name == flt.NAME
    assert np.array_equal(stepped.x, flt.step(state, 20.0, [0, 0, 0], [0, 0, -9.8]).x)


def test_step_advance_and_tracker_leave_their_state_alone(flt):
    _, state = flt.advance(flt.init(), LOG.between(0.0, 5.0))
    x, P = state.x.copy(), state.P.copy()
    flt.step(state, 6.0, [0.1, 0.2, 0.3], [1.0, 0.0, -9.8], [2e-5, 0.0, 4e-5])
    flt.advance(state, LOG.between(5.0, 7.0))
    trk = flt.tracker(state)
    trk.update(6.0, [0.1, 0.2, 0.3], [1.0, 0.0, -9.8])
    trk.state.x[:] = 0.0
    trk.q_nb[:] = 0.0
    assert np.array_equal(state.x, x)
    assert np.array_equal(state.P, P)
    assert np.linalg.norm(trk.q_nb) == pytest.approx(1.0, abs=1e-12)


def test_recording_is_left_alone(flt):
    copies = [a.copy() for a in (LOG.imu.t, LOG.imu.gyr, LOG.imu.acc, LOG.mag.t, LOG.mag.mag)]
    flt.run(LOG)
    for copy, array in zip(
        copies, (LOG.imu.t, LOG.imu.gyr, LOG.imu.acc, LOG.mag.t, LOG.mag.mag), strict=True
    ):
        assert np.array_equal(copy, array, equal_nan=True)


def test_origin_of_time_does_not_matter(flt):
    """Times are multiples of 2**-16 s: shifted by 2**20 s every interval keeps its bits."""
    later = Recording(imu=LOG.imu.shifted(2.0**20), mag=LOG.mag.shifted(2.0**20))
    for start in (None, RAD_10_DEG):
        state = flt.init() if start is None else flt.init(attitude=start)
        want, got = flt.advance(state, LOG)[0], flt.advance(state, later)[0]
        streams.assert_same_bits(want, joined([got]))


def test_given_attitude_is_where_it_starts(flt):
    state = flt.init(attitude=RAD_10_DEG)
    assert np.array_equal(state.q_nb, RAD_10_DEG)
    assert state.status == 0
    sol, _ = flt.advance(state, LOG)
    assert np.all(sol.status & strapdown.Status.ALIGNING == 0)
    # before anything is propagated or seen: the first sample has no interval, its rate is NaN
    np.testing.assert_allclose(sol.q_nb[0], RAD_10_DEG, atol=1e-12)
    parts, _ = in_pieces(flt, LOG, [0.5, 1.4, 8.0], flt.init(attitude=RAD_10_DEG))
    streams.assert_same_bits(sol, joined(parts))


def test_diagnostics_may_be_switched_off(flt):
    sol = flt.run(LOG, diagnostics=False)
    assert not sol.diagnostics
    streams.assert_same_bits(flt.run(LOG), joined([sol]))


def test_without_a_magnetometer_every_way_agrees(flt):
    rec = replace(LOG, mag=None)
    parts, _ = in_pieces(flt, rec, [0.02, 3.0, 7.5])
    streams.assert_same_bits(flt.run(rec), joined(parts))


def test_held_accelerometer_samples_are_no_measurements(flt):
    """With a mask, values of samples that are not real do not matter."""
    rng = np.random.default_rng(4)
    real = np.arange(len(LOG.imu)) % 3 == 1
    other = np.where(real[:, None], LOG.imu.acc, rng.standard_normal(LOG.imu.acc.shape))
    one = replace(LOG, imu=replace(LOG.imu, acc_real=real))
    two = replace(LOG, imu=replace(LOG.imu, acc=other, acc_real=real))
    streams.assert_same_bits(flt.run(one), joined([flt.run(two)]))
    parts, _ = in_pieces(flt, one, [0.5, 4.0, 9.0])
    streams.assert_same_bits(flt.run(one), joined(parts))
    state, states = flt.init(), []
    for (t, gyr, acc, field), is_real in zip(streams.samples(one), real, strict=True):
        state = flt.step(state, t, gyr, acc if is_real else None, field)
        states.append(state)
    streams.assert_same_bits(flt.run(one), streams.collect(states))
    trk = flt.tracker()
    for (t, gyr, acc, field), is_real in zip(streams.samples(one), real, strict=True):
        trk.update(t, gyr, acc if is_real else None, field)
    assert np.array_equal(trk.state.x, state.x, equal_nan=True)


def test_held_rates_are_no_measurements(flt):
    """The same for a gyroscope slower than the accelerometer."""
    rng = np.random.default_rng(5)
    real = np.arange(len(LOG.imu)) % 3 == 1
    other = np.where(real[:, None], LOG.imu.gyr, rng.standard_normal(LOG.imu.gyr.shape))
    one = replace(LOG, imu=replace(LOG.imu, gyr_real=real))
    two = replace(LOG, imu=replace(LOG.imu, gyr=other, gyr_real=real))
    streams.assert_same_bits(flt.run(one), joined([flt.run(two)]))
    parts, _ = in_pieces(flt, one, [0.5, 4.0, 9.0])
    streams.assert_same_bits(flt.run(one), joined(parts))
    state, states = flt.init(), []
    trk = flt.tracker()
    for (t, gyr, acc, field), is_real in zip(streams.samples(one), real, strict=True):
        state = flt.step(state, t, gyr if is_real else None, acc, field)
        states.append(state)
        trk.update(t, gyr if is_real else None, acc, field)
    streams.assert_same_bits(flt.run(one), streams.collect(states))
    assert np.array_equal(trk.state.x, state.x, equal_nan=True)
