"""Gauss-Newton for calibrations: history by iteration, covariance, and a look at the geometry.

The problems are small (9 to 12 unknowns) and start near their solution, so plain Gauss-Newton
with step halving does; what matters is what it reports. Unknowns that the data cannot tell
apart are named, not returned.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from strapdown._types import FloatArray
from strapdown.errors import InputError, NotConverged

Model = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

MAX_ITERATIONS = 50
TOLERANCE = 1e-10  # largest relative step at which the iteration ends
RANK_TOLERANCE = 1e-7  # smallest to largest singular value of the scaled Jacobian
MAX_HALVINGS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A least-squares solution and what is known of it.

    Attributes
    ----------
    x : ndarray, shape (p,)
        Unknowns.
    cofactor : ndarray, shape (p, p)
        ``inv(J^T J)`` at the solution; times the variance of one residual, the covariance.
    residuals : ndarray, shape (n,)
        Residuals at the solution.
    history : ndarray, shape (k + 1, p)
        Unknowns at the start and after each of k iterations.
    condition : float
        Condition number of the scaled Jacobian: the larger, the worse the geometry.
    """

    x: FloatArray
    cofactor: FloatArray
    residuals: FloatArray
    history: FloatArray
    condition: float

    @property
    def dof(self) -> int:
        """Equations less unknowns."""
        return len(self.residuals) - len(self.x)

    def covariance(self, std: float | None = None) -> FloatArray:
        """Return the covariance of the unknowns.

        The variance of one residual is the larger of what the residuals show and ``std**2``: few
        degrees of freedom can by chance look better than the noise. NaN without either.
        """
        shown = float(self.residuals @ self.residuals) / self.dof if self.dof else np.nan
        stated = np.nan if std is None else std**2
        return np.asarray(self.cofactor * np.fmax(shown, stated))


def gauss_newton(
    model: Model,
    start: FloatArray,
    scale: FloatArray,
    names: tuple[str, ...],
    *,
    what: str,
    advice: str,
) -> Solution:
    """Return the unknowns that make the residuals least in the sum of their squares.

    Parameters
    ----------
    model : callable
        Takes the unknowns, shape (p,), returns residuals (n,) and Jacobian (n, p).
    start : ndarray, shape (p,)
        First approximation.
    scale : ndarray, shape (p,)
        Typical size of a change of each unknown that matters equally.
    names : tuple of str
        Names of the unknowns, for messages.
    what, advice : str
        What is computed, and what to do if it fails.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If the data cannot tell some unknowns apart, at the start or at the solution.
    NotConverged
        If the steps do not shrink.
    """
    x = np.array(start, dtype=np.float64)
    history = [x]
    residuals, jacobian = model(x)
    for _ in range(MAX_ITERATIONS):
        step = _step(residuals, jacobian, scale, names, what, advice)[0]
        cost = residuals @ residuals
        fraction = 1.0
        for _ in range(MAX_HALVINGS):
            trial = x + fraction * step
            new_residuals, new_jacobian = model(trial)
            # The last steps change the cost by rounding only.
            if new_residuals @ new_residuals <= cost * (1.0 + 1e-9) + 1e-300:
                break
            fraction *= 0.5
        else:
            if np.max(np.abs(step / scale)) > 1e3 * TOLERANCE:
                raise NotConverged(what, len(history) - 1, float(np.sqrt(cost)), advice)
        x, residuals, jacobian = trial, new_residuals, new_jacobian
        history.append(x)
        if np.max(np.abs(fraction * step / scale)) <= TOLERANCE:
            break
    else:
        raise NotConverged(what, MAX_ITERATIONS, float(np.linalg.norm(residuals)), advice)
    _, singular, right = _step(residuals, jacobian, scale, names, what, advice)
    cofactor = (right.T / singular**2) @ right * np.outer(scale, scale)
    return Solution(
        x=x,
        cofactor=0.5 * (cofactor + cofactor.T),
        residuals=residuals,
        history=np.array(history),
        condition=float(singular[0] / singular[-1]),
    )


def correlation_length(residuals: FloatArray) -> float:
    """Return how many samples count as one independent sample, at least 1.

    One plus twice the sum of the autocorrelation up to its first value under 0.05, the noise
    level of a record of some hundred samples.
    """
    n = len(residuals)
    centred = residuals - residuals.mean()
    power = centred @ centred
    if n < 20 or not power > 0.0:
        return 1.0
    spectrum = np.fft.rfft(centred, 2 * n)
    autocorrelation = np.fft.irfft(np.abs(spectrum) ** 2)[: n // 4] / power
    end = int(np.argmax(autocorrelation < 0.05)) or len(autocorrelation)
    return float(max(1.0, 1.0 + 2.0 * autocorrelation[1:end].sum()))


def _step(
    residuals: FloatArray,
    jacobian: FloatArray,
    scale: FloatArray,
    names: tuple[str, ...],
    what: str,
    advice: str,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the step, and the singular values and right vectors of the scaled Jacobian."""
    if not (np.isfinite(residuals).all() and np.isfinite(jacobian).all()):
        raise NotConverged(what, 0, float("nan"), advice)
    Q, R = np.linalg.qr(jacobian * scale)
    left, singular, right = np.linalg.svd(R)
    if singular[-1] <= RANK_TOLERANCE * singular[0]:
        unseen = right[singular <= RANK_TOLERANCE * singular[0]]  # any basis of one space
        weights = np.sqrt((unseen * unseen).sum(axis=0))
        blurred = [name for name, w in zip(names, weights, strict=True) if w > 0.3 * weights.max()]
        listed = " and ".join([", ".join(blurred[:-1])] * (len(blurred) > 1) + blurred[-1:])
        raise InputError(f"{what} cannot tell {listed} from these data; {advice}.")
    step = -scale * (right.T @ ((left.T @ (Q.T @ residuals)) / singular))
    return step, singular, right
