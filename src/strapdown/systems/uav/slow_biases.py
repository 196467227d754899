"""S6, S7 and S9: biases that vary as (4.1); 4.2.2 and 4.2.3, open loop."""

from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, not_given, worded
from strapdown.systems.uav import flight, plots
from strapdown.systems.uav.flight import ANGLES, Log, Mission
from strapdown.systems.uav.sensors import SWING

FAILED: Final = 10.0  # mean error of an angle at which no autopilot flies [deg]


def run(seed: int) -> Shown:
    """Fly both missions with slowly varying biases.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    blocks = []
    missions: tuple[tuple[Mission, str], ...] = (("first", "S6, S7"), ("tight", "S9"))
    for mission, name in missions:
        flown = flight.log(mission, seed, varying=True)
        solutions = {}
        for printed in (False, True):
            kind = "as printed" if printed else "corrected"
            for filter_name, flt in (
                ("multi-mode", flight.multi(printed=printed)),
                ("standard", flight.standard(printed=printed)),
            ):
                sol = flt.run(flown.rec, diagnostics=False)
                solutions[filter_name, printed] = sol
                item = f"{name}, {filter_name} {kind}"
                off = flight.errors(sol, flown)
                rows += _angles(item, off, flown, fails=filter_name == "standard")
                rows.append(_biases(item, sol.gyr_bias, flown, fails=filter_name == "standard"))
        multi, plain = solutions["multi-mode", False], solutions["standard", False]
        blocks.append(page.plot(
            plots.angles(flown, multi, plain),
            "Figures 4.17 and 4.20." if mission == "first" else "Figure 4.27.",
        ))  # fmt: skip
        curves = ((_known(multi.gyr_bias), "multi-mode", plots.MULTI),
                  (_known(plain.gyr_bias), "standard", plots.STANDARD))  # fmt: skip
        blocks.append(page.plot(
            plots.biases(flown, curves),
            "Figures 4.18 and 4.21." if mission == "first" else "Figure 4.28.",
        ))  # fmt: skip
    return Shown(rows=rows, blocks=blocks)


def _known(bias: FloatArray | None) -> FloatArray:
    """Return a bias that the filter has."""
    return np.empty((0, 3)) if bias is None else bias


def _angles(item: str, off: FloatArray, flown: Log, *, fails: bool) -> list[Row]:
    """Return the errors of the angles, and whether they are what the thesis says."""
    mean, worst = flight.mean_abs(off, flown), flight.largest(off, flown)
    rows = [
        not_given(f"{item}, largest error of {name} after 30 s", float(worst[k]), "deg",
                  f"mean {mean[k]:.2g} deg")
        for k, name in enumerate(ANGLES)
    ]  # fmt: skip
    said = "strong degradation" if fails else "angles followed correctly"
    limit = f"more than {FAILED:g} deg" if fails else "1 deg"
    rows.append(worded(
        f"{item}, angles", said, f"mean errors {mean[0]:.2g}, {mean[1]:.2g}, {mean[2]:.2g} deg",
        same=bool(mean.max() > FAILED) if fails else bool(mean.max() < 1.0),
        from_simulation=True, tolerance=limit,
        remark="no autopilot flies on these; the loop itself is not closed here" if fails
        else "the thesis prints its 1 deg for constant biases only",
    ))  # fmt: skip
    return rows


def _biases(item: str, bias: Any, flown: Log, *, fails: bool) -> Row:
    """Return whether P and Q are followed: an error well below the swing."""
    off = bias[flown.late] - flown.bias[flown.late]
    rms = np.sqrt(np.mean(off**2, axis=0))
    swing = SWING[0] / np.sqrt(2.0)
    part = float(rms[:2].max() / swing)
    return worded(
        f"{item}, biases", "not estimated correctly" if fails else "followed correctly",
        f"RMS errors {rms[0]:.2g}, {rms[1]:.2g}, {rms[2]:.2g} rad/s, {100.0 * part:.2g} % of the "
        "swing's RMS", same=part > 0.5 if fails else part < 0.25, from_simulation=True,
        tolerance="half of the swing or more" if fails else "a quarter of the swing",
        remark="constant in its model" if fails else "a random walk lags behind a sine",
    )  # fmt: skip


PART: Final = Part(
    name="slow-biases",
    title="Slowly varying biases, S6, S7 and S9: figures 4.17 to 4.21, 4.27, 4.28",
    source="4.2.2, 4.2.3",
    run=run,
)
