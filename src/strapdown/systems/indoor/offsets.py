"""Section 6.2: zero-g and zero-rate offsets of the LSM9DS1, tables 6.1 and 6.2."""

import math
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.noise import StaticStatistics, ZeroG, zero_g, zero_rate
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, time_figure
from strapdown.sensors import preset
from strapdown.simulation.motions import Static
from strapdown.simulation.scenario import Scenario, Timing
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, simulated
from strapdown.units import DPS

MINUTES: Final = 2.0
RATE_HZ: Final = 100.0
SHOWN_S: Final = 7.0  # of figures 6.3 and 6.4


class Pose(NamedTuple):
    """A row of table 6.1: mean and largest norm [g], shares above and below 1 [%]."""

    axis: str
    mean: float
    largest: float
    above: float
    below: float


TABLE_6_1: Final = (
    Pose("x", 1.0096, 1.0233, 99.0, 1.0),
    Pose("y", 1.0036, 1.0266, 99.0, 1.0),
    Pose("z", 0.9936, 1.0037, 0.02, 99.08),
)
# Mean [deg/s] and variance [(deg/s)²].
TABLE_6_2: Final = {"x": (0.9055, 0.0079), "y": (-0.7203, 0.0091), "z": (3.1291, 0.0064)}


def run(seed: int) -> Shown:
    """Simulate two minutes in each pose with the printed offsets, and find them again.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    poses = [
        still_norms(pose, np.random.default_rng([seed, k])) for k, pose in enumerate(TABLE_6_1)
    ]
    rows: list[Row] = []
    for pose, found in zip(TABLE_6_1, zero_g(poses), strict=True):
        rows += zero_g_rows(pose, found)
    rows += _conclusions()
    gyr = still_rates(seed)
    rows += zero_rate_rows(zero_rate(gyr))
    return Shown(rows=rows, blocks=(_figure(poses, gyr),))


def norm_std(pose: Pose) -> float:
    """Return the deviation of the norm that a normal distribution needs for the printed shares."""
    from scipy.stats import norm

    smaller = min(pose.above, pose.below) / 100.0
    return abs(pose.mean - 1.0) / float(norm.isf(smaller))


def still_norms(pose: Pose, rng: np.random.Generator) -> FloatArray:
    """Return two minutes at rest with an axis up [m/s^2], shape (n, 3)."""
    n = round(MINUTES * 60.0 * RATE_HZ)
    up = np.eye(3)["xyz".index(pose.axis)]
    return np.asarray(G0 * (pose.mean * up + norm_std(pose) * rng.standard_normal((n, 3))))


def still_rates(seed: int) -> FloatArray:
    """Return two minutes of the preset's gyroscope at rest [rad/s], shape (n, 3)."""
    chip = preset("lsm9ds1")
    scene = Scenario(
        motion=Static(),
        device=chip,
        timing=Timing(duration=60.0 * MINUTES, rate=119.0, reference_rate=1.0),
    )
    imu = scene.record(seed).imu
    assert imu is not None
    return imu.gyr


def zero_g_rows(pose: Pose, found: ZeroG) -> list[Row]:
    """Return a row of table 6.1 beside what simulated data give.

    Parameters
    ----------
    pose : Pose
        Printed.
    found : ZeroG
        Of simulated data.

    Returns
    -------
    list of Row
    """
    n, std = MINUTES * 60.0 * RATE_HZ, norm_std(pose)
    rows = [
        simulated(
            f"table 6.1, {pose.axis}, mean norm", pose.mean, found.mean, "g",
            Tolerance(absolute=3.0 * std / math.sqrt(n) + 5e-5),
            "three standard deviations of the mean, and the last digit",
        )
    ]  # fmt: skip
    for name, thesis, here in (
        ("above", pose.above, 100.0 * found.above),
        ("below", pose.below, 100.0 * found.below),
    ):
        p = min(pose.above, pose.below) / 100.0
        digit = 0.5 if pose.axis != "z" else 5e-3
        contradiction = pose.axis == "z" and name == "below"
        rows.append(
            simulated(
                f"table 6.1, {pose.axis}, share {name} 1 g", thesis, here, "%",
                Tolerance(absolute=100.0 * 3.0 * math.sqrt(p * (1.0 - p) / n) + digit),
                "three standard deviations of a share, and the last digit; noise is chosen so "
                "that it makes the smaller share"
                + ("; 0.02 and 99.08 make 99.10 %, so 99.98 was meant" if contradiction else ""),
            )
        )  # fmt: skip
    extreme = std / math.sqrt(2.0 * math.log(n)) * math.pi / math.sqrt(6.0)
    away = (pose.largest - pose.mean) / std
    rows.append(
        simulated(
            f"table 6.1, {pose.axis}, largest norm", pose.largest, found.maximum, "g",
            Tolerance(absolute=3.0 * extreme),
            "three standard deviations of the largest of n normal samples; the printed one is "
            f"{away:.1f} standard deviations above the mean where 3.9 are expected"
            + ("" if abs(away - 3.9) < 1.0 else ": not the noise of the printed shares, a jolt"),
        )
    )  # fmt: skip
    return rows


def _conclusions() -> list[Row]:
    """Return what 6.2.3 makes of table 6.1."""
    return [
        compared(
            "6.2.3, largest deviation of a mean from 1 g", 0.96,
            100.0 * max(abs(pose.mean - 1.0) for pose in TABLE_6_1), "%",
            Tolerance(absolute=5e-3), "of the printed means; last digit",
        ),
        compared(
            "6.2.3, largest value above 1 g", 0.0266,
            max(pose.largest for pose in TABLE_6_1) - 1.0, "g",
            Tolerance(absolute=5e-5), "of the printed largest values; last digit",
        ),
        *(
            compared(
                f"table 6.1, {pose.axis}, both shares together", 100.0, pose.above + pose.below,
                "%", Tolerance(absolute=0.1 if pose.axis == "z" else 1.0),
                "last digits" + ("; 99,08 must stand for 99,98" if pose.axis == "z" else ""),
            )
            for pose in TABLE_6_1
        ),
    ]  # fmt: skip


def zero_rate_rows(found: StaticStatistics) -> list[Row]:
    """Return table 6.2 beside what simulated data give.

    Parameters
    ----------
    found : StaticStatistics
        Of a gyroscope at rest [rad/s].

    Returns
    -------
    list of Row
    """
    rows = []
    for k, (axis, (mean, variance)) in enumerate(TABLE_6_2.items()):
        rows.append(
            simulated(
                f"table 6.2, {axis}, mean", mean, float(found.mean[k]) / DPS, "deg/s",
                Tolerance(absolute=0.0042 + 3.0 * math.sqrt(variance / found.n)),
                "the Earth's rate, 0.0042 deg/s, which the simulated sensor sees, and three "
                "standard deviations of the mean",
            )
        )  # fmt: skip
        rows.append(
            simulated(
                f"table 6.2, {axis}, variance", variance, float(found.variance[k]) / DPS**2,
                "(deg/s)²", Tolerance(relative=3.0 * math.sqrt(2.0 / found.n) + 5e-5 / variance),
                "three standard deviations of a variance, and the last digit",
            )
        )  # fmt: skip
    rows.append(
        info(
            "6.3.1, 'about 3.12 dps' for the drift about z", 3.12, TABLE_6_2["z"][0], "deg/s",
            "the table has 3.1291",
        )
    )  # fmt: skip
    return rows


def _figure(poses: list[FloatArray], gyr: FloatArray) -> page.Block:
    n = round(SHOWN_S * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    norms = [
        Series(x=t, y=np.linalg.norm(acc[:n], axis=1) / G0 - 1.0, name=axis, color=color)
        for acc, axis, color in zip(poses, "xyz", AXIS_COLORS, strict=True)
    ]
    shown = round(SHOWN_S * 119.0)
    rates = [
        Series(x=np.arange(shown) / 119.0, y=gyr[:shown, k] / DPS, name=axis, color=AXIS_COLORS[k])
        for k, axis in enumerate("xyz")
    ]
    panels = [
        Panel(y_label="norm - 1 [g]", items=norms),
        Panel(y_label="rate [deg/s]", items=rates),
    ]
    return page.plot(time_figure(panels), "Figures 6.3 and 6.4: first seven seconds at rest.")


PART = Part(
    name="offsets",
    title="Zero-g and zero-rate: tables 6.1, 6.2, figures 6.3, 6.4",
    source="6.2",
    run=run,
)
