"""Array types that the whole package shares."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

# Three components: a tuple of floats in real-time code, an array elsewhere.
Vector3: TypeAlias = tuple[float, float, float] | FloatArray
Vector4: TypeAlias = tuple[float, float, float, float] | FloatArray
