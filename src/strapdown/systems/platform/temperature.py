"""Table 6.5: the bias of each axis over temperature, and whether it needs a compensation."""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.calibration import TemperatureRecord, slope_matters, temperature_model
from strapdown.constants import G0
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, grid_figure
from strapdown.sensors import preset
from strapdown.sensors.triads import Triad
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, info, simulated, worded
from strapdown.units import DPS

TEST_S: Final = 600.0
RANGE_DEGC: Final = (20.0, 40.0)  # 6.1.1
RATE_HZ: Final = 100.0
STEP_DEGC: Final = 1e-3  # resolution of the chip's thermometer, 6.6
AMBIENT_DEGC: Final = 1.0  # how much the ambient temperature may change in use
REQUIRED_DPS: Final = 0.5
DRAWS: Final = 200
# p1 per degC and p2, in deg/s and g, of both tests.
TABLE_6_5: Final = {
    "gyr": (
        ((4.339e-3, 2.039e-2, -5.197e-4), (0.934, 3.216, 0.153)),
        ((7.787e-3, 1.896e-2, -3.976e-4), (0.907, 3.515, 4.5986e-3)),
    ),
    "acc": (
        ((-1.860e-4, -4.892e-4, -4.576e-4), (4.705e-3, -3.554e-2, 0.977)),
        ((-3.539e-4, -3.539e-4, -3.593e-4), (-4.2167e-2, -4.2167e-2, 0.954)),
    ),
}
UNITS: Final = {"gyr": ("deg/s", DPS), "acc": ("g", G0)}


def run(seed: int) -> Shown:
    """Simulate both tests of ten minutes with the printed lines, and fit them again.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    panels: list[Panel] = []
    models: list[TemperatureRecord] = []
    for sensor in UNITS:
        for test in (1, 2):
            temp, y = warmed(sensor, test, seed)
            model = temperature_model(sensor, temp, y)
            rows += line_rows(sensor, test, model, scatter(sensor, temp, seed))
            panels.append(_panel(sensor, test, temp, y))
            if sensor == "gyr":
                models.append(model)
    rows.append(
        info(
            "table 6.5, acc x, test 2", "as acc y, test 2", "both are simulated as printed", "",
            "probably copied by mistake: p1 and p2 of x and y agree in all digits",
        )
    )  # fmt: skip
    needed = any(slope_matters(model, AMBIENT_DEGC, REQUIRED_DPS * DPS) for model in models)
    largest = max(float(np.abs(model.slope).max()) for model in models) * AMBIENT_DEGC / DPS
    rows.append(
        worded(
            "6.6, is a compensation needed", "no", "yes" if needed else "no", same=not needed,
            from_simulation=True,
            tolerance=f"{REQUIRED_DPS:g} deg/s",
            remark=f"{AMBIENT_DEGC:g} degC of ambient change moves the worst axis, gyr y, by "
            f"{largest:.3g} deg/s; the requirement on the rate is {REQUIRED_DPS:g} deg/s",
        )
    )  # fmt: skip
    block = page.plot(
        grid_figure(panels, columns=2),
        "Figures 6.12 and 6.13: output over temperature at rest, less its mean.",
    )
    return Shown(rows=rows, blocks=(block,))


def warmed(sensor: str, test: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return temperature [degC] and output [SI] of one test: warmed up, then left to cool.

    Parameters
    ----------
    sensor : str
        ``"gyr"`` or ``"acc"``.
    test : int
        1 or 2.
    seed : int
        Of the noise.

    Returns
    -------
    temp_degc : ndarray, shape (n,)
    samples : ndarray, shape (n, 3)
        A sample per 10 ms averaged to one per second: the slope does not need more.
    """
    rng = np.random.default_rng([seed, len(sensor), ord(sensor[0]), test])
    n, every = round(TEST_S * RATE_HZ), round(RATE_HZ)
    t = np.arange(n) / RATE_HZ
    low, high = RANGE_DEGC
    up = np.clip(t / (0.4 * TEST_S), 0.0, 1.0)
    down = np.exp(-np.clip(t - 0.4 * TEST_S, 0.0, None) / (0.2 * TEST_S))
    temp = low + (high - low) * np.where(t < 0.4 * TEST_S, up, down)
    p1, p2 = (np.array(row) * UNITS[sensor][1] for row in TABLE_6_5[sensor][test - 1])
    triad: Triad = getattr(preset("mpu6050"), sensor)
    y = p1 * temp[:, np.newaxis] + p2 + triad.noise.sample(n, 1.0 / RATE_HZ, rng)
    y = triad.digital.apply(y)
    means = y.reshape(-1, every, 3).mean(axis=1)
    read = np.rint(temp.reshape(-1, every).mean(axis=1) / STEP_DEGC) * STEP_DEGC
    return read, means


def scatter(sensor: str, temp_degc: FloatArray, seed: int) -> FloatArray:
    """Return the standard deviations of slope and intercept that the sensor's noise makes.

    Flicker and random walk of the bias, which the residuals of one test hardly show, are in
    them.

    Parameters
    ----------
    sensor : str
        ``"gyr"`` or ``"acc"``.
    temp_degc : ndarray, shape (n,)
        Temperature, a sample per second.
    seed : int
        Of the noise.

    Returns
    -------
    ndarray, shape (2, 3)
        Of p1 per degC and of p2 [SI], x y z.
    """
    rng = np.random.default_rng([seed, 5])
    noise = getattr(preset("mpu6050"), sensor).noise
    design = np.column_stack((temp_degc, np.ones_like(temp_degc)))
    lines = [
        np.linalg.lstsq(design, noise.sample(len(temp_degc), 1.0, rng), rcond=None)[0]
        for _ in range(DRAWS)
    ]
    return np.asarray(np.std(lines, axis=0), dtype=np.float64)


def line_rows(sensor: str, test: int, model: TemperatureRecord, std: FloatArray) -> list[Row]:
    """Return slope and intercept of each axis beside the printed ones.

    Parameters
    ----------
    sensor : str
        ``"gyr"`` or ``"acc"``.
    test : int
        1 or 2.
    model : TemperatureRecord
        Fitted to simulated data.
    std : ndarray, shape (2, 3)
        See `scatter`.

    Returns
    -------
    list of Row
    """
    unit, size = UNITS[sensor]
    rows = []
    for k, axis in enumerate("xyz"):
        for which, name in enumerate(("p1", "p2")):
            thesis = TABLE_6_5[sensor][test - 1][which][k]
            unclear = "; printed 4.5986-3, read as 4.5986E-3" if thesis == 4.5986e-3 else ""
            rows.append(
                simulated(
                    f"table 6.5, {sensor} {axis}, test {test}, {name}",
                    thesis,
                    model[f"{name}_{axis}"].value / size,
                    f"{unit}/degC" if which == 0 else unit,
                    Tolerance(absolute=3.0 * float(std[which, k]) / size),
                    f"three standard deviations over {DRAWS} draws of the noise of chapter 5"
                    + unclear,
                )
            )
    return rows


def _panel(sensor: str, test: int, temp: FloatArray, y: FloatArray) -> Panel:
    unit, size = UNITS[sensor]
    centred = (y - y.mean(axis=0)) / size
    return Panel(
        x_label="temperature [degC]",
        y_label=f"{sensor}, test {test} [{unit}]",
        items=[
            Series(
                x=temp, y=centred[:, k], name=axis, color=AXIS_COLORS[k], kind="points", width=2.0
            )
            for k, axis in enumerate("xyz")
        ],
        height=220,
    )


PART = Part(
    name="temperature",
    title="Temperature: table 6.5, figures 6.12, 6.13",
    source="6.6, (6.24)",
    run=run,
)
