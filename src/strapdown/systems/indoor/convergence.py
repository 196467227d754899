"""Section 4.2: the two-stage filter at rest, corrected and as printed, from any start.

The thesis prints no transient; the figures beside ours are those of another program of the same
equations, on ideal sensors at 100 Hz with the constants of 4.2.6. Angles are the thesis's: yaw,
pitch, roll relative to east-north-up.
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
from strapdown.units import DEG

RATE_HZ: Final = 100.0
FIELD_N: Final = (2e-5, 0.0, 0.0)  # level, as the printed model has it [T]
DIPPING_N: Final = (2e-5, 0.0, 4.5e-5)
STARTS: Final = 40
LONG_S: Final = 90.0  # twelve times the 7 s in which errors decay
LEFT_DEG: Final = 0.05
LEVEL: Final = (0.0, 0.0, 0.0)
TILTED: Final = (-100.0, 10.0, -20.0)
OTHER: Final = "not printed: of another program of the same equations; last digit"


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
) -> FloatArray:
    """Return the attitudes of a filter on ideal sensors of a box that lies still.

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

    Returns
    -------
    ndarray, shape (n, 4)
    """
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    C_bn = dcm_from_quat(truth).T
    acc, mag = (np.tile(C_bn @ v, (len(t), 1)) for v in ([0.0, 0.0, -G0], field_n))
    rec = Recording(imu=Imu(t=t, gyr=np.zeros((len(t), 3)), acc=acc), mag=Mag(t=t, mag=mag))
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
                "converges from everywhere; 90 s are twelve time constants, 0.05 deg is for slow "
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
    rows = []
    end = angles(still(TwoStage.as_printed(), box(TILTED), box(LEVEL), 60.0)[-1])
    rows += [
        simulated(
            "4.2.5, as printed, box at -100/10/-20 deg, yaw after 60 s", -96.04, float(end[0]),
            "deg", Tolerance(absolute=0.01),
            "4 deg off: h2 and H2 have wrong signs in (4.21), (4.22). Not printed: of another program of the same equations; "
            "last digit and the order of the stages",
        ),
        not_given(
            "4.2.5, as printed, the same, error of yaw", float(end[0]) - TILTED[0], "deg",
            "does not decay",
        ),
    ]  # fmt: skip
    worst = 0.0
    for yaw in (40.0, -100.0, 150.0):
        truth = box((yaw, 0.0, 0.0))
        end = still(TwoStage(field_model="printed"), truth, box(LEVEL), 60.0)[-1]
        worst = max(worst, float(rotation_angle(quat_mul(quat_conj(truth), end))) / DEG)
    rows.append(
        simulated(
            "4.2.5, printed field model, level boxes, largest error after 60 s", 0.0, worst, "deg",
            Tolerance(absolute=LEFT_DEG), "the wrong terms vanish where the box is level",
        )
    )  # fmt: skip
    return rows


def _transients() -> list[Row]:
    """Return the transients of another program of the same equations, stages as printed."""
    flt = TwoStage(restriction="printed")
    yaw = angles(still(flt, box((170.0, 0.0, 0.0)), box(LEVEL), 10.0))[:, 0]
    pitch = angles(still(flt, box(TILTED), box(LEVEL), 60.0))[:, 1]
    digit = Tolerance(absolute=0.05)
    rows = [
        simulated(f"4.2.6, start 170 deg away, yaw after {s} s", thesis, float(yaw[s * 100]),
                  "deg", digit, OTHER)
        for s, thesis in ((1, 155.7), (5, 167.4))
    ]  # fmt: skip
    rows += [
        simulated(f"4.2.6, pitch to 10 deg, after {s} s", thesis,
                  float(pitch[min(s * 100, len(pitch) - 1)]), "deg",
                  Tolerance(absolute=0.5 * digit_of),
                  OTHER)
        for s, thesis, digit_of in ((1, 5.9, 0.1), (5, 7.7, 0.1), (60, 9.97, 0.01))
    ]  # fmt: skip
    return rows


def _figure() -> page.Block:
    t = np.arange(round(60.0 * RATE_HZ)) / RATE_HZ
    items = [
        Series(x=t, y=angles(still(flt, box(TILTED), box(LEVEL), 60.0))[:, 0], name=name, color=c)
        for flt, name, c in (
            (TwoStage(), "corrected", "#0072b2"),
            (TwoStage.as_printed(), "as printed", "#d55e00"),
        )
    ]
    panel = Panel(y_label="yaw [deg]", items=items, height=220)
    return page.plot(time_figure([panel]), "Box at -100/10/-20 deg, start level.")


PART = Part(
    name="convergence",
    title="Two-stage filter at rest: corrected and as printed",
    source="4.2",
    run=run,
)
