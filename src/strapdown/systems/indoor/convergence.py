"""Section 4.2: the two-stage filter at rest, corrected and as printed, from any start.

The thesis prints no transient. Another program of the same equations, written apart from this one,
gave the figures in the remarks: ideal sensors at 100 Hz with the constants of 4.2.6.
Angles are the thesis's: yaw, pitch, roll relative to east-north-up.
"""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import TwoStage
from strapdown.constants import G0
from strapdown.recording import Imu, Mag, Recording
from strapdown.report import page
from strapdown.report.figures import Panel, Series, time_figure
from strapdown.rotation import (
    dcm_from_quat,
    quat_conj,
    quat_enu_from_ned,
    quat_from_rotvec,
    quat_from_rpy,
    quat_mul,
    quat_ned_from_enu,
    quat_normalize,
    rotation_angle,
    rpy_from_quat,
)
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, not_given, simulated
from strapdown.units import DEG, DPS

RATE_HZ: Final = 100.0
FIELD_N: Final = (2e-5, 0.0, 0.0)  # level, as the printed model has it [T]
DIPPING_N: Final = (2e-5, 0.0, 4.5e-5)
STARTS: Final = 40
LONG_S: Final = 120.0  # sixteen times the 7 s in which errors decay
LEFT_DEG: Final = 0.05
LEVEL: Final = (0.0, 0.0, 0.0)
TILTED: Final = (-100.0, 10.0, -20.0)
ZERO_RATE_DPS: Final = (0.9055, -0.7203, 3.1291)  # table 6.2


def run(seed: int) -> Shown:
    """Start the filter in many attitudes, and the printed one in a tilted one.

    Parameters
    ----------
    seed : int
        Of the attitudes.

    Returns
    -------
    Shown
    """
    rows = [*_defaults(), *_everywhere(seed), *_printed(), *_transients()]
    return Shown(rows=rows, blocks=(_figure(),))


# --- runs ---------------------------------------------------------------------------------


def box(ypr_deg: tuple[float, float, float]) -> FloatArray:
    """Return q_nb of a box from the thesis's yaw, pitch, roll [deg]."""
    yaw, pitch, roll = ypr_deg
    return quat_ned_from_enu(quat_from_rpy(np.array([roll, pitch, yaw]) * DEG))


def angles(q_nb: FloatArray) -> FloatArray:
    """Return the thesis's yaw, pitch, roll of attitudes [deg], shape (..., 3)."""
    return np.asarray(rpy_from_quat(quat_enu_from_ned(q_nb))[..., ::-1] / DEG)


def still(
    flt: TwoStage,
    truth: FloatArray,
    start: FloatArray,
    seconds: float,
    field_n: tuple[float, float, float] = FIELD_N,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Return the attitudes of a filter on sensors without noise of a box that lies still.

    Parameters
    ----------
    flt : TwoStage
        The filter.
    truth, start : ndarray, shape (4,)
        How the box lies, and how the filter starts.
    seconds : float
        Length.
    field_n : tuple of float
        Magnetic field, NED [T].
    bias : tuple of float
        Of the gyroscope [deg/s].

    Returns
    -------
    ndarray, shape (n, 4)
    """
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    C_bn = dcm_from_quat(truth).T
    acc, mag = (np.tile(C_bn @ v, (len(t), 1)) for v in ([0.0, 0.0, -G0], field_n))
    gyr = np.tile(np.array(bias) * DPS, (len(t), 1))
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))
    return flt.advance(flt.init(attitude=start), rec, diagnostics=False)[0].q_nb


# --- rows ---------------------------------------------------------------------------------


def _defaults() -> list[Row]:
    """Return the constants of 4.2.6 in the units of the filter here."""
    flt, dt = TwoStage(), 1.0 / RATE_HZ
    close = Tolerance(relative=1e-12)
    return [
        compared("4.2.6, Q", 1e-6, flt.process_noise**2 * dt, "", close, "per 10 ms"),
        compared("4.2.6, R1", 2.0, flt.acc_noise**2 / dt, "", close, "at 100 Hz"),
        compared("4.2.6, R2", 1.0, flt.mag_noise**2 / dt, "", close, "at 100 Hz"),
        compared("4.2.6, P0", 0.5, flt.variance, "", close),
    ]


def _everywhere(seed: int) -> list[Row]:
    """Return the worst end of the corrected filter over random truths and starts."""
    rng = np.random.default_rng([seed, 1])
    pairs = [quat_normalize(rng.standard_normal((2, 4))) for _ in range(STARTS)]
    rows = []
    for field, name in ((FIELD_N, "level field"), (DIPPING_N, "dipping field")):
        left = []
        for truth, start in pairs:
            end = still(TwoStage(), truth, start, LONG_S, field)[-1]
            left.append(float(rotation_angle(quat_mul(quat_conj(truth), end))) / DEG)
        rows.append(
            simulated(
                f"4.2, corrected, {name}, worst of {STARTS} random starts after {LONG_S:g} s", 0.0,
                max(left), "deg", Tolerance(absolute=LEFT_DEG),
                "converges from everywhere; 120 s are 16 time constants, 0.05 deg is for slow "
                "first turns",
            )
        )  # fmt: skip
    opposite = []
    for axis in np.vstack((np.eye(3), [[0.6, 0.0, 0.8], [0.6, -0.64, 0.48]])):
        truth = box(TILTED)
        start = quat_mul(truth, quat_from_rotvec(179.0 * DEG * axis))
        end = still(TwoStage(), truth, start, 120.0, DIPPING_N)[-1]
        opposite.append(float(rotation_angle(quat_mul(quat_conj(truth), end))) / DEG)
    rows.append(
        simulated(
            "4.2, corrected, worst of 5 starts 179 deg off, after 120 s",
            0.0,
            max(opposite),
            "deg",
            Tolerance(absolute=LEFT_DEG), "the pull is almost nothing at first",
        )
    )  # fmt: skip
    return rows


def _printed() -> list[Row]:
    """Return where the printed model ends, tilted and level."""
    end = angles(still(TwoStage.as_printed(), box(TILTED), box(LEVEL), 60.0)[-1])
    rows = [
        _beside_other("4.2.5, as printed, box at -100/10/-20 deg, yaw after 60 s", -96.04, end[0]),
        not_given(
            "4.2.5, as printed, the same, error of yaw",
            float(end[0]) - TILTED[0],
            "deg",
            "does not decay: h2 and H2 have wrong signs in (4.21), (4.22)",
        ),
    ]
    worst = 0.0
    for yaw in (40.0, -100.0, 150.0):
        truth = box((yaw, 0.0, 0.0))
        end = still(TwoStage(field_model="printed"), truth, box(LEVEL), 60.0)[-1]
        worst = max(worst, float(rotation_angle(quat_mul(quat_conj(truth), end))) / DEG)
    rows.append(
        simulated(
            "4.2.5, printed field model, level boxes, largest error after 60 s",
            0.0,
            worst,
            "deg",
            Tolerance(absolute=LEFT_DEG),
            "the wrong terms vanish where the box is level",
        )
    )
    return rows


def _transients() -> list[Row]:
    """Return transients with the stages kept apart as printed, and what a bias does to 9 axes."""
    flt = TwoStage(restriction="printed")
    yaw = angles(still(flt, box((170.0, 0.0, 0.0)), box(LEVEL), 10.0))[:, 0]
    pitch = angles(still(flt, box(TILTED), box(LEVEL), 60.0))[:, 1]
    rows = [
        _beside_other("4.2.6, start 170 deg away, yaw after 1 s", 155.7, yaw[100]),
        _beside_other("4.2.6, start 170 deg away, yaw after 5 s", 167.4, yaw[500]),
        _beside_other("4.2.6, pitch to 10 deg, after 1 s", 5.9, pitch[100]),
        _beside_other("4.2.6, pitch to 10 deg, after 5 s", 7.7, pitch[500]),
        _beside_other("4.2.6, pitch to 10 deg, after 60 s", 9.97, pitch[-1]),
    ]
    truth = box((40.0, 0.0, 0.0))
    end = angles(still(flt, truth, truth, 120.0, bias=ZERO_RATE_DPS)[-1])
    what = "4.2.2, 9DOF, box at 40/0/0 deg, zero-rate of table 6.2 left in"
    for name, other, here in zip(("yaw", "pitch", "roll"), (55.0, -11.8, 7.3), end, strict=True):
        rows.append(_beside_other(f"{what}, {name} after 120 s", other, here))
    return rows


def _beside_other(item: str, other: float, here: float) -> Row:
    """Return a figure that the thesis does not print, beside that of another program."""
    digits = len(f"{other:g}".partition(".")[2])
    same = abs(float(here) - other) <= 0.5 * 10.0**-digits
    return not_given(
        item,
        float(here),
        "deg",
        f"another program of the same equations ends at {other:g}: "
        + ("the same to its last digit" if same else "not the same"),
    )


def _figure() -> page.Block:
    t = np.arange(round(60.0 * RATE_HZ)) / RATE_HZ
    items = [
        Series(x=t, y=angles(still(flt, box(TILTED), box(LEVEL), 60.0))[:, 0], name=name, color=c)
        for flt, name, c in (
            (TwoStage(), "corrected", "#0072b2"),
            (TwoStage.as_printed(), "as printed", "#d55e00"),
        )
    ]
    panel = Panel(y_label="yaw [deg]", items=items, height=220, y_range=(-102.0, -92.0))
    return page.plot(time_figure([panel]), "Box at -100/10/-20 deg, start level.")


PART = Part(
    name="convergence",
    title="Two-stage filter at rest: corrected and as printed",
    source="4.2",
    run=run,
)
