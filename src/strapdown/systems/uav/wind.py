"""S10: a light breeze, slowly varying biases; 4.2.3, figures 4.30 and 4.31, open loop.

The aircraft flies its track through the air; the breeze carries air and aircraft over the ground,
so that GPS sees another course than the nose points to. No sensor but GPS feels a steady wind.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, not_given, worded
from strapdown.systems.uav import flight, plots
from strapdown.systems.uav.flight import ANGLES, Log
from strapdown.systems.uav.sensors import SWING

BREEZE: Final = (1.6, 3.3)  # ends of Beaufort's light breeze [m/s]
FROM_SOUTH_WEST: Final = (np.sqrt(0.5), np.sqrt(0.5), 0.0)  # where it blows to


def run(seed: int) -> Shown:
    """Fly the tighter mission in calm air and in both breezes.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    flown = flight.log("tight", seed, varying=True)
    rows: list[Row] = []
    blocks = []
    flt = flight.multi()
    calm = flight.mean_abs(flight.errors(flt.run(flown.rec, diagnostics=False), flown), flown)
    for speed in BREEZE:
        blown = carried(flown, speed)
        sol = flt.run(blown.rec, diagnostics=False)
        off = flight.errors(sol, flown)
        mean = flight.mean_abs(off, flown)
        item = f"S10, {speed:g} m/s"
        rows += [
            not_given(f"{item}, multi-mode, largest error of {name} after 30 s",
                      float(flight.largest(off, flown)[k]), "deg",
                      f"mean {mean[k]:.2g} deg, in calm air {calm[k]:.2g}")
            for k, name in enumerate(ANGLES)
        ]  # fmt: skip
        rows.append(worded(
            f"{item}, figure 4.30, roll and pitch", "estimate degrades",
            f"mean errors {mean[0]:.2g} and {mean[1]:.2g} deg, in calm air {calm[0]:.2g} and "
            f"{calm[1]:.2g}", same=bool((mean[:2] > 2.0 * calm[:2]).all()), from_simulation=True,
            tolerance="twice as large",
            remark="a course that is no heading pulls at all three angles through the field",
        ))  # fmt: skip
        bias = np.asarray(sol.gyr_bias)
        rows.append(_biases(item, bias, flown))
        blocks.append(page.plot(
            plots.biases(flown, ((bias, "multi-mode", plots.MULTI),)),
            f"Figure 4.31: biases in a breeze of {speed:g} m/s.",
        ))  # fmt: skip
    return Shown(rows=rows, blocks=blocks)


def carried(flown: Log, speed: float) -> Log:
    """Return the flight in a steady wind to the north-east.

    Parameters
    ----------
    flown : Log
        In calm air.
    speed : float
        Of the wind [m/s].

    Returns
    -------
    Log
    """
    fixes = flown.rec.need("gnss")
    v_n = np.asarray(fixes.v_n) + speed * np.array(FROM_SOUTH_WEST)
    return replace(flown, rec=replace(flown.rec, gnss=replace(fixes, v_n=v_n)))


def _biases(item: str, bias: FloatArray, flown: Log) -> Row:
    """Return whether the biases are still followed."""
    rms = np.sqrt(np.mean((bias[flown.late] - flown.bias[flown.late]) ** 2, axis=0))
    part = float(rms.max() / (SWING[0] / np.sqrt(2.0)))
    return worded(
        f"{item}, figure 4.31, biases", "still right",
        f"RMS errors {rms[0]:.2g}, {rms[1]:.2g}, {rms[2]:.2g} rad/s, {100.0 * part:.2g} % of the "
        "swing's RMS", same=part < 0.25, from_simulation=True, tolerance="a quarter of the swing",
        remark="a steady error of heading is no rate",
    )  # fmt: skip


PART: Final = Part(
    name="wind",
    title="A light breeze, S10: figures 4.30 and 4.31",
    source="4.2.3",
    run=run,
)
