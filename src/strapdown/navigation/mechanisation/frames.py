"""Strapdown mechanisations: from rates and specific forces to attitude, velocity and position."""

import math
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.earth import dcm_ne
from strapdown.errors import ComputationError, InputError
from strapdown.kernels.mechanisation import layout as k
from strapdown.navigation.mechanisation import earth_model, increments
from strapdown.navigation.mechanisation.earth_model import SphericalEarth
from strapdown.navigation.mechanisation.inputs import (
    Samples,
    Start,
    Valid,
    samples_after,
    samples_of,
)
from strapdown.rotation import (
    dcm_from_quat,
    quat_from_dcm,
    quat_mul,
    rpy_from_quat,
)
from strapdown.solution import HEADING_REFERENCES, Solution
from strapdown.units import DEG

FRAMES: Final = ("inertial", "ecef", "ned", "wander")
ATTITUDES: Final = ("quaternion", "dcm", "euler")
SAMPLINGS: Final = ("mean", "points")
NED_LIMIT: Final = 89.95 * DEG  # of latitude: 5.6 km from the pole


class MechanisationState(NamedTuple):
    """All that a mechanisation remembers between two samples.

    Attributes
    ----------
    x : ndarray
        Its memory; `strapdown.kernels.mechanisation.layout` names the cells.
    flags : int
        `Status` bits that the next row takes.
    """

    x: FloatArray
    flags: int = 0

    @property
    def t(self) -> float:
        """Time of the last sample used [s]."""
        return float(self.x[k.T])


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanisation:
    """A strapdown mechanisation: dead reckoning with an IMU from a known start.

    `mechanise` does all of it in one call; this is the form that goes on from piece to piece.

    Parameters
    ----------
    frame : {'ned', 'ecef', 'inertial', 'wander'}
        In which velocity and position are integrated: local level, Earth, inertial or wander
        azimuth. All but ``'ned'``, which ends at 89.95 deg of latitude, pass over the poles.
    attitude : {'quaternion', 'dcm', 'euler'}
        What attitude is integrated as. ``'euler'`` ends where the body's x axis comes within
        0.06 deg of the z axis of the frame; in ECEF and inertial space that is the Earth's axis.
    earth : {'wgs84', 'spherical'} or SphericalEarth
        Shape and rotation.
    gravity : {'somigliana', 'gradient', 'spherical'} or float, optional
        Normal gravity with its second-order fall with height; the same with the linear gradient
        only; of a sphere, falling with the square of the distance; or one value everywhere
        [m/s^2]. By default the first on the ellipsoid and the third on the sphere.
    samples : int
        Samples of a step, 1 to 4: the solution has a row for each step. More need a lower rate
        of steps for the same coning error.
    compensate : bool
        Coning and sculling compensation, for one sample with the sample before. False takes rate
        and force as constant over the step: error of second order, for comparison.
    height : {'free', 'held'}
        ``'held'`` keeps height and takes vertical velocity as zero. Free, a height error grows
        by ``exp(t / 570 s)``, as in any inertial system without a height from elsewhere.
    sampling : {'mean', 'points'}
        Whether samples are means over their intervals, as recordings have them, or values at
        their times. Points go through a spline first, and cannot go piece by piece.
    max_gap : float
        Longest interval between samples that is bridged [s].
    heading_reference : {'true', 'magnetic', 'arbitrary'}
        What the heading of the start was measured from; stated in the solution.

    Notes
    -----
    Online but for points. A sample with NaN is left out, and the next one covers its time; its row
    is flagged. For a motion with smooth rates the error falls with the fourth power
    of the step from two samples on, with the third for one, with the second without
    compensation; the slow terms of the frame's own turn are of second order and make micrometres
    at 100 Hz. Sub-samples are taken as equally long. Where the accelerometer is slower than the
    gyroscope, its held samples count as they stand, half of its interval late.

    References
    ----------
    .. [1] Thesis E1, sections 2.5.1 to 2.5.4 and 2.6.
    .. [2] P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
           Systems", 2nd edition, Artech House, 2013, chapter 5.

    Examples
    --------
    >>> ins = Mechanisation(frame="ecef", samples=2)
    >>> state = ins.init(Start(lla=(0.8, 0.2, 100.0), q_nb=(1, 0, 0, 0), t=0.0))
    >>> state.t
    0.0
    """

    frame: Literal["ned", "ecef", "inertial", "wander"] = "ned"
    attitude: Literal["quaternion", "dcm", "euler"] = "quaternion"
    earth: str | SphericalEarth = "wgs84"
    gravity: str | float | None = None
    samples: int = 1
    compensate: bool = True
    height: Literal["free", "held"] = "free"
    sampling: Literal["mean", "points"] = "mean"
    max_gap: float = 1.0
    heading_reference: str = "true"
    _p: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the parameters."""
        _checks.one_of("frame", self.frame, FRAMES)
        _checks.one_of("attitude", self.attitude, ATTITUDES)
        _checks.one_of("height", self.height, ("free", "held"))
        _checks.one_of("sampling", self.sampling, SAMPLINGS)
        _checks.one_of("heading_reference", self.heading_reference, HEADING_REFERENCES)
        _checks.whole("samples", self.samples, 1, increments.MOST_SAMPLES)
        if not isinstance(self.compensate, bool):
            raise TypeError(f"`compensate` must be True or False, got {self.compensate!r}.")
        _checks.positive("max_gap", self.max_gap, allow_inf=True)
        object.__setattr__(self, "_p", self._params(self.samples))

    def _params(self, samples: int) -> FloatArray:
        p = np.zeros(k.P_SIZE)
        p[k.FRAME] = FRAMES.index(self.frame)
        p[k.ATTITUDE] = ATTITUDES.index(self.attitude)
        p[k.HELD] = float(self.height == "held")
        p[k.LEAST_COSINE] = math.cos(NED_LIMIT)
        earth_model.fill(p, self.earth, self.gravity)
        increments.fill(p, samples, compensate=self.compensate)
        return p

    def init(self, start: Start) -> MechanisationState:
        """Return the state at a start.

        Parameters
        ----------
        start : Start
            With its time.

        Returns
        -------
        MechanisationState

        Raises
        ------
        ValueError
            If the frame or the attitude cannot begin there.
        """
        from strapdown.kernels.mechanisation.run import prime

        _checks.instance("start", start, Start, "`Start.of` makes one from a solution")
        if start.t is None:
            raise ValueError("`start` must have a time `t` here, got None.")
        lla, v_n, q_nb = (np.asarray(a) for a in (start.lla, start.v_n, start.q_nb))
        p = self._p
        if self.frame == "ned" and abs(lla[0]) > NED_LIMIT:
            raise ValueError(
                f"`start` must lie within {NED_LIMIT / DEG:g} deg of the equator for the frame "
                f"'ned', got latitude {lla[0] / DEG:.6g} deg; {_POLE_ADVICE}."
            )
        x = np.zeros(k.X_SIZE)
        x[k.T] = x[k.T0] = start.t
        x[k.HEIGHT] = lla[2]
        x[k.COUNT] = p[k.FIRST]
        C_ne = dcm_ne(lla)
        r_e = earth_model.ecef_from_lla(p, lla)
        if self.frame == "ned":
            x[k.POS : k.POS + 3], x[k.V : k.V + 3], q_xb = lla, v_n, q_nb
        elif self.frame == "wander":  # begins with its x axis to the north
            x[k.POS + 2], x[k.V : k.V + 3], q_xb = lla[2], v_n, q_nb
            x[k.Q_EW : k.Q_EW + 4] = quat_from_dcm(C_ne.T)
        else:
            x[k.POS : k.POS + 3], x[k.V : k.V + 3] = r_e, C_ne.T @ v_n
            q_xb = quat_mul(quat_from_dcm(C_ne.T), q_nb)
            if self.frame == "inertial":
                x[k.V] -= p[k.OMEGA] * r_e[1]
                x[k.V + 1] += p[k.OMEGA] * r_e[0]
        if self.height == "held":
            x[k.V : k.V + 3] -= self._up(C_ne) * (self._up(C_ne) @ x[k.V : k.V + 3])
        x[k.ATT : k.ATT + 4] = q_xb
        if self.attitude == "dcm":
            x[k.ATT : k.ATT + 9] = dcm_from_quat(q_xb).ravel()
        elif self.attitude == "euler":
            x[k.ATT : k.ATT + 3] = rpy_from_quat(q_xb)
            x[k.ATT + 3] = 0.0
            if abs(math.cos(x[k.ATT + 1])) < 1e-3:
                raise ValueError(f"`start` must not be {_lock_text(self.frame)}; {_LOCK_ADVICE}.")
        prime(x, p, np.zeros(k.W_SIZE))
        return MechanisationState(x)

    def _up(self, C_ne: FloatArray) -> FloatArray:
        level = self.frame in ("ned", "wander")
        return np.array((0.0, 0.0, -1.0)) if level else np.asarray(-C_ne[2])

    def advance(
        self, state: MechanisationState, rec: Samples
    ) -> tuple[Solution, MechanisationState]:
        """Go on from `state` over the next piece of a recording.

        Parameters
        ----------
        state : MechanisationState
            Left as it is.
        rec : Recording, Imu, or tuple of three arrays
            Samples later than the state; see `mechanise`.

        Returns
        -------
        Solution, MechanisationState
            A row for each step that was completed, and what is remembered after the last
            sample, unfinished steps included.

        Raises
        ------
        ValueError
            If samples begin before the state.
        DataGap
            If an interval is longer than `max_gap`.
        ComputationError
            If NED comes too near to a pole, or Euler angles to gimbal lock.
        """
        if self.sampling == "points":
            raise ValueError(
                "`sampling` must be 'mean' to go piece by piece: points are joined by a spline "
                "over the whole recording; use `run`."
            )
        samples = samples_of(rec)
        if len(samples.t) and not samples.t[0] > state.t:
            raise ValueError(
                f"`rec` must begin after the state, got {samples.t[0]:g} after {state.t:g}."
            )
        x = state.x.copy()
        out, flags = self._integrate(x, samples_after(samples, state.t, self.max_gap), state.flags)
        return self._solution(out), MechanisationState(x, flags)

    def run(self, rec: Samples, start: Start) -> Solution:
        """Return the solution over a whole recording, the start as its first row.

        Parameters
        ----------
        rec : Recording, Imu, or tuple of three arrays
            See `mechanise`.
        start : Start
            Where and when it begins.

        Returns
        -------
        Solution
        """
        _checks.instance("start", start, Start, "`Start.of` makes one from a solution")
        samples = samples_of(rec)
        t = samples.t
        if len(t) == 0:
            raise InputError("`rec` must hold valid inertial samples, it has none.")
        first = float(t[0]) if start.t is None else start.t
        if not t[0] <= first <= t[-1]:
            raise ValueError(
                f"time of `start` must lie within the samples, {t[0]:g} to {t[-1]:g} s, "
                f"got {first:g}."
            )
        if self.sampling == "points" and len(t) > 1:
            samples = samples._replace(
                gyr=increments.means_from_points(t, samples.gyr),
                acc=increments.means_from_points(t, samples.acc),
            )
        x = self.init(Start(lla=start.lla, q_nb=start.q_nb, v_n=start.v_n, t=first)).x
        at = int(np.searchsorted(t, first))
        if self._p[k.FIRST] > 0.0 and t[at] == first:
            # the sample that ends at the start is the one before the first
            x[k.TH : k.TH + 3], x[k.DV : k.DV + 3] = samples.gyr[at], samples.acc[at]
            x[k.BEFORE] = 1.0
        rows = [_row(x, self._p, 0)]
        out, flags = self._integrate(x, samples_after(samples, first, self.max_gap), 0)
        rows.append(out)
        left = int(x[k.COUNT] - self._p[k.FIRST])
        if left:  # the last step is of as many samples as there are
            self._finish(x, left)
            rows.append(_row(x, self._p, flags))
        return self._solution(np.concatenate(rows))

    def _finish(self, x: FloatArray, left: int) -> None:
        from strapdown.kernels.mechanisation.run import step

        p = self._p.copy()
        p[k.FIRST : k.P_SIZE] = 0.0
        increments.fill(p, left, compensate=self.compensate and left > 1)
        step(x, p, np.zeros(k.W_SIZE))
        self._refuse(x)

    def _integrate(self, x: FloatArray, samples: Valid, flags: int) -> tuple[FloatArray, int]:
        """Advance `x`; return time, ten outputs and status of each step, and the flags left."""
        from strapdown.kernels.mechanisation.run import run

        m, p = self.samples, self._p
        waiting = int(x[k.COUNT] - p[k.FIRST])
        steps = (waiting + len(samples.t)) // m
        out = np.empty((steps, 12))
        outputs = np.empty((steps, 10))
        run(x, p, np.zeros(k.W_SIZE), samples.t, samples.gyr, samples.acc, outputs)
        self._refuse(x)
        out[:, 0] = samples.t[m - 1 - waiting :: m][:steps]
        out[:, 1:11] = outputs
        bits = np.concatenate((np.zeros(waiting, dtype=np.int64), samples.flags))
        bits[0] |= flags
        out[:, 11] = np.bitwise_or.reduce(bits[: steps * m].reshape(steps, m), axis=1)
        return out, int(np.bitwise_or.reduce(bits[steps * m :]))

    def _refuse(self, x: FloatArray) -> None:
        if x[k.STATUS] == k.POLE:
            raise ComputationError(
                f"frame 'ned' must stay within {NED_LIMIT / DEG:g} deg of the equator, it came "
                f"to {x[k.POS] / DEG:.6g} deg at {x[k.T]:g} s; {_POLE_ADVICE}."
            )
        if x[k.STATUS] == k.GIMBAL_LOCK:
            raise ComputationError(
                f"attitude 'euler' came to {_lock_text(self.frame)} at {x[k.T]:g} s; "
                f"{_LOCK_ADVICE}."
            )

    def _solution(self, rows: FloatArray) -> Solution:
        return Solution(
            t=np.ascontiguousarray(rows[:, 0]),
            lla=rows[:, 1:4],
            v_n=rows[:, 4:7],
            q_nb=rows[:, 7:11],
            status=rows[:, 11].astype(np.int64),
            filter=f"mechanisation-{self.frame}",
            causal=self.sampling == "mean",
            heading_reference=self.heading_reference,
            meta={"parameters": self.parameters()},
        )

    def parameters(self) -> dict[str, Any]:
        """Return the parameters by name."""
        names = self.__dataclass_fields__
        return {name: getattr(self, name) for name in names if not name.startswith("_")}


def mechanise(
    rec: Samples,
    start: Start,
    *,
    frame: Literal["ned", "ecef", "inertial", "wander"] = "ned",
    attitude: Literal["quaternion", "dcm", "euler"] = "quaternion",
    earth: str | SphericalEarth = "wgs84",
    gravity: str | float | None = None,
    samples: int = 1,
    compensate: bool = True,
    height: Literal["free", "held"] = "free",
    sampling: Literal["mean", "points"] = "mean",
    max_gap: float = 1.0,
    heading_reference: str = "true",
) -> Solution:
    """Return where an IMU went from a known start: dead reckoning without any aiding.

    Parameters
    ----------
    rec : Recording, Imu, or tuple of three arrays
        Inertial samples; as a tuple ``(t, gyr, acc)`` of shapes (n,), (n, 3), (n, 3) in s,
        rad/s, m/s^2. Row k covers the interval that ends at ``t[k]``; NaN rows are left out.
    start : Start
        Attitude, velocity, position and their time.
    frame, attitude, earth, gravity, samples, compensate, height, sampling, max_gap
        See `Mechanisation`.
    heading_reference : {'true', 'magnetic', 'arbitrary'}
        See `Mechanisation`.

    Returns
    -------
    Solution
        `lla`, `v_n` and `q_nb` at the start and after each step.

    Raises
    ------
    ValueError
        If the start lies outside the samples.
    DataGap
        If an interval is longer than `max_gap`.
    ComputationError
        If NED comes too near to a pole, or Euler angles to gimbal lock.

    Examples
    --------
    A box at rest for ten minutes on the equator, level, its x axis to the north:

    >>> import numpy as np
    >>> from strapdown.constants import GAMMA_E, OMEGA_IE
    >>> t = np.arange(0.0, 600.5, 0.5)
    >>> gyr, acc = np.zeros((2, len(t), 3))
    >>> gyr[:, 0], acc[:, 2] = OMEGA_IE, -GAMMA_E
    >>> start = Start(lla=(0.0, 0.0, 0.0), q_nb=(1.0, 0.0, 0.0, 0.0))
    >>> sol = mechanise((t, gyr, acc), start, frame="wander")
    >>> bool(np.abs(sol.v_n).max() < 1e-9)
    True
    """
    return Mechanisation(
        frame=frame, attitude=attitude, earth=earth, gravity=gravity, samples=samples,
        compensate=compensate, height=height, sampling=sampling, max_gap=max_gap,
        heading_reference=heading_reference,
    ).run(rec, start)  # fmt: skip


_POLE_ADVICE: Final = (
    "north turns too fast there: use frame='wander', which keeps local level axes, or 'ecef'"
)
_LOCK_ADVICE: Final = "use attitude='quaternion' or 'dcm', which have no such place"


def _lock_text(frame: str) -> str:
    axis = {"ned": "down", "wander": "down"}.get(frame, "the Earth's axis")
    return f"gimbal lock (the body's x axis within 0.06 deg of {axis})"


def _row(x: FloatArray, p: FloatArray, flags: int) -> FloatArray:
    """Return time, the ten outputs and the status of a state."""
    from strapdown.kernels.mechanisation.run import tell

    w = np.zeros(k.W_SIZE)
    tell(x, p, w)
    return np.concatenate((x[k.T : k.T + 1], w[k.OUT : k.OUT + 10], [flags]))[np.newaxis]
