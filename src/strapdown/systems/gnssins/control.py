"""Chapter 7: measured attitude, adaptive R, the two filters, and the Control Unit on a drive.

The thesis has no drive of its own: the shipped scenario `drive`, with the sensors it was designed
for (ADIS16405, Fastrax UP500), a box mounted askew and three stops, stands in for one.
"""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from strapdown import simulation
from strapdown._types import FloatArray
from strapdown.attitude import AdaptiveEkf
from strapdown.constants import G0
from strapdown.evaluation import attitude_errors, navigation_errors
from strapdown.kernels.gnssins import layout as k
from strapdown.kernels.gnssins.attitude import adaptive_r
from strapdown.kernels.gnssins.measurement import gauss_newton, master_slave, roll_by_table
from strapdown.navigation import Gnssins
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import ESTIMATE, MUTED, Panel, Series, grid_figure
from strapdown.rotation import dcm_from_rpy, quat_from_rotvec, quat_from_rpy, quat_mul
from strapdown.solution import Outcome, Solution
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given
from strapdown.units import DEG, MG

TURNS: Final = 300
STARTS: Final = (5.0, 20.0, 45.0, 90.0, 135.0)  # [deg]
OUTAGE: Final = (60.0, 80.0)  # GPS off, in the drive's second leg [s]
DATE: Final = 2025.5
WHY_PRINTED: Final = (
    "alignment believes each measured attitude to 0.004 deg, so that their noise becomes bias"
)
ROUNDING: Final = Tolerance(absolute=1e-6)
# table 7.3: QuatCOV, KA, baseR in alignment, GPS active, GPS inactive
TABLE_7_3: Final = {
    "alignment": (1e-9, 0.0, 1.0),
    "GPS active": (1e-2, 1.0, 1.5),
    "GPS inactive": (1e-2, 3.0, 6.0),
}


def run(seed: int) -> Shown:
    """Measure attitudes, and drive.

    Parameters
    ----------
    seed : int
        Of attitudes and of the sensors' noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    scenario = simulation.load("drive")
    rec = scenario.record(seed + 1)
    rpy = scenario.mount.rpy
    rows = [*_measured(rng), *_covariances()]
    found, solution = _drive(rec, rpy)
    return Shown(rows=[*rows, *found], blocks=(_figure(solution),))


# --- measured attitude -------------------------------------------------------------------


def _measured(rng: np.random.Generator) -> list[Row]:
    """Return the rows of Master-Slave and Gauss-Newton, without noise."""
    limit = np.array([math.pi, 0.49 * math.pi, math.pi])
    angles = rng.uniform(-limit, limit, (TURNS, 3))
    field = np.array([0.45, 0.03, 0.89])
    field /= np.linalg.norm(field)
    declination = math.atan2(field[1], field[0])
    worst = tables = printed = 0.0
    for rpy in angles:
        g_b, b_b = dcm_from_rpy(rpy).T @ [0.0, 0.0, 1.0], dcm_from_rpy(rpy).T @ field
        true = quat_from_rpy(rpy)
        gx, gy, gz = map(float, g_b)
        bx, by, bz = map(float, b_b)
        c, d = math.cos(declination), math.sin(declination)
        for method in (0.0, 1.0):
            q = master_slave(gx, gy, gz, bx, by, bz, c, d, method)
            off = _angle(np.array(q), true)
            worst, tables = (
                (max(worst, off), tables) if method == 0.0 else (worst, max(tables, off))
            )
        roll, _ = roll_by_table(gx, gy, gx, 1.0)
        printed += float(abs(math.remainder(roll - rpy[0], math.tau)) > 1e-3)
    rows = [
        compared("7.6.2, Master-Slave, all quadrants, largest error", 0.0, worst, "deg", ROUNDING,
                 f"{TURNS} attitudes without noise; arctangents"),
        compared("tables 7.1 (g_x read as g_z) and 7.2, largest error", 0.0, tables, "deg",
                 Tolerance(absolute=1e-3), "an arcsine loses half of its digits near 90 deg"),
        info("table 7.1 as printed, by the sign of g_x, roll is wrong", None,
             100.0 * printed / TURNS, "%", "share of attitudes"),
    ]  # fmt: skip
    for use_down in (False, True):
        for start in STARTS:
            share = _converged(rng, angles, field, start, use_down)
            name = "with g_z" if use_down else "as printed, without g_z"
            rows.append(not_given(f"7.6.1, Gauss-Newton {name}, from {start:g} deg, converges",
                                  share, "%", "stops at 0.01; unit vectors"))  # fmt: skip
    return rows


def _converged(
    rng: np.random.Generator, angles: FloatArray, field: FloatArray, degrees: float, use_down: bool
) -> float:
    """Return how often the right attitude is found from so far off [%]."""
    w, right = np.zeros(k.W_SIZE), 0
    for rpy in angles:
        C_bn, true = dcm_from_rpy(rpy).T, quat_from_rpy(rpy)
        axis = rng.standard_normal(3)
        q = quat_mul(true, quat_from_rotvec(degrees * DEG * axis / np.linalg.norm(axis)))
        qa, qb, qc, qd = map(float, q)
        gx, gy, gz = map(float, C_bn[:, 2])
        bx, by, bz = map(float, C_bn @ field)
        n, e, down = map(float, field)
        z = float(use_down)
        got = gauss_newton(w, qa, qb, qc, qd, gx, gy, gz, bx, by, bz, n, e, down, z, 0.01)
        right += _angle(np.array(got), true) < 1.0
    return 100.0 * right / len(angles)


def _angle(q: FloatArray, true: FloatArray) -> float:
    """Return the angle between two attitudes [deg]; NaN where one is missing."""
    # of the vector part, for the arccosine of a number near one has half of the digits
    away = quat_mul(q * [1.0, -1.0, -1.0, -1.0], true)
    return float(2.0 * np.degrees(math.atan2(np.linalg.norm(away[1:]), abs(away[0]))))


def _covariances() -> list[Row]:
    """Return the rows of (7.7.8) and of Q and R, (7.7.22), (7.7.23)."""
    rows = []
    for name, (var, ka, base) in TABLE_7_3.items():
        same = adaptive_r(var, ka, base, 0.0, 0.0, 0.0)
        rows.append(
            compared(
                f"table 7.3, {name}, R at rest",
                var,
                same,
                "1",
                Tolerance(relative=1e-9),
                "(7.7.8) without manoeuvre",
            )
        )
        for root, reading in ((0.0, "10^(KA d)"), (1.0, "10^sqrt(KA d)")):
            r = adaptive_r(var, ka, base, 1.0, 10.0 * DEG, root)
            rows.append(not_given(f"(7.7.8), {name}, R at d 1 m/s^2 and 10 deg/s, {reading}", r,
                                  "1", "units are not printed, read as SI"))  # fmt: skip
    da = 35.0 * MG * math.sqrt(35.0)
    half = Tolerance(absolute=0.05)
    rows += [
        compared("(7.7.22), da = 0.035 sqrt(35) g", 2.0, da, "m/s^2", half,
                 "half of the last printed digit"),
        compared("(7.7.22), dv = da * 1 s", 2.0, da, "m/s", half,
                 "printed as da sqrt(35), which is 12"),
        compared("(7.7.22), db = 0.02 sqrt(35) g", 1.2, 0.02 * math.sqrt(35.0) * G0, "m/s^2",
                 half, "half of the last printed digit"),
        info("(7.7.23), R, position and velocity", "9, 4", "9, 4", "m^2, m^2/s^2",
             "the text says 2 m and 3 m/s, which is 4, 9"),
        info("7.8, thresholds, TKF, length of alignment", "not printed",
             "0.1 rad/s, 0.3 m/s^2, 30 deg, 2 s, 10 s", "", "chosen: parameters of `gnssins`"),
    ]  # fmt: skip
    return rows


# --- drive ------------------------------------------------------------------------------


def _drive(rec: Recording, mount: Any) -> tuple[list[Row], Solution]:
    """Return the rows of the drive, and the solution with an outage."""
    fixes = rec.need("gnss")
    off = replace(rec, gnss=fixes.rows((fixes.t < OUTAGE[0]) | (fixes.t > OUTAGE[1])))
    place = fixes.lla[0]
    settings: dict[str, Any] = {"mount": tuple(map(float, mount))}
    systems = {
        "12 states": Gnssins.at(place, DATE, **settings),
        "9 states": Gnssins.at(place, DATE, states=9, **settings),
        "as printed": Gnssins.as_printed(declination=Gnssins.at(place, DATE).declination,
                                         **settings),
        "no magnetometer": Gnssins(use_mag=False, **settings),
    }  # fmt: skip
    rows: list[Row] = []
    for name, system in systems.items():
        why = WHY_PRINTED if name == "as printed" else ""
        rows += _errors(f"ch. 7, drive, {name}", system.run(rec), rec, why)
    alone = AdaptiveEkf.at(place, DATE, **settings).run(replace(rec, gnss=None))
    errors = attitude_errors(alone, _reference(rec))
    rows.append(not_given("ch. 7, drive, attitude without a receiver, inclination RMSE",
                          _rms(errors.inclination) / DEG, "deg",
                          "the vehicle's acceleration stays in the vertical"))  # fmt: skip
    sol = systems["12 states"].run(off)
    return [*rows, *_unit(sol), *_outage(sol, rec)], sol


def _errors(name: str, sol: Solution, rec: Recording, why: str) -> list[Row]:
    attitude, way = attitude_errors(sol, _reference(rec)), navigation_errors(sol, _reference(rec))
    return [
        not_given(f"{name}, horizontal RMSE", _rms(way.horizontal), "m", "fixes of 1.5 m, 1 Hz"),
        not_given(f"{name}, heading RMSE", _rms(attitude.heading) / DEG, "deg", why),
        not_given(f"{name}, inclination RMSE", _rms(attitude.inclination) / DEG, "deg", why),
    ]


def _reference(rec: Recording) -> Any:
    """Return the truth, which a simulated recording has."""
    return rec.reference


def _rms(x: Any) -> float:
    return float(np.sqrt(np.nanmean(np.square(x))))


def _unit(sol: Solution) -> list[Row]:
    """Return the rows of what the Control Unit did through the drive."""
    found = sol.diagnostics["control_unit"]
    mode, reset, newton = found.innovation[:, :3].T
    before, away = found.t < 9.5, (found.t > OUTAGE[0] + 3.0) & (found.t < OUTAGE[1])
    moving = (found.t > 16.0) & (found.t < 35.0)
    exact = Tolerance(absolute=0.0)
    gaps = np.diff(found.t[reset > 0.0])
    return [
        compared("7.8, QRctr in alignment", 0.0, float(np.max(mode[before])), "", exact,
                 "largest; the car stands for 12 s"),
        compared("7.8, QRctr with GPS, moving", 2.0, float(np.median(mode[moving])), "", exact,
                 "median; 16 to 35 s"),
        compared("7.8, QRctr without GPS", 1.0, float(np.median(mode[away])), "", exact,
                 f"median; no fix from {OUTAGE[0]:g} to {OUTAGE[1]:g} s"),
        compared("7.6.3, runs in alignment and reset measured by Gauss-Newton", 0.0,
                 float(np.sum(newton[mode == 0.0])), "", exact, "Master-Slave there"),
        not_given("7.6.3, other runs measured by Gauss-Newton",
                  100.0 * float(np.mean(newton[mode > 0.0])), "%",
                  "Master-Slave after rejections"),
        compared("7.7.1, interval of the attitude filter", 1.0, float(np.median(np.diff(found.t))),
                 "s", Tolerance(absolute=0.011), "median; a sample of 10 ms"),
        not_given("7.1.2, automatic resets in uniform motion", float(np.sum(reset)), "",
                  "at the stops"),
        compared("7.1.2, least time between resets", 30.0,
                 float(gaps.min()) if len(gaps) else math.inf, "s",
                 Tolerance(absolute=1.0, bound="at least"), "chosen: `reset_every`"),
        not_given("7.8, measured attitudes rejected",
                  float(np.sum(found.outcome == Outcome.REJECTED_GATE)), "",
                  "residuals beyond the limit"),
    ]  # fmt: skip


def _outage(sol: Solution, rec: Recording) -> list[Row]:
    way = navigation_errors(sol, _reference(rec))
    last = int(np.argmin(np.abs(way.t - OUTAGE[1])))
    after = (way.t > OUTAGE[1] + 10.0) & (way.t < OUTAGE[1] + 60.0)
    return [
        not_given("7.8, GPS off for 20 s, horizontal error at its end",
                  float(way.horizontal[last]), "m", "no outage was tried in the thesis"),
        not_given("7.8, the same, largest from 10 s after it on",
                  float(np.nanmax(way.horizontal[after])), "m"),
    ]  # fmt: skip


def _figure(sol: Solution) -> page.Block:
    found = sol.diagnostics["control_unit"]
    reset = found.innovation[:, 1] > 0.0
    items = [
        Series(x=found.t, y=found.innovation[:, 0], name="QRctr", color=ESTIMATE, kind="path"),
        Series(x=found.t[reset], y=found.innovation[reset, 0], name="reset", color=MUTED,
               kind="points"),
    ]  # fmt: skip
    panel = Panel(y_label="mode", items=items, x_label="time [s]", height=220)
    return page.plot(
        grid_figure([panel]),
        "Control Unit on a drive: 0 alignment or uniform motion, 1 GPS inactive, 2 GPS active.",
    )


PART: Final = Part(
    name="control-unit",
    title="Chapter 7: measured attitude, tables 7.1 to 7.3, both filters, Control Unit",
    source="ch. 7; items 19 to 34",
    run=run,
)
