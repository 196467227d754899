"""Tables 6.1 and 6.2: the ADIS16350 calibrated without knowing its orientation.

The preset `adis16350` holds the parameters of both tables; its sensors are put into as many
positions as the thesis had, and the parameters are found again. Orientations, durations and
noise are not printed. Chosen here: accelerometer positions about 45 deg apart, 14 s each, which
leaves 0.5 mg of noise on a mean; for the gyroscope six faces and three corners, 60 s at each
rate. The g-sensitivity of the datasheet is left out of the gyroscope, for the model has none.
"""

import math
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.calibration import (
    CalibrationRecord,
    accelerometer_from_poses,
    gyro_from_rate_table,
)
from strapdown.calibration.sphere import fibonacci_sphere
from strapdown.constants import G0
from strapdown.report import page
from strapdown.report.figures import ESTIMATE, MUTED, Panel, Series, grid_figure
from strapdown.sensors import Gyro, preset
from strapdown.systems._parts import Part
from strapdown.systems._rows import (
    Row,
    Shown,
    Tolerance,
    compared,
    info,
    not_given,
    simulated,
    worded,
)
from strapdown.truth import Truth
from strapdown.units import DEG, DPS, MG, RPM

NAMES: Final = ("b_x", "b_y", "b_z", "s_x", "s_y", "s_z", "theta_yz", "theta_zx", "theta_zy")
TABLE_6_1: Final = (
    0.012133, 0.023295, -0.03593, 0.00775, 0.008838, 0.008041, -0.00086, 0.01142, -0.00049,
)  # fmt: skip
TABLE_6_2: Final = (
    0.3766, 0.1963, 0.6270, 0.004818, 0.004042, 0.009385, -0.00126, -0.00296, -0.00171,
)  # fmt: skip
VARIANCES: Final = (
    0.08846, 0.07018, 0.02816, 1.80e-5, 1.42e-5, 2.57e-5, 4.08e-5, 1.50e-4, 1.53e-4,
)  # fmt: skip
POSES: Final = 39
POSE_TIME: Final = 14.0  # [s]
TURN_TIME: Final = 60.0  # [s]
TABLE_RATES: Final = (200.0 * DPS, 270.0 * DPS)
_SHOWN_SIGMAS: Final = (("b_x", DPS, "deg/s"), ("s_x", 1.0, "1"), ("theta_zy", 1.0, "rad"))
SIGMAS: Final = 4.0  # one figure in 16,000 lies beyond by chance
SETTLED: Final = 1e-6  # in g or deg/s, parts, rad: no change to see in a plot


class Experiment(NamedTuple):
    """A calibration by both sets of derivatives, and the table it is compared with."""

    number: str
    exact: CalibrationRecord
    thesis: CalibrationRecord
    printed: tuple[float, ...]
    size: float  # of the biases' unit
    unit: str

    def shown(self, values: FloatArray) -> FloatArray:
        """Return values of the nine parameters in the table's units."""
        return np.asarray(values / np.array([self.size] * 3 + [1.0] * 6))


def run(seed: int) -> Shown:
    """Simulate both experiments and calibrate.

    Parameters
    ----------
    seed : int
        Of orientations and noise.

    Returns
    -------
    Shown
    """
    acc_rng, gyr_rng, spread_rng = np.random.default_rng(seed).spawn(3)
    means = _accelerometer_means(acc_rng)
    box: Any = preset("adis16350")
    acc_std = box.acc.noise.white / math.sqrt(POSE_TIME)
    gyr_std = box.gyr.noise.white / math.sqrt(TURN_TIME)
    acc = _experiment("6.1", TABLE_6_1, G0, "g", accelerometer_from_poses, means, std=acc_std)
    axes = _faces_and_corners()
    turns, rates = _gyro_means(axes, gyr_rng)
    gyr = _experiment(
        "6.2", TABLE_6_2, DPS, "deg/s", gyro_from_rate_table, turns, rates, std=gyr_std
    )
    rows = [*_parameters(acc), *_derivatives(acc, 5.0), *_comments(acc)]
    rows += [*_parameters(gyr), *_derivatives(gyr, 4.0), *_variances(gyr)]
    rows += [*_turntable(gyr), *_spread(gyr, spread_rng), *_g_sensitivity(axes, gyr_rng)]
    return Shown(rows=rows, blocks=(_history(acc, "6.3", "6.4"), _history(gyr, "6.9", "6.10")))


# --- simulation -------------------------------------------------------------------------


def _at_rest(f_b: FloatArray, omega: FloatArray, duration: float) -> Truth:
    """Return constant specific force and rate; nothing else of the motion is looked at."""
    t = np.arange(round(200.0 * duration)) / 200.0
    zero = np.zeros((len(t), 3))
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    return Truth(
        t=t, q_nb=q_nb, omega_ib_b=zero + omega, f_b=zero + f_b, lla=zero, v_n=zero, m_n=zero
    )


def _accelerometer_means(rng: np.random.Generator) -> FloatArray:
    """Return the means of 39 positions, rings of zenith angles 45 deg apart, [m/s^2]."""
    acc: Any = preset("adis16350").acc
    zenith = np.repeat(np.arange(5) * 45.0 * DEG, (1, 12, 13, 12, 1))
    roll = np.concatenate(
        [np.arange(n) * 360.0 / n + rng.uniform(0, 360) for n in (1, 12, 13, 12, 1)]
    )
    roll = roll * DEG
    up = np.column_stack(
        (np.sin(zenith) * np.cos(roll), np.sin(zenith) * np.sin(roll), np.cos(zenith))
    )
    still = np.zeros(3)
    return np.array(
        [acc.apply(_at_rest(G0 * d, still, POSE_TIME), rng).value.mean(axis=0) for d in up]
    )


def _faces_and_corners() -> FloatArray:
    corners = np.array([[1.0, 1.0, -1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]) / math.sqrt(3.0)
    return np.vstack((np.eye(3), -np.eye(3), corners))


def _gyro(*, with_g: bool = False) -> Gyro:
    gyr: Any = preset("adis16350").gyr
    whole: Gyro = gyr
    return whole if with_g else replace(whole, g_sensitivity=Gyro().g_sensitivity)


def _gyro_means(
    axes: FloatArray, rng: np.random.Generator, *, with_g: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return means and rates of every axis at both rates of the table [rad/s]."""
    gyr = _gyro(with_g=with_g)
    rates = np.repeat(TABLE_RATES, len(axes))
    means = [
        gyr.apply(_at_rest(-G0 * axis, rate * axis, TURN_TIME), rng).value.mean(axis=0)
        for axis, rate in zip(np.tile(axes, (2, 1)), rates, strict=True)
    ]  # the axis of the table points down
    return np.array(means), rates


def _experiment(
    number: str,
    printed: tuple[float, ...],
    size: float,
    unit: str,
    method: Any,
    *data: FloatArray,
    std: float | None = None,
) -> Experiment:
    """Return a calibration by the right derivatives and by those of the thesis.

    `std` is what the noise of the sensor leaves on a mean.
    """
    exact, thesis = method(*data, std=std), method(*data, variant="thesis")
    return Experiment(number, exact, thesis, printed, size, unit)


# --- rows -------------------------------------------------------------------------------


def _units(experiment: Experiment) -> tuple[str, ...]:
    return (experiment.unit,) * 3 + ("1",) * 3 + ("rad",) * 3


def _parameters(experiment: Experiment) -> list[Row]:
    """Return the rows of the table's values, by the exact derivatives."""
    values = experiment.shown(np.array([p.value for p in experiment.exact.parameters]))
    stds = experiment.shown(np.array([p.std for p in experiment.exact.parameters]))
    return [
        simulated(f"table {experiment.number}, {name}", printed, float(here), unit,
                  Tolerance(absolute=SIGMAS * float(std)), "4 of its own sigmas")
        for name, printed, here, unit, std in zip(
            NAMES, experiment.printed, values, _units(experiment), stds, strict=True
        )
    ]  # fmt: skip


def _settled(experiment: Experiment, record: CalibrationRecord) -> float:
    """Return the iteration whose change is the last above `SETTLED`."""
    change = np.abs(np.diff(experiment.shown(record.history), axis=0)).max(axis=1)
    return float(np.flatnonzero(change > SETTLED)[-1] + 1)


def _derivatives(experiment: Experiment, printed: float) -> list[Row]:
    """Return the rows of the thesis's derivatives beside the right ones."""
    apart = experiment.shown(experiment.thesis.history[-1] - experiment.exact.history[-1])
    ends = experiment.shown(experiment.thesis.history[-1])
    stds = experiment.shown(np.array([p.std for p in experiment.exact.parameters]))
    worst = float(np.abs((ends - experiment.printed) / stds).max())
    n = experiment.number
    return [
        worded(f"table {n}, all nine, by the thesis's derivatives", "the table",
               f"within {worst:.1f} sigma of it", same=worst < SIGMAS, from_simulation=True,
               remark="slopes by the scale factors too large by (1 + s)^4; under 4 sigma"),
        not_given(f"table {n}, thesis's derivatives less the right ones, largest of nine",
                  float(np.abs(apart).max()), f"{experiment.unit}, 1, rad",
                  "the slopes change the way; what is left comes from the weights of the rates"
                  if n == "6.2" else "the slopes change the way, not the end"),
        simulated(f"table {n}, iterations until nothing changes, thesis's derivatives", printed,
                  _settled(experiment, experiment.thesis), "1", Tolerance(absolute=1.0),
                  f"printed as {'after the fifth' if n == '6.1' else 'about four'}; last change "
                  "above 1e-6; tolerance: one iteration"),
        not_given(f"table {n}, the same, right derivatives",
                  _settled(experiment, experiment.exact), "1", "quadratic convergence"),
    ]  # fmt: skip


def _comments(experiment: Experiment) -> list[Row]:
    """Return the rows of what 6.3.1 says about table 6.1."""
    bias, scale, angle = np.abs(np.array(TABLE_6_1)).reshape(3, 3).max(axis=1)
    return [
        compared("6.3.1, equations of the accelerometer", 39.0,
                 float(experiment.exact.equations), "1", Tolerance(), "one per position"),
        compared("6.3.1, their redundancy", 30.0, float(experiment.exact.dof), "1", Tolerance(),
                 "39 equations, 9 unknowns"),
        compared("6.3.1, largest bias of table 6.1", 0.35, float(bias) * 9.81, "m/s^2",
                 Tolerance(absolute=0.005), "about; half of the last printed digit"),
        compared("6.3.1, largest scale factor of table 6.1", 1.0, 100.0 * float(scale), "%",
                 Tolerance(bound="at most"), "all below 1 %"),
        compared("6.3.1, largest misalignment of table 6.1", 0.60, float(angle) / DEG, "deg",
                 Tolerance(bound="at most"),
                 "said to be below about 0.60 deg, but the table's own theta_zx is larger"),
        info("6.3.1, datasheet beside the biases", "+-35 mg",
             f"{preset('adis16350').acc.spread.bias / MG:.0f} mg", "",  # type: ignore[union-attr]
             "the 35 mg rms are the output noise of the datasheet; its 0 g offset is 20 mg"),
        info("figure 6.5, temperature after switching on", "curve without numbers", None, "",
             "not readable; the preset's slopes with temperature are those of the datasheet"),
    ]  # fmt: skip


def _implied_noise(experiment: Experiment) -> tuple[float, FloatArray]:
    """Return the noise of a mean that the printed variances of the biases stand for [deg/s].

    Also the nine variances at that noise: the program's ``v'v (J'J)^-1`` is proportional to the
    variance of a mean.
    """
    squares = np.array([experiment.size**2] * 3 + [1.0] * 6)
    here = np.diag(experiment.thesis.covariance) / squares
    factor = float(np.exp(np.log(np.array(VARIANCES[:3]) / here[:3]).mean()))
    record = experiment.exact
    used = record.residual_rms * math.sqrt(record.equations / record.dof) / DPS
    return used * math.sqrt(factor), factor * here


def _squared(unit: str) -> str:
    return unit if unit == "1" else f"({unit})^2"


def _variances(experiment: Experiment) -> list[Row]:
    """Return the rows of the table's variances, which need the noise that is not printed."""
    sigma, scaled = _implied_noise(experiment)
    rows = [
        not_given(
            "table 6.2, noise of a mean that makes the printed variances of the biases", sigma,
            "deg/s", "the datasheet's output noise is 0.6 deg/s rms: means of a few samples",
        )
    ]  # fmt: skip
    rows += [
        info(f"table 6.2, variance of {name}", printed, float(here), _squared(unit),
             "v'v (J'J)^-1 at that noise; the larger ones in print, of s and theta, speak for "
             "positions less spread than here")
        for name, printed, here, unit in zip(
            NAMES, VARIANCES, scaled, _units(experiment), strict=True
        )
    ]  # fmt: skip
    rows.append(
        not_given(
            "table 6.2, printed variances over usual ones", float(experiment.exact.dof), "1",
            "the program does not divide v'v by the redundancy",
        )
    )  # fmt: skip
    return rows


def _turntable(experiment: Experiment) -> list[Row]:
    """Return the rows of the turntable and of the number of equations."""
    rows = [
        compared(f"6.3.2, {rpm} rpm", printed, rpm * RPM / DPS, "deg/s", Tolerance(absolute=0.5),
                 "half of the last printed digit")
        for rpm, printed in ((33.33, 200.0), (45.0, 270.0))
    ]  # fmt: skip
    return [
        *rows,
        compared("6.3.2, equations of the gyroscope", 18.0, float(experiment.exact.equations), "1",
                 Tolerance(), "9 positions at 2 rates"),
        compared("6.3.2, their redundancy", 9.0, float(experiment.exact.dof), "1", Tolerance(),
                 "18 equations, 9 unknowns"),
        info("6.3.2, wireless readout, 17 ms from command to frame", "hardware", None, "",
             "nothing is computed"),
    ]  # fmt: skip


def _spread(good: Experiment, rng: np.random.Generator) -> list[Row]:
    """Return the rows of what positions near to each other cost."""
    cap = fibonacci_sphere(100)
    cap = cap[np.argsort(-cap[:, 2])[:9]]
    bad = gyro_from_rate_table(*_gyro_means(cap, rng))
    tilt = math.degrees(math.acos(float(cap[:, 2].min())))
    off = max(
        abs(p.value / (DPS if k < 3 else 1.0) - TABLE_6_2[k]) / (p.std / (DPS if k < 3 else 1.0))
        for k, p in enumerate(bad.parameters)
    )
    return [
        not_given(f"6.3.2, sigma of {name}, positions well spread / within {tilt:.0f} deg",
                  f"{good.exact[name].std / size:.2g} / {bad[name].std / size:.2g}", unit,
                  "positions must be as distinct as possible: a poor spread shows as sigma")
        for name, size, unit in _SHOWN_SIGMAS
    ] + [
        not_given("6.3.2, the same poor spread, worst error in its own sigmas", off, "sigma"),
    ]  # fmt: skip


def _g_sensitivity(axes: FloatArray, rng: np.random.Generator) -> list[Row]:
    """Return the row of the error that the model leaves out."""
    record = gyro_from_rate_table(*_gyro_means(axes, rng, with_g=True))
    off = np.abs(record.bias / DPS - TABLE_6_2[:3]).max()
    return [
        not_given("6.3.2, worst bias error if 0.05 deg/s/g acts, which the model lacks",
                  float(off), "deg/s", "on a level table gravity turns with the axis"),
    ]  # fmt: skip


# --- figures ----------------------------------------------------------------------------


def _history(experiment: Experiment, whole: str, detail: str) -> page.Block:
    """Return the parameters over the iterations of the thesis's program."""
    history = experiment.shown(experiment.thesis.history)
    iterations = np.arange(len(history), dtype=np.float64)
    units = _units(experiment)
    panels = [
        _panel(iterations[:11], history[:11, k], f"{NAMES[k]} [{units[k]}]") for k in range(9)
    ]
    late = slice(4, 11)
    panels.append(
        _panel(
            iterations[late],
            history[late, 0] - history[-1, 0],
            f"b_x less its end [{experiment.unit}]",
        )
    )
    return page.plot(
        grid_figure(panels, columns=2),
        f"Figures {whole} and {detail}: parameters over the iterations of the thesis's program.",
    )


def _panel(x: FloatArray, y: FloatArray, label: str) -> Panel:
    """Return a parameter over the iterations; one name, so that no legend hides the titles."""
    items = [
        Series(x=x[[0, -1]], y=np.full(2, y[-1]), name="estimate", color=MUTED, dash="dot"),
        Series(x=x, y=y, name="estimate", color=ESTIMATE),
        Series(x=x, y=y, name="estimate", color=ESTIMATE, kind="points", width=5.0),
    ]
    return Panel(y_label="", title=label, items=items, x_label="iteration", height=110)


PART: Final = Part(
    name="calibration",
    title="Multi-position calibration: tables 6.1 and 6.2, figures 6.3, 6.4, 6.9, 6.10",
    source="chapter 6; items 11, 13 to 18",
    run=run,
)
