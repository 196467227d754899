"""TRIAD: the first direction is kept, the second only says how it is turned about the first."""

import numpy as np
from numpy.typing import ArrayLike

from strapdown._types import FloatArray
from strapdown.attitude.determination.result import (
    MIN_ANGLE,
    Determination,
    covariance_of_rows,
    epochs,
    finish,
)
from strapdown.rotation import quat_from_dcm


def triad(
    v_b: ArrayLike, v_n: ArrayLike, *, sigma: ArrayLike = 1.0, min_angle: float = MIN_ANGLE
) -> Determination:
    """Attitude from two directions, the first of which is met exactly.

    Parameters
    ----------
    v_b : array_like, shape (2, 3) or (n, 2, 3)
        The two vectors in b, of any length, the more trusted one first. At rest the specific
        force points up: its negative is the direction down.
    v_n : array_like, shape (2, 3) or (n, 2, 3)
        The same in n.
    sigma : array_like, scalar, (2,) or (n, 2)
        Standard deviation of each direction, about either axis across it [rad]. It sets the
        covariance only; of 1, the default, the covariance is to be multiplied by sigma^2.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has one direction only.

    Notes
    -----
    Vectorised. With ``c``, ``s`` cosine and sine of the angle between the two, and axes along the
    first, across in their plane (h) and normal to it (e), the errors are ``phi_h``, ``phi_e`` of
    sigma_1, and ``s phi_1 - c phi_h`` of sigma_2: the covariance follows.

    References
    ----------
    .. [1] M. D. Shuster, S. D. Oh, "Three-axis attitude determination from vector
           observations", J. Guidance and Control 4(1), 1981.

    Examples
    --------
    A level box that heads east; down, and a field of 60 deg dip:

    >>> found = triad([[0, 0, 1], [0, -1, 1.732]], [[0, 0, 1], [1, 0, 1.732]], sigma=0.01)
    >>> (found.rpy * 180 / np.pi).round(6)
    array([ 0.,  0., 90.])
    >>> (found.std_n * 180 / np.pi).round(2)  # heading suffers from the dip
    array([0.57, 0.57, 1.52])
    """
    data = epochs(v_b, v_n, sigma, min_angle, exactly=2)
    axes_b, axes_n = _axes(data.b), _axes(data.n)
    C_nb = np.einsum("nki,nkj->nij", axes_n, axes_b)
    C_nb = np.where(data.solvable[:, None, None], C_nb, np.eye(3))
    P = anchored_covariance(data.n[:, 0], data.n[:, 1], data.sigma)
    return finish(data, quat_from_dcm(C_nb), P, data.status)


def anchored_covariance(first: FloatArray, second: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the covariance of phi_n where the first direction is met exactly; (n, 3, 3)."""
    axis, h, e = np.moveaxis(_axes(np.stack((first, second), axis=1)), 1, 0)
    c = np.einsum("ni,ni->n", first, second)[:, None]
    s = np.einsum("ni,ni->n", h, second)[:, None]
    rows = np.stack((h, e, s * axis - c * h), axis=1)
    variance = np.stack((sigma[:, 0], sigma[:, 0], sigma[:, 1]), axis=1) ** 2
    return covariance_of_rows(rows, variance)


def _axes(pair: FloatArray) -> FloatArray:
    """Return rows along the first vector, across it towards the second, and normal to both."""
    first, second = pair[:, 0], pair[:, 1]
    e = np.cross(first, second)
    norm = np.linalg.norm(e, axis=-1, keepdims=True)
    e = e / np.where(norm > 0.0, norm, 1.0)
    return np.stack((first, np.cross(e, first), e), axis=1)
