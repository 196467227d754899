"""What an estimator remembers, and its stateful form for real-time code."""

import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kernels import memory as _m

if TYPE_CHECKING:
    from strapdown.estimator import Estimator

NO_VECTOR: Final[FloatArray] = np.empty(0)
ABSENT: Final[FloatArray] = np.full(3, np.inf)  # no sample, as against a bad one


class State(NamedTuple):
    """All that an estimator remembers between two samples.

    ``np.savez(file, **state._asdict())`` saves it, ``State(**np.load(file))`` restores it.

    Attributes
    ----------
    name : str
        Registry name of the estimator it belongs to.
    x : ndarray, shape (m,)
        Its memory; `strapdown.kernels.memory` names the cells.
    P : ndarray, shape (s, s)
        Covariance of its error state, (0, 0) if it has none.
    """

    name: str
    x: FloatArray
    P: FloatArray

    @property
    def t(self) -> float:
        """Time of the last sample used [s]; NaN before the first."""
        return float(self.x[_m.T])

    @property
    def q_nb(self) -> FloatArray:
        """Attitude, body to NED, shape (4,)."""
        return self.x[_m.Q : _m.Q + 4].copy()

    @property
    def gyr_bias(self) -> FloatArray:
        """Gyro bias in b, shape (3,) [rad/s]."""
        return self.x[_m.BG : _m.BG + 3].copy()

    @property
    def status(self) -> int:
        """`Status` bits of the last sample."""
        return int(self.x[_m.STATUS])


class Tracker:
    """The stateful form of an estimator, for real-time code: one call per sample.

    Parameters
    ----------
    estimator : Estimator
        Whose parameters and kernel it uses.
    state : State, optional
        Where to begin; knows nothing by default.
    """

    __slots__ = ("_P", "_name", "_p", "_q", "_t", "_update", "_w", "_x")

    def __init__(self, estimator: "Estimator", state: State | None = None) -> None:
        state = estimator._own(estimator.init() if state is None else state)
        self._update, self._p, self._w = estimator._ready()
        self._name, self._x, self._P = state.name, state.x.copy(), state.P.copy()
        self._t = -math.inf if math.isnan(state.t) else state.t
        self._q = self._x[_m.Q : _m.Q + 4]  # a view

    def update(
        self,
        t: float,
        gyr: ArrayLike | None,
        acc: ArrayLike | None,
        mag: ArrayLike | None = None,
    ) -> None:
        """Feed one sample.

        Parameters
        ----------
        t : float
            Time [s], later than that of the sample before.
        gyr : array_like, shape (3,), or None
            Angular rate [rad/s]; float64 arrays are the quickest. None where a slower
            gyroscope has no new sample.
        acc : array_like, shape (3,), or None
            Specific force [m/s^2]; None where a slower accelerometer has no new sample.
        mag : array_like, shape (3,), optional
            Magnetic field [T], if there is a new one.

        Raises
        ------
        ValueError
            If time does not increase or a vector has not three components.
        """
        if not self._t < t < math.inf:
            raise ValueError(f"`t` must increase, got {t} after {self._t}.")
        if mag is None:
            mag = NO_VECTOR
        if acc is None:
            acc = ABSENT
        if gyr is None:
            gyr = ABSENT
        try:
            ok = self._update(self._x, self._P, self._p, self._w, t, gyr, acc, mag)
        except TypeError:  # not float64 vectors
            t, gyr, acc, mag = as_kernel_input(t, gyr, acc, mag)
            ok = self._update(self._x, self._P, self._p, self._w, t, gyr, acc, mag)
        if not ok:
            raise wrong_lengths(gyr, acc, mag)
        self._t = t

    @property
    def state(self) -> State:
        """A copy of what it remembers."""
        return State(self._name, self._x.copy(), self._P.copy())

    @property
    def q_nb(self) -> FloatArray:
        """Attitude, body to NED, shape (4,)."""
        return self._q.copy()

    @property
    def gyr_bias(self) -> FloatArray:
        """Gyro bias in b, shape (3,) [rad/s]."""
        return self._x[_m.BG : _m.BG + 3].copy()

    @property
    def status(self) -> int:
        """`Status` bits of the last sample."""
        return int(self._x[_m.STATUS])


def as_kernel_input(
    t: float, gyr: ArrayLike, acc: ArrayLike, mag: ArrayLike
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Return a sample in the types that kernels are compiled for."""
    if np.shape(mag) == (0,):
        mag = NO_VECTOR
    else:
        mag = np.array(_checks.as_vector("mag", mag, allow_nan=True))
    return (
        _checks.finite("t", t),
        gyr if gyr is ABSENT else np.array(_checks.as_vector("gyr", gyr, allow_nan=True)),
        acc if acc is ABSENT else np.array(_checks.as_vector("acc", acc, allow_nan=True)),
        mag,
    )


def wrong_lengths(*vectors: Any) -> ValueError:
    """Return the error for vectors that have not three components."""
    shapes = ", ".join(str(np.shape(v)) for v in vectors)
    return ValueError(f"`gyr`, `acc` and `mag` must have shape (3,), got {shapes}.")
