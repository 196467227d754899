"""Tables 3 to 5: the sensor lying still for 150 s, simulated and evaluated again."""

from typing import Final, NamedTuple

import numpy as np

from strapdown.constants import G0
from strapdown.noise import full_statistics, zero_g
from strapdown.noise.static import StaticStatistics
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import Panel, time_figure, xyz
from strapdown.sensors import Datasheet, datasheet
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.systems.kinematic import device
from strapdown.units import DEG, MILLIGAUSS, UT

SIGMAS: Final = 4.0  # one figure in 16,000 lies beyond by chance


class Table(NamedTuple):
    """A printed table: its number, the sensor, the unit it is read in, and that printed."""

    number: int
    sensor: str
    unit: str
    printed: str
    size: float  # of the unit, in SI
    mean: device.Triple
    variance: device.Triple
    digits: float  # half of the last printed digit of the coarsest mean


TABLES: Final = (
    Table(3, "gyro", "rad/s", "deg/sec", 1.0, device.GYR_MEAN, device.GYR_VARIANCE, 5e-5),
    Table(4, "acc", "g", "m/sec", G0, device.ACC_MEAN, device.ACC_VARIANCE, 5e-5),
    Table(5, "mag", "mG", "uG", MILLIGAUSS, device.MAG_MEAN, device.MAG_VARIANCE, 5e-5),
)
CHANNELS: Final = tuple(f"{table.sensor} {axis}" for table in TABLES for axis in "xyz")


def run(seed: int) -> Shown:
    """Simulate the recording and evaluate it.

    Parameters
    ----------
    seed : int
        Of the noise.

    Returns
    -------
    Shown
    """
    rec = device.record(device.still(), seed)
    found = full_statistics(rec)
    rows = [*_recording(rec), *_units()]
    for k, table in enumerate(TABLES):
        rows += _table(table, found, 3 * k)
    rows += [*_covariance(found), *_offsets(rec, found)]
    return Shown(rows=rows, blocks=(_raw(rec), _matrix(found)))


def _recording(rec: Recording) -> list[Row]:
    """Return the rows of how it was recorded."""
    imu, _ = device.streams(rec)
    sheet = datasheet("mpu9250")
    return [
        info("item 1, bus to the Raspberry Pi 3", "I2C, 400 kHz", None, "",
             "hardware: nothing is computed"),
        info("item 1, sampling rate", device.RATE, 1.0 / float(np.median(np.diff(imu.t))), "Hz",
             "taken over by the simulation"),
        compared(
            "item 1, converter, counts of the gyro's smallest range", 2.0**16,
            2.0 * 250.0 * DEG / sheet.value("gyr", "sensitivity", "250 dps"), "LSB",
            Tolerance(relative=1e-3),
            "500 deg/s at 131 LSB/(deg/s); the datasheet rounds the sensitivity to 3 digits",
        ),
        info("item 2, gyro ranges", "250, 500, 1000, 2000", _ranges(sheet, "gyr", DEG), "deg/s",
             "2^15 counts at each sensitivity; which one was used is not said, here the smallest"),
        info("item 2, accelerometer ranges", "2, 4, 8, 16", _ranges(sheet, "acc", G0), "g",
             "2^15 counts at each sensitivity; which one was used is not said, here the smallest"),
        info("item 2, magnetometer range", 4800.0, sheet.value("mag", "dynamic range") / UT, "uT",
             "preset mpu9250"),
        compared(
            "item 3, samples in 150 s", device.SAMPLES, float(len(imu)), "1", Tolerance(),
            "100 Hz for 150 s, exact",
        ),
    ]  # fmt: skip


def _ranges(sheet: Datasheet, sensor: str, unit: float) -> str:
    """Return the ranges to which the datasheet has a sensitivity."""
    return ", ".join(f"{2**15 * size / unit:.4g}" for size in sheet.values(sensor, "sensitivity"))


def _units() -> list[Row]:
    """Return the rows that show in which units the tables must be read."""
    y, z = device.GYR_MEAN[1], device.ACC_MEAN[2]
    field = float(np.linalg.norm(device.MAG_MEAN))
    return [
        info("table 3, unit: drift of y in 150 s as deg/s, as printed", 10.0,
             y * device.DURATION, "deg", "contradicts the 10 deg of figure 12: not deg/s"),
        compared(
            "table 3, unit: drift of y in 150 s as rad/s", 10.0, y / DEG * device.DURATION, "deg",
            Tolerance(absolute=0.5), "figure 12 prints 10 deg: half of its last digit",
        ),
        info("table 4, unit: mean of z", f"{z} m/sec", f"{z * G0:.3f} m/s^2", "",
             "read as g; a sensor at rest shows gravity"),
        info("table 5, unit: norm of the means", f"{field:.1f} uG", f"{field * 0.1:.1f} uT", "",
             "read as mG; the Earth's field has 25 to 65 uT"),
    ]  # fmt: skip


def _table(table: Table, found: StaticStatistics, first: int) -> list[Row]:
    rows = []
    for axis in range(3):
        here = found.mean[first + axis] / table.size
        sigma = (table.variance[axis] / found.n) ** 0.5
        rows.append(simulated(
            f"table {table.number}, {table.sensor} {'xyz'[axis]}, mean",
            table.mean[axis], here, table.unit, Tolerance(absolute=SIGMAS * sigma),
            f"printed as {table.printed}; 4 sigma of a mean of {found.n} samples",
        ))  # fmt: skip
    for axis in range(3):
        here = found.variance[first + axis] / table.size**2
        rows.append(simulated(
            f"table {table.number}, {table.sensor} {'xyz'[axis]}, variance",
            table.variance[axis], here, f"({table.unit})^2",
            Tolerance(relative=SIGMAS * (2.0 / (found.n - 1)) ** 0.5),
            f"printed as ({table.printed})^2; 4 sigma of a variance of {found.n} samples",
        ))  # fmt: skip
    return rows


def _covariance(found: StaticStatistics) -> list[Row]:
    """Return the rows of the 9x9 covariance that a Kalman filter's R may be made of."""
    size = np.sqrt(np.diag(found.covariance))
    correlation = np.abs(found.covariance / np.outer(size, size) - np.eye(9)).max()
    eigenvalues = np.linalg.eigvalsh(found.covariance / np.outer(size, size))
    return [
        not_given("item 5, 9x9 covariance, largest correlation", float(correlation), "1",
                  "simulated without any: 36 pairs of 15,000 samples stay below 0.035"),
        not_given("item 5, 9x9 covariance, least eigenvalue of the correlations",
                  float(eigenvalues[0]), "1", "positive: it can serve as R"),
    ]  # fmt: skip


def _offsets(rec: Recording, found: StaticStatistics) -> list[Row]:
    """Return the rows of calibration at rest."""
    imu, _ = device.streams(rec)
    half = len(imu) // 2
    left = (imu.gyr[half:] - imu.gyr[:half].mean(axis=0)).mean(axis=0)
    drift = np.abs(left).max() / DEG * device.DURATION
    raw = np.abs(found.mean[:3]).max() / DEG * device.DURATION
    norm = zero_g([imu.acc])[0]
    return [
        not_given("item 14, worst drift in 150 s, raw", float(raw), "deg"),
        not_given("item 14, worst drift in 150 s, bias of the first 75 s subtracted", float(drift),
                  "deg", "the thesis says that it removes the drift, and not for long periods"),
        not_given("item 15, offset of the accelerometer along gravity", 1e3 * norm.offset, "mg",
                  "the axis that lies along g; 1.0016 g less one and what noise adds"),
        info("item 16, calibration of the magnetometer", "none was made", None, "",
             "one pose does not show an offset; `strapdown calibrate mag` needs turns"),
    ]  # fmt: skip


def _raw(rec: Recording) -> page.Block:
    imu, mag = device.streams(rec)
    return page.plot(
        time_figure(
            [
                Panel(y_label="rate [deg/s]", items=xyz(imu.t, imu.gyr / DEG)),
                Panel(y_label="force [g]", items=xyz(imu.t, imu.acc / G0)),
                Panel(y_label="field [uT]", items=xyz(mag.t, mag.mag / UT)),
            ]
        ),
        "Figure 11: the sensor lying still, simulated from tables 3 to 5.",
    )


def _matrix(found: StaticStatistics) -> page.Block:
    size = np.repeat([table.size for table in TABLES], 3)
    scaled = found.covariance / np.outer(size, size)
    return page.table(
        ("", *CHANNELS),
        [(name, *map(float, row)) for name, row in zip(CHANNELS, scaled, strict=True)],
        caption="Covariance of the nine channels, in (rad/s, g, mG)^2",
        digits=3,
    )


PART: Final = Part(
    name="static",
    title="Sensor lying still: figure 11, tables 3 to 5, covariance",
    source="chapter 5; items 1 to 5, 14 to 16",
    run=run,
)
