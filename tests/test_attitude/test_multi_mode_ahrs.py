"""The multi-mode AHRS as a whole: consistency in both modes, fixes in every way of running."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from truth import streams, sway

from strapdown.attitude import MultiModeAhrs
from strapdown.recording import Gnss, Imu, Mag, Recording
from strapdown.solution import Status

G, DEG = 9.80665, np.pi / 180
RATE = 50.0
FIELD_N = np.array([2.4e-5, 1e-6, 3.9e-5])
REFERENCE = {
    "declination": float(np.arctan2(FIELD_N[1], FIELD_N[0])),
    "mag_reference": (float(np.hypot(FIELD_N[0], FIELD_N[1])), float(FIELD_N[2])),
}
RUNS = 120


def flight(t, r_nb, gyr, acc, mag, course=None, every=2):
    """A recording; fixes at every other sample, at 9 m/s."""
    gnss = None
    if course is not None:
        course = course[::every]
        v_n = np.stack((9 * np.cos(course), 9 * np.sin(course), 0 * course), axis=1)
        gnss = Gnss(t=t[::every], lla=np.tile([0.7, 0.2, 50.0], (len(course), 1)), v_n=v_n)
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag), gnss=gnss)


@cache
def consistency(mode):
    """NEES at the end of each run, and squared normalised innovations, on its own model."""
    walk = (7e-4, 5e-4, 1e-4)
    flt = MultiModeAhrs(
        std_tilt=0.1, std_heading=0.1, std_gyr_bias=0.02, gyr_bias_noise=walk, gate=math.inf,
        reject_disturbed=False, **REFERENCE,
    )  # fmt: skip
    found, squares = [], {"acc": [], "mag": [], "course": []}
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        n, dt = 1000, 1.0 / RATE
        t = dt * np.arange(n)
        r_nb = sway.attitude(t, rng)
        bias = sway.walk(n, dt, 0.02, walk, rng)
        white = rng.standard_normal((3, n, 3))
        gyr = sway.rates(r_nb, dt) + bias + flt.gyr_noise / np.sqrt(dt) * white[0]
        acc = r_nb.inv().apply([0, 0, -G]) + math.sqrt(1.962361) * white[1]
        mag = r_nb.inv().apply(FIELD_N) + math.sqrt(7e-5) * 1e-4 * white[2]
        course = None
        if mode == 1:
            course = r_nb.as_euler("ZYX")[:, 0] + math.sqrt(0.001) * rng.standard_normal(n)
        rec = flight(t, r_nb, gyr, acc, mag, course)
        first = Rotation.from_rotvec(0.1 * rng.standard_normal(3)) * r_nb[0]
        sol, state = flt.advance(flt.init(attitude=first.as_quat()[[3, 0, 1, 2]]), rec)
        found.append(sway.nees(state, r_nb[-1], bias[-1]))
        for name, rows in sol.diagnostics.items():
            used = rows.outcome == 1
            squares[name].append((rows.innovation[used] / rows.sigma[used]) ** 2)
    return np.array(found), {
        name: np.concatenate(rows).ravel() for name, rows in squares.items() if rows
    }


@pytest.mark.parametrize("mode", [1, 2])
def test_mean_nees_lies_in_its_chi_square_interval(mode):
    found, _ = consistency(mode)
    low, high = chi2.ppf([0.005, 0.995], 6 * RUNS) / RUNS
    assert low < found.mean() < high


@pytest.mark.parametrize(("mode", "sensor"), [(1, "mag"), (1, "course"), (2, "mag"), (2, "acc")])
def test_innovations_have_the_size_that_is_stated(mode, sensor):
    squares = consistency(mode)[1][sensor]
    n = len(squares)
    assert n > 50_000
    low, high = chi2.ppf([0.005, 0.995], n) / n
    assert low < squares.mean() < high


def test_gravity_is_looked_at_only_without_gps():
    # the one before the first field has been used
    assert len(consistency(1)[1].get("acc", ())) <= 3 * RUNS
    assert "course" not in consistency(2)[1]


def swaying(seconds=20.0, seed=4):
    """A flight with noise and a loss of GPS from 8 to 14 s; fixes just before IMU samples."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    r_nb = sway.attitude(t, rng)
    course = r_nb.as_euler("ZYX")[:, 0]
    rec = flight(
        t, r_nb, sway.rates(r_nb, 1 / RATE) + [0.02, -0.01, 0.03],
        r_nb.inv().apply([0, 0, -G]) + 0.1 * rng.standard_normal((len(t), 3)),
        r_nb.inv().apply(FIELD_N), course, every=10,
    )  # fmt: skip
    kept = np.flatnonzero((rec.gnss.t < 8.0) | (rec.gnss.t > 14.0))
    return Recording(imu=rec.imu, mag=rec.mag, gnss=rec.gnss.rows(kept).shifted(-0.003)), r_nb


def test_fixes_correct_in_every_way_of_running():
    """Run, pieces and steps agree to the last bit; pieces end within the loss."""
    rec, _ = swaying()
    flt = MultiModeAhrs(**REFERENCE)
    whole = flt.run(rec)
    state, done = flt.init(), 0
    for a, b in ((-1.0, 0.99), (0.99, 7.999), (7.999, 11.0), (11.0, 99.0)):
        part, state = flt.advance(state, rec.between(a, b))
        streams.assert_same_bits(whole, part, rows=slice(done, done + len(part)))
        done += len(part)
    assert done == len(whole)
    state, states, j = flt.init(), [], 0
    for i, t in enumerate(rec.imu.t):
        aiding = {}
        while j < len(rec.gnss) and rec.gnss.t[j] <= t:
            row = np.full(14, np.nan)
            row[0], row[4:7] = rec.gnss.t[j], rec.gnss.v_n[j]
            aiding = {"gnss": row}
            j += 1
        state = flt.step(state, t, rec.imu.gyr[i], rec.imu.acc[i], rec.mag.mag[i], **aiding)
        states.append(state)
    streams.assert_same_bits(whole, streams.collect(states))


def test_run_on_the_first_part_is_the_first_part_of_run():
    rec, _ = swaying()
    flt = MultiModeAhrs(**REFERENCE)
    whole = flt.run(rec)
    for stop in (0.5, 7.0, 9.2, 15.0):
        part = flt.run(rec.between(-1.0, stop))
        streams.assert_same_bits(whole, part, rows=slice(0, len(part)))


def test_loss_of_gps_is_flagged_and_shows_in_the_diagnostics():
    rec, r_nb = swaying()
    sol = MultiModeAhrs(**REFERENCE).run(rec)
    out = (sol.status & Status.OUTAGE) > 0
    lost = np.flatnonzero(out) / RATE
    last, first = rec.gnss.t[rec.gnss.t < 8.0][-1], rec.gnss.t[rec.gnss.t > 14.0][0]
    assert lost[0] == pytest.approx(last + 1.5, abs=0.03)
    assert lost[-1] == pytest.approx(first, abs=0.03)
    assert set(sol.diagnostics) == {"acc", "mag", "course"}
    used = sol.diagnostics["acc"].t
    assert ((used >= lost[0]) & (used <= lost[-1]) | (used < 0.1)).all()
    off = (Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()).magnitude() / DEG
    assert off[500:].max() < 1.0


def test_without_a_magnetometer_the_course_makes_the_heading_true():
    rec, _ = swaying()
    flt = MultiModeAhrs()
    assert flt.run(rec).heading_reference == "magnetic"
    blind = Recording(imu=rec.imu, gnss=rec.gnss)
    assert flt.run(blind).heading_reference == "true"
    assert flt.run(Recording(imu=rec.imu)).heading_reference == "arbitrary"


def settled(flt, yaw, seconds=60.0, limit=2.0):
    """When the error falls below the limit for good, from the printed start [s]."""
    t = np.arange(round(seconds * RATE)) / RATE
    r_nb = Rotation.from_euler("ZYX", [yaw, 0.0, 0.0])
    rows = np.ones((len(t), 1))
    rec = flight(
        t, r_nb, 0 * rows * [0, 0, 0], rows * r_nb.inv().apply([0, 0, -G]),
        rows * r_nb.inv().apply(FIELD_N), yaw * rows[:, 0],
    )  # fmt: skip
    sol, _ = flt.advance(flt.init(attitude=[1, 0, 0, 0]), rec)
    off = (Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()).magnitude() / DEG
    bad = np.flatnonzero(off > limit)
    return np.inf if bad[-1] == len(off) - 1 else sol.t[bad[-1]]


def test_from_the_printed_start_the_exact_jacobian_finds_any_heading_the_printed_one_does_not():
    """At rest, within a minute; in the flight of spec D 18 the printed one takes 28 s."""
    exact = MultiModeAhrs(gate=math.inf, **REFERENCE)
    printed = MultiModeAhrs(gate=math.inf, heading_jacobian="printed", **REFERENCE)
    assert settled(exact, 90 * DEG) < 10.0
    assert settled(exact, 180 * DEG) < 30.0
    for yaw in (90 * DEG, 120 * DEG):
        assert settled(printed, yaw) == math.inf


def test_learned_reference_is_as_good_as_the_samples_that_it_is_the_mean_of():
    """One sample of 8 mG is 2 deg of dip, 250 of them a tenth: tilt stays that far off."""
    rng = np.random.default_rng(6)
    t = np.arange(round(40 * RATE)) / RATE
    r_nb = sway.attitude(np.clip(t - 10.0, 0.0, None), rng)
    field = r_nb.inv().apply(FIELD_N) + math.sqrt(7e-5) * 1e-4 * rng.standard_normal((len(t), 3))
    yaw = r_nb.as_euler("ZYX")[:, 0]
    rec = flight(t, r_nb, sway.rates(r_nb, 1 / RATE), r_nb.inv().apply([0, 0, -G]), field, yaw)
    off = {}
    for learn_time in (0.0, 5.0):
        flt = MultiModeAhrs(learn_time=learn_time, declination=REFERENCE["declination"])
        sol = flt.run(rec)
        e = (Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()).as_rotvec()[1000:, :2]
        off[learn_time] = np.sqrt(np.mean(np.sum(e**2, axis=1))) / DEG
    assert off[5.0] < 0.3
    assert off[5.0] < 0.5 * off[0.0]


def test_field_of_a_place_and_a_date():
    flt = MultiModeAhrs.at((41.1326 * DEG, 14.7823 * DEG, 100.0), 2012.0, course_std=0.02)
    # the thesis's own field, of an unknown model and day: 2 deg of declination, 57 of dip
    assert flt.declination / DEG == pytest.approx(1.9, abs=1.0)
    horizontal, down = flt.mag_reference
    assert np.degrees(np.arctan2(down, horizontal)) == pytest.approx(57.3, abs=1.5)
    assert flt.course_std == 0.02


def test_defaults_are_the_variances_of_the_program():
    flt = MultiModeAhrs()
    np.testing.assert_allclose(np.square(flt.gyr_bias_noise) * 50, [0.25e-4, 0.25e-4, 1e-8])
    assert flt.gyr_noise**2 * 50 == pytest.approx(1e-4)
    assert flt.mag_noise**2 * 25 == pytest.approx(7e-5 * 1e-8)  # gauss squared
    assert flt.course_std**2 == pytest.approx(0.001)
    printed = MultiModeAhrs.as_printed()
    assert printed.declination / DEG == pytest.approx(1.907, abs=5e-4)
    np.testing.assert_allclose(printed.mag_reference, [0.24776e-4, 0.3865e-4], atol=5e-10)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("gyr_bias_noise", (1e-4, -1e-4, 0.0), "`gyr_bias_noise` must be non-negative"),
        ("gyr_bias_noise", (1e-4, 1e-4), r"`gyr_bias_noise` must have shape \(3,\)"),
        ("course_std", 0.0, "`course_std` must be positive"),
        ("fix_timeout", 0.0, "`fix_timeout` must be positive"),
        ("min_speed", -1.0, "`min_speed` must be non-negative"),
        ("learn_time", -1.0, "`learn_time` must be non-negative"),
        ("mag_reference", (0.0, 4e-5), "`mag_reference` must be positive"),
        ("heading_jacobian", "levelled", "`heading_jacobian` must be one of exact, printed"),
    ],
)
def test_parameters_out_of_range_are_refused(name, value, sentence):
    with pytest.raises(ValueError, match=sentence):
        MultiModeAhrs(**{name: value})
