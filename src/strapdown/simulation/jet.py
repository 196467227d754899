"""Functions of time with their derivatives: truncated Taylor series, computed with exactly.

A `Jet` holds the Taylor coefficients of a function at each of n times. Sums, products, quotients
and the functions below give the coefficients of the result by the recurrences of series
arithmetic [1]_, so that a rate is the derivative of its angle to rounding, with no difference
quotient anywhere.

References
----------
.. [1] A. Griewank, A. Walther, "Evaluating Derivatives", 2nd edition, SIAM, 2008, chapter 13.
"""

import math
from collections.abc import Iterable
from typing import Protocol, Union

import numpy as np

from strapdown._types import FloatArray

Term = Union["Jet", float]


class Smooth(Protocol):
    """A function of time that knows its derivatives, such as SciPy's `PPoly`."""

    def __call__(self, x: FloatArray, nu: int = 0) -> FloatArray:
        """Return the `nu`-th derivative at `x`."""
        ...


class Jet:
    """Taylor coefficients of one function at n times.

    Parameters
    ----------
    c : ndarray, shape (order + 1, n)
        ``c[k]`` is the k-th derivative divided by k factorial.
    """

    __slots__ = ("c",)
    __array_ufunc__ = None  # so that a NumPy scalar on the left leaves the sum to the jet

    def __init__(self, c: FloatArray) -> None:
        self.c = c

    @property
    def order(self) -> int:
        """Highest derivative that is known."""
        return len(self.c) - 1

    @property
    def value(self) -> FloatArray:
        """The function itself, shape (n,)."""
        return np.asarray(self.c[0])

    def derivative(self) -> "Jet":
        """Return the derivative, of one order less."""
        return Jet(self.c[1:] * np.arange(1.0, len(self.c))[:, np.newaxis])

    def to(self, order: int) -> "Jet":
        """Return the jet cut to an order."""
        return Jet(self.c[: order + 1])

    def plus(self, values: FloatArray) -> "Jet":
        """Return the sum with a constant at each time."""
        c = self.c.copy()
        c[0] += values
        return Jet(c)

    def __neg__(self) -> "Jet":
        return Jet(-self.c)

    def __add__(self, other: Term) -> "Jet":
        if isinstance(other, Jet):
            k = min(len(self.c), len(other.c))
            return Jet(self.c[:k] + other.c[:k])
        c = self.c.copy()
        c[0] += other
        return Jet(c)

    __radd__ = __add__

    def __sub__(self, other: Term) -> "Jet":
        return self + (-other)

    def __rsub__(self, other: float) -> "Jet":
        return -self + other

    def __mul__(self, other: Term) -> "Jet":
        if not isinstance(other, Jet):
            return Jet(self.c * other)
        a, b = self.c, other.c
        return Jet(
            np.stack(
                [sum_of(a[j] * b[k - j] for j in range(k + 1)) for k in range(min(len(a), len(b)))]
            )
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Term) -> "Jet":
        if not isinstance(other, Jet):
            return Jet(self.c / other)
        a, b = self.c, other.c
        q: list[FloatArray] = []
        for k in range(min(len(a), len(b))):
            q.append((a[k] - sum_of(b[j] * q[k - j] for j in range(1, k + 1))) / b[0])
        return Jet(np.stack(q))

    def __rtruediv__(self, other: float) -> "Jet":
        return constant(other, self) / self


def sum_of(terms: Iterable[FloatArray]) -> FloatArray:
    """Return the sum of arrays; zero if there is none."""
    total: FloatArray = np.zeros(())
    for term in terms:
        total = total + term
    return total


def constant(value: float, like: Jet) -> Jet:
    """Return a constant at the times and of the order of another jet."""
    c = np.zeros_like(like.c)
    c[0] = value
    return Jet(c)


def time(t: FloatArray, order: int) -> Jet:
    """Return time itself."""
    c = np.zeros((order + 1, len(t)))
    c[0] = t
    if order:
        c[1] = 1.0
    return Jet(c)


def jet_of(function: Smooth, t: FloatArray, order: int) -> Jet:
    """Return the jet of a function that knows its derivatives, such as a spline."""
    return Jet(np.stack([function(t, nu=k) / math.factorial(k) for k in range(order + 1)]))


def compose(function: Smooth, u: Jet) -> Jet:
    """Return ``function(u(t))``: the outer Taylor series, with the inner one put in."""
    outer = jet_of(function, u.value, u.order).c
    step = Jet(np.concatenate((np.zeros_like(u.c[:1]), u.c[1:])))
    result = Jet(np.zeros_like(u.c)).plus(outer[-1])
    for k in range(u.order - 1, -1, -1):
        result = (result * step).plus(outer[k])
    return result


def sin_cos(a: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine."""
    s, c = [np.sin(a.c[0])], [np.cos(a.c[0])]
    for k in range(1, len(a.c)):
        s.append(sum_of(j * a.c[j] * c[k - j] for j in range(1, k + 1)) / k)
        c.append(-sum_of(j * a.c[j] * s[k - j] for j in range(1, k + 1)) / k)
    return Jet(np.stack(s)), Jet(np.stack(c))


def sqrt(a: Jet) -> Jet:
    """Return the root of a positive function."""
    r = [np.sqrt(a.c[0])]
    for k in range(1, len(a.c)):
        r.append((a.c[k] - sum_of(r[j] * r[k - j] for j in range(1, k))) / (2.0 * r[0]))
    return Jet(np.stack(r))


def atan2(y: Jet, x: Jet) -> Jet:
    """Return the angle of ``(x, y)``, continuous from each time to the next."""
    angle = np.unwrap(np.arctan2(y.value, x.value))[np.newaxis]
    if min(y.order, x.order) == 0:
        return Jet(angle)
    rate = (x * y.derivative() - y * x.derivative()) / (x * x + y * y)
    k = np.arange(1.0, len(rate.c) + 1)[:, np.newaxis]
    return Jet(np.concatenate((angle, rate.c / k)))
