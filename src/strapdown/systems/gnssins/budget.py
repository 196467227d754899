"""Tables 5.1 and 5.2, the error budget of GPS; and formula (6.1.3), how an unaided INS drifts."""

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.earth import gravity_n, lla_from_ned, ned_from_lla
from strapdown.navigation import Start, mechanise
from strapdown.navigation.error_growth import drift
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, grid_figure
from strapdown.rotation import quat_from_rotvec, quat_mul
from strapdown.simulation.jet import constant, jet_of
from strapdown.simulation.kinematics import Pose, quat_from_angles, truth
from strapdown.simulation.profile import integral, ramps
from strapdown.solution import Solution
from strapdown.systems._growth import slope
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given
from strapdown.truth import Truth
from strapdown.units import DEG, DPS, MG

# error: GPS, DGPS [m]
BUDGET: Final = {
    "satellite clock": (15.0, 0.1),
    "ephemerides": (40.0, 1.0),
    "orbit": (5.0, 0.1),
    "ionosphere": (12.0, 1.0),
    "troposphere": (3.0, 0.5),
    "multipath": (2.0, 3.0),
    "receiver noise": (1.0, 1.0),
}
TOTALS: Final = (45.0, 3.3)
PLACE: Final = (39.36 * DEG, 16.23 * DEG, 250.0)  # the university of the thesis
SPAN: Final = 100.0  # [s]
RATE: Final = 100.0  # [Hz]
# Left out of the formula: the curvature of the Earth, (t / 806 s)^2 / 12 of the bias' term; and
# the rate of the Earth, of which an azimuth error leads a part to the wrong gyroscope: 0.8 m
# across the way after 100 s, 0.7 % of the norm.
TOLERANCE: Final = Tolerance(relative=0.01)


def run(seed: int) -> Shown:
    """Sum up the budget, and integrate the errors of an INS.

    Parameters
    ----------
    seed : int
        Not used: nothing is random here.

    Returns
    -------
    Shown
    """
    del seed
    runs = _runs()
    return Shown(
        rows=[*_budget(), *_ranges(), *_drift(runs), *_powers(runs)],
        blocks=(_entries(), _figure(runs)),
    )


# --- error budget -----------------------------------------------------------------------


def _budget() -> list[Row]:
    """Return the rows of the sums."""
    columns = np.array(list(BUDGET.values())).T
    shares = 100.0 * columns**2 / np.sum(columns**2, axis=1, keepdims=True)
    rows = [
        info(f"table 5.{column + 1}, {name}", f"{entry[column]:g} m",
             f"{shares[column, k]:.1f} %", "", "its share of the variance")
        for column in range(2)
        for k, (name, entry) in enumerate(BUDGET.items())
    ]  # fmt: skip
    for name, total, errors, digit in zip(
        ("GPS", "DGPS"), TOTALS, columns, (0.5, 0.05), strict=True
    ):
        rss = float(np.sqrt(np.sum(errors**2)))
        rows.append(compared(
            f"table 5.{1 if name == 'GPS' else 2}, sigma of {name}, root of the sum of squares",
            total, rss, "m", Tolerance(absolute=digit),
            "half of the last printed digit" if name == "GPS" else
            "half of the last printed digit; the printed entries do not lead to the printed sum",
        ))  # fmt: skip
        rows.append(info(
            f"tables 5.1 and 5.2, sigma of {name}, divided by n inside the root", total,
            rss / math.sqrt(len(errors)), "m", "the formula as printed: contradicts the tables",
        ))  # fmt: skip
    return rows


def _ranges() -> list[Row]:
    """Return the rows of the errors of a range, 5.8."""
    f1, f2 = 1575.42e6, 1227.60e6
    distance, k = 21_345_678.9, 10.0 * f1**2  # 10 m of ionosphere on L1
    r1, r2 = distance + k / f1**2, distance + k / f2**2  # (5.8.2)
    free = (r2 * f2**2 - r1 * f1**2) / (f2**2 - f1**2)
    other = (r2 - r1 * f1**2 / f2**2) / (1.0 - f1**2 / f2**2)
    pressure, temperature, vapour = 1013.25, 288.15, 11.7  # [mbar], [K], [mbar], at sea level
    D = 0.0026 * math.cos(2.0 * PLACE[0]) + 0.00028 * PLACE[2] / 1e3  # (5.8.5)
    zenith = 0.002277 * (1.0 + D) * (pressure + (1255.0 / temperature + 0.05) * vapour)
    printed = 0.002277 * (1.0 + D) * pressure * (1255.0 / temperature + 0.005) * vapour
    said = (
        ("satellite clocks and orbit", "1 to 3 m"), ("ionosphere", "5 to 30 m"),
        ("multipath, carrier and pseudorange", "15 cm, 15 to 30 m"),
        ("selective availability", "200 to 300 m"), ("troposphere, left by a model", "under 1 m"),
        ("receiver, reduced by the phase", "50 %"),
    )  # fmt: skip
    return [
        compared("(5.8.3), range free of the ionosphere, first form", 0.0, free - distance, "m",
                 Tolerance(absolute=1e-6), "less the true one; 10 m of delay on L1, (5.8.1)"),
        compared("(5.8.3), the same, second form", 0.0, other - distance, "m",
                 Tolerance(absolute=1e-6), "less the true range; rounding at 2e7 m"),
        not_given("(5.8.4) as corrected, zenith delay of the troposphere at sea level", zenith,
                  "m",
                  "Saastamoinen: P0 + (1255 / T0 + 0.05) e0; standard atmosphere"),
        info("(5.8.4) as printed, the same", None, printed, "m",
             "P0 (1255 / T0 + 0.005) e0: a misprint"),
        *(info(f"5.8, {what}", text, None, "", "said, nothing to compute") for what, text in said),
    ]  # fmt: skip


def _entries() -> page.Block:
    rows = [(name, *entry) for name, entry in BUDGET.items()]
    sums = np.sqrt(np.sum(np.array(list(BUDGET.values())) ** 2, axis=0))
    return page.table(
        ("error", "GPS [m]", "DGPS [m]"),
        [*rows, ("root of the sum of squares", *map(float, sums)), ("printed", *TOTALS)],
        caption="Tables 5.1 and 5.2",
    )


# --- drift ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """North from rest, after a turn on the spot.

    Attributes
    ----------
    speed : float
        Reached 10 s after the start and kept [m/s].
    turn : float
        Angle of the turn about down, from 1 s to 4 s [rad].
    """

    speed: float = 0.0
    turn: float = 0.0

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        north = jet_of(integral(ramps(0.0, [(5.0, 5.0, self.speed)]), 0.0), t, 2)
        yaw = jet_of(ramps(0.0, [(1.0, 3.0, self.turn)]), t, 2)
        zero = constant(0.0, north)
        return Pose((north, zero, zero), quat_from_angles(zero, zero, yaw))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """One term of (6.1.3): its formula and the error of a mechanisation that has that error.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times [s].
    formula, here : ndarray, shape (n,)
        Sizes of the position error [m].
    """

    t: FloatArray
    formula: FloatArray
    here: FloatArray


def _runs() -> dict[str, Run]:
    """Return every term of the formula, by name."""
    still, straight = _truth(Drive()), _truth(Drive(speed=8.3))
    turned = _truth(Drive(speed=8.3, turn=0.5 * math.pi))
    start = Start.of(still)
    level = np.asarray(start.q_nb)
    tilted = quat_mul(quat_from_rotvec([0.0, 0.1 * DEG, 0.0]), level)
    askew = quat_mul(quat_from_rotvec([0.0, 0.0, 0.5 * DEG]), level)
    mean_speed = _way(straight)[-1] / SPAN
    mean_force = 2.0 * _way(straight)[-1] / SPAN**2
    moved = replace(start, lla=lla_from_ned([10.0, 0.0, 0.0], start.lla))
    return {
        "dp0, 10 m": _term(still, moved, position=10.0),
        "dv0, 0.1 m/s": _term(still, replace(start, v_n=(0.1, 0.0, 0.0)), velocity=0.1),
        "db0a, accelerometer bias of 1 mg": _term(still, start, acc=(MG, 0.0, 0.0), acc_bias=MG),
        "db0g, gyro bias of 0.015 deg/s": _term(
            still, start, gyr=(0.0, 0.015 * DPS, 0.0), gyr_bias=0.015 * DPS
        ),
        "dalpha0, tilt of 0.1 deg": _term(still, replace(start, q_nb=tilted), tilt=0.1 * DEG),
        "dH0z, azimuth off by 0.5 deg": _term(
            straight, replace(start, q_nb=askew), heading=0.5 * DEG, speed=mean_speed
        ),
        "SF0a, accelerometer scale off by 0.5 %": _term(
            straight, start, acc_scale=0.005, specific_force=mean_force
        ),
        "SF0g, gyro scale off by 0.5 %": _term(
            turned, start, gyr_scale=0.005, heading_change=0.5 * math.pi, speed=mean_speed
        ),
    }


def _truth(drive: Drive) -> Truth:
    return truth(drive, np.arange(round(SPAN * RATE) + 1) / RATE, PLACE, m_n=(2e-5, 0.0, 4e-5))


def _way(of: Truth) -> FloatArray:
    return np.asarray(ned_from_lla(of.lla, of.lla[0])[:, 0])


def _term(
    of: Truth,
    start: Start,
    *,
    acc: Any = (0.0, 0.0, 0.0),
    gyr: Any = (0.0, 0.0, 0.0),
    **error: float,
) -> Run:
    """Return a run with one error, beside one without any, on the same samples."""
    scale = np.array([1.0 + error.get("acc_scale", 0.0), 1.0, 1.0])
    turn = np.array([1.0, 1.0, 1.0 + error.get("gyr_scale", 0.0)])
    clean = _mechanised(of, Start.of(of), of.omega_ib_b, of.f_b)
    wrong = _mechanised(of, start, of.omega_ib_b * turn + gyr, of.f_b * scale + acc)
    off = ned_from_lla(wrong, of.lla[0]) - ned_from_lla(clean, of.lla[0])
    gravity = float(np.linalg.norm(gravity_n(of.lla[0])))
    formula = drift(of.t, gravity=gravity, **error).total
    return Run(t=of.t, formula=formula, here=np.linalg.norm(off[:, :2], axis=1))


def _mechanised(of: Truth, start: Start, gyr: FloatArray, acc: FloatArray) -> FloatArray:
    """Return where the mechanisation gets to; the height is held, so that it does not diverge."""
    sol: Solution = mechanise((of.t, gyr, acc), start, sampling="points", height="held")
    return np.asarray(sol.lla)


def _drift(runs: dict[str, Run]) -> list[Row]:
    """Return the rows of the formula beside the mechanisation, after 100 s."""
    rows = [
        compared(f"(6.1.3), {name}, after 100 s", float(run.formula[-1]), float(run.here[-1]), "m",
                 TOLERANCE, "formula beside a mechanisation on the turning ellipsoid; 1 %: what "
                 "curvature and rate of the Earth, left out of it, do in 100 s")
        for name, run in runs.items()
    ]  # fmt: skip
    rows.append(not_given(
        "(6.1.3), gyro bias of table 6.2, x, left in for 100 s",
        float(drift(SPAN, gyr_bias=0.3766 * DPS, gravity=9.81).total) / 1e3, "km",
        "why the calibration comes first",
    ))  # fmt: skip
    rows.append(not_given(
        "(6.1.3), accelerometer bias of 0.35 m/s^2 left in for 100 s",
        float(drift(SPAN, acc_bias=0.35).total), "m", "the largest of table 6.1",
    ))  # fmt: skip
    return rows


def _powers(runs: dict[str, Run]) -> list[Row]:
    """Return the rows of how the errors grow."""
    remark = "slope in log-log axes, 10 s to 100 s; curvature of the Earth within 0.01"
    near = Tolerance(absolute=0.01)
    return [
        compared(f"6.1, position error from the {sensor}, power of time", power,
                 slope(runs[name].t, runs[name].here, 10.0, SPAN), "1", near, remark)
        for sensor, power, name in (
            ("gyroscopes", 3.0, "db0g, gyro bias of 0.015 deg/s"),
            ("accelerometers", 2.0, "db0a, accelerometer bias of 1 mg"),
        )
    ]  # fmt: skip


def _figure(runs: dict[str, Run]) -> page.Block:
    colors = (*AXIS_COLORS, "#cc79a7", "#e69f00", "#56b4e9", "#5b6470", "#0b5cad")
    items = []
    for (name, run), color in zip(runs.items(), colors, strict=True):
        rows = np.unique(np.geomspace(100, len(run.t) - 1, 120).astype(int))
        items.append(Series(x=run.t[rows], y=run.here[rows], name=name, color=color, kind="path"))
        items.append(
            Series(
                x=run.t[rows],
                y=run.formula[rows],
                name="formula",
                color=color,
                kind="path",
                dash="dot",
            )
        )
    panel = Panel(
        y_label="position error [m]", items=items, x_label="time [s]", height=320, log_x=True,
        log_y=True, y_range=(1e-4, 1e3),
    )  # fmt: skip
    return page.plot(grid_figure([panel]), "(6.1.3) beside a mechanisation, term by term.")


PART: Final = Part(
    name="budget",
    title="Errors of GPS, tables 5.1 and 5.2; drift formula (6.1.3)",
    source="5.8, 6.1; items 8, 9, 12",
    run=run,
)
