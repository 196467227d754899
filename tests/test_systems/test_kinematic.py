"""Thesis B: every item of its checklist has its rows, and the verdicts are those documented."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_systems.shown import count, missed, rows, shown

from strapdown.report import page
from strapdown.systems import Verdict, parts
from strapdown.systems.kinematic import (
    device,
    filters,
    growth,
    moving,
    relations,
    static,
    still,
    vectors,
)

NAMES = [part.name for part in parts("kinematic")]
TABLES = [
    ("table 3, gyro", "static", 6),
    ("table 4, acc", "static", 6),
    ("table 5, mag", "static", 6),
    ("table 3, unit", "static", 2),
    ("table 1,", "errors", 7),
    ("table 2,", "errors", 8),
    ("figure 12,", "still", 5),
    ("(43),", "still", 1),
    ("figure 13,", "still", 1 + 3 + 3 + 1),
    ("figure 14,", "still", 1 + 1 + 1 + 1 + 3 + 1),
    ("figure 15,", "moving", 1),
    ("figure 16,", "moving", 3),
    ("figure 17,", "moving", 4),
    ("figure 18,", "moving", 1),
]
# The spec's checklist: where the rows of each item are.
ITEMS = {
    1: ("static", "item 1,"), 2: ("static", "item 2,"), 3: ("static", "item 3,"),
    4: ("static", "table 3, gyro x, variance"), 5: ("static", "item 5,"),
    6: ("errors", "table 1, constant bias"), 7: ("errors", "table 1, white noise"),
    8: ("errors", "table 1, bias random walk"), 9: ("errors", "table 1, temperature"),
    10: ("errors", "item 10,"), 11: ("errors", "table 2, white noise"),
    12: ("relations", "item 12,"), 13: ("relations", "item 13,"), 14: ("static", "item 14,"),
    15: ("static", "item 15,"), 16: ("static", "item 16,"), 17: ("relations", "(6)"),
    18: ("relations", "item 18,"), 19: ("relations", "(11)"), 20: ("relations", "(20)"),
    21: ("relations", "(77)"), 22: ("still", "figure 12, drift, rates"),
    23: ("vectors", "item 23,"), 24: ("vectors", "item 24,"), 25: ("vectors", "item 25,"),
    26: ("vectors", "item 26,"), 27: ("still", "figure 13, drift"),
    28: ("moving", "figure 16, yaw"), 29: ("still", "(43)"), 30: ("still", "figure 14, dynamics"),
    31: ("still", "item 31,"), 32: ("vectors", "item 32,"), 33: ("vectors", "item 33,"),
    34: ("still", "item 34,"), 35: ("vectors", "item 35,"),
    36: ("still", "figures 13 and 14, first settled"), 37: ("filters", "(58) to (62)"),
    38: ("filters", "item"), 39: ("filters", "item 39,"), 40: ("filters", "item 40,"),
    41: ("filters", "(64)"), 42: ("filters", "item 42,"), 43: ("filters", "item 43,"),
    44: ("moving", "figure 15,"), 45: ("moving", "items 45 and 46"),
    46: ("moving", "items 45 and 46"), 47: ("moving", "item 47,"), 48: ("still", "item 48,"),
    49: ("vectors", "item 49,"), 50: ("filters", "item 50,"),
}  # fmt: skip
# What does not come out; the remarks of the rows say why.
MISSED = {
    "moving": {"figure 17, turn about the sensor's x, angles by (21) to (23) of q"},
    "filters": {"4.3.2, gain for a larger process noise"},
}
FIGURES = {"static": 2, "errors": 1, "relations": 1, "still": 3, "moving": 6, "vectors": 1}


@pytest.mark.parametrize(("beginning", "name", "number"), TABLES)
def test_every_figure_of_the_tables_has_its_row(beginning, name, number):
    assert count("kinematic", name, beginning) == number


@pytest.mark.parametrize("item", range(1, 51))
def test_every_item_of_the_checklist_has_a_row(item):
    name, beginning = ITEMS[item]
    assert count("kinematic", name, beginning) > 0


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_missed_is_what_is_documented(name, seed):
    assert missed("kinematic", name, seed) == MISSED.get(name, set())


@pytest.mark.parametrize("name", NAMES)
def test_rows_say_what_they_compare_and_why(name):
    for row in rows("kinematic", name).values():
        json.dumps(row.summary(), allow_nan=False)
        claims = row.verdict in (Verdict.MET, Verdict.RECOVERED, Verdict.MISSED)
        assert not claims or row.remark
        assert claims or row.tolerance == ""
        assert row.verdict is not Verdict.NOT_GIVEN or row.thesis is None


@pytest.mark.parametrize("name", NAMES)
def test_figures_stand_on_the_page(name):
    blocks = shown("kinematic", name).blocks
    assert len(blocks) == FIGURES.get(name, 0)
    text = page.render(
        page.Page(title="t", sections=[page.Section(title="s", blocks=[*blocks, page.text("x")])])
    )
    assert "NaN" not in text.split("<script>")[0]


# --- what is simulated ------------------------------------------------------------------


def test_rest_pose_is_the_attitude_of_the_printed_means():
    """SciPy's Wahba solution, gravity given all the weight, in the frame north, west, up."""
    up, field = np.array(device.ACC_MEAN), np.array(device.MAG_MEAN)
    level = field - (field @ up) * up / (up @ up)
    found, _ = Rotation.align_vectors([[0, 0, 1], [1, 0, 0]], [up, level])
    yaw, pitch, roll = found.as_euler("ZYX", degrees=True)
    np.testing.assert_allclose(
        np.degrees(device.angles(device.rest_pose())), [roll, pitch, yaw], atol=1e-9
    )
    # the extraction of the thesis has -145.62, 0.063, 0.034 deg
    np.testing.assert_allclose([yaw, pitch, roll], [-145.62, 0.063, 0.034], atol=0.005)


def test_angles_are_those_of_the_thesis_and_of_its_inverse():
    q = np.array([0.5, -0.1, 0.3, 0.8]) / np.linalg.norm([0.5, -0.1, 0.3, 0.8])
    frame = Rotation.from_quat(q[[1, 2, 3, 0]])  # takes sensor vectors to north, west, up
    ned = Rotation.from_euler("X", np.pi) * frame
    q_nb = ned.as_quat()[[3, 0, 1, 2]]
    np.testing.assert_allclose(device.angles(q_nb), frame.as_euler("ZYX")[::-1], atol=1e-12)
    inverse = frame.inv().as_euler("ZYX")[::-1]
    np.testing.assert_allclose(device.frame_angles(q_nb), inverse, atol=1e-12)


def test_still_sensor_shows_gravity_and_field_of_the_means_in_its_rest_pose():
    truth = device.still(1.0)
    np.testing.assert_allclose(truth.f_b[5] / 9.80665, device.ACC_MEAN, atol=1e-12)
    r_nb = Rotation.from_quat(truth.q_nb[5][[1, 2, 3, 0]])
    np.testing.assert_allclose(r_nb.inv().apply(truth.m_n[5]) / 1e-7, device.MAG_MEAN, atol=1e-9)
    np.testing.assert_allclose(truth.m_n[5, 1], 0.0, atol=1e-18)  # x axis to magnetic north


def test_rates_of_the_turns_integrate_to_their_rotation_vectors():
    truth = moving.motion()
    turned = Rotation.from_quat(truth.q_nb[0][[1, 2, 3, 0]]).inv() * Rotation.from_quat(
        truth.q_nb[:, [1, 2, 3, 0]]
    )
    angle = np.concatenate((np.zeros((1, 3)), np.cumsum(
        0.5 * (truth.omega_ib_b[1:] + truth.omega_ib_b[:-1]), axis=0) * 0.01))  # fmt: skip
    # trapezia: dt^2 / 12 of the second derivative, 0.6 rad/s^3
    np.testing.assert_allclose(angle, turned.as_rotvec(), atol=1e-5)
    peaks = np.degrees(np.abs(turned.as_rotvec()).max(axis=0))
    np.testing.assert_allclose(peaks, [60.0, 60.0, 90.0], atol=1e-9)


def test_settling_and_chatter_agree_with_the_extractions_own_simulation():
    """It has 19.8 s, 1.98 s, and 0.22, 0.67 deg of yaw, with the gradient's part along q.

    That part takes a share of the normalised gradient: a slower way, a smaller chatter.
    """
    found = rows("kinematic", "still")
    assert found["figure 13, settled within 5 deg"].here == pytest.approx(19.8, rel=0.1)
    assert found["figure 14, settled within 5 deg"].here == pytest.approx(1.98, rel=0.1)
    assert found["figure 13, yaw, std of the last 75 s"].here == pytest.approx(0.225, rel=0.15)
    assert found["figure 14, yaw, std of the last 75 s"].here == pytest.approx(0.67, rel=0.15)
    assert found["figure 14, roll, std of the last 75 s"].here == pytest.approx(0.325, rel=0.15)


def test_random_walk_of_the_angle_is_sigma_sqrt_dt_t():
    found = rows("kinematic", "errors")
    for axis, want in zip("xyz", (0.099, 0.140, 0.078), strict=True):  # the extraction's
        here = found[f"table 3, {axis}: std of angle after 150 s"].here
        assert here == pytest.approx(want, rel=0.08)  # 1000 records: 2.2 % each, 3.5 sigma


def test_no_yaw_of_a_level_sensor_shows_a_turn_about_x_about_z_without_y():
    """The remark on figure 17, over all yaws and turns of up to 80 deg, by SciPy."""
    for yaw in np.radians(np.arange(-180.0, 180.0, 7.0)):
        rest = Rotation.from_euler("Z", yaw)
        for turn in np.radians([5.0, 20.0, 45.0, 80.0]):
            out = rest * Rotation.from_rotvec([turn, 0.0, 0.0])
            before, after = (r.inv().as_euler("ZYX") for r in (rest, out))
            z, y, _ = (after - before + np.pi) % (2.0 * np.pi) - np.pi
            assert abs(z) < abs(y) + 1e-9


# --- wrong inputs -----------------------------------------------------------------------


def verdicts_of(found, beginning):
    return {row.verdict for row in found if row.item.startswith(beginning)}


def test_rates_read_as_printed_in_deg_per_s_miss_figure_12(monkeypatch):
    monkeypatch.setattr(device, "GYR_MEAN", tuple(np.radians(device.GYR_MEAN)))
    rec = device.record(device.still(), 0)
    found = still._integration(rec, still._sums(rec))
    assert verdicts_of(found, "figure 12") == {Verdict.MISSED}


def test_noise_10_percent_too_large_misses_the_variances(monkeypatch):
    monkeypatch.setattr(device, "ACC_VARIANCE", tuple(1.21 * v for v in device.ACC_VARIANCE))
    found = [row for row in static.run(0).rows if row.item.endswith("variance")]
    assert verdicts_of(found, "table 4, acc") == {Verdict.MISSED}
    assert verdicts_of(found, "table 3, gyro") == {Verdict.RECOVERED}


def test_another_beta_misses_equation_43(monkeypatch):
    monkeypatch.setattr(still, "GYR_ERROR", 1.01 * still.GYR_ERROR)
    assert verdicts_of(still._gains(), "") == {Verdict.MISSED}


def test_a_filter_that_is_no_faster_and_drifts_misses_figures_13_and_14():
    rec = device.record(device.still(), 0)
    low = still.Response.of(still.filtered(rec, beta=device.BETA_LOW))
    loose = still.Response.of(still.filtered(rec, beta=1e-4, use_mag=False))
    found = still._transient(low, low)
    assert verdicts_of(found, "figure 14, dynamics") == {Verdict.MISSED}
    assert verdicts_of(still._rest(low, low), "figure 14, osc") == {Verdict.MISSED}
    assert verdicts_of(still._rest(loose, low), "figure 13, drift") == {Verdict.MISSED}


def test_white_noise_in_place_of_a_walk_has_another_slope():
    t = growth.DT + device.times(growth.LAST)
    rng = np.random.default_rng(0)
    white = growth._integrals(growth._records(rng, growth.Noise(white=1.0), t), 1).std(axis=0)
    assert not growth.RANDOM_SLOPE.holds(1.5, growth.slope(t, white))


def test_a_preset_dip_lets_the_disturbance_into_the_tilt():
    field = vectors._disturbed(0)
    swapped = {**field, "dip, reference by (49)": field["dip, reference preset"]}
    assert verdicts_of(vectors._iron(swapped), "item 32, dip") == {Verdict.MISSED}


def test_without_realignment_the_turns_show_on_other_axes(monkeypatch):
    monkeypatch.setattr(device, "angles_from_rest", device.frame_angles)
    sol = still.filtered(device.record(moving.motion(), 0), device.rest_pose(), beta=0.0756)
    assert Verdict.MISSED in verdicts_of(moving._from_rest(sol), "item 47, turn")


def test_a_wrong_formula_is_missed(monkeypatch):
    def run():
        found = rows_of(relations.run(0))
        return {name for name, row in found.items() if row.verdict is Verdict.MISSED}

    product, matrix, frames = (
        relations._printed_product, relations._printed_matrix, relations._printed_frames,
    )  # fmt: skip
    monkeypatch.setattr(relations, "_printed_product", lambda q, p: product(p, q))
    assert "(11), product" in run()
    assert "(77), dq/dt = q w' / 2, w' in the sensor" in run()
    monkeypatch.setattr(relations, "_printed_product", product)
    monkeypatch.setattr(relations, "_printed_matrix", lambda rpy: matrix(rpy * [1, 1, -1]))
    monkeypatch.setattr(relations, "_printed_frames", lambda q: frames(q).T)
    assert run() == {"(6), matrix of yaw, pitch, roll", "(20), the transpose of C(q)"}


def test_a_wrong_limb_model_is_missed(monkeypatch):
    right = filters._limb_rate
    monkeypatch.setattr(filters, "_limb_rate", lambda x: right(x) * [1, 1, 1, -1, 1, 1, 1])
    found = {row.item: row.verdict for row in filters._limb(np.random.default_rng(0))}
    assert found["(68), row 4 of Phi"] is Verdict.MISSED


def rows_of(found):
    return {row.item: row for row in found.rows}


# --- the page ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_page_counts_the_verdicts_as_they_are(name):
    text = (Path(__file__).parents[2] / "docs/system-kinematic.md").read_text("utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith(f"| `{name}` |")]
    counts = [int(cell) for cell in line.strip("| ").split("|")[2:]]
    order = (Verdict.MET, Verdict.MISSED, Verdict.RECOVERED, Verdict.NOT_GIVEN, Verdict.INFO)
    found = [row.verdict for row in shown("kinematic", name).rows]
    assert counts == [found.count(verdict) for verdict in order]
