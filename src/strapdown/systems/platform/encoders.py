"""Section 8.2: quadrature counting, start offset, and the star tracker made of encoders."""

import math
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import IndirectEkf
from strapdown.calibration import body_rates, decode_quadrature, start_offset
from strapdown.calibration.encoder import HEDM5500_RESOLUTION
from strapdown.rotation import quat_from_rpy, rpy_from_quat
from strapdown.sensors import preset
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.systems.platform import bench
from strapdown.units import DEG, DPS

# Table 8.2: rows are the current state AB, columns the one before; 0 is the X of the table.
STATES: Final = ("11", "10", "00", "01")
TABLE_8_2: Final = ((0, -1, 0, 1), (1, 0, -1, 0), (0, 1, 0, -1), (-1, 0, 1, 0))
STEP_DEG: Final = 0.09
CYCLES: Final = 500
OFFSET_DEG: Final = 1.7  # of the simulated start


def run(seed: int) -> Shown:
    """Count, find the offset, and make the star tracker of simulated encoders.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows = [counting(TABLE_8_2), _turn(), *_offset(), *_resolution()]
    return Shown(rows=[*rows, *_quaternion(seed), *_rates(seed)])


def counting(table: tuple[tuple[int, ...], ...]) -> Row:
    """Return how many of the sixteen transitions count as a table says.

    Parameters
    ----------
    table : 4 rows of 4
        Change of the count, by current and previous state in the order of `STATES`.

    Returns
    -------
    Row
    """
    right = 0
    for current, line in zip(STATES, table, strict=True):
        for previous, change in zip(STATES, line, strict=True):
            a, b = ([int(state[k]) for state in (previous, current)] for k in (0, 1))
            right += int(decode_quadrature(a, b).count[-1]) == change
    return compared(
        "table 8.2, transitions that count as printed", 16.0, float(right), "of 16",
        Tolerance(absolute=0.0), "exact",
    )  # fmt: skip


def _turn() -> Row:
    """Return the error of an angle that went to and fro through the two channels."""
    encoder = preset("hedm5500").encoder
    assert encoder is not None
    angle = 35.0 * DEG * np.sin(np.linspace(0.0, 20.0, 40_000))
    state = encoder.channels(angle)
    counted = decode_quadrature(state // 2, state % 2, CYCLES).count * HEDM5500_RESOLUTION
    return not_given(
        "8.2.3, channels A and B of a swing of 35 deg, decoded: largest error",
        float(np.abs(counted - angle).max()) / DEG, "deg", "half a count is rounding",
    )  # fmt: skip


def _offset() -> list[Row]:
    """Return (8.6) after a visit to both stops of roll and pitch."""
    rows = []
    sweep = bench.STOP_DEG * np.sin(np.linspace(0.0, 2.0 * np.pi, 2001)) - OFFSET_DEG
    for axis, angle in (("roll", sweep), ("pitch", -sweep)):
        counted = np.rint(angle / STEP_DEG) * STEP_DEG * DEG
        here = -start_offset(counted) / DEG
        sign = 1.0 if axis == "roll" else -1.0
        rows.append(
            simulated(
                f"(8.6), start offset of {axis} from stops at ±{bench.STOP_DEG:g} deg",
                sign * OFFSET_DEG, here, "deg", Tolerance(absolute=0.5 * STEP_DEG),
                "the platform was switched on that far from level; half a count",
            )
        )  # fmt: skip
    return rows


def _resolution() -> list[Row]:
    """Return the resolution of the encoders and the covariance (8.8) to (8.10) made of it."""
    enc = STEP_DEG / math.sqrt(12.0)
    sigma = 0.5 * IndirectEkf().star_resolution / math.sqrt(12.0)
    return [
        compared(
            "2.4, resolution of 500 cycles in quadrature", STEP_DEG, 360.0 / (4 * CYCLES), "deg",
            Tolerance(absolute=5e-3),
            "500 cycles counted four times make 0.18 deg; 0.09 deg would need 1000 cycles. The "
            "thesis works with 0.09 deg, and so do the other experiments here",
        ),
        compared("(8.8), sigma_enc", 0.02598, enc, "deg", Tolerance(absolute=5e-6), "last digit"),
        compared("(8.8), sigma_enc", 4.534e-4, enc * DEG, "rad", Tolerance(absolute=5e-8),
                 "last digit"),
        compared("(8.9), sigma_st", 2.267e-4, sigma, "", Tolerance(absolute=5e-8),
                 "of the filter's default resolution; last digit"),
        compared("(8.10), sigma_st²", 5.140e-8, sigma**2, "", Tolerance(absolute=5e-12),
                 "last digit"),
    ]  # fmt: skip


def _quaternion(seed: int) -> list[Row]:
    """Return (8.7), Euler angles to quaternion, corrected and as printed."""
    rng = np.random.default_rng([seed, 8])
    rpy = rng.uniform(-1.2, 1.2, (1000, 3))
    ours = quat_from_rpy(rpy)
    corrected, printed = _products(rpy)
    same = np.abs(ours - corrected * np.sign(np.sum(ours * corrected, axis=1))[:, np.newaxis])
    return [
        compared(
            "(8.7) corrected, scalar first, against the rotation here: largest difference", 0.0,
            float(same.max()), "", Tolerance(absolute=1e-15), "rounding of three products",
        ),
        info(
            "(8.7) as printed: largest departure of the norm from 1", None,
            float(np.abs(np.linalg.norm(printed, axis=1) - 1.0).max()), "",
            "misprint: third row has c(φ/2)c(θ/2)s(ψ/2) for s(φ/2)c(θ/2)s(ψ/2)",
        ),
    ]  # fmt: skip


def _products(rpy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (8.7), scalar first, with its third row corrected and as printed."""
    half = 0.5 * rpy.T
    (sf, st, sp), (cf, ct, cp) = np.sin(half), np.cos(half)
    q4, q1 = cf * ct * cp + sf * st * sp, sf * ct * cp - cf * st * sp
    q3 = cf * ct * sp - sf * st * cp
    right, wrong = cf * st * cp + sf * ct * sp, cf * st * cp + cf * ct * sp
    return np.column_stack((q4, q1, right, q3)), np.column_stack((q4, q1, wrong, q3))


def _rates(seed: int) -> list[Row]:
    """Return how well rates come out of counted angles, 6.3."""
    rng = np.random.default_rng([seed, 9])
    motion = bench.hand_motion(rng, (7.05, 8.56, 12.84), moving=57.0, duration=60.0)
    found = bench.truth(motion, 60.0)
    rpy = bench.encoders(found)
    error = body_rates(found.t, rpy) - found.omega_ib_b
    inner = slice(20, -20)
    steps = np.gradient(rpy, found.t, axis=0)
    exact = np.gradient(np.unwrap(rpy_from_quat(found.q_nb), axis=0), found.t, axis=0)
    return [
        not_given("6.3, rates from splined counts: RMS error",
                  float(np.sqrt(np.mean(error[inner] ** 2))) / DPS, "deg/s",
                  "hand motion with the RMS rates of test 2, table 9.1"),
        not_given("6.3, rates from differences of counts: RMS error",
                  float(np.sqrt(np.mean((steps - exact)[inner] ** 2))) / DPS, "deg/s",
                  "what the spline is for"),
    ]  # fmt: skip


PART = Part(
    name="encoders",
    title="Encoders: table 8.2, start offset, star tracker",
    source="2.4, 6.3, 8.2",
    run=run,
)
