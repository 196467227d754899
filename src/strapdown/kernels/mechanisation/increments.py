"""One step of rotation and velocity from one to four samples: coning and sculling.

Rate and specific force of a body are one twist (omega, f), and turning and gaining velocity one
rigid motion. Over a step its logarithm is, to the fourth order [1]_,

``phi = sum th_i + sum_{i<j} k_ij th_i x th_j``

``s = sum dv_i + sum_{i<j} k_ij (th_i x dv_j + dv_i x th_j)``

with weights k that depend on the number of samples: the second sum of the one is the coning
correction, that of the other the sculling correction [2]_. The velocity gained, in the axes
of the start, is ``J(phi) s`` with the left Jacobian J of rotations. A step of a single sample may
look at the sample before as well: then that stands in slot 0 with no weight in the plain sum.

References
----------
.. [1] A. Iserles, H. Z. Munthe-Kaas, S. P. Norsett, A. Zanna, "Lie-group methods", Acta Numerica
       9, 2000, section 4 (the Magnus expansion).
.. [2] P. G. Savage, "Strapdown inertial navigation integration algorithm design", J. Guidance
       21(1) and 21(2), 1998.
"""

from math import cos, sin, sqrt

from strapdown.kernels._jit import Vec, kernel
from strapdown.kernels.mechanisation.layout import CONING, DV, SUM, TH


@kernel
def weighted(x: Vec, p: Vec, at: int, first: int, m: int) -> tuple[float, float, float]:
    """Sum of the increments from ``x[at]`` with the weights from ``p[first]``."""
    sx, sy, sz = 0.0, 0.0, 0.0
    for i in range(m):
        k = p[first + i]
        sx += k * x[at + 3 * i]
        sy += k * x[at + 3 * i + 1]
        sz += k * x[at + 3 * i + 2]
    return sx, sy, sz


@kernel
def rotation_vector(x: Vec, p: Vec, m: int) -> tuple[float, float, float]:
    """Rotation vector of a step from its m slots [rad]."""
    rx, ry, rz = weighted(x, p, TH, SUM, m)
    for i in range(m):
        ax, ay, az = x[TH + 3 * i], x[TH + 3 * i + 1], x[TH + 3 * i + 2]
        for j in range(i + 1, m):
            k = p[CONING + 4 * i + j]
            bx, by, bz = x[TH + 3 * j], x[TH + 3 * j + 1], x[TH + 3 * j + 2]
            rx += k * (ay * bz - az * by)
            ry += k * (az * bx - ax * bz)
            rz += k * (ax * by - ay * bx)
    return rx, ry, rz


@kernel
def translation_vector(x: Vec, p: Vec, m: int) -> tuple[float, float, float]:
    """Velocity part s of the twist of a step from its m slots [m/s]."""
    sx, sy, sz = weighted(x, p, DV, SUM, m)
    for i in range(m):
        ax, ay, az = x[TH + 3 * i], x[TH + 3 * i + 1], x[TH + 3 * i + 2]
        ux, uy, uz = x[DV + 3 * i], x[DV + 3 * i + 1], x[DV + 3 * i + 2]
        for j in range(i + 1, m):
            k = p[CONING + 4 * i + j]
            bx, by, bz = x[TH + 3 * j], x[TH + 3 * j + 1], x[TH + 3 * j + 2]
            vx, vy, vz = x[DV + 3 * j], x[DV + 3 * j + 1], x[DV + 3 * j + 2]
            sx += k * (ay * vz - az * vy + uy * bz - uz * by)
            sy += k * (az * vx - ax * vz + uz * bx - ux * bz)
            sz += k * (ax * vy - ay * vx + ux * by - uy * bx)
    return sx, sy, sz


# fmt: off
@kernel
def left_jacobian(
    rx: float, ry: float, rz: float, sx: float, sy: float, sz: float
) -> tuple[float, float, float]:
    """``J(phi) s``: mean over the step of ``exp(tau phi x) s``."""
    # fmt: on
    n2 = rx * rx + ry * ry + rz * rz
    if n2 < 1e-2:  # first terms left out are n2**4 / 3628800 and n2**4 / 39916800 < 3e-15 of J
        a = 0.5 - n2 * (1.0 / 24.0 - n2 * (1.0 / 720.0 - n2 / 40320.0))
        b = 1.0 / 6.0 - n2 * (1.0 / 120.0 - n2 * (1.0 / 5040.0 - n2 / 362880.0))
    else:
        n = sqrt(n2)
        half = sin(0.5 * n)
        a = 2.0 * half * half / n2
        b = (1.0 - sin(n) / n) / n2
    cx, cy, cz = ry * sz - rz * sy, rz * sx - rx * sz, rx * sy - ry * sx
    return (
        sx + a * cx + b * (ry * cz - rz * cy),
        sy + a * cy + b * (rz * cx - rx * cz),
        sz + a * cz + b * (rx * cy - ry * cx),
    )


# fmt: off
@kernel
def rotation_matrix(
    rx: float, ry: float, rz: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Matrix ``exp(phi x)``, row after row."""
    # fmt: on
    n2 = rx * rx + ry * ry + rz * rz
    if n2 < 1e-2:
        a = 1.0 - n2 * (1.0 / 6.0 - n2 * (1.0 / 120.0 - n2 * (1.0 / 5040.0 - n2 / 362880.0)))
        b = 0.5 - n2 * (1.0 / 24.0 - n2 * (1.0 / 720.0 - n2 / 40320.0))
        c = 1.0 - b * n2
    else:
        n = sqrt(n2)
        half = sin(0.5 * n)
        a = sin(n) / n
        b = 2.0 * half * half / n2
        c = cos(n)
    return (
        c + b * rx * rx, b * rx * ry - a * rz, b * rx * rz + a * ry,
        b * rx * ry + a * rz, c + b * ry * ry, b * ry * rz - a * rx,
        b * rx * rz - a * ry, b * ry * rz + a * rx, c + b * rz * rz,
    )  # fmt: skip
