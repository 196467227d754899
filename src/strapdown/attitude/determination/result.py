"""What a determination returns, and what all of them do before and after."""

import math
from dataclasses import dataclass
from enum import IntFlag, unique
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.errors import NotConverged
from strapdown.rotation import dcm_from_quat, rpy_from_quat

MIN_ANGLE = 1e-3  # directions nearer to parallel count as one [rad]


@unique
class Observability(IntFlag):
    """What the vectors of an epoch determine; zero: the attitude, from all of them.

    Attributes
    ----------
    MISSING
        A vector is NaN or zero and was left out; the others suffice.
    ONE_DIRECTION
        What is left points along one line: the turn about it is open. No attitude.
    HEADING_OPEN
        Tilt only, by design: yaw is zero, and its covariance NaN.
    SINGULAR
        The method, not the geometry, has a singularity here: the attitude is given, its
        covariance is NaN.
    AMBIGUOUS
        Two different attitudes fit equally well. No attitude.
    NOT_CONVERGED
        The iteration found no minimum. No attitude.
    """

    MISSING = 1
    ONE_DIRECTION = 2
    HEADING_OPEN = 4
    SINGULAR = 8
    AMBIGUOUS = 16
    NOT_CONVERGED = 32


_UNSOLVED = Observability.ONE_DIRECTION | Observability.AMBIGUOUS | Observability.NOT_CONVERGED


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Determination:
    """Attitudes found from directions, one per epoch.

    For a single epoch the leading dimension n is left out.

    Attributes
    ----------
    q_nb : ndarray, shape (n, 4)
        Attitude, body to NED (or to whatever frame the references are given in), ``w >= 0``;
        NaN where there is none.
    covariance_n : ndarray, shape (n, 3, 3)
        Covariance of the attitude error phi_n [rad^2], ``q_true = exp(phi_n) q_nb``: turns
        about north, east, down. NaN where it is open.
    loss : ndarray, shape (n,)
        Wahba's ``1/2 sum |v_n - C_nb v_b|^2 / sigma^2`` over the unit vectors. Twice of it is
        chi-square with 2 m - 3 degrees of freedom for the optimal methods, if sigma is true.
    status : ndarray of int, shape (n,)
        Bits of `Observability`; zero where all is well.
    iterations : ndarray of int, shape (n,)
        Steps taken; zero for closed forms.
    """

    q_nb: FloatArray
    covariance_n: FloatArray
    loss: FloatArray
    status: IntArray
    iterations: IntArray

    @property
    def observable(self) -> BoolArray:
        """Whether attitude and covariance are both there, shape (n,)."""
        return np.asarray((self.status & ~int(Observability.MISSING)) == 0)

    @property
    def std_n(self) -> FloatArray:
        """Standard deviations about north, east, down [rad], shape (n, 3)."""
        return np.asarray(np.sqrt(np.einsum("...ii->...i", self.covariance_n)))

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw [rad], shape (n, 3)."""
        return rpy_from_quat(self.q_nb)


class Epochs(NamedTuple):
    """Unit vectors ready for a method; what is left out has zero vectors and weight."""

    b: FloatArray  # (n, m, 3)
    n: FloatArray  # (n, m, 3)
    weight: FloatArray  # 1 / sigma^2 (n, m)
    sigma: FloatArray  # (n, m)
    status: IntArray  # (n,)
    single: bool
    min_angle: float

    @property
    def solvable(self) -> BoolArray:
        """Epochs with two directions at least."""
        return np.asarray((self.status & int(_UNSOLVED)) == 0)


def epochs(
    v_b: ArrayLike, v_n: ArrayLike, sigma: ArrayLike, min_angle: float, exactly: int | None = None
) -> Epochs:
    """Check and scale vectors of (m, 3) or (n, m, 3); flag what determines no attitude."""
    b = _checks.as_vectors("v_b", v_b, allow_nan=True)
    n = _checks.as_vectors("v_n", v_n, allow_nan=True)
    if b.ndim not in (2, 3) or b.shape[-2] < 2:
        raise ValueError(
            f"`v_b` must have shape (m, 3) or (n, m, 3) with at least two vectors, got {b.shape}."
        )
    if n.shape != b.shape and n.shape != b.shape[-2:]:
        raise ValueError(
            f"`v_n` must have shape {b.shape} like `v_b`, or {b.shape[-2:]} for all epochs, "
            f"got {n.shape}."
        )
    if exactly is not None and b.shape[-2] != exactly:
        raise ValueError(
            f"`v_b` must hold {exactly} vectors per epoch, got {b.shape[-2]}; "
            "`quest`, `davenport` and `svd` take any number."
        )
    _checks.in_range("min_angle", min_angle, 1e-7, 0.5 * math.pi)
    single = b.ndim == 2
    b = b.reshape(-1, *b.shape[-2:])
    n = np.broadcast_to(n, b.shape)
    deviations = _deviations(sigma, b.shape[:2])
    unit_b, has_b = _units(b)
    unit_n, has_n = _units(n)
    has = has_b & has_n
    unit_b, unit_n = unit_b * has[..., None], unit_n * has[..., None]
    status = np.where(has.all(axis=1), 0, int(Observability.MISSING))
    status |= np.where(
        _spread(unit_b, unit_n) > math.sin(min_angle), 0, int(Observability.ONE_DIRECTION)
    )
    weight = has / deviations**2
    return Epochs(unit_b, unit_n, weight, deviations, status, single, min_angle)


def finish(
    data: Epochs,
    q_nb: FloatArray,
    covariance_n: FloatArray,
    status: IntArray,
    iterations: IntArray | None = None,
) -> Determination:
    """Put the result together: NaN where there is no attitude, an error for a single epoch."""
    lost = (status & int(_UNSOLVED)) != 0
    open_covariance = lost | ((status & int(Observability.SINGULAR)) != 0)
    q = np.where(q_nb[:, :1] < 0.0, -q_nb, q_nb)
    steps = np.zeros(len(q), dtype=np.int64) if iterations is None else iterations
    if data.single and lost[0]:
        _refuse(int(status[0]), data.min_angle, int(steps[0]))
    loss = loss_of(data, q)
    q = np.where(lost[:, None], np.nan, q)
    P = 0.5 * (covariance_n + np.swapaxes(covariance_n, 1, 2))
    P = np.where(open_covariance[:, None, None], np.nan, P)
    loss = np.where(lost, np.nan, loss)
    if data.single:
        q, P, loss, status, steps = q[0], P[0], loss[0], status[0], steps[0]
    return Determination(
        q_nb=q, covariance_n=P, loss=loss, status=np.asarray(status), iterations=np.asarray(steps)
    )


def loss_of(data: Epochs, q_nb: FloatArray) -> FloatArray:
    """Return Wahba's loss of unit quaternions, shape (n,)."""
    C = dcm_from_quat(q_nb)
    off = data.n - np.einsum("nij,nmj->nmi", C, data.b)
    return np.asarray(0.5 * np.einsum("nm,nmi,nmi->n", data.weight, off, off))


def information(data: Epochs) -> FloatArray:
    """Return ``sum (I - v v^T) / sigma^2`` over the references, shape (n, 3, 3)."""
    total = data.weight.sum(axis=1)[:, None, None] * np.eye(3)
    return np.asarray(total - np.einsum("nm,nmi,nmj->nij", data.weight, data.n, data.n))


def optimal_covariance(data: Epochs) -> FloatArray:
    """Return the covariance of Wahba's optimum with weights 1 / sigma^2; shape (n, 3, 3)."""
    return inverse(np.where(data.solvable[:, None, None], information(data), np.eye(3)))


def covariance_of_rows(rows: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the covariance of phi_n of three independent ``row . phi_n = noise``."""
    solved = inverse(rows)
    return np.asarray(np.einsum("nij,nj,nkj->nik", solved, variance, solved))


def rows_of(data: Epochs, which: BoolArray | IntArray) -> Epochs:
    """Return some of the epochs."""
    return data._replace(
        b=data.b[which],
        n=data.n[which],
        weight=data.weight[which],
        sigma=data.sigma[which],
        status=data.status[which],
    )


def newton_step(data: Epochs, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Newton's step to the minimum as phi_n, the least curvature, and its axis.

    Curvatures count by their magnitude, so that a step always goes downhill.
    """
    b_n = np.einsum("nij,nmj->nmi", dcm_from_quat(q), data.b)
    torque = np.einsum("nm,nmi->ni", data.weight, np.cross(b_n, data.n))
    outer = np.einsum("nm,nmi,nmj->nij", data.weight, data.n, b_n)
    H = np.einsum("nii->n", outer)[:, None, None] * np.eye(3)
    H -= 0.5 * (outer + np.swapaxes(outer, 1, 2))
    values, axes = np.linalg.eigh(H)
    size = np.maximum(np.abs(values), np.finfo(float).tiny)
    step = np.einsum("nij,nj,nkj,nk->ni", axes, 1.0 / size, axes, torque)
    return step, values[:, 0], axes[:, :, 0]


def inverse(matrices: FloatArray) -> FloatArray:
    """Return the inverses of 3x3 matrices, by cofactors: singular ones give inf or NaN."""
    a, b, c = np.moveaxis(matrices, -2, 0)
    cofactors = np.stack((np.cross(b, c), np.cross(c, a), np.cross(a, b)), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(cofactors / np.einsum("ni,ni->n", a, cofactors[..., 0])[:, None, None])


def _deviations(sigma: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return the standard deviation of each direction, shape (n, m)."""
    array = _checks.as_floats("sigma", sigma)
    try:
        array = np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(
            f"`sigma` must be a number or have shape ({shape[1]},) or {shape}, got {array.shape}."
        ) from None
    if not ((array >= 1.0 / _checks.LARGEST) & (array <= _checks.LARGEST)).all():
        raise ValueError(f"`sigma` must be positive and finite, got {array.min():g}.")
    return np.asarray(array)


def _units(vectors: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return unit vectors, zero where there is no direction; and where there is one."""
    largest = np.abs(vectors).max(axis=-1)
    has = largest > 0.0  # False for NaN
    scaled = np.where(has[..., None], vectors, 0.0) / np.where(has, largest, 1.0)[..., None]
    norm = np.linalg.norm(scaled, axis=-1)
    return scaled / np.where(has, norm, 1.0)[..., None], np.asarray(has)


def _spread(b: FloatArray, n: FloatArray) -> FloatArray:
    """Return the largest sine between two directions, the smaller of b and n; shape (n,)."""
    largest = np.zeros(len(b))
    for i in range(b.shape[1]):
        for j in range(i):
            sine = np.minimum(
                np.linalg.norm(np.cross(b[:, i], b[:, j]), axis=-1),
                np.linalg.norm(np.cross(n[:, i], n[:, j]), axis=-1),
            )
            largest = np.maximum(largest, sine)
    return largest


def _refuse(status: int, min_angle: float, iterations: int) -> None:
    """Raise what a single epoch without an attitude deserves."""
    if status & Observability.ONE_DIRECTION:
        raise ValueError(
            f"`v_b` and `v_n` must hold two directions at least {math.degrees(min_angle):.3g} deg "
            "apart, got one: the turn about it is open; a second sensor, such as a magnetometer "
            "beside an accelerometer, closes it."
        )
    if status & Observability.AMBIGUOUS:
        raise ValueError(
            "`v_b` must fit one attitude best, got directions that fit two equally well, such as "
            "a mirror image; check the signs of the axes."
        )
    raise NotConverged(
        "attitude from directions",
        iterations,
        hint="start nearer, or take `quest`, which needs no start",
    )
