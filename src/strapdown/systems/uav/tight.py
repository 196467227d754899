"""S8: the tighter mission with constant biases; 4.2.3, figures 4.22 to 4.26."""

from typing import Final

import numpy as np

from strapdown.report import page
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, not_given, worded
from strapdown.systems.uav import flight, plots
from strapdown.systems.uav.ahrs import bias_rows, limit_rows
from strapdown.systems.uav.flight import ANGLES
from strapdown.units import DEG


def run(seed: int) -> Shown:
    """Fly the tighter mission with constant biases.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    flown, wide = flight.log("tight", seed), flight.log("first", seed)
    bank = [float(np.abs(one.rpy[:, 0]).max() / DEG) for one in (flown, wide)]
    rows: list[Row] = [not_given(
        "S8, figure 4.22, largest bank", bank[0], "deg",
        f"{bank[1]:.2g} deg in the first mission; the waypoints are not printed",
    )]  # fmt: skip
    blocks = []
    for printed in (False, True):
        kind = "as printed" if printed else "corrected"
        multi = flight.multi(printed=printed).run(flown.rec, diagnostics=False)
        plain = flight.standard(printed=printed).run(flown.rec, diagnostics=False)
        before = flight.standard(printed=printed).run(wide.rec, diagnostics=False)
        if not printed:
            figure = plots.angles(flown, multi, plain)
            blocks.append(page.plot(figure, "Figures 4.23 to 4.26."))
        off = flight.errors(multi, flown)
        rows += limit_rows(f"S8, 4.2.3, multi-mode {kind}", off, flown, "sharper turns")
        rows += bias_rows(
            f"S8, 4.2.3, multi-mode {kind}", multi.gyr_bias, multi.std_gyr_bias, flown
        )
        rows += bias_rows(f"S8, 4.2.3, standard {kind}", plain.gyr_bias, None, flown)
        mean = flight.mean_abs(flight.errors(plain, flown), flown)
        was = flight.mean_abs(flight.errors(before, wide), wide)
        here = ", ".join(
            f"{name} {was[k]:.2g} -> {mean[k]:.2g} deg" for k, name in enumerate(ANGLES[:2])
        )
        rows.append(worded(
            f"S8, figures 4.23, 4.24, standard {kind}, against the first mission",
            "worse, mainly in roll and pitch", here, same=bool((mean[:2] > was[:2]).all()),
            from_simulation=True, tolerance="larger", remark="mean absolute errors",
        ))  # fmt: skip
    return Shown(rows=rows, blocks=blocks)


PART: Final = Part(
    name="tight",
    title="The tighter mission, S8: figures 4.22 to 4.26",
    source="4.2.3",
    run=run,
)
