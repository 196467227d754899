"""Turn of the body and velocity gained, in the axes that the body had at the start."""

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.quat import exp, mul, rotate


@kernel
def run(t: Vec, gyr: Mat, acc: Mat, out: Mat) -> None:
    """Write ``q_b0b`` and the integral of ``f_b0`` at each sample; the first is the start.

    The specific force acts with the attitude of the middle of its interval.
    """
    qw, qx, qy, qz = 1.0, 0.0, 0.0, 0.0
    vx, vy, vz = 0.0, 0.0, 0.0
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            h = 0.5 * dt
            ew, ex, ey, ez = exp(gyr[k, 0] * h, gyr[k, 1] * h, gyr[k, 2] * h)
            qw, qx, qy, qz = mul(qw, qx, qy, qz, ew, ex, ey, ez)
            fx, fy, fz = rotate(qw, qx, qy, qz, acc[k, 0], acc[k, 1], acc[k, 2])
            vx += fx * dt
            vy += fy * dt
            vz += fz * dt
            qw, qx, qy, qz = mul(qw, qx, qy, qz, ew, ex, ey, ez)
            s = 1.5 - 0.5 * (qw * qw + qx * qx + qy * qy + qz * qz)
            qw, qx, qy, qz = qw * s, qx * s, qy * s, qz * s
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = qw, qx, qy, qz
        out[k, 4], out[k, 5], out[k, 6] = vx, vy, vz
