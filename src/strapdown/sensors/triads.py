"""Gyroscope, accelerometer and magnetometer: three axes with all their errors, composed.

The order is that of the hardware: the sensing element turns the truth into a signal with bias,
scale, misalignment, non-linearity, temperature and g-sensitivity; the low-pass and the sampling
follow; noise is added; the converter clips and rounds.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.recording import Mag
from strapdown.rotation import dcm_from_quat, dcm_from_rotvec
from strapdown.sensors.digital import Digital
from strapdown.sensors.linear import ZERO, Linear, Matrix
from strapdown.sensors.noise import Noise
from strapdown.sensors.sampling import Sampling, Ticks
from strapdown.sensors.settings import Quantity
from strapdown.truth import Truth

Triple = tuple[float, float, float]
NONE: Triple = (0.0, 0.0, 0.0)


class Samples(NamedTuple):
    """What one sensor of an IMU said.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Stamps [s].
    value : ndarray, shape (n, 3)
        Output [SI].
    """

    t: FloatArray
    value: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How the parts of one type differ, from which `individual` draws one.

    Parameters
    ----------
    scale : float
        Scale factors lie within this of the nominal one, evenly [1].
    misalignment : float
        Each axis is turned by up to this against the case, evenly [rad].
    non_orthogonality : float
        Angles between the axes lie within this of 90 deg, evenly [rad]: the axes are turned
        together, and by so much against each other. Infinite turns each on its own.
    bias : float
        Standard deviation of the constant bias [SI].
    nonlinearity : float
        Largest departure from a straight line over the range, as a share of full scale;
        the quadratic term lies within what makes it, evenly.
    """

    scale: float = 0.0
    misalignment: Annotated[float, Quantity("angle")] = 0.0
    non_orthogonality: Annotated[float, Quantity("angle")] = math.inf
    bias: Annotated[float, Quantity("@value")] = 0.0
    nonlinearity: float = 0.0

    def __post_init__(self) -> None:
        """Check that nothing is negative."""
        for name in ("scale", "misalignment", "bias", "nonlinearity"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        if (
            _checks.positive(
                "non_orthogonality", self.non_orthogonality, allow_zero=True, allow_inf=True
            )
            < math.inf
        ):
            limit = 2.0 * self.misalignment
            _checks.in_range("non_orthogonality", self.non_orthogonality, 0.0, limit)

    def axes(self, rng: np.random.Generator) -> FloatArray:
        """Return the sensitive axes of one part in its case, as rows, shape (3, 3).

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of the randomness.

        Returns
        -------
        ndarray, shape (3, 3)
        """
        off = rng.uniform(-1.0, 1.0, (3, 3)) * (1.0 - np.eye(3))
        if self.non_orthogonality == math.inf:
            return np.asarray(np.eye(3) + self.misalignment * off)
        # half of an angle between two axes is each one's: that much less turns all of them
        half = 0.5 * self.non_orthogonality
        together = (self.misalignment - half) * off[[2, 0, 1], [1, 2, 0]]
        apart = half * (np.triu(off) + np.triu(off).T)
        return np.asarray((np.eye(3) + apart) @ dcm_from_rotvec(together))


@dataclass(frozen=True, slots=True, kw_only=True)
class Triad:
    """What the three kinds of triad have in common.

    Parameters
    ----------
    linear : Linear
        Bias, scale, misalignment, quadratic terms.
    noise : Noise
        Turn-on bias, drifts, flicker, white noise.
    sampling : Sampling
        Rate, low-pass, delay, jitter, dropouts.
    digital : Digital
        Range and counts.
    temp_bias : tuple of float
        Change of the bias per degree [SI/K].
    temp_scale : tuple of float
        Relative change of the scale factors per degree [1/K].
    temp_reference : float
        Temperature at which both vanish [degC].
    spread : Spread
        How parts of this type differ.
    """

    linear: Linear = field(default_factory=Linear)
    noise: Noise = field(default_factory=Noise)
    sampling: Sampling = field(default_factory=Sampling)
    digital: Digital = field(default_factory=Digital)
    temp_bias: Triple = NONE
    temp_scale: Triple = NONE
    temp_reference: Annotated[float, Quantity("temperature")] = 25.0
    spread: Spread = field(default_factory=Spread)

    def __post_init__(self) -> None:
        """Check the coefficients of temperature."""
        _checks.as_vector("temp_bias", self.temp_bias)
        _checks.as_vector("temp_scale", self.temp_scale)
        _checks.finite("temp_reference", self.temp_reference)

    def individual(self, rng: np.random.Generator) -> Self:
        """Return one part of this type: its constant errors drawn from the spread.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of the randomness.

        Returns
        -------
        Gyro, Accelerometer or Magnetometer
            With `linear` replaced and a spread of zero.
        """
        s = self.spread
        scale = 1.0 + s.scale * rng.uniform(-1.0, 1.0, 3)
        axes = s.axes(rng)
        bias = np.array(self.linear.bias) + s.bias * rng.standard_normal(3)
        share = 2.0 * s.nonlinearity * rng.uniform(-1.0, 1.0, 3)
        quadratic = np.array(self.linear.quadratic)
        if math.isfinite(self.digital.full_scale):
            quadratic = quadratic + np.diag(share / self.digital.full_scale)
        linear = Linear(
            matrix=np.diag(scale) @ axes @ np.array(self.linear.matrix),
            bias=bias,  # type: ignore[arg-type]
            quadratic=quadratic,  # type: ignore[arg-type]
        )
        return replace(self, linear=linear, spread=Spread())

    def _output(
        self,
        t: FloatArray,
        x: FloatArray,
        rng: np.random.Generator,
        temp_degc: ArrayLike,
        ticks: Ticks | None,
    ) -> Samples:
        """Return the samples of a signal at the truth's times."""
        tick_rng, noise_rng, early_rng = rng.spawn(3)
        when = self.sampling.ticks(t, tick_rng) if ticks is None else ticks
        signal = self._element(x, temp_degc)
        noise = self.noise
        if self.sampling.filters_noise and len(t) > 1:
            early = Noise(white=noise.white)
            signal = signal + early.sample(len(t), float(np.median(np.diff(t))), early_rng)
            noise = noise.without_white()
        seen = self.sampling.sample(t, signal, when)
        seen = seen + noise.sample(len(seen), self.sampling.step(t), noise_rng)
        return Samples(when.stamp[when.kept], self.digital.apply(seen)[when.kept])

    def _element(self, x: FloatArray, temp_degc: ArrayLike) -> FloatArray:
        """Return the sensing element's signal."""
        warm = _warmth(temp_degc, len(x), self.temp_reference)
        scaled = x if self.temp_scale == NONE else x * (1.0 + warm * np.array(self.temp_scale))
        out = self.linear.apply(scaled)
        return out if self.temp_bias == NONE else out + warm * np.array(self.temp_bias)

    def _undone(self, y: ArrayLike, temp_degc: ArrayLike) -> FloatArray:
        """Return the input of `_element`; NaN where the output is saturated."""
        given = _checks.as_samples("value", y, allow_nan=True)
        warm = _warmth(temp_degc, len(given), self.temp_reference)
        x = self.linear.invert(given - warm * np.array(self.temp_bias))
        x = x / (1.0 + warm * np.array(self.temp_scale))
        if math.isfinite(self.digital.full_scale):
            clipped = self.digital.saturated(given).any(axis=1, keepdims=True)
            x = np.where(clipped, np.nan, x)
        return x


@dataclass(frozen=True, slots=True, kw_only=True)
class Gyro(Triad):
    """Gyroscope.

    Parameters
    ----------
    g_sensitivity : 3 rows of 3 floats
        Bias per specific force [rad/s per m/s^2].
    """

    g_sensitivity: Matrix = ZERO

    def __post_init__(self) -> None:
        """Check the matrix too."""
        Triad.__post_init__(self)
        _checks.as_matrices("g_sensitivity", self.g_sensitivity)

    def apply(
        self,
        truth: Truth,
        rng: np.random.Generator,
        *,
        temp_degc: ArrayLike = 25.0,
        ticks: Ticks | None = None,
    ) -> Samples:
        """Return what the gyroscope says of a motion.

        Parameters
        ----------
        truth : Truth
            The motion, at the sensor's rate or, better, at several times it.
        rng : numpy.random.Generator
            Source of the randomness.
        temp_degc : array_like, scalar or shape (n,)
            Temperature of the sensor at the truth's times [degC].
        ticks : Ticks, optional
            Sampling times shared with another sensor; drawn from `rng` by default.

        Returns
        -------
        Samples
            Angular rate [rad/s].
        """
        x = truth.omega_ib_b
        if self.g_sensitivity != ZERO:
            # a bias, so it is not scaled: brought to the input, where all else is undone
            x = x + truth.f_b @ self._g_at_input().T
        return self._output(truth.t, x, rng, temp_degc, ticks)

    def compensate(
        self, gyr: ArrayLike, acc: ArrayLike | None = None, temp_degc: ArrayLike = 25.0
    ) -> FloatArray:
        """Return the rate behind the outputs: the deterministic errors undone.

        Parameters
        ----------
        gyr : array_like, shape (n, 3)
            Outputs [rad/s].
        acc : array_like, shape (n, 3), optional
            True specific force [m/s^2], needed where there is a g-sensitivity.
        temp_degc : array_like, scalar or shape (n,)
            Temperature [degC].

        Returns
        -------
        ndarray, shape (n, 3)
            Exact without noise, rounding and filtering; NaN where the output is saturated.

        Raises
        ------
        ValueError
            If there is a g-sensitivity and `acc` is missing.
        """
        x = self._undone(gyr, temp_degc)
        if self.g_sensitivity == ZERO:
            return x
        if acc is None:
            raise ValueError("`acc` must be given to undo a g-sensitivity, got None.")
        return x - _checks.as_samples("acc", acc, allow_nan=True) @ self._g_at_input().T

    def _g_at_input(self) -> FloatArray:
        return np.asarray(np.linalg.solve(self.linear.matrix, np.array(self.g_sensitivity)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Accelerometer(Triad):
    """Accelerometer.

    Parameters are those of `Triad`.
    """

    def apply(
        self,
        truth: Truth,
        rng: np.random.Generator,
        *,
        temp_degc: ArrayLike = 25.0,
        ticks: Ticks | None = None,
    ) -> Samples:
        """Return what the accelerometer says of a motion [m/s^2]; see `Gyro.apply`."""
        return self._output(truth.t, truth.f_b, rng, temp_degc, ticks)

    def compensate(self, acc: ArrayLike, temp_degc: ArrayLike = 25.0) -> FloatArray:
        """Return the specific force behind the outputs [m/s^2]; see `Gyro.compensate`."""
        return self._undone(acc, temp_degc)


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnetometer(Triad):
    """Magnetometer; hard and soft iron are in `linear`, see `Linear.from_hard_and_soft_iron`.

    Parameters are those of `Triad`.
    """

    def apply(
        self,
        truth: Truth,
        rng: np.random.Generator,
        *,
        temp_degc: ArrayLike = 25.0,
        ticks: Ticks | None = None,
    ) -> Mag:
        """Return what the magnetometer says of a motion [T]; see `Gyro.apply`."""
        m_b = np.einsum("kji,kj->ki", dcm_from_quat(truth.q_nb), truth.m_n)
        t, value = self._output(truth.t, m_b, rng, temp_degc, ticks)
        return Mag(t=t, mag=value)

    def compensate(self, mag: ArrayLike, temp_degc: ArrayLike = 25.0) -> FloatArray:
        """Return the field behind the outputs [T]; see `Gyro.compensate`."""
        return self._undone(mag, temp_degc)


def _warmth(temp_degc: ArrayLike, n: int, reference: float) -> FloatArray:
    """Return the temperature over the reference, shape (n, 1)."""
    temp = _checks.as_floats("temp_degc", temp_degc)
    if temp.ndim not in (0, 1) or (temp.ndim == 1 and len(temp) != n):
        raise ValueError(f"`temp_degc` must be one number or have shape ({n},), got {temp.shape}.")
    return np.broadcast_to(temp - reference, (n,))[:, np.newaxis]
