"""Chapters 2, 3 and appendix A: observability, Jacobians, constants, schedule."""

from itertools import combinations
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import MultiModeAhrs, StandardAhrs
from strapdown.kalman import observability
from strapdown.rotation import quat_from_rpy
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, worded
from strapdown.systems.uav import flight, programs
from strapdown.units import DEG

ATTITUDE: Final = (0.2, -0.1, 0.7)  # roll, pitch, yaw at which the system is linearised [rad]
VELOCITY: Final = (7.0, 5.5, -0.4)  # [m/s]
TURNING: Final = (0.1, 0.2, 0.3)  # [rad/s]
VECTORS: Final = {
    "accelerations": (0.0, 0.0, -programs.G),
    "magnetic field": programs.FIELD,
    "GPS velocity": VELOCITY,
}
FIRST: Final = 12  # steps of the schedule looked at
SINGLE, PAIR = 5, 7


def run(seed: int) -> Shown:
    """Compute what follows from printed equations and constants.

    Parameters
    ----------
    seed : int
        Of the flight on which the schedule is looked at.

    Returns
    -------
    Shown
    """
    rows = [*_ranks(), *_jacobians(), *_noise(), *_field(), *_schedule(seed), *_counter()]
    return Shown(rows=rows)


def matrices(
    names: tuple[str, ...], rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[FloatArray, FloatArray]:
    """Return F of (3.25) and H of some of the measurements, rows scaled to a length of one.

    Parameters
    ----------
    names : tuple of str
        Of `VECTORS`, or ``"yaw"``.
    rate : tuple of float
        Rates less biases [rad/s].

    Returns
    -------
    F : ndarray, shape (7, 7)
    H : ndarray, shape (m, 7)
    """
    q = quat_from_rpy(ATTITUDE)
    p, s, r = rate
    F = np.zeros((7, 7))
    F[:4, :4] = 0.5 * np.array([[0, -p, -s, -r], [p, 0, r, -s], [s, -r, 0, p], [r, s, -p, 0]])
    F[:4, 4:] = programs.of_rate(q)
    rows = []
    for name in names:
        if name == "yaw":
            rows.append(programs.heading(q, exact=True)[1])
        else:
            vector = np.array(VECTORS[name])
            rows.append(programs.vector(q, vector / np.linalg.norm(vector))[1])
    H = np.vstack(rows)
    return F, np.hstack((H, np.zeros((len(H), 3))))


def _ranks() -> list[Row]:
    """Return the rows of 3.2.1."""
    rows = []
    for count, thesis in ((1, SINGLE), (2, PAIR)):
        for names in combinations(VECTORS, count):
            rank = observability(*matrices(names)).rank
            rows.append(compared(
                f"3.2.1, rank of the observability matrix, {' and '.join(names)}", thesis, rank,
                "", Tolerance(), "linearised without rotation",
            ))  # fmt: skip
    for names, what in ((("yaw",), "course alone"), (("magnetic field", "yaw"), "mode 1")):
        rows.append(not_given(
            f"3.2.1, the same, {what}", observability(*matrices(names)).rank, "",
            "the thesis counts GPS as a vector; its filter takes the course",
        ))  # fmt: skip
    turning = [observability(*matrices((name,), TURNING)).rank for name in VECTORS]
    rows.append(not_given(
        "3.2.1, the same, a single vector while turning, least of the three", min(turning), "",
        "two vectors are needed in straight flight only",
    ))  # fmt: skip
    return rows


def _jacobians() -> list[Row]:
    """Return the rows of (2.38): what a turn about down makes of yaw."""
    rows = []
    for yaw in (0.0, 60.0, 90.0, 120.0, 180.0):
        q = quat_from_rpy((0.2, 0.05, yaw * DEG))
        w, x, y, z = q
        turn = 0.5 * np.array([-z, -y, x, w])  # 1/2 (0, down) q
        exact, printed = (
            float(programs.heading(q, exact=kind)[1][0] @ turn) for kind in (True, False)
        )
        rows.append(info(
            f"(2.38), derivative of yaw by a turn about down, at a yaw of {yaw:g} deg",
            round(printed, 3), exact, "", "thesis: value of the printed formula; it must be 1",
        ))  # fmt: skip
    return rows


def _noise() -> list[Row]:
    """Return what the printed variances are in the units of the estimators' parameters."""
    multi, plain = MultiModeAhrs(), StandardAhrs()
    P_0 = StandardAhrs.as_printed().init().P
    last = Tolerance(relative=1e-12)
    return [
        compared("A.1, Q of a quaternion component", 1e-8, plain.gyr_noise**2 * 0.02 / 4.0, "",
                 last, "per step of 20 ms, of the default density"),
        compared("A.1, Q of a bias", 1e-12, plain.gyr_bias_noise**2 * 0.02, "(rad/s)^2", last,
                 "per step"),
        compared("A.1, variance of the accelerometer", programs.VAR_ACC, plain.acc_noise**2 * 25.0,
                 "(m/s^2)^2", last, "per correction at 25 Hz"),
        compared("A.1, variance of the magnetic heading", programs.VAR_PSI,
                 plain.mag_noise**2 * 10.0, "rad^2", last, "per correction at 10 Hz"),
        compared("A.1, the same, as commented", (7.0 * DEG) ** 2, programs.VAR_PSI, "rad^2",
                 Tolerance(absolute=5e-6), "7 deg squared; printed with d2r = 0.01745"),
        compared("A.1, A.2, P_0 of each state", 0.1, float(np.diag(P_0).max()), "", last, ""),
        compared("A.2, aQ of the rates", 1e-4, multi.gyr_noise**2 * 50.0, "(rad/s)^2", last,
                 "per sample at 50 Hz"),
        compared("A.2, aQ of b_P and b_Q", 0.25e-4, multi.gyr_bias_noise[0] ** 2 * 50.0,
                 "(rad/s^2)^2", last, "per sample"),
        compared("A.2, aQ of b_R", 1e-8, multi.gyr_bias_noise[2] ** 2 * 50.0, "(rad/s^2)^2", last,
                 "per sample"),
        compared("A.2, variance of the field", programs.VAR_MAG, multi.mag_noise**2 * 25.0 * 1e8,
                 "G^2", last, "per correction at 25 Hz"),
        compared("A.2, variance of the course", programs.VAR_COURSE, multi.course_std**2, "rad^2",
                 last, "per fix"),
    ]  # fmt: skip


def _field() -> list[Row]:
    """Return what the printed field is, beside the model of the place."""
    north, east, down = programs.FIELD
    here = MultiModeAhrs.at(flight.PLACE, 2012.0)
    level = float(np.hypot(north, east))
    declination = float(np.degrees(np.arctan2(east, north)))
    model = here.mag_reference or (0.0, 0.0)
    return [
        not_given("A.2, V^E, declination", declination, "deg",
                  "the standard program leaves it out: its yaw is of magnetic north"),
        not_given("A.2, V^E, inclination", float(np.degrees(np.arctan2(down, level))), "deg", ""),
        not_given("A.2, V^E, size", float(np.hypot(level, down)), "G", ""),
        info("A.2, V^E, declination beside a world magnetic model", declination,
             float(np.degrees(here.declination or 0.0)), "deg", "of 2012.0, by extrapolation"),
        info("A.2, V^E, horizontal part beside the model", level, model[0] * 1e4, "G", ""),
        info("A.2, V^E, part down beside the model", down, model[1] * 1e4, "G", ""),
    ]  # fmt: skip


def _schedule(seed: int) -> list[Row]:
    """Return at which steps the kernels correct, on a flight at 50 Hz."""
    flown = flight.log("first", seed)
    rec = flown.rec.between(0.0, 0.02 * (FIRST + 1.5))
    rows = []
    for name, flt, want in (
        ("standard", flight.standard(printed=True),
         {"acc": [2, 4, 6, 8, 10, 12], "mag": [1, 6, 11]}),
        ("multi-mode", flight.multi(printed=True), {"mag": [2, 4, 6, 8, 10, 12]}),
    ):  # fmt: skip
        sol, _ = flt.advance(flt.init(attitude=[1.0, 0.0, 0.0, 0.0]), rec)
        for sensor, steps in want.items():
            found = sol.diagnostics[sensor]
            done = np.round(found.t[np.isfinite(found.sigma[:, 0])] / 0.02).astype(int)
            done = done[done <= FIRST]
            what = "gravity" if sensor == "acc" else "field"
            rows.append(worded(
                f"A, {name}, steps with a correction by {what}",
                ", ".join(map(str, steps)), ", ".join(map(str, done)),
                same=list(done) == steps, remark="counts at 50 Hz, of the first twelve",
            ))  # fmt: skip
        norm = float(np.abs(np.linalg.norm(sol.q_nb, axis=1) - 1.0).max())
        rows.append(compared(
            f"2.4.1, {name}, norm of the quaternion less one, largest", 0.0, norm, "",
            Tolerance(absolute=1e-15), "after every step",
        ))  # fmt: skip
    return rows


def _counter() -> list[Row]:
    """Return when the printed step counter overflows."""
    return [not_given(
        "A, `short count`, time at which it overflows", 32767 * programs.DT, "s",
        "then the standard program takes no heading for as long; ours counts time",
    )]  # fmt: skip


PART: Final = Part(
    name="equations",
    title="Observability, Jacobians, constants and schedule: chapters 2 and 3, appendix A",
    source="2.4, 3.2 to 3.5, appendix A",
    run=run,
)
