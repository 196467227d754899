"""Section 9.1: the bang-bang yaw, the filter at rising frequencies, exact against truncated.

The thesis's figures 9.3 to 9.6 are lost, and with them the frequencies, seeds and covariances.
Sensors here have the white noise and random walk of tables 5.3, 5.5 and 5.7 and sample the end
of each step; calibration and start are perfect, the star tracker is the encoders' every 3 s, and
k is 1.
"""

import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import IndirectEkf
from strapdown.attitude.indirect_ekf import Propagation
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import (
    AXIS_COLORS,
    Panel,
    Series,
    grid_figure,
    sigma_band,
    time_figure,
)
from strapdown.rotation import quat_conj, quat_mul, rpy_from_quat
from strapdown.sensors import Accelerometer, Device, Gyro, Magnetometer, Noise, Sampling, preset
from strapdown.simulation.motions import BangBang
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.systems.platform import bench
from strapdown.units import DEG

FREQUENCIES_HZ: Final = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
THRESHOLD_HZ: Final = 50.0
SEEDS: Final = 4
START_S: Final = 50.0
DURATION_S: Final = 55.0
SCENARIOS: Final = ("space", "terrestrial")
MOST_DIFFERENCE: Final = 2e-4  # v1 against v2, relative
THRUST_N: Final = 0.389
ARM_M: Final = 0.30
INERTIA: Final = 1.4186  # kg m^2, I_zz


class Outcome(NamedTuple):
    """The manoeuvre at one frequency, over all seeds.

    Attributes
    ----------
    rms : float
        RMS of the q3 error.
    bound : float
        Mean of three standard deviations of q3.
    outside : float
        Share of the samples beyond them.
    """

    rms: float
    bound: float
    outside: float


def run(seed: int) -> Shown:
    """Run the sweep in both scenarios and both formulations.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    rows = _profile()
    blocks: list[page.Block] = [_profile_figure()]
    for scenario in SCENARIOS:
        found: dict[str, list[Outcome]] = {}
        for propagation in ("exact", "truncated"):
            found[propagation] = [
                manoeuvre(scenario, f, seed, propagation=propagation) for f in FREQUENCIES_HZ
            ]
        rows += criterion_rows(scenario, found["exact"])
        rows += _difference_rows(scenario, found["exact"], found["truncated"])
        rows.append(_averaged(scenario, seed))
        blocks.append(_sweep_figure(scenario, found))
        blocks.append(_error_figure(scenario, seed))
    return Shown(rows=rows, blocks=blocks)


# --- the motion ---------------------------------------------------------------------------


def _profile() -> list[Row]:
    """Return thrust, torque and the profile they make, chapter 2 and (9.1), (9.2)."""
    found = bench.truth(BangBang(), 60.0, 100.0)
    yaw = np.unwrap(rpy_from_quat(found.q_nb)[:, 2])
    peak = float(np.abs(found.omega_ib_b[:, 2]).max()) / DEG
    return [
        compared("(2.2), largest torque of a pair", 0.1167, THRUST_N * ARM_M, "N m",
                 Tolerance(absolute=5e-5), "last digit"),
        compared("(9.1), torque of two pairs", 0.22, 2.0 * THRUST_N * ARM_M, "N m",
                 Tolerance(absolute=5e-3),
                 "0.389 N at 0.30 m make 0.2334 N m; the thesis goes on with 0.22"),
        compared("(9.2), acceleration of yaw", 0.1551, 0.22 / INERTIA, "rad/s²",
                 Tolerance(absolute=5e-5), "last digit"),
        compared("9.1, largest rate of yaw", 22.2, peak, "deg/s",
                 Tolerance(absolute=0.05), "derived from 2.5 s; last digit"),
        compared("9.1, change of yaw", 55.5, float(yaw[-1] - yaw[0]) / DEG, "deg",
                 Tolerance(absolute=0.05), "derived; last digit"),
    ]  # fmt: skip


def _profile_figure() -> page.Block:
    found = bench.truth(BangBang(), 60.0, 100.0)
    yaw = np.unwrap(rpy_from_quat(found.q_nb)[:, 2]) / DEG
    shown = found.t >= START_S - 2.0
    t, rate = found.t[shown], found.omega_ib_b[shown, 2]
    panels = [
        Panel(y_label="acc. [rad/s²]", items=[Series(x=t, y=np.gradient(rate, t), name="yaw")]),
        Panel(y_label="yaw [deg]", items=[Series(x=t, y=yaw[shown], name="yaw")]),
    ]
    return page.plot(time_figure(panels), "Figures 9.1 and 9.2: acceleration and angle of yaw.")


# --- the runs -----------------------------------------------------------------------------


def sensors(rate: float, *, average: bool = False) -> Device:
    """Return the sensors of 5.4: white noise and random walk, at one rate.

    Parameters
    ----------
    rate : float
        Samples per second [Hz].
    average : bool
        Whether the gyroscope gives means over its steps instead of what is there at their end.

    Returns
    -------
    Device
    """
    chip, field = preset("mpu6050"), preset("hmc5883l")
    assert chip.gyr is not None
    assert chip.acc is not None
    assert field.mag is not None
    sampling = Sampling(rate=rate)

    def noise(of: Noise) -> Noise:
        return Noise(white=of.white, random_walk=of.random_walk)

    return Device(
        gyr=Gyro(noise=noise(chip.gyr.noise), sampling=Sampling(rate=rate, average=average)),
        acc=Accelerometer(noise=noise(chip.acc.noise), sampling=sampling),
        mag=Magnetometer(noise=noise(field.mag.noise), sampling=sampling),
    )


def log(rate: float, seed: int, *, average: bool = False) -> Recording:
    """Return the log of a manoeuvre with the star tracker of the encoders in it.

    Parameters
    ----------
    rate : float
        Of the filter [Hz].
    seed : int
        Of the noise.
    average : bool
        See `sensors`.

    Returns
    -------
    Recording
    """
    fine = 4.0 * rate if average else rate  # means need samples in between
    found = bench.truth(BangBang(), DURATION_S, fine)
    every = round(fine / rate)
    rec = sensors(rate, average=average).record(found, seed=seed, reference_every=every)
    rpy = bench.encoders(found)[::every]
    star = bench.star_tracker(found.t[::every], rpy)
    return Recording(imu=rec.imu, mag=rec.mag, star=star, reference=rec.reference)


def estimator(scenario: str, propagation: Propagation = "exact") -> IndirectEkf:
    """Return the filter of a scenario, with the reference field that is true here."""
    if scenario == "space":
        return IndirectEkf.space(propagation=propagation)
    field = bench.FIELD_N
    return IndirectEkf.terrestrial(
        propagation=propagation, mag_factor=1.0, mag_reference=(float(field[0]), float(field[2]))
    )


def errors(
    scenario: str, rec: Recording, propagation: Propagation
) -> tuple[FloatArray, FloatArray]:
    """Return error and standard deviation of q3 at each sample."""
    used = rec if scenario == "space" else Recording(imu=rec.imu, mag=rec.mag)
    sol = estimator(scenario, propagation).run(used, diagnostics=False)
    assert rec.reference is not None
    assert rec.reference.attitude is not None
    assert sol.std_attitude_n is not None
    n = min(len(sol), len(rec.reference.attitude))
    off = quat_mul(quat_conj(sol.q_nb[:n]), rec.reference.attitude.q_nb[:n])
    return off[:, 3] * np.sign(off[:, 0]), 0.5 * sol.std_attitude_n[:n, 2]


def manoeuvre(
    scenario: str,
    rate: float,
    seed: int,
    *,
    propagation: Propagation = "exact",
    average: bool = False,
) -> Outcome:
    """Return the error of q3 from 50 s on, over some seeds.

    Parameters
    ----------
    scenario : str
        ``"space"`` or ``"terrestrial"``.
    rate : float
        Frequency of the filter [Hz].
    seed : int
        Of the first log.
    propagation : {'exact', 'truncated'}
        v1 or v2.
    average : bool
        See `sensors`.

    Returns
    -------
    Outcome
    """
    error, std = [], []
    for k in range(SEEDS):
        rec = log(rate, SEEDS * seed + k, average=average)
        assert rec.imu is not None
        e, s = errors(scenario, rec, propagation)
        rows = rec.imu.t[: len(e)] >= START_S
        error.append(e[rows])
        std.append(s[rows])
    e, s = np.concatenate(error), np.concatenate(std)
    return Outcome(
        rms=float(np.sqrt(np.mean(e**2))),
        bound=float(3.0 * s.mean()),
        outside=float(np.mean(np.abs(e) > 3.0 * s)),
    )


# --- rows ---------------------------------------------------------------------------------


def criterion_rows(scenario: str, found: list[Outcome]) -> list[Row]:
    """Return the sweep with its criterion.

    Parameters
    ----------
    scenario : str
        Which.
    found : list of Outcome
        By `FREQUENCIES_HZ`.

    Returns
    -------
    list of Row
    """
    figure = "9.3, 9.4" if scenario == "space" else "9.5, 9.6"
    rows = [
        not_given(
            f"figures {figure}, {scenario}, {f:g} Hz, RMS of q3", outcome.rms, "",
            f"3 sigma {outcome.bound:.3g}; {100.0 * outcome.outside:.3g} % of the samples beyond; "
            f"{SEEDS} logs",
        )
        for f, outcome in zip(FREQUENCIES_HZ, found, strict=True)
    ]  # fmt: skip
    ratio = [outcome.rms / outcome.bound for outcome in found]
    at = FREQUENCIES_HZ.index(THRESHOLD_HZ)
    falling = all(a > b for a, b in pairwise(ratio))
    rows.append(
        simulated(
            f"9.1, {scenario}, RMS of q3 over 3 sigma, above 50 Hz: at 100 Hz", 1.0, ratio[at + 1],
            "", Tolerance(bound="at most"),
            "inside the ±3 sigma curve" + (", and falling at every step" if falling else ""),
        )
    )  # fmt: skip
    rows.append(
        simulated(
            f"9.1, {scenario}, RMS of q3 over 3 sigma, at 50 Hz itself", 1.0, ratio[at], "",
            Tolerance(bound="at most"),
            "the delay of half a step, about alpha dt/2 times the time of acceleration; the "
            "thesis's window, Q and R are not printed",
        )
    )  # fmt: skip
    rows.append(
        info(
            f"9.1, {scenario}, frequency at which RMS of q3 is 3 sigma", THRESHOLD_HZ,
            _crossing(ratio), "Hz", "between the runs, on logarithmic axes",
        )
    )  # fmt: skip
    return rows


def _crossing(ratio: list[float]) -> float:
    """Return the frequency at which the ratio is one; NaN if it is nowhere."""
    x, y = np.log(FREQUENCIES_HZ), np.log(ratio)
    for k in range(len(x) - 1):
        if y[k] > 0.0 >= y[k + 1]:
            return math.exp(x[k] - y[k] * (x[k + 1] - x[k]) / (y[k + 1] - y[k]))
    return math.nan


def _difference_rows(scenario: str, exact: list[Outcome], truncated: list[Outcome]) -> list[Row]:
    """Return how far v2 is from v1."""
    rows = []
    for f, one, two in zip(FREQUENCIES_HZ, exact, truncated, strict=True):
        rows.append(
            simulated(
                f"8.1.1, {scenario}, {f:g} Hz, v2 against v1, RMS of q3, relative", 0.0,
                abs(two.rms / one.rms - 1.0), "", Tolerance(absolute=MOST_DIFFERENCE),
                "'no particular change in precision', set here to 2e-4; 8.1.1 assumes steps of "
                f"about 10 ms, these are of {1e3 / f:g} ms",
            )
        )  # fmt: skip
    return rows


def _averaged(scenario: str, seed: int) -> Row:
    found = manoeuvre(scenario, 20.0, seed, average=True)
    return info(
        f"9.1, {scenario}, 20 Hz, gyroscope averaging over its steps, RMS of q3",
        None,
        found.rms,
        "",
        f"3 sigma {found.bound:.3g}: what makes the error fall with frequency is sampling the "
        "steps' ends",
    )  # fmt: skip


def _sweep_figure(scenario: str, found: dict[str, list[Outcome]]) -> page.Block:
    f = np.array(FREQUENCIES_HZ)
    items = [
        Series(x=f, y=np.array([o.rms for o in outcomes]), name=name, color=color, kind="path",
               dash=dash)
        for (name, outcomes), color, dash in zip(
            (("v1", found["exact"]), ("v2", found["truncated"])), AXIS_COLORS[::2],
            ("solid", "dot"), strict=True,
        )
    ]  # fmt: skip
    items.append(
        Series(x=f, y=np.array([o.bound for o in found["exact"]]), name="3 sigma", color="#5b6470",
               kind="path", dash="dash")
    )  # fmt: skip
    panel = Panel(
        x_label="frequency [Hz]", y_label="RMS of q3", items=items, height=260, log_x=True,
        log_y=True,
    )  # fmt: skip
    number = "9.4" if scenario == "space" else "9.6"
    return page.plot(grid_figure([panel]), f"Figure {number}: RMS of q3, {scenario} scenario.")


def _error_figure(scenario: str, seed: int) -> page.Block:
    items: list[Series] = []
    colors = ("#d55e00", "#e69f00", "#009e73", "#0072b2")
    for f, color in zip((10.0, 20.0, 50.0, 100.0), colors, strict=True):
        rec = log(f, SEEDS * seed)
        assert rec.imu is not None
        e, s = errors(scenario, rec, "exact")
        rows = rec.imu.t[: len(e)] >= START_S - 2.0
        t = rec.imu.t[: len(e)][rows]
        items.append(Series(x=t, y=e[rows], name=f"{f:g} Hz", color=color))
    panel = Panel(y_label="q3", items=[sigma_band(t, s[rows]), *items], height=240)
    number = "9.3" if scenario == "space" else "9.5"
    return page.plot(time_figure([panel]), f"Figure {number}: error of q3, {scenario} scenario.")


PART = Part(
    name="frequency",
    title="Frequency of the filter, exact and truncated: figures 9.1 to 9.6",
    source="2.2, 8.1.1, 9.1",
    run=run,
)
