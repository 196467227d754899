"""Checks of vectors and matrices that belong together."""

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray

_ROUND_OFF = 1e-9  # relative asymmetry or negative eigenvalue that arithmetic can leave


def vector(name: str, value: ArrayLike, size: int | None = None) -> FloatArray:
    """Return one finite vector; a number is a vector of one."""
    array = np.atleast_1d(_checks.as_floats(name, value))
    if array.ndim != 1 or (size is not None and array.size != size):
        want = "(n,)" if size is None else f"({size},)"
        raise ValueError(f"`{name}` must have shape {want}, got {array.shape}.")
    if not (np.abs(array) <= _checks.LARGEST).all():
        raise ValueError(f"`{name}` must be finite, got {array}.")
    return array


def matrix(
    name: str, value: ArrayLike, rows: int | None = None, columns: int | None = None
) -> FloatArray:
    """Return one finite matrix; a number is a matrix of one."""
    array = np.atleast_2d(_checks.as_floats(name, value))
    fits = array.ndim == 2 and (rows is None or array.shape[0] == rows)
    if not fits or (columns is not None and array.shape[1] != columns):
        want = f"({'n' if rows is None else rows}, {'m' if columns is None else columns})"
        raise ValueError(f"`{name}` must have shape {want}, got {array.shape}.")
    if not (np.abs(array) <= _checks.LARGEST).all():
        raise ValueError(f"`{name}` must be finite, got {array.tolist()}.")
    return array


def square(name: str, value: ArrayLike, size: int | None = None) -> FloatArray:
    """Return one finite square matrix."""
    array = matrix(name, value, size, size)
    if array.shape[0] != array.shape[1]:
        raise ValueError(f"`{name}` must be square, got shape {array.shape}.")
    return array


def covariance(
    name: str, value: ArrayLike, size: int | None = None, *, definite: bool = False
) -> FloatArray:
    """Return a symmetric matrix without negative eigenvalues, or with positive ones only."""
    array = square(name, value, size)
    apart = np.abs(array - array.T)
    scale = max(float(np.abs(array).max(initial=0.0)), np.finfo(float).tiny)
    if apart.max(initial=0.0) > _ROUND_OFF * scale:
        i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
        raise ValueError(
            f"`{name}` must be symmetric, got {array[i, j]:g} at ({i}, {j}) and "
            f"{array[j, i]:g} at ({j}, {i})."
        )
    array = 0.5 * (array + array.T)
    least = float(np.linalg.eigvalsh(array)[0]) if array.size else 0.0
    if definite and not least > np.finfo(float).eps * scale:
        raise ValueError(
            f"`{name}` must be positive definite, got a least eigenvalue of {least:g}; "
            "it is inverted here."
        )
    if least < -_ROUND_OFF * scale:
        raise ValueError(
            f"`{name}` must have no negative eigenvalue, got {least:g}; a covariance is the mean "
            "of squares, and of deviations the square is meant."
        )
    return array


def solve(name: str, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return ``left^-1 right`` of a symmetric innovation covariance."""
    try:
        return np.asarray(np.linalg.solve(left, right))
    except np.linalg.LinAlgError:
        raise ValueError(
            f"`{name}` must make H P H^T + R invertible, got a singular one: two measurements "
            "without noise say the same."
        ) from None


def distributed(name: str, part: ArrayLike, by: ArrayLike | None, size: int) -> FloatArray:
    """Return a noise covariance of `size`, spread by a distribution matrix where there is one."""
    if by is None:
        return covariance(name, part, size)
    spread = matrix("G" if name == "Q" else "J", by, size)
    return np.asarray(spread @ covariance(name, part, spread.shape[1]) @ spread.T)
