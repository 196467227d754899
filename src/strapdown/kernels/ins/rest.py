"""Rest, seen by the IMU alone and causally: both sensors quiet for the whole of a window.

The window of four blocks slides by one block, so that sums of each block are all there is to keep.
Quiet means quiet as a parked car is: a car that creeps shakes its gyroscope three times as much.
The parameters say how much a parked car shakes; the noise of the sensor comes on top, as the
steps from sample to sample show it in the block with the smallest of them so far. Steps tell noise
from motion, which is slow, so that a car need not have stood for this.
"""

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.ins.layout import (
    AT_REST,
    BLOCK_DT,
    LAST_F,
    LAST_G,
    NOISE_A,
    NOISE_G,
    REST_A,
    REST_G,
    REST_T,
    RING,
    RING_BLOCK,
    STEPS,
)

BLOCKS = 4
SPREAD = 1.4  # of a variance over a window of noise, against the least seen so far
LEAST_STEPS = 24.0  # that make a measurement of noise
LEAST_TIME = 0.5  # and take so long [s]


# fmt: off
@kernel
def measure_noise(
    x: Vec, dt: float, gx: float, gy: float, gz: float, fx: float, fy: float, fz: float
) -> None:
    """Measure the white noise of both sensors by the steps between neighbouring samples."""
    # fmt: on
    dx, dy, dz = gx - x[LAST_G], gy - x[LAST_G + 1], gz - x[LAST_G + 2]
    x[STEPS] += dx * dx + dy * dy + dz * dz
    dx, dy, dz = fx - x[LAST_F], fy - x[LAST_F + 1], fz - x[LAST_F + 2]
    x[STEPS + 1] += dx * dx + dy * dy + dz * dz
    x[STEPS + 2] += 1.0
    x[STEPS + 3] += dt
    n = x[STEPS + 2]
    if n < LEAST_STEPS or x[STEPS + 3] < LEAST_TIME:
        return
    # a step has twice the variance of a sample, and three axes are in the sum
    k = x[STEPS + 3] / (6.0 * n * n)
    if x[NOISE_G] == 0.0 or k * x[STEPS] < x[NOISE_G]:
        x[NOISE_G] = k * x[STEPS]
    if x[NOISE_A] == 0.0 or k * x[STEPS + 1] < x[NOISE_A]:
        x[NOISE_A] = k * x[STEPS + 1]
    for i in range(4):
        x[STEPS + i] = 0.0


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
    k = SPREAD * 3.0 * count / p[REST_T]
    quiet: bool = gyr < p[REST_G] * p[REST_G] + k * x[NOISE_G]
    return quiet and acc < p[REST_A] * p[REST_A] + k * x[NOISE_A]


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
    for i in range(4):
        x[STEPS + i] = 0.0
    for i in range((BLOCKS + 1) * RING_BLOCK):
        x[RING + i] = 0.0
    x[BLOCK_DT] = 0.0
    x[AT_REST] = 0.0
