"""Section 6.3: the box on a servo, yaw by the two-stage filter, figures 6.6 to 6.8.

Two servos are simulated. The shipped scenario swings as A.2.3 programs it, 90 deg in 0.3 s of each
0.5 s, ten times in 12 s; that is faster than the gyroscope's range of 245 deg/s. The thesis's
curves swing by the whole 90 deg, over about 15 s: its servo must have been slower. One of 0.7 s a
swing stays within the range.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import RobustEskf, TwoStage
from strapdown.attitude._base import AttitudeEstimator
from strapdown.noise import zero_rate
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import REFERENCE, Panel, Series, time_figure
from strapdown.rotation import interpolate, quat_from_rpy, rpy_from_quat
from strapdown.simulation.motions import Servo, Static
from strapdown.simulation.scenario import Scenario, Timing, load
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, info, not_given, simulated, worded
from strapdown.units import DEG, DPS

START_DEG: Final = 110.0
END_DEG: Final = 157.0
LENGTH_S: Final = 15.0
SLOPE_DPS: Final = 3.13
SWING_DEG: Final = 90.0
BIAS_DPS: Final = 3.1291  # table 6.2, z
BY_EYE_DEG: Final = 3.0  # how well angles can be read off a figure
LEFT_DPS: Final = 0.1
SLOW_S: Final = 0.7  # a swing within 245 deg/s less the bias


class Drift(NamedTuple):
    """Yaw of a run from the first swing on.

    Attributes
    ----------
    t, yaw, motion : ndarray, shape (n,)
        Time since the first swing [s], estimated yaw and true swing [deg].
    start, end : float
        Yaw at the first swing and `LENGTH_S` later [deg].
    slope : float
        Straight part of the yaw beside the swing [deg/s].
    swing : float
        Estimated over true swing, times 90 deg.
    error : ndarray, shape (n,)
        Yaw less motion, from zero at the start [deg].
    """

    t: FloatArray
    yaw: FloatArray
    motion: FloatArray
    start: float
    end: float
    slope: float
    swing: float
    error: FloatArray


def run(seed: int) -> Shown:
    """Swing both servos and follow yaw, with and without compensation, in 6 and 9 axes.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    blocks: list[page.Block] = []
    bias = zero_rate_bias(seed)
    for scene, name in ((slow_servo(), "swings of 0.7 s"), (load("servo"), "swings of 0.3 s")):
        rec = scene.record(seed)
        plain = follow(rec, TwoStage(use_mag=False), bias[2])
        mended = follow(compensated(rec, bias), TwoStage(use_mag=False))
        rows += drift_rows(name, plain)
        rows += compensated_rows(name, mended)
        if scene.name != "servo":
            rows += _nine_axes(rec, bias)
        maker = follow(rec, RobustEskf(use_mag=False, gyr_range=245.0 * DPS), aligned=True)
        rows.append(
            info(
                f"6.3.1, {name}, lowest and highest yaw of the board's fusion", "-90 and 0",
                f"{maker.error.min():.2f} and {(maker.motion + maker.error).max():.2f}", "deg",
                "MotionFX is closed; this is the flagship here on the same data without field, "
                "which finds the bias by itself. The thesis's yaw turns the other way",
            )
        )  # fmt: skip
        blocks.append(_figure(name, plain, mended, maker))
    rows += _still(seed)
    return Shown(rows=rows, blocks=blocks)


# --- runs ---------------------------------------------------------------------------------


def slow_servo() -> Scenario:
    """Return the shipped scenario with a servo that the gyroscope can follow."""
    shipped = load("servo")
    return replace(
        shipped,
        name="slow servo",
        motion=Servo(wait=SLOW_S, move=SLOW_S),
        timing=replace(shipped.timing, duration=26.0),
    )


def zero_rate_bias(seed: int) -> FloatArray:
    """Return the mean of two minutes at rest, 6.2.2 [rad/s], shape (3,)."""
    scene = replace(
        load("servo"),
        motion=Static(),
        timing=Timing(duration=120.0, rate=119.0, reference_rate=1.0),
    )
    imu = scene.record(seed + 1).imu
    assert imu is not None
    return zero_rate(imu.gyr).mean


def compensated(rec: Recording, bias: FloatArray) -> Recording:
    """Return the log with the zero-rate offset taken off, as 6.2.3 asks."""
    assert rec.imu is not None
    return replace(rec, imu=replace(rec.imu, gyr=rec.imu.gyr - bias))


def follow(
    rec: Recording, flt: AttitudeEstimator, drift: float = 0.0, *, aligned: bool = False
) -> Drift:
    """Return the yaw that a filter makes of a log of the servo.

    Parameters
    ----------
    rec : Recording
        The log; the servo starts after 5 s.
    flt : AttitudeEstimator
        The filter.
    drift : float
        Expected drift before the servo starts, so that the first swing begins at 110 deg
        [rad/s].
    aligned : bool
        Whether the filter begins by itself, without a given yaw.

    Returns
    -------
    Drift
    """
    assert rec.reference is not None
    assert rec.reference.attitude is not None
    first = Servo().rest
    yaw_0 = START_DEG * DEG - drift * first
    state = flt.init() if aligned else flt.init(attitude=quat_from_rpy([0.0, 0.0, yaw_0]))
    sol, _ = flt.advance(state, rec, diagnostics=False)
    true = interpolate(sol.t, rec.reference.attitude.t, rec.reference.attitude.q_nb)
    rows = (sol.t >= first) & (sol.t <= first + LENGTH_S + 1.0)
    t = sol.t[rows] - first
    yaw = np.unwrap(sol.rpy[rows, 2]) / DEG
    motion = np.unwrap(rpy_from_quat(true)[rows, 2]) / DEG
    fitted = t <= LENGTH_S
    design = np.column_stack((np.ones_like(t), t, motion / SWING_DEG))[fitted]
    _, slope, swing = np.linalg.lstsq(design, yaw[fitted], rcond=None)[0]
    error = yaw - motion
    return Drift(
        t, yaw, motion, float(yaw[0]), float(np.interp(LENGTH_S, t, yaw)), float(slope),
        float(swing), error - error[0],
    )  # fmt: skip


# --- rows ---------------------------------------------------------------------------------


def drift_rows(name: str, found: Drift) -> list[Row]:
    """Return the drift of the filter without compensation.

    Parameters
    ----------
    name : str
        Which servo.
    found : Drift
        Of the 6-axis filter.

    Returns
    -------
    list of Row
    """
    clipped = found.swing < SWING_DEG - BY_EYE_DEG
    why = (
        "; the gyroscope ends at 245 deg/s, and what it cuts off the swings is lost, the bias "
        "while it does so too: the thesis's servo must have been slower"
        if clipped
        else ""
    )
    eye = Tolerance(absolute=BY_EYE_DEG)
    return [
        info(f"6.3.1, {name}, yaw at the first swing", START_DEG, found.start, "deg",
             "the filter starts so that it comes to be"),
        simulated(f"6.3.1, {name}, yaw {LENGTH_S:g} s later", END_DEG, found.end, "deg", eye,
                  f"read off a figure, 3 deg{why}"),
        simulated(f"6.3.1, {name}, slope of yaw", SLOPE_DPS, found.slope, "deg/s",
                  Tolerance(absolute=0.15),
                  "biases about x and y tilt the estimate, which turns the axis by up to 5 %"
                  + why),
        simulated(f"6.3.1, {name}, slope against the zero-rate of z", BIAS_DPS, found.slope,
                  "deg/s", Tolerance(absolute=0.15), f"as above{why}"),
        simulated(f"6.3.1, {name}, size of the swings", SWING_DEG, found.swing, "deg", eye,
                  f"read off a figure, 3 deg{why}"),
    ]  # fmt: skip


def compensated_rows(name: str, found: Drift) -> list[Row]:
    """Return the same with the zero-rate offset taken off.

    Parameters
    ----------
    name : str
        Which servo.
    found : Drift
        Of the 6-axis filter on compensated rates.

    Returns
    -------
    list of Row
    """
    why = (
        "; the swings beyond 245 deg/s are cut off in the raw rate, unevenly by the bias"
        if found.swing < SWING_DEG - BY_EYE_DEG
        else ""
    )
    largest = float(np.abs(found.error[found.t <= LENGTH_S]).max())
    return [
        worded(
            f"6.2.3, {name}, slope after compensation of the zero-rate",
            "must be compensated",
            f"{found.slope:.3f} deg/s left",
            same=abs(found.slope) <= LEFT_DPS,
            from_simulation=True,
            tolerance=f"+-{LEFT_DPS:g} deg/s",
            remark=f"a thirtieth of the offset that is taken off{why}",
        ),
        worded(
            f"6.3.1, {name}, yaw after compensation",
            "within 90 deg of the start",
            f"{largest:.2f} deg off at most",
            same=largest <= BY_EYE_DEG,
            from_simulation=True,
            tolerance=f"+-{BY_EYE_DEG:g} deg",
            remark=f"as the board's own yaw, read off a figure{why}",
        ),
    ]


def _nine_axes(rec: Recording, bias: FloatArray) -> list[Row]:
    """Return the errors with the second stage on, which the thesis does not show."""
    rows = []
    for used, name in ((rec, "raw rates"), (compensated(rec, bias), "compensated rates")):
        found = follow(used, TwoStage(), aligned=True)
        rows.append(
            not_given(
                f"4.2.2, 9DOF, {name}, largest change of the error of yaw",
                float(np.abs(found.error).max()), "deg",
                f"bounded by the field; slope {found.slope:.3g} deg/s as it settles",
            )
        )  # fmt: skip
    return rows


def _still(seed: int) -> list[Row]:
    """Return two minutes at rest, 6 and 9 axes, without compensation."""
    scene = replace(
        load("servo"),
        motion=Static(rpy=(0.0, 0.0, 50.0 * DEG)),
        timing=Timing(duration=120.0, rate=119.0, reference_rate=1.0),
    )
    rec = scene.record(seed)
    rows = []
    for flt, name in ((TwoStage(use_mag=False), "6DOF"), (TwoStage(), "9DOF")):
        sol = flt.run(rec, diagnostics=False)
        yaw = np.unwrap(sol.rpy[:, 2]) / DEG
        roll, pitch, _ = sol.rpy[-1] / DEG
        mean = (yaw[-1] - yaw[0]) / (sol.t[-1] - sol.t[0])
        rows.append(
            not_given(
                f"checklist 29, 58, two minutes still, {name}, mean drift of yaw", float(mean),
                "deg/s",
                f"roll and pitch end at {roll:.1f} and {pitch:.1f} deg: R1 = 2 and R2 = 1 "
                "beside Q = 1e-6 trust the gyroscope, whose offset is not compensated",
            )
        )  # fmt: skip
    return rows


def _figure(name: str, plain: Drift, mended: Drift, maker: Drift) -> page.Block:
    colors = ("#d55e00", "#0072b2", "#009e73")
    items = [Series(x=plain.t, y=plain.motion + plain.start, name="servo", color=REFERENCE)]
    for found, label, color in zip(
        (plain, mended, maker), ("two-stage", "compensated", "board's part"), colors, strict=True
    ):
        items.append(Series(x=found.t, y=found.yaw, name=label, color=color))
    panel = Panel(y_label="yaw [deg]", items=items, height=260)
    return page.plot(time_figure([panel]), f"Figures 6.6 to 6.8: yaw, {name}.")


PART = Part(
    name="servo",
    title="Servo: yaw of the two-stage filter, figures 6.6 to 6.8",
    source="6.3, A.2.3",
    run=run,
)
