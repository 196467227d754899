"""The Madgwick filter on real trials, and its variants in every way of running."""

import math

import numpy as np
import pytest
from truth import hand, streams

import strapdown
from strapdown.attitude import Madgwick
from strapdown.evaluation import attitude_errors
from strapdown.recording import Imu, Mag, Recording

DIP = math.atan2(43.0, 21.0)  # of the ideal sensors' field
VARIANTS = {
    "weighted": {"alpha": 20.0},
    "preset field": {"dip": DIP},
    "both, with bias": {"alpha": 20.0, "dip": DIP, "zeta": 0.002},
    "preset field, true heading": {"dip": DIP, "declination": 0.06},
}
LOG = streams.rough_log()


@pytest.fixture(params=VARIANTS)
def flt(request):
    return Madgwick(**VARIANTS[request.param])


def test_variants_give_the_same_bits_in_one_piece_in_steps_and_from_the_tracker(flt):
    state, states, tracked, trk = flt.init(), [], [], flt.tracker()
    for sample in streams.samples(LOG):
        state = flt.step(state, *sample)
        trk.update(*sample)
        states.append(state)
        tracked.append(trk.state)
    sol = flt.run(LOG)
    streams.assert_same_bits(sol, streams.collect(states))
    streams.assert_same_bits(sol, streams.collect(tracked))


def test_variants_follow_a_moving_hand(flt):
    """As the simplified filter does, whose error comes from the hand's acceleration."""
    t = np.arange(3000) / 100.0
    r_nb, gyr, acc, mag = hand.sensors(t)
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))
    off, simple = (
        np.sqrt(np.mean(hand.degrees_off(f.run(rec).q_nb, r_nb) ** 2))
        for f in (flt, Madgwick(declination=flt.declination))
    )
    # alpha 20 takes 2 beta / 20 = 0.0076 rad/s of about 1 rad/s from every rate
    assert off < 1.5 * simple + 0.5


def test_preset_dip_that_is_wrong_tilts_and_the_measured_one_does_not():
    t = np.arange(3000) / 100.0
    r_nb, gyr, acc, mag = hand.sensors(t, rest=60.0)
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))
    tilt = []
    for dip in (None, DIP, DIP + 0.3):
        q_nb = Madgwick(dip=dip).run(rec).q_nb[-1]
        down = strapdown.rotation.dcm_from_quat(q_nb)[2]
        tilt.append(np.degrees(np.arccos(np.clip(down @ r_nb[-1].as_matrix()[2], -1.0, 1.0))))
    # the chatter is 2 beta dt = 0.09 deg; of 17 deg of dip gravity and field share the blame
    assert tilt[0] < 0.1
    assert tilt[1] < 0.1
    assert 3.0 < tilt[2] < 17.2


def test_mean_over_ten_trials_is_near_that_of_the_authors_program(data_dir):
    """BROAD publishes 4.53 / 3.32 / 2.69 deg for Madgwick's own C code with beta 0.12.

    That code deviates from the paper's equations in the magnetometer part; the limits allow the
    mean 0.3 deg more in total and in inclination.
    """
    trials = sorted((data_dir / "broad").glob("*.mat"))
    assert len(trials) == 10
    rmse = []
    for path in trials:
        rec = strapdown.read(path)
        sol = Madgwick(beta=0.12).run(rec, diagnostics=False)
        summary = attitude_errors(sol, rec.reference, remove_heading=False).summary()
        rmse.append([summary[f"{k}_rmse_deg"] for k in ("total", "heading", "inclination")])
    total, heading, inclination = np.mean(rmse, axis=0)
    print(f"mean RMSE {total:.2f} / {heading:.2f} / {inclination:.2f} deg")
    assert total <= 4.83
    assert inclination <= 2.99
    assert heading <= 3.62
