"""S1, S2, S3: biases and angles found, both programs twice, both filters compared; 4.2.1."""

from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.recording import Gnss, Imu, Mag, Recording
from strapdown.report import page
from strapdown.systems._parts import Part
from strapdown.systems._rows import (
    Row,
    Shown,
    Tolerance,
    info,
    not_given,
    simulated,
    worded,
)
from strapdown.systems.uav import flight, plots, programs
from strapdown.systems.uav.flight import ANGLES, AXES, Log
from strapdown.systems.uav.sensors import BIAS, SIGMAS
from strapdown.units import GAUSS

STEPS: Final = 3000  # of both programs, one minute
IDENTICAL: Final = 1e-9  # round-off of some thousand steps
BEGIN: Final = 240.0  # biases are means of the last minute [s]


def run(seed: int) -> Shown:
    """Fly the first mission with constant biases.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    flown = flight.log("first", seed)
    rows: list[Row] = []
    blocks = []
    for printed in (False, True):
        kind = "as printed" if printed else "corrected"
        flt = flight.multi(printed=printed)
        sol = flt.run(flown.rec, diagnostics=False)
        off = flight.errors(sol, flown)
        rows += limit_rows(f"S1, 4.2.1, multi-mode {kind}", off, flown, "GPS always valid")
        rows += bias_rows(f"S1, 4.2.1, multi-mode {kind}", sol.gyr_bias, sol.std_gyr_bias, flown)
        plain = flight.standard(printed=printed).run(flown.rec, diagnostics=False)
        rows += _comparison(kind, off, flight.errors(plain, flown), flown)
        rows += bias_rows(f"S3, 4.2.1, standard {kind}", plain.gyr_bias, None, flown)
        if not printed:
            figure = plots.angles(flown, sol, plain)
            blocks.append(
                page.plot(figure, "Figures 4.7 to 4.10: roll, pitch, yaw and their errors.")
            )
            curves = ((np.asarray(sol.gyr_bias), "multi-mode", plots.MULTI),)
            blocks.append(page.plot(plots.biases(flown, curves), "Figure 4.5: biases."))
    rows += _identical(seed)
    slow = flight.errors(
        flight.multi().run(flight.log("first", seed, gps_rate=4.0).rec, diagnostics=False), flown
    )
    rows.append(not_given(
        "2.1, rate of the GPS; largest error of the three angles with 4 Hz in place of 25",
        float(np.abs(slow[flown.late]).max()), "deg", "a fix corrects when it comes",
    ))  # fmt: skip
    return Shown(rows=rows, blocks=blocks)


def limit_rows(item: str, off: FloatArray, flown: Log, remark: str) -> list[Row]:
    """Return the largest errors after convergence beside the 1 deg of 4.2.2.

    Parameters
    ----------
    item : str
        What stands before each angle.
    off : ndarray, shape (n, 3)
        Errors [deg].
    flown : Log
        The flight.
    remark : str
        Of the rows.

    Returns
    -------
    list of Row
    """
    worst = np.abs(off[flown.late]).max(axis=0)
    return [
        simulated(f"{item}, largest error of {name} after 30 s", 1.0, float(worst[k]), "deg",
                  Tolerance(bound="at most"), f"{remark}; the thesis prints the limit for S5")
        for k, name in enumerate(ANGLES)
    ]  # fmt: skip


def bias_rows(item: str, bias: Any, std: Any, flown: Log) -> list[Row]:
    """Return the biases of the last minute beside the simulated constants.

    Parameters
    ----------
    item : str
        Of the rows.
    bias : ndarray, shape (n, 3)
        Estimated [rad/s].
    std : ndarray, shape (n, 3), or None
        Stated standard deviations; None: those of a filter that claims too much in turns.
    flown : Log
        The flight.

    Returns
    -------
    list of Row
    """
    last = flown.t >= BEGIN
    found = bias[last].mean(axis=0)
    width = 0.02 * np.ones(3) if std is None else SIGMAS * std[-1]
    why = (
        "0.02 rad/s, less than half of the swing that S7 cannot follow"
        if std is None
        else "4 sigma"
    )
    return [
        simulated(f"{item}, bias b_{AXES[k]}, mean of the last minute", BIAS[k], float(found[k]),
                  "rad/s", Tolerance(absolute=float(width[k])), why)
        for k in range(3)
    ]  # fmt: skip


def _comparison(kind: str, multi: FloatArray, standard: FloatArray, flown: Log) -> list[Row]:
    """Return the rows of S3: how much better, where the standard filter is off."""
    mean = [np.abs(off[flown.late]).mean(axis=0) for off in (multi, standard)]
    better = 100.0 * (1.0 - mean[0] / mean[1])
    rows = [
        info(f"S3, 4.2.1, {kind}, improvement of {name} in mean absolute error", None,
             float(better[k]), "%", f"{mean[1][k]:.2g} deg standard, {mean[0][k]:.2g} multi-mode")
        for k, name in enumerate(ANGLES)
    ]  # fmt: skip
    rows.append(simulated(
        f"S3, 4.2.1, {kind}, improvement, mean of the three angles", 50.0, float(better.mean()),
        "%", Tolerance(bound="at least"), "'about 50 %', of an error measure that is not printed",
    ))  # fmt: skip
    straight = flown.late & ~flown.turning
    turns = [float(np.abs(off[flown.turning, 0]).mean()) for off in (standard, multi)]
    calm = float(np.abs(standard[straight, 0]).mean())
    rows.append(worded(
        f"S3, figure 4.7, {kind}, roll in turns", "standard has an offset, multi-mode follows",
        f"mean errors {turns[0]:.2g} and {turns[1]:.2g} deg",
        same=turns[0] > 1.0 and turns[1] < 0.25 * turns[0], from_simulation=True,
        tolerance="1 deg; a quarter of it", remark="banked by more than 10 deg",
    ))  # fmt: skip
    rows.append(worded(
        f"S3, figure 4.7, {kind}, roll of the standard filter", "off mainly in turns",
        f"mean error {turns[0]:.2g} deg in turns, {calm:.2g} out of them",
        same=turns[0] > 1.5 * calm, from_simulation=True, tolerance="half as much again",
        remark="turns follow each other every 22 s here; what one has left takes longer to go",
    ))  # fmt: skip
    rows.append(worded(
        f"S3, figure 4.9, {kind}, yaw", "curves overlap, errors differ slightly",
        f"mean errors {mean[1][2]:.2g} and {mean[0][2]:.2g} deg",
        same=bool(mean[1][2] < 1.0), from_simulation=True, tolerance="1 deg",
        remark="a roll that is off by degrees turns the levelled field by as many"
        + ("; and declination is left out" if kind == "as printed" else ""),
    ))  # fmt: skip
    return rows


def _identical(seed: int) -> list[Row]:
    """Return the rows of S2: kernels as printed beside the programs in dense matrices."""
    flown = flight.log("first", seed, outage=25.0, every=50.0)
    t, imu = flown.t[:STEPS], flown.rec.need("imu")
    gyr, acc, field = imu.gyr[:STEPS], imu.acc[:STEPS], flown.rec.need("mag").mag[:STEPS]
    v_n, valid = _at_even_counts(flown, len(t))
    # the first step of a program has an interval: a sample before it begins that
    before = np.concatenate(([t[0] - programs.DT], t))
    fixes = np.flatnonzero(np.arange(len(t)) % 2 == 1)
    rec = Recording(
        imu=Imu(t=before, gyr=np.vstack((gyr[:1], gyr)), acc=np.vstack((acc[:1], acc))),
        mag=Mag(t=t, mag=field),
        gnss=Gnss(t=t[fixes], lla=np.zeros((len(fixes), 3)),
                  v_n=np.where(valid[fixes, None], v_n[fixes], np.nan)),
    )  # fmt: skip
    rows = []
    for name, flt in (
        ("standard", flight.standard(printed=True)),
        ("multi-mode", flight.multi(printed=True)),
    ):
        sol, _ = flt.advance(flt.init(attitude=[1.0, 0.0, 0.0, 0.0]), rec, diagnostics=False)
        memory, worst = programs.Memory(), 0.0
        for k in range(len(t)):
            sample = (field[k] / GAUSS, acc[k], gyr[k])
            if name == "standard":
                programs.standard(memory, *sample)
            else:
                programs.multi_mode(memory, *sample, v_n[k], valid=bool(valid[k]))
            here = np.concatenate((sol.q_nb[k + 1], sol.gyr_bias[k + 1]))  # type: ignore[index]
            worst = max(worst, float(np.abs(here - memory.x).max()))
        rows.append(worded(
            f"S2, figure 4.6, {name}, two implementations", "identical results",
            f"apart by {worst:.0e} at most", same=worst < IDENTICAL, from_simulation=True,
            tolerance="1e-9", remark=f"dense matrices and kernel, {STEPS} steps, "
            "both modes, the same start",
        ))  # fmt: skip
    return rows


def _at_even_counts(flown: Log, n: int) -> tuple[FloatArray, Any]:
    """Return velocity and validity at the steps that correct; a lost fix has none."""
    fixes = flown.rec.need("gnss")
    number = np.round(fixes.t / programs.DT).astype(int) + 1
    v_n, valid = np.zeros((n, 3)), np.zeros(n, dtype=bool)
    inside = number < n
    v_n[number[inside]] = fixes.v_n[inside]
    valid[number[inside]] = True
    return v_n, valid


PART: Final = Part(
    name="ahrs",
    title="Both filters with constant biases, S1 to S3: figures 4.4 to 4.10",
    source="4.2.1",
    run=run,
)
