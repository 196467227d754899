"""Gyr_comp and ACC_comp of thesis E, 7.3: calibration and temperature; the bias comes later.

``true = S^-1 (measured - offset) - slope (T - 25 degC)``. A sample at the end of the sensor's
range stays as it is, so that it is known for what it is.
"""

from math import isinf

from strapdown.kernels._jit import Vec, kernel

REFERENCE = 25.0  # [degC]


# fmt: off
@kernel
def compensate(
    p: Vec, at: int, end: float, has_temp: float, temp: float, mx: float, my: float, mz: float
) -> tuple[float, float, float]:
    """Compensate one sample by the S^-1, offset and slope in ``p[at]``; inf stays absent."""
    # fmt: on
    if isinf(mx) or abs(mx) >= end or abs(my) >= end or abs(mz) >= end:
        return mx, my, mz
    x, y, z = mx - p[at + 9], my - p[at + 10], mz - p[at + 11]
    cx = p[at] * x + p[at + 1] * y + p[at + 2] * z
    cy = p[at + 3] * x + p[at + 4] * y + p[at + 5] * z
    cz = p[at + 6] * x + p[at + 7] * y + p[at + 8] * z
    if has_temp > 0.0:
        warm = temp - REFERENCE
        cx -= p[at + 12] * warm
        cy -= p[at + 13] * warm
        cz -= p[at + 14] * warm
    return cx, cy, cz
