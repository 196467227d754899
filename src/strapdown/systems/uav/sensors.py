"""Appendix B: sensor models of the MNAV100CA, recovered from what the preset simulates.

The thesis prints ranges, biases and the variances that its filters assume; the levels of its
simulated noise are not given. The preset `mnav100ca` takes what the filters assume.
"""

import math
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.report import page
from strapdown.report.figures import REFERENCE, Panel, Series, time_figure, xyz
from strapdown.sensors import Sampling, preset
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.truth import Truth
from strapdown.units import DEG, DPS, GAUSS

RATE: Final = 50.0  # [Hz]
DURATION: Final = 300.0  # two periods of the slow biases [s]
BIAS: Final = (0.1, 0.25, 0.5)  # [rad/s]
SWING: Final = (0.05, 0.05, 0.0)  # (4.1) [rad/s]
PERIOD: Final = 150.0  # [s]
SIGMA_GYR: Final = 0.01  # [rad/s]
VARIANCE_MAG: Final = 7e-5  # [G^2]
VARIANCE_ACC: Final = 1.962361  # [(m/s^2)^2]
VARIANCE_COURSE: Final = 0.001  # [rad^2]
SPEED: Final = 9.0  # [m/s]
SIGMAS: Final = 4.0  # one figure in 16,000 lies beyond by chance


def run(seed: int) -> Shown:
    """Simulate the sensors and evaluate them.

    Parameters
    ----------
    seed : int
        Of the noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    box: Any = preset("mnav100ca")
    still = _truth(np.zeros((_samples(), 3)))
    gyr = box.gyr.apply(still, rng).value
    slow = gyr - np.array(BIAS) + slow_bias(still.t)
    rows = [
        *_scale(box, rng), *_ranges(box, rng), *_biases(gyr, slow, still.t),
        *_noise(gyr, box.mag.apply(still, rng).mag, box.acc.apply(still, rng).value),
        *_course(box, rng), *_low_pass(), *_others(),
    ]  # fmt: skip
    return Shown(rows=rows, blocks=(_figure(still.t, slow),))


def _samples() -> int:
    return round(DURATION * RATE)


def _truth(omega: FloatArray, f_b: FloatArray | None = None) -> Truth:
    """Return a box with these rates and forces at 50 Hz, its field that of the thesis's size."""
    n = len(omega)
    zero = np.zeros((n, 3))
    return Truth(
        t=np.arange(n) / RATE, q_nb=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), omega_ib_b=omega,
        f_b=np.tile([0.0, 0.0, -G0], (n, 1)) if f_b is None else f_b, lla=zero,
        v_n=zero + [SPEED, 0.0, 0.0], m_n=np.tile([2.4e-5, 0.0, 3.9e-5], (n, 1)),
    )  # fmt: skip


def slow_bias(t: FloatArray) -> FloatArray:
    """Return (4.1), shape (n, 3) [rad/s]."""
    wave = np.sin(2.0 * np.pi * t / PERIOD)
    return np.asarray(np.array(BIAS) + np.outer(wave, SWING))


def _scale(box: Any, rng: np.random.Generator) -> list[Row]:
    """Return the rows of the scale factors, the identity in the thesis, fitted to outputs."""
    x = rng.uniform(-2.0, 2.0, (_samples(), 3))
    rows = []
    for name, sensor, truth, sigma in (
        ("omega_SF", box.gyr, _truth(x), SIGMA_GYR),
        ("A_SF", box.acc, _truth(np.zeros_like(x), x), 0.05),
    ):
        y = sensor.apply(truth, rng).value
        design = np.hstack((x, np.ones((len(x), 1))))
        matrix = np.linalg.lstsq(design, y, rcond=None)[0][:3].T
        # inputs are spread evenly over +-2, a variance of 4/3
        limit = SIGMAS * sigma / math.sqrt(len(x) * 4.0 / 3.0)
        rows.append(simulated(
            f"appendix B, {name}, largest departure from the identity", 0.0,
            float(np.abs(matrix - np.eye(3)).max()), "1", Tolerance(absolute=limit),
            f"fitted to {len(x)} random inputs; 4 sigma",
        ))  # fmt: skip
    return rows


def _ranges(box: Any, rng: np.random.Generator) -> list[Row]:
    """Return the rows of the saturations."""
    far = np.tile([[1.0, -1.0, 1.0]], (200, 1))
    gyr = np.abs(box.gyr.apply(_truth(10.0 * far), rng).value).max(axis=0)
    acc = np.abs(box.acc.apply(_truth(np.zeros_like(far), 100.0 * far), rng).value).max(axis=0)
    return [
        simulated("appendix B, saturation of the gyroscopes", 150.0, float(gyr.max()) / DPS,
                  "deg/s", Tolerance(absolute=1e-9), "driven to 573 deg/s; rounding"),
        simulated("appendix B, saturation of the accelerometers", 2.0 * 9.80, float(acc.max()),
                  "m/s^2", Tolerance(absolute=1e-9),
                  "printed as 2 g, 1 g = 9.80 m/s^2; driven to 100 m/s^2; rounding"),
        info("appendix B, gravity: text and program", 9.80, 9.81, "m/s^2",
             "the program counts with 9.81"),
    ]  # fmt: skip


def _biases(gyr: FloatArray, slow: FloatArray, t: FloatArray) -> list[Row]:
    """Return the rows of the constant and of the slowly varying biases, (4.1)."""
    limit = Tolerance(absolute=SIGMAS * SIGMA_GYR / math.sqrt(len(t)))
    remark = f"mean of {len(t)} samples at rest; 4 sigma"
    rows = [
        simulated(f"4.2, constant bias b_{name}", bias, float(gyr[:, k].mean()), "rad/s", limit,
                  remark)
        for k, (name, bias) in enumerate(zip("PQR", BIAS, strict=True))
    ]  # fmt: skip
    wave = 2.0 * np.pi * t / PERIOD
    design = np.column_stack((np.ones_like(t), np.sin(wave), np.cos(wave)))
    found = np.linalg.lstsq(design, slow, rcond=None)[0]
    swing = Tolerance(absolute=limit.absolute * math.sqrt(2.0))
    remark = f"fit of a sine to {len(t)} samples at rest; 4 sigma"
    for k, (name, bias) in enumerate(zip("PQR", BIAS, strict=True)):
        rows.append(simulated(f"(4.1), mean of b_{name}", bias, float(found[0, k]), "rad/s", limit,
                              remark))  # fmt: skip
        rows.append(simulated(f"(4.1), swing of b_{name}", SWING[k], float(found[1, k]), "rad/s",
                              swing, remark))  # fmt: skip
    rows.append(simulated(
        "(4.1), period of b_P", PERIOD, _period(t, slow[:, 0]), "s",
        Tolerance(absolute=SIGMAS * _period_sigma(len(t))), "best period; 4 sigma",
    ))  # fmt: skip
    return rows


def _period(t: FloatArray, y: FloatArray) -> float:
    """Return the period whose sine fits best [s]."""
    from scipy.optimize import curve_fit

    def wave(time: FloatArray, mean: float, swing: float, phase: float, period: float) -> Any:
        return mean + swing * np.sin(2.0 * np.pi * time / period + phase)

    found, _ = curve_fit(wave, t, y, p0=(0.1, 0.05, 0.0, 140.0))
    return float(found[3])


def _period_sigma(n: int) -> float:
    """Return the standard deviation of a fitted period [s], phase and mean fitted too.

    That of a frequency is ``sqrt(24 / n) sigma / (2 pi A T)`` over a time T.
    """
    frequency = math.sqrt(24.0 / n) * SIGMA_GYR / (2.0 * math.pi * SWING[0] * DURATION)
    return frequency * PERIOD**2


def _noise(gyr: FloatArray, mag: FloatArray, acc: FloatArray) -> list[Row]:
    """Return the rows of the noise that the filters assume."""
    n = len(gyr)
    share = SIGMAS * math.sqrt(2.0 / (3 * n))
    remark = f"preset at rest, {3 * n} values of three axes; 4 sigma"
    sigma = float(np.sqrt(gyr.var(axis=0, ddof=1).mean()))
    return [
        simulated("appendix A.2, noise of the gyroscopes", SIGMA_GYR, sigma, "rad/s",
                  Tolerance(relative=0.5 * share), remark),
        simulated("appendix A.2, variance of the magnetometers", VARIANCE_MAG,
                  float(mag.var(axis=0, ddof=1).mean()) / GAUSS**2, "G^2",
                  Tolerance(relative=share), remark),
        compared("appendix A.1, variance of the accelerometers, commented as (0.1 g)^2",
                 VARIANCE_ACC, (0.1 * 9.81) ** 2, "(m/s^2)^2", Tolerance(absolute=5e-7),
                 "last printed digit; printed with a 1 in place of the 0: kept for replication"),
        info("appendix A.1, variance of the accelerometers", VARIANCE_ACC,
             float(acc.var(axis=0, ddof=1).mean()), "(m/s^2)^2",
             "preset: 0.05 m/s^2 a sample; the filter's stands for manoeuvres too"),
        not_given("4.2, level of the simulated noise on all sensors", None, "",
                  "named, not printed"),
    ]  # fmt: skip


def _course(box: Any, rng: np.random.Generator) -> list[Row]:
    """Return the rows of the course from GPS velocities."""
    fixes = box.gnss.apply(_truth(np.zeros((_samples(), 3))), rng)
    course = np.arctan2(fixes.v_n[:, 1], fixes.v_n[:, 0])
    variance = float(course.var(ddof=1))
    return [
        info("appendix A.2, variance of the course from GPS", VARIANCE_COURSE, variance, "rad^2",
             "preset: 0.05 m/s of noise on velocities at 9 m/s; the filter allows for more"),
        not_given("appendix A.2, velocity noise that this variance stands for at 9 m/s",
                  SPEED * math.sqrt(VARIANCE_COURSE), "m/s",
                  f"{math.sqrt(VARIANCE_COURSE) / DEG:.1f} deg of course"),
    ]  # fmt: skip


def _low_pass() -> list[Row]:
    """Return the rows of H_gyro, whose printed form has no gain of one."""
    cutoff, rate = 5.0, 400.0
    sampling = Sampling(rate=rate, bandwidth=cutoff, order=1)
    t = np.arange(round(20.0 * rate)) / rate
    rng = np.random.default_rng(0)

    def gain(frequency: float) -> float:
        x = np.cos(2.0 * np.pi * frequency * t)[:, np.newaxis]
        y = sampling.sample(t, x, sampling.ticks(t, rng))[:, 0]
        late = t >= 10.0  # whole periods, long after the start
        carrier = np.exp(-2j * np.pi * frequency * t[late])
        return float(2.0 * np.abs(np.mean(y[late] * carrier)))

    return [
        not_given("appendix B, H_gyro = omega_br / (s + omega_br), gain at omega_br / 10",
                  gain(0.1 * cutoff), "1",
                  "printed as 1 / (s + omega_br), whose gain at rest is 1 / omega_br"),
        not_given("appendix B, the same, gain at omega_br", gain(cutoff), "1",
                  "1/sqrt(2) by the formula; omega_br is not printed, 5 Hz here"),
        info("appendix B, H of gyroscopes and accelerometers in the simulations", "1", "1", "",
             "preset without low-pass, as the thesis allows"),
    ]  # fmt: skip


def _others() -> list[Row]:
    """Return the rows of what has a model without figures."""
    return [
        info("appendix A.1, magnetometer calibration H' = sf H - bias", "identity", "identity", "",
             "x and y only; the preset has neither hard nor soft iron"),
        info("2.1, barometer, Pitot tube, thermometers", "no figures", None, "",
             "the preset's are named as assumed"),
        info("appendix B, misalignment, cross-axis, temperature, g-sensitivity", "no model", None,
             "", "left out of the preset"),
    ]  # fmt: skip


def _figure(t: FloatArray, slow: FloatArray) -> page.Block:
    true = slow_bias(t)
    items = [
        *xyz(t, slow, names=("P", "Q", "R"), width=0.6),
        *(Series(x=t, y=true[:, k], name="(4.1)", color=REFERENCE, width=1.6) for k in range(3)),
    ]
    return page.plot(
        time_figure([Panel(y_label="rate [rad/s]", items=items, height=220)]),
        "Gyroscopes at rest with the slowly varying biases (4.1).",
    )


PART: Final = Part(
    name="sensors",
    title="Sensor models: appendix B, biases of 4.2",
    source="appendices A and B, 4.2",
    run=run,
)
