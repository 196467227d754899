"""What the converter makes of a signal: range, steps, and raw counts."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.sensors.settings import Quantity

# A sample on the last step below full scale has been clipped as far as anyone can tell.
_EDGE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Digital:
    """Saturation and quantisation, and the way from counts to SI and back.

    Parameters
    ----------
    lsb : float
        Size of one count [SI]. Zero switches quantisation off, and there are no counts.
    full_scale : float
        Output saturates at this and its negative, seen from `zero` [SI].
    bits : int
        Width of the signed word; it limits the counts too.
    zero : float
        What a count of 0 stands for [SI].
    """

    lsb: Annotated[float, Quantity("@value")] = 0.0
    full_scale: Annotated[float, Quantity("@value")] = math.inf
    bits: int = 16
    zero: Annotated[float, Quantity("@value")] = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        _checks.positive("lsb", self.lsb, allow_zero=True)
        if not _checks.positive("full_scale", self.full_scale, allow_inf=True) > self.lsb:
            raise ValueError(
                f"`full_scale` must be greater than `lsb`, got {self.full_scale!r} "
                f"and {self.lsb!r}."
            )
        _checks.whole("bits", self.bits, 2, 64)
        _checks.finite("zero", self.zero)

    def apply(self, x: ArrayLike) -> FloatArray:
        """Return the signal clipped and rounded to counts [SI]; NaN stays."""
        low, high = self._limits()
        clipped = np.clip(_checks.as_floats("x", x), low, high)
        if not self.lsb:
            return np.asarray(clipped)
        return np.asarray(self.zero + self.lsb * np.rint((clipped - self.zero) / self.lsb))

    def counts(self, x: ArrayLike) -> IntArray:
        """Return the raw counts of a signal.

        Parameters
        ----------
        x : array_like
            Finite values [SI].

        Returns
        -------
        ndarray of int64

        Raises
        ------
        ValueError
            If the converter has no counts (`lsb` is zero), or a value is not finite.
        """
        self._need_lsb()
        values = _checks.as_floats("x", x)
        if not np.isfinite(values).all():
            raise ValueError("`x` must be finite to have counts, got NaN or infinity.")
        low, high = self._limits()
        clipped = np.clip(values, low, high)
        return np.rint((clipped - self.zero) / self.lsb).astype(np.int64)

    def from_counts(self, counts: ArrayLike) -> FloatArray:
        """Return the SI value of raw counts; undoes `counts` to half a count."""
        self._need_lsb()
        return np.asarray(self.zero + self.lsb * _checks.as_floats("counts", counts))

    def saturated(self, x: ArrayLike) -> BoolArray:
        """Return which values [SI] lie at an end of the range, where the truth is unknown."""
        low, high = self._limits()
        values = _checks.as_floats("x", x)
        edge = _EDGE * self.lsb
        return np.asarray((values <= low + edge) | (values >= high - edge))

    def _limits(self) -> tuple[float, float]:
        low, high = self.zero - self.full_scale, self.zero + self.full_scale
        if not self.lsb:
            return low, high
        half = 2 ** (self.bits - 1)
        words = self.zero - half * self.lsb, self.zero + (half - 1) * self.lsb
        return max(low, words[0]), min(high, words[1])

    def _need_lsb(self) -> None:
        if not self.lsb:
            raise ValueError("`lsb` must be positive for raw counts, got 0.")
