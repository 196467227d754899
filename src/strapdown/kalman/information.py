"""Estimates in information form, where independent ones add.

``Y = P^-1`` may be singular: what is not known has no information, whereas its covariance would
be infinite. Source: thesis GNSS/INS theory, 3.2 and 3.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m
from strapdown.kalman.linear import Estimate

_RANK = 1e-12  # eigenvalues below this part of the largest are round-off


class Information(NamedTuple):
    """What is known of a state.

    Attributes
    ----------
    y : ndarray, shape (n,)
        ``Y m``, with the most likely state m.
    Y : ndarray, shape (n, n)
        Information matrix; zero where nothing is known.

    Examples
    --------
    Of two unknowns the first is measured, then their sum:

    >>> first = Information.from_measurement([2.0], [[1.0, 0.0]], [[0.1]])
    >>> first.rank, first.mean()
    (1, array([2., 0.]))
    >>> both = fuse(first, Information.from_measurement([5.0], [[1.0, 1.0]], [[0.1]]))
    >>> both.estimate().x.round(9)
    array([2., 3.])
    """

    y: FloatArray
    Y: FloatArray

    @classmethod
    def from_estimate(cls, x: ArrayLike, P: ArrayLike) -> "Information":
        """Return the information of an estimate.

        Parameters
        ----------
        x : array_like, shape (n,)
            State.
        P : array_like, shape (n, n)
            Its covariance, positive definite.

        Returns
        -------
        Information
        """
        state = _m.vector("x", x)
        Y = np.linalg.inv(_m.covariance("P", P, state.size, definite=True))
        Y = 0.5 * (Y + Y.T)
        return cls(Y @ state, Y)

    @classmethod
    def from_measurement(cls, z: ArrayLike, H: ArrayLike, R: ArrayLike) -> "Information":
        """Return the information of a measurement ``z = H x`` with noise of covariance R.

        ``y = H^T R^-1 z`` and ``Y = H^T R^-1 H`` (3.3.11). The source writes m = H^+ z (3.3.9),
        the same only for measurements that are no more than the states, or equally good.

        Parameters
        ----------
        z : array_like, shape (m,)
            What was measured.
        H : array_like, shape (m, n)
            Measurement matrix.
        R : array_like, shape (m, m)
            Covariance of the noise, positive definite.

        Returns
        -------
        Information
        """
        measured = _m.vector("z", z)
        rows = _m.matrix("H", H, measured.size)
        weighted = np.linalg.solve(
            _m.covariance("R", R, measured.size, definite=True),
            np.column_stack((rows, measured)),
        )
        Y = rows.T @ weighted[:, :-1]
        return cls(rows.T @ weighted[:, -1], 0.5 * (Y + Y.T))

    @property
    def rank(self) -> int:
        """Number of independent combinations of the state that are known."""
        values = np.linalg.eigvalsh(self.Y)
        return int((values > _RANK * max(values[-1], np.finfo(float).tiny)).sum())

    def mean(self) -> FloatArray:
        """Return the most likely state; of several the shortest, ``Y^+ y`` (3.2.15)."""
        return np.asarray(np.linalg.pinv(self.Y, rcond=_RANK, hermitian=True) @ self.y)

    def estimate(self) -> Estimate:
        """Return state and covariance.

        Returns
        -------
        Estimate

        Raises
        ------
        ValueError
            If a combination of the state is not known; the message shows one.
        """
        values, vectors = np.linalg.eigh(self.Y)
        if self.rank < len(self.y):
            unknown = np.round(vectors[:, 0], 3) + 0.0
            raise ValueError(
                f"`Y` must have full rank, got {self.rank} of {len(self.y)}: nothing is known "
                f"along {unknown.tolist()}; `mean` gives the shortest of the most likely states."
            )
        P = vectors @ np.diag(1.0 / values) @ vectors.T
        return Estimate(P @ self.y, 0.5 * (P + P.T))


def fuse(*parts: Information) -> Information:
    """Return what independent sources know together: ``Y = sum Y_i`` and ``y = sum y_i``.

    Parameters
    ----------
    *parts : Information
        Of the same state, with independent errors; (3.2.13) and (3.2.14).

    Returns
    -------
    Information

    Raises
    ------
    ValueError
        If there is none, or the sizes differ.

    Examples
    --------
    >>> one, two = Information.from_estimate([1], [[1]]), Information.from_estimate([2], [[0.25]])
    >>> fuse(one, two).estimate()
    Estimate(x=array([1.8]), P=array([[0.2]]))
    """
    sizes = {len(part.y) for part in parts}
    if len(sizes) != 1:
        got = f"sizes {sorted(sizes)}" if sizes else "none"
        raise ValueError(f"`parts` must be of one state, got {got}.")
    y = np.sum([part.y for part in parts], axis=0)
    return Information(np.asarray(y), np.asarray(np.sum([part.Y for part in parts], axis=0)))
