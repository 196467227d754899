"""How fast a curve grows."""

import math

import numpy as np

from strapdown._types import FloatArray


def slope(t: FloatArray, y: FloatArray, first: float, last: float) -> float:
    """Return the slope of |y| over t in log-log axes.

    Parameters
    ----------
    t, y : ndarray, shape (n,)
        The curve; t increases.
    first, last : float
        Between which t the slope is taken.

    Returns
    -------
    float
        The power of t that joins both ends.
    """
    ends = np.interp([first, last], t, np.abs(y))
    return float(math.log(ends[1] / ends[0]) / math.log(last / first))
