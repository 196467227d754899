"""The flights of chapter 4: round an area over Benevento, 9 m/s, 50 m, coordinated turns.

Where the waypoints lie is not printed, nor how long the missions last, nor how often GPS speaks.
Here a mission is straight legs and quarter turns; GPS speaks at every correction, as the program
asks for it. The second mission has its waypoints nearer each other.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, Literal

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.attitude import MultiModeAhrs, StandardAhrs
from strapdown.attitude.multi_mode_ahrs import FIELD_N
from strapdown.recording import Imu, Recording
from strapdown.rotation import rpy_from_quat
from strapdown.sensors import Sampling, preset
from strapdown.simulation import kinematics
from strapdown.simulation.vehicles import Flight
from strapdown.solution import Solution
from strapdown.systems.uav.sensors import BIAS, DURATION, RATE, SPEED, slow_bias
from strapdown.truth import Truth
from strapdown.units import DEG, GAUSS

PLACE: Final = (41.1326 * DEG, 14.7823 * DEG, 180.0)  # Benevento, 130 m above the sea; at 50 m
CONVERGED: Final = 30.0  # errors count from here on [s]
GPS_RATE: Final = 25.0  # [Hz]
GPS_NOISE: Final = 0.1  # [m/s], 0.6 deg of course
STEP: Final = 3.0  # between the points of a track [m]
ANGLES: Final = ("roll", "pitch", "yaw")
AXES: Final = ("P", "Q", "R")

Mission = Literal["first", "tight"]
# Quarter turns, right positive; seconds of straight flight before each, seconds of the turn.
_TURNS: Final = (1, 1, -1, 1, 1, 1, -1, -1)
_TIMES: Final[dict[str, tuple[float, float]]] = {"first": (16.0, 6.0), "tight": (6.0, 4.0)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """A flight and what the sensors said of it.

    Attributes
    ----------
    rec : Recording
        Without a reference.
    t : ndarray, shape (n,)
        Times of the samples [s].
    rpy : ndarray, shape (n, 3)
        True roll, pitch, yaw [rad].
    bias : ndarray, shape (n, 3)
        True biases of the gyroscopes [rad/s].
    """

    rec: Recording
    t: FloatArray
    rpy: FloatArray
    bias: FloatArray

    @property
    def late(self) -> BoolArray:
        """Samples after the filters have converged."""
        return np.asarray(self.t >= CONVERGED)

    @property
    def turning(self) -> BoolArray:
        """Those of them at which the aircraft is banked by ten degrees or more."""
        return np.asarray(self.late & (np.abs(self.rpy[:, 0]) > 10.0 * DEG))


@lru_cache(maxsize=2)
def truth(mission: Mission) -> Truth:
    """Return the motion at 50 Hz, in flight from the first sample on.

    Parameters
    ----------
    mission : {'first', 'tight'}
        Which circuit.

    Returns
    -------
    Truth
    """
    motion = Flight(points=_track(*_TIMES[mission]), speed=SPEED, rest=0.0, acceleration=2.0)
    t = 20.0 + np.arange(round(DURATION * RATE)) / RATE  # at speed after 8 s
    found = kinematics.truth(motion, t, PLACE, m_n=np.array(FIELD_N) * GAUSS)
    return replace(found, t=t - t[0])


def _track(straight: float, turn: float) -> tuple[tuple[float, ...], ...]:
    """Return points every few metres of legs and turns, whose rate swells and fades."""
    dt = STEP / SPEED
    number = round((DURATION + 60.0) / dt)
    t = dt * np.arange(number)
    course = np.zeros(number)
    begin = 30.0
    for k in range(number):
        if begin > t[-1]:
            break
        share = np.clip((t - begin) / turn, 0.0, 1.0)
        course += _TURNS[k % len(_TURNS)] * (
            0.5 * np.pi * share - 0.25 * np.sin(2.0 * np.pi * share)
        )
        begin += turn + straight
    north, east = np.cumsum(STEP * np.cos(course)), np.cumsum(STEP * np.sin(course))
    down = 3.0 * np.sin(2.0 * np.pi * t / 70.0)  # some pitch to estimate
    return tuple((float(n), float(e), float(d)) for n, e, d in zip(north, east, down, strict=True))


@lru_cache(maxsize=8)
def log(
    mission: Mission,
    seed: int,
    *,
    varying: bool = False,
    outage: float = 0.0,
    every: float = 100.0,
    gps_rate: float = GPS_RATE,
) -> Log:
    """Return a flight with simulated sensors.

    Parameters
    ----------
    mission : {'first', 'tight'}
        Which circuit.
    seed : int
        Of the noise.
    varying : bool
        Whether the biases are (4.1), or constant.
    outage, every : float
        Length of the losses of GPS, and from one to the next [s]; zero: never lost.
    gps_rate : float
        Fixes per second [Hz].

    Returns
    -------
    Log
    """
    motion = truth(mission)
    box: Any = preset("mnav100ca")
    gnss = replace(
        box.gnss, sampling=Sampling(rate=gps_rate), std_velocity=(GPS_NOISE,) * 3,
        outage=outage, outage_every=every, first_outage=every - outage,
    )  # fmt: skip
    rec = replace(
        box, gnss=gnss, baro=None, airspeed=None, temperature=None
    ).record(motion, seed=seed)  # fmt: skip
    bias = slow_bias(motion.t) if varying else np.tile(BIAS, (len(motion.t), 1))
    imu = Imu(t=rec.imu.t, gyr=rec.imu.gyr - np.array(BIAS) + bias, acc=rec.imu.acc)
    return Log(
        rec=replace(rec, imu=imu, reference=None), t=motion.t, rpy=rpy_from_quat(motion.q_nb),
        bias=bias,
    )  # fmt: skip


def standard(*, printed: bool = False) -> StandardAhrs:
    """Return the standard AHRS as a user has it, with the true declination, or as printed.

    Parameters
    ----------
    printed : bool
        The program.

    Returns
    -------
    StandardAhrs
    """
    if printed:
        return StandardAhrs.as_printed()
    return StandardAhrs(declination=float(np.arctan2(FIELD_N[1], FIELD_N[0])))


def multi(*, printed: bool = False) -> MultiModeAhrs:
    """Return the multi-mode AHRS with the field of the flight, or as printed.

    Parameters
    ----------
    printed : bool
        The program.

    Returns
    -------
    MultiModeAhrs
    """
    if printed:
        return MultiModeAhrs.as_printed(fix_timeout=0.1)
    north, east, down = np.array(FIELD_N) * GAUSS
    return MultiModeAhrs(
        declination=float(np.arctan2(east, north)),
        mag_reference=(float(np.hypot(north, east)), float(down)), fix_timeout=0.3,
    )  # fmt: skip


def errors(sol: Solution, flown: Log) -> FloatArray:
    """Return the errors of roll, pitch and yaw [deg].

    Parameters
    ----------
    sol : Solution
        Of the flight.
    flown : Log
        The flight.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    off = rpy_from_quat(sol.q_nb) - flown.rpy
    return np.asarray((off + np.pi) % (2.0 * np.pi) - np.pi) / DEG


def rpy_deg(sol: Solution) -> FloatArray:
    """Return roll, pitch and yaw of a solution [deg]."""
    return np.asarray(rpy_from_quat(sol.q_nb)) / DEG


def mean_abs(off: FloatArray, flown: Log) -> FloatArray:
    """Return the mean absolute errors after convergence, shape (3,) [deg]."""
    return np.asarray(np.abs(off[flown.late]).mean(axis=0))


def largest(off: FloatArray, flown: Log) -> FloatArray:
    """Return the largest absolute errors after convergence, shape (3,) [deg]."""
    return np.asarray(np.abs(off[flown.late]).max(axis=0))
