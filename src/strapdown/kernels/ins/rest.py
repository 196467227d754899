"""Rest, seen by the IMU alone and causally: both sensors quiet for the whole of a window.

The window of four blocks slides by one block, so that sums of each block are all there is to keep.
Quiet means quiet as a parked car is: a car that creeps shakes its gyroscope three times as much.
The parameters say how much a parked car shakes; the noise of the sensor comes on top, as the
quietest window so far shows it.
"""

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.ins.layout import (
    AT_REST,
    BLOCK_DT,
    FLOOR_A,
    FLOOR_G,
    REST_A,
    REST_G,
    REST_T,
    RING,
    RING_BLOCK,
)

BLOCKS = 4
SPREAD = 1.2  # of a variance over a window of noise
MOST = 3.0  # a quietest window above so many times the parameter's square was no rest


# fmt: off
@kernel
def feed(
    x: Vec, p: Vec, dt: float, gx: float, gy: float, gz: float, fx: float, fy: float, fz: float
) -> bool:
    """Add one sample; True when a block became full and ``x[AT_REST]`` is new."""
    # fmt: on
    x[RING] += 1.0
    x[RING + 1] += gx
    x[RING + 2] += gy
    x[RING + 3] += gz
    x[RING + 4] += fx
    x[RING + 5] += fy
    x[RING + 6] += fz
    x[RING + 7] += gx * gx
    x[RING + 8] += gy * gy
    x[RING + 9] += gz * gz
    x[RING + 10] += fx * fx
    x[RING + 11] += fy * fy
    x[RING + 12] += fz * fz
    x[BLOCK_DT] += dt
    if x[BLOCK_DT] < p[REST_T] / float(BLOCKS) - 0.25 * dt:
        return False
    for i in range(BLOCKS * RING_BLOCK - 1, -1, -1):
        x[RING + RING_BLOCK + i] = x[RING + i]
    for i in range(RING_BLOCK):
        x[RING + i] = 0.0
    x[BLOCK_DT] = 0.0
    x[AT_REST] = 1.0 if _quiet(x, p) else 0.0
    return True


@kernel
def _quiet(x: Vec, p: Vec) -> bool:
    """Whether the deviations within the window, summed over the axes, are small."""
    count = 0.0
    for b in range(1, BLOCKS + 1):
        if x[RING + RING_BLOCK * b] < 2.0:
            return False
        count += x[RING + RING_BLOCK * b]
    gyr = 0.0
    acc = 0.0
    for i in range(6):
        s = 0.0
        s2 = 0.0
        for b in range(1, BLOCKS + 1):
            s += x[RING + RING_BLOCK * b + 1 + i]
            s2 += x[RING + RING_BLOCK * b + 7 + i]
        variance = s2 / count - (s / count) * (s / count)
        if i < 3:
            gyr += variance
        else:
            acc += variance
    if x[FLOOR_G] == 0.0 or gyr < x[FLOOR_G]:
        x[FLOOR_G] = gyr
    if x[FLOOR_A] == 0.0 or acc < x[FLOOR_A]:
        x[FLOOR_A] = acc
    g = p[REST_G] * p[REST_G]
    a = p[REST_A] * p[REST_A]
    quiet: bool = gyr < g + SPREAD * min(x[FLOOR_G], MOST * g)
    return quiet and acc < a + SPREAD * min(x[FLOOR_A], MOST * a)


@kernel
def mean_rate(x: Vec, axis: int) -> float:
    """Mean of one axis of the gyroscope over the window [rad/s]."""
    count = 0.0
    s = 0.0
    for b in range(1, BLOCKS + 1):
        count += x[RING + RING_BLOCK * b]
        s += x[RING + RING_BLOCK * b + 1 + axis]
    return s / max(count, 1.0)


@kernel
def forget(x: Vec) -> None:
    """Empty the window, after a gap."""
    for i in range((BLOCKS + 1) * RING_BLOCK):
        x[RING + i] = 0.0
    x[BLOCK_DT] = 0.0
    x[AT_REST] = 0.0
