"""Real-time form of a navigation filter: sample by sample, with fixes that come late."""

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.estimator import State, Tracker
from strapdown.kernels import memory as _m

if TYPE_CHECKING:
    from strapdown.estimator import Estimator

_EVERY = 0.5  # between two snapshots [s]


class _Sample:
    """One IMU sample and the aiding that takes effect at it, in order of time."""

    __slots__ = ("acc", "aiding", "gyr", "mag", "t")

    def __init__(self, t: float, gyr: FloatArray, acc: FloatArray, mag: FloatArray) -> None:
        self.t, self.gyr, self.acc, self.mag = t, gyr, acc, mag
        self.aiding: list[tuple[float, int, FloatArray]] = []


class NavigationTracker(Tracker):
    """The stateful form of navigation filters: IMU samples and aiding, late if need be.

    Aiding that is older than the last IMU sample goes to the sample where it belonged: the
    filter steps back to a snapshot before it and repeats the samples since. The result is that
    of aiding in time, bit for bit; the price is one step per repeated sample.

    Parameters
    ----------
    estimator : Estimator
        Whose parameters and kernel it uses.
    state : State, optional
        Where to begin; knows nothing by default.
    history : float
        How late aiding may be [s]. What is older is dropped and counted in `dropped`.
    """

    __slots__ = ("_pending", "_samples", "_snapshots", "dropped", "history")

    def __init__(
        self, estimator: "Estimator", state: State | None = None, history: float = 3.0
    ) -> None:
        super().__init__(estimator, state)
        self.history = _checks.positive("history", history, allow_zero=True)
        self.dropped = 0
        self._samples: list[_Sample] = []
        self._snapshots: list[tuple[float, FloatArray, FloatArray]] = []
        self._pending: list[tuple[float, int, FloatArray]] = []

    def add_gnss(
        self,
        t: float,
        lla: ArrayLike,
        v_n: ArrayLike | None = None,
        std_position_n: ArrayLike | None = None,
        std_velocity_n: ArrayLike | None = None,
    ) -> None:
        """Hand over a fix; it takes effect at the first IMU sample that is not before it.

        Parameters
        ----------
        t : float
            Time of validity [s]; may be before the last IMU sample and before other fixes.
        lla : array_like, shape (3,)
            Latitude, longitude, height [rad, rad, m].
        v_n : array_like, shape (3,), optional
            Velocity, NED [m/s].
        std_position_n, std_velocity_n : array_like, shape (3,), optional
            Sigmas that the receiver states [m], [m/s].
        """
        t = _checks.finite("t", t)
        values = np.full(14, np.nan)
        values[0] = t
        for at, name, value in (
            (1, "lla", lla),
            (4, "v_n", v_n),
            (7, "std_position_n", std_position_n),
            (10, "std_velocity_n", std_velocity_n),
        ):
            if value is not None:
                values[at : at + 3] = _checks.as_vector(name, value, allow_nan=True)
        self._add(t, _m.GNSS, values)

    def add_speed(self, t: float, speed: float) -> None:
        """Hand over a wheel speed [m/s] of time `t` [s]."""
        self._add(_checks.finite("t", t), _m.SPEED, np.array([float(speed)]))

    def add_pressure(self, t: float, pressure: float) -> None:
        """Hand over a static pressure [Pa] of time `t` [s]."""
        self._add(_checks.finite("t", t), _m.BARO, np.array([float(pressure)]))

    def update(
        self,
        t: float,
        gyr: ArrayLike | None,
        acc: ArrayLike | None,
        mag: ArrayLike | None = None,
    ) -> None:
        """Feed one IMU sample.

        Parameters
        ----------
        t : float
            Time [s], later than that of the sample before.
        gyr : array_like, shape (3,), or None
            Angular rate [rad/s]; None where a slower gyroscope has no new sample: the last one
            is held.
        acc : array_like, shape (3,), or None
            Specific force [m/s^2]; None where a slower accelerometer has no new sample.
        mag : array_like, shape (3,), optional
            Field [T], if there is a new one and the filter uses it.

        Raises
        ------
        ValueError
            If time does not increase or a vector has not three components.
        """
        t = _checks.finite("t", t)
        if not t > self._t:
            raise ValueError(f"`t` must increase, got {t} after {self._t}.")
        if gyr is None:
            gyr = self._samples[-1].gyr if self._samples else np.full(3, np.nan)
        sample = _Sample(
            t,
            _checks.as_vector("gyr", gyr, allow_nan=True).copy(),
            np.full(3, np.inf)
            if acc is None
            else _checks.as_vector("acc", acc, allow_nan=True).copy(),
            _NO_FIELD if mag is None else _checks.as_vector("mag", mag, allow_nan=True).copy(),
        )
        self._pending.sort(key=lambda item: item[0])
        while self._pending and self._pending[0][0] <= t:
            sample.aiding.append(self._pending.pop(0))
        if not self._snapshots or t >= self._snapshots[-1][0] + _EVERY:
            self._snapshots.append((self._t, self._x.copy(), self._P.copy()))
            self._forget(t)
        self._samples.append(sample)
        self._take(sample)
        self._t = t

    @property
    def lla(self) -> FloatArray:
        """Latitude, longitude, height of the IMU [rad, rad, m]; NaN before the first fix."""
        return self._x[_m.LLA : _m.LLA + 3].copy()

    @property
    def v_n(self) -> FloatArray:
        """Velocity over ground, NED [m/s]; NaN before the first fix."""
        return self._x[_m.V : _m.V + 3].copy()

    @property
    def q_vb(self) -> FloatArray:
        """Mount, body to vehicle, shape (4,)."""
        return self._x[_m.Q_VB : _m.Q_VB + 4].copy()

    def _add(self, t: float, cell: int, values: FloatArray) -> None:
        """Put aiding where it belongs: before a sample to come, or back into the history."""
        item = (t, cell, values)
        if not self._samples or t > self._samples[-1].t:
            self._pending.append(item)
            return
        times = [sample.t for sample in self._samples]
        at = bisect_left(times, t)
        snapshot = max(
            (i for i, (before, _, _) in enumerate(self._snapshots) if before < times[at]),
            default=-1,
        )
        if t < times[0] or snapshot < 0 or times[-1] - t > self.history:
            self.dropped += 1
            return
        aiding = self._samples[at].aiding
        aiding.append(item)
        aiding.sort(key=lambda entry: entry[0])
        before, x, P = self._snapshots[snapshot]
        del self._snapshots[snapshot + 1 :]
        self._x[:] = x
        self._P[:] = P
        latest = before
        for sample in self._samples[bisect_left(times, np.nextafter(before, np.inf)) :]:
            if sample.t >= self._snapshots[-1][0] + _EVERY and latest > self._snapshots[-1][0]:
                self._snapshots.append((latest, self._x.copy(), self._P.copy()))
            self._take(sample)
            latest = sample.t

    def _take(self, sample: _Sample) -> None:
        """Run the kernel on one sample with its aiding; of one kind the latest counts."""
        for _, cell, values in sample.aiding:
            self._x[cell] = 1.0
            self._x[cell + 1 : cell + 1 + len(values)] = values
        self._update(
            self._x, self._P, self._p, self._w, sample.t, sample.gyr, sample.acc, sample.mag
        )

    def _forget(self, t: float) -> None:
        """Drop history that no late aiding can need."""
        while len(self._snapshots) > 2 and self._snapshots[1][0] < t - self.history:
            del self._snapshots[0]
        oldest = self._snapshots[0][0]
        keep = bisect_left([sample.t for sample in self._samples], np.nextafter(oldest, np.inf))
        del self._samples[:keep]


_NO_FIELD: FloatArray = np.empty(0)
