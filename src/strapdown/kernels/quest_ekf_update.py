"""What a measurement tells the filter of limb rates and quaternion: scalars in Joseph form."""

from math import atan2, inf, isnan, nan, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mekf import ROUND_OFF
from strapdown.kernels.memory import (
    D_ACC,
    D_MAG,
    P_COS_D,
    P_SIN_D,
    Q,
    note,
    note_sigma,
    set_status,
)
from strapdown.kernels.quat import exp, from_dcm, mul, normalize, rotate
from strapdown.kernels.quest_ekf_layout import (
    MIN_SINE,
    P_GATE,
    P_SIN_DIP,
    Q_P,
    RATE,
    W_DX,
    W_PH,
)


@kernel
def enter(P: Mat, w: Vec, hph: float, left: float, r: float, gate: float) -> tuple[float, bool]:
    """Joseph update with ``P h`` of the scratch; beyond the gate the noise is raised.

    Returns the innovation's variance, and whether it lies within the gate.
    """
    hph = max(hph, 0.0)
    expected = hph + max(r, ROUND_OFF * hph)
    variance = expected
    accepted = left * left <= gate * gate * expected
    if not accepted:
        variance = left * left / (gate * gate)
    for i in range(7):
        gain_i = w[W_PH + i] / variance
        w[W_DX + i] += gain_i * left
        for j in range(i + 1):
            gain_j = w[W_PH + j] / variance
            # (I - K h) P (I - K h)^T + K r K^T, written out
            v = P[i, j] - gain_i * w[W_PH + j] - w[W_PH + i] * gain_j + gain_i * variance * gain_j
            P[i, j] = v
            P[j, i] = v
    return expected, accepted


@kernel
def update_rate(P: Mat, w: Vec, i: int, innovation: float, r: float) -> None:
    """Enter a measured component of the rate: its row of H has a one only."""
    for j in range(7):
        w[W_PH + j] = P[j, i]
    enter(P, w, P[i, i], innovation - w[W_DX + i], r, inf)


# fmt: off
@kernel
def update_turn(
    x: Vec, P: Mat, p: Vec, w: Vec,
    u_n: float, u_e: float, u_d: float, innovation: float, r: float,
) -> tuple[float, float, bool]:
    """Enter a measured ``u . phi``, u about magnetic north, east and down.

    Returns what was left of the innovation, its variance, and whether it lies within the gate.
    """
    # fmt: on
    hw, hx, hy, hz = mul(
        0.0,
        2.0 * (p[P_COS_D] * u_n - p[P_SIN_D] * u_e),
        2.0 * (p[P_SIN_D] * u_n + p[P_COS_D] * u_e),
        2.0 * u_d,
        x[Q_P], x[Q_P + 1], x[Q_P + 2], x[Q_P + 3],
    )  # fmt: skip
    for i in range(7):
        w[W_PH + i] = P[i, 3] * hw + P[i, 4] * hx + P[i, 5] * hy + P[i, 6] * hz
    hph = hw * w[W_PH + 3] + hx * w[W_PH + 4] + hy * w[W_PH + 5] + hz * w[W_PH + 6]
    left = innovation - hw * w[W_DX + 3] - hx * w[W_DX + 4] - hy * w[W_DX + 5] - hz * w[W_DX + 6]
    expected, accepted = enter(P, w, hph, left, r, p[P_GATE])
    return left, expected, accepted


# fmt: off
@kernel
def update_down(
    x: Vec, P: Mat, p: Vec, w: Vec, north: float, east: float, r_north: float, r_east: float
) -> bool:
    """Enter what the measured direction down is off to magnetic north and east.

    ``v = down + down x phi``; along down it tells no turn.
    """
    # fmt: on
    a, va, ok_a = update_turn(x, P, p, w, 0.0, -1.0, 0.0, north, r_north)
    b, vb, ok_b = update_turn(x, P, p, w, 1.0, 0.0, 0.0, east, r_east)
    accepted = ok_a and ok_b
    note(w, D_ACC, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
    note_sigma(w, D_ACC, 0, a, va)
    note_sigma(w, D_ACC, 1, b, vb)
    if not accepted:
        set_status(x, s.ACC_REJECTED)
    return accepted


# fmt: off
@kernel
def update_east(
    x: Vec, P: Mat, p: Vec, w: Vec, c: float, d: float, east: float, r: float
) -> bool:
    """Enter what the measured field is off to magnetic east; its reference is ``(c, 0, d)``.

    ``m = ref + ref x phi``: an error of tilt shows as one of heading, and the row knows.
    """
    # fmt: on
    left, expected, accepted = update_turn(x, P, p, w, d, 0.0, -c, east, r)
    note(w, D_MAG, nan, nan, nan, s.ACCEPTED if accepted else s.REJECTED_GATE)
    note_sigma(w, D_MAG, 0, left, expected)
    return accepted


# fmt: off
@kernel
def update_field(
    x: Vec, P: Mat, p: Vec, w: Vec, north: float, east: float, down: float, c: float, d: float,
    r: float,
) -> None:
    """Enter the measured unit field, turned to magnetic north, east and down.

    Across the reference, to the east and in dip: along it a unit vector tells no turn, and has
    no noise.
    """
    # fmt: on
    if isnan(p[P_SIN_DIP]):  # the angle, not its sine: half a turn off, too, is off
        accepted = update_east(x, P, p, w, c, d, c * atan2(east, north), r)
    else:
        accepted = update_east(x, P, p, w, c, d, east, r)
        a, va, ok = update_turn(x, P, p, w, 0.0, 1.0, 0.0, c * down - d * north, r)
        note_sigma(w, D_MAG, 1, a, va)
        accepted = accepted and ok
        w[D_MAG + 6] = s.ACCEPTED if accepted else s.REJECTED_GATE
    if not accepted:
        set_status(x, s.MAG_REJECTED)


# fmt: off
@kernel
def quest(
    dx: float, dy: float, dz: float, mx: float, my: float, mz: float, sin_dip: float,
    weight_d: float, weight_m: float, cos_d: float, sin_d: float,
) -> tuple[float, float, float, float]:
    """QUEST of two unit vectors in b, down d and the field m, in closed form; q_nb.

    Both planes are made to agree; within them, what the angle between d and m is off that of
    the references is shared by weight. NaN dip: the measured one, nothing is off. NaN where d
    and m are parallel.
    """
    # fmt: on
    ex, ey, ez = dy * mz - dz * my, dz * mx - dx * mz, dx * my - dy * mx
    s_b = sqrt(ex * ex + ey * ey + ez * ez)
    c_b = dx * mx + dy * my + dz * mz
    if not s_b > MIN_SINE:
        return nan, nan, nan, nan
    ex, ey, ez = ex / s_b, ey / s_b, ez / s_b
    hx, hy, hz = ey * dz - ez * dy, ez * dx - ex * dz, ex * dy - ey * dx
    c, k = 1.0, 0.0
    if not isnan(sin_dip):
        s_n = sqrt(1.0 - sin_dip * sin_dip)
        sin_off = s_n * c_b - sin_dip * s_b
        cos_off = sin_dip * c_b + s_n * s_b
        c = weight_d + weight_m * cos_off
        k = weight_m * sin_off
        n = sqrt(c * c + k * k)  # zero where the vectors, of one weight, contradict each other
        if n > 0.0:
            c, k = c / n, k / n
        else:
            c, k = 1.0, 0.0
    # d goes to (k north, c down), h to (c north, -k down), with the field's north
    gx, gy, gz = k * dx + c * hx, k * dy + c * hy, k * dz + c * hz
    w, x, y, z = from_dcm(
        cos_d * gx - sin_d * ex, cos_d * gy - sin_d * ey, cos_d * gz - sin_d * ez,
        sin_d * gx + cos_d * ex, sin_d * gy + cos_d * ey, sin_d * gz + cos_d * ez,
        c * dx - k * hx, c * dy - k * hy, c * dz - k * hz,
    )  # fmt: skip
    return w, x, y, z


# fmt: off
@kernel
def update_both(
    x: Vec, P: Mat, p: Vec, w: Vec, ew: float, ex: float, ey: float, ez: float, angle: float,
    c: float, d: float, r_d: float, r_m: float,
) -> None:
    """Enter QUEST's quaternion; ``e`` turns what it finds in n to where the estimate has it.

    Its covariance, the inverse of ``(I - down down^T) / r_d + (I - m m^T) / r_m``, has no
    correlation between the turns that move down to the north and to the east, and the one that
    moves the field ``m = (c, 0, d)`` to the east. These three are entered, the last as the angle
    to the east that the field is measured at: however far an acceleration bends down, it does not
    turn the heading. If the field shares in the tilt, it is that of the quaternions' difference:
    down itself would be off by half of tilt times heading, which are correlated.
    """
    # fmt: on
    r_east = r_d
    if isnan(p[P_SIN_DIP]):
        vx, vy, _ = rotate(ew, ex, ey, ez, 0.0, 0.0, 1.0)
    else:
        r_east = r_d * r_m / (r_d + r_m)
        k = 2.0 if ew > 0.0 else -2.0
        vx, vy = k * ey, -k * ex
    north = p[P_COS_D] * vx + p[P_SIN_D] * vy
    east = p[P_COS_D] * vy - p[P_SIN_D] * vx
    update_down(x, P, p, w, north, east, r_east, r_d)
    if not update_east(x, P, p, w, c, d, c * angle, r_m):
        set_status(x, s.MAG_REJECTED)


@kernel
def inject(x: Vec, w: Vec) -> None:
    """Move the error state found into the estimate, along the sphere; none is left."""
    for i in range(3):
        x[RATE + i] += w[W_DX + i]
    _, rx, ry, rz = mul(
        w[W_DX + 3], w[W_DX + 4], w[W_DX + 5], w[W_DX + 6],
        x[Q_P], -x[Q_P + 1], -x[Q_P + 2], -x[Q_P + 3],
    )  # fmt: skip
    ew, ex, ey, ez = exp(2.0 * rx, 2.0 * ry, 2.0 * rz)
    qw, qx, qy, qz = mul(ew, ex, ey, ez, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(qw, qx, qy, qz)
    for i in range(7):
        w[W_DX + i] = 0.0
