"""Section 9.3: the filter fed sample by sample, as on the microcontroller, tables 9.6 to 9.9."""

from dataclasses import replace
from typing import Final

import numpy as np

from strapdown.attitude import IndirectEkf
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, time_figure
from strapdown.solution import Solution
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, info, worded
from strapdown.systems.platform.offline import Ran, error_rows, ground_rows, motion_rows
from strapdown.systems.platform.replay import (
    CONVERGED_S,
    Replay,
    Trial,
    errors,
    replay,
    space,
    terrestrial,
)

SPACE_TESTS: Final = (
    Trial("TEST 1 on-line", 180.0, (5.475, 6.904, 6.969), (18.061, 16.786, 19.443), 170.0),
    Trial("TEST 2 on-line", 180.0, (5.141, 7.073, 6.040), (22.008, 18.893, 20.137), 170.0),
    Trial("TEST 3 on-line", 180.0, (5.827, 7.294, 6.359), (17.366, 21.748, 17.519), 170.0),
    Trial("TEST 4 on-line", 180.0, (6.807, 7.922, 8.070), (22.328, 22.504, 26.128), 170.0),
)
TERRESTRIAL_TESTS: Final = (
    Trial("TEST 1 on-line", 180.0, (6.136, 7.709, 6.392), (18.130, 21.435, 18.252), 170.0),
    Trial("TEST 2 on-line", 180.0, (5.550, 7.816, 6.761), (18.130, 19.313, 19.183), 170.0),
    Trial("TEST 3 on-line", 180.0, (4.398, 7.342, 7.503), (17.435, 20.802, 18.092), 170.0),
    Trial("TEST 4 on-line", 180.0, (3.901, 6.00, 7.662), (13.183, 17.908, 21.137), 170.0),
)
# RMS of q1 q2 q3 and of phi theta psi [deg]: tables 9.7 and 9.9.
SPACE: Final = (
    ((5.336e-4, 4.122e-4, 5.148e-4), (0.062, 0.049, 0.058)),
    ((5.528e-4, 4.133e-4, 3.367e-4), (0.063, 0.048, 0.039)),
    ((5.322e-4, 4.353e-4, 5.047e-4), (0.059, 0.052, 0.057)),
    ((6.019e-4, 5.027e-4, 4.065e-4), (0.068, 0.058, 0.047)),
)
TERRESTRIAL: Final = (
    ((1.410e-3, 9.795e-4, 3.517e-3), (0.116, 0.065, 0.421)),
    ((2.105e-3, 2.650e-3, 8.736e-3), (0.111, 0.082, 1.074)),
    ((1.9267e-3, 1.576e-3, 9.057e-3), (0.099, 0.106, 1.067)),
    ((2.200e-3, 1.620e-3, 9.699e-3), (0.067, 0.061, 1.155)),
)


def run(seed: int) -> Shown:
    """Stream the four tests of each scenario through the filter.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    panels: dict[str, list[Panel]] = {"9.18, space": [], "9.19, terrestrial": []}
    same = True
    for test, printed in zip(SPACE_TESTS, SPACE, strict=True):
        log = replay(test, seed)
        rows += motion_rows("9.6", test, log)
        ran, equal = streamed(log, *space(log))
        same = same and equal
        rows += error_rows("9.7", "", test, printed, ran)
        panels["9.18, space"].append(_panel(test, log, ran))
    for test, printed in zip(TERRESTRIAL_TESTS, TERRESTRIAL, strict=True):
        log = replay(test, seed, number=1)  # another motion than the space tests of that name
        rows += motion_rows("9.8", test, log)
        ran, equal = streamed(log, *terrestrial(log, systematic=True))
        same = same and equal
        clean, _ = streamed(log, *terrestrial(log, systematic=False))
        rows += ground_rows("9.9", "", test, printed, ran, clean)
        panels["9.19, terrestrial"].append(_panel(test, log, ran))
    rows += [
        worded(
            "9.3, the filter runs sample by sample", "in real time",
            "bits equal to those of one run" if same else "differs from one run",
            same=same, from_simulation=True, remark="attitudes and biases of all eight tests",
        ),
        info("tables 9.6, 9.8, unit of the RMS", "deg", "deg/s", "", "misprint"),
        info("9.3, rates on line", None, None, "", "the thesis has no table of their errors"),
    ]  # fmt: skip
    blocks = [
        page.plot(time_figure(four), f"Figure {name} scenario: errors of the angles.")
        for name, four in panels.items()
    ]
    return Shown(rows=rows, blocks=blocks)


def _panel(test: Trial, log: Replay, ran: Ran) -> Panel:
    counted = log.t >= CONVERGED_S
    return Panel(
        y_label=f"{test.name.split(' on')[0]} [deg]",
        items=[
            Series(x=log.t[counted], y=ran.found.rpy[counted, k], name=name, color=AXIS_COLORS[k])
            for k, name in enumerate(("phi", "theta", "psi"))
        ],
    )


def streamed(log: Replay, flt: IndirectEkf, rec: Recording) -> tuple[Ran, bool]:
    """Feed a log to the filter a sample at a time.

    Parameters
    ----------
    log : Replay
        With the references.
    flt : IndirectEkf
        The filter.
    rec : Recording
        What it sees of the log.

    Returns
    -------
    Ran
        What it said after each sample.
    bool
        Whether `run` says the same, bit for bit.
    """
    imu, mag, star = rec.imu, rec.mag, rec.star
    assert imu is not None
    aiding = {} if star is None else dict(zip(star.t.tolist(), star.q_nb, strict=True))
    state = flt.init()
    q_nb, bias = np.empty((len(imu), 4)), np.empty((len(imu), 3))
    for k, t in enumerate(imu.t.tolist()):
        field = None if mag is None else mag.mag[k]  # all are sampled together, 9.2
        if t in aiding:
            state = flt.step(state, t, imu.gyr[k], imu.acc[k], field, star=aiding[t])
        else:
            state = flt.step(state, t, imu.gyr[k], imu.acc[k], field)
        q_nb[k], bias[k] = state.q_nb, state.gyr_bias
    whole = flt.run(rec, diagnostics=False)
    assert whole.gyr_bias is not None
    same = np.array_equal(whole.q_nb, q_nb) and np.array_equal(whole.gyr_bias, bias)
    sol = replace(whole, q_nb=q_nb, gyr_bias=bias)
    return _ran(log, flt, rec, sol), same


def _ran(log: Replay, flt: IndirectEkf, rec: Recording, sol: Solution) -> Ran:
    counted = slice(int(np.searchsorted(log.t, CONVERGED_S)), None)
    found = errors(flt, rec, sol, log.rpy, log.rates)
    true = errors(flt, rec, sol, log.true_rpy, log.true_rates)
    return Ran(sol, found, found.rms(counted), true.rms(counted))


PART = Part(
    name="on-line",
    title="On-line runs: tables 9.6 to 9.9, figures 9.18, 9.19",
    source="9.3",
    run=run,
)
