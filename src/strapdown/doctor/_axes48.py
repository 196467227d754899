"""The 48 ways to permute and reflect three axes, and their names."""

import itertools
from typing import Final

import numpy as np

from strapdown._types import FloatArray


def _all() -> FloatArray:
    """Return the signed permutations, shape (48, 3, 3), the identity first."""
    matrices = np.zeros((48, 3, 3))
    pairs = itertools.product(
        itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)
    )
    for k, (order, signs) in enumerate(pairs):
        matrices[k, range(3), order] = signs
    return matrices


SIGNED: Final = _all()
DETERMINANTS: Final = np.round(np.linalg.det(SIGNED))
IDENTITY: Final = 0


def index_of(matrix: FloatArray) -> int:
    """Return the number of a signed permutation."""
    return int(np.abs(SIGNED - matrix).sum(axis=(1, 2)).argmin())


def name_of(matrix: FloatArray) -> str:
    """Return the axes that a signed permutation takes, as ``--axes`` writes them: ``y,-x,z``."""
    text = []
    for row in np.asarray(matrix):
        j = int(np.abs(row).argmax())
        text.append(("-" if row[j] < 0.0 else "") + "xyz"[j])
    return ",".join(text)
