"""Maximum-likelihood fit of noise coefficients, with what the record cannot show.

Two views of the record are fitted together, for a model whose variances are linear in the
squared coefficients theta (`strapdown.noise.covariance`):

* **Long times.** The record is averaged over some hundred blocks. The differences of
  neighbouring block means are a stationary Gaussian series, and its likelihood is exact. This
  is where few degrees of freedom make a variance far from Gaussian.
* **Short times.** Octaves of the overlapping deviation below the block length, by generalised
  least squares with their joint covariance. Here degrees of freedom are many.

Both lead to the same kind of linear equations, iterated until their weights stay, with theta
kept non-negative. Intervals, limits and the test whether a term is there at all come from the
profile of the likelihood.

A rate ramp is not noise: it is the mean of the differences of block means, taken in when the
likelihood asks for it. A random walk hides a small one.

A curve that no sum of the terms describes gets a relative model error, just large enough to
explain the residuals; it takes weight from the short times.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular, toeplitz
from scipy.optimize import brentq, nnls
from scipy.stats import chi2, t

from strapdown._types import FloatArray, IntArray
from strapdown.noise.covariance import TERMS, Moments, difference_covariance

_ROUNDS = 60  # of weights
_SETTLED = 1e-5  # relative change of the model that ends them
_SURE_SHARE = 30  # residuals count up to this share of the record; beyond, they are not Gaussian
_SHARP = 0.02  # relative deviation below which an interval is symmetric
_ROOT = 2e-3  # relative tolerance of the ends of an interval
_MISFIT_LEVEL = 1e-3  # chance at which residuals count as a misfit
_LEAST_MODEL_ERROR = 1e-4
_MAX_MODEL_ERROR = 3.0  # beyond it a curve has nothing to do with the terms
EVIDENCE: Final = 7.0  # gain of 2 log L that shows a term: chance 0.4 % where there is none
_CONFIDENCE: Final = 0.95
_ONE_SIDED: Final = float(chi2.ppf(2.0 * _CONFIDENCE - 1.0, 1))
_RAMP_EVIDENCE: Final = float(chi2.ppf(0.999, 1))  # a ramp must be beyond doubt


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """What the fit sees of a record; times are in samples.

    Attributes
    ----------
    curve : ndarray, shape (k,)
        Overlapping variances at octaves of the averaging factor.
    factors : ndarray of int, shape (k,)
        The averaging factors.
    moments : Moments
        Their means and covariances at coefficient one.
    steps : ndarray, shape (p,)
        Differences of neighbouring block means.
    block : int
        Samples per block.
    """

    curve: FloatArray
    factors: IntArray
    moments: Moments
    steps: FloatArray
    block: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveFit:
    """Squared coefficients and how sure they are; times are in samples.

    Attributes
    ----------
    squares : ndarray, shape (4,)
        Squared coefficients in the order of `TERMS`.
    std : ndarray, shape (4,)
        Their standard deviations; NaN for a term at zero.
    low, high : ndarray, shape (4,)
        Interval of 95 %. Without evidence for the term `low` is 0 and `high` is the limit
        from above, one-sided 95 %, infinite where the record sets none.
    evidence : ndarray, shape (4,)
        Twice the gain in log likelihood from the term.
    ramp, ramp_std : float
        Change of the rate per sample, and its standard deviation.
    has_ramp : bool
        Whether the ramp is beyond doubt, and part of the fit.
    model_error : float
        Relative model error of the variance that the residuals need; 0 if none.
    chi_square : float
        Residuals of the curve, without model error.
    dof : int
        Residuals less terms in the fit.
    """

    squares: FloatArray
    std: FloatArray
    low: FloatArray
    high: FloatArray
    evidence: FloatArray
    ramp: float
    ramp_std: float
    has_ramp: bool
    model_error: float
    chi_square: float
    dof: int


class Fit:
    """Squared noise coefficients at their best, before the question how sure they are.

    Parameters
    ----------
    data : Data
        The two views of the record.

    Attributes
    ----------
    model_error : float
        Relative model error of the variance that the residuals need; 0 if none.
    """

    def __init__(self, data: Data) -> None:
        self._scale = float(data.curve.max())
        self._problem = _Problem(data, self._scale)
        self._ramp = self._problem.seek_ramp()
        self._theta = self._problem.fit()
        self._dof = self._problem.dof(self._theta)
        self._chi_square = self._problem.chi_square(self._theta)
        if chi2.sf(self._chi_square, self._dof) < _MISFIT_LEVEL:
            self._theta = _with_model_error(self._problem)

    @property
    def model_error(self) -> float:
        """See the attributes of the class."""
        return self._problem.model_error

    def result(self) -> CurveFit:
        """Return the coefficients with their intervals, limits and evidence."""
        problem, theta, scale = self._problem, self._theta, self._scale
        problem.freeze(theta)
        best = problem.loss(theta)
        count = len(TERMS)
        std, low, high = np.full(count, np.nan), np.zeros(count), np.full(count, np.inf)
        evidence = np.zeros(count)
        there = np.flatnonzero(theta > 0.0)
        covariance = np.linalg.inv(problem.equations(theta)[0][np.ix_(there, there)])
        std[there] = np.sqrt(np.diag(covariance))
        for k in range(count):
            evidence[k] = max(problem.profile(k, 0.0, theta) - best, 0.0)
            if evidence[k] < EVIDENCE:
                step = std[k] if theta[k] > 0.0 else problem.first_step(theta, k)
                high[k] = _crossing(problem, k, theta, step, best + _ONE_SIDED)
                continue
            fall = _interval_fall(theta[k], std[k])
            if std[k] < _SHARP * theta[k]:  # the likelihood is a parabola this near its top
                reach = np.sqrt(fall) * std[k]
                low[k], high[k] = theta[k] - reach, theta[k] + reach
            else:
                low[k] = _crossing(problem, k, theta, -std[k], best + fall)
                high[k] = _crossing(problem, k, theta, std[k], best + fall)
        return CurveFit(
            squares=theta * scale,
            std=std * scale,
            low=low * scale,
            high=high * scale,
            evidence=evidence,
            ramp=self._ramp[0] * np.sqrt(scale),
            ramp_std=self._ramp[1] * np.sqrt(scale),
            has_ramp=problem.ramp,
            model_error=problem.model_error,
            chi_square=self._chi_square,
            dof=self._dof,
        )


class _Problem:
    """The equations of the fit, with the numbers scaled to be near one."""

    def __init__(self, data: Data, scale: float) -> None:
        self.y = data.curve / scale
        self.A = data.moments.design
        self.moments = data.moments
        self.model_error = 0.0
        self.ramp = False
        short = data.factors <= data.block // 2
        self.short = short if short.any() else data.factors == data.factors.min()
        self.sure = data.factors * _SURE_SHARE <= data.block * (data.steps.size + 1)
        if np.count_nonzero(self.sure) < 2:
            self.sure = self.short
        self.steps = data.steps / np.sqrt(scale)
        self.block = data.block
        self.factors = data.factors
        lags = np.arange(data.steps.size, dtype=np.float64) * data.block
        self.columns = [
            difference_covariance(a, lags, data.block, data.block) / data.block**2
            for a in range(len(TERMS))
        ]
        self.blocks = [toeplitz(column) for column in self.columns]
        self.stacked = np.column_stack(self.blocks)
        self.frozen: tuple[FloatArray, FloatArray, float] | None = None

    def seek_ramp(self) -> tuple[float, float]:
        """Return the ramp per sample and its deviation; let it in if it is beyond doubt."""
        theta = self.fit()
        self.freeze(theta)
        without = self.loss(theta)
        self.ramp = True
        theta = self._iterate(theta, np.arange(len(TERMS)))
        gain = without - self.loss(theta)
        mean, std = self._mean_step(self._block_factor(theta))
        self.frozen = None
        ramp = mean / self.block
        self.ramp = gain > _RAMP_EVIDENCE
        if self.ramp:
            self.y = np.maximum(self.y - 0.5 * (ramp * self.factors) ** 2, 1e-3 * self.y)
        return ramp, std / self.block

    def curve_covariance(self, theta: FloatArray) -> FloatArray:
        """Return the covariance of the whole curve, model error included."""
        V = self.moments.covariance(theta)
        diagonal = np.diag_indices_from(V)
        V[diagonal] += (self.model_error * (self.A @ theta)) ** 2
        V[diagonal] *= 1.0 + 1e-9  # the longest times are nearly collinear
        return V

    def chi_square(self, theta: FloatArray) -> float:
        """Return the weighted squared residuals of the curve, its longest times left out."""
        s = self.sure
        r = (self.y - self.A @ theta)[s]
        return float(r @ np.linalg.solve(self.curve_covariance(theta)[np.ix_(s, s)], r))

    def dof(self, theta: FloatArray) -> int:
        """Return the degrees of freedom of `chi_square`."""
        return max(int(np.count_nonzero(self.sure)) - int(np.count_nonzero(theta)), 1)

    def short_equations(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return the normal equations of the short times, and the squared data."""
        s = self.short
        L = np.linalg.cholesky(self.curve_covariance(theta)[np.ix_(s, s)])
        W = solve_triangular(L, np.column_stack((self.A[s], self.y[s])), lower=True)
        A, y = W[:, :-1], W[:, -1]
        return np.asarray(A.T @ A), np.asarray(A.T @ y), float(y @ y)

    def freeze(self, theta: FloatArray) -> None:
        """Keep the weights of the short times as they are at `theta`."""
        self.frozen = self.short_equations(theta)

    def equations(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return information and right-hand side, weights as at `theta`."""
        M, h, _ = self.frozen or self.short_equations(theta)
        factor = self._block_factor(theta)
        p = self.steps.size
        solved = cho_solve(factor, self.stacked, check_finite=False)
        e = cho_solve(factor, self._less_ramp(factor), check_finite=False)
        h = h + 0.5 * np.array([e @ V @ e for V in self.blocks])
        P = [solved[:, a * p : (a + 1) * p] for a in range(len(TERMS))]
        F = np.empty_like(M)
        for a in range(len(TERMS)):
            for b in range(a, len(TERMS)):
                F[a, b] = F[b, a] = 0.5 * np.einsum("ij,ji->", P[a], P[b])
        return M + F, h

    def loss(self, theta: FloatArray) -> float:
        """Return -2 log L up to a constant; the short times must be frozen."""
        assert self.frozen is not None
        M, h, square = self.frozen
        factor = self._block_factor(theta)
        steps = self._less_ramp(factor)
        fall = float(steps @ cho_solve(factor, steps))
        fall += 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
        return fall + square - 2.0 * float(theta @ h) + float(theta @ M @ theta)

    def fit(self) -> FloatArray:
        """Return theta with all terms free."""
        relative = self.A / self.y[:, np.newaxis]
        theta = nnls(relative, np.ones(self.y.size))[0]
        return self._iterate(theta, np.arange(len(TERMS)))

    def profile(self, k: int, value: float, near: FloatArray) -> float:
        """Return the loss with term `k` at `value` and the others at their best."""
        return self.at(k, value, near)[0]

    def at(self, k: int, value: float, near: FloatArray) -> tuple[float, FloatArray]:
        """Return the loss and theta with term `k` at `value`, starting at theta `near`."""
        others = np.flatnonzero(np.arange(len(TERMS)) != k)
        theta = near.copy()
        theta[k] = value
        if not theta.any():  # that term alone made the curve; begin with any other
            theta[others[0]] = self.y.min() / self.A[:, others[0]].max()
        theta = self._iterate(theta, others)
        return self.loss(theta), theta

    def first_step(self, theta: FloatArray, k: int) -> float:
        """Return a size at which a term that is absent would begin to matter."""
        return float(1.0 / np.sqrt(self.equations(theta)[0][k, k]))

    def _iterate(self, theta: FloatArray, free: IntArray) -> FloatArray:
        held = theta.copy()
        held[free] = 0.0
        model = self.A @ theta
        for round_ in range(_ROUNDS):
            M, h = self.equations(theta)
            d = 1.0 / np.sqrt(np.diag(M))
            right = (h - M @ held)[free] * d[free]
            L = np.linalg.cholesky((M * np.outer(d, d))[np.ix_(free, free)])
            new = held.copy()
            new[free] = nnls(L.T, solve_triangular(L, right, lower=True))[0] * d[free]
            if not new.any():
                return theta
            if round_ > 20:  # a term may enter and leave in turn
                new = 0.5 * (new + theta)
            theta, before = new, model
            model = self.A @ theta
            if np.max(np.abs(model - before) / model) < _SETTLED:
                break
        return theta

    def _mean_step(self, factor: tuple[FloatArray, bool]) -> tuple[float, float]:
        """Return the mean of the steps and its deviation, at the weights of `factor`."""
        weight = cho_solve(factor, np.ones(self.steps.size))
        total = float(weight.sum())
        return float(weight @ self.steps) / total, 1.0 / np.sqrt(total)

    def _less_ramp(self, factor: tuple[FloatArray, bool]) -> FloatArray:
        if not self.ramp:
            return self.steps
        return np.asarray(self.steps - self._mean_step(factor)[0])

    def _block_factor(self, theta: FloatArray) -> tuple[FloatArray, bool]:
        column = sum(t * c for t, c in zip(theta, self.columns, strict=True))
        column[0] *= 1.0 + 1e-10
        factor: tuple[FloatArray, bool] = cho_factor(
            toeplitz(column), lower=True, check_finite=False
        )
        return factor


def _with_model_error(problem: _Problem) -> FloatArray:
    """Set the model error at which the residuals are as large as they should be."""
    low, high = _LEAST_MODEL_ERROR, _MAX_MODEL_ERROR
    while high > 1.15 * low:
        problem.model_error = float(np.sqrt(low * high))
        theta = problem.fit()
        if problem.chi_square(theta) > problem.dof(theta):
            low = problem.model_error
        else:
            high = problem.model_error
    problem.model_error = high
    return problem.fit()


def _interval_fall(value: float, std: float) -> float:
    """Return by how much 2 log L falls at the ends of the interval.

    A variance from few degrees of freedom is less sure than its likelihood says; Student's
    quantile in place of the normal one brings the coverage near its nominal value.
    """
    freedom = max(2.0 * (value / std) ** 2, 3.0)
    quantile = float(t.ppf(0.5 + 0.5 * _CONFIDENCE, freedom))
    return quantile * quantile


def _crossing(problem: _Problem, k: int, theta: FloatArray, step: float, level: float) -> float:
    """Return where the profile of term `k` reaches `level`, going from its best by `step`."""
    nearest = theta.copy()  # the other terms change little from one value to the next

    def excess(value: float) -> float:
        nonlocal nearest
        loss, nearest = problem.at(k, value, nearest)
        return loss - level

    near, far = theta[k], max(theta[k] + step, 0.0)
    for _ in range(40):
        if excess(far) > 0.0:
            return float(brentq(excess, near, far, xtol=_ROOT * abs(far - near), rtol=_ROOT))
        if far == 0.0:
            return 0.0
        step *= 2.0
        near, far = far, max(far + step, 0.0)
    return float("inf")
