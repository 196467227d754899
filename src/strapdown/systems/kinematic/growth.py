"""Tables 1 and 2: how errors of gyroscope and accelerometer grow when they are integrated.

Slopes are those of a straight line in log-log axes. Of deterministic errors they follow from one
integration; of random ones from the standard deviation over many simulated records.
"""

import math
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, grid_figure
from strapdown.sensors import Digital, Gyro, Linear, Noise
from strapdown.systems._growth import slope as power
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, not_given, simulated, worded
from strapdown.systems.kinematic import device
from strapdown.units import DEG, DPS

DT: Final = 1.0 / device.RATE  # [s]
FIRST, LAST = 10.0, 100.0  # times between which slopes are taken [s]
RECORDS: Final = 1000
# The logarithms of two standard deviations of 1000 records each have a sigma of 1 / sqrt(2000);
# over a decade a slope then has at most 0.014, less where both ends are correlated.
RANDOM_SLOPE: Final = Tolerance(absolute=0.055)
RANDOM_REMARK: Final = "std over 1000 records, 10 s to 100 s; 4 sigma of that slope"
EXACT: Final = Tolerance(absolute=1e-3)
EXACT_REMARK: Final = "10 s to 100 s; sums at 100 Hz against integrals"


def run(seed: int) -> Shown:
    """Integrate the errors of tables 1 and 2.

    Parameters
    ----------
    seed : int
        Of the noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    t = DT + device.times(LAST)
    white, walk = _records(rng, Noise(white=1.0), t), _records(rng, Noise(random_walk=1.0), t)
    random = {
        "angle random walk": _integrals(white, 1).std(axis=0),
        "angle, from bias random walk": _integrals(walk, 1).std(axis=0),
        "position, from white noise": _integrals(white, 2).std(axis=0),
        "position, from bias random walk": _integrals(walk, 2).std(axis=0),
    }
    rows = [*_gyro(t, random), *_calibration_errors(t), *_accelerometer(t, random)]
    return Shown(rows=rows, blocks=(_figure(t, random),))


def _records(rng: np.random.Generator, noise: Noise, t: FloatArray) -> FloatArray:
    """Return records of noise, shape (RECORDS, n)."""
    return noise.sample(len(t), DT, rng, width=RECORDS).T


def _integrals(x: FloatArray, times: int) -> FloatArray:
    """Return x integrated that often, along its last axis."""
    for _ in range(times):
        x = DT * np.cumsum(x, axis=-1)
    return x


def slope(t: FloatArray, y: FloatArray) -> float:
    """Return the slope of the size of y over t in log-log axes, from `FIRST` to `LAST`."""
    return power(t, y, FIRST, LAST)


def _gyro(t: FloatArray, random: dict[str, FloatArray]) -> list[Row]:
    """Return the rows of table 1, all but its calibration errors."""
    constant = np.ones_like(t)
    rows = [
        compared("table 1, constant bias: angle ~ t^1", 1.0, slope(t, _integrals(constant, 1)),
                 "1", EXACT, EXACT_REMARK),
        simulated("table 1, white noise: std of angle ~ t^0.5", 0.5,
                  slope(t, random["angle random walk"]), "1", RANDOM_SLOPE, RANDOM_REMARK),
        simulated("table 1, bias random walk: std of angle ~ t^1.5", 1.5,
                  slope(t, random["angle, from bias random walk"]), "1", RANDOM_SLOPE,
                  "printed as second-order random walk, whose slope is 1.5; " + RANDOM_REMARK),
        compared("table 1, temperature: angle ~ t^1", 1.0,
                 slope(t, _integrals(_warmed(), 1)), "1", EXACT,
                 "0.1 deg/s/degC, 5 degC off; " + EXACT_REMARK),
    ]  # fmt: skip
    # the unit noise above scales: at time t its standard deviation is that of sqrt(t)
    unit = float(np.interp(LAST, t, random["angle random walk"])) / math.sqrt(LAST)
    for axis, variance in zip("xyz", device.GYR_VARIANCE, strict=True):
        density = math.sqrt(variance * DT)
        rows.append(
            not_given(
                f"table 3, {axis}: std of angle after 150 s",
                unit * density * math.sqrt(device.DURATION) / DEG, "deg",
                "from the simulated records; sigma sqrt(dt t) is "
                f"{density * math.sqrt(device.DURATION) / DEG:.4f} deg",
            )
        )  # fmt: skip
    return rows


def _warmed() -> FloatArray:
    """Return what a gyroscope reads at rest 5 degC off its calibration [rad/s], one axis."""
    gyr = Gyro(temp_bias=(0.1 * DPS, 0.1 * DPS, 0.1 * DPS))
    samples = gyr.apply(device.still(LAST), np.random.default_rng(0), temp_degc=30.0)
    return np.ascontiguousarray(samples.value[:, 0])


def _calibration_errors(t: FloatArray) -> list[Row]:
    """Return the rows of scale, misalignment, non-linearity and rounding."""
    turned = 0.01 * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    quadratic = ((1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (0.0, 0.0, 1e-3))
    models = {
        "scale factor 1 %": Linear.from_scale_and_misalignment(0.01 * np.eye(3)),
        "misalignment 0.01 rad": Linear.from_scale_and_misalignment(turned),
        "quadratic term 0.001 s/rad": Linear(quadratic=quadratic),
    }
    rows = []
    for name, model in models.items():
        slow, fast = _angle_error(model, 1.0, t), _angle_error(model, 10.0, t)
        with_time, with_speed = slope(t, slow), math.log10(fast[-1] / slow[-1])
        rows.append(worded(
            f"table 1, calibration, {name}", "grows with time and with speed",
            f"~ t^{with_time:.2f} speed^{with_speed:.2f}",
            same=with_time > 0.5 and with_speed > 0.5,
            remark="about an oblique axis, 1 and 10 rad/s; grows: an exponent above 0.5",
        ))  # fmt: skip
    converter = Digital(lsb=2.0 * 250.0 * DPS / 2**16, full_scale=250.0 * DPS)
    rate = np.linspace(-240.0, 240.0, 100_001) * DPS
    rounding = float(np.abs(converter.apply(rate) - rate).max()) / converter.lsb
    rows.append(
        not_given(
            "item 10, quantisation, B = 16 bits over 500 deg/s, largest error", rounding, "LSB"
        )
    )
    return rows


def _angle_error(model: Linear, speed: float, t: FloatArray) -> FloatArray:
    """Return the error of the integrated angle at a constant rate [rad], shape (n,)."""
    rate = np.tile(speed * np.array([0.6, -0.64, 0.48]), (len(t), 1))
    return np.asarray(np.linalg.norm(_integrals((model.apply(rate) - rate).T, 1), axis=0))


def _accelerometer(t: FloatArray, random: dict[str, FloatArray]) -> list[Row]:
    """Return the rows of table 2; its "angle" and "eps t^2/2 t" are slips copied from table 1."""
    constant = np.ones_like(t)
    return [
        compared("table 2, constant bias: velocity ~ t^1", 1.0, slope(t, _integrals(constant, 1)),
                 "1", EXACT, EXACT_REMARK),
        compared("table 2, constant bias: position ~ t^2", 2.0, slope(t, _integrals(constant, 2)),
                 "1", EXACT, EXACT_REMARK),
        compared("table 2, constant bias: position / (eps t^2 / 2)", 1.0,
                 float(_integrals(constant, 2)[-1] / (0.5 * t[-1] ** 2)), "1", EXACT,
                 "at 100 s; printed as an angle eps t^2/2 t, a slip copied from table 1"),
        simulated("table 2, white noise: std of velocity ~ t^0.5", 0.5,
                  slope(t, random["angle random walk"]), "1", RANDOM_SLOPE, RANDOM_REMARK),
        simulated("table 2, white noise: std of position ~ t^1.5", 1.5,
                  slope(t, random["position, from white noise"]), "1", RANDOM_SLOPE,
                  RANDOM_REMARK),
        simulated("table 2, bias random walk: std of position ~ t^2.5", 2.5,
                  slope(t, random["position, from bias random walk"]), "1", RANDOM_SLOPE,
                  "printed as third-order random walk, whose slope is 2.5; " + RANDOM_REMARK),
        compared("table 2, temperature: position ~ t^2", 2.0,
                 slope(t, _integrals(_warmed(), 2)), "1", EXACT,
                 "a bias that the temperature leaves, as above; " + EXACT_REMARK),
        not_given("table 2, calibration: error at rest of a scale factor off by 1 %",
                  float(_error_at_rest()), "mg",
                  "visible at rest, as the thesis says, because gravity is measured"),
    ]  # fmt: skip


def _error_at_rest() -> float:
    model = Linear.from_scale_and_misalignment(0.01 * np.eye(3))
    gravity = np.array([0.0, 0.0, 1.0])
    return 1e3 * float(np.linalg.norm(model.apply(gravity) - gravity))


def _figure(t: FloatArray, random: dict[str, FloatArray]) -> page.Block:
    colors = (*AXIS_COLORS, "#cc79a7")
    rows = np.unique(np.geomspace(10, len(t) - 1, 200).astype(int))
    items = [
        Series(x=t[rows], y=std[rows], name=name, color=color, kind="path")
        for (name, std), color in zip(random.items(), colors, strict=True)
    ]
    panel = Panel(
        y_label="std, unit coefficients", items=items, x_label="time [s]", height=280,
        log_x=True, log_y=True,
    )  # fmt: skip
    return page.plot(
        grid_figure([panel]),
        "Growth of the integrated errors over time: slopes 1/2, 3/2, 3/2 and 5/2.",
    )


PART: Final = Part(
    name="errors",
    title="Growth of integrated errors: tables 1 and 2",
    source="2.3.2, 2.4.3; items 6 to 11",
    run=run,
)
