"""How well directions cover the sphere: what share of it, and where the largest hole is."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from strapdown._checks import as_samples
from strapdown._types import FloatArray
from strapdown.errors import InputError

_PROBES = 2000  # directions that are asked for their nearest sample: about 4 deg apart
_AXIS_NAMES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Coverage:
    """How directions are spread.

    Attributes
    ----------
    fraction : float
        Share of equal cells of the sphere that hold a direction. With n directions there are
        n/4 cells, at least 12 and at most 100.
    hole : float
        Largest angle from any point of the sphere to its nearest direction [rad].
    hole_direction : ndarray, shape (3,)
        Centre of that hole.
    """

    fraction: float
    hole: float
    hole_direction: FloatArray

    def __str__(self) -> str:
        """One phrase: share and hole."""
        return (
            f"the directions cover {100.0 * self.fraction:.0f} % of the sphere, with none within "
            f"{math.degrees(self.hole):.0f} deg of {direction_name(self.hole_direction)}"
        )


def fibonacci_sphere(n: int) -> FloatArray:
    """Return n unit vectors spread evenly over the sphere, shape (n, 3)."""
    k = np.arange(n) + 0.5
    z = 1.0 - 2.0 * k / n
    longitude = math.pi * (1.0 + math.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.column_stack((radius * np.cos(longitude), radius * np.sin(longitude), z))


def unit_vectors(name: str, vectors: ArrayLike) -> FloatArray:
    """Return vectors divided by their norm, shape (n, 3); zero vectors are refused."""
    array = as_samples(name, vectors)
    norm = np.linalg.norm(array, axis=1, keepdims=True)
    if not (norm > 0.0).all():
        row = int(np.argmin(norm[:, 0]))
        raise InputError(f"`{name}` must not be zero, got {array[row]} in row {row}.")
    return np.asarray(array / norm)


def coverage(directions: ArrayLike) -> Coverage:
    """Return how well directions cover the sphere.

    Parameters
    ----------
    directions : array_like, shape (n, 3)
        Vectors; their length does not matter.

    Returns
    -------
    Coverage
    """
    units = unit_vectors("directions", directions)
    if not len(units):
        return Coverage(0.0, math.pi, np.array([0.0, 0.0, 1.0]))
    cells = fibonacci_sphere(min(100, max(12, len(units) // 4)))
    filled = len(np.unique(cKDTree(cells).query(units)[1]))
    probes = fibonacci_sphere(_PROBES)
    chord = cKDTree(units).query(probes)[0]
    emptiest = int(np.argmax(chord))
    hole = 2.0 * math.asin(min(1.0, 0.5 * float(chord[emptiest])))
    return Coverage(filled / len(cells), hole, probes[emptiest])


def direction_name(direction: FloatArray) -> str:
    """Return ``"+x"`` for a direction close to an axis, else its components."""
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) > math.cos(math.radians(25.0)):
        return f"{'+' if direction[k] > 0.0 else '-'}{_AXIS_NAMES[k]}"
    return "(" + ", ".join(f"{c:.1f}" for c in direction) + ")"
