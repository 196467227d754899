"""The smoother of the loosely coupled filter on simulated drives."""

from dataclasses import replace

import drive
import numpy as np
import pytest

from strapdown.navigation import LooselyCoupled
from strapdown.navigation.loosely_coupled import LooselyCoupled as Loose
from strapdown.recording import Recording
from strapdown.solution import Status

FLT = LooselyCoupled()
WINDOW = (140.0, 200.0)


def outage(d):
    g = d.rec.gnss
    return replace(d.rec, gnss=g.rows((g.t < WINDOW[0]) | (g.t > WINDOW[1])))


@pytest.fixture(scope="module")
def solved():
    d = drive.simulate(seed=11)
    rec = outage(d)
    return d, FLT.run(rec), FLT.smooth(rec)


def horizontal(sol, d):
    e = drive.ned_error(sol.lla.copy(), d.lla)
    return np.hypot(e[:, 0], e[:, 1])


def test_the_middle_of_an_outage_is_many_times_better(solved):
    filtered, smoothed = [], []
    middle = (d_t := np.arange(1, 30001) * 0.01) > 165.0
    middle &= d_t < 175.0
    for seed in range(6):
        d = drive.simulate(seed=seed, slow=0.1)  # or both ends are off by half a metre
        rec = outage(d)
        end = int(np.searchsorted(d.t, WINDOW[1])) - 1
        filtered.append(horizontal(FLT.run(rec), d)[end])
        smoothed.append(horizontal(FLT.smooth(rec), d)[middle].max())
    assert np.median(smoothed) < 0.5 * np.median(filtered)


def test_it_says_of_itself_that_it_is_not_causal_and_keeps_the_axis(solved):
    _, sol, smooth = solved
    assert sol.causal
    assert not smooth.causal
    np.testing.assert_array_equal(smooth.t, sol.t)
    np.testing.assert_array_equal(smooth.status, sol.status)


def test_the_last_sample_is_the_filters(solved):
    _, sol, smooth = solved
    for name in ("q_nb", "lla", "v_n", "std_position_n"):
        np.testing.assert_allclose(getattr(smooth, name)[-1], getattr(sol, name)[-1], rtol=1e-12)


def test_no_sigma_is_larger_than_the_filters(solved):
    _, sol, smooth = solved
    known = (sol.status & Status.ALIGNING) == 0
    for name in ("std_attitude_n", "std_velocity_n", "std_gyr_bias", "std_acc_bias"):
        worse = getattr(smooth, name)[known] - getattr(sol, name)[known]
        # within a tick the filter's sigma grows and the smoother's is that of its mark
        assert worse.max() < 0.02 * getattr(sol, name)[known].max(), name


def test_its_track_has_no_jumps_where_fixes_come(solved):
    d, _, smooth = solved
    known = (d.t > 40.0) & (d.t < 290.0)
    step = drive.ned_error(smooth.lla[1:].copy(), smooth.lla[:-1])
    way = step - 0.005 * (smooth.v_n[1:] + smooth.v_n[:-1])
    # position and velocity of neighbouring samples belong together to a millimetre
    assert np.abs(way[known[1:]]).max() < 2e-3


def test_its_errors_are_what_its_sigmas_say():
    z = []
    for seed in range(12):
        d = drive.simulate(seed=50 + seed, duration=200.0, rate=50.0)
        sol = FLT.smooth(d.rec)
        k = int(np.searchsorted(d.t, 110.0))
        z.append(
            np.concatenate(
                (
                    drive.attitude_error(sol.q_nb[k], d.C_nb[k]) / sol.std_attitude_n[k],
                    (sol.v_n[k] - d.v_n[k]) / sol.std_velocity_n[k],
                    drive.ned_error(sol.lla[k].copy(), d.lla[k]) / sol.std_position_n[k],
                )
            )
        )
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    # chi-square of 12: 99.9 % between 0.45 and 1.7
    assert (rms < 1.8).all(), rms.round(2)
    assert (rms > 0.3).all(), rms.round(2)


def test_cutting_the_tape_into_segments_changes_nothing(monkeypatch, solved):
    import strapdown.navigation.loosely_coupled as module

    d, _, smooth = solved
    monkeypatch.setattr(module, "_TAPE", 60_000)  # a few seconds instead of eighty
    again = FLT.smooth(outage(d))
    for name in ("q_nb", "lla", "v_n", "std_position_n", "std_attitude_n"):
        np.testing.assert_allclose(
            getattr(again, name), getattr(smooth, name), rtol=1e-9, atol=1e-12, err_msg=name
        )


def test_it_survives_gaps_and_realignment():
    d = drive.simulate(seed=12)
    keep = (d.t < 150.0) | (d.t > 153.5)
    sol = FLT.smooth(replace(d.rec, imu=d.rec.imu.rows(keep)))
    known = (sol.status & Status.ALIGNING) == 0
    assert np.isfinite(sol.lla[known]).all()
    late = known & (sol.t > 190.0)
    e = drive.ned_error(sol.lla[late].copy(), d.lla[keep][late])
    assert np.hypot(e[:, 0], e[:, 1]).max() < 2.5


def test_an_empty_or_unaligned_recording_is_returned_as_filtered():
    d = drive.simulate(duration=10.0)
    sol = Loose().smooth(d.rec)
    assert (sol.status & Status.ALIGNING).all()
    nothing = Recording(imu=d.rec.imu.rows(slice(0, 0)), gnss=d.rec.gnss)
    assert len(Loose().smooth(nothing)) == 0
