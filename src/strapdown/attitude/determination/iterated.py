"""Attitude by iteration from a start: gradient descent and Gauss-Newton.

Both minimise ``sum |h(q) - v_b|^2 / sigma^2``, where ``h(q) = C(q)^T v_n`` is what the reference
would look like from q. They differ in how h continues off the unit sphere: gradient descent
takes the form of thesis kinematic device, (29), Gauss-Newton the homogeneous one of thesis
GNSS/INS system, (2.6.42) transposed.
"""

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
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
from strapdown.rotation import quat_from_rotvec, quat_mul

_IDENTITY = (1.0, 0.0, 0.0, 0.0)
_FAR = 0.2  # Newton's step from an end that is not the minimum of all components [rad]
_KICK = 0.1  # turn that leaves a saddle of the loss [rad]


def gradient_descent(
    v_b: ArrayLike,
    v_n: ArrayLike,
    q_nb: ArrayLike = _IDENTITY,
    *,
    sigma: ArrayLike = 1.0,
    step: float = 0.1,
    tolerance: float = 1e-6,
    max_iterations: int = 2000,
    min_angle: float = MIN_ANGLE,
) -> Determination:
    """Attitude by gradient descent from any start.

    Each iteration goes ``q <- q - mu grad / |grad|`` (27), ``grad = J^T f`` (28), and normalises.
    The source's constant mu circles around the minimum at that distance; here mu is halved where
    the loss would not fall, and grows by half where it does.

    Parameters
    ----------
    v_b : array_like, shape (m, 3) or (n, m, 3)
        Two or more vectors in b, of any length. NaN or zero vectors are left out and flagged.
    v_n : array_like, shape (m, 3) or (n, m, 3)
        The same in n.
    q_nb : array_like, shape (4,) or (n, 4)
        Where to start.
    sigma : array_like, scalar, (m,) or (n, m)
        Standard deviation of each direction, about either axis across it [rad]. Its ratios are
        the weights; its size scales the covariance.
    step : float
        First mu, in components of the quaternion.
    tolerance : float
        It stops where the minimum is estimated to be so near [rad]: the length of Newton's step.
    max_iterations : int
        Epochs that need more are flagged, `NOT_CONVERGED`.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination
        That of Wahba's optimum, to `tolerance`.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has no unique attitude.
    NotConverged
        If a single epoch needs more iterations.

    Notes
    -----
    Vectorised. Slow where directions are near to parallel or sigmas differ: the iterations grow
    with the ratio of the largest to the least information. Where the gradient vanishes at a
    saddle, half a turn away from the minimum, it leaves along the negative curvature. Misprint
    corrected: ``q_3^3`` of (29) is ``q_3^2``; the matrices printed as ``J^T`` are J.

    References
    ----------
    .. [1] Thesis kinematic device, 4.2.2.2: (27) to (36).

    Examples
    --------
    >>> found = gradient_descent([[0, 0, -1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0]])
    >>> (np.abs(found.rpy) * 180 / np.pi).round(3)
    array([180.,   0.,   0.])
    """
    step = _checks.in_range("step", step, 1e-9, 1e3)
    _checks.positive("tolerance", tolerance)
    max_iterations = _checks.whole("max_iterations", max_iterations, 1)
    data = epochs(v_b, v_n, sigma, min_angle)
    q = _start(q_nb, data)
    mu = np.full(len(q), step)
    steps = np.zeros(len(q), dtype=np.int64)
    active = data.solvable
    cost = np.full(len(q), np.inf)
    cost[active] = _cost(rows_of(data, active), q[active])
    for _ in range(max_iterations):
        if not active.any():
            break
        part = rows_of(data, active)
        here, length = q[active], mu[active]
        f, J = _seen_on_sphere(part, here)
        gradient = np.einsum("nm,nmij,nmi->nj", part.weight, J, f)
        norm = np.linalg.norm(gradient, axis=1, keepdims=True)
        there = here - length[:, None] * gradient / np.where(norm > 0.0, norm, 1.0)
        there /= np.linalg.norm(there, axis=1, keepdims=True)
        cost_there = _cost(part, there)
        falls = cost_there < cost[active]
        q[active] = np.where(falls[:, None], there, here)
        cost[active] = np.where(falls, cost_there, cost[active])
        mu[active] = length * np.where(falls, 1.5, 0.5)
        steps[active] += 1
        newton, curvature, axis = newton_step(part, q[active])
        near = np.linalg.norm(newton, axis=1) < tolerance
        saddle = near & (curvature <= 0.0)
        if saddle.any():
            rows = np.flatnonzero(active)[saddle]
            q[rows] = quat_mul(quat_from_rotvec(_KICK * axis[saddle]), q[rows])
            cost[rows] = _cost(rows_of(data, rows), q[rows])
            mu[rows] = step
        active = active.copy()
        active[np.flatnonzero(active)[near & ~saddle]] = False
    status = data.status | np.where(active, int(Observability.NOT_CONVERGED), 0)
    return finish(data, q, optimal_covariance(data), status, steps)


def gauss_newton(
    v_b: ArrayLike,
    v_n: ArrayLike,
    q_nb: ArrayLike,
    *,
    sigma: ArrayLike = 1.0,
    components: ArrayLike | None = None,
    tolerance: float = 0.01,
    max_iterations: int = 20,
    min_angle: float = MIN_ANGLE,
) -> Determination:
    """Attitude by Gauss-Newton iteration from a start that is close.

    Each iteration solves for the four components of the quaternion, ``q <- q - (A^T A)^-1 A^T
    eps`` (7.6.9); the norm is free and is put right at the end.

    Parameters
    ----------
    v_b : array_like, shape (m, 3) or (n, m, 3)
        Two or more vectors in b, of any length: they are scaled to unit vectors. NaN or zero
        vectors are left out and flagged.
    v_n : array_like, shape (m, 3) or (n, m, 3)
        The same in n.
    q_nb : array_like, shape (4,) or (n, 4)
        Where to start.
    sigma : array_like, scalar, (m,) or (n, m)
        Standard deviation of each direction, about either axis across it [rad]. Its ratios are
        the weights, which the source leaves equal; its size scales the covariance.
    components : array_like of bool, shape (m, 3), optional
        Which components in b are used; all by default. The source does without the third of
        gravity: ``[[1, 1, 0], [1, 1, 1]]``.
    tolerance : float
        Stop rule: no component of q changes by so much. The default is the source's; what is
        left is then of the order of its square.
    max_iterations : int
        Epochs that need more are flagged, `NOT_CONVERGED`.
    min_angle : float
        Directions nearer to parallel, in b or in n, count as one [rad].

    Returns
    -------
    Determination
        The covariance is that of the components used.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or a single epoch has no unique attitude.
    NotConverged
        If a single epoch needs more iterations or ends where the loss has no minimum.

    Notes
    -----
    Vectorised. With five components and a free norm there are other solutions, and from a start
    off by more than some 40 deg it may end there. An end more than 0.2 rad from the minimum of
    the loss over all components is flagged; where gravity has hardly a third component the two
    solutions merge, and one that is nearer may be returned.

    References
    ----------
    .. [1] Thesis GNSS/INS system, 7.6.1: (7.6.2) to (7.6.9).

    Examples
    --------
    >>> found = gauss_newton([[0, 0, 1], [0, -1, 2]], [[0, 0, 1], [1, 0, 2]], [0.9, 0, 0, 0.436])
    >>> (found.rpy * 180 / np.pi).round(3), int(found.iterations)
    (array([ 0.,  0., 90.]), 3)
    """
    _checks.positive("tolerance", tolerance)
    max_iterations = _checks.whole("max_iterations", max_iterations, 1)
    data = epochs(v_b, v_n, sigma, min_angle)
    q = _start(q_nb, data)
    used = _components(components, data.b.shape[1])
    steps = np.zeros(len(q), dtype=np.int64)
    P = np.full((len(q), 3, 3), np.nan)
    active = data.solvable
    for _ in range(max_iterations):
        if not active.any():
            break
        rows = np.flatnonzero(active)
        part = rows_of(data, active)
        eps, A = _seen_homogeneous(part, q[rows])
        scale = np.sqrt(part.weight)[:, :, None] * used
        weighted = (scale[..., None] * A).reshape(len(rows), -1, 4)
        solved: FloatArray = np.asarray(np.linalg.pinv(weighted, rcond=1e-9), dtype=np.float64)
        change = -np.einsum("nij,nj->ni", solved, (scale * eps).reshape(len(rows), -1))
        q[rows] += change
        steps[rows] += 1
        done = np.abs(change).max(axis=1) < tolerance
        P[rows[done]] = _covariance(part, q[rows], scale, solved)[done]
        active = active.copy()
        active[rows[done]] = False
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    lost = active | ~(norm[:, 0] > 1e-3)
    q = np.where(lost[:, None], _IDENTITY, q / np.where(norm > 0.0, norm, 1.0))
    found = data.solvable & ~lost
    if found.any():
        step, curvature, _ = newton_step(rows_of(data, found), q[found])
        elsewhere = (curvature <= 0.0) | (np.linalg.norm(step, axis=1) > _FAR)
        lost[np.flatnonzero(found)[elsewhere]] = True
    status = data.status | np.where(lost, int(Observability.NOT_CONVERGED), 0)
    return finish(data, q, P, status, steps)


def _start(q_nb: ArrayLike, data: Epochs) -> FloatArray:
    """Return the start of each epoch, shape (n, 4)."""
    q = (
        _checks.as_quats("q_nb", q_nb)
        if _checks.as_floats("q_nb", q_nb).ndim != 1
        else _near_unit(q_nb)
    )
    n = len(data.b)
    if q.shape not in ((4,), (n, 4)):
        raise ValueError(f"`q_nb` must have shape (4,) or ({n}, 4), got {q.shape}.")
    return np.array(np.broadcast_to(q, (n, 4)))


def _near_unit(q_nb: ArrayLike) -> FloatArray:
    """Return one start, scaled: it needs no more than a direction."""
    q = _checks.as_vector("q_nb", q_nb, 4)
    norm = float(np.linalg.norm(q))
    if not norm > 0.0:
        raise ValueError("`q_nb` must not be zero, got a quaternion of norm 0.")
    return np.asarray(q / norm)


def _components(components: ArrayLike | None, m: int) -> FloatArray:
    """Return one where a component is used, zero elsewhere; shape (m, 3)."""
    if components is None:
        return np.ones((m, 3))
    used = _checks.as_floats("components", components)
    if used.shape != (m, 3):
        raise ValueError(f"`components` must have shape ({m}, 3), got {used.shape}.")
    used = used.astype(bool)
    if used.sum() < 4:
        raise ValueError(
            f"`components` must leave four at least, the unknowns of q, got {int(used.sum())}."
        )
    return np.asarray(used.astype(np.float64))


def _skew(v: FloatArray) -> FloatArray:
    """Return ``[v x]``, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(v, -1, 0)
    zero = np.zeros_like(x)
    rows = (zero, -z, y, z, zero, -x, -y, x, zero)
    return np.stack(rows, axis=-1).reshape(*v.shape[:-1], 3, 3)


def _seen(data: Epochs, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ``C(q)^T v_n`` less its term of ``v_n`` alone, and the derivative; as (n, m, 3)."""
    w, v, r = q[:, None, :1], q[:, None, 1:], data.n
    along = np.einsum("nmi,nmi->nm", np.broadcast_to(v, r.shape), r)[..., None]
    seen = 2.0 * v * along + 2.0 * w * np.cross(r, v)
    J = np.empty((*r.shape, 4))
    J[..., 0] = 2.0 * np.cross(r, v)
    J[..., 1:] = 2.0 * (
        along[..., None] * np.eye(3)
        + np.broadcast_to(v, r.shape)[..., :, None] * r[..., None, :]
        + w[..., None] * _skew(r)
    )
    return seen, J


def _seen_on_sphere(data: Epochs, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residuals (29), (n, m, 3), and Jacobian (30), (n, m, 3, 4)."""
    seen, J = _seen(data, q)
    v = q[:, 1:]
    f = data.n * (1.0 - 2.0 * np.einsum("ni,ni->n", v, v)[:, None, None]) + seen - data.b
    J[..., 1:] -= 4.0 * data.n[..., :, None] * v[:, None, None, :]
    return f, J


def _seen_homogeneous(data: Epochs, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residuals, (n, m, 3), and the matrix A of (7.6.7), (n, m, 3, 4)."""
    seen, J = _seen(data, q)
    w, v = q[:, :1], q[:, 1:]
    size = (w * w)[:, 0] - np.einsum("ni,ni->n", v, v)
    J[..., 0] += 2.0 * w[:, None] * data.n
    J[..., 1:] -= 2.0 * data.n[..., :, None] * v[:, None, None, :]
    return data.n * size[:, None, None] + seen - data.b, J


def _cost(data: Epochs, q: FloatArray) -> FloatArray:
    """Return half the weighted square of the residuals, shape (n,)."""
    f, _ = _seen_on_sphere(data, q)
    return np.asarray(0.5 * np.einsum("nm,nmi,nmi->n", data.weight, f, f))


def _covariance(data: Epochs, q: FloatArray, scale: FloatArray, solved: FloatArray) -> FloatArray:
    """Return the covariance of phi_n of the weighted least squares; (n, 3, 3).

    The noise of a unit vector lies across it: ``sigma^2 (I - b b^T)``.
    """
    n, m = data.weight.shape
    G = solved.reshape(n, 4, m, 3) * scale[:, None]  # dq = -G eps
    across = np.eye(3) - data.b[..., :, None] * data.b[..., None, :]
    noise = data.sigma[..., None, None] ** 2 * across
    cov_q = np.einsum("nami,nmij,nbmj->nab", G, noise, G)
    unit = q / np.linalg.norm(q, axis=1, keepdims=True)
    w, v = unit[:, :1], unit[:, 1:]
    E = np.empty((n, 3, 4))  # phi_n = 2 Im(dq q*)
    E[:, :, 0] = -2.0 * v
    E[:, :, 1:] = 2.0 * (w[..., None] * np.eye(3) + _skew(v))
    return np.asarray(np.einsum("nia,nab,njb->nij", E, cov_q, E))
