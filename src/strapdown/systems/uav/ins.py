"""4.1: position and velocity behind the AHRS, and (1.2); the thesis prints no figure of it."""

from dataclasses import replace
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.earth import meridian_radius, transverse_radius
from strapdown.navigation import UavIns
from strapdown.report import page
from strapdown.report.figures import Panel, Series, time_figure
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, not_given, worded
from strapdown.systems.uav import flight, plots
from strapdown.systems.uav.flight import Log
from strapdown.systems.uav.sensors import SIGMAS
from strapdown.truth import Truth

BIAS: Final = (0.1, -0.05, 0.2)  # of the accelerometers, chosen here [m/s^2]
AXES: Final = ("north", "east", "down")
GPS_RATE: Final = 4.0  # of the preset [Hz]
# gravity is 9.803 there, the default 9.807; Coriolis at 9 m/s is 1 mm/s^2
SYSTEMATIC: Final = 0.006


def run(seed: int) -> Shown:
    """Fly the first mission with and without losses of GPS.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    truth = flight.truth("first")
    rows = [*_rates(truth)]
    panels = []
    for outage, name in ((0.0, "GPS always valid"), (25.0, "GPS lost for 25 s of 100")):
        flown = flight.log("first", seed, outage=outage, gps_rate=GPS_RATE)
        imu = flown.rec.need("imu")
        rec = replace(flown.rec, imu=replace(imu, acc=imu.acc + np.array(BIAS)))
        sol = UavIns(**flight.multi().parameters()).run(rec, diagnostics=False)
        lla, v_n = np.asarray(sol.lla), np.asarray(sol.v_n)
        off = (lla - truth.lla) * _metres(truth)
        rows += _errors(name, off, v_n - truth.v_n, flown)
        if not outage:
            rows.append(_biases(np.asarray(sol.acc_bias)[-1], np.asarray(sol.std_acc_bias)[-1]))
        items = [
            Series(x=flown.t, y=off[:, k], name=AXES[k], color=color)
            for k, color in enumerate((plots.TRUTH, plots.MULTI, plots.STANDARD))
        ]
        panels.append(Panel(y_label=f"position [m], {name}", items=items, height=180))
    block = page.plot(time_figure(panels), "Errors of the INS; the thesis shows none.")
    return Shown(rows=rows, blocks=(block,))


def _metres(truth: Truth) -> FloatArray:
    """Return metres per radian of latitude and longitude, and per metre of depth."""
    lat, height = truth.lla[:, 0], truth.lla[:, 2]
    north = meridian_radius(lat) + height
    east = (transverse_radius(lat) + height) * np.cos(lat)
    return np.stack((north, east, -np.ones_like(north)), axis=1)


def _rates(truth: Truth) -> list[Row]:
    """Return how well (1.2) makes the flown track of the flown velocity."""
    rate = truth.v_n / _metres(truth)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(truth.t)[:, None]
    track = truth.lla[0] + np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
    off = (track - truth.lla) * _metres(truth)
    return [not_given(
        "(1.2), track of 2.7 km integrated from the flown velocity, largest error",
        float(np.abs(off[:, :2]).max()), "m", "trapezoids of 20 ms; radii of WGS-84",
    )]  # fmt: skip


def _errors(name: str, off: FloatArray, off_v: FloatArray, flown: Log) -> list[Row]:
    late = flown.late
    rows = []
    for k, axis in enumerate(AXES):
        rms, worst = np.sqrt(np.mean(off[late, k] ** 2)), np.abs(off[late, k]).max()
        rows.append(not_given(
            f"4.1, {name}, position {axis}, RMS after 30 s", float(rms), "m",
            f"largest {worst:.2g} m; fixes at 4 Hz with 1.5 m, down 3 m",
        ))  # fmt: skip
    speed = np.sqrt(np.mean(np.sum(off_v[late] ** 2, axis=1)))
    rows.append(not_given(f"4.1, {name}, velocity, RMS after 30 s", float(speed), "m/s",
                          "all three axes; fixes with 0.1 m/s each"))  # fmt: skip
    return rows


def _biases(found: FloatArray, std: FloatArray) -> Row:
    """Return whether the biases are those that were simulated."""
    off = np.abs(found - np.array(BIAS))
    return worded(
        "appendix B, biases of the accelerometers", "estimated by the INS",
        "; ".join(f"{found[k]:.3f} of {BIAS[k]:g}" for k in range(3)) + " m/s^2",
        same=bool((off < SIGMAS * std + SYSTEMATIC).all()), from_simulation=True,
        tolerance="4 sigma and 6 mm/s^2", remark="values chosen here; gravity is taken for 9.807 "
        "in place of 9.803 m/s^2, and Coriolis left out",
    )  # fmt: skip


PART: Final = Part(
    name="ins",
    title="Position, velocity and accelerometer biases behind the AHRS: 4.1",
    source="1.2.2, 4.1, appendix B",
    run=run,
)
