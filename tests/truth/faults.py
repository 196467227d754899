"""Faults of a log, on the shipped scenario of hand motion: what every attitude estimator meets.

A `Case` is a spoiled recording beside the untouched one, with the span of the fault and the flags
that should tell of it. How far the same estimator is led astray is the angle between its errors on
both: `astray`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.recording import Imu, Mag, Recording
from strapdown.sensors.sampling import Ticks
from strapdown.simulation import kinematics, scenario
from strapdown.solution import Status
from strapdown.units import DPS, UT

RATE = 100.0
RECOVERED = 1.0  # so near the solution of the untouched log again [deg]


@dataclass(frozen=True, eq=False)
class Case:
    """A fault.

    Attributes
    ----------
    name : str
        In words.
    rec, clean : Recording
        With the fault and without it.
    start, end : float
        Of the fault [s].
    flags : Status
        One of them must stand where the fault is; 0 if nothing can tell.
    parameters : mapping
        Facts of the sensor that the estimator is told.
    truths : tuple of Rotation
        Attitude at the IMU samples of `rec` and of `clean`.
    """

    name: str
    rec: Recording
    clean: Recording
    start: float
    end: float
    flags: Status
    parameters: Mapping[str, Any] = field(default_factory=dict)
    truths: tuple[Any, Any] = (None, None)


# --- the log ----------------------------------------------------------------------------


@lru_cache(maxsize=4)
def log(rest: float = 10.0, jitter: float = 0.0, drift: tuple[float, float] = (0.0, 0.0)) -> Any:
    """The shipped scenario at 100 Hz with nine axes, and the attitude at the IMU's times.

    `rest` is how long the box lies at first. Sampling times are off by up to `jitter`, and known.
    `drift` pulls the box north and turns it about down, from 2 s to 12 s after the start.
    """
    hand = scenario.load("hand_moved")
    motion = replace(hand.motion, rest=rest)
    t = np.arange(round(120.0 * 400.0) + 1) / 400.0
    place = (hand.place.lat, hand.place.lon, hand.place.height)
    truth = kinematics.truth(motion, t, place, epoch_utc=hand.place.epoch_utc)
    seeds = np.random.SeedSequence(7).spawn(4)
    rng = [np.random.default_rng(seed) for seed in seeds]
    ticks = np.arange(round(119.0 * RATE)) / RATE
    ticks = ticks + rng[3].uniform(-jitter, jitter, len(ticks)) * (ticks > 0.5)
    every = Ticks(ticks, ticks, np.ones(len(ticks), dtype=bool))
    gyr = hand.device.gyr.apply(truth, rng[0], ticks=every)
    acc = hand.device.acc.apply(truth, rng[1], ticks=every)
    mag = hand.device.mag.apply(truth, rng[2])
    r_nb = slerp(t, truth.q_nb, ticks)
    rec = Recording(imu=Imu(t=gyr.t, gyr=gyr.value, acc=acc.value), mag=mag)
    if any(drift):
        rec, r_nb = _drifting(rec, r_nb, *drift)
    return rec, r_nb


def slerp(t, q_nb, at):
    """SciPy rotations at times, from quaternions, scalar first."""
    from scipy.spatial.transform import Slerp

    return Slerp(t, Rotation.from_quat(q_nb[:, [1, 2, 3, 0]]))(np.clip(at, t[0], t[-1]))


def _drifting(rec: Recording, r_nb: Rotation, pull: float, turn: float) -> Any:
    """Add an acceleration to the north and a rate about down over ten seconds."""
    t = rec.imu.t
    # cosine ramps of one second, so that nothing jumps
    shape = np.clip(np.minimum(t - 2.0, 12.0 - t), 0.0, 1.0)
    shape = 0.5 - 0.5 * np.cos(np.pi * shape)
    angle = np.cumsum(turn * shape) / RATE
    about = Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0]))
    down_b = r_nb.inv().apply([0.0, 0.0, 1.0])
    turned = about * r_nb
    acc = rec.imu.acc + turned.inv().apply(np.outer(pull * shape, [1.0, 0.0, 0.0]))
    gyr = rec.imu.gyr + (turn * shape)[:, None] * down_b
    field_n = np.stack([np.interp(rec.mag.t, t, angle)] * 3, axis=1) * [0.0, 0.0, 1.0]
    # the field of the box as it was, seen from the box as it is
    r_mag = slerp(t, r_nb.as_quat()[:, [3, 0, 1, 2]], rec.mag.t)
    seen = r_mag.apply(rec.mag.mag)
    mag = (Rotation.from_rotvec(field_n) * r_mag).inv().apply(seen)
    spoiled = replace(rec, imu=replace(rec.imu, gyr=gyr, acc=acc), mag=Mag(t=rec.mag.t, mag=mag))
    return spoiled, turned


# --- the faults -------------------------------------------------------------------------


def _spoiled(rec: Recording, sensor: str, start: float, count: int, value: float) -> Recording:
    stream = rec.mag if sensor == "mag" else rec.imu
    array = getattr(stream, sensor).copy()
    first = int(np.searchsorted(stream.t, start))
    array[first : first + count] = value
    return replace(
        rec, **{"mag" if sensor == "mag" else "imu": replace(stream, **{sensor: array})}
    )


INVALID = {"gyr": Status.GYR_INVALID, "acc": Status.ACC_INVALID, "mag": Status.MAG_INVALID}
TITLES = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}
LOST = "10 % of the samples lost in 20 s"
NAMES = (
    *(f"{what} of the {sensor}" for what in ("one NaN", "100 NaN", "100 zero vectors")
      for sensor in TITLES.values()),
    LOST,
    "sampling times off by up to 4 ms, and known",
    "gyroscope clipped at 15 deg/s, its range declared",
    "gap of 5 s",
    "magnetometer unplugged at half time",
    "magnet near for 15 s",
    "pulling out of rest at 0.3 m/s² for 10 s",
    "turning out of rest at 1 deg/s for 10 s",
    *(f"start {how}" for how in ("upside down", "nose up", "nose down")),
)  # fmt: skip
STARTS = {
    "upside down": (np.pi, 0.0, 0.7),
    "nose up": (0.3, np.pi / 2, 0.7),
    "nose down": (0.3, -np.pi / 2, 0.7),
}
RANGE = 15.0 * DPS  # the scenario turns by up to 40 deg/s


@cache
def cases() -> Mapping[str, Case]:
    """Return all faults by name."""
    return {case.name: case for case in _cases()}


def _cases() -> Iterator[Case]:
    rec, r_nb = log()
    known = (r_nb, r_nb)
    rates = {"gyr": RATE, "acc": RATE, "mag": (len(rec.mag) - 1) / np.ptp(rec.mag.t)}
    for words, value, count in (("one NaN", np.nan, 1), ("100 NaN", np.nan, 100),
                                ("100 zero vectors", 0.0, 100)):  # fmt: skip
        for sensor, rate in rates.items():
            stuck = sensor == "gyr" and value == 0.0  # a rate may be zero
            yield Case(
                f"{words} of the {TITLES[sensor]}",
                _spoiled(rec, sensor, 60.0, count, value),
                rec, 60.0, 60.0 + count / rate,
                Status.GYR_STUCK if stuck else INVALID[sensor], truths=known,
            )  # fmt: skip
    rng = np.random.default_rng(11)
    yield _cut(LOST, 40.0, 60.0, lambda n: rng.random(n) < 0.1)
    jittered, r_jittered = log(jitter=0.004)
    yield Case(
        "sampling times off by up to 4 ms, and known",
        jittered, rec, 0.5, 119.0, Status(0), truths=(r_jittered, r_nb),
    )  # fmt: skip
    clipped = replace(rec, imu=replace(rec.imu, gyr=np.clip(rec.imu.gyr, -RANGE, RANGE)))
    yield Case(
        "gyroscope clipped at 15 deg/s, its range declared",
        clipped, rec, 10.0, 119.0, Status.SATURATED, {"gyr_range": RANGE}, known,
    )  # fmt: skip
    yield _cut("gap of 5 s", 60.0, 65.0, lambda n: np.ones(n, dtype=bool), Status.GAP)
    yield Case(
        "magnetometer unplugged at half time",
        replace(rec, mag=rec.mag.rows(np.flatnonzero(rec.mag.t < 60.0))),
        rec, 60.0, 119.0, Status.MAG_MISSING, truths=known,
    )  # fmt: skip
    yield Case(
        "magnet near for 15 s", _magnet(rec), rec, 58.0, 77.0,
        Status.MAG_DISTURBED | Status.MAG_REJECTED, truths=known,
    )  # fmt: skip
    lying, r_lying = log(rest=20.0)
    for words, drift in (
        ("pulling out of rest at 0.3 m/s² for 10 s", (0.3, 0.0)),
        ("turning out of rest at 1 deg/s for 10 s", (0.0, 1.0 * DPS)),
    ):
        creeping, r_creeping = log(rest=20.0, drift=drift)
        yield Case(words, creeping, lying, 2.0, 12.0, Status(0), truths=(r_creeping, r_lying))
    for words, rpy in STARTS.items():
        turn = r_nb[0].inv() * Rotation.from_euler("ZYX", [rpy[2], rpy[1], rpy[0]])
        yield Case(
            f"start {words}", _turned(rec, turn.inv()), rec, 0.0, 0.0, Status(0),
            truths=(r_nb * turn, r_nb),
        )  # fmt: skip


def _cut(
    name: str, start: float, end: float, lost: Callable[[int], Any], flags: Status = Status(0)
) -> Case:
    """Samples of the IMU and of the magnetometer that are lost."""
    rec, r_nb = log()
    kept = []
    for t in (rec.imu.t, rec.mag.t):
        kept.append(np.flatnonzero(~((t > start) & (t < end) & lost(len(t)))))
    cut = replace(rec, imu=rec.imu.rows(kept[0]), mag=rec.mag.rows(kept[1]))
    return Case(name, cut, rec, start, end, flags, truths=(r_nb[kept[0]], r_nb))


def _magnet(rec: Recording) -> Recording:
    """A field of 85 uT that comes and goes within 2 s, at rest in n."""
    _, r_nb = log()
    t = rec.mag.t
    shape = np.clip(np.minimum(t - 58.0, 77.0 - t) / 2.0, 0.0, 1.0)
    r_mag = slerp(rec.imu.t, r_nb.as_quat()[:, [3, 0, 1, 2]], t)
    more = r_mag.inv().apply(np.outer(shape, np.array([0.0, 80.0, -30.0]) * UT))
    return replace(rec, mag=Mag(t=t, mag=rec.mag.mag + more))


def _turned(rec: Recording, turn: Rotation) -> Recording:
    """The same motion of a box whose axes are turned."""
    imu = replace(rec.imu, gyr=turn.apply(rec.imu.gyr), acc=turn.apply(rec.imu.acc))
    return replace(rec, imu=imu, mag=Mag(t=rec.mag.t, mag=turn.apply(rec.mag.mag)))


# --- what became of it -----------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What an estimator made of a case.

    Attributes
    ----------
    finite : bool
        Whether everything it gave was a number.
    flags : Status
        That stand in the fault and do not on the untouched log there.
    largest : float
        Farthest from the untouched solution, from the fault on [deg].
    recovery : float
        How long after the end of the fault it came back for good [s]; infinite if never.
    at_end : float
        How far off at the end of the log [deg].
    extra : float
        Largest error in the fault less the largest error there on the untouched log [deg].
    """

    finite: bool
    flags: Status
    largest: float
    recovery: float
    at_end: float
    extra: float


def judge(flt: Any, case: Case) -> Outcome:
    """Run an estimator on both logs and compare."""
    sol, clean = replace(flt, **case.parameters).run(case.rec), flt.run(case.clean)
    parts = (sol.q_nb, sol.gyr_bias, sol.std_attitude_n, sol.std_gyr_bias)
    off = astray(sol, clean, case)
    bad = np.flatnonzero((off > RECOVERED) & (sol.t >= case.start))
    recovery = max(0.0, float(sol.t[bad[-1]]) - case.end) if len(bad) else 0.0
    if len(bad) and bad[-1] == len(off) - 1:
        recovery = np.inf
    worst = [
        np.degrees(errors(s, r_nb).magnitude()[(s.t >= case.start) & (s.t <= case.end)]).max()
        for s, r_nb in zip((sol, clean), case.truths, strict=True)
    ]
    return Outcome(
        finite=all(part is None or bool(np.isfinite(part).all()) for part in parts),
        flags=_new_flags(sol, clean, case),
        largest=float(off[sol.t >= case.start].max()),
        recovery=recovery,
        at_end=float(off[-1]),
        extra=float(worst[0] - worst[1]),
    )


def errors(sol: Any, r_nb: Rotation) -> Rotation:
    """Rotations in n from the truth to the estimate."""
    return Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()


def astray(sol: Any, clean: Any, case: Case) -> Any:
    """Angle between the errors on both logs at the times of `sol` [deg]."""
    here, there = errors(sol, case.truths[0]), errors(clean, case.truths[1])
    nearest = np.clip(np.searchsorted(clean.t, sol.t - 0.5 / RATE), 0, len(clean) - 1)
    return np.degrees((here * there[nearest].inv()).magnitude())


def _new_flags(sol: Any, clean: Any, case: Case) -> Status:
    """Flags within the fault, and a little after it, that the untouched log does not have."""
    until = max(case.end, case.start) + 6.0
    bits = 0
    for result, sign in ((sol, 1), (clean, -1)):
        span = (result.t >= case.start) & (result.t <= until)
        seen = int(np.bitwise_or.reduce(result.status[span], initial=0))
        bits = bits | seen if sign > 0 else bits & ~seen
    return Status(bits)
