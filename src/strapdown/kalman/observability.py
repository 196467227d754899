"""What measurements tell of a state: rank of the observability matrix, and what stays open.

Sources: thesis micro UAV, 3.2.1; R. E. Kalman, "On the general theory of control systems", 1960.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.kalman import _matrices as _m


class Observed(NamedTuple):
    """What a system's measurements tell.

    Attributes
    ----------
    rank : int
        How many directions of the state can be found.
    open : ndarray, shape (n, n - rank)
        Orthonormal directions of the state that no measurement shows, one per column.
    singular_values : ndarray, shape (n,)
        Of the observability matrix, largest first: the smaller, the more noise is in the way.
    """

    rank: int
    open: FloatArray
    singular_values: FloatArray

    @property
    def whole(self) -> bool:
        """Whether nothing stays open."""
        return bool(self.open.shape[1] == 0)


def observability(
    F: ArrayLike,
    H: ArrayLike,
    *,
    tolerance: float = 1e-9,
) -> Observed:
    """Return what the measurements ``z = H x`` of a linear system tell of its state.

    The matrix is ``[H; H F; H F^2; ...]`` with n blocks. F may be the derivative, ``x' = F x``, or
    the step, ``x_k+1 = F x_k``: at one point of linearisation both tell the same. Of a system that
    varies, give a sequence of steps, and of as many H: the matrix is then
    ``[H_0; H_1 F_0; H_2 F_1 F_0; ...]``.

    Parameters
    ----------
    F : array_like, shape (n, n), or (k, n, n)
        Derivative or step; see above.
    H : array_like, shape (m, n), or (k, m, n)
        Measurements. Rows of different units are better scaled by their noise.
    tolerance : float
        Singular values below this part of the largest count as zero.

    Returns
    -------
    Observed

    Examples
    --------
    Position alone tells position and velocity; velocity alone leaves position open:

    >>> F = [[0.0, 1.0], [0.0, 0.0]]
    >>> observability(F, [[1.0, 0.0]]).rank
    2
    >>> found = observability(F, [[0.0, 1.0]])
    >>> found.rank, abs(found.open[:, 0]).round(9).tolist()
    (1, [1.0, 0.0])
    """
    _checks.positive("tolerance", tolerance)
    given: Any = _checks.as_floats("F", F)
    if given.ndim == 3:
        steps = [_m.square("F", one) for one in given]
        n = len(steps[0])
        rows = [_m.matrix("H", one, columns=n) for one in _checks.as_floats("H", H)]
        if len(rows) != len(steps):
            raise ValueError(
                f"`H` must be as many as `F`, one per step, got {len(rows)} and {len(steps)}."
            )
    else:
        one = _m.square("F", given)
        n = len(one)
        steps = [one] * n
        rows = [_m.matrix("H", H, columns=n)] * n
    blocks, so_far = [], np.eye(n)
    for step, row in zip(steps, rows, strict=True):
        blocks.append(row @ so_far)
        so_far = step @ so_far
    _, found, directions = np.linalg.svd(np.concatenate(blocks))
    values = np.zeros(n)
    values[: len(found)] = found
    rank = int(np.count_nonzero(values > tolerance * values[0])) if values[0] > 0.0 else 0
    return Observed(rank, directions[rank:].T.copy(), values)
