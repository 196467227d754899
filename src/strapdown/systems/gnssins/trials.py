"""Chapter 9: the box at rest for 100 s, with and without filtering, and the drive of 250 m.

The records do not exist. Simulated: 40 samples a second, noise of the ADIS16350's data sheet
without its filter, biases of tables 6.1 and 6.2. What filtered the rates is not printed but for "a
simulation of the GPS, possible because the position is known": here a Kalman filter of rate and
bias is told, besides the gyroscope, that the box does not turn.
"""

from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.earth import gravity_n, ned_from_lla
from strapdown.kalman.linear import predict, update
from strapdown.navigation import Gnssins, Start, mechanise
from strapdown.recording import Gnss, Imu, Recording
from strapdown.report import page
from strapdown.report.figures import AXIS_COLORS, Panel, Series, grid_figure
from strapdown.rotation import (
    dcm_from_quat,
    dcm_from_rpy,
    quat_from_rotvec,
    quat_from_rpy,
    quat_mul,
)
from strapdown.simulation.kinematics import truth
from strapdown.systems._growth import slope
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, not_given, simulated
from strapdown.systems.gnssins.budget import PLACE, Drive
from strapdown.systems.gnssins.calibrations import TABLE_6_1, TABLE_6_2
from strapdown.units import DPS, MG

RATE: Final = 40.0  # [Hz]
SPAN: Final = 100.0  # [s]
GYR_NOISE: Final = 0.60 * DPS  # rms of a sample, range of 300 deg/s, no filter
ACC_NOISE: Final = 35.0 * MG
GYR_BIAS: Final = np.array(TABLE_6_2[:3]) * DPS
ACC_BIAS: Final = np.array(TABLE_6_1[:3]) * G0
TRIALS: Final = 200
LEVEL: Final = (0.02, -0.03, 0.4)  # how the box stands: roll, pitch, yaw [rad]
AXES: Final = ("x", "y", "z")
CAR_SPAN, CAR_WAY, CAR_BIAS = 30.0, 250.0, 0.5  # [s], [m], [m/s^2]
CAR_SPEED: Final = CAR_WAY / (CAR_SPAN - 7.5)  # reached 10 s after the start, see `Drive`


class Still(NamedTuple):
    """Trials at rest: times, and for each trial and sample velocity and displacement in n."""

    t: FloatArray
    v_n: FloatArray
    way: FloatArray


def run(seed: int) -> Shown:
    """Simulate both trials.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    t, gyr, acc = _samples(rng, TRIALS)
    raw, filtered = _still(t, gyr[:1], acc[:1]), _still(t, _filtered(gyr), acc)
    rows = [*_at_rest(raw, filtered), *_system(t, gyr[0], acc[0]), *_car()]
    blocks = (
        _figure(raw, "9.22 to 9.24, without filtering"),
        _figure(filtered, "9.25 to 9.27, rates filtered"),
    )
    return Shown(rows=rows, blocks=blocks)


# --- at rest ----------------------------------------------------------------------------


def _samples(rng: np.random.Generator, trials: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times, rates and specific forces of the box at rest."""
    t = np.arange(round(SPAN * RATE) + 1) / RATE
    shape = (trials, len(t), 3)
    gyr = GYR_BIAS + GYR_NOISE * rng.standard_normal(shape)
    force = dcm_from_rpy(LEVEL).T @ [0.0, 0.0, -G0]
    return t, gyr, force + ACC_BIAS + ACC_NOISE * rng.standard_normal(shape)


def _still(t: FloatArray, gyr: FloatArray, acc: FloatArray) -> Still:
    """Follow steps 1, 2 and 4 of the trial."""
    acc = acc - ACC_BIAS  # step 1
    down = -np.mean(acc, axis=1)  # step 2: roll and pitch by gravity
    roll = np.arctan2(down[:, 1], down[:, 2])
    pitch = np.arctan2(-down[:, 0], np.hypot(down[:, 1], down[:, 2]))
    q = quat_from_rpy(np.column_stack((roll, pitch, np.full_like(roll, LEVEL[2]))))
    turns = quat_from_rotvec(gyr / RATE)
    a_n = np.empty_like(acc)
    for k in range(len(t)):
        q = quat_mul(q, turns[:, k])
        a_n[:, k] = np.einsum("kij,kj->ki", dcm_from_quat(q), acc[:, k])
    a_n[..., 2] += np.linalg.norm(down, axis=1)[:, None]
    v_n = np.cumsum(a_n, axis=1) / RATE
    return Still(t, v_n, np.cumsum(v_n, axis=1) / RATE)


def _filtered(gyr: FloatArray) -> FloatArray:
    """Return the rates that a filter of rate and bias believes, told that nothing turns (3b).

    Axis by axis: the gyroscope measures rate plus bias; the known position says that the rate is
    zero, to a hundredth of the gyroscope's noise.
    """
    H, R = np.array([[1.0, 1.0], [1.0, 0.0]]), np.diag([GYR_NOISE**2, (0.01 * GYR_NOISE) ** 2])
    Phi, Q = np.diag([0.0, 1.0]), np.diag([GYR_NOISE**2, 0.0])
    P = np.diag([GYR_NOISE**2, (5.0 * DPS) ** 2])
    rates = np.empty_like(gyr)
    bias = np.zeros_like(gyr[:, 0])
    for k in range(gyr.shape[1]):
        # the gain does not depend on the data: one for all trials and axes
        step = update([0.0, 0.0], P, [0.0, 0.0], H, R)
        innovation = gyr[:, k] - bias  # the other one is zero less zero
        rates[:, k] = step.K[0, 0] * innovation
        bias = bias + step.K[1, 0] * innovation
        P = predict([0.0, 0.0], step.P, Phi, Q).P
    return rates


def _at_rest(raw: Still, filtered: Still) -> list[Row]:
    """Return the rows of the trial that is shown, and of all that it might have been."""
    rows = []
    for name, trial, figures in (
        ("without filtering", raw, "figures 9.16 to 9.18, 9.22 to 9.24"),
        ("rates filtered", filtered, "figures 9.19 to 9.21, 9.25 to 9.27"),
    ):
        for axis in range(3):
            what = f"ch. 9, at rest, {name}, {AXES[axis]}"
            rows.append(
                not_given(f"{what} after 100 s", float(trial.way[0, -1, axis]), "m", figures)
            )
            rows.append(
                not_given(f"{what}, velocity", float(trial.v_n[0, -1, axis]), "m/s", figures)
            )
    ratio = float(np.linalg.norm(raw.way[0, -1]) / np.linalg.norm(filtered.way[0, -1]))
    size = np.sort(np.abs(filtered.way[:, -1]), axis=1)
    low, high = np.quantile(size[:, 2], [0.05, 0.95])
    return [
        *rows,
        not_given("ch. 9, at rest, drift without filtering over that with it", ratio, "1",
                  "very much larger"),
        simulated("ch. 9, at rest, rates filtered, axis that drifts most", 20.0,
                  float(np.median(size[:, 2])), "m", Tolerance(absolute=float(high - low) / 2.0),
                  f"almost 20 m, y; median of {TRIALS} trials, of which nine of ten lie between "
                  f"{low:.0f} and {high:.0f} m: one trial is printed"),
        simulated("ch. 9, at rest, rates filtered, the two other axes", 10.0,
                  float(np.median(size[:, :2])), "m", Tolerance(bound="at most"),
                  "some metres, read as at most 10 m; median of the trials"),
    ]  # fmt: skip


def _system(t: FloatArray, gyr: FloatArray, acc: FloatArray) -> list[Row]:
    """Return the rows of the whole system of chapter 7 at rest, with simulated fixes."""
    at = np.arange(1.0, SPAN)
    fixes = Gnss(t=at, lla=np.tile(PLACE, (len(at), 1)), v_n=np.zeros((len(at), 3)))
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), gnss=fixes)
    rows = []
    for name, make in (("consistent", Gnssins), ("as printed", Gnssins.as_printed)):
        system = make(acc_offset=tuple(ACC_BIAS.tolist()), gravity=G0)
        sol, _ = system.advance(system.init(attitude=quat_from_rpy(LEVEL)), rec)
        off = np.abs(ned_from_lla(np.asarray(sol.lla)[t > 2.0], np.array(PLACE)))
        bias = float(np.abs(np.asarray(sol.gyr_bias)[-1] - GYR_BIAS)[:2].max()) / DPS
        what = f"ch. 7, at rest, {name}, fixes at the known place"
        rows.append(not_given(f"{what}, largest drift", float(off.max()), "m"))
        rows.append(
            not_given(f"{what}, gyro bias off, x or y", bias, "deg/s", "z is unseen: no field")
        )
    return rows


# --- car --------------------------------------------------------------------------------


def _car() -> list[Row]:
    """Return the rows of the drive: a bias of 0.5 m/s^2 on z, nothing else."""
    t = np.arange(round(CAR_SPAN * 100.0) + 1) / 100.0
    of = truth(Drive(speed=CAR_SPEED), t, PLACE, m_n=(2e-5, 0.0, 4e-5))
    wrong = mechanise(
        (t, of.omega_ib_b, of.f_b + [0.0, 0.0, CAR_BIAS]), Start.of(of), sampling="points"
    )
    lla, v_n = np.asarray(wrong.lla), np.asarray(wrong.v_n)
    off = ned_from_lla(lla, of.lla[0]) - ned_from_lla(of.lla, of.lla[0])
    gravity = float(np.linalg.norm(gravity_n(of.lla[0])))
    near = Tolerance(relative=0.005)
    remark = "0.5 m/s^2 on z; an unaided height grows by g t^2 / (6 R) of itself more, 0.02 %"
    way = float(np.linalg.norm(ned_from_lla(of.lla, of.lla[0])[-1]))
    start = Start.of(of)
    fixes = slice(100, None, 100)
    rec = Recording(
        imu=Imu(t=t, gyr=of.omega_ib_b, acc=of.f_b + [0.0, 0.0, CAR_BIAS]),
        gnss=Gnss(t=t[fixes], lla=of.lla[fixes], v_n=of.v_n[fixes]),
    )
    system = Gnssins(gravity=gravity)
    sol, _ = system.advance(system.init(attitude=start.q_nb), rec)
    late = t > 10.0
    left = ned_from_lla(np.asarray(sol.lla)[late], of.lla[0]) - ned_from_lla(
        of.lla[late], of.lla[0]
    )
    return [
        compared("ch. 9, car, way", CAR_WAY, way, "m", Tolerance(relative=0.01),
                 "from rest; north, level"),
        compared("ch. 9, car, mean speed", 8.3, way / CAR_SPAN, "m/s", Tolerance(absolute=0.05),
                 "half of the last printed digit"),
        compared("ch. 9, car, z velocity after 30 s", CAR_BIAS * CAR_SPAN,
                 float(v_n[-1, 2] - of.v_n[-1, 2]), "m/s", near, remark),
        compared("ch. 9, car, z after 30 s", 0.5 * CAR_BIAS * CAR_SPAN**2, float(off[-1, 2]), "m",
                 near, remark),
        compared("ch. 9, car, z velocity, power of time", 1.0,
                 slope(t[1:], np.abs(v_n[1:, 2]), 3.0, CAR_SPAN), "1", Tolerance(absolute=0.01),
                 "linear, figures 31 to 33"),
        compared("ch. 9, car, z, power of time", 2.0,
                 slope(t[1:], np.abs(off[1:, 2]), 3.0, CAR_SPAN), "1", Tolerance(absolute=0.01),
                 "parabolic, figures 34 to 36"),
        not_given("ch. 9, car, the same with ch. 7 and a fix a second, largest z from 10 s on",
                  float(np.abs(left[:, 2]).max()), "m", "no receiver in the thesis's trial"),
    ]  # fmt: skip


def _figure(trial: Still, figures: str) -> page.Block:
    items = [
        Series(x=trial.t[::20], y=trial.way[0, ::20, axis], name=AXES[axis],
               color=AXIS_COLORS[axis], kind="path")
        for axis in range(3)
    ]  # fmt: skip
    panel = Panel(y_label="displacement [m]", items=items, x_label="time [s]", height=260)
    return page.plot(grid_figure([panel]), f"As figures {figures}.")


PART: Final = Part(
    name="trials",
    title="Chapter 9: 100 s at rest with and without filtering, 250 m by car",
    source="ch. 9; items 40, 41",
    run=run,
)
