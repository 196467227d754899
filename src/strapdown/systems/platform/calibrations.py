"""Tables 6.1 to 6.4: sensors with the printed errors, calibrated against the encoders.

The thesis's logs do not exist, and neither motion nor poses are printed. Sensors get the errors
that undo the printed matrices, the noise of tables 5.3 to 5.7 and counts; the platform is turned
by hand as in test 2 of table 9.1 for the gyroscope, and from pose to pose within the stops for
the other two.
"""

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from strapdown._types import FloatArray, IntArray
from strapdown.calibration import (
    CalibrationRecord,
    against_reference,
    body_rates,
    body_vectors,
    correction_from_physical,
    physical_parameters,
    turn_on_bias,
)
from strapdown.calibration.reference import NAMES, SCALE_TOLERANCES
from strapdown.constants import G0
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, time_figure
from strapdown.sensors import preset
from strapdown.simulation.motions import Poses
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, not_given, simulated, worded
from strapdown.systems.platform import bench
from strapdown.units import DEG, DPS, GAUSS

TRIALS: Final = 10
TRIAL_S: Final = 25.0
HAND_RMS_DPS: Final = (7.05, 8.56, 12.84)  # table 9.1, test 2
POSES: Final = 40
HOLD_S: Final = 3.0
TURN_S: Final = 2.0
_SHOWN: Final = 6000  # samples in a figure
_GROUPS: Final = 8  # of poses, whose spread shows what other poses would have given
# Unit, its size in SI, RMS errors before and after (tables 6.2 to 6.4), and the largest
# deviation of a scale factor that the thesis states.
UNITS: Final = {"gyr": ("deg/s", DPS), "acc": ("g", G0), "mag": ("G", GAUSS)}
RMS: Final = {
    "gyr": ("6.2", (1.116, 3.977, 0.215), (0.128, 0.146, 0.115)),
    "acc": ("6.3", (5.670e-3, 4.001e-2, 5.711e-2), (2.720e-3, 2.916e-3, 3.679e-3)),
    "mag": ("6.4", (5.402e-2, 1.367e-2, 2.280e-2), (2.189e-2, 1.303e-2, 0.927e-2)),
}
# Twelve parameters, derived from the printed matrices by (6.11) and (6.12), as `NAMES`:
# k, S_b in the unit above, angles in deg.
DERIVED: Final = {
    "gyr": (1.01812, 1.01667, 0.99980, -1.0967, 3.9611, -0.1656,
            0.017, -0.412, -0.123, -0.819, -0.543, 0.227),
    "acc": (1.00594, 1.01051, 1.03381, 0.01762, -0.04085, 0.09018,
            -0.145, -0.729, 0.086, 0.000, -0.421, -0.203),
    "mag": (1.01266, 0.97305, 0.95923, 0.03195, -0.01419, 0.01931,
            0.937, -10.778, -1.683, 1.687, 5.686, -0.006),
}  # fmt: skip
_DIGIT: Final = (*(1e-5,) * 3, *(1e-5,) * 3, *(1e-3,) * 6)
_GYR_BIAS_DIGIT: Final = 1e-4


def run(seed: int) -> Shown:
    """Calibrate the three simulated sensors and compare with the printed matrices and tables.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    for sensor in ("gyr", "acc", "mag"):
        rows += _derived(sensor)
    found = {"gyr": gyroscope(seed), "acc": posed("acc", seed), "mag": posed("mag", seed)}
    for sensor, calibrated in found.items():
        rows += matrix_rows(sensor, calibrated.record)
        rows += _rms_rows(sensor, calibrated)
    rows += tolerance_rows()
    rows += _bias_rows(seed, found["gyr"].record)
    rows.append(
        compared(
            "6.4, spirit level of 0.02 mm per metre", 1e-3, math.atan(0.02e-3) / DEG, "deg",
            Tolerance(absolute=5e-4), "'of the order of a thousandth of a degree'",
        )
    )  # fmt: skip
    blocks = tuple(_figure(sensor, calibrated) for sensor, calibrated in found.items())
    return Shown(rows=rows, blocks=blocks)


# --- the three procedures ---------------------------------------------------------------


class Found(NamedTuple):
    """A calibration, and the errors of all samples.

    Attributes
    ----------
    record : CalibrationRecord
        What was found.
    before, after : ndarray, shape (n, 3)
        Samples less reference, raw and corrected [SI].
    part : ndarray of int, shape (n,)
        Which trial or group of poses a sample belongs to.
    """

    record: CalibrationRecord
    before: FloatArray
    after: FloatArray
    part: IntArray


def gyroscope(seed: int) -> Found:
    """Return the calibration of 6.3: ten trials of 25 s by hand against the encoders' splines."""
    samples, reference = [], []
    for trial in range(TRIALS):
        rng = np.random.default_rng([seed, 1, trial])
        motion = bench.hand_motion(rng, HAND_RMS_DPS, rest=0.0, moving=TRIAL_S, duration=TRIAL_S)
        log = bench.record(motion, TRIAL_S, int(rng.integers(2**31)))
        assert log.rec.imu is not None
        samples.append(log.rec.imu.gyr)
        reference.append(body_rates(log.rec.imu.t, log.rpy))
    y, B = np.concatenate(samples), np.concatenate(reference)
    record = against_reference("gyr", y, B)
    part = np.repeat(np.arange(TRIALS), [len(piece) for piece in samples])
    return Found(record, y - B, record.correct(y) - B, part)


def posed(sensor: Literal["acc", "mag"], seed: int) -> Found:
    """Return the calibration of 6.4 or 6.5: at rest in many poses, against gravity or field.

    The means of the poses are fitted: an encoder's rounding does not change within a pose, so
    that its samples would look surer than they are.
    """
    rng = np.random.default_rng([seed, 2])
    limit = bench.LIMITS_DEG * DEG
    rpy = np.column_stack(
        (rng.uniform(-limit, limit, (POSES, 2)), np.linspace(0.0, 2.0 * np.pi, POSES))
    )
    motion = Poses(rpy=tuple(tuple(row) for row in rpy.tolist()), hold=HOLD_S, turn=TURN_S)
    log = bench.record(motion, (HOLD_S + TURN_S) * POSES - TURN_S, int(rng.integers(2**31)))
    assert log.rec.imu is not None
    assert log.rec.mag is not None
    t = log.rec.imu.t
    pose, since = np.divmod(t + 1e-9, HOLD_S + TURN_S)
    rest = since < HOLD_S
    pose = pose[rest].astype(np.int64)
    v_n = np.array([0.0, 0.0, -G0]) if sensor == "acc" else bench.FIELD_N
    y = (log.rec.imu.acc if sensor == "acc" else log.rec.mag.mag)[rest]
    B = body_vectors(log.rpy, v_n)[rest]
    means = [np.array([x[pose == k].mean(axis=0) for k in range(POSES)]) for x in (y, B)]
    record = against_reference(sensor, *means)
    return Found(record, y - B, record.correct(y) - B, pose % _GROUPS)


# --- rows -------------------------------------------------------------------------------


def physical(sensor: str) -> FloatArray:
    """Return the twelve parameters of the printed matrix, in the unit of its table and deg."""
    C = bench.matrix(sensor)
    bias = -np.linalg.solve(C[:, :3], C[:, 3])
    return physical_parameters(C[:, :3], bias / UNITS[sensor][1]) * _to_deg()


def _to_deg() -> FloatArray:
    return np.array([1.0] * 6 + [1.0 / DEG] * 6)


def _derived(sensor: str) -> list[Row]:
    """Return the parameters of the printed matrix beside those derived from it once before."""
    unit = UNITS[sensor][0]
    rows = []
    for k, (name, here) in enumerate(zip(NAMES, physical(sensor), strict=True)):
        digit = _GYR_BIAS_DIGIT if sensor == "gyr" and name[0] == "b" else _DIGIT[k]
        rows.append(
            compared(
                f"(6.11), {sensor}, {name}", DERIVED[sensor][k], float(here),
                {"k": "", "b": unit, "a": "deg"}[name[0]], Tolerance(absolute=0.6 * digit),
                "derived from the printed matrix, misprints of (6.11) corrected; last digit",
            )
        )  # fmt: skip
    return rows


def matrix_rows(sensor: str, record: CalibrationRecord) -> list[Row]:
    """Return the twelve elements of C, printed and found.

    Parameters
    ----------
    sensor : str
        ``"gyr"``, ``"acc"`` or ``"mag"``.
    record : CalibrationRecord
        Of simulated data.

    Returns
    -------
    list of Row
    """
    number = {"gyr": "6.17", "acc": "6.20", "mag": "6.23"}[sensor]
    printed, size = bench.MATRICES[sensor]
    here, std = _elements(record)
    return [
        simulated(
            f"({number}), b{4 * i + j + 1} of {sensor}", printed[i][j],
            float(here[i, j] / (size if j == 3 else 1.0)), _offset_unit(sensor) if j == 3 else "",
            Tolerance(absolute=3.0 * float(std[i, j] / (size if j == 3 else 1.0))),
            "three standard deviations of the regression",
        )
        for i in range(3)
        for j in range(4)
    ]  # fmt: skip


def _offset_unit(sensor: str) -> str:
    return {"gyr": "rad/s", "acc": "g", "mag": "G"}[sensor]


def _elements(record: CalibrationRecord) -> tuple[FloatArray, FloatArray]:
    """Return C, shape (3, 4), and the standard deviations of its elements [SI]."""

    def elements(parameters: FloatArray) -> FloatArray:
        M, bias = correction_from_physical(parameters)
        return np.column_stack((M, -M @ bias))

    values = np.array([p.value for p in record.parameters])
    columns = []
    for k, parameter in enumerate(record.parameters):
        step = np.zeros(len(values))
        step[k] = parameter.std
        columns.append((elements(values + step) - elements(values - step)).ravel() / 2.0)
    jacobian = np.column_stack(columns) / [p.std for p in record.parameters]
    std = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, record.covariance, jacobian))
    return elements(values), std.reshape(3, 4)


def _rms_rows(sensor: str, found: Found) -> list[Row]:
    """Return the RMS errors before and after."""
    number, before, after = RMS[sensor]
    unit, size = UNITS[sensor]
    here = [np.sqrt(np.mean(errors**2, axis=0)) / size for errors in (found.before, found.after)]
    spread = np.array(
        [
            np.sqrt(np.mean(found.before[found.part == k] ** 2, axis=0)) / size
            for k in range(found.part.max() + 1)
        ]
    ).std(axis=0, ddof=1)
    what = "ten trials" if sensor == "gyr" else f"{_GROUPS} groups of poses"
    alone = np.abs(_still(sensor)) / size
    kept = "; what the thesis keeps after calibration is not simulated" if sensor == "mag" else ""
    rows = []
    for k, axis in enumerate("xyz"):
        rows.append(
            simulated(
                f"table {number}, RMS error of {sensor} {axis} without calibration",
                before[k],
                float(here[0][k]),
                unit,
                Tolerance(absolute=3.0 * float(spread[k])),
                f"three standard deviations over {what}, for the thesis's own are not printed; "
                f"level and facing north the printed matrix alone makes {alone[k]:.3g} {unit}"
                + kept,
            )
        )
    for k, axis in enumerate("xyz"):
        rows.append(
            simulated(
                f"table {number}, RMS error of {sensor} {axis} with calibration",
                after[k],
                float(here[1][k]),
                unit,
                Tolerance(bound="at most"),
                _left(sensor, k, after[k]),
            )
        )
    return rows


def _still(sensor: str) -> FloatArray:
    """Return the error that the printed matrix undoes, level, facing north, at rest [SI]."""
    C = bench.matrix(sensor)
    x = {"gyr": np.zeros(3), "acc": np.array([0.0, 0.0, -G0]), "mag": bench.FIELD_N}[sensor]
    return np.asarray(np.linalg.solve(C[:, :3], x - C[:, 3]) - x)


def _left(sensor: str, axis: int, printed: float) -> str:
    """Return what the printed residual holds beside the sensor's noise."""
    unit, size = UNITS[sensor]
    white = getattr(preset("hmc5883l" if sensor == "mag" else "mpu6050"), sensor).noise.white
    rate = 75.0 if sensor == "mag" else bench.RATE_HZ
    turned = bench.matrix(sensor)[axis, :3] * white
    sigma = float(np.linalg.norm(turned)) * math.sqrt(rate) / size
    share = f"{100.0 * sigma / printed:.0f} %"
    text = f"noise of chapter 5 alone makes {sigma:.3g} {unit}, {share} of the printed; "
    if sigma > printed:
        return text + "the thesis's own two tables do not agree"
    return text + "what the thesis has besides is not simulated"


def tolerance_rows() -> list[Row]:
    """Return the verdicts on the scale factors against table 6.1."""
    rows = []
    for sensor, thesis, statement, within in (
        ("gyr", 2.0, "below 2 %", True),
        ("acc", 3.27, "3.27 %", False),
        ("mag", 4.25, "4.25 %", True),
    ):
        worst = float(np.max(np.abs(np.diag(bench.matrix(sensor)[:, :3]) - 1.0)))
        bound = "at most" if sensor == "gyr" else "around"
        tolerance = SCALE_TOLERANCES[sensor]
        rows += [
            compared(
                f"6.3 to 6.5, largest deviation of a scale factor of {sensor}", thesis,
                100.0 * worst, "%",
                Tolerance(absolute=0.0 if bound == "at most" else 5e-3, bound=bound),
                "as the thesis counts it, of the diagonal of C; last digit",
            ),
            worded(
                f"table 6.1, {sensor}, tolerance of {100.0 * tolerance:g} %",
                f"{statement}: {_verdict(within)}",
                f"{100.0 * worst:.2f} %: {_verdict(worst <= tolerance)}",
                same=within == (worst <= tolerance),
            ),
        ]  # fmt: skip
    return rows


def _verdict(within: bool) -> str:
    return "within" if within else "out of tolerance"


def _bias_rows(seed: int, record: CalibrationRecord) -> list[Row]:
    """Return the turn-on bias (6.18) from a rest of 2 s and of 1 s, against the one simulated."""
    rows = []
    true = np.array(bench.device().gyr.linear.bias) / DPS  # type: ignore[union-attr]
    for seconds in (2.0, 1.0):
        still = Poses()  # one pose
        log = bench.record(still, seconds + 0.5, seed + 7)
        imu = log.rec.imu
        assert imu is not None
        found = turn_on_bias(imu.t, imu.gyr, imu.acc, expected=record.bias, longest=seconds)
        error = float(np.abs(found.bias / DPS - true).max())
        rows.append(
            not_given(
                f"(6.18), turn-on bias from {seconds:g} s of rest, largest error", error, "deg/s",
                f"6.3.1 says 2 s, 9.2.1 says 1 s; stated deviation "
                f"{float(found.std.max()) / DPS:.3g} deg/s",
            )
        )  # fmt: skip
    return rows


def _figure(sensor: str, found: Found) -> page.Block:
    """Return the errors before and after, figures 6.3 to 6.10."""
    unit, size = UNITS[sensor]
    rows = slice(0, _SHOWN)
    t = np.arange(len(found.before))[rows] / bench.RATE_HZ
    panels = [
        Panel(
            y_label=f"{sensor} {name} [{unit}]",
            items=[
                Series(x=t, y=errors[rows, k] / size, name=axis, color=AXIS_COLORS[k])
                for k, axis in enumerate("xyz")
            ],
        )
        for name, errors in (("before", found.before), ("after", found.after))
    ]
    caption = {"gyr": "6.3 and 6.4", "acc": "6.6 and 6.7", "mag": "6.9 and 6.10"}[sensor]
    return page.plot(time_figure(panels), f"Figures {caption}: errors of {sensor}.")


PART = Part(
    name="calibration",
    title="Calibration against the encoders: tables 6.1 to 6.4, figures 6.3 to 6.10",
    source="6.2 to 6.5",
    run=run,
)
