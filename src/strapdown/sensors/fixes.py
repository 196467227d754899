"""GNSS receiver and star tracker: sensors of position and of attitude."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray
from strapdown.earth import (
    dcm_ne,
    earth_rate_n,
    ecef_from_lla,
    lla_from_ecef,
    transport_rate_n,
)
from strapdown.recording import Gnss, Star
from strapdown.rotation import dcm_from_quat, quat_from_rotvec, quat_mul, slerp
from strapdown.sensors.noise import Noise
from strapdown.sensors.sampling import Sampling
from strapdown.sensors.settings import Quantity
from strapdown.truth import Truth

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssFix:
    """Position and velocity of a GNSS receiver's antenna.

    Parameters
    ----------
    sampling : Sampling
        Rate, jitter, dropouts; no low-pass and no mean.
    std_position : tuple of float
        Standard deviation of each fix, north, east, down [m], new at every fix.
    std_velocity : tuple of float
        The same of the velocity [m/s].
    wander : tuple of float
        Standard deviation of the slow error that neighbouring fixes share [m].
    wander_time : float
        Its correlation time [s].
    lever_arm_b : tuple of float
        From the IMU to the antenna, in the axes of the box [m].
    latency : float
        How much later than its validity a fix is stamped [s]; a fault that a log may have.
    outage : float
        Length of the regular losses of signal [s]; zero switches them off.
    outage_every : float
        From one loss to the next [s].
    first_outage : float
        When the first begins [s].
    heading_from : float
        Speed from which on the heading follows the course; below, the last one is repeated
        [m/s].
    """

    sampling: Sampling = field(default_factory=lambda: Sampling(rate=1.0))
    std_position: Annotated[Triple, Quantity("length")] = (1.5, 1.5, 3.0)
    std_velocity: Annotated[Triple, Quantity("speed")] = (0.05, 0.05, 0.1)
    wander: Annotated[Triple, Quantity("length")] = (0.0, 0.0, 0.0)
    wander_time: Annotated[float, Quantity("time")] = 60.0
    lever_arm_b: Annotated[Triple, Quantity("length")] = (0.0, 0.0, 0.0)
    latency: Annotated[float, Quantity("time")] = 0.0
    outage: Annotated[float, Quantity("time")] = 0.0
    outage_every: Annotated[float, Quantity("time")] = 100.0
    first_outage: Annotated[float, Quantity("time")] = 75.0
    heading_from: Annotated[float, Quantity("speed")] = 0.5

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("std_position", "std_velocity", "wander"):
            if (_checks.as_vector(name, getattr(self, name)) < 0.0).any():
                raise ValueError(f"`{name}` must be non-negative, got {getattr(self, name)}.")
        _checks.as_vector("lever_arm_b", self.lever_arm_b)
        for name in ("latency", "outage", "heading_from"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        _checks.positive("wander_time", self.wander_time)
        _checks.instance("sampling", self.sampling, Sampling)
        _checks.in_range("outage_every", self.outage_every, max(self.outage, 1e-9), np.inf)
        if self.sampling.bandwidth or self.sampling.average:
            raise ValueError("`sampling` of a GNSS fix must have no low-pass and no mean.")

    def apply(self, truth: Truth, rng: np.random.Generator) -> Gnss:
        """Return the fixes along a motion.

        Parameters
        ----------
        truth : Truth
            The motion.
        rng : numpy.random.Generator
            Source of the randomness.

        Returns
        -------
        Gnss
            With the standard deviations that were used, the slow part included.
        """
        tick_rng, noise_rng = rng.spawn(2)
        ticks = self.sampling.ticks(truth.t, tick_rng)
        lla, v_n = self._antenna(truth)
        lla, v_n = (self.sampling.sample(truth.t, x, ticks) for x in (lla, v_n))
        n, step = len(lla), self.sampling.step(truth.t)
        position_rng, velocity_rng, wander_rng = noise_rng.spawn(3)
        slow = Noise(gauss_markov=self.wander, gauss_markov_time=self.wander_time)
        error_n = np.array(self.std_position) * position_rng.standard_normal((n, 3))
        error_n = error_n + slow.sample(n, step, wander_rng)
        v_n = v_n + np.array(self.std_velocity) * velocity_rng.standard_normal((n, 3))
        std = np.hypot(self.std_position, self.wander)
        kept = ticks.kept & ~self._lost(ticks.t)
        return Gnss(
            t=(ticks.stamp + self.latency)[kept],
            lla=_moved(lla, error_n)[kept],
            v_n=v_n[kept],
            std_position_n=np.tile(std, (n, 1))[kept],
            std_velocity_n=np.tile(self.std_velocity, (n, 1))[kept],
            heading=self._courses(v_n)[kept],
        )

    def _antenna(self, truth: Truth) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity of the antenna."""
        if not any(self.lever_arm_b):
            return truth.lla, truth.v_n
        C_nb = dcm_from_quat(truth.q_nb)
        arm_b = np.array(self.lever_arm_b)
        turn_n = earth_rate_n(truth.lla[:, 0]) + transport_rate_n(truth.lla, truth.v_n)
        omega_nb_b = truth.omega_ib_b - np.einsum("kji,kj->ki", C_nb, turn_n)
        v_n = truth.v_n + np.einsum("kij,kj->ki", C_nb, np.cross(omega_nb_b, arm_b))
        return _moved(truth.lla, C_nb @ arm_b), v_n

    def _lost(self, t: FloatArray) -> BoolArray:
        """Return at which times there is no signal."""
        since = t - self.first_outage
        return np.asarray((since >= 0.0) & (np.mod(since, self.outage_every) < self.outage))

    def _courses(self, v_n: FloatArray) -> FloatArray:
        """Return the course, at low speed the last one; at first zero."""
        fast = np.hypot(v_n[:, 0], v_n[:, 1]) >= self.heading_from
        last = np.maximum.accumulate(np.where(fast, np.arange(len(v_n)), -1))
        course = np.arctan2(v_n[:, 1], v_n[:, 0])
        return np.where(last >= 0, course[last], 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class StarTracker:
    """Attitude of a star tracker.

    Parameters
    ----------
    sampling : Sampling
        Rate, delay, jitter, dropouts; no low-pass and no mean.
    std : tuple of float
        Standard deviation of the error about each axis of the box [rad].
    """

    sampling: Sampling = field(default_factory=lambda: Sampling(rate=1.0 / 3.0))
    std: Annotated[Triple, Quantity("angle")] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the values."""
        if (_checks.as_vector("std", self.std) < 0.0).any():
            raise ValueError(f"`std` must be non-negative, got {self.std}.")
        _checks.instance("sampling", self.sampling, Sampling)
        if self.sampling.bandwidth or self.sampling.average:
            raise ValueError("`sampling` of a star tracker must have no low-pass and no mean.")

    def apply(self, truth: Truth, rng: np.random.Generator) -> Star:
        """Return the attitudes along a motion, with the error on the side of the box."""
        tick_rng, noise_rng = rng.spawn(2)
        ticks = self.sampling.ticks(truth.t, tick_rng)
        when = np.clip(ticks.t - self.sampling.delay, truth.t[0], truth.t[-1])
        after = np.clip(np.searchsorted(truth.t, when), 1, max(len(truth.t) - 1, 1))
        before = np.minimum(after - 1, len(truth.t) - 1)
        after = np.minimum(after, len(truth.t) - 1)
        gap = truth.t[after] - truth.t[before]
        share = (when - truth.t[before]) / np.where(gap > 0.0, gap, 1.0)
        q_nb = slerp(truth.q_nb[before], truth.q_nb[after], share)
        error_b = np.array(self.std) * noise_rng.standard_normal((len(when), 3))
        q_nb = quat_mul(q_nb, quat_from_rotvec(error_b))
        return Star(t=ticks.stamp[ticks.kept], q_nb=q_nb[ticks.kept])


def _moved(lla: FloatArray, offset_n: FloatArray) -> FloatArray:
    """Return positions moved by metres in their own NED axes."""
    offset_e = np.einsum("kji,kj->ki", dcm_ne(lla), offset_n)
    return lla_from_ecef(ecef_from_lla(lla) + offset_e)
