"""Devices by name, made of their datasheets' figures.

Every number comes from the datasheet tables beside this file, which say where each was printed;
what no source gives is named in `Device.assumed`. A preset is the nominal part of its type:
`Device.individual` draws one with the type's spread of scale, misalignment and bias.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from strapdown._checks import one_of
from strapdown.constants import G0
from strapdown.sensors.datasheet import Datasheet, datasheet
from strapdown.sensors.device import Device
from strapdown.sensors.digital import Digital
from strapdown.sensors.fixes import GnssFix, StarTracker
from strapdown.sensors.linear import Linear, Matrix
from strapdown.sensors.noise import Noise
from strapdown.sensors.sampling import Sampling
from strapdown.sensors.scalars import AxisEncoder, Barometer, Pitot, Thermometer
from strapdown.sensors.triads import Accelerometer, Gyro, Magnetometer, Spread, Triple
from strapdown.units import DPS

ADIS_RATE = 200.0  # "about 200 Hz", thesis E2, 6.3.1
ALLAN_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)  # of a bias instability of one


def preset(name: str) -> Device:
    """Return the device of this name.

    Parameters
    ----------
    name : str
        One of `preset_names`.

    Returns
    -------
    Device

    Raises
    ------
    ValueError
        If there is none; the nearest name is offered.

    Examples
    --------
    >>> chip = preset("mpu6050")
    >>> chip.gyr.digital.counts([[0.0, 0.0, 1.0]])
    array([[   0,    0, 7506]])
    """
    return _PRESETS[one_of("name", name, _PRESETS)](datasheet(name))


def preset_names() -> tuple[str, ...]:
    """Return the names of all presets."""
    return tuple(_PRESETS)


def _mpu6050(sheet: Datasheet) -> Device:
    rate = sheet.value("device", "rate in use")
    gyr_per_degc, acc_per_degc = (
        _triple(sheet.values(sensor, "bias slope", "test 1")) for sensor in ("gyr", "acc")
    )
    return Device(
        name=sheet.name,
        gyr=Gyro(
            noise=Noise(
                white=sheet.values("gyr", "white noise N"),
                flicker=sheet.values("gyr", "bias instability B"),
                random_walk=sheet.values("gyr", "rate random walk K"),
            ),
            sampling=Sampling(rate=rate, delay=sheet.value("gyr", "delay", "DLPF_CFG=1")),
            digital=_digital(sheet, "gyr", "FS_SEL=0"),
            temp_bias=gyr_per_degc,
            temp_reference=23.0,
            spread=Spread(scale=sheet.value("gyr", "scale tolerance")),
        ),
        acc=Accelerometer(
            noise=Noise(
                white=sheet.values("acc", "white noise N"),
                flicker=(0.0, 0.0, sheet.value("acc", "bias instability B")),
            ),
            sampling=Sampling(rate=rate),
            digital=_digital(sheet, "acc", "AFS_SEL=0"),
            temp_bias=acc_per_degc,
            temp_reference=23.0,
            spread=Spread(scale=sheet.value("acc", "scale tolerance")),
        ),
        temperature=Thermometer(sampling=Sampling(rate=1.0), digital=Digital(lsb=0.001)),
        datasheet=sheet,
        assumed=(
            "low-pass left out: the noise was measured behind it, and the delay is kept",
            "slopes with temperature are those of test 1, reference 23 degC",
            "thermometer: 1 Hz, 0.001 degC as the order of its resolution",
        ),
    )


def _hmc5883l(sheet: Datasheet) -> Device:
    slope = sheet.value("mag", "thermal sensitivity")
    return Device(
        name=sheet.name,
        mag=Magnetometer(
            noise=Noise(
                white=sheet.values("mag", "white noise N"),
                flicker=sheet.values("mag", "bias instability B"),
                random_walk=sheet.values("mag", "rate random walk K"),
            ),
            sampling=Sampling(rate=sheet.value("device", "output rate")),
            digital=_digital(sheet, "mag", "in use", bits=12),
            temp_scale=(slope, slope, slope),
            spread=Spread(scale=sheet.value("mag", "scale tolerance")),
        ),
        datasheet=sheet,
    )


def _mpu9250(sheet: Datasheet) -> Device:
    rate = sheet.value("device", "rate in use")
    resolution = sheet.value("mag", "resolution", "16 bit")
    variance = sheet.values("mag", "measured variance")
    return Device(
        name=sheet.name,
        gyr=Gyro(
            noise=Noise(white=sheet.value("gyr", "rate noise density")),
            sampling=Sampling(rate=rate),
            digital=Digital(
                lsb=sheet.value("gyr", "sensitivity", "250 dps"), full_scale=250.0 * DPS
            ),
            spread=Spread(
                scale=sheet.value("gyr", "scale tolerance"),
                misalignment=sheet.value("gyr", "cross-axis"),
                bias=sheet.value("gyr", "zero-rate offset") / 3.0,
                nonlinearity=sheet.value("gyr", "non-linearity"),
            ),
        ),
        acc=Accelerometer(
            noise=Noise(white=sheet.value("acc", "noise density")),
            sampling=Sampling(rate=rate),
            digital=Digital(lsb=sheet.value("acc", "sensitivity", "2 g"), full_scale=2.0 * G0),
            spread=Spread(
                misalignment=sheet.value("acc", "cross-axis"),
                bias=sheet.value("acc", "zero-g tolerance", "x, y") / 3.0,
                nonlinearity=sheet.value("acc", "non-linearity"),
            ),
        ),
        mag=Magnetometer(
            noise=Noise(white=tuple((v / rate) ** 0.5 for v in variance)),
            sampling=Sampling(rate=rate),
            digital=Digital(lsb=resolution, full_scale=sheet.value("mag", "dynamic range")),
        ),
        datasheet=sheet,
        assumed=(
            "smallest ranges, 250 dps and 2 g: the thesis does not say which it used",
            "a tolerance of the offset is three standard deviations",
            "noise of the magnetometer: the variance that the thesis measured, taken as white",
        ),
    )


def _lsm9ds1(sheet: Datasheet) -> Device:
    rate = sheet.value("device", "output rate")
    variance = sheet.values("gyr", "measured variance")
    return Device(
        name=sheet.name,
        gyr=Gyro(
            linear=Linear(bias=_triple(sheet.values("gyr", "zero-rate offset"))),
            noise=Noise(white=tuple((v / rate) ** 0.5 for v in variance)),
            sampling=Sampling(rate=rate),
            digital=_digital(sheet, "gyr"),
        ),
        acc=Accelerometer(
            sampling=Sampling(rate=rate), digital=_digital(sheet, "acc", "9DOF", "8 g")
        ),
        mag=Magnetometer(
            sampling=Sampling(rate=sheet.value("device", "output rate", "magnetometer")),
            digital=_digital(sheet, "mag"),
        ),
        datasheet=sheet,
        assumed=(
            "gyroscope: the measured variance is white noise at 119 Hz",
            "accelerometer and magnetometer without noise but rounding: no source gives any",
            "sensitivities are the type's common ones",
        ),
    )


def _adis16350(sheet: Datasheet) -> Device:
    triangle = Linear.from_triangular  # the parameters that the thesis found, table 6.1 and 6.2
    gyr, acc = _adis_inertial(sheet, "ADIS16350")
    return Device(
        name=sheet.name,
        gyr=replace(
            gyr,
            linear=triangle(
                (0.004818, 0.004042, 0.009385),
                theta_yz=-0.00126,
                theta_zx=-0.00296,
                theta_zy=-0.00171,
                bias=(0.3766 * DPS, 0.1963 * DPS, 0.6270 * DPS),
            ),
            digital=Digital(
                lsb=sheet.value("gyr", "sensitivity", "300 dps"), full_scale=300.0 * DPS, bits=14
            ),
        ),
        acc=replace(
            acc,
            linear=triangle(
                (0.00775, 0.008838, 0.008041),
                theta_yz=-0.00086,
                theta_zx=0.01142,
                theta_zy=-0.00049,
                bias=(0.012133 * G0, 0.023295 * G0, -0.03593 * G0),
            ),
            spread=replace(acc.spread, bias=sheet.value("acc", "zero-g offset")),
        ),
        temperature=Thermometer(
            sampling=Sampling(rate=1.0),
            digital=Digital(lsb=sheet.value("temperature", "scale factor"), zero=25.0),
        ),
        datasheet=sheet,
        assumed=(
            *_ADIS_ASSUMED,
            "constant errors are those that the thesis found (tables 6.1 and 6.2)",
            "random walk of the accelerometer: its noise density",
        ),
    )


def _adis16405(sheet: Datasheet) -> Device:
    gyr, acc = _adis_inertial(sheet, "ADIS16405")
    slope = sheet.value("mag", "bias temperature coefficient")
    scale = sheet.value("mag", "sensitivity temperature coefficient")
    return Device(
        name=sheet.name,
        gyr=replace(
            gyr, spread=replace(gyr.spread, bias=sheet.value("gyr", "initial bias error"))
        ),
        acc=replace(
            acc,
            noise=Noise(
                white=sheet.value("acc", "velocity random walk"),
                flicker=sheet.value("acc", "in-run bias stability") / ALLAN_FLOOR,
            ),
            spread=replace(acc.spread, bias=sheet.value("acc", "initial bias error")),
        ),
        mag=Magnetometer(
            noise=Noise(white=sheet.value("mag", "noise density")),
            sampling=Sampling(rate=ADIS_RATE),
            digital=_digital(sheet, "mag", bits=14),
            temp_bias=(slope, slope, slope),
            temp_scale=(scale, scale, scale),
            spread=Spread(
                scale=_tolerance(sheet, "mag"),
                misalignment=sheet.value("mag", "misalignment"),
                non_orthogonality=_between_axes(sheet, "mag"),
                bias=sheet.value("mag", "initial bias error"),
                nonlinearity=sheet.value("mag", "non-linearity"),
            ),
        ),
        temperature=Thermometer(
            sampling=Sampling(rate=1.0),
            digital=Digital(lsb=sheet.value("temperature", "scale factor"), zero=25.0),
        ),
        datasheet=sheet,
        assumed=_ADIS_ASSUMED,
    )


_ADIS_ASSUMED = (
    "200 Hz: what the thesis read out (6.3.1); the sensor can do 819.2 Hz",
    "bias stability is taken as the floor of the Allan deviation",
    "low-pass left out: its 330 or 350 Hz lie above half the rate",
    "converter of 14 bits; supply of 5.0 V: the effect of the voltage is left out",
    "g-sensitivity: 1 sigma on each axis from the force along it",
)


def _adis_inertial(sheet: Datasheet, part: str) -> tuple[Gyro, Accelerometer]:
    """Return what both types have in common."""

    def slopes(sensor: str, quantity: str) -> Triple:
        slope = sheet.value(sensor, quantity, part)
        return slope, slope, slope

    g = sheet.value("gyr", "linear acceleration effect")
    g_sensitivity: Matrix = ((g, 0.0, 0.0), (0.0, g, 0.0), (0.0, 0.0, g))
    sampling = Sampling(rate=ADIS_RATE)
    return Gyro(
        noise=Noise(
            white=sheet.value("gyr", "angular random walk"),
            flicker=sheet.value("gyr", "in-run bias stability") / ALLAN_FLOOR,
        ),
        sampling=sampling,
        digital=Digital(
            lsb=sheet.value("gyr", "sensitivity", "300"), full_scale=300.0 * DPS, bits=14
        ),
        temp_bias=slopes("gyr", "bias temperature coefficient"),
        temp_scale=slopes("gyr", "sensitivity temperature coefficient"),
        g_sensitivity=g_sensitivity,
        spread=Spread(
            scale=_tolerance(sheet, "gyr"),
            misalignment=sheet.values("gyr", "misalignment")[-1],
            non_orthogonality=_between_axes(sheet, "gyr"),
            nonlinearity=sheet.value("gyr", "non-linearity"),
        ),
    ), Accelerometer(
        noise=Noise(white=sheet.value("acc", "noise density")),
        sampling=sampling,
        digital=_digital(sheet, "acc", bits=14),
        temp_bias=slopes("acc", "bias temperature coefficient"),
        temp_scale=slopes("acc", "sensitivity temperature coefficient"),
        spread=Spread(
            scale=_tolerance(sheet, "acc"),
            misalignment=sheet.values("acc", "misalignment")[-1],
            non_orthogonality=_between_axes(sheet, "acc"),
            nonlinearity=sheet.value("acc", "non-linearity"),
        ),
    )


def _mnav100ca(sheet: Datasheet) -> Device:
    rate = sheet.value("device", "rate in use")
    inertial = Sampling(rate=rate)
    return Device(
        name=sheet.name,
        gyr=Gyro(
            linear=Linear(bias=_triple(sheet.values("gyr", "bias"))),
            noise=Noise(
                white=sheet.value("gyr", "noise that the filter assumes") / math.sqrt(rate)
            ),
            sampling=inertial,
            digital=Digital(full_scale=sheet.value("gyr", "dynamic range")),
        ),
        acc=Accelerometer(
            noise=Noise(white=0.05 / math.sqrt(rate)),
            sampling=inertial,
            digital=Digital(full_scale=2.0 * 9.80),  # 1 g = 9.80 m/s^2 there
        ),
        mag=Magnetometer(
            noise=Noise(
                white=math.sqrt(sheet.value("mag", "variance that the filter assumes") / rate)
            ),
            sampling=inertial,
        ),
        gnss=GnssFix(sampling=Sampling(rate=4.0)),
        baro=Barometer(noise=Noise(white=2.0), sampling=Sampling(rate=25.0)),
        airspeed=Pitot(noise=Noise(white=0.05), sampling=Sampling(rate=25.0)),
        temperature=Thermometer(sampling=Sampling(rate=1.0)),
        datasheet=sheet,
        assumed=(
            "noise of gyroscope and magnetometer is what the filters assume",
            "accelerometer 0.05 m/s^2 a sample: the filter's 1.4 m/s^2 stands for manoeuvres",
            "GPS at 4 Hz, 1.5 m and 3 m, 0.05 m/s and 0.1 m/s",
            "barometer 2 Pa/sqrt(Hz), Pitot tube 0.05 m/s/sqrt(Hz), both at 25 Hz",
        ),
    )


def _hedm5500(sheet: Datasheet) -> Device:
    return Device(
        name=sheet.name,
        encoder=AxisEncoder(
            sampling=Sampling(rate=sheet.value("device", "rate in use")),
            digital=Digital(lsb=sheet.value("encoder", "resolution"), bits=32),
        ),
        datasheet=sheet,
        assumed=("resolution of 0.09 deg as printed, not the 0.18 deg of 500 cycles",),
    )


def _star_tracker(sheet: Datasheet) -> Device:
    std = sheet.value("star", "standard deviation")
    return Device(
        name=sheet.name,
        star=StarTracker(sampling=Sampling(rate=sheet.value("star", "rate")), std=(std, std, std)),
        datasheet=sheet,
    )


def _fastrax_up500(sheet: Datasheet) -> Device:
    return Device(
        name=sheet.name,
        gnss=GnssFix(sampling=Sampling(rate=sheet.value("gnss", "rate in use"))),
        datasheet=sheet,
        assumed=("1.5 m and 3 m, 0.05 m/s and 0.1 m/s: a single-frequency receiver in the open",),
    )


_PRESETS: dict[str, Callable[[Datasheet], Device]] = {
    "mpu6050": _mpu6050,
    "hmc5883l": _hmc5883l,
    "mpu9250": _mpu9250,
    "lsm9ds1": _lsm9ds1,
    "adis16350": _adis16350,
    "adis16405": _adis16405,
    "mnav100ca": _mnav100ca,
    "hedm5500": _hedm5500,
    "star_tracker": _star_tracker,
    "fastrax_up500": _fastrax_up500,
}


def _digital(
    sheet: Datasheet, sensor: str, range_word: str = "", lsb_word: str = "", *, bits: int = 16
) -> Digital:
    """Return range and counts as the sheet gives them."""
    return Digital(
        lsb=sheet.value(sensor, "sensitivity", lsb_word),
        full_scale=sheet.value(sensor, "dynamic range", range_word),
        bits=bits,
    )


def _tolerance(sheet: Datasheet, sensor: str) -> float:
    """Return how far the sensitivity may lie from the typical one, relative."""
    figure = sheet.find(sensor, "sensitivity")[0]
    if figure.least is None or figure.most is None or figure.typical is None:
        raise ValueError(f"the sensitivity of {sensor} of {sheet.name} must have its limits.")
    return max(figure.most - figure.typical, figure.typical - figure.least) / figure.typical


def _between_axes(sheet: Datasheet, sensor: str) -> float:
    """Return how far the axes are from orthogonal; one sheet calls it a misalignment."""
    quantities = {figure.quantity for figure in sheet.figures if figure.sensor == sensor}
    if "axis non-orthogonality" in quantities:
        return sheet.value(sensor, "axis non-orthogonality")
    return sheet.value(sensor, "misalignment", "axis to axis")


def _triple(values: tuple[float, ...]) -> Triple:
    x, y, z = values
    return x, y, z
