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

A rate ramp is not noise: it is the mean of the differences of block means, taken in when it is
beyond doubt; the likelihood is then the restricted one, of what a mean does not touch. A random
walk hides a small ramp.

A curve that no sum of the terms describes gets a relative model error, just large enough to
explain the residuals; it takes weight from the short times.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import toeplitz
from scipy.optimize import brentq, nnls
from scipy.stats import chi2
from scipy.stats import t as student

from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.kernels import toeplitz as _k
from strapdown.noise.covariance import TERMS, Moments, difference_covariance

_ROUNDS = 60  # of weights
_SETTLED = 1e-5  # relative change of the model that ends them
_SURE_SHARE = 30  # residuals count up to this share of the record; beyond, they are not Gaussian
_SHARP = 0.02  # relative deviation below which an interval is symmetric
_ROOT = 2e-3  # relative tolerance of the ends of an interval
_MISFIT_LEVEL = 1e-3  # chance at which residuals count as a misfit
_LEAST_MODEL_ERROR = 1e-4
_MAX_MODEL_ERROR = 3.0  # beyond it a curve has nothing to do with the terms
_EVIDENCE: Final = 7.0  # gain of 2 log L that shows a term: chance 0.4 % where there is none
_CONFIDENCE: Final = 0.95
_ONE_SIDED: Final = float(chi2.ppf(2.0 * _CONFIDENCE - 1.0, 1))
_RAMP_SIGMAS: Final = 3.0  # that show a ramp
_WALK: Final = TERMS.index("K")


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
        Interval of 95 %. Of a term that is not shown `low` is 0 and `high` is the limit
        from above, one-sided 95 %, infinite where the record sets none.
    shown : ndarray of bool, shape (4,)
        Whether the data show the term: the gain in likelihood from it is beyond chance, and
        its interval does not reach zero.
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
    shown: BoolArray
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
        shown = np.zeros(count, dtype=np.bool_)
        there = np.flatnonzero(theta > 0.0)
        covariance = np.linalg.inv(problem.information(theta)[np.ix_(there, there)])
        std[there] = np.sqrt(np.diag(covariance))
        for k in range(count):
            evidence = problem.profile(k, 0.0, theta)[0] - best
            fall = _interval_fall(theta[k], std[k]) if theta[k] > 0.0 else np.inf
            shown[k] = evidence > max(_EVIDENCE, fall)
            if not shown[k]:
                step = std[k] if theta[k] > 0.0 else problem.first_step(theta, k)
                high[k] = _crossing(problem, k, theta, step, best + _ONE_SIDED)
                continue
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
            shown=shown,
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
        self.steps: FloatArray = data.steps / math.sqrt(scale)
        self.block = data.block
        self.factors = data.factors
        p = data.steps.size
        lags = np.arange(p, dtype=np.float64) * data.block
        self.columns = np.array(
            [
                difference_covariance(a, lags, data.block, data.block) / data.block**2
                for a in range(len(TERMS))
            ]
        )
        # Of a trace or quadratic form with a Toeplitz matrix each diagonal counts twice.
        self.doubled = self.columns * np.where(np.arange(p) == 0, 1.0, 2.0)
        ring = np.concatenate((self.columns, self.columns[:, :0:-1]), axis=1)
        # Frequency zero is left out: white noise has no power there.
        self.spectra = np.fft.rfft(ring, axis=1).real[:, 1:]
        self.frozen: tuple[FloatArray, FloatArray, float] | None = None

    def seek_ramp(self) -> tuple[float, float]:
        """Return the ramp per sample and its deviation; let it in if it is beyond doubt."""
        self.ramp = True
        theta = self.fit()
        self.freeze(theta)
        mean = self._mean_step(theta @ self.columns)[0]
        # As unsure as the strongest random walk that could hide in what the ramp leaves.
        walk = _crossing(
            self, _WALK, theta, self.first_step(theta, _WALK), self.loss(theta) + _ONE_SIDED
        )
        if math.isfinite(walk):
            theta = self.profile(_WALK, walk, theta)[1]
        std = self._mean_step(theta @ self.columns)[1]
        self.frozen = None
        ramp = mean / self.block
        self.ramp = abs(mean) > _RAMP_SIGMAS * std
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
        A, y = self.A[s], self.y[s]
        V = self.curve_covariance(theta)[np.ix_(s, s)]
        W = np.linalg.solve(V, np.column_stack((A, y)))
        M = A.T @ W[:, :-1]
        return 0.5 * (M + M.T), A.T @ W[:, -1], float(y @ W[:, -1])

    def freeze(self, theta: FloatArray) -> None:
        """Keep the weights of the short times as they are at `theta`."""
        self.frozen = self.short_equations(theta)

    def loss(self, theta: FloatArray) -> float:
        """Return -2 log L up to a constant; the short times must be frozen."""
        assert self.frozen is not None
        M, h, square = self.frozen
        column = theta @ self.columns
        steps = self._less_ramp(column)
        x, log_det = _toeplitz_solve(column, steps)[:2]
        fall = float(steps @ x) + log_det
        if self.ramp:  # the likelihood of what is left when the mean is taken out
            fall -= 2.0 * math.log(self._mean_step(column)[1])
        return fall + square - 2.0 * float(theta @ h) + float(theta @ M @ theta)

    def information(self, theta: FloatArray) -> FloatArray:
        """Return the Fisher information about all terms."""
        M = self.short_equations(theta)[0] if self.frozen is None else self.frozen[0]
        V = toeplitz(theta @ self.columns)
        P = [np.linalg.solve(V, toeplitz(column)) for column in self.columns]
        F = np.array([[0.5 * np.sum(a * b.T) for b in P] for a in P])
        return np.asarray(M + F)

    def fit(self) -> FloatArray:
        """Return theta with all terms free."""
        relative = self.A / self.y[:, np.newaxis]
        theta = nnls(relative, np.ones(self.y.size))[0]
        return self._iterate(theta, np.arange(len(TERMS)))

    def profile(self, k: int, value: float, near: FloatArray) -> tuple[float, FloatArray]:
        """Return the least loss with term `k` at `value`, and theta there, sought from `near`."""
        others = np.flatnonzero(np.arange(len(TERMS)) != k)
        theta = near.copy()
        theta[k] = value
        if not theta.any():  # that term alone made the curve; begin with any other
            theta[others[0]] = self.y.min() / self.A[:, others[0]].max()
        theta = self._iterate(theta, others)
        return self.loss(theta), theta

    def first_step(self, theta: FloatArray, k: int) -> float:
        """Return a size at which a term that is absent would begin to matter."""
        return float(1.0 / np.sqrt(self.information(theta)[k, k]))

    def _iterate(self, theta: FloatArray, free: IntArray) -> FloatArray:
        """Return theta after scoring steps for the terms `free`, until the model stays."""
        held = theta.copy()
        held[free] = 0.0
        model = self.A @ theta
        for round_ in range(_ROUNDS):
            M, h = self._step_equations(theta)
            d = 1.0 / np.sqrt(np.diag(M))
            right = (h - M @ held)[free] * d[free]
            L = np.linalg.cholesky((M * np.outer(d, d))[np.ix_(free, free)])
            new = held.copy()
            new[free] = nnls(L.T, np.linalg.solve(L, right))[0] * d[free]
            if not new.any():
                return theta
            if round_ > _ROUNDS // 3:  # a term may enter and leave in turn
                new = 0.5 * (new + theta)
            theta, before = new, model
            model = self.A @ theta
            if np.max(np.abs(model - before) / model) < _SETTLED:
                break
        return theta

    def _step_equations(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return matrix and right-hand side of a scoring step from `theta`.

        The gradient is exact; the information of the steps is that of a series on a ring.
        """
        M, h, _ = self.frozen or self.short_equations(theta)
        column = theta @ self.columns
        x, _, a, error = _toeplitz_solve(column, self._less_ramp(column))
        inverse, products = np.empty(x.size), np.empty(x.size)
        _k.inverse_diagonals(a, error, inverse)
        _k.lagged_products(x, products)
        if self.ramp:
            ones = _toeplitz_solve(column, np.ones(x.size))[0]
            lost = np.empty(x.size)
            _k.lagged_products(ones, lost)
            inverse -= lost / ones.sum()
        gradient = 0.5 * (self.doubled @ (products - inverse))
        share = self.spectra / (theta @ self.spectra)
        F = 0.5 * share @ share.T  # the ring is twice as long, and its two halves are alike
        return M + F, h + F @ theta + gradient

    def _mean_step(self, column: FloatArray) -> tuple[float, float]:
        """Return the mean of the steps and its deviation, at the weights of `column`."""
        weight = _toeplitz_solve(column, np.ones(self.steps.size))[0]
        total = float(weight.sum())
        return float(weight @ self.steps) / total, 1.0 / math.sqrt(total)

    def _less_ramp(self, column: FloatArray) -> FloatArray:
        if not self.ramp:
            return self.steps
        return self.steps - self._mean_step(column)[0]


def _toeplitz_solve(
    column: FloatArray, y: FloatArray
) -> tuple[FloatArray, float, FloatArray, float]:
    """Return the solution, log det, and what the first column of the inverse is made of."""
    row = column.copy()
    row[0] *= 1.0 + 1e-10
    a, x = np.empty(y.size), np.empty(y.size)
    log_det, error = _k.solve(row, y, a, x)
    return x, log_det, a, error


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
    quantile = float(student.ppf(0.5 + 0.5 * _CONFIDENCE, freedom))
    return quantile * quantile


def _crossing(problem: _Problem, k: int, theta: FloatArray, step: float, level: float) -> float:
    """Return where the profile of term `k` reaches `level`, going from its best by `step`."""
    nearest = theta.copy()  # the other terms change little from one value to the next

    def excess(value: float) -> float:
        nonlocal nearest
        loss, nearest = problem.profile(k, value, nearest)
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
