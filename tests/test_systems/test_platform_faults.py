"""Thesis A: a wrong input turns a row into a missed one."""

import dataclasses

import numpy as np
import pytest

from strapdown.calibration import temperature_model
from strapdown.noise import identify, low_pass_study
from strapdown.noise.datasheet import Figure, compare
from strapdown.systems import Tolerance, Verdict
from strapdown.systems._rows import compared
from strapdown.systems.platform import (
    allan,
    bench,
    calibrations,
    encoders,
    equations,
    low_pass,
    multiplier,
    offline,
    sheets,
    sweep,
    temperature,
    timing,
)
from strapdown.systems.platform.replay import Errors
from strapdown.units import DPS, MS

GYR = allan.TABLES[0]


def verdicts(rows):
    return [row.verdict for row in rows]


@pytest.fixture(scope="module")
def white():
    """An hour of white noise of table 5.3, x, in deg/s."""
    rng = np.random.default_rng(3)
    return identify(7.867e-2 * rng.standard_normal(360_000), 100.0)


def test_a_coefficient_off_by_5_percent_is_missed(white):
    right = allan.coefficient_row(GYR, 0, "N", 7.867e-3, white.N)
    wrong = allan.coefficient_row(GYR, 0, "N", 1.05 * 7.867e-3, white.N)
    assert verdicts([right, wrong]) == [Verdict.RECOVERED, Verdict.MISSED]


def test_a_printed_coefficient_that_does_not_show_is_missed_and_a_dash_is_recovered(white):
    assert not white.B.observed
    rows = [allan.coefficient_row(GYR, 0, "B", thesis, white.B) for thesis in (1.2e-3, None)]
    assert verdicts(rows) == [Verdict.MISSED, Verdict.RECOVERED]
    assert rows[0].here == "not observable"
    assert rows[1].thesis == "-"
    seen = allan.coefficient_row(GYR, 0, "N", None, white.N)
    assert seen.verdict is Verdict.MISSED  # a dash where there is something


def test_other_delays_lead_to_another_cut_off():
    sigma = np.array(low_pass.SIGMA_DPS) * DPS
    for factor, same in ((1.0, True), (0.05, False)):
        delay = factor * np.array(low_pass.DELAY_MS) * MS
        study = low_pass_study(low_pass.CUTOFF_HZ, sigma, delay, 0.01)
        judged = [row for row in low_pass.verdicts(study) if row.thesis is not None]
        assert (verdicts(judged) == [Verdict.MET, Verdict.MET]) is same


def test_noise_of_three_times_the_density_is_not_in_line(white):
    for value, verdict in ((0.0111 * DPS, Verdict.RECOVERED), (0.0037 * DPS, Verdict.MISSED)):
        in_si = dataclasses.replace(
            white, N=dataclasses.replace(white.N, value=white.N.value * DPS)
        )
        (found,) = compare(in_si, [Figure(kind="density", value=value)])
        assert sheets.maker_row("x", GYR, found).verdict is verdict


def test_the_matrix_of_another_sensor_is_missed(monkeypatch):
    found = calibrations.posed("acc", 0)
    assert Verdict.MISSED not in verdicts(calibrations.matrix_rows("acc", found.record))
    monkeypatch.setitem(bench.MATRICES, "acc", (bench.C_MAG, 9.80665))
    assert verdicts(calibrations.matrix_rows("acc", found.record)).count(Verdict.MISSED) > 8


def test_a_scale_factor_within_the_tolerance_is_not_the_thesis_verdict(monkeypatch):
    C = np.array(bench.C_ACC)
    C[2, 2] = 0.98
    monkeypatch.setitem(bench.MATRICES, "acc", (tuple(map(tuple, C)), 9.80665))
    assert verdicts(calibrations.tolerance_rows())[2:4] == [Verdict.MISSED, Verdict.MISSED]


def test_a_slope_of_twice_the_size_is_missed():
    temp, y = temperature.warmed("gyr", 1, 0)
    std = temperature.scatter("gyr", temp, 0)
    good = temperature.line_rows("gyr", 1, temperature_model("gyr", temp, y), std)
    bad = temperature.line_rows("gyr", 1, temperature_model("gyr", temp, 2.0 * y), std)
    assert verdicts(good) == [Verdict.RECOVERED] * 6
    assert verdicts(bad)[:4] == [Verdict.MISSED] * 4


def test_a_table_that_counts_the_other_way_is_missed():
    turned = tuple(tuple(-change for change in line) for line in encoders.TABLE_8_2)
    assert encoders.counting(encoders.TABLE_8_2).verdict is Verdict.MET
    row = encoders.counting(turned)
    assert row.verdict is Verdict.MISSED
    assert row.here == 8.0  # those that count nothing


def test_process_noise_with_half_its_cross_term_is_missed(monkeypatch):
    assert {row.verdict for row in equations._noise()[:2]} == {Verdict.MET}

    def halved(*arguments, **keywords):
        Q = whole(*arguments, **keywords)
        Q[:3, 3:] *= 0.5
        Q[3:, :3] *= 0.5
        return Q

    whole = equations.noise
    monkeypatch.setattr(equations, "noise", halved)
    assert {row.verdict for row in equations._noise()[:2]} == {Verdict.MISSED}


def test_an_error_beyond_three_sigma_at_100_hz_is_missed():
    good = [sweep.Outcome(rms, 5e-4, 0.0) for rms in (8e-3, 4e-3, 2e-3, 6e-4, 3e-4, 1e-4)]
    bad = [sweep.Outcome(2.0 * o.rms, o.bound, 0.0) for o in good]
    judged = [
        [row.verdict for row in sweep.criterion_rows("space", found)][6:8] for found in (good, bad)
    ]
    assert judged == [[Verdict.RECOVERED, Verdict.MISSED], [Verdict.MISSED, Verdict.MISSED]]


def test_frequency_at_which_the_error_crosses_three_sigma_is_between_the_runs():
    ratio = [16.0, 8.0, 4.0, 1.6, 0.8, 0.4]  # proportional to 1/f
    assert sweep._crossing(ratio) == pytest.approx(80.0)
    assert np.isnan(sweep._crossing([0.5] * 6))


def test_an_error_of_0_6_deg_does_not_meet_the_requirement():
    def ran(tilt, yaw):
        return [Errors(np.zeros(3), np.array([0.1, tilt, yaw]), np.full(3, 0.1))]

    good = offline.requirement_rows(ran(0.1, 0.1), ran(0.1, 2.0))
    assert set(verdicts(good)) == {Verdict.RECOVERED}
    bad = offline.requirement_rows(ran(0.6, 0.1), ran(0.1, 0.2))
    assert verdicts(bad).count(Verdict.MISSED) == 2  # space theta, and yaw that suddenly passes


def test_settling_time_is_the_last_peak_that_is_off():
    t = np.arange(6000) / 100.0
    sigma = 1.0 + np.exp(-t / 5.0) + 0.2 * (t % 3.0)
    sol = type("Solution", (), {"std_attitude_n": np.column_stack([sigma] * 3)})()
    # the peak of each 3 s is 1.6 + exp(-(t + 3)/5) of its end: within 5 % from exp < 0.08
    assert offline.settling_time(t, sol) == pytest.approx(5.0 * np.log(1.0 / 0.08), abs=3.0)


def test_a_k_that_is_not_the_best_is_missed():
    k = np.array(multiplier.FACTORS)
    falling = np.tile((0.02 + 0.1 / k**2)[:, np.newaxis], (1, 5))
    rising = np.tile((0.001 * k)[:, np.newaxis], (1, 5))
    good, bad = (
        verdicts(multiplier.curve_rows(np.stack([curve] * 3), True)[-2:])
        for curve in (falling, rising)
    )
    assert good == [Verdict.RECOVERED, Verdict.RECOVERED]
    assert bad == [Verdict.MISSED, Verdict.MISSED]


def test_clocks_that_fit_the_printed_time_are_met(monkeypatch):
    monkeypatch.setattr(timing, "CLOCKS", 86)
    found = [row for row in timing.run(0).rows if row.item.startswith("table 9.10")]
    assert verdicts(found) == [Verdict.MET, Verdict.MET]


def test_at_most_is_one_sided():
    bound = Tolerance(bound="at most")
    assert compared("x", 1.0, 0.0, "", bound).verdict is Verdict.MET
    assert compared("x", 1.0, 1.01, "", bound).verdict is Verdict.MISSED
