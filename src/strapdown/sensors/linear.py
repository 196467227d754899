"""The deterministic errors of a triad: bias, scale, misalignment, quadratic terms; both ways.

All of them are ``y = M x + Q (x * x) + b``; the literature writes M in many ways, and each has a
named constructor here. x is the truth, y what the sensor says, both SI.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import NotConverged
from strapdown.sensors.settings import Quantity

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZERO: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
MOST_ITERATIONS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Linear:
    """Bias, scale, misalignment and quadratic non-linearity of three axes.

    Parameters
    ----------
    matrix : 3 rows of 3 floats
        M: output per input; not singular.
    bias : tuple of float
        b: constant offset of the output [SI].
    quadratic : 3 rows of 3 floats
        Q: output per square of the input [1/SI]. Zero switches it off.
    """

    matrix: Matrix = IDENTITY
    bias: Annotated[Triple, Quantity("@value")] = (0.0, 0.0, 0.0)
    quadratic: Matrix = ZERO

    def __post_init__(self) -> None:
        """Check shapes and that the matrix can be inverted."""
        matrix = _checks.as_matrices("matrix", self.matrix)
        if matrix.shape != (3, 3) or abs(np.linalg.det(matrix)) < 1e-9:
            raise ValueError("`matrix` must be one 3x3 matrix that can be inverted.")
        bias = _checks.as_vector("bias", self.bias)
        quadratic = _checks.as_matrices("quadratic", self.quadratic)
        object.__setattr__(self, "matrix", _rows(matrix))
        object.__setattr__(self, "bias", tuple(bias.tolist()))
        object.__setattr__(self, "quadratic", _rows(quadratic))

    # --- the literature's ways to write it ----------------------------------------------

    @classmethod
    def from_sense_axes(
        cls,
        scale: ArrayLike = (1.0, 1.0, 1.0),
        *,
        a_yz: float = 0.0,
        a_zy: float = 0.0,
        a_xz: float = 0.0,
        a_zx: float = 0.0,
        a_xy: float = 0.0,
        a_yx: float = 0.0,
        bias: ArrayLike = (0.0, 0.0, 0.0),
    ) -> "Linear":
        """Return the model of small turns of each sense axis, ``y = K T^-1 x + b``.

        ``T = [[1, -a_yz, a_zy], [a_xz, 1, -a_zx], [-a_xy, a_yx, 1]]``.

        Parameters
        ----------
        scale : array_like, shape (3,)
            Diagonal of K: output per input.
        a_yz, a_zy, a_xz, a_zx, a_xy, a_yx : float
            ``a_ij``: turn of sense axis i about axis j of the box [rad].
        bias : array_like, shape (3,)
            b [SI].

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis A, 6.2, equations (6.3) to (6.6); element (1, 2) of T, misprinted there,
               is corrected.
        """
        T = np.array([[1.0, -a_yz, a_zy], [a_xz, 1.0, -a_zx], [-a_xy, a_yx, 1.0]])
        matrix = np.diag(_checks.as_vector("scale", scale)) @ np.linalg.inv(T)
        return cls(matrix=_rows(matrix), bias=_triple("bias", bias))

    @classmethod
    def from_scale_and_misalignment(
        cls, M: ArrayLike, bias: ArrayLike = (0.0, 0.0, 0.0), nominal: float = 1.0
    ) -> "Linear":
        """Return ``y = S (I + M) x + b``: scale deviations on M's diagonal, misalignments off it.

        Parameters
        ----------
        M : array_like, shape (3, 3)
            Deviations from the identity.
        bias : array_like, shape (3,)
            b [SI].
        nominal : float
            Nominal scale factor S.

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis E1, 1.5.2, equation (1.5.1).
        """
        matrix = nominal * (np.eye(3) + _checks.as_matrices("M", M))
        return cls(matrix=_rows(matrix), bias=_triple("bias", bias))

    @classmethod
    def from_triangular(
        cls,
        scale: ArrayLike = (0.0, 0.0, 0.0),
        *,
        theta_yz: float = 0.0,
        theta_zx: float = 0.0,
        theta_zy: float = 0.0,
        bias: ArrayLike = (0.0, 0.0, 0.0),
    ) -> "Linear":
        """Return the nine-parameter model in which the x axis is right by definition.

        ``M = [[1 + sx, 0, 0], [-theta_yz, 1 + sy, 0], [theta_zy, -theta_zx, 1 + sz]]``.

        Parameters
        ----------
        scale : array_like, shape (3,)
            Scale errors sx, sy, sz.
        theta_yz, theta_zx, theta_zy : float
            Turn of the y axis about z, of the z axis about x and about y [rad].
        bias : array_like, shape (3,)
            b [SI].

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis E2, 6.2, equation (6.2.7), in the form of its program: the printed matrix
               has theta_zx and theta_zy exchanged.
        """
        sx, sy, sz = _checks.as_vector("scale", scale)
        matrix = (
            (1.0 + sx, 0.0, 0.0),
            (-theta_yz, 1.0 + sy, 0.0),
            (theta_zy, -theta_zx, 1.0 + sz),
        )
        return cls(matrix=matrix, bias=_triple("bias", bias))

    @classmethod
    def from_gain_and_alignment(
        cls, gain: ArrayLike, alignment: ArrayLike, bias: ArrayLike = (0.0, 0.0, 0.0)
    ) -> "Linear":
        """Return ``y = G R x + c``: a gain for each sensitive axis, and the axes' directions.

        Parameters
        ----------
        gain : array_like, shape (3,)
            Diagonal of G.
        alignment : array_like, shape (3, 3)
            R: its rows are the sensitive axes.
        bias : array_like, shape (3,)
            c [SI].

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis C, 3.4, equation (3.6); D, appendix B, is the case of R = I.
        """
        R = _checks.as_matrices("alignment", alignment)
        matrix = np.diag(_checks.as_vector("gain", gain)) @ R
        return cls(matrix=_rows(matrix), bias=_triple("bias", bias))

    @classmethod
    def from_hard_and_soft_iron(
        cls,
        hard_iron: ArrayLike = (0.0, 0.0, 0.0),
        soft_iron: ArrayLike = IDENTITY,
        *,
        axes: "Linear | None" = None,
    ) -> "Linear":
        """Return a magnetometer between iron: ``y = M_si^-1 A x + b_hi``.

        With scale factors of one this is the form ``x = T M_si (y - b_hi)`` of [1]_.

        Parameters
        ----------
        hard_iron : array_like, shape (3,)
            b_hi: field of what is magnetic by itself, as the output shows it [T].
        soft_iron : array_like, shape (3, 3)
            M_si: takes the ellipsoid of the outputs back to a sphere.
        axes : Linear, optional
            A: the sensor's own axes, such as `from_sense_axes` makes (T^-1); ideal by default.
            Its bias adds to the hard iron.

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis A, 6.5, equation (6.21).
        """
        soft = _checks.as_matrices("soft_iron", soft_iron)
        own = axes if axes is not None else cls()
        matrix = np.linalg.inv(soft) @ np.array(own.matrix)
        bias = _checks.as_vector("hard_iron", hard_iron) + np.array(own.bias)
        return cls(matrix=_rows(matrix), bias=_triple("bias", bias))

    @classmethod
    def from_calibration(cls, C: ArrayLike) -> "Linear":
        """Return the errors that a calibration matrix undoes: ``x = C (y, 1)``.

        Parameters
        ----------
        C : array_like, shape (3, 4)
            Calibration matrix, the offset in the fourth column [SI].

        Returns
        -------
        Linear

        References
        ----------
        .. [1] Thesis A, 6.2, equations (6.8) and (6.9).
        """
        full = _checks.as_matrices("C", C, 3, 4)
        matrix = np.linalg.inv(full[:, :3])
        return cls(matrix=_rows(matrix), bias=_triple("bias", -matrix @ full[:, 3]))

    # --- use ----------------------------------------------------------------------------

    def with_bias(self, bias: ArrayLike) -> "Linear":
        """Return the same errors with another bias [SI]."""
        return replace(self, bias=_triple("bias", bias))

    @property
    def is_ideal(self) -> bool:
        """Whether nothing is changed."""
        return self == Linear()

    def apply(self, x: ArrayLike) -> FloatArray:
        """Return what the sensor makes of the truth, shape (..., 3)."""
        true = _checks.as_vectors("x", x, allow_nan=True)
        out = true @ np.array(self.matrix).T + np.array(self.bias)
        if self.quadratic != ZERO:
            out = out + (true * true) @ np.array(self.quadratic).T
        return np.asarray(out)

    def invert(self, y: ArrayLike) -> FloatArray:
        """Return the truth behind what the sensor says; undoes `apply` to rounding.

        Parameters
        ----------
        y : array_like, shape (..., 3)
            Outputs [SI].

        Returns
        -------
        ndarray, shape (..., 3)

        Raises
        ------
        NotConverged
            If the quadratic term is so large that the iteration finds no input.
        """
        given = _checks.as_vectors("y", y, allow_nan=True)
        back = np.linalg.inv(np.array(self.matrix)).T
        offset = given - np.array(self.bias)
        x = np.asarray(offset @ back)
        if self.quadratic == ZERO or x.size == 0:
            return x
        Q, change = np.array(self.quadratic).T, float("inf")
        largest = float(np.nanmax(np.abs(x), initial=0.0))
        for _ in range(MOST_ITERATIONS):
            before, last = x, change
            x = np.asarray((offset - (x * x) @ Q) @ back)
            change = float(np.nanmax(np.abs(x - before), initial=0.0))
            if change <= 4e-16 * largest:
                return x
            if change > 2.0 * last:  # it runs away
                break
        if not change <= 1e-12 * largest:
            raise NotConverged(
                "inverse of the quadratic error", MOST_ITERATIONS, change, "lower `quadratic`"
            )
        return x


def _rows(matrix: Any) -> Matrix:
    a, b, c = (tuple(float(v) for v in row) for row in matrix)
    return a, b, c  # type: ignore[return-value]


def _triple(name: str, value: ArrayLike) -> Triple:
    x, y, z = _checks.as_vector(name, value)
    return float(x), float(y), float(z)
