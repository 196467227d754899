"""Sums of squared differences of the integrated signal: the Allan family.

`x` is the running sum of the samples in units of one sample, ``x[k] = y[0] + ... + y[k-1]``.
A mean over m samples is then ``(x[k+m] - x[k]) / m``, and the difference of two neighbouring
means is ``(x[k+2m] - 2 x[k+m] + x[k]) / m``.

The shifted copies of `x` come in as views of equal length: one index serves them all, and the
compiler can use vector instructions. `lanes` holds partial sums, which lets it do so without
permission to reorder additions, and rounds better than one long sum.
"""

from strapdown.kernels._jit import Vec, kernel


@kernel
def integrate(y: Vec, mean: float, x: Vec) -> None:
    """Write the running sum of ``y - mean`` into `x`, which is one longer and starts at 0."""
    s = 0.0
    x[0] = 0.0
    for k in range(y.shape[0]):
        s += y[k] - mean
        x[k + 1] = s


@kernel
def second_difference_power(x0: Vec, x1: Vec, x2: Vec, lanes: Vec) -> float:
    """Sum of ``(x2 - 2 x1 + x0)**2``."""
    n = x0.shape[0]
    width = lanes.shape[0]
    whole = n - n % width
    for j in range(width):
        lanes[j] = 0.0
    for block in range(n // width):
        start = block * width
        for j in range(width):
            d = x2[start + j] - 2.0 * x1[start + j] + x0[start + j]
            lanes[j] += d * d
    s = 0.0
    for j in range(width):
        s += lanes[j]
    for i in range(whole, n):
        d = x2[i] - 2.0 * x1[i] + x0[i]
        s += d * d
    return s


@kernel
def third_difference_power(x0: Vec, x1: Vec, x2: Vec, x3: Vec, lanes: Vec) -> float:
    """Sum of ``(x3 - 3 x2 + 3 x1 - x0)**2``."""
    n = x0.shape[0]
    width = lanes.shape[0]
    whole = n - n % width
    for j in range(width):
        lanes[j] = 0.0
    for block in range(n // width):
        start = block * width
        for j in range(width):
            d = (x3[start + j] - x0[start + j]) - 3.0 * (x2[start + j] - x1[start + j])
            lanes[j] += d * d
    s = 0.0
    for j in range(width):
        s += lanes[j]
    for i in range(whole, n):
        d = (x3[i] - x0[i]) - 3.0 * (x2[i] - x1[i])
        s += d * d
    return s


@kernel
def averaged_second_difference_power(x: Vec, m: int) -> float:
    """Sum over all starts of the squared sum of m neighbouring second differences of span m."""
    n = x.shape[0]
    v = 0.0
    for i in range(m):
        v += x[i + 2 * m] - 2.0 * x[i + m] + x[i]
    s = v * v
    for i in range(n - 3 * m):
        v += (x[i + 3 * m] - x[i]) - 3.0 * (x[i + 2 * m] - x[i + m])
        s += v * v
    return s


@kernel
def reflected_second_difference_power(x: Vec, m: int) -> float:
    """Sum of squared second differences of span m about each inner point.

    Beyond its ends `x` is continued by reflection in its end points, so that every inner
    point has a difference; m must be less than the length of `x`.
    """
    n = x.shape[0]
    last = n - 1
    s = 0.0
    for i in range(1, last):
        low = x[i - m] if i >= m else 2.0 * x[0] - x[m - i]
        high = x[i + m] if i + m <= last else 2.0 * x[last] - x[2 * last - i - m]
        d = (low - x[i]) + (high - x[i])
        s += d * d
    return s
