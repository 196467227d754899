"""Attitude measurement of thesis E, 7.6: Master-Slave, Gauss-Newton, and what stands in for them.

g_b is the gravity vector in b, down: at rest minus the specific force. All return q_nb, NaN where
the vectors leave it open.
"""

from math import asin, atan2, cos, nan, pi, sin, sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.gnssins.layout import W_S
from strapdown.kernels.quat import from_two_vectors, mul, normalize, rotate

MAX_STEPS = 20
MIN_SINE2 = 1e-12  # of the angle between the vectors; below, they are parallel


# fmt: off
@kernel
def from_angles(
    roll: float, pitch: float, yaw: float
) -> tuple[float, float, float, float]:
    """Quaternion of Euler angles, (2.6.69) with its sign corrected."""
    # fmt: on
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@kernel
def roll_by_table(gx: float, gy: float, gz: float, g: float) -> tuple[float, float]:
    """Roll and pitch by arcsines, (7.6.11), (7.6.12), and the quadrants of table 7.1.

    The table's first sign is that of g_z, not of g_x as printed.
    """
    pitch = -asin(min(max(gx / g, -1.0), 1.0))
    c = g * cos(pitch)
    roll = 0.0
    if c > 0.0:
        roll = asin(min(max(gy / c, -1.0), 1.0))
    if gz < 0.0:
        roll = pi - roll if gy >= 0.0 else -(pi + roll)
    return roll, pitch


# fmt: off
@kernel
def master_slave(
    gx: float, gy: float, gz: float,
    bx: float, by: float, bz: float,
    cos_d: float, sin_d: float, tables: float,
) -> tuple[float, float, float, float]:
    """Gravity gives roll and pitch, the levelled field yaw: (7.6.10) to (7.6.16).

    By arctangents, exact in all quadrants; `tables` takes roll by arcsine as the thesis, which
    loses digits near 90 deg. ``cos_d, sin_d`` are of the declination.
    """
    # fmt: on
    g2 = gx * gx + gy * gy + gz * gz
    b2 = bx * bx + by * by + bz * bz
    if not (g2 > 0.0 and b2 > 0.0):
        return nan, nan, nan, nan
    if tables > 0.0:
        roll, pitch = roll_by_table(gx, gy, gz, sqrt(g2))
    else:
        roll, pitch = atan2(gy, gz), atan2(-gx, sqrt(gy * gy + gz * gz))
    w, x, y, z = from_angles(roll, pitch, 0.0)
    hx, hy, _ = rotate(w, x, y, z, bx, by, bz)
    if not hx * hx + hy * hy > MIN_SINE2 * b2:
        return nan, nan, nan, nan
    yaw = atan2(-hy, hx) + atan2(sin_d, cos_d)
    w, x, y, z = from_angles(roll, pitch, yaw)
    return w, x, y, z


# fmt: off
@kernel
def level_only(
    w: float, x: float, y: float, z: float,
    gx: float, gy: float, gz: float,
) -> tuple[float, float, float, float]:
    """Turn q the short way until gravity points down; its heading stays."""
    # fmt: on
    nx, ny, nz = rotate(w, x, y, z, gx, gy, gz)
    cw, cx, cy, cz = from_two_vectors(nx, ny, nz, 0.0, 0.0, 1.0)
    w, x, y, z = mul(cw, cx, cy, cz, w, x, y, z)
    w, x, y, z = normalize(w, x, y, z)
    return w, x, y, z


# fmt: off
@kernel
def level_and_course(
    w: float, x: float, y: float, z: float,
    gx: float, gy: float, gz: float,
    fx: float, fy: float, fz: float, course: float,
) -> tuple[float, float, float, float]:
    """Master-Slave with the course over ground for the field; f is the vehicle's x axis in b."""
    # fmt: on
    w, x, y, z = level_only(w, x, y, z, gx, gy, gz)
    nx, ny, _ = rotate(w, x, y, z, fx, fy, fz)
    if not nx * nx + ny * ny > MIN_SINE2:
        return nan, nan, nan, nan
    half = 0.5 * (course - atan2(ny, nx))
    w, x, y, z = mul(cos(half), 0.0, 0.0, sin(half), w, x, y, z)
    return w, x, y, z


@kernel
def add_row(w: Vec, j0: float, j1: float, j2: float, j3: float, e: float) -> None:
    """Add a row of the Jacobian and its residual to the normal equations."""
    for i in range(4):
        ji = j0 if i == 0 else (j1 if i == 1 else (j2 if i == 2 else j3))
        w[W_S + 5 * i] += ji * j0
        w[W_S + 5 * i + 1] += ji * j1
        w[W_S + 5 * i + 2] += ji * j2
        w[W_S + 5 * i + 3] += ji * j3
        w[W_S + 5 * i + 4] += ji * e


# fmt: off
@kernel
def add_vector(
    w: Vec, a: float, b: float, c: float, d: float,
    n: float, e: float, s: float,
    mx: float, my: float, mz: float, rows: int,
) -> None:
    """Add the first `rows` rows of ``C_bn (n, e, s) - m`` and their derivatives to A."""
    # fmt: on
    x = 2.0 * (a * n + d * e - c * s)
    y = 2.0 * (-d * n + a * e + b * s)
    z = 2.0 * (c * n - b * e + a * s)
    t = 2.0 * (b * n + c * e + d * s)
    # C_bn v by Euler's theorem: half of q times the derivatives
    add_row(w, x, t, -z, y, 0.5 * (a * x + b * t - c * z + d * y) - mx)
    add_row(w, y, z, t, -x, 0.5 * (a * y + b * z + c * t - d * x) - my)
    if rows > 2:
        add_row(w, z, -y, x, t, 0.5 * (a * z - b * y + c * x + d * t) - mz)


@kernel
def solve4(w: Vec) -> bool:
    """Solve the normal equations in place by elimination; the solution stands in column 4."""
    for k in range(4):
        pivot = w[W_S + 5 * k + k]
        if not pivot > 1e-9:  # of unit vectors: the attitude is open
            return False
        for i in range(k + 1, 4):
            f = w[W_S + 5 * i + k] / pivot
            for j in range(k, 5):
                w[W_S + 5 * i + j] -= f * w[W_S + 5 * k + j]
    for m in range(4):
        k = 3 - m
        v = w[W_S + 5 * k + 4]
        for j in range(k + 1, 4):
            v -= w[W_S + 5 * k + j] * w[W_S + 5 * j + 4]
        w[W_S + 5 * k + 4] = v / w[W_S + 5 * k + k]
    return True


# fmt: off
@kernel
def gauss_newton(
    w: Vec, qa: float, qb: float, qc: float, qd: float,
    gx: float, gy: float, gz: float,
    bx: float, by: float, bz: float,
    n: float, e: float, s: float,
    use_z: float, stop: float,
) -> tuple[float, float, float, float]:
    """Iterate (7.6.9) from q until no component changes by `stop`; unit vectors go in.

    ``(n, e, s)`` is the reference field. `use_z` off leaves g_z out as the thesis does: a box
    whose z axis lies level to the east or west then has no solution. Norm is set at the end.
    """
    # fmt: on
    a, b, c, d = qa, qb, qc, qd
    for _ in range(MAX_STEPS):
        for i in range(20):
            w[W_S + i] = 0.0
        rows = 3 if use_z > 0.0 else 2
        add_vector(w, a, b, c, d, 0.0, 0.0, 1.0, gx, gy, gz, rows)
        add_vector(w, a, b, c, d, n, e, s, bx, by, bz, 3)
        if not solve4(w):
            return nan, nan, nan, nan
        da, db, dc, dd = w[W_S + 4], w[W_S + 9], w[W_S + 14], w[W_S + 19]
        a, b, c, d = a - da, b - db, c - dc, d - dd
        if abs(da) < stop and abs(db) < stop and abs(dc) < stop and abs(dd) < stop:
            a, b, c, d = normalize(a, b, c, d)
            return a, b, c, d
    return nan, nan, nan, nan
