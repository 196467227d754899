"""Motions of test benches and hands: at rest, turntable, servo, coning, sculling and more.

Every class is one motion in closed form under the `Motion` protocol. Fields are SI; in a
scenario's TOML their names carry the unit (``rate_rpm``, ``rpy_deg``). Vehicles are in
`strapdown.simulation.vehicles`.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.sensors.settings import Quantity
from strapdown.simulation.jet import Jet, constant, jet_of, sin_cos, time
from strapdown.simulation.kinematics import Pose, quat_from_angles
from strapdown.simulation.profile import gate, integral, ramps, sines, spline, steps
from strapdown.units import DEG, RPM

Rows = tuple[tuple[float, ...], ...]
Triple = tuple[float, float, float]

_AXES = ("roll", "pitch", "yaw")


def _at_rest(clock: Jet) -> tuple[Jet, Jet, Jet]:
    zero = constant(0.0, clock)
    return zero, zero, zero


def _turned(clock: Jet, rpy: Triple) -> tuple[Jet, Jet, Jet]:
    roll, pitch, yaw = (constant(angle, clock) for angle in rpy)
    return roll, pitch, yaw


@dataclass(frozen=True, slots=True, kw_only=True)
class Static:
    """At rest on the Earth.

    Parameters
    ----------
    rpy : tuple of float
        Roll, pitch, yaw [rad].
    """

    rpy: Annotated[Triple, Quantity("angle")] = (0.0, 0.0, 0.0)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        clock = time(t, 2)
        return Pose(_at_rest(clock), quat_from_angles(*_turned(clock, self.rpy)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Poses:
    """At rest in one pose after another, as for a calibration.

    Parameters
    ----------
    rpy : tuple of (float, float, float)
        Roll, pitch, yaw of each pose [rad]; each angle goes straight to its next value.
    hold : float
        Rest in each pose [s].
    turn : float
        Time from one pose to the next [s].
    """

    rpy: Annotated[Rows, Quantity("angle")] = ((0.0, 0.0, 0.0),)
    hold: Annotated[float, Quantity("time")] = 5.0
    turn: Annotated[float, Quantity("time")] = 2.0

    def __post_init__(self) -> None:
        """Check the poses."""
        _checks.as_samples("rpy", self.rpy)
        _checks.positive("hold", self.hold)
        _checks.positive("turn", self.turn)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        begins = [self.hold + k * (self.hold + self.turn) for k in range(len(self.rpy) - 1)]
        roll, pitch, yaw = (
            jet_of(
                ramps(
                    self.rpy[0][axis],
                    [
                        (begin, self.turn, row[axis])
                        for begin, row in zip(begins, self.rpy[1:], strict=True)
                    ],
                ),
                t,
                2,
            )
            for axis in range(3)
        )
        return Pose(_at_rest(roll), quat_from_angles(roll, pitch, yaw))


@dataclass(frozen=True, slots=True, kw_only=True)
class Turntable:
    """A turntable on a vertical axis, the box at a distance from it and tilted.

    A record player turns at 33 1/3 rpm (200 deg/s) or 45 rpm (270 deg/s).

    Parameters
    ----------
    rate : float
        Rate about down, clockwise seen from above [rad/s]; negative turns the other way.
    rest : float
        Rest before [s].
    spin : float
        Time to reach the rate, and to stop again [s].
    turning : float
        Time at constant rate [s].
    radius : float
        Distance of the box from the axis [m].
    tilt : tuple of float
        Roll, pitch, yaw of the box on the platter [rad]; at yaw 0 it looks outwards.
    """

    rate: Annotated[float, Quantity("angular_rate")] = 100.0 / 3.0 * RPM
    rest: Annotated[float, Quantity("time")] = 5.0
    spin: Annotated[float, Quantity("time")] = 2.0
    turning: Annotated[float, Quantity("time")] = 60.0
    radius: Annotated[float, Quantity("length")] = 0.0
    tilt: Annotated[Triple, Quantity("angle")] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the times."""
        _checks.positive("rest", self.rest, allow_zero=True)
        _checks.positive("spin", self.spin)
        _checks.positive("turning", self.turning)
        _checks.positive("radius", self.radius, allow_zero=True)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        stop = self.rest + self.spin + self.turning
        rate = ramps(0.0, [(self.rest, self.spin, self.rate), (stop, self.spin, 0.0)])
        angle = jet_of(integral(rate, self.rest), t, 2)
        sine, cosine = sin_cos(angle)
        path = (cosine * self.radius, sine * self.radius, constant(0.0, angle))
        roll, pitch, yaw = _turned(angle, self.tilt)
        # yaw turns last of the three, so a turn about down adds to it
        return Pose(path, quat_from_angles(roll, pitch, yaw + angle))


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo:
    """A hobby servo that swings to and fro between zero and an angle.

    C A.2.3: to 90 deg, wait 500 ms, back to 0, wait 500 ms, five times; a pause of 1 s; all of
    it twice. The waits include the swing itself, which takes about 0.3 s.

    Parameters
    ----------
    angle : float
        Size of the swing [rad].
    axis : str
        What swings: ``"roll"``, ``"pitch"`` or ``"yaw"``.
    rest : float
        Rest before the first swing [s].
    wait : float
        From the start of one swing to the next [s].
    move : float
        Time that a swing takes, at most `wait` [s].
    swings, repeats : int
        To-and-fro swings of a group, and groups.
    pause : float
        Pause after each group [s].
    """

    angle: Annotated[float, Quantity("angle")] = 90.0 * DEG
    axis: str = "yaw"
    rest: Annotated[float, Quantity("time")] = 5.0
    wait: Annotated[float, Quantity("time")] = 0.5
    move: Annotated[float, Quantity("time")] = 0.3
    swings: int = 5
    repeats: int = 2
    pause: Annotated[float, Quantity("time")] = 1.0

    def __post_init__(self) -> None:
        """Check names and times."""
        _checks.one_of("axis", self.axis, _AXES)
        _checks.positive("wait", self.wait)
        _checks.in_range("move", self.move, 1e-3, self.wait)
        _checks.whole("swings", self.swings, 1)
        _checks.whole("repeats", self.repeats, 1)
        _checks.positive("pause", self.pause, allow_zero=True)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        group = 2.0 * self.swings * self.wait + self.pause
        changes = [
            (self.rest + k * group + j * self.wait, self.move, self.angle if j % 2 == 0 else 0.0)
            for k in range(self.repeats)
            for j in range(2 * self.swings)
        ]
        swing = jet_of(ramps(0.0, changes), t, 2)
        zero = constant(0.0, swing)
        roll, pitch, yaw = (swing if name == self.axis else zero for name in _AXES)
        return Pose(_at_rest(swing), quat_from_angles(roll, pitch, yaw))


@dataclass(frozen=True, slots=True, kw_only=True)
class HandMoved:
    """A box turned and waved about by hand: sums of sines between two rests.

    Each term is an amplitude, a period [s] and a phase [rad].

    Parameters
    ----------
    roll, pitch, yaw : tuple of (float, float, float)
        Terms of the angles [rad, s, rad].
    north, east, down : tuple of (float, float, float)
        Terms of the position [m, s, rad].
    rest : float
        Rest before [s].
    moving : float
        Time of motion, ramps included [s].
    ramp : float
        Time in which the motion sets in and fades [s].
    """

    roll: Annotated[Rows, Quantity("angle", (True, False, False))] = ((0.5, 5.3, 0.4),)
    pitch: Annotated[Rows, Quantity("angle", (True, False, False))] = ((0.4, 6.7, 1.1),)
    yaw: Annotated[Rows, Quantity("angle", (True, False, False))] = ((0.8, 9.1, 0.0),)
    north: Annotated[Rows, Quantity("length", (True, False, False))] = ()
    east: Annotated[Rows, Quantity("length", (True, False, False))] = ()
    down: Annotated[Rows, Quantity("length", (True, False, False))] = ()
    rest: Annotated[float, Quantity("time")] = 5.0
    moving: Annotated[float, Quantity("time")] = 50.0
    ramp: Annotated[float, Quantity("time")] = 2.0

    def __post_init__(self) -> None:
        """Check the terms and times."""
        for name in ("roll", "pitch", "yaw", "north", "east", "down"):
            if _checks.as_floats(name, getattr(self, name)).size:
                terms = _checks.as_samples(name, getattr(self, name))
                for period in terms[:, 1]:
                    _checks.positive(f"period in {name}", period)
        _checks.positive("ramp", self.ramp)
        _checks.positive("rest", self.rest, allow_zero=True)
        _checks.positive("moving", self.moving)
        if self.moving < 2.0 * self.ramp:
            raise ValueError(
                f"`moving` must be at least two ramps of {self.ramp:g} s, got {self.moving:g}."
            )

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        envelope = gate(t, 2, self.rest, self.rest + self.moving, self.ramp)
        roll, pitch, yaw, north, east, down = (
            envelope * sines(t, 2, terms)
            for terms in (self.roll, self.pitch, self.yaw, self.north, self.east, self.down)
        )
        return Pose((north, east, down), quat_from_angles(roll, pitch, yaw))


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoints:
    """Quintic splines through given poses at given times, at rest at both ends.

    Parameters
    ----------
    times : tuple of float
        When each pose is passed, increasing [s]; at least four.
    points : tuple of (float, float, float)
        North, east, down of each [m].
    rpy : tuple of (float, float, float)
        Roll, pitch, yaw of each [rad]; angles are not wrapped, so that 350 deg to 370 deg is a
        turn of 20 deg. Level and looking north where left out.
    """

    times: Annotated[tuple[float, ...], Quantity("time")] = (0.0, 5.0, 10.0, 15.0)
    points: Annotated[Rows, Quantity("length")] = ((0.0, 0.0, 0.0),) * 4
    rpy: Annotated[Rows, Quantity("angle")] = ()

    def __post_init__(self) -> None:
        """Check that there is a point and an attitude for each time."""
        t = _checks.as_times("times", self.times)
        for name in ("points", "rpy"):
            rows = getattr(self, name)
            if (_checks.as_floats(name, rows).size or name == "points") and len(
                _checks.as_samples(name, rows)
            ) != len(t):
                raise ValueError(
                    f"`{name}` must have one row per time, got {len(rows)} and {len(t)}."
                )
        if len(t) < 4:
            raise ValueError(f"`times` must hold at least four times, got {len(t)}.")

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        knots, points = np.array(self.times), np.array(self.points)
        rpy = np.array(self.rpy) if np.size(self.rpy) else np.zeros((len(knots), 3))
        north, east, down = (jet_of(spline(knots, points[:, k]), t, 2) for k in range(3))
        roll, pitch, yaw = (jet_of(spline(knots, rpy[:, k]), t, 2) for k in range(3))
        return Pose((north, east, down), quat_from_angles(roll, pitch, yaw))


@dataclass(frozen=True, slots=True, kw_only=True)
class BangBang:
    """Full torque about yaw one way, then the other way.

    A 9.1: after 50 s at rest, 2.5 s at 0.1551 rad/s^2 and 2.5 s at its opposite; the rate peaks
    at 0.3878 rad/s, and the box ends 55.5 deg further.

    Parameters
    ----------
    acceleration : float
        Angular acceleration about down [rad/s^2].
    start : float
        When it sets in [s].
    half : float
        Duration of each half [s].
    """

    acceleration: Annotated[float, Quantity("angular_acceleration")] = 0.1551
    start: Annotated[float, Quantity("time")] = 50.0
    half: Annotated[float, Quantity("time")] = 2.5

    def __post_init__(self) -> None:
        """Check the times."""
        _checks.finite("acceleration", self.acceleration)
        _checks.finite("start", self.start)
        _checks.positive("half", self.half)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        middle, end = self.start + self.half, self.start + 2.0 * self.half
        alpha = steps(
            0.0, [(self.start, self.acceleration), (middle, -self.acceleration), (end, 0.0)]
        )
        rate = integral(alpha, self.start)
        rate.c[-1, -1] = rate.c[0, -1] = 0.0  # at rest again, not but for round-off
        yaw = jet_of(integral(rate, self.start), t, 2)
        zero = constant(0.0, yaw)
        return Pose(_at_rest(yaw), quat_from_angles(zero, zero, yaw))


@dataclass(frozen=True, slots=True, kw_only=True)
class Coning:
    """The axis of the box runs round a cone; the box turns about no fixed axis.

    ``q_nb = (cos(a/2), sin(a/2) cos(w t), sin(a/2) sin(w t), 0)``: the rate has a constant part
    of ``-2 w sin(a/2)^2`` about z, which an integration of too few samples misses.

    Parameters
    ----------
    angle : float
        Half angle a of the cone [rad].
    frequency : float
        Turns round the cone per second, ``w / (2 pi)`` [Hz].
    """

    angle: Annotated[float, Quantity("angle")] = 1.0 * DEG
    frequency: Annotated[float, Quantity("frequency")] = 10.0

    def __post_init__(self) -> None:
        """Check the values."""
        _checks.in_range("angle", self.angle, 0.0, math.pi)
        _checks.positive("frequency", self.frequency)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        clock = time(t, 2)
        sine, cosine = sin_cos(clock * (2.0 * math.pi * self.frequency))
        tilt = math.sin(0.5 * self.angle)
        w, zero = constant(math.cos(0.5 * self.angle), clock), constant(0.0, clock)
        return Pose(_at_rest(clock), (w, cosine * tilt, sine * tilt, zero))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sculling:
    """The box rocks about its pitch axis and shakes along north at the same frequency.

    Pitch is ``angle sin(w t)``, north ``amplitude sin(w t + phase)``. Rocking and shaking in
    step leave a constant ``-amplitude w^2 angle cos(phase) / 2`` (small angles) in the specific
    force along z of the box, which an integration of too few samples takes for a motion.

    Parameters
    ----------
    angle : float
        Amplitude of pitch [rad].
    amplitude : float
        Amplitude along north [m].
    frequency : float
        Of both [Hz].
    phase : float
        Lead of the shaking [rad].
    """

    angle: Annotated[float, Quantity("angle")] = 1.0 * DEG
    amplitude: Annotated[float, Quantity("length")] = 0.001
    frequency: Annotated[float, Quantity("frequency")] = 10.0
    phase: Annotated[float, Quantity("angle")] = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("angle", "amplitude", "phase"):
            _checks.finite(name, getattr(self, name))
        _checks.positive("frequency", self.frequency)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        clock = time(t, 2)
        zero, w = constant(0.0, clock), 2.0 * math.pi * self.frequency
        pitch = sin_cos(clock * w)[0] * self.angle
        north = sin_cos(clock * w + self.phase)[0] * self.amplitude
        return Pose((north, zero, zero), quat_from_angles(zero, pitch, zero))
