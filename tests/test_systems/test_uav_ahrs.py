"""Thesis D, chapters 2 to 4: rows, verdicts, flights, wrong filters."""

import json
from dataclasses import replace

import numpy as np
import pytest
from test_systems.shown import count, missed, rows, shown

from strapdown.kalman import observability
from strapdown.rotation import dcm_from_quat
from strapdown.systems import Verdict
from strapdown.systems.uav import equations, flight, programs, wind
from strapdown.units import DEG, GAUSS

PARTS = ("equations", "ahrs", "outages", "slow-biases", "tight", "wind", "ins")
TABLES = [
    ("equations", "3.2.1, rank of the observability matrix", 6),
    ("equations", "A.1", 6),
    ("equations", "A.2", 11),
    ("equations", "A, standard, steps", 2),
    ("equations", "A, multi-mode, steps", 1),
    ("equations", "2.4.1", 2),
    ("ahrs", "S1, 4.2.1, multi-mode corrected", 6),
    ("ahrs", "S1, 4.2.1, multi-mode as printed", 6),
    ("ahrs", "S2", 2),
    ("ahrs", "S3", 20),
    ("outages", "S5, 4.2.2, period 100 s, multi-mode", 10),
    ("outages", "S5, 4.2.2, period 75 s, multi-mode", 10),
    ("outages", "S5, figure", 4),
    ("slow-biases", "S6, S7", 20),
    ("slow-biases", "S9", 20),
    ("tight", "S8", 21),
    ("wind", "S10, 1.6 m/s", 5),
    ("wind", "S10, 3.3 m/s", 5),
    ("ins", "4.1", 8),
    ("ins", "appendix B", 1),
    ("ins", "(1.2)", 1),
]
ALWAYS = {
    "equations": set(),
    "ahrs": {
        *(f"S3, figure {what}" for kind in ("corrected", "as printed")
          for what in (f"4.7, {kind}, roll of the standard filter", f"4.9, {kind}, yaw")),
    },
    "outages": {
        *(f"S5, 4.2.2, period {p} s, multi-mode {kind}, largest error of {angle}"
          for p in (75, 100) for kind in ("corrected", "as printed") for angle in flight.ANGLES),
        *(f"S5, figure 4.16, period {p} s, standard" for p in (75, 100)),
    },
    "slow-biases": set(),
    "tight": set(),
    "wind": set(),
    "ins": set(),
}  # fmt: skip


@pytest.mark.parametrize(("part", "beginning", "number"), TABLES)
def test_every_statement_has_its_rows(part, beginning, number):
    assert count("uav", part, beginning) == number


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("part", PARTS)
def test_what_is_missed_is_what_is_documented(part, seed):
    found = missed("uav", part, seed)
    assert found >= ALWAYS[part]
    # with some noises the printed Jacobian is beyond 1 deg in yaw, and R of five times the
    # printed sigma in losses of the shorter period
    for item in found - ALWAYS[part]:
        assert "multi-mode as printed, largest error of yaw" in item or "period 75 s" in item


@pytest.mark.parametrize("part", PARTS)
def test_rows_are_json(part):
    for row in rows("uav", part).values():
        json.dumps(row.summary(), allow_nan=False)
    assert len(shown("uav", part).blocks) == {
        "equations": 0, "ahrs": 2, "outages": 2, "slow-biases": 4, "tight": 1, "wind": 2, "ins": 1,
    }[part]  # fmt: skip


def test_multi_mode_stays_below_one_degree_and_improves_by_half():
    """The demands on both: constant biases, GPS always valid."""
    found = rows("uav", "ahrs")
    for angle in flight.ANGLES:
        row = found[f"S1, 4.2.1, multi-mode corrected, largest error of {angle} after 30 s"]
        assert row.verdict is Verdict.RECOVERED
        assert row.here < 1.0
    for kind in ("corrected", "as printed"):
        assert found[f"S3, 4.2.1, {kind}, improvement, mean of the three angles"].here > 50.0


def test_ins_keeps_the_aircraft_within_what_its_fixes_allow():
    found = rows("uav", "ins")
    for axis, limit in (("north", 0.5), ("east", 0.5), ("down", 1.0)):
        assert found[f"4.1, GPS always valid, position {axis}, RMS after 30 s"].here < limit
    track = found["(1.2), track of 2.7 km integrated from the flown velocity, largest error"]
    assert track.here < 0.001


# --- flights ----------------------------------------------------------------------------


@pytest.mark.parametrize(("mission", "bank"), [("first", 26.0), ("tight", 36.0)])
def test_aircraft_flies_coordinated_turns_at_9_m_s(mission, bank):
    motion = flight.truth(mission)
    speed = np.linalg.norm(motion.v_n, axis=1)
    np.testing.assert_allclose(speed, 9.0, rtol=0.02)  # the track's spline
    assert np.abs(motion.f_b[:, 1]).max() < 0.01  # Coriolis only
    off = np.arctan2(motion.v_n[:, 1], motion.v_n[:, 0])
    C_nb = dcm_from_quat(motion.q_nb)
    yaw = np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0])
    np.testing.assert_allclose(np.exp(1j * off), np.exp(1j * yaw), atol=1e-6)
    flown = flight.log(mission, 0)
    assert np.abs(flown.rpy[:, 0]).max() / DEG == pytest.approx(bank, abs=0.5)
    assert motion.t[0] == 0.0
    assert len(motion.t) == 15_000
    np.testing.assert_allclose(motion.m_n[0] / GAUSS, programs.FIELD)


def test_biases_are_those_that_the_gyroscopes_have():
    for varying in (False, True):
        flown = flight.log("first", 0, varying=varying)
        motion = flight.truth("first")
        off = flown.rec.imu.gyr - motion.omega_ib_b - flown.bias
        # 0.01 rad/s a sample, 15000 of them; nothing is clipped
        np.testing.assert_allclose(off.mean(axis=0), 0.0, atol=4e-4)
        np.testing.assert_allclose(off.std(axis=0), 0.01, rtol=0.03)
    assert np.ptp(flown.bias[:, 0]) == pytest.approx(0.1, abs=1e-4)


def test_gps_is_lost_where_the_scenario_says():
    t = flight.log("first", 0, outage=25.0).rec.gnss.t
    for begin in (75.0, 175.0):
        assert not np.any((t >= begin) & (t < begin + 25.0))
    assert np.sum((t > 40) & (t < 60)) == pytest.approx(500, abs=1)


def test_a_breeze_turns_the_course_and_nothing_else():
    flown = flight.log("tight", 0, varying=True)
    blown = wind.carried(flown, 2.0)
    drift = blown.rec.gnss.v_n - flown.rec.gnss.v_n
    np.testing.assert_allclose(drift, np.tile([2**0.5, 2**0.5, 0.0], (len(drift), 1)), atol=1e-12)
    assert blown.rec.imu is flown.rec.imu
    assert blown.rec.mag is flown.rec.mag
    plain = flight.standard()
    streams = [plain.run(one.rec, diagnostics=False).q_nb for one in (flown, blown)]
    np.testing.assert_array_equal(*streams)  # it has no GPS


# --- wrong filters ------------------------------------------------------------------------


def test_a_filter_without_state_noise_does_not_follow_slow_biases():
    """What makes S6 work: with the standard's bias model the multi-mode filter fails too."""
    flown = flight.log("first", 0, varying=True)
    stiff = replace(flight.multi(), gyr_bias_noise=(7e-6,) * 3)
    for flt, fails in ((flight.multi(), False), (stiff, True)):
        sol = flt.run(flown.rec, diagnostics=False)
        off = (sol.gyr_bias - flown.bias)[flown.late, :2]
        assert (np.sqrt(np.mean(off**2)) > 0.3 * 0.05 / np.sqrt(2)) == fails


def test_a_filter_of_magnetic_north_is_off_by_the_declination():
    flown = flight.log("first", 0)
    plain = replace(flight.standard(), declination=0.0)
    yaw = [flight.errors(f.run(flown.rec), flown)[flown.late, 2].mean() for f in
           (plain, flight.standard())]  # fmt: skip
    assert yaw[0] - yaw[1] == pytest.approx(-1.907, abs=0.1)


# --- observability -----------------------------------------------------------------------


def test_what_a_single_vector_leaves_open_is_a_turn_about_it_and_its_bias():
    F, H = equations.matrices(("magnetic field",))
    found = observability(F, H)
    assert found.open.shape == (7, 2)
    q = equations.quat_from_rpy(equations.ATTITUDE)
    u = np.array(programs.FIELD) / np.linalg.norm(programs.FIELD)
    w, v = q[0], q[1:]
    turn = np.r_[-u @ v, w * u + np.cross(u, v), 0, 0, 0]  # (0, u) q
    u_b = dcm_from_quat(q).T @ u
    for direction in (turn, np.r_[0, 0, 0, 0, u_b]):
        inside = found.open @ (found.open.T @ direction)
        np.testing.assert_allclose(inside, direction, atol=1e-9)


def test_printed_heading_leaves_mode_1_open_at_90_deg(monkeypatch):
    """Spec D 18: its rank contribution vanishes there, 5 in place of 7."""
    monkeypatch.setattr(equations, "ATTITUDE", (0.0, 0.0, np.pi / 2))
    assert observability(*equations.matrices(("magnetic field", "yaw"))).rank == 7
    exact = programs.heading
    monkeypatch.setattr(programs, "heading", lambda q, exact_=True, **_: exact(q))
    assert observability(*equations.matrices(("magnetic field", "yaw"))).rank == 5


@pytest.mark.parametrize("make", [flight.standard, flight.multi])
def test_covariance_is_sound_after_six_hours(make):
    """The flight again and again: symmetric, positive but along q, which stays round-off."""
    flt, rec = make(), flight.log("first", 0).rec
    state = flt.init()
    for k in range(72):
        later = replace(
            rec, imu=rec.imu.shifted(300.0 * k), mag=rec.mag.shifted(300.0 * k),
            gnss=rec.gnss.shifted(300.0 * k),
        )  # fmt: skip
        _, state = flt.advance(state, later, diagnostics=False)
    least = np.linalg.eigvalsh(state.P)
    assert np.array_equal(state.P, state.P.T)
    assert abs(least[0]) < 1e-15 * 0.4  # round-off of the start
    assert least[1] > 1e-9
    assert np.abs(state.P[:, :4] @ state.q_nb).max() < 1e-15 * 0.4
