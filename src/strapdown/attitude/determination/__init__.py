"""Attitude at one instant from directions known in n and measured in b.

All functions take many epochs at once and return a `Determination`: attitude, its covariance,
the loss, and per epoch a flag that says what is wrong with the geometry. Vectors of shape
(n, m, 3) are n epochs of m vectors: an epoch without a unique attitude is NaN and flagged.
Vectors of shape (m, 3) are one epoch: it raises instead.
"""

from strapdown.attitude.determination.compass import compass, master_slave, tilt
from strapdown.attitude.determination.iterated import gauss_newton, gradient_descent
from strapdown.attitude.determination.result import Determination, Observability
from strapdown.attitude.determination.triad import triad
from strapdown.attitude.determination.wahba import davenport, quest, svd

__all__ = [
    "Determination",
    "Observability",
    "compass",
    "davenport",
    "gauss_newton",
    "gradient_descent",
    "master_slave",
    "quest",
    "svd",
    "tilt",
    "triad",
]
