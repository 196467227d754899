"""Unit quaternions ``q = (w, x, y, z)``, Hamilton product, as plain floats.

``q_nb`` takes components in b to components in n: ``v_n = C(q_nb) v_b``. Vectors that
have no direction, such as a zero acceleration, give NaN: the caller decides what to do.
"""

from math import atan2, cos, nan, sin, sqrt

from strapdown.kernels._jit import kernel

# A magnetic field within this sine of the vertical has no horizontal direction.
MIN_SINE = 1e-6


# fmt: off
@kernel
def mul(
    aw: float, ax: float, ay: float, az: float,
    bw: float, bx: float, by: float, bz: float,
) -> tuple[float, float, float, float]:
    """Hamilton product ``a * b``; ``q_ac = q_ab * q_bc``."""
    # fmt: on
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@kernel
def conj(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Conjugate: the inverse rotation; ``q_ba`` of ``q_ab``."""
    return w, -x, -y, -z


@kernel
def normalize(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Scale to unit norm."""
    s = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return w * s, x * s, y * s, z * s


@kernel
def exp(rx: float, ry: float, rz: float) -> tuple[float, float, float, float]:
    """Quaternion of the rotation vector ``(rx, ry, rz)`` [rad]."""
    angle2 = rx * rx + ry * ry + rz * rz
    if angle2 < 1e-4:  # series: first terms left out are angle2**3 / 46080 and / 645120 < 3e-17
        w = 1.0 - angle2 * (1.0 / 8.0 - angle2 / 384.0)
        k = 0.5 - angle2 * (1.0 / 48.0 - angle2 / 3840.0)
    else:
        angle = sqrt(angle2)
        w = cos(0.5 * angle)
        k = sin(0.5 * angle) / angle
    return w, k * rx, k * ry, k * rz


@kernel
def log(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rotation vector [rad] of the quaternion, of length 0 to pi."""
    if w < 0.0:  # the same rotation, taken the short way
        w, x, y, z = -w, -x, -y, -z
    n2 = x * x + y * y + z * z
    if n2 < 1e-8:  # series of atan(t) / t: first term left out is t**4 / 5 < 3e-17
        k = 2.0 / w * (1.0 - n2 / (3.0 * w * w))
    else:
        n = sqrt(n2)
        k = 2.0 * atan2(n, w) / n
    return k * x, k * y, k * z


# fmt: off
@kernel
def rotate(
    w: float, x: float, y: float, z: float,
    vx: float, vy: float, vz: float,
) -> tuple[float, float, float]:
    """``v_n = C(q_nb) v_b``."""
    # fmt: on
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + (y * tz - z * ty),
        vy + w * ty + (z * tx - x * tz),
        vz + w * tz + (x * ty - y * tx),
    )


# fmt: off
@kernel
def rotate_inverse(
    w: float, x: float, y: float, z: float,
    vx: float, vy: float, vz: float,
) -> tuple[float, float, float]:
    """``v_b = C(q_nb)^T v_n``."""
    # fmt: on
    vx, vy, vz = rotate(w, -x, -y, -z, vx, vy, vz)
    return vx, vy, vz


@kernel
def down_in_body(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Third row of ``C_nb``: the n-frame z axis seen in the body frame."""
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


# fmt: off
@kernel
def dcm(
    w: float, x: float, y: float, z: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """``C_nb`` of ``q_nb``, row after row."""
    # fmt: on
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


# fmt: off
@kernel
def from_dcm(
    c11: float, c12: float, c13: float,
    c21: float, c22: float, c23: float,
    c31: float, c32: float, c33: float,
) -> tuple[float, float, float, float]:
    """``q_nb`` of ``C_nb``, with ``w >= 0``; divides by the largest component only."""
    # fmt: on
    trace = c11 + c22 + c33
    if trace >= c11 and trace >= c22 and trace >= c33:
        w, x, y, z = 1.0 + trace, c32 - c23, c13 - c31, c21 - c12
    elif c11 >= c22 and c11 >= c33:
        w, x, y, z = c32 - c23, 1.0 + c11 - c22 - c33, c12 + c21, c13 + c31
    elif c22 >= c33:
        w, x, y, z = c13 - c31, c12 + c21, 1.0 - c11 + c22 - c33, c23 + c32
    else:
        w, x, y, z = c21 - c12, c13 + c31, c23 + c32, 1.0 - c11 - c22 + c33
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    w, x, y, z = normalize(w, x, y, z)
    return w, x, y, z


# fmt: off
@kernel
def from_two_vectors(
    ax: float, ay: float, az: float,
    bx: float, by: float, bz: float,
) -> tuple[float, float, float, float]:
    """Shortest rotation q that turns the direction a into b: ``b = C(q) a``.

    Opposite directions leave the axis open: it is then one of those normal to a.
    """
    # fmt: on
    a2 = ax * ax + ay * ay + az * az
    b2 = bx * bx + by * by + bz * bz
    if not (a2 > 0.0 and b2 > 0.0):
        return nan, nan, nan, nan
    s = 1.0 / sqrt(a2)
    ax, ay, az = s * ax, s * ay, s * az
    s = 1.0 / sqrt(b2)
    bx, by, bz = s * bx, s * by, s * bz
    kx, ky, kz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    k2 = kx * kx + ky * ky + kz * kz
    if k2 < 1e-32:  # nothing but round-off is left of the cross product: take any normal
        if abs(ay) <= abs(az):
            kx, ky, kz = -az, 0.0, ax
        else:
            kx, ky, kz = ay, -ax, 0.0
    # Near 180 deg round-off tilts the axis towards a, which would turn a past b: take it out.
    s = kx * ax + ky * ay + kz * az
    kx, ky, kz = kx - s * ax, ky - s * ay, kz - s * az
    sx, sy, sz = ax + bx, ay + by, az + bz
    dx, dy, dz = ax - bx, ay - by, az - bz
    w = sqrt(sx * sx + sy * sy + sz * sz)  # twice the cosine of the half angle
    s = sqrt((dx * dx + dy * dy + dz * dz) / (kx * kx + ky * ky + kz * kz))
    w, kx, ky, kz = normalize(w, s * kx, s * ky, s * kz)
    return w, kx, ky, kz


@kernel
def from_acc(fx: float, fy: float, fz: float) -> tuple[float, float, float, float]:
    """``q_nb`` at rest from the specific force ``f_b``, with yaw zero."""
    if not fx * fx + fy * fy + fz * fz > 0.0:
        return nan, nan, nan, nan
    # at rest f_b points up, so -f_b points down
    half_roll = 0.5 * atan2(-fy, -fz)
    half_pitch = 0.5 * atan2(fx, sqrt(fy * fy + fz * fz))
    cr, sr = cos(half_roll), sin(half_roll)
    cp, sp = cos(half_pitch), sin(half_pitch)
    return cp * cr, cp * sr, sp * cr, -sp * sr


# fmt: off
@kernel
def from_acc_mag(
    fx: float, fy: float, fz: float,
    mx: float, my: float, mz: float,
) -> tuple[float, float, float, float]:
    """``q_nb`` at rest from specific force and magnetic field; n is magnetic north.

    NaN where one is zero or the field is vertical (within `MIN_SINE`).
    """
    # fmt: on
    f2 = fx * fx + fy * fy + fz * fz
    m2 = mx * mx + my * my + mz * mz
    if not (f2 > 0.0 and m2 > 0.0):
        return nan, nan, nan, nan
    s = -1.0 / sqrt(f2)  # at rest f_b points up, so -f_b points down
    dx, dy, dz = s * fx, s * fy, s * fz
    s = 1.0 / sqrt(m2)
    mx, my, mz = s * mx, s * my, s * mz
    ex, ey, ez = dy * mz - dz * my, dz * mx - dx * mz, dx * my - dy * mx  # east = down x field
    e2 = ex * ex + ey * ey + ez * ez
    if not e2 > MIN_SINE * MIN_SINE:
        return nan, nan, nan, nan
    s = 1.0 / sqrt(e2)
    ex, ey, ez = s * ex, s * ey, s * ez
    # rows of C_nb: north = east x down, east, down
    w, x, y, z = from_dcm(
        ey * dz - ez * dy, ez * dx - ex * dz, ex * dy - ey * dx,
        ex, ey, ez,
        dx, dy, dz,
    )  # fmt: skip
    return w, x, y, z
