"""The random errors of a sensor: turn-on bias, drifts, flicker and white noise.

Coefficients are those of the Allan deviation, per axis: N (white), B (flicker, the bias
instability), K (random walk of the bias). The sampled processes are

* white: standard deviation ``N / sqrt(dt)`` (thesis A, equation 5.10);
* random walk: steps of standard deviation ``K sqrt(dt)`` (A 5.6 and 5.13);
* Gauss-Markov: ``b' = -b / tau + w``, stationary, exactly discretised (A 5.2 and 5.3);
* flicker: white noise of standard deviation B through the filter ``(1 - z^-1)^(-1/2)`` [1]_, whose
  two-sided power density ``B^2 dt / (2 sin(pi f dt))`` goes to ``B^2 / (2 pi f)`` at low
  frequency; the Allan deviation then has its floor at ``sqrt(2 ln 2 / pi) B = 0.664 B`` (A 5.11).

References
----------
.. [1] N. J. Kasdin, "Discrete simulation of colored noise and stochastic processes and 1/f^alpha
       power law noise generation", Proc. IEEE 83(5), 1995.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.sensors.settings import Quantity

PerAxis = float | tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Random errors; zero switches each of them off.

    Every value is one number for all axes, or one per axis.

    Parameters
    ----------
    turn_on : float or tuple of float
        Standard deviation of the bias that is drawn anew at every start [SI].
    white : float or tuple of float
        N: density of the white noise [SI/sqrt(Hz)].
    flicker : float or tuple of float
        B: bias instability [SI]; the Allan deviation's floor divided by 0.664.
    random_walk : float or tuple of float
        K: random walk of the bias [SI sqrt(Hz)].
    gauss_markov : float or tuple of float
        Standard deviation of an exponentially correlated bias [SI].
    gauss_markov_time : float or tuple of float
        Its correlation time [s].
    """

    turn_on: Annotated[PerAxis, Quantity("@value")] = 0.0
    white: Annotated[PerAxis, Quantity("@density")] = 0.0
    flicker: Annotated[PerAxis, Quantity("@value")] = 0.0
    random_walk: Annotated[PerAxis, Quantity("@walk")] = 0.0
    gauss_markov: Annotated[PerAxis, Quantity("@value")] = 0.0
    gauss_markov_time: Annotated[PerAxis, Quantity("time")] = 100.0

    def __post_init__(self) -> None:
        """Check that nothing is negative."""
        for name in ("turn_on", "white", "flicker", "random_walk", "gauss_markov"):
            for value in _values(getattr(self, name)):
                _checks.positive(name, value, allow_zero=True)
        for value in _values(self.gauss_markov_time):
            _checks.positive("gauss_markov_time", value)

    def without_white(self) -> "Noise":
        """Return all of it but the white noise."""
        return replace(self, white=0.0)

    def sample(self, n: int, dt: float, rng: np.random.Generator, width: int = 3) -> FloatArray:
        """Return one realisation.

        Parameters
        ----------
        n : int
            Samples.
        dt : float
            Time from one to the next [s].
        rng : numpy.random.Generator
            Source of the randomness.
        width : int
            Axes.

        Returns
        -------
        ndarray, shape (n, width)
            Turn-on bias, drifts, flicker and white noise added up [SI].

        Raises
        ------
        ValueError
            If a value has another number of axes than `width`.
        """
        _checks.whole("n", n, 0)
        _checks.positive("dt", dt)
        total = np.zeros((n, width))
        turn_on, white = self._axes("turn_on", width), self._axes("white", width)
        flicker, walk = self._axes("flicker", width), self._axes("random_walk", width)
        markov, tau = self._axes("gauss_markov", width), self._axes("gauss_markov_time", width)
        # each process has its own numbers, so that switching one off leaves the others alone
        on_rng, white_rng, flicker_rng, walk_rng, markov_rng = rng.spawn(5)
        total += turn_on * on_rng.standard_normal(width)
        if white.any():
            total += white / math.sqrt(dt) * white_rng.standard_normal((n, width))
        if walk.any():
            total += np.cumsum(walk_rng.standard_normal((n, width)), axis=0) * (
                walk * math.sqrt(dt)
            )
        for axis in range(width):
            if flicker[axis]:
                total[:, axis] += flicker[axis] * pink(n, flicker_rng)
            if markov[axis]:
                total[:, axis] += markov[axis] * _markov(n, dt / tau[axis], markov_rng)
        return total

    def _axes(self, name: str, width: int) -> FloatArray:
        values = _values(getattr(self, name))
        if len(values) not in (1, width):
            raise ValueError(f"`{name}` must hold 1 or {width} values, got {len(values)}.")
        return np.broadcast_to(np.array(values, dtype=np.float64), (width,))


def pink(n: int, rng: np.random.Generator) -> FloatArray:
    """Return n samples of 1/f noise of unit bias instability, shape (n,), starting at rest."""
    from scipy.signal import fftconvolve

    k = np.arange(1.0, max(n, 1))
    impulse = np.cumprod(np.concatenate(([1.0], (k - 0.5) / k)))[:n]
    out: FloatArray = fftconvolve(rng.standard_normal(n), impulse)[:n] if n else np.zeros(0)
    return out


def _markov(n: int, step: float, rng: np.random.Generator) -> FloatArray:
    """Return a stationary first-order Gauss-Markov process of unit variance."""
    from scipy.signal import lfilter

    keep = math.exp(-step)
    drive = rng.standard_normal(n) * math.sqrt(-math.expm1(-2.0 * step))
    if n:
        drive[0] = rng.standard_normal()
    out: FloatArray = lfilter([1.0], [1.0, -keep], drive)
    return out


def _values(value: PerAxis) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, (tuple, list)) else (value,)
