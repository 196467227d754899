"""Motions of vehicles along a track: a road drive with stops, a flight with coordinated turns."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.sensors.settings import Quantity
from strapdown.simulation.jet import Jet, atan2, compose, constant, jet_of, sin_cos, sqrt
from strapdown.simulation.kinematics import Pose
from strapdown.simulation.profile import free_spline, integral, ramps

Rows = tuple[tuple[float, ...], ...]

STEEPEST_RAMP = 1.875  # largest slope of the ramp 10 s^3 - 15 s^4 + 6 s^5


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A road vehicle along a smooth track, with stops; its x axis follows the track.

    The track is a spline of degree 7 through the points over the length of the straight lines
    between them, so the speed differs from the wanted one by some per cent in bends.

    Parameters
    ----------
    points : tuple of (float, float, float)
        North, east, down of the track's points [m]; at least eight.
    speed : float
        Wanted speed [m/s].
    acceleration : float
        Largest acceleration when it starts and stops [m/s^2].
    stops : tuple of int
        Numbers of the points, from 0, at which it stops besides the last.
    rest : float
        Rest at the start, and at every stop [s].
    """

    points: Annotated[Rows, Quantity("length")] = (
        (0.0, 0.0, 0.0),
        (60.0, 0.0, 0.0),
        (120.0, 5.0, -1.0),
        (180.0, 40.0, -2.0),
        (200.0, 100.0, -2.0),
        (180.0, 160.0, -1.0),
        (120.0, 195.0, 0.0),
        (60.0, 200.0, 0.0),
    )
    speed: Annotated[float, Quantity("speed")] = 12.0
    acceleration: Annotated[float, Quantity("acceleration")] = 2.0
    stops: tuple[int, ...] = ()
    rest: Annotated[float, Quantity("time")] = 10.0

    def __post_init__(self) -> None:
        """Check the track."""
        given = _checks.as_floats("points", self.points)
        points = _checks.as_samples("points", given if given.size else np.empty((0, 3)))
        if len(points) < 8:
            raise ValueError(f"`points` must hold at least eight points, got {len(points)}.")
        if (np.linalg.norm(np.diff(points, axis=0), axis=1) == 0.0).any():
            raise ValueError("`points` must differ from each to the next.")
        _checks.positive("speed", self.speed)
        _checks.positive("acceleration", self.acceleration)
        _checks.positive("rest", self.rest, allow_zero=True)
        stops = _checks.as_times(
            "stops", self.stops if _checks.as_floats("stops", self.stops).size else np.empty(0)
        )
        for stop in stops.tolist():
            _checks.whole("stops", stop, 1, len(points) - 2)

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        path, tangent = self._along(t)
        return Pose(path, None, tangent, constant(0.0, path[0]))

    @property
    def arrival(self) -> float:
        """When it stands at the last point [s]."""
        changes = self._speeds()
        return changes[-1][0] + changes[-1][1]

    def _along(self, t: FloatArray) -> tuple[tuple[Jet, Jet, Jet], tuple[Jet, Jet, Jet]]:
        """Return position and tangent."""
        points, u_points = np.array(self.points), self._lengths()
        way = jet_of(integral(ramps(0.0, self._speeds()), self.rest), t, 3)
        splines: list[Any] = [free_spline(u_points, points[:, k]) for k in range(3)]
        north, east, down = (compose(s, way) for s in splines)
        ahead, aside, below = (compose(s.derivative(), way.to(1)) for s in splines)
        return (north, east, down), (ahead, aside, below)

    def _lengths(self) -> FloatArray:
        legs = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
        return np.concatenate(([0.0], np.cumsum(legs)))

    def _speeds(self) -> list[tuple[float, float, float]]:
        """Return the ramps of the speed along the track."""
        u, at = self._lengths(), self.rest
        ramp = STEEPEST_RAMP * self.speed / self.acceleration
        changes = []
        ends = [0, *self.stops, len(u) - 1]
        for begin, end in pairwise(ends):
            way = float(u[end] - u[begin])
            # a ramp covers half of its time's way; where there is no room, go slower
            speed = min(self.speed, way / ramp)
            cruise = way / speed - ramp
            changes += [(at, ramp, speed), (at + ramp + cruise, ramp, 0.0)]
            at += 2.0 * ramp + cruise + self.rest
        return changes


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight(Drive):
    """A fixed-wing flight along a smooth track, banked so that no force acts sideways.

    Bank follows from the path's curvature and speed: ``tan(roll) = f_y / -f_z`` of the unbanked
    axes, with standard gravity and without the Coriolis force: some mm/s^2 stay sideways. The x
    axis follows the path: no angle of attack, no sideslip. It starts and ends at rest.

    Parameters are those of `Drive`.
    """

    def pose(self, t: FloatArray) -> Pose:
        """Return the pose at times of any order."""
        path, tangent = Drive._along(self, t)
        ahead, aside, below = tangent
        a_north, a_east, a_down = (part.derivative().derivative() for part in path)
        level = sqrt(ahead * ahead + aside * aside)
        f_side = (ahead * a_east - aside * a_north) / level
        f_ahead = (ahead * a_north + aside * a_east) / level
        sine, cosine = sin_cos(atan2(-below, level))
        f_down = f_ahead * sine + (a_down - G0) * cosine
        return Pose(path, None, tangent, atan2(f_side, -f_down))
