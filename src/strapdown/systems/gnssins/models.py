"""Error models of chapters 1 and 6: forward and back, and the calibrations of 6.2.1.

Random matrices stand for misalignments and scale deviations, of the size of 1e-3 for which the
thesis says that its first-order inverse holds.
"""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.calibration import (
    distortion_matrix,
    eighteen_position,
    six_position,
    temperature_model,
)
from strapdown.calibration.positions import eighteen_positions, six_positions, up_down
from strapdown.constants import G0
from strapdown.navigation.grades import NMI_PER_HR, cep_rate, ins_grade
from strapdown.sensors import Digital, Linear, Noise, preset
from strapdown.systems._growth import slope
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
from strapdown.systems.gnssins.calibrations import TABLE_6_1
from strapdown.truth import Truth
from strapdown.units import DPS, HOUR, MG

CASES: Final = 1000
ROUNDING: Final = Tolerance(absolute=1e-13)
ROUNDING_REMARK: Final = "largest difference over 1000 random cases; rounding"


def run(seed: int) -> Shown:
    """Go through the models.

    Parameters
    ----------
    seed : int
        Of matrices, inputs and noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    rows = [*_cluster(rng), *_quantised(rng), *_gyro_bias(rng), *_curved(rng), *_cep(rng)]
    return Shown(rows=[*rows, *_positions(rng), *_printed(rng), *_warmth(rng)])


def _deviations(rng: np.random.Generator) -> FloatArray:
    return rng.uniform(-1e-3, 1e-3, (CASES, 3, 3))


def _cluster(rng: np.random.Generator) -> list[Row]:
    """Return the rows of (1.5.1) to (1.5.3), and of misalignments as small angles."""
    M, x, b = (
        _deviations(rng),
        rng.uniform(-10.0, 10.0, (CASES, 3)),
        rng.uniform(-1.0, 1.0, (CASES, 3)),
    )
    back = first = angles = 0.0
    for k in range(CASES):
        model = Linear.from_scale_and_misalignment(M[k], b[k], nominal=1.7)
        y = model.apply(x[k])
        back = max(back, float(np.abs(model.invert(y) - x[k]).max()))
        short = np.abs(np.linalg.inv(np.eye(3) + M[k]) - (np.eye(3) - M[k])).max()
        first = max(first, float(short))
        # the misalignment of an axis: what it sees of the two others
        seen = model.apply(np.eye(3)) - model.apply(np.zeros(3))
        off = seen.T / 1.7 - np.eye(3) - M[k]
        angles = max(angles, float(np.abs(off).max()))
    return [
        compared("(1.5.2), exact inverse of (1.5.1)", 0.0, back, "1", ROUNDING, ROUNDING_REMARK),
        worded("(1.5.2), first-order inverse I - M", "valid for small errors, 1e-3",
               f"{first:.1e} off", same=first < 1e-5, tolerance="under 1e-5",
               remark="largest over 1000 matrices of up to 1e-3: the square of M, 3e-6"),
        compared("1.5.6, misalignment w_j alpha_ij + w_k alpha_ik", 0.0, angles, "1", ROUNDING,
                 "the elements of M off its diagonal; " + ROUNDING_REMARK),
    ]  # fmt: skip


def _quantised(rng: np.random.Generator) -> list[Row]:
    """Return the rows of rounding, which has no inverse."""
    converter = Digital(lsb=0.05 * DPS, full_scale=300.0 * DPS, bits=14)
    x = rng.uniform(-290.0, 290.0, 100_000) * DPS
    off = (converter.apply(x) - x) / converter.lsb
    return [
        compared("1.5.2, quantisation, largest error", 0.5, float(np.abs(off).max()), "LSB",
                 Tolerance(absolute=1e-3), "100,000 inputs of 0.05 deg/s a count"),
        not_given("1.5.2, quantisation, variance over 1/12 LSB^2", float(off.var() * 12.0), "1",
                  "the thesis says that it may grow with time: of the sum of the samples"),
        info("1.5.2, dead zone", "not invertible", None, "", "no sensor of the thesis has one"),
    ]  # fmt: skip


def _gyro_bias(rng: np.random.Generator) -> list[Row]:
    """Return the rows of the three parts of a bias and of a scale factor, 1.5.6."""
    starts = np.array([Noise(turn_on=3.0 * DPS).sample(1, 0.01, rng)[0] for _ in range(2000)])
    walk = Noise(random_walk=1e-3).sample(2000, 0.1, rng, width=2000)
    t = np.arange(1, 2001) / 10.0
    gyr: Any = preset("adis16405").gyr
    scales = [np.diag(gyr.individual(rng).linear.matrix) for _ in range(300)]
    return [
        simulated("1.5.6, turn-on bias, std over 2000 starts", 3.0, float(starts.std()) / DPS,
                  "deg/s", Tolerance(relative=4.0 / math.sqrt(2.0 * starts.size)),
                  "initial bias error of table 1; 4 sigma"),
        simulated("1.5.6, bias random walk, power of time of its variance", 1.0,
                  slope(t, walk.var(axis=1), 10.0, 200.0), "1", Tolerance(absolute=0.06),
                  "printed as dw/dt of white noise; 2000 walks from 10 s to 200 s, 4 sigma"),
        not_given("1.5.6, scale factor, spread over 300 parts", 100.0 * float(np.std(scales)),
                  "%", "ADIS16405; its drift after turn-on has no figure"),
    ]  # fmt: skip


def _curved(rng: np.random.Generator) -> list[Row]:
    """Return the row of the two polynomial forms of a non-linearity."""
    model = Linear(bias=(0.01, 0.0, 0.0), quadratic=((2e-3, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3))
    x = rng.uniform(-1.0, 1.0, (2000, 3))
    y = model.apply(x)
    fit = np.polynomial.Polynomial.fit(y[:, 0], x[:, 0], 4)
    residual = float(np.abs(fit(y[:, 0]) - x[:, 0]).max())
    exact = float(np.abs(model.invert(y) - x).max())
    return [
        compared("1.5.6, non-linearity undone exactly", 0.0, exact, "1", ROUNDING,
                 "C0 + C1 w + C2 w^2 with C2 of 2e-3; rounding"),
        not_given("1.5.6, the same by a polynomial of the output, order 4", residual, "1",
                  "the form that is said to be used most in practice"),
    ]  # fmt: skip


def _cep(rng: np.random.Generator) -> list[Row]:
    """Return the row of the CEP rate, whose growth is linear by 1.3.1."""
    t = np.linspace(0.0, HOUR, 61)
    speeds = 0.8 * NMI_PER_HR * rng.standard_normal((4000, 1, 2))
    rate = cep_rate(t, speeds * t[:, np.newaxis])
    # the median radius of a round Gaussian, sigma sqrt(2 ln 2); its sigma is 0.74 / sqrt(4000)
    want = 0.8 * math.sqrt(2.0 * math.log(2.0))
    return [
        not_given("1.3.2, CEP rate of drifts of 0.8 nmi/h (1 sigma), 4000 runs",
                  rate / NMI_PER_HR, "nmi/h",
                  f"{want:.3f} by the law of Rayleigh; grade: {ins_grade(rate)}"),
    ]  # fmt: skip


# --- 6.2.1 ------------------------------------------------------------------------------


def _positions(rng: np.random.Generator) -> list[Row]:
    """Return the rows of six and of 18 positions, on the accelerometer of table 6.1."""
    acc: Any = preset("adis16350").acc
    linear: Linear = acc.linear
    noise = 0.5 * MG

    def means(directions: FloatArray) -> FloatArray:
        return linear.apply(G0 * directions) + noise * rng.standard_normal(directions.shape)

    six = means(six_positions())
    bias, scale = up_down(np.diag(six[0::2]), np.diag(six[1::2]), G0)
    up, down = np.diag(six[0::2]), np.diag(six[1::2])
    printed = (up + down - 2.0 * G0) / (2.0 * G0)
    table = np.array(TABLE_6_1)
    limit = Tolerance(absolute=4.0 * 0.5e-3 / math.sqrt(2.0))
    remark = "0.5 mg on each mean, chosen here; 4 sigma"
    bias_g = bias / G0
    rows = [
        simulated(f"(6.2.1), bias {axis}", float(table[k]), float(bias_g[k]), "g", limit, remark)
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    rows += [
        simulated(f"(6.2.2) as corrected, scale {axis}", float(table[3 + k]), float(scale[k]), "1",
                  limit, "numerator l_up - l_down - 2 K; " + remark)
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    rows.append(info("(6.2.2) as printed, scale x", float(table[3]), float(printed[0]), "1",
                     "numerator l_up + l_down - 2 K: a misprint"))  # fmt: skip
    full = six_position(six)
    M = np.linalg.inv(full.matrix)
    rows.append(simulated(
        "(6.2.3), full matrix from six positions, largest error", 0.0,
        float(np.abs(M - np.array(linear.matrix)).max()), "1",
        Tolerance(absolute=limit.absolute), "twelve unknowns; " + remark,
    ))  # fmt: skip
    many = eighteen_position(means(eighteen_positions()), std=noise)
    worst = max(
        abs(p.value / (G0 if k < 3 else 1.0) - table[k]) / (p.std / (G0 if k < 3 else 1.0))
        for k, p in enumerate(many.parameters)
    )
    rows.append(worded(
        "6.2.1, 18 positions, nine parameters", "described, after Shin and El-Sheimy",
        f"within {worst:.1f} sigma of table 6.1", same=worst < 4.0, from_simulation=True,
        remark="by the norm alone, (6.2.5); under 4 of their own sigmas, noise known",
    ))  # fmt: skip
    return rows


def _squared_norm(x: FloatArray, readings: FloatArray) -> FloatArray:
    """Return ``a_x^2 + a_y^2 + a_z^2`` of (6.2.15), shape (n,)."""
    a = np.linalg.solve(distortion_matrix(x), (readings - x[:3]).T)
    return np.asarray(np.sum(a * a, axis=0))


def _slopes(x: FloatArray, readings: FloatArray) -> FloatArray:
    """Return (6.2.17) to (6.2.25), misprints corrected, shape (n, 9)."""
    dx, dy, _ = (readings - x[:3]).T
    _, _, _, sx, sy, sz, yz, zx, zy = x
    A, B, C = 1.0 / (1.0 + sx), 1.0 / (1.0 + sy), 1.0 / (1.0 + sz)
    ax, ay, az = np.linalg.solve(distortion_matrix(x), (readings - x[:3]).T)
    back = C * (B * yz * zx - zy)
    return 2.0 * np.column_stack(
        (
            -A * ax - yz * A * B * ay - A * back * az,
            -B * ay - zx * B * C * az,
            -C * az,
            -(ax * dx + ay * yz * B * dx + az * back * dx) * A**2,
            -(ay * (yz * A * dx + dy) + az * C * (A * yz * zx * dx + zx * dy)) * B**2,
            -az * az / C * C**2,
            ay * A * B * dx + az * A * B * C * zx * dx,
            az * (A * B * C * yz * dx + B * C * dy),
            -az * A * C * dx,
        )
    )


def _printed(rng: np.random.Generator) -> list[Row]:
    """Return the rows of (6.2.6) to (6.2.25): what the program has right, and the print not."""
    x = np.array(TABLE_6_1)
    S = distortion_matrix(x)
    _, _, _, sx, sy, sz, yz, zx, zy = x
    A, B, C = 1.0 / (1.0 + sx), 1.0 / (1.0 + sy), 1.0 / (1.0 + sz)
    inverse = np.array(
        [[A, 0.0, 0.0], [yz * A * B, B, 0.0], [yz * zx * A * B * C - zy * A * C, zx * B * C, C]]
    )
    minus = inverse * np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
    readings, h = rng.uniform(-10.0, 10.0, (39, 3)), 1e-6
    numeric = np.column_stack(
        [
            (_squared_norm(x + h * e, readings) - _squared_norm(x - h * e, readings)) / (2.0 * h)
            for e in np.eye(9)
        ]
    )
    off = np.abs(_slopes(x, readings) - numeric).max()
    return [
        compared("(6.2.12) as corrected, S times its inverse less one", 0.0,
                 float(np.abs(S @ inverse - np.eye(3)).max()), "1", ROUNDING,
                 "at table 6.1, theta_zx and theta_zy as in the program; rounding"),
        info("(6.2.12) as printed, the same", None, float(np.abs(S @ minus - np.eye(3)).max()),
             "1", "minus on element (3, 2): a misprint"),
        compared("(6.2.17) to (6.2.25) as corrected, off central differences", 0.0,
                 float(off), "(m/s^2)^2", Tolerance(absolute=1e-6),
                 "39 readings of up to 10 m/s^2; rounding of the differences"),
        not_given("(6.2.20) to (6.2.22) as printed, slope by s_x over the right one",
                  (1.0 + sx) ** 4, "1", "k = 1/A^2 in place of A^2: slower, but the same end"),
    ]  # fmt: skip


# --- temperature ------------------------------------------------------------------------


def _warmth(rng: np.random.Generator) -> list[Row]:
    """Return the rows of the bias that follows the temperature, 7.3, from the datasheet."""
    rows = []
    for name, sensor, printed, unit, size in (
        ("adis16350", "gyr", 0.1, "deg/s/degC", DPS),
        ("adis16350", "acc", 4.0, "mg/degC", MG),
        ("adis16405", "gyr", 0.01, "deg/s/degC", DPS),
        ("adis16405", "acc", 0.3, "mg/degC", MG),
    ):
        triad: Any = getattr(preset(name), sensor)
        n = 20_000
        temp = np.linspace(20.0, 35.0, n)
        zero = np.zeros((n, 3))
        force = zero if sensor == "gyr" else zero + [0.0, 0.0, G0]
        still = Truth(
            t=np.arange(n) / 20.0, q_nb=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), omega_ib_b=zero,
            f_b=force, lla=zero, v_n=zero, m_n=zero,
        )  # fmt: skip
        # white noise alone: flicker is no part of this formula
        part = replace(triad, noise=Noise(white=triad.noise.white))
        part = replace(part, sampling=replace(part.sampling, rate=20.0))
        samples = part.apply(still, rng, temp_degc=temp).value
        slope_x = temperature_model(sensor, temp, samples).parameters[0]
        rows.append(simulated(
            f"7.3, {name.upper()}, {sensor} bias over temperature", printed, slope_x.value / size,
            unit, Tolerance(absolute=4.0 * slope_x.std / size),
            "20 to 35 degC in 1000 s, x axis; 4 of its own sigmas; no coefficient is printed in "
            "7.3, the datasheet's is",
        ))  # fmt: skip
    rows.append(info("7.3, hold of the Kalman bias, TKF", "not printed", None, "",
                     "part of the navigation experiments"))  # fmt: skip
    return rows


PART: Final = Part(
    name="models",
    title="Error models, six and 18 positions, printed derivatives, temperature",
    source="1.3.2, 1.5, 6.1, 6.2.1, 6.2.2, 7.3; items 11, 13, 14, 19, F1 to F9, F11, F44",
    run=run,
)
