"""Section 9.2.2: how many times the magnetometer's deviation to take, figures 9.12 and 9.13."""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, grid_figure
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, worded
from strapdown.systems.platform import bench
from strapdown.systems.platform.replay import (
    CONVERGED_S,
    Replay,
    Trial,
    errors,
    replay,
    terrestrial,
)
from strapdown.units import DEG

FACTORS: Final = (1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0)
CHOSEN: Final = 20.0
DROP: Final = 10.0  # beyond, the error drops drastically
RUNS: Final = 3  # Monte Carlo analyses
MOTION: Final = Trial("k", 120.0, (4.00, 7.33, 8.09), (15.13, 21.41, 20.85), 115.0)  # table 9.1


def run(seed: int) -> Shown:
    """Vary k on three logs, with and without a systematic error of the magnetometer.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    logs = [replay(MOTION, seed, number) for number in range(RUNS)]
    rows: list[Row] = []
    panels: list[Panel] = []
    for systematic in (True, False):
        rms = np.array([[attitude_rms(log, k, systematic) for k in FACTORS] for log in logs])
        rows += curve_rows(rms, systematic)
        panels += _panels(rms, systematic)
    rows.append(_angle())
    block = page.plot(
        grid_figure(panels, columns=2),
        "Figures 9.12 and 9.13: RMS of the quaternion's error against k, sum and components.",
    )
    return Shown(rows=rows, blocks=(block,))


def attitude_rms(log: Replay, factor: float, systematic: bool) -> FloatArray:
    """Return the RMS of q1, q2, q3 and of roll and pitch against the true motion from 50 s on.

    Parameters
    ----------
    log : Replay
        The log.
    factor : float
        k.
    systematic : bool
        Whether the magnetometer has its systematic error.

    Returns
    -------
    ndarray, shape (5,)
        The angles in degrees.
    """
    flt, rec = terrestrial(log, systematic=systematic, factor=factor)
    sol = flt.run(rec, diagnostics=False)
    found = errors(flt, rec, sol, log.true_rpy, log.true_rates).rms(log.t >= CONVERGED_S)
    return np.concatenate((found.q, found.rpy[:2]))


def curve_rows(rms: FloatArray, systematic: bool) -> list[Row]:
    """Return what the curves over k say.

    Parameters
    ----------
    rms : ndarray, shape (runs, factors, 5)
        See `attitude_rms`.
    systematic : bool
        Whether the magnetometer has its systematic error.

    Returns
    -------
    list of Row
    """
    kind = "systematic error" if systematic else "white noise only"
    total = rms[:, :, :3].sum(axis=2)
    mean = total.mean(axis=0)
    at = FACTORS.index(CHOSEN)
    rows = [
        not_given(
            f"figure 9.12, {kind}, k = {k:g}, sum of RMS of q", float(mean[n]), "",
            "RMS of q1, q2, q3 " + ", ".join(f"{v:.3g}" for v in rms.mean(axis=0)[n, :3]),
        )
        for n, k in enumerate(FACTORS)
    ]  # fmt: skip
    best = FACTORS[int(np.argmin(mean))]
    if not systematic:
        rows.append(
            info(
                "9.2.2, white noise only, k of the least sum", CHOSEN, best, "",
                "with white noise alone there is nothing for k to mend: the thesis's choice shows "
                "that its magnetometer had systematic errors",
            )
        )  # fmt: skip
        return rows
    least = total / total.min(axis=1, keepdims=True)
    spread = float(least[:, at].std(ddof=1))
    tilt = rms[:, :, 3:].mean(axis=0)
    drop = float((tilt[0] / tilt[FACTORS.index(DROP)]).min())
    above = float(mean[at] / mean.min() - 1.0)
    rows += [
        worded(
            "9.2.2, systematic error, k = 20 is the best compromise of three analyses",
            "k = 20",
            f"least at k = {best:g}; at k = 20 {100.0 * above:.2g} % above it",
            same=above <= 0.05,
            from_simulation=True,
            tolerance="5 % of the least",
            remark="mean of the three, a flat curve; the three differ in this figure by "
            f"{100.0 * spread:.2g} %. White noise asks for less than 30, see below",
        ),
        worded(
            "9.2.2, systematic error, the error drops drastically up to k = 10",
            "drops", f"roll and pitch by a factor of {drop:.3g} or more from k = 1 to 10",
            same=drop >= 2.0, from_simulation=True, tolerance="factor of 2",
            remark=f"from {tilt[0, 0]:.2g} and {tilt[0, 1]:.2g} deg RMS; heading hardly changes, "
            "no k removes its error",
        ),
    ]  # fmt: skip
    return rows


def _angle() -> Row:
    """Return the angle between gravity and field, which makes heading weak."""
    north, _, down = bench.FIELD_G
    return compared(
        "9.2.2, angle between the two vectors", 28.9, float(np.arctan2(north, down)) / DEG, "deg",
        Tolerance(absolute=0.05), "of the printed N_h; last digit. (6.22) and 9.2.2 disagree",
    )  # fmt: skip


def _panels(rms: FloatArray, systematic: bool) -> list[Panel]:
    kind = "systematic error" if systematic else "white noise only"
    k, mean = np.array(FACTORS), rms.mean(axis=0)
    one = [Series(x=k, y=mean[:, :3].sum(axis=1), name="sum", kind="path")]
    three = [
        Series(x=k, y=mean[:, n], name=f"q{n + 1}", color=AXIS_COLORS[n], kind="path")
        for n in range(3)
    ]
    return [
        Panel(
            x_label="k",
            y_label=f"RMS, {kind}",
            items=items,
            height=220,
            log_x=True,
            log_y=log,
        )
        for items, log in ((one, False), (three, True))
    ]


PART = Part(
    name="mag-factor",
    title="Multiplier of the magnetometer's deviation: figures 9.12, 9.13",
    source="9.2.2",
    run=run,
)
