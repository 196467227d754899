"""Thesis E's attitude filter and its Control Unit, on motions in closed form."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth import hand

from strapdown.attitude import AdaptiveEkf
from strapdown.recording import Gnss, Imu, Mag, Recording, Temperature
from strapdown.solution import Outcome, Status

G = 9.80665
FIELD_N = np.array([2e-5, 0.0, 4e-5])
LLA = np.array([0.69, 0.28, 250.0])
RADIUS = 6.37e6
RATE = 50.0


def log(r_nb, t, *, acc_n=0.0, bias=(0.0, 0.0, 0.0), field_n=FIELD_N, noise=0.0, seed=1):
    """Samples of ideal sensors: mean rates over the intervals, force and field at their ends."""
    rng = np.random.default_rng(seed)
    gyr = (r_nb[:-1].inv() * r_nb[1:]).as_rotvec() / np.diff(t)[:, None]
    gyr = np.concatenate((gyr[:1], gyr)) + bias
    acc = r_nb.inv().apply(np.zeros_like(gyr) + acc_n - [0, 0, G])
    mag = r_nb.inv().apply(np.zeros_like(gyr) + field_n)
    gyr = gyr + noise * 0.01 * rng.standard_normal(gyr.shape)
    acc = acc + noise * 0.1 * rng.standard_normal(gyr.shape)
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))


def times(seconds):
    return np.arange(round(seconds * RATE)) / RATE


def resting(seconds, yaw=0.5, **how):
    t = times(seconds)
    r_nb = Rotation.from_euler("ZYX", np.tile([yaw, 0.1, -0.2], (len(t), 1)))
    return log(r_nb, t, **how), r_nb


def turning(seconds, rate=0.4, **how):
    """Level, about down, from rest: fast enough not to be uniform motion."""
    t = times(seconds)
    yaw = rate * np.maximum(t - 2.0, 0.0)
    r_nb = Rotation.from_euler("Z", yaw[:, None])
    return log(r_nb, t, **how), r_nb


def circle(seconds, speed=10.0, rate=0.25, start=2.0):
    """A vehicle that pulls away and drives a circle, with fixes every half second."""
    t = times(seconds)
    u = np.clip(t - start, 0.0, 4.0) * speed / 4.0
    du = np.where((t > start) & (t < start + 4.0), speed / 4.0, 0.0)
    w = rate * u / speed
    yaw = np.concatenate(([0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) / RATE)))
    r_nb = Rotation.from_euler("Z", yaw[:, None])
    acc_n = r_nb.apply(np.stack((du, w * u, 0.0 * u), axis=1))
    v_n = r_nb.apply(np.stack((u, 0.0 * u, 0.0 * u), axis=1))
    way = np.concatenate((np.zeros((1, 3)), np.cumsum(0.5 * (v_n[1:] + v_n[:-1]) / RATE, axis=0)))
    fixes = slice(0, None, round(RATE / 2))
    lla = LLA + way * [1 / RADIUS, 1 / (RADIUS * np.cos(LLA[0])), -1.0]
    rec = log(r_nb, t, acc_n=acc_n)
    return replace(rec, gnss=Gnss(t=t[fixes], lla=lla[fixes], v_n=v_n[fixes])), r_nb


def unit(sol, name):
    """A row per run of the filter of what the Control Unit decided."""
    found = sol.diagnostics["control_unit"]
    return found.innovation[:, found.labels.index(name)]


# --- modes -----------------------------------------------------------------------------


def test_alignment_lasts_while_the_box_rests_and_measures_by_master_slave():
    rec, _ = resting(20.0)
    sol = AdaptiveEkf(reset_every=np.inf, uniform_time=1e3).run(rec)
    found = sol.diagnostics["control_unit"]
    mode = unit(sol, "mode")
    assert set(mode[found.t < 9.9]) == {0.0}
    assert set(mode[found.t > 10.1]) == {1.0}
    assert not unit(sol, "gauss_newton")[found.t < 9.9].any()
    assert unit(sol, "gauss_newton")[found.t > 10.1].all()


def test_motion_ends_alignment():
    rec, _ = turning(6.0)
    sol = AdaptiveEkf(uniform_time=1e3).run(rec)
    mode = unit(sol, "mode")
    assert mode[0] == 0.0
    assert mode[-1] == 1.0


def test_modes_follow_the_receiver():
    rec, _ = circle(40.0)
    fixes = rec.gnss.rows((rec.gnss.t < 15.0) | (rec.gnss.t > 25.0))
    sol = AdaptiveEkf().run(replace(rec, gnss=fixes))
    found = sol.diagnostics["control_unit"]
    mode = dict(zip(np.round(found.t), unit(sol, "mode"), strict=True))
    assert [mode[k] for k in (1.0, 10.0, 20.0, 30.0)] == [0.0, 2.0, 1.0, 2.0]
    outage = rec.imu.t[(sol.status & Status.OUTAGE) > 0]
    # from `fix_timeout` after the last fix, at 14.5 s, to the next one, at 25.5 s
    assert outage[0] == pytest.approx(17.0, abs=0.03)
    assert outage[-1] == pytest.approx(25.48, abs=0.03)
    assert np.all(np.diff(outage) < 0.03)


def test_attitude_filter_runs_every_period_and_waits_for_a_slow_field():
    rec, _ = turning(30.0)
    sol = AdaptiveEkf(period=0.5).run(rec)
    assert np.diff(sol.diagnostics["control_unit"].t) == pytest.approx(0.5, abs=0.021)
    slow = replace(rec, mag=rec.mag.rows(slice(7, None, 60)))  # every 1.2 s
    found = AdaptiveEkf().run(slow).diagnostics["control_unit"].t
    assert np.isin(np.round(found[1:], 2), np.round(slow.mag.t, 2)).all()


# --- what it estimates -----------------------------------------------------------------


@pytest.mark.parametrize("method", ["auto", "master-slave", "gauss-newton"])
@pytest.mark.parametrize("use_down", [True, False])
def test_bias_is_found_while_turning_by_either_measurement(method, use_down):
    bias = np.array([0.02, -0.03, 0.04])
    rec, r_nb = turning(120.0, bias=bias)
    flt = AdaptiveEkf(method=method, use_down=use_down, quat_std=(0.005, 0.01, 0.01))
    sol = flt.run(rec)
    np.testing.assert_allclose(sol.gyr_bias[-1], bias, atol=1e-3)
    assert hand.degrees_off(sol.q_nb, r_nb)[rec.imu.t > 100.0].max() < 0.1
    # a run in mode 0 comes once or twice in alignment
    share = unit(sol, "gauss_newton").mean()
    assert (share == 0.0) if method == "master-slave" else (share > 0.9)


def test_reference_field_is_learned_from_a_tilted_box():
    """Its strength and dip serve Gauss-Newton when the box stands otherwise."""
    t = times(60.0)
    yaw = 0.4 * np.maximum(t - 2.0, 0.0)
    r_nb = Rotation.from_euler("ZYX", np.column_stack((yaw, 0.0 * t + 0.4, 0.0 * t - 0.7)))
    rec = log(r_nb, t)
    sol = AdaptiveEkf(quat_std=(0.005, 0.01, 0.01)).run(rec)
    assert hand.degrees_off(sol.q_nb, r_nb).max() < 0.05
    field = AdaptiveEkf(mag_reference=(2e-5, 4e-5), quat_std=(0.005, 0.01, 0.01)).run(rec)
    np.testing.assert_allclose(sol.q_nb, field.q_nb, atol=1e-6)


@pytest.mark.parametrize("integration", ["exact", "square", "inverse"])
def test_every_integration_follows_a_turn(integration):
    rec, r_nb = turning(60.0)
    sol = AdaptiveEkf(integration=integration).run(rec)
    # first order: atan(w dt / 2) for w dt / 2 leaves w^3 dt^2 / 12 = 2e-6 rad/s
    assert hand.degrees_off(sol.q_nb, r_nb).max() < 0.05


def test_as_printed_it_converges_with_half_a_degree_of_lag():
    """From P_0 of 1e10; the covariance is carried by the rate at the end of each second."""
    rec, r_nb = turning(120.0, bias=[0.02, -0.03, 0.04])
    sol = AdaptiveEkf.as_printed().run(rec)
    late = rec.imu.t > 60.0
    assert hand.degrees_off(sol.q_nb, r_nb)[late].max() < 2.0
    np.testing.assert_allclose(sol.gyr_bias[-1], [0.02, -0.03, 0.04], atol=5e-3)
    assert AdaptiveEkf.as_printed(period=2.0).period == 2.0


def test_gps_speed_takes_the_acceleration_of_turns_out_of_the_vertical():
    """2.5 m/s^2 sideways tilt the vertical by 14 deg; with (7.5.9) hardly anything is left."""
    rec, r_nb = circle(60.0)
    late = rec.imu.t > 20.0
    flt = AdaptiveEkf(k_acc=(0.0, 0.0, 0.0), base_rate=(1.0, 1.0, 1.0))
    aided = hand.degrees_off(flt.run(rec).q_nb, r_nb)[late]
    alone = hand.degrees_off(flt.run(replace(rec, gnss=None)).q_nb, r_nb)[late]
    assert aided.max() < 1.0
    assert alone.max() > 5.0


def test_adaptive_covariance_trusts_a_turning_box_less():
    """Without a receiver: the measured tilt is off by 14 deg, which R knows in time."""
    rec, r_nb = circle(16.0)
    rec = replace(rec, gnss=None)
    off = [
        hand.degrees_off(AdaptiveEkf(k_acc=(0.0, 0.0, k)).run(rec).q_nb, r_nb).max()
        for k in (0.0, 3.0, 10.0)
    ]
    assert off[0] > off[1] > off[2]


@pytest.mark.parametrize("exponent", ["linear", "root"])
def test_r_in_use_is_that_of_table_7_3(exponent):
    rec, _ = circle(30.0)
    flt = AdaptiveEkf(exponent=exponent)
    sol = flt.run(rec)
    found = sol.diagnostics["control_unit"]
    for at, mode in ((1.0, 0), (20.0, 2)):
        row = np.argmin(np.abs(found.t - at))
        assert unit(sol, "mode")[row] == mode
        k = np.argmin(np.abs(rec.imu.t - found.t[row]))
        d = abs(np.linalg.norm(rec.imu.acc[k]) - flt.gravity)
        column = 1 if mode == 2 else 0
        exponent_of = flt.k_acc[column] * d
        if exponent == "root":
            exponent_of = np.sqrt(exponent_of)
        rate = abs(rec.imu.gyr[k, 2] - sol.gyr_bias[k - 1, 2])
        want = flt.quat_std[column] ** 2 * 10**exponent_of * flt.base_rate[column] ** rate
        assert unit(sol, "r")[row] == pytest.approx(want, rel=1e-6)


def test_course_gives_heading_where_there_is_no_field():
    rec, r_nb = circle(60.0)
    rec = replace(rec, mag=None)
    sol = AdaptiveEkf(min_speed=3.0).run(rec)
    assert sol.heading_reference == "true"
    off = hand.rotvec_off(sol.q_nb, r_nb)
    # a fix's course is up to half a second old, 7 deg of the circle, in every second of gyro
    assert np.degrees(np.abs(off[rec.imu.t > 30.0, 2])).max() < 8.0
    turned = AdaptiveEkf(min_speed=3.0, mount=(0.0, 0.0, 1.0)).run(
        replace(rec, imu=replace(rec.imu, gyr=_about_z(rec.imu.gyr), acc=_about_z(rec.imu.acc)))
    )
    # q_nb of a box turned by the mount is that of the vehicle times the mount
    back = Rotation.from_quat(turned.q_nb[:, [1, 2, 3, 0]]) * Rotation.from_euler("Z", -1.0)
    same = hand.degrees_off(sol.q_nb, back)
    assert same[rec.imu.t > 30.0].max() < 1.0


def _about_z(v):
    """Components in a box that stands turned by 1 rad in the vehicle."""
    return Rotation.from_euler("Z", -1.0).apply(v)


def test_temperature_and_calibration_are_compensated():
    rec, _ = turning(60.0)
    S = np.array([[1.02, 0.01, 0.0], [0.0, 0.97, 0.02], [-0.01, 0.0, 1.01]])
    offset, slope = np.array([0.05, -0.02, 0.03]), np.array([1e-3, -2e-3, 3e-3])
    warm = Temperature(t=np.array([-1.0]), temp_degc=np.array([40.0]))
    spoiled = rec.imu.gyr @ S.T + (slope * 15.0) @ S.T + offset
    spoiled = replace(rec, imu=replace(rec.imu, gyr=spoiled), temperature=warm)
    flt = AdaptiveEkf(
        gyr_matrix=tuple(S.ravel()), gyr_offset=tuple(offset), gyr_slope=tuple(slope)
    )
    want, got = AdaptiveEkf().run(rec), flt.run(spoiled)
    np.testing.assert_allclose(got.q_nb, want.q_nb, atol=1e-9)
    state = flt.step(flt.init(), 0.0, spoiled.imu.gyr[0], spoiled.imu.acc[0], temperature=40.0)
    np.testing.assert_allclose(state.q_nb, got.q_nb[0], atol=0.3)  # no field yet: tilt only
    one, _ = flt.advance(flt.init(), replace(spoiled, mag=None).between(-2.0, 0.001))
    assert np.array_equal(one.q_nb[0], state.q_nb)


def test_world_model_gives_declination_and_reference_field():
    flt = AdaptiveEkf.at(LLA, dt.date(2025, 6, 1), stop=0.005)
    assert flt.declination == pytest.approx(np.radians(4.3), abs=np.radians(0.5))
    horizontal, down = flt.mag_reference
    assert 2.4e-5 < horizontal < 2.8e-5  # 16 deg E, 39.5 deg N
    assert 3.4e-5 < down < 4.0e-5
    assert flt.stop == 0.005


# --- resets, rejection -----------------------------------------------------------------


def test_uniform_motion_resets_the_attitude():
    rec, _ = resting(100.0, bias=[0.0, 0.0, 0.002], noise=1.0)
    sol = AdaptiveEkf(reset_every=20.0).run(rec)
    found = sol.diagnostics["control_unit"]
    resets = found.t[unit(sol, "reset") > 0.0]
    assert np.diff(resets) == pytest.approx(20.0, abs=1.01)
    assert resets[0] == pytest.approx(20.0, abs=1.01)
    assert np.all(sol.status[rec.imu.t > 6.0] & Status.REST)
    none = AdaptiveEkf(reset_every=np.inf).run(rec)
    assert not unit(none, "reset").any()


def test_no_reset_while_speed_changes_or_the_box_turns():
    for rec, _ in (circle(60.0), turning(60.0)):
        sol = AdaptiveEkf(reset_every=5.0).run(rec)
        assert not unit(sol, "reset").any()
        assert not np.any(sol.status[rec.imu.t > 6.0] & Status.REST)


@pytest.mark.parametrize("hold", ["corrections", "bias"])
def test_bias_waits_after_a_reset(hold):
    rec, _ = resting(60.0, bias=[0.01, 0.0, 0.0], noise=0.3)
    flt = AdaptiveEkf(reset_every=20.0, hold_time=4.5, hold=hold)
    sol = flt.run(rec)
    found = sol.diagnostics["control_unit"]
    reset = found.t[unit(sol, "reset") > 0.0][0]
    held = (rec.imu.t >= reset) & (rec.imu.t < reset + 4.4)
    assert np.all(sol.gyr_bias[held] == sol.gyr_bias[held][0])
    moved = (rec.imu.t > reset + 4.6) & (rec.imu.t < reset + 6.0)
    assert np.any(sol.gyr_bias[moved] != sol.gyr_bias[held][0])
    turned = hand.rotvec_off(
        sol.q_nb[held][[40]], Rotation.from_quat(sol.q_nb[held][[1], :][:, [1, 2, 3, 0]])
    )
    # 39 samples without a measurement in between: with the bias withheld it turns by 0.01 rad/s
    unseen = 0.01 * 39 / RATE
    assert np.linalg.norm(turned) == pytest.approx(unseen if hold == "bias" else 0.0, abs=2e-3)


def test_other_sign_of_the_same_attitude_is_no_residual():
    """Start on the quaternion's other side; every measurement comes with w > 0 or < 0."""
    rec, r_nb = resting(5.0, yaw=0.0)
    q = hand.scalar_first(r_nb)[0]
    for sign in (1.0, -1.0):
        sol, _ = AdaptiveEkf().advance(AdaptiveEkf().init(attitude=sign * q), rec)
        assert np.all(sol.diagnostics["attitude"].outcome == Outcome.ACCEPTED)
        assert hand.degrees_off(sol.q_nb, r_nb).max() < 1e-4


def disturbed(seconds, start, stop):
    """Turning slowly, with a magnet that turns the field by 70 deg for a while."""
    t = times(seconds)
    r_nb = Rotation.from_euler("Z", 0.15 * t[:, None])
    field = np.tile(FIELD_N, (len(t), 1))
    near = (t > start) & (t < stop)
    field[near] = Rotation.from_euler("Z", 70, degrees=True).apply(FIELD_N)
    return log(r_nb, t, field_n=field), r_nb


def test_measurement_that_is_far_off_is_rejected_and_flagged():
    rec, r_nb = disturbed(40.0, 20.0, 26.0)
    sol = AdaptiveEkf().run(rec)
    found = sol.diagnostics["attitude"]
    rejected = found.t[found.outcome == Outcome.REJECTED_GATE]
    assert rejected.min() > 20.0
    assert rejected.max() < 26.1
    assert len(rejected) == 5
    flagged = rec.imu.t[(sol.status & Status.AIDING_REJECTED) > 0]
    np.testing.assert_allclose(flagged, rejected)
    # the chord of 70 deg: a field turned to the east looks like a heading turned to the west
    bad = found.innovation[found.outcome == Outcome.REJECTED_GATE]
    want = [0.0, 0.0, -2.0 * np.sin(np.radians(35.0))]
    np.testing.assert_allclose(bad, np.tile(want, (5, 1)), atol=0.02)
    assert hand.degrees_off(sol.q_nb, r_nb).max() < 0.5
    trusting = AdaptiveEkf(limit=3.0).run(rec)
    assert hand.degrees_off(trusting.q_nb, r_nb).max() > 5.0


def test_rejections_that_last_end_in_a_reset():
    rec, r_nb = disturbed(60.0, 20.0, 100.0)
    sol = AdaptiveEkf(recover=8.0).run(rec)
    found = sol.diagnostics["control_unit"]
    resets = found.t[unit(sol, "reset") > 0.0]
    assert resets[0] == pytest.approx(20.0 + 9.0, abs=1.01)
    off = np.degrees(hand.rotvec_off(sol.q_nb, r_nb)[:, 2])
    # the measured field is now believed; it was taken at one instant
    assert abs(off[-1]) == pytest.approx(70.0, abs=2.0)


def test_quaternion_residual_beyond_one_is_rejected_in_alignment_too():
    """120 deg; the Euler residuals are not looked at there."""
    rec, r_nb = resting(8.0)
    for degrees, accepted in ((100.0, True), (150.0, False)):
        wrong = Rotation.from_euler("Z", degrees, degrees=True) * r_nb[0]
        start = AdaptiveEkf().init(attitude=wrong.as_quat()[[3, 0, 1, 2]])
        sol, _ = AdaptiveEkf().advance(start, rec)
        first = sol.diagnostics["attitude"].outcome[0]
        assert first == (Outcome.ACCEPTED if accepted else Outcome.REJECTED_GATE)


# --- bad input -------------------------------------------------------------------------

BAD = [
    ({"gyr_noise": 0.0}, "`gyr_noise` must be positive"),
    ({"period": -1.0}, "`period` must be positive"),
    ({"hold_time": -1.0}, "`hold_time` must be"),
    ({"reset_every": 0.0}, "`reset_every` must be positive"),
    ({"quat_std": (0.1, 0.0, 0.1)}, "`quat_std` must be positive"),
    ({"bias_walk": (0.1, -0.1, 0.1)}, "`bias_walk` must be at least 0"),
    ({"base_rate": (1.0, 0.5, 1.0)}, "`base_rate` must be at least 1"),
    ({"k_acc": (0.0, 1.0)}, "`k_acc` must have shape"),
    ({"exponent": "square"}, "`exponent` must be"),
    ({"propagation": "never"}, "`propagation` must be"),
    ({"integration": "none"}, "`integration` must be"),
    ({"method": "triad"}, "`method` must be"),
    ({"roll": "sine"}, "`roll` must be"),
    ({"hold": "all"}, "`hold` must be"),
    ({"use_down": 1}, "`use_down` must be True or False"),
    ({"gyr_matrix": (0.0,) * 9}, "`gyr_matrix` must be near the identity"),
    ({"mag_reference": (0.0, 4e-5)}, "`mag_reference` must be positive"),
    ({"mount": (np.nan, 0.0, 0.0)}, "`mount` must be finite"),
]


@pytest.mark.parametrize(("parameters", "message"), BAD, ids=[next(iter(b[0])) for b in BAD])
def test_impossible_parameter_is_refused(parameters, message):
    with pytest.raises((ValueError, TypeError), match=message):
        AdaptiveEkf(**parameters)


def test_temperature_must_be_a_number():
    flt = AdaptiveEkf()
    with pytest.raises(ValueError, match="`temperature` must be finite"):
        flt.step(flt.init(), 0.0, [0, 0, 0], [0, 0, -G], temperature=np.nan)


def test_impossible_fixes_and_temperatures_are_left_out():
    rec, r_nb = circle(30.0)
    lla = rec.gnss.lla.copy()
    lla[20:24, 0] = np.nan
    v_n = rec.gnss.v_n.copy()
    v_n[30:34] = 1e30
    warm = Temperature(t=np.array([0.0, 1.0]), temp_degc=np.array([np.nan, 25.0]))
    bad = replace(rec, gnss=replace(rec.gnss, lla=lla, v_n=v_n), temperature=warm)
    sol = AdaptiveEkf().run(bad)
    assert np.isfinite(sol.q_nb).all()
    assert np.count_nonzero(sol.status & Status.AIDING_REJECTED) == 4
    clean = hand.degrees_off(AdaptiveEkf().run(rec).q_nb, r_nb).max()
    # two seconds without a speed: a vertical that is off by 14 deg counts a few times
    assert hand.degrees_off(sol.q_nb, r_nb).max() < clean + 3.0


@pytest.mark.parametrize("propagation", ["sampled", "printed"])
@pytest.mark.parametrize("integration", ["exact", "square", "inverse"])
def test_measurements_surer_than_rounding_and_wild_samples_leave_all_finite(
    propagation, integration
):
    """P_0 of 1e10 beside R of 1e-24; turns of many radians between samples up to 30 s apart."""
    rng = np.random.default_rng(6)
    t = np.cumsum(10.0 ** rng.uniform(-3.0, 1.5, 600))
    gyr, acc = 10.0 ** rng.uniform(-3, 4, (2, 600, 1)) * rng.standard_normal((2, 600, 3))
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=2e-5 * rng.standard_normal((600, 3)))
    )
    flt = AdaptiveEkf(
        propagation=propagation, integration=integration, quat_std=(1e-12,) * 3, std_attitude=1e5,
        std_gyr_bias=1e5, limit=7.0,
    )  # fmt: skip
    sol, state = flt.advance(flt.init(), rec)
    for name in ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias"):
        assert np.isfinite(getattr(sol, name)).all(), name
    np.testing.assert_allclose(np.linalg.norm(sol.q_nb, axis=1), 1.0, atol=1e-12)
    assert np.isfinite(state.P).all()
