"""Section 9.2: the filter on logs of the platform moved by hand, tables 9.1 to 9.5."""

from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, sigma_band, time_figure
from strapdown.solution import Solution
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, info, not_given, simulated, worded
from strapdown.systems.platform.replay import (
    CONVERGED_S,
    Errors,
    Replay,
    Trial,
    errors,
    replay,
    space,
    terrestrial,
)
from strapdown.units import DEG, DPS

REQUIRED: Final = 0.5  # deg and deg/s
YAW_LIMIT_DEG: Final = 3.0  # of the terrestrial scenario, chapter 10
TESTS: Final = (
    Trial("TEST 1", 180.0, (4.00, 7.33, 8.09), (15.13, 21.41, 20.85), 170.0),
    Trial("TEST 2", 180.0, (7.05, 8.56, 12.84), (27.49, 33.27, 40.53), 170.0),
    Trial("TEST 3", 180.0, (5.11, 5.50, 11.08), (20.19, 20.88, 39.69), 170.0),
    Trial("TEST 4", 600.0, (2.28, 2.27, 3.84), (16.77, 19.43, 23.87), 75.0),
)
# RMS of q1 q2 q3, of phi theta psi [deg], of the rates [deg/s]: tables 9.2 to 9.5.
SPACE: Final = (
    ((5.839e-4, 6.947e-4, 6.570e-4), (0.071, 0.079, 0.077), (0.140, 0.137, 0.117)),
    ((7.260e-4, 7.431e-4, 1.021e-3), (0.080, 0.086, 0.117), (0.189, 0.165, 0.137)),
    ((5.791e-4, 3.933e-4, 7.715e-4), (0.066, 0.046, 0.089), (0.126, 0.124, 0.112)),
    ((2.713e-4, 2.162e-4, 1.670e-4), (0.030, 0.025, 0.019), (0.090, 0.105, 0.077)),
)
TERRESTRIAL: Final = (
    ((1.663e-3, 1.668e-3, 8.549e-3), (0.091, 0.072, 1.012), (0.140, 0.137, 0.117)),
    ((1.452e-3, 9.721e-4, 6.880e-3), (0.096, 0.100, 0.804), (0.189, 0.165, 0.137)),
    ((7.974e-4, 7.072e-4, 2.795e-3), (0.081, 0.067, 0.328), (0.126, 0.124, 0.113)),
    ((2.538e-3, 1.128e-3, 1.141e-2), (0.127, 0.033, 1.324), (0.090, 0.105, 0.077)),
)
_ANGLES: Final = ("phi", "theta", "psi")


class Ran(NamedTuple):
    """A scenario on one log.

    Attributes
    ----------
    sol : Solution
        What the filter found.
    found : Errors
        Against the encoders' spline, at each time.
    rms : Errors
        RMS of them from 50 s on.
    true : Errors
        RMS against the true motion.
    """

    sol: Solution
    found: Errors
    rms: Errors
    true: Errors


def run(seed: int) -> Shown:
    """Run both scenarios on the four tests.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    worst: dict[str, list[Errors]] = {"space": [], "terrestrial": []}
    blocks: list[page.Block] = []
    for number, test in enumerate(TESTS):
        log = replay(test, seed)
        rows += motion_rows("9.1", test, log)
        orbit = scenario(log, "space")
        ground = scenario(log, "terrestrial")
        clean = scenario(log, "terrestrial", systematic=False)
        rows += error_rows("9.2", "9.3", test, SPACE[number], orbit)
        rows += ground_rows("9.4", "9.5", test, TERRESTRIAL[number], ground, clean)
        worst["space"].append(orbit.rms)
        worst["terrestrial"].append(ground.rms)
        if number == 0:
            rows += _convergence(log, orbit, ground)
            blocks += _figures(log, orbit, ground)
        if number == 3:
            rows += _stability(log, orbit)
    rows += requirement_rows(worst["space"], worst["terrestrial"])
    return Shown(rows=rows, blocks=blocks)


def scenario(log: Replay, name: str, *, systematic: bool = True) -> Ran:
    """Return what the filter of a scenario finds on a log.

    Parameters
    ----------
    log : Replay
        The log.
    name : str
        ``"space"`` or ``"terrestrial"``.
    systematic : bool
        Whether the magnetometer has its systematic error.

    Returns
    -------
    Ran
    """
    flt, rec = space(log) if name == "space" else terrestrial(log, systematic=systematic)
    sol = flt.run(rec, diagnostics=False)
    found = errors(flt, rec, sol, log.rpy, log.rates)
    counted = slice(int(np.searchsorted(log.t, CONVERGED_S)), None)
    true = errors(flt, rec, sol, log.true_rpy, log.true_rates)
    return Ran(sol, found, found.rms(counted), true.rms(counted))


# --- rows ---------------------------------------------------------------------------------


def motion_rows(table: str, test: Trial, log: Replay) -> list[Row]:
    """Return the rates of the simulated motion beside the printed ones.

    Parameters
    ----------
    table : str
        Number of the table.
    test : Trial
        The printed test.
    log : Replay
        The simulated one.

    Returns
    -------
    list of Row
    """
    rates = log.true_rates / DPS
    rms, largest = np.sqrt(np.mean(rates**2, axis=0)), np.abs(rates).max(axis=0)
    return [
        info(f"table {table}, {test.name}, RMS of w{axis}", test.rms[k], float(rms[k]), "deg/s",
             "the motion is made so; the rest of the table follows")
        for k, axis in enumerate("xyz")
    ] + [
        info(f"table {table}, {test.name}, largest w{axis}", test.largest[k], float(largest[k]),
             "deg/s", "not tuned: it follows from the RMS and the sums of sines")
        for k, axis in enumerate("xyz")
    ]  # fmt: skip


def error_rows(
    attitude: str,
    rates: str,
    test: Trial,
    printed: tuple[tuple[float, float, float], ...],
    ran: Ran,
) -> list[Row]:
    """Return errors that must not exceed the printed ones.

    Parameters
    ----------
    attitude, rates : str
        Numbers of the tables; without one for the rates there are no rows of them.
    test : Trial
        Which.
    printed : 3 rows of 3
        RMS of quaternion, angles, rates.
    ran : Ran
        What was found.

    Returns
    -------
    list of Row
    """
    rows = [
        _bounded(f"table {attitude}, {test.name}, RMS of q{k + 1}", printed[0][k], ran, "q", k, "")
        for k in range(3)
    ]
    rows += [
        _bounded(
            f"table {attitude}, {test.name}, RMS of {name}", printed[1][k], ran, "rpy", k, "deg"
        )
        for k, name in enumerate(_ANGLES)
    ]
    return rows + (_rate_rows(rates, test, printed[2], ran) if rates else [])


def _rate_rows(
    table: str, test: Trial, printed: tuple[float, float, float], ran: Ran
) -> list[Row]:
    rows = []
    for k, axis in enumerate("xyz"):
        item = f"table {table}, {test.name}, RMS of w{axis}"
        rows.append(_bounded(item, printed[k], ran, "rates", k, "deg/s"))
    return rows


def _bounded(item: str, printed: float, ran: Ran, part: str, k: int, unit: str) -> Row:
    here, true = (float(getattr(of, part)[k]) for of in (ran.rms, ran.true))
    why = ""
    if here > printed >= true:
        why = ": the excess is the reference's, whose counts stand still at rest"
    return simulated(
        item, printed, here, unit, Tolerance(bound="at most"),
        "printed noise and counts alone should do no worse than the real device; against the "
        f"true motion in place of the encoders' spline {true:.3g}{why}",
    )  # fmt: skip


def ground_rows(
    attitude: str,
    rates: str,
    test: Trial,
    printed: tuple[tuple[float, float, float], ...],
    ran: Ran,
    clean: Ran,
) -> list[Row]:
    """Return the rows of the terrestrial scenario.

    Parameters
    ----------
    attitude, rates, test, printed
        See `error_rows`.
    ran, clean : Ran
        With the systematic error of the magnetometer, and without.

    Returns
    -------
    list of Row
    """
    rows = []
    for k in range(3):
        rows.append(
            _beside(f"table {attitude}, {test.name}, RMS of q{k + 1}", printed[0][k], "q", k, "",
                    ran, clean)
        )  # fmt: skip
    for k, name in enumerate(_ANGLES[:2]):
        item = f"table {attitude}, {test.name}, RMS of {name}"
        rows.append(_bounded(item, printed[1][k], ran, "rpy", k, "deg"))
    item = f"table {attitude}, {test.name}, RMS of psi"
    rows.append(_beside(item, printed[1][2], "rpy", 2, "deg", ran, clean))
    return rows + (_rate_rows(rates, test, printed[2], ran) if rates else [])


def _beside(item: str, printed: float, part: str, k: int, unit: str, ran: Ran, clean: Ran) -> Row:
    here, white = (float(getattr(of.rms, part)[k]) for of in (ran, clean))
    return info(
        item, printed, here, unit,
        "follows the magnetometer's systematic error, of table 6.4's size and a shape that is "
        f"not printed; with white noise alone {white:.3g}",
    )  # fmt: skip


def requirement_rows(orbit: list[Errors], ground: list[Errors]) -> list[Row]:
    """Return the verdicts of 1.1 and chapter 10 on both scenarios.

    Parameters
    ----------
    orbit, ground : list of Errors
        RMS of each test.

    Returns
    -------
    list of Row
    """
    rows = []
    for name, found, passes in (
        ("space", orbit, (True, True, True)),
        ("terrestrial", ground, (True, True, False)),
    ):
        angles = np.max([errors.rpy for errors in found], axis=0)
        rates = np.max([errors.rates for errors in found], axis=0)
        for k, axis in enumerate(_ANGLES):
            rows.append(_required(f"{name}, {axis}", float(angles[k]), "deg", passes[k]))
        for k, axis in enumerate("xyz"):
            rows.append(_required(f"{name}, w{axis}", float(rates[k]), "deg/s", True))
    yaw = max(float(errors.rpy[2]) for errors in ground)
    rows.append(
        simulated(
            "chapter 10, terrestrial, yaw limited to 3 deg", YAW_LIMIT_DEG, yaw, "deg",
            Tolerance(absolute=0.5, bound="at most"),
            "worst RMS of the four tests with a systematic error of table 6.4's size; last digit",
        )
    )  # fmt: skip
    return rows


def _required(item: str, worst: float, unit: str, passes: bool) -> Row:
    here = worst <= REQUIRED
    words = {True: "met", False: "not met"}
    return worded(
        f"1.1, requirement of {REQUIRED:g} {unit}, {item}", words[passes],
        f"{words[here]}: {worst:.3g} {unit}", same=here == passes, from_simulation=True,
        remark="worst RMS of the four tests",
    )  # fmt: skip


def _convergence(log: Replay, orbit: Ran, ground: Ran) -> list[Row]:
    """Return what 9.2.1 and 9.2.2 say of the first seconds, figures 9.9, 9.10, 9.15, 9.16."""
    rows = [
        simulated(
            "9.2.1, space, 3 sigma settles after", CONVERGED_S, settling_time(log.t, orbit.sol),
            "s", Tolerance(bound="at most"),
            "its peaks before the updates stay within 5 % of the last one",
        )
    ]  # fmt: skip
    assert orbit.sol.gyr_bias is not None
    assert ground.sol.gyr_bias is not None
    changed = np.flatnonzero(np.abs(np.diff(orbit.sol.gyr_bias, axis=0)).max(axis=1) > 0.0) + 1
    assert log.rec.star is not None
    between = int(np.count_nonzero(~np.isin(log.t[changed], log.rec.star.t)))
    rows.append(
        worded(
            "figure 9.10, space, the bias changes only at updates", "piecewise constant",
            f"{len(changed)} changes, {between} of them between updates", same=between == 0,
            from_simulation=True,
        )
    )  # fmt: skip
    steps = np.abs(np.diff(ground.sol.gyr_bias, axis=0)).max(axis=1) / DPS
    early = log.t[1:] < 10.0
    rows.append(
        not_given(
            "figure 9.16, terrestrial, largest correction of the bias in 10 s",
            float(steps[early].max()), "deg/s",
            "'strongly unstable in the first seconds'; afterwards "
            f"{float(steps[~early].max()):.2g}",
        )
    )  # fmt: skip
    return rows


def settling_time(t: FloatArray, sol: Solution) -> float:
    """Return when the standard deviation of yaw has settled [s].

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s].
    sol : Solution
        Of the space scenario.

    Returns
    -------
    float
        From then on its largest value in each 3 s is within 5 % of the last one.
    """
    assert sol.std_attitude_n is not None
    every = round(3.0 / float(t[1] - t[0]))
    count = len(t) // every
    peaks = sol.std_attitude_n[: count * every, 2].reshape(count, every).max(axis=1)
    unsettled = np.flatnonzero(np.abs(peaks / peaks[-1] - 1.0) > 0.05)
    return float(t[(unsettled[-1] + 1) * every]) if len(unsettled) else 0.0


def _stability(log: Replay, orbit: Ran) -> list[Row]:
    """Return whether the errors of test 4 grow over its 600 s."""
    first = (log.t >= CONVERGED_S) & (log.t < 300.0)
    early, late = (
        float(np.sqrt(np.mean(orbit.found.q[rows] ** 2))) for rows in (first, log.t >= 300.0)
    )
    return [
        simulated(
            "9.2, TEST 4, space, RMS of q after 300 s over that before", 1.0, late / early, "",
            Tolerance(bound="at most"), "no divergence over 600 s, the last 520 s of them at rest",
        )
    ]  # fmt: skip


# --- figures ------------------------------------------------------------------------------


def _figures(log: Replay, orbit: Ran, ground: Ran) -> list[page.Block]:
    numbers = (
        ("space", orbit, "9.7, 9.8, 9.10, 9.11"),
        ("terrestrial", ground, "9.14, 9.16, 9.17"),
    )
    return [
        page.plot(
            time_figure(_panels(log, ran)),
            f"Figures {number}: {name} scenario, TEST 1: angles, errors, bias, rate.",
        )
        for name, ran, number in numbers
    ]


def _panels(log: Replay, ran: Ran) -> list[Panel]:
    t, sol = log.t, ran.sol
    assert sol.gyr_bias is not None
    assert sol.std_attitude_n is not None

    def lines(values: FloatArray) -> list[Series]:
        return [
            Series(x=t, y=values[:, k], name=axis, color=AXIS_COLORS[k])
            for k, axis in enumerate("xyz")
        ]

    sigma = 0.5 * sol.std_attitude_n[:, 2]
    q_range = 4.0 * float(np.abs(ran.found.q[t >= CONVERGED_S]).max())
    return [
        Panel(y_label="angle [deg]", items=lines(sol.rpy / DEG)),
        Panel(
            y_label="error of q",
            items=[sigma_band(t, sigma, name="±3 sigma of q3"), *lines(ran.found.q)],
            y_range=(-q_range, q_range),
        ),
        Panel(y_label="bias [deg/s]", items=lines(sol.gyr_bias / DPS)),
        Panel(y_label="rate error [deg/s]", items=lines(ran.found.rates)),
    ]


PART = Part(
    name="off-line",
    title="Off-line runs: tables 9.1 to 9.5, figures 9.7 to 9.17, the requirement",
    source="1.1, 9.2, 10",
    run=run,
)
