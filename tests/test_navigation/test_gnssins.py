"""The complete system of thesis E on simulated drives with a closed-form truth."""

from dataclasses import replace
from itertools import pairwise

import drive
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from strapdown.errors import MissingStream
from strapdown.kernels import memory as m
from strapdown.kernels.gnssins import layout as lay
from strapdown.navigation import Gnssins, NavigationTracker
from strapdown.recording import Gnss, Imu, Mag, Recording
from strapdown.solution import Outcome, Status

FIELD_N = np.array([2.1e-5, 0.1e-5, 4.2e-5])
FLT = Gnssins(declination=float(np.arctan2(FIELD_N[1], FIELD_N[0])))
ARRAYS = (
    "q_nb", "lla", "v_n", "gyr_bias", "acc_bias", "std_attitude_n", "std_position_n",
    "std_velocity_n", "std_acc_bias", "status",
)  # fmt: skip


def with_field(d):
    """The drive's recording and a magnetometer at 20 Hz."""
    noise = 3e-7 * np.random.default_rng(1).standard_normal((len(d.t), 3))
    field = np.einsum("kji,j->ki", d.C_nb, FIELD_N) + noise
    return replace(d.rec, mag=Mag(t=d.t[::5], mag=field[::5]))


@pytest.fixture(scope="module")
def city():
    return drive.simulate(seed=3)


@pytest.fixture(scope="module")
def rec(city):
    return with_field(city)


def rms(x, rows=slice(None)):
    return np.sqrt(np.mean(np.square(x[rows]), axis=0))


def attitude_off(sol, d):
    return np.degrees(drive.attitude_error(sol.q_nb, d.C_nb))


def position_off(sol, d):
    return drive.ned_error(sol.lla.copy(), d.lla)


def same(a, b, n=None):
    for name in ARRAYS:
        x, y = getattr(a, name)[:n], getattr(b, name)[:n]
        np.testing.assert_array_equal(x, y, err_msg=name)


def without(rec, *windows):
    keep = np.ones(len(rec.gnss), bool)
    for a, b in windows:
        keep &= (rec.gnss.t < a) | (rec.gnss.t > b)
    return replace(rec, gnss=rec.gnss.rows(keep))


# --- what it finds ----------------------------------------------------------------------


@pytest.mark.parametrize("states", [9, 12])
@pytest.mark.parametrize("bias_frame", ["body", "local"])
def test_drive_with_all_sensors_is_followed(city, rec, states, bias_frame):
    sol = replace(FLT, states=states, bias_frame=bias_frame).run(rec)
    late = city.t > 60.0
    # fixes with 0.5 m of slow error at 0.5 m off the box; tilt by what speed cannot explain
    assert rms(position_off(sol, city), late).max() < 1.0
    assert rms(sol.v_n - city.v_n, late).max() < 0.15
    assert (rms(attitude_off(sol, city), late) < [1.0, 1.0, 2.0]).all()
    np.testing.assert_allclose(sol.gyr_bias[-1], city.gyr_bias, atol=np.radians(0.1))
    assert sol.heading_reference == "true"
    assert not np.any(sol.status[late] & (Status.ALIGNING | Status.OUTAGE))


def test_without_a_field_navigation_begins_with_the_first_course(city):
    sol = Gnssins().run(city.rec)
    begun = city.t[np.argmax((sol.status & Status.ALIGNING) == 0)]
    first = city.t[np.argmax(city.speed > Gnssins().min_speed)]
    assert first < begun < first + 2.5  # a fix, a run of the filter, and the next fix
    early = city.t < begun
    assert np.array_equal(sol.q_nb[early], np.tile([1.0, 0, 0, 0], (early.sum(), 1)))
    late = city.t > 60.0
    assert (rms(attitude_off(sol, city), late) < [1.0, 1.0, 2.0]).all()
    assert rms(position_off(sol, city), late).max() < 1.0


def test_before_navigation_the_fix_is_what_is_known(city, rec):
    sol = FLT.run(rec)
    first = np.argmax(rec.imu.t >= rec.gnss.t[0])
    assert np.isnan(sol.lla[:first]).all()
    blind = Gnssins().run(city.rec)
    np.testing.assert_allclose(blind.lla[first], rec.gnss.lla[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(blind.std_position_n[first], rec.gnss.std_position_n[0])


def test_navigation_begins_as_sure_as_its_fix(rec):
    for own, want in ((True, [0.5, 0.25]), (False, [3.0, 2.0])):
        sol = replace(FLT, receiver_sigmas=own).run(rec.between(-1.0, 5.0))
        begun = np.argmax((sol.status & Status.ALIGNING) == 0)
        got = sol.std_position_n[begun, 0], sol.std_velocity_n[begun, 0]
        np.testing.assert_allclose(got, want, rtol=1e-12)


def test_mounted_box_gives_the_same_track(city):
    mount = (0.3, -0.2, 1.4)
    C_vb = Rotation.from_euler("ZYX", mount[::-1]).as_matrix()
    turned = drive.simulate(seed=3, C_vb=C_vb)
    flt = Gnssins(mount=mount)
    sol = flt.run(turned.rec)
    late = turned.t > 60.0
    assert (rms(attitude_off(sol, turned), late) < [1.0, 1.0, 2.0]).all()
    assert rms(position_off(sol, turned), late).max() < 1.0
    np.testing.assert_allclose(Rotation.from_quat(sol.q_vb[-1][[1, 2, 3, 0]]).as_matrix(), C_vb)


def test_as_printed_it_works_with_its_own_sensors_noise(city, rec):
    """R and Q of the tables, P_0 of 1e6, once a second."""
    sol = Gnssins.as_printed(declination=FLT.declination).run(rec)
    late = city.t > 60.0
    assert rms(position_off(sol, city), late).max() < 1.5
    assert rms(sol.v_n - city.v_n, late).max() < 0.3
    assert np.diff(sol.diagnostics["gnss_position"].t) == pytest.approx(1.0, abs=0.02)
    nine = Gnssins.as_printed(states=9, declination=FLT.declination).run(rec)
    assert rms(position_off(nine, city), late).max() < 1.5


def test_a_fix_counts_at_its_own_time(city, rec):
    """Fixes between two samples of a slow IMU: 0.1 s of 14 m/s would be metres."""
    slow = replace(rec, imu=rec.imu.rows(slice(None, None, 10)))
    sol = FLT.run(slow)
    late = slow.imu.t > 60.0
    moved = replace(slow, gnss=replace(slow.gnss, t=slow.gnss.t - 0.05))
    ahead = FLT.run(moved)
    along = np.einsum("ij,ij->i", ahead.v_n, drive.ned_error(ahead.lla.copy(), sol.lla))[late]
    fast = np.linalg.norm(sol.v_n, axis=1)[late] > 10.0
    # a fix that says it is 50 ms older than it is puts the box ahead by 50 ms
    assert np.median(along[fast] / np.linalg.norm(ahead.v_n[late][fast], axis=1) ** 2) == (
        pytest.approx(0.05, abs=0.01)
    )


# --- Control Unit -----------------------------------------------------------------------


def test_outage_is_flagged_and_ends_with_the_next_fix(city, rec):
    start, stop = 100.0, 130.0
    sol = FLT.run(without(rec, (start, stop)))
    flagged = rec.imu.t[(sol.status & Status.OUTAGE) > 0]
    assert start + 1.5 < flagged[0] < start + FLT.fix_timeout + 0.6
    assert stop - 0.1 < flagged[-1] < stop + 0.6
    off = np.linalg.norm(position_off(sol, city)[:, :2], axis=1)
    k = np.argmin(np.abs(rec.imu.t - stop))
    assert off[k] < 150.0  # a degree of tilt is 0.17 m/s^2: 77 m in 30 s
    assert off[rec.imu.t > stop + 10.0].max() < 3.0
    assert sol.std_position_n[k].max() > 10.0 * sol.std_position_n[k - 3500].max()


def test_jump_of_the_fixes_is_rejected_and_a_lasting_one_believed(city, rec):
    k = np.arange(len(rec.gnss))
    for start, length, kept in ((200, 6, True), (200, 1000, False)):
        jump = (k >= start) & (k < start + length)
        lla = rec.gnss.lla.copy()
        lla[jump, 0] += 2400.0 / drive.A
        sol = FLT.run(replace(rec, gnss=replace(rec.gnss, lla=lla)))
        found = sol.diagnostics["gnss_position"]
        rejected = found.t[found.outcome == Outcome.REJECTED_GATE]
        assert rejected[0] == pytest.approx(rec.gnss.t[start], abs=0.02)
        north = position_off(sol, city)[:, 0]
        at = rec.imu.t > rec.gnss.t[start] + FLT.recover + 2.0
        if kept:
            assert len(rejected) == length
            assert np.nanmax(np.abs(north)) < 30.0
        else:
            assert north[at] == pytest.approx(2400.0, abs=10.0)
            assert rejected[-1] - rejected[0] == pytest.approx(FLT.recover, abs=0.6)


def test_modes_of_a_drive_are_those_of_the_thesis(city, rec):
    found = FLT.run(without(rec, (100.0, 130.0))).diagnostics["control_unit"]
    mode = found.innovation[:, 0]
    assert set(mode[found.t < 9.0]) == {0.0}  # it stands for 20 s
    assert set(mode[(found.t > 104.0) & (found.t < 119.0)]) <= {0.0, 1.0}
    assert set(mode[(found.t > 135.0) & (found.t < 185.0)]) <= {0.0, 2.0}
    assert 2.0 in mode
    assert 1.0 in mode


# --- one kernel -------------------------------------------------------------------------


@pytest.mark.parametrize("flt", [FLT, Gnssins.as_printed(states=9)], ids=["default", "printed"])
def test_any_split_and_single_steps_give_the_bits_of_run(rec, flt):
    part = without(rec.between(15.0, 45.0), (30.0, 36.0))
    whole = flt.run(part)
    rng = np.random.default_rng(2)
    for _ in range(3):
        cuts = [-np.inf, *np.sort(rng.uniform(15.0, 45.0, 5)), np.inf]
        state, done = flt.init(), 0
        for a, b in pairwise(cuts):
            sol, state = flt.advance(state, part.between(a, b))
            for name in ARRAYS:
                np.testing.assert_array_equal(
                    getattr(sol, name), getattr(whole, name)[done : done + len(sol)]
                )
            done += len(sol)
        assert done == len(whole)
    state, j, i = flt.init(), 0, 0
    for k, t in enumerate(part.imu.t):
        aiding, field = {}, None
        while j < len(part.gnss) and part.gnss.t[j] <= t:
            g = part.gnss
            aiding["gnss"] = [
                g.t[j], *g.lla[j], *g.v_n[j], *g.std_position_n[j], *g.std_velocity_n[j], np.nan
            ]  # fmt: skip
            j += 1
        while i < len(part.mag) and part.mag.t[i] <= t:
            field = part.mag.mag[i]
            i += 1
        state = flt.step(state, t, part.imu.gyr[k], part.imu.acc[k], field, **aiding)
        np.testing.assert_array_equal(state.q_nb, whole.q_nb[k])
        np.testing.assert_array_equal(state.x[m.LLA : m.LLA + 3], whole.lla[k])
        assert state.status == whole.status[k]


@pytest.mark.parametrize("stop", [0.3, 24.9, 31.7, 111.1])
def test_run_on_the_first_part_is_the_first_part_of_run(rec, stop):
    part = rec.between(-1.0, stop)
    same(FLT.run(rec), FLT.run(part), len(part.imu))


def test_tracker_takes_late_fixes_and_the_field(rec):
    part = rec.between(15.0, 40.0)
    whole, trk = FLT.run(part), FLT.tracker()
    assert isinstance(trk, NavigationTracker)
    g, j, i = part.gnss, 0, 0
    for k, t in enumerate(part.imu.t):
        field = None
        while i < len(part.mag) and part.mag.t[i] <= t:
            field = part.mag.mag[i]
            i += 1
        # 0.3 s late, the last ones just in time
        while j < len(g) and min(g.t[j] + 0.3, part.imu.t[-2]) <= t:
            trk.add_gnss(g.t[j], g.lla[j], g.v_n[j], g.std_position_n[j], g.std_velocity_n[j])
            j += 1
        trk.update(t, part.imu.gyr[k], part.imu.acc[k], field)
    assert j == len(g)
    np.testing.assert_array_equal(trk.lla, whole.lla[-1])
    np.testing.assert_array_equal(trk.q_nb, whole.q_nb[-1])


# --- honest covariance -----------------------------------------------------------------

RUNS = 100
PLACE = np.array([0.7, 0.2, 100.0])
TURN = Rotation.from_euler("ZYX", [1.3, 0.2, -0.5])


def consistent(seed, flt):
    """Errors over sigmas of one run of a standing box whose force errors are the filter's own."""
    rng = np.random.default_rng(seed)
    rate, n = 25.0, 1000
    h, t = 1.0 / rate, np.arange(1, n + 1) / rate
    M, N = drive.radii(PLACE[0])
    per_metre = 1.0 / np.array([M + PLACE[2], (N + PLACE[2]) * np.cos(PLACE[0]), -1.0])

    def walk(start, step):
        steps = step * np.sqrt(h) * rng.standard_normal((n, 3))
        return start * rng.standard_normal(3) + np.cumsum(steps, axis=0)

    a = walk(flt.std_acc, flt.acc_walk)
    b = walk(flt.std_acc_bias, flt.acc_bias_walk) if flt.states == 12 else np.zeros((n, 3))
    white = flt.acc_noise / np.sqrt(h) * rng.standard_normal((n, 3))
    acc = TURN.inv().apply([0.0, 0.0, -drive.gravity(*PLACE[[0, 2]])] - a - b - white)
    at = np.arange(1.0, 41.0)
    fixes = Gnss(
        t=at,
        lla=PLACE + flt.std_fix_position * per_metre * rng.standard_normal((40, 3)),
        v_n=flt.std_fix_velocity * rng.standard_normal((40, 3)),
    )
    rec = Recording(imu=Imu(t=t, gyr=np.zeros((n, 3)), acc=acc), gnss=fixes)
    sol, state = flt.advance(flt.init(attitude=TURN.as_quat()[[3, 0, 1, 2]]), rec)
    e = [(PLACE - sol.lla[-1]) / per_metre, -sol.v_n[-1], a[-1] - state.x[lay.ACC_ERROR :][:3]]
    if flt.states == 12:
        e.append(b[-1] + TURN.apply(sol.acc_bias[-1]))
    e, P = np.concatenate(e), state.P[7:, 7:]
    squares = [
        np.square(sol.diagnostics[name].innovation / sol.diagnostics[name].sigma).sum()
        for name in ("gnss_position", "gnss_velocity")
    ]
    assert len(sol.diagnostics["gnss_position"].t) == 39  # the first one is the start
    return e @ np.linalg.solve(P, e), squares


@pytest.mark.parametrize("states", [9, 12])
def test_position_filter_is_off_by_what_its_covariance_says(states):
    """NEES of all states and NIS of position and velocity within 99 %; attitude is given."""
    flt = Gnssins(
        states=states, acc_noise=0.05, acc_walk=0.02, acc_bias_walk=0.005, std_acc=0.3,
        std_acc_bias=0.2, std_fix_position=2.0, std_fix_velocity=0.3, fix_gate=np.inf,
        quat_std=(1e3,) * 3, gyr_noise=1e-12, std_gyr_bias=0.0, bias_walk=(0.0,) * 3,
        std_attitude=1e-9, reset_every=np.inf, limit=3.0,
    )  # fmt: skip
    runs = [consistent(seed, flt) for seed in range(RUNS)]
    nees = sum(run[0] for run in runs)
    low, high = chi2.ppf([0.005, 0.995], states * RUNS)
    assert low < nees < high
    low, high = chi2.ppf([0.005, 0.995], 3 * 39 * RUNS)
    for nis in np.sum([run[1] for run in runs], axis=0):
        assert low < nis < high


@pytest.mark.parametrize("flt", [FLT, Gnssins.as_printed()], ids=["default", "printed"])
def test_covariance_stays_definite_for_a_day(flt):
    """A box at rest with a fix a minute: 86,400 s at 1 Hz."""
    rng = np.random.default_rng(7)
    t = np.arange(86400.0)
    acc = [0.0, 0.0, -9.8] + 0.05 * rng.standard_normal((len(t), 3))
    at = t[30::60]
    rec = Recording(
        imu=Imu(t=t, gyr=1e-3 * rng.standard_normal((len(t), 3)), acc=acc),
        mag=Mag(t=t, mag=FIELD_N + 2e-7 * rng.standard_normal((len(t), 3))),
        gnss=Gnss(
            t=at, lla=PLACE + 1e-7 * rng.standard_normal((len(at), 3)), v_n=0.0 * acc[30::60]
        ),
    )
    sol, state = replace(flt, max_gap=2.0).advance(flt.init(), rec)
    position = np.linalg.eigvalsh(state.P[7:, 7:])
    assert position.min() > 0.0
    attitude = np.linalg.eigvalsh(state.P[:7, :7])  # nothing along q itself
    assert attitude[0] > -1e-15 * attitude[-1]
    assert attitude[1] > 0.0
    assert np.isfinite(sol.lla[100:]).all()


# --- bad input --------------------------------------------------------------------------


def test_without_fixes_it_says_what_it_needs(rec):
    with pytest.raises(MissingStream, match="gnss"):
        FLT.run(replace(rec, gnss=None))


BAD_FIXES = {
    "latitude beyond 90": ("lla", (0, 1.7)),
    "nan": ("lla", (1, np.nan)),
    "absurd height": ("lla", (2, 1e7)),
    "zero sigma": ("std_position_n", (0, 0.0)),
    "absurd sigma": ("std_position_n", (1, 1e9)),
    "absurd speed": ("v_n", (0, 1e30)),
}


@pytest.mark.parametrize("case", BAD_FIXES)
def test_fixes_without_sense_do_no_harm(city, rec, case):
    """Every third fix of a minute is spoiled."""
    name, (column, value) = BAD_FIXES[case]
    array = getattr(rec.gnss, name).copy()
    array[100:220:3, column] = value
    sol = FLT.run(replace(rec, gnss=replace(rec.gnss, **{name: array})))
    for each in ("q_nb", "gyr_bias", "std_attitude_n"):
        assert np.isfinite(getattr(sol, each)).all()
    late = city.t > 60.0
    assert rms(position_off(sol, city), late).max() < 1.5
    assert (rms(attitude_off(sol, city), late) < 3.0).all()


def test_bad_samples_leave_all_finite(city, rec):
    gyr, acc, mag = rec.imu.gyr.copy(), rec.imu.acc.copy(), rec.mag.mag.copy()
    rows = np.random.default_rng(5).integers(3000, 29000, 300)
    gyr[rows[:100]], acc[rows[100:200]], mag[rows[200:] // 5] = np.nan, np.nan, np.nan
    acc[7000:7050], gyr[9000:9010] = 1e4, -1e30
    bad = replace(rec, imu=replace(rec.imu, gyr=gyr, acc=acc), mag=replace(rec.mag, mag=mag))
    sol = FLT.run(bad)
    begun = np.argmax((sol.status & Status.ALIGNING) == 0)
    for name in ARRAYS:
        assert np.isfinite(getattr(sol, name)[begun:]).all(), name
    assert rms(position_off(sol, city), city.t > 250.0).max() < 1.5


def test_gap_of_the_imu_is_bridged(city, rec):
    keep = (rec.imu.t < 100.0) | (rec.imu.t > 103.0)
    cut = replace(rec, imu=rec.imu.rows(keep))
    sol = FLT.run(cut)
    assert np.count_nonzero(sol.status & Status.GAP) == 1
    off = np.linalg.norm(drive.ned_error(sol.lla.copy(), city.lla[keep])[:, :2], axis=1)
    assert off[cut.imu.t > 110.0].max() < 3.0
    turned = np.degrees(np.abs(drive.attitude_error(sol.q_nb, city.C_nb[keep])))
    assert turned[cut.imu.t > 160.0].max() < 6.0


@pytest.mark.parametrize(
    "lla0", [(-0.3, np.pi - 1e-6, 10.0), (1.5, 1.0, 0.0), (-1.0, -2.0, 3000.0)]
)
def test_antimeridian_south_and_high_latitude_are_no_trouble(lla0):
    d = drive.simulate(seed=4, duration=120.0, lla0=lla0, heading0=np.pi / 2)
    sol = Gnssins().run(d.rec)
    assert np.nanmax(np.abs(sol.lla[:, 1])) <= np.pi
    late = d.t > 60.0
    assert rms(position_off(sol, d), late).max() < 1.2


BAD = [
    ({"states": 15}, "`states` must be 9 or 12"),
    ({"form": "exact"}, "`form` must be"),
    ({"bias_frame": "ecef"}, "`bias_frame` must be"),
    ({"receiver_sigmas": 1}, "`receiver_sigmas` must be True or False"),
    ({"acc_noise": 0.0}, "`acc_noise` must be positive"),
    ({"acc_walk": -1.0}, "`acc_walk` must be"),
    ({"printed_std": (1.0, 0.0, 1.0)}, "`printed_std` must be positive"),
    ({"std_start": 0.0}, "`std_start` must be positive"),
    ({"fix_gate": 0.0}, "`fix_gate` must be positive"),
]


@pytest.mark.parametrize(("parameters", "message"), BAD, ids=[next(iter(b[0])) for b in BAD])
def test_impossible_parameter_is_refused(parameters, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Gnssins(**parameters)
