"""Vertical reference of thesis E, 7.5: gravity in b, the vehicle's own acceleration removed."""

from strapdown.kernels._jit import Vec, kernel


# fmt: off
@kernel
def vehicle_acceleration(
    p: Vec, at: int, wx: float, wy: float, wz: float, u: float, u_dot: float
) -> tuple[float, float, float]:
    """Acceleration of a vehicle that moves along its x axis at speed u, in b: (7.5.9).

    ``(u', u r, -u q)`` with the rates q, r of the vehicle; C_vb stands in ``p[at]``.
    """
    # fmt: on
    q = p[at + 3] * wx + p[at + 4] * wy + p[at + 5] * wz
    r = p[at + 6] * wx + p[at + 7] * wy + p[at + 8] * wz
    ax, ay, az = u_dot, u * r, -u * q
    return (
        p[at] * ax + p[at + 3] * ay + p[at + 6] * az,
        p[at + 1] * ax + p[at + 4] * ay + p[at + 7] * az,
        p[at + 2] * ax + p[at + 5] * ay + p[at + 8] * az,
    )
