"""Noise with memory: shaping filters, and the state augmented by theirs.

A Kalman filter wants white noise. Noise that is correlated in time is white noise through a
filter; the filter's state is estimated, too. Source: thesis GNSS/INS theory, 3.8 to 3.10.
Misprints corrected: on the diagonal of (3.10.25) stand the transitions of the noises, not their
H; in (3.10.23) F_eps stands for F_xi.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m
from strapdown.kalman.discretise import van_loan

_MOST_AXES = 1000


class NoiseModel(NamedTuple):
    """A noise ``H xi`` made by a linear filter of white noise, continuous or discrete.

    Attributes
    ----------
    F : ndarray, shape (k, k)
        Dynamics [1/s] of xi; its transition where discrete.
    G : ndarray, shape (k, r)
        Distributes the white noise over xi.
    H : ndarray, shape (m, k)
        Makes the noise of xi.
    Q : ndarray, shape (r, r)
        Spectral density of the white noise; its covariance per step where discrete.
    P0 : ndarray, shape (k, k)
        Covariance of xi at the start.
    """

    F: FloatArray
    G: FloatArray
    H: FloatArray
    Q: FloatArray
    P0: FloatArray

    def discrete(self, dt: float) -> "NoiseModel":
        """Return the same noise in steps of dt [s], exactly."""
        Phi, Q = van_loan(self.F, self.Q, dt, G=self.G)
        return NoiseModel(Phi, np.eye(len(Phi)), self.H, Q, self.P0)


class Augmented(NamedTuple):
    """A model whose state includes those of its noises; names as in the model given.

    Attributes
    ----------
    F : ndarray
        Dynamics, or transition, of ``[x; xi_process; xi_measurement]``.
    G : ndarray
        Distributes ``[w; w_process; w_measurement]`` over it.
    H : ndarray
        Measurement matrix.
    Q : ndarray
        Density, or covariance, of the white noises.
    """

    F: FloatArray
    G: FloatArray
    H: FloatArray
    Q: FloatArray


def wiener(density: float, axes: int = 1, std: float = 0.0) -> NoiseModel:
    """Random walk, or Wiener process: what white noise integrates to (3.9.3).

    Parameters
    ----------
    density : float
        Root of its spectral density: deviation after one second [unit/sqrt(s)].
    axes : int
        Number of independent ones.
    std : float
        Deviation at the start [unit].

    Returns
    -------
    NoiseModel
        Continuous. Its variance grows by ``density^2`` every second.

    Examples
    --------
    >>> wiener(0.1).discrete(4.0).Q.round(9)
    array([[0.04]])
    """
    q = _checks.positive("density", density, allow_zero=True) ** 2
    p = _checks.positive("std", std, allow_zero=True) ** 2
    unit = np.eye(_checks.whole("axes", axes, 1, _MOST_AXES))
    return NoiseModel(0.0 * unit, unit, unit, q * unit, p * unit)


def gauss_markov(std: float, tau: float, axes: int = 1) -> NoiseModel:
    """First-order Gauss-Markov process: exponentially correlated noise (3.9.4) to (3.9.6).

    Parameters
    ----------
    std : float
        Its deviation, the same at all times [unit].
    tau : float
        Correlation time [s].
    axes : int
        Number of independent ones.

    Returns
    -------
    NoiseModel
        Continuous, with the density ``2 std^2 / tau``; `discrete` gives ``Phi = exp(-dt / tau)``
        and ``Q = std^2 (1 - exp(-2 dt / tau))``.

    Examples
    --------
    >>> model = gauss_markov(2.0, 10.0).discrete(10.0 * np.log(2.0))
    >>> model.F.round(9), model.Q.round(9)
    (array([[0.5]]), array([[3.]]))
    """
    p = _checks.positive("std", std) ** 2
    rate = 1.0 / _checks.positive("tau", tau)
    unit = np.eye(_checks.whole("axes", axes, 1, _MOST_AXES))
    return NoiseModel(-rate * unit, unit, unit, 2.0 * rate * p * unit, p * unit)


def augment(
    F: ArrayLike,
    G: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    *,
    process: NoiseModel | None = None,
    measurement: NoiseModel | None = None,
) -> Augmented:
    """Take the states of correlated noises into the state.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Dynamics of ``x' = F x + G (w + eps)``, or transition of a discrete model.
    G : array_like, shape (n, r)
        Distributes white noise w and correlated noise eps over the state.
    H : array_like, shape (m, n)
        Measurement matrix of ``z = H x + mu + v``.
    Q : array_like, shape (r, r)
        Density, or covariance, of the white noise w.
    process : NoiseModel, optional
        The correlated process noise eps; its H has r rows.
    measurement : NoiseModel, optional
        The correlated measurement noise mu; its H has m rows.

    Returns
    -------
    Augmented
        Continuous, (3.10.23) and (3.10.24), or discrete, (3.10.25) and (3.10.26), as the models
        are. The white measurement noise v stays as it is.

    Raises
    ------
    ValueError
        If shapes do not fit.

    Examples
    --------
    An angle from a rate whose bias wanders:

    >>> found = augment([[0.0]], [[1.0]], [[1.0]], [[1e-6]], process=wiener(1e-4))
    >>> found.F
    array([[0., 1.],
           [0., 0.]])
    >>> found.H
    array([[1., 0.]])
    """
    dynamics = _m.square("F", F)
    n = len(dynamics)
    spread, rows = _m.matrix("G", G, n), _m.matrix("H", H, columns=n)
    noise = _m.covariance("Q", Q, spread.shape[1])
    parts_F, parts_G, parts_Q = [dynamics], [spread], [noise]
    beside = [rows]
    if process is not None:
        _require_rows("process", process, spread.shape[1])
        parts_F.append(process.F)
        parts_G.append(process.G)
        parts_Q.append(process.Q)
        beside.append(np.zeros((len(rows), len(process.F))))
    if measurement is not None:
        _require_rows("measurement", measurement, len(rows))
        parts_F.append(measurement.F)
        parts_G.append(measurement.G)
        parts_Q.append(measurement.Q)
        beside.append(measurement.H)
    whole = _diagonal(parts_F)
    if process is not None:
        whole[:n, n : n + len(process.F)] = spread @ process.H
    return Augmented(whole, _diagonal(parts_G), np.hstack(beside), _diagonal(parts_Q))


def _require_rows(name: str, model: NoiseModel, count: int) -> None:
    """Refuse a noise of another number of components."""
    _checks.instance(name, model, NoiseModel)
    if len(model.H) != count:
        raise ValueError(
            f"`{name}` must make {count} noises, one for each it is added to, got {len(model.H)}; "
            "`axes` sets it."
        )


def _diagonal(parts: list[FloatArray]) -> FloatArray:
    """Return the block-diagonal matrix."""
    out = np.zeros(tuple(np.sum([part.shape for part in parts], axis=0)))
    i = j = 0
    for part in parts:
        out[i : i + part.shape[0], j : j + part.shape[1]] = part
        i, j = i + part.shape[0], j + part.shape[1]
    return out
