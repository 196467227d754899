"""The INS of thesis D as a whole: consistency, biases, losses of GPS, every way of running."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from truth import sway

from strapdown.errors import MissingStream
from strapdown.kernels.uav_ins import PN
from strapdown.navigation import UavIns
from strapdown.recording import Gnss, Imu, Mag, Recording
from strapdown.solution import Status

G, RATE = 9.80665, 50.0
A, E2 = 6378137.0, 6.69437999014e-3
PLACE = np.array([0.72, 0.26, 180.0])
FIELD_N = np.array([2.4e-5, 1e-6, 3.9e-5])
REFERENCE = {
    "declination": float(np.arctan2(FIELD_N[1], FIELD_N[0])),
    "mag_reference": (float(np.hypot(FIELD_N[0], FIELD_N[1])), float(FIELD_N[2])),
}
ARRAYS = (
    "q_nb", "gyr_bias", "lla", "v_n", "acc_bias", "std_attitude_n", "std_position_n",
    "std_velocity_n", "std_acc_bias", "status",
)  # fmt: skip
SIGMA_P, SIGMA_V = np.array([1.5, 1.5, 3.0]), np.array([0.1, 0.1, 0.2])


def lla_of(ned):
    """Geodetic coordinates of a path of some hundred metres; radii of the place."""
    w = 1.0 - E2 * np.sin(PLACE[0]) ** 2
    r_n = A * (1 - E2) / w**1.5 + PLACE[2]
    r_e = (A / np.sqrt(w) + PLACE[2]) * np.cos(PLACE[0])
    return PLACE + ned / [r_n, r_e, -1.0], np.array([r_n, r_e, -1.0])


def flown(seed, seconds=30.0, noise=0.02, walk=1e-3, every=25, attitude_noise=0.0):
    """A swaying aircraft on a closed-form path; specific force is the mean of each interval."""
    rng = np.random.default_rng(seed)
    n, dt = round(seconds * RATE), 1.0 / RATE
    t = dt * np.arange(n)
    r_nb = sway.attitude(t, rng)
    f, phase = rng.uniform(0.02, 0.1, 3), rng.uniform(0, 6.28, 3)
    angle = 2 * np.pi * np.outer(t, f) + phase
    size = np.array([40.0, 40.0, 5.0])
    ned = size * np.sin(angle)
    v_n = size * 2 * np.pi * f * np.cos(angle)
    bias = 0.1 * rng.standard_normal(3) + np.cumsum(
        walk * math.sqrt(dt) * rng.standard_normal((n, 3)), axis=0
    )
    a_n = np.vstack((np.zeros(3), np.diff(v_n, axis=0) / dt))  # mean over the interval
    middle = sway.attitude(t - dt / 2, np.random.default_rng(seed))
    acc = (
        middle.inv().apply(a_n - [0, 0, G])
        + bias
        + noise / math.sqrt(dt) * rng.standard_normal((n, 3))
    )
    lla, scale = lla_of(ned)
    fixes = slice(every, None, every)
    count = len(t[fixes])
    gnss = Gnss(
        t=t[fixes], lla=lla[fixes] + SIGMA_P * rng.standard_normal((count, 3)) / scale,
        v_n=v_n[fixes] + SIGMA_V * rng.standard_normal((count, 3)),
        std_position_n=np.tile(SIGMA_P, (count, 1)), std_velocity_n=np.tile(SIGMA_V, (count, 1)),
    )  # fmt: skip
    gyr = sway.rates(r_nb, dt) + attitude_noise * rng.standard_normal((n, 3))
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=r_nb.inv().apply(FIELD_N)), gnss=gnss
    )
    return rec, r_nb, ned, v_n, bias


@cache
def consistency(runs=120):
    """NEES of the nine states at the end, and squared normalised innovations of the fixes.

    Attitude is as good as known, so that what the AHRS leaves is no part of it; course is no yaw
    here, the aircraft may slip.
    """
    flt = UavIns(
        std_tilt=1e-4, std_heading=1e-4, std_gyr_bias=1e-6, gyr_noise=1e-6, acc_noise=1e6,
        gyr_bias_noise=(1e-9,) * 3, min_speed=1e6, tilt_time=0.0, std_acc_bias=0.1,
        fix_gate=math.inf, **REFERENCE,
    )  # fmt: skip
    found, squares = [], []
    for seed in range(runs):
        rec, r_nb, ned, v_n, bias = flown(seed)
        first = r_nb[0].as_quat()[[3, 0, 1, 2]]
        sol, state = flt.advance(flt.init(attitude=first), rec)
        _, scale = lla_of(ned[-1])
        e = np.r_[
            (lla_of(ned[-1])[0] - sol.lla[-1]) * scale, v_n[-1] - sol.v_n[-1],
            bias[-1] - sol.acc_bias[-1],
        ]  # fmt: skip
        found.append(e @ np.linalg.solve(state.P[PN:, PN:], e))
        for name in ("gnss_position", "gnss_velocity"):
            rows = sol.diagnostics[name]
            squares.append(((rows.innovation / rows.sigma) ** 2).ravel())
    return np.array(found), np.concatenate(squares)


def test_mean_nees_of_a_hundred_and_twenty_runs_lies_in_its_chi_square_interval():
    found, _ = consistency()
    low, high = chi2.ppf([0.005, 0.995], 9 * len(found)) / len(found)
    assert low < found.mean() < high


def test_innovations_of_the_fixes_have_the_size_that_is_stated():
    _, squares = consistency()
    n = len(squares)
    assert n > 40_000
    low, high = chi2.ppf([0.005, 0.995], n) / n
    assert low < squares.mean() < high


@pytest.fixture(scope="module")
def circuit():
    """Thesis D's first mission, GPS at 4 Hz, accelerometers with a bias; and the truth."""
    from strapdown.systems.uav import flight

    log = flight.log("first", 0, gps_rate=4.0)
    imu = replace(log.rec.imu, acc=log.rec.imu.acc + [0.1, -0.05, 0.2])
    flt = UavIns(**flight.multi().parameters())
    return flt, replace(log.rec, imu=imu), flight.truth("first")


def off(sol, truth):
    """Error of position north, east, down [m]."""
    w = 1.0 - E2 * np.sin(truth.lla[:, 0]) ** 2
    r_n, r_e = A * (1 - E2) / w**1.5, A / np.sqrt(w) * np.cos(truth.lla[:, 0])
    return (sol.lla - truth.lla) * np.stack((r_n, r_e, -np.ones_like(r_n)), axis=1)


def cut(truth, rows):
    """Part of a truth."""
    names = ("t", "q_nb", "omega_ib_b", "f_b", "lla", "v_n", "m_n")
    return replace(truth, **{name: getattr(truth, name)[rows] for name in names})


def rms(x):
    return np.sqrt(np.mean(np.square(x), axis=0))


def test_flight_is_followed_and_the_biases_of_the_accelerometer_are_found(circuit):
    flt, rec, truth = circuit
    sol = flt.run(rec)
    late = truth.t > 30.0
    # fixes are good to 1.5 and 3 m, 0.1 m/s
    assert (rms(off(sol, truth)[late]) < [0.4, 0.4, 0.6]).all()
    assert (rms(sol.v_n[late] - truth.v_n[late]) < 0.1).all()
    np.testing.assert_allclose(sol.acc_bias[-1], [0.1, -0.05, 0.2], atol=0.03)
    # gravity there is 9.803: 4 mm/s^2, which the bias takes
    for error, std in (
        (off(sol, truth), sol.std_position_n), (sol.v_n - truth.v_n, sol.std_velocity_n),
    ):  # fmt: skip
        ratio = rms((error / std)[late])
        assert (ratio > 0.5).all()
        assert (ratio < 1.5).all()


def test_attitude_is_that_of_the_ahrs(circuit):
    from strapdown.systems.uav import flight

    flt, rec, _ = circuit
    ahrs = flight.multi().run(rec)
    sol = flt.run(rec)
    for name in ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias", "status"):
        np.testing.assert_array_equal(getattr(sol, name), getattr(ahrs, name))
    assert set(sol.diagnostics) == {*ahrs.diagnostics, "gnss_position", "gnss_velocity"}


def test_a_loss_of_gps_is_flown_through_within_what_is_stated(circuit):
    flt, rec, truth = circuit
    t = rec.gnss.t
    blanked = replace(rec, gnss=rec.gnss.rows((t < 120.0) | (t > 145.0)))
    sol = flt.run(blanked)
    error, std = np.abs(off(sol, truth)), sol.std_position_n
    lost = (truth.t > 120.0) & (truth.t < 145.0)
    assert (error[lost, :2] < 4.0 * std[lost, :2] + 0.5).all()
    assert std[lost][-1, :2].max() > 10.0 * std[truth.t < 119.0][-1, :2].max()
    after = (truth.t > 150.0) & (truth.t < 300.0)
    assert (rms(off(sol, truth)[after]) < [0.5, 0.5, 0.6]).all()
    assert np.any(sol.status & Status.OUTAGE)


def same(whole, part, rows):
    for name in ARRAYS:
        mine, theirs = getattr(whole, name)[rows], getattr(part, name)
        np.testing.assert_array_equal(mine, theirs, err_msg=name)


def test_pieces_prefix_and_steps_give_the_bits_of_run(circuit):
    flt, rec, _ = circuit
    rec = rec.between(0.0, 40.0)
    whole = flt.run(rec)
    state, done = flt.init(), 0
    for a, b in ((0.0, 0.3), (0.3, 11.001), (11.001, 26.0), (26.0, 99.0)):
        part, state = flt.advance(state, rec.between(a, b))
        same(whole, part, slice(done, done + len(part)))
        done += len(part)
    for stop in (0.1, 5.3, 21.0):
        part = flt.run(rec.between(0.0, stop))
        same(whole, part, slice(0, len(part)))
    state, j, fixes = flt.init(), 0, rec.gnss
    for i, t in enumerate(rec.imu.t[:800]):
        aiding = {}
        while j < len(fixes) and fixes.t[j] <= t:
            row = np.r_[fixes.t[j], fixes.lla[j], fixes.v_n[j], fixes.std_position_n[j],
                        fixes.std_velocity_n[j], fixes.heading[j]]  # fmt: skip
            aiding = {"gnss": row}
            j += 1
        state = flt.step(state, t, rec.imu.gyr[i], rec.imu.acc[i], rec.mag.mag[i], **aiding)
    np.testing.assert_array_equal(state.q_nb, whole.q_nb[799])
    from strapdown.kernels import memory as m

    np.testing.assert_array_equal(state.x[m.LLA : m.LLA + 3], whole.lla[799])
    np.testing.assert_array_equal(state.x[m.STD_BA : m.STD_BA + 3], whole.std_acc_bias[799])


def test_tracker_takes_late_fixes_and_gives_the_bits_of_run(circuit):
    flt, rec, _ = circuit
    rec = rec.between(0.0, 20.0)
    whole, fixes = flt.run(rec), rec.gnss
    trk, j = flt.tracker(), 0
    for i, t in enumerate(rec.imu.t):
        while j < len(fixes) and min(fixes.t[j] + 0.31, rec.imu.t[-1]) <= t:
            trk.add_gnss(fixes.t[j], fixes.lla[j], fixes.v_n[j], fixes.std_position_n[j],
                         fixes.std_velocity_n[j])  # fmt: skip
            j += 1
        trk.update(t, rec.imu.gyr[i], rec.imu.acc[i], rec.mag.mag[i])
    np.testing.assert_array_equal(trk.q_nb, whole.q_nb[-1])
    np.testing.assert_array_equal(trk.lla, whole.lla[-1])
    np.testing.assert_array_equal(trk.v_n, whole.v_n[-1])


def test_bad_samples_and_gaps_leave_all_finite_and_it_comes_back(circuit):
    flt, rec, truth = circuit
    gyr, acc, mag = rec.imu.gyr.copy(), rec.imu.acc.copy(), rec.mag.mag.copy()
    gyr[2000:2010], acc[2500:2600], mag[3000:3100] = np.nan, np.nan, np.nan
    keep = (rec.imu.t < 80.0) | (rec.imu.t > 84.0)
    spoiled = replace(
        rec, imu=replace(rec.imu, gyr=gyr, acc=acc).rows(keep), mag=Mag(t=rec.mag.t, mag=mag)
    )
    sol = flt.run(spoiled)
    began = np.flatnonzero(np.isfinite(sol.lla[:, 0]))[0]
    assert began <= 13  # the first fix after the first sample, at 4 Hz
    for name in ARRAYS:
        assert np.isfinite(getattr(sol, name)[began:]).all(), name
    assert np.any(sol.status & Status.GAP)
    there = cut(truth, keep)
    late = there.t > 110.0
    assert (rms(off(sol, there)[late]) < 1.0).all()


def test_fixes_without_velocity_or_sigmas_are_taken(circuit):
    flt, rec, truth = circuit
    bare = replace(rec, gnss=Gnss(t=rec.gnss.t, lla=rec.gnss.lla)).between(0.0, 150.0)
    sol = flt.run(bare)
    late = truth.t[: len(sol)] > 60.0
    part = cut(truth, slice(0, len(sol)))
    # no course: gravity levels, and turns tilt it
    assert (rms(off(sol, part)[late]) < 3.0).all()
    assert "gnss_velocity" not in sol.diagnostics


def test_fixes_are_needed():
    rec, *_ = flown(1, seconds=1.0)
    with pytest.raises(MissingStream, match="must have the stream 'gnss'"):
        UavIns().run(replace(rec, gnss=None))


@pytest.mark.parametrize(
    ("name", "value", "must"),
    [
        ("force_noise", 0.0, "positive"),
        ("tilt_time", -1.0, "non-negative"),
        ("std_acc_bias", -1.0, "non-negative"),
        ("std_fix_position", 0.0, "positive"),
        ("fix_gate", 0.0, "positive"),
        ("course_std", 0.0, "positive"),
    ],
)
def test_parameters_out_of_range_are_refused(name, value, must):
    with pytest.raises(ValueError, match=f"`{name}` must be {must}"):
        UavIns(**{name: value})


def test_rotation_of_the_truth_is_scipys():
    """The helper's attitude does not depend on how often it is asked."""
    t = np.linspace(0, 1, 5)
    one = sway.attitude(t, np.random.default_rng(3))
    two = sway.attitude(t[2:3], np.random.default_rng(3))
    assert (one[2].inv() * two[0]).magnitude() < 1e-12
    assert isinstance(one, Rotation)
