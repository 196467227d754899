"""Wahba's problem, solved three ways: the rotation that fits all directions best.

``sum |v_n - C_nb v_b|^2 / sigma^2`` over unit vectors is least where ``trace(C_nb^T B)``, with
``B = sum v_n v_b^T / sigma^2``, is largest: for the eigenvector q of the largest eigenvalue of
Davenport's 4x4 matrix K. All three find the same attitude and have the same covariance,
``(sum (I - v_n v_n^T) / sigma^2)^-1``.
"""

import numpy as np
from numpy.typing import ArrayLike

from strapdown._types import BoolArray, FloatArray
from strapdown.attitude.determination.result import (
    MIN_ANGLE,
    Determination,
    Epochs,
    Observability,
    epochs,
    finish,
    newton_step,
    optimal_covariance,
    rows_of,
)
from strapdown.rotation import quat_from_dcm, quat_from_rotvec, quat_mul

_TIE = 1e-13  # gap of the two largest eigenvalues of K that is round-off
_FLAT = 1e-7  # slope of the polynomial at its root, about four gaps, where Newton's root fails
_NEWTON_STEPS = 60


def davenport(
    v_b: ArrayLike, v_n: ArrayLike, *, sigma: ArrayLike = 1.0, min_angle: float = MIN_ANGLE
) -> Determination:
    """Attitude by Davenport's q-method: the eigenvector of a 4x4 matrix.

    Parameters
    ----------
    v_b : array_like, shape (m, 3) or (n, m, 3)
        Two or more vectors in b, of any length. NaN or zero vectors are left out and flagged.
    v_n : array_like, shape (m, 3) or (n, m, 3)
        The same in n.
    sigma : array_like, scalar, (m,) or (n, m)
        Standard deviation of each direction, about either axis across it [rad]. Its ratios are
        the weights; its size scales the covariance.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has no unique attitude.

    Notes
    -----
    Vectorised.

    References
    ----------
    .. [1] F. L. Markley, D. Mortari, "Quaternion attitude estimation using vector
           observations", J. Astronautical Sciences 48, 2000.

    Examples
    --------
    >>> found = davenport([[0, 0, 1], [0, -1, 0]], [[0, 0, 1], [1, 0, 0]])
    >>> np.abs(found.q_nb).round(6)
    array([0.707107, 0.      , 0.      , 0.707107])
    """
    data = epochs(v_b, v_n, sigma, min_angle)
    B, z = _profile(data)
    trace = np.einsum("nii->n", B)
    K = np.empty((len(B), 4, 4))
    K[:, 0, 0] = trace
    K[:, 0, 1:] = K[:, 1:, 0] = z
    K[:, 1:, 1:] = B + np.swapaxes(B, 1, 2) - trace[:, None, None] * np.eye(3)
    values, vectors = np.linalg.eigh(K)
    tie = values[:, 3] - values[:, 2] < _TIE
    return _finished(data, vectors[:, :, 3], tie)


def svd(
    v_b: ArrayLike, v_n: ArrayLike, *, sigma: ArrayLike = 1.0, min_angle: float = MIN_ANGLE
) -> Determination:
    """Attitude by Markley's singular value decomposition.

    Parameters
    ----------
    v_b : array_like, shape (m, 3) or (n, m, 3)
        Two or more vectors in b, of any length. NaN or zero vectors are left out and flagged.
    v_n : array_like, shape (m, 3) or (n, m, 3)
        The same in n.
    sigma : array_like, scalar, (m,) or (n, m)
        Standard deviation of each direction, about either axis across it [rad]. Its ratios are
        the weights; its size scales the covariance.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has no unique attitude.

    Notes
    -----
    Vectorised. The most robust of the three.

    References
    ----------
    .. [1] F. L. Markley, "Attitude determination using vector observations and the singular
           value decomposition", J. Astronautical Sciences 36(3), 1988.

    Examples
    --------
    >>> found = svd([[0, 0, 1], [0, -1, 0]], [[0, 0, 1], [1, 0, 0]])
    >>> (found.rpy * 180 / np.pi).round(6)
    array([ 0.,  0., 90.])
    """
    data = epochs(v_b, v_n, sigma, min_angle)
    B, _ = _profile(data)
    U, values, Vt = np.linalg.svd(np.where(data.solvable[:, None, None], B, np.eye(3)))
    sign = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    U[:, :, 2] *= sign[:, None]
    tie = 2.0 * (values[:, 1] + sign * values[:, 2]) < _TIE
    return _finished(data, quat_from_dcm(U @ Vt), tie)


def quest(
    v_b: ArrayLike, v_n: ArrayLike, *, sigma: ArrayLike = 1.0, min_angle: float = MIN_ANGLE
) -> Determination:
    """Attitude by Shuster's QUEST: Newton's root of the characteristic equation.

    The Gibbs vector that it solves for is infinite for turns by 180 deg. It is therefore sought
    in the reference frame as it is and turned by 180 deg about each of its axes (sequential
    rotations); the one farthest from the singularity counts.

    Parameters
    ----------
    v_b : array_like, shape (m, 3) or (n, m, 3)
        Two or more vectors in b, of any length. NaN or zero vectors are left out and flagged.
    v_n : array_like, shape (m, 3) or (n, m, 3)
        The same in n.
    sigma : array_like, scalar, (m,) or (n, m)
        Standard deviation of each direction, about either axis across it [rad]. Its ratios are
        the weights; its size scales the covariance.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has no unique attitude.

    Notes
    -----
    Vectorised. The characteristic polynomial loses digits where directions are nearly parallel or
    their sigmas very different: with the gap between the two largest eigenvalues of K, for
    weights that sum to one, the attitude would be off by some ``1e-16 / gap^2`` rad. Two Newton
    steps on the loss bring the digits back; below a gap of 3e-8 the epoch counts as ambiguous,
    which `svd` may still tell.

    References
    ----------
    .. [1] M. D. Shuster, S. D. Oh, "Three-axis attitude determination from vector
           observations", J. Guidance and Control 4(1), 1981.

    Examples
    --------
    >>> found = quest([[0, 0, -1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0]])  # upside down
    >>> np.abs(found.q_nb).round(6)
    array([0., 1., 0., 0.])
    """
    data = epochs(v_b, v_n, sigma, min_angle)
    B, _ = _profile(data)
    largest, slope = _largest_eigenvalue(B)
    q = np.zeros((len(B), 4))
    size = np.zeros(len(B))
    for axis in range(-1, 3):
        half_turn = np.ones(3) if axis < 0 else np.where(np.arange(3) == axis, 1.0, -1.0)
        candidate = _gibbs(half_turn[:, None] * B, largest)
        norm = np.linalg.norm(candidate, axis=1)
        farther = np.abs(candidate[:, 0]) > size
        size = np.where(farther, np.abs(candidate[:, 0]), size)
        if axis >= 0:  # turn back: the conjugate of i, j or k times the candidate
            candidate = _times_unit(candidate, axis)
        unit = candidate / np.where(norm > 0.0, norm, 1.0)[:, None]
        q = np.where(farther[:, None], unit, q)
    q[size == 0.0, 0] = 1.0
    flat = slope < _FLAT
    return _finished(data, _polished(data, q, data.solvable & ~flat), flat)


def _profile(data: Epochs) -> tuple[FloatArray, FloatArray]:
    """Return ``B`` of weights that sum to one, and ``sum w v_b x v_n``."""
    total = data.weight.sum(axis=1, keepdims=True)
    w = data.weight / np.where(total > 0.0, total, 1.0)
    B = np.einsum("nm,nmi,nmj->nij", w, data.n, data.b)
    return B, _axial(B)


def _axial(B: FloatArray) -> FloatArray:
    """Return ``sum w v_b x v_n`` of ``B = sum w v_n v_b^T``."""
    return np.stack(
        (B[:, 2, 1] - B[:, 1, 2], B[:, 0, 2] - B[:, 2, 0], B[:, 1, 0] - B[:, 0, 1]), axis=1
    )


def _finished(data: Epochs, q: FloatArray, tie: BoolArray) -> Determination:
    """Flag ties among the solvable epochs and finish."""
    ambiguous = np.where(data.solvable & tie, int(Observability.AMBIGUOUS), 0)
    return finish(data, q, optimal_covariance(data), data.status | ambiguous)


def _invariants(B: FloatArray) -> tuple[FloatArray, ...]:
    """Return S, z, trace of B, trace of the adjoint of S, and determinant of S."""
    S = B + np.swapaxes(B, 1, 2)
    sigma = np.einsum("nii->n", B)
    kappa = 2.0 * sigma**2 - 0.5 * np.einsum("nij,nij->n", S, S)
    return S, _axial(B), sigma, kappa, np.linalg.det(S)


def _largest_eigenvalue(B: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Newton's root from above, and the slope of the polynomial there; each (n,)."""
    S, z, sigma, kappa, det = _invariants(B)
    Sz = np.einsum("nij,nj->ni", S, z)
    a, b = sigma**2 - kappa, sigma**2 + np.einsum("ni,ni->n", z, z)
    c = det + np.einsum("ni,ni->n", z, Sz)
    d = np.einsum("ni,ni->n", Sz, Sz)
    x = np.ones(len(B))  # the sum of the weights: no eigenvalue is larger
    slope = np.ones(len(B))
    for _ in range(_NEWTON_STEPS):
        value = ((x * x - a - b) * x - c) * x + a * b + c * sigma - d
        slope = (4.0 * x * x - 2.0 * (a + b)) * x - c
        step = value / np.where(np.abs(slope) > 0.0, slope, np.inf)
        x = x - step
        if np.abs(step).max(initial=0.0) < 1e-16:
            break
    return x, slope


def _gibbs(B: FloatArray, largest: FloatArray) -> FloatArray:
    """Return the eigenvector of K to its largest eigenvalue, not normalised, shape (n, 4)."""
    S, z, sigma, kappa, det = _invariants(B)
    alpha = largest**2 - sigma**2 + kappa
    beta = largest - sigma
    Sz = np.einsum("nij,nj->ni", S, z)
    x = alpha[:, None] * z + beta[:, None] * Sz + np.einsum("nij,nj->ni", S, Sz)
    gamma = (largest + sigma) * alpha - det
    return np.concatenate((gamma[:, None], x), axis=1)


def _polished(data: Epochs, q: FloatArray, which: BoolArray) -> FloatArray:
    """Return attitudes after two Newton steps on the loss."""
    if which.any():
        part = rows_of(data, which)
        for _ in range(2):
            step, _, _ = newton_step(part, q[which])
            q[which] = quat_mul(quat_from_rotvec(step), q[which])
    return q


def _times_unit(q: FloatArray, axis: int) -> FloatArray:
    """Return ``e* q`` with e the unit quaternion i, j or k of the axis."""
    e = np.zeros(3)
    e[axis] = -1.0
    return np.concatenate((-(q[:, 1:] @ e)[:, None], q[:, :1] * e + np.cross(e, q[:, 1:])), axis=1)
