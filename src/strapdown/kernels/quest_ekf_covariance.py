"""Covariance of the filter of limb rates and quaternion, and how a turn of q carries it along.

`A` and `B` are the lower rows of Phi: what quaternion and rate of a sample make of the next
quaternion. Equation numbers are those of spec B (thesis "kinematic device", section 4.3.3).
"""

from math import cos, sin, sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import STD_ATT, Q
from strapdown.kernels.quat import mul
from strapdown.kernels.quest_ekf_layout import Q_P, W_A, W_B, W_M, W_PH


@kernel
def turn_matrix(w: Vec, ew: float, ex: float, ey: float, ez: float) -> None:
    """Write A, ``A q = q e``."""
    (
        w[W_A], w[W_A + 1], w[W_A + 2], w[W_A + 3],
        w[W_A + 4], w[W_A + 5], w[W_A + 6], w[W_A + 7],
        w[W_A + 8], w[W_A + 9], w[W_A + 10], w[W_A + 11],
        w[W_A + 12], w[W_A + 13], w[W_A + 14], w[W_A + 15],
    ) = (
        ew, -ex, -ey, -ez,
        ex, ew, ez, -ey,
        ey, -ez, ew, ex,
        ez, ey, -ex, ew,
    )  # fmt: skip


# fmt: off
@kernel
def rate_matrix(
    w: Vec, qw: float, qx: float, qy: float, qz: float,
    phi_x: float, phi_y: float, phi_z: float, dt: float,
) -> None:
    """Write B, what a rate does to the quaternion that it has turned by phi_b.

    Its columns are ``1/2 dt q (0, J_r e)`` with the right Jacobian of the rotation,
    ``J_r = I - f2 [phi] + f3 [phi]^2``. Phi zero gives the columns of (68).
    """
    # fmt: on
    phi2 = phi_x * phi_x + phi_y * phi_y + phi_z * phi_z
    if phi2 < 1e-2:  # first terms left out: phi2**2 / 720 and / 5040
        f2 = 0.5 - phi2 / 24.0
        f3 = 1.0 / 6.0 - phi2 / 120.0
    else:
        phi = sqrt(phi2)
        f2 = (1.0 - cos(phi)) / phi2
        f3 = (phi - sin(phi)) / (phi2 * phi)
    k = 0.5 * dt
    for j in range(3):
        a = phi_x if j == 0 else (phi_y if j == 1 else phi_z)
        ux, uy, uz = f3 * a * phi_x, f3 * a * phi_y, f3 * a * phi_z
        if j == 0:
            ux += 1.0 - f3 * phi2
            uy -= f2 * phi_z
            uz += f2 * phi_y
        elif j == 1:
            ux += f2 * phi_z
            uy += 1.0 - f3 * phi2
            uz -= f2 * phi_x
        else:
            ux -= f2 * phi_y
            uy += f2 * phi_x
            uz += 1.0 - f3 * phi2
        bw, bx, by, bz = mul(qw, qx, qy, qz, 0.0, ux, uy, uz)
        w[W_B + j] = k * bw
        w[W_B + 3 + j] = k * bx
        w[W_B + 6 + j] = k * by
        w[W_B + 9 + j] = k * bz


@kernel
def decay(P: Mat, a: float, q: float) -> None:
    """``omega <- a omega + noise`` of variance q, in the covariance."""
    for i in range(3):
        for j in range(i + 1):
            P[i, j] *= a * a
            P[j, i] = P[i, j]
        for j in range(3, 7):
            P[i, j] *= a
            P[j, i] = P[i, j]
        P[i, i] += q


@kernel
def spread(P: Mat, w: Vec) -> None:
    """``q <- B omega + A q`` in the covariance."""
    for i in range(4):
        for j in range(7):
            v = 0.0
            for k in range(3):
                v += w[W_B + 3 * i + k] * P[k, j]
            for k in range(4):
                v += w[W_A + 4 * i + k] * P[3 + k, j]
            w[W_M + 7 * i + j] = v
    for i in range(4):
        for j in range(3):
            P[3 + i, j] = w[W_M + 7 * i + j]
            P[j, 3 + i] = w[W_M + 7 * i + j]
        for j in range(i + 1):
            v = 0.0
            for k in range(3):
                v += w[W_M + 7 * i + k] * w[W_B + 3 * j + k]
            for k in range(4):
                v += w[W_M + 7 * i + 3 + k] * w[W_A + 4 * j + k]
            P[3 + i, 3 + j] = v
            P[3 + j, 3 + i] = v


@kernel
def turned_since(x: Vec) -> tuple[float, float, float, float]:
    """Turn of the body e, ``q_nb = q_P e``."""
    ew, ex, ey, ez = mul(
        x[Q_P], -x[Q_P + 1], -x[Q_P + 2], -x[Q_P + 3], x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    )
    return ew, ex, ey, ez


@kernel
def belongs(x: Vec) -> None:
    """State that P belongs to q_nb."""
    for i in range(4):
        x[Q_P + i] = x[Q + i]


@kernel
def turn_frame(x: Vec, P: Mat, w: Vec, qw: float, qx: float, qy: float, qz: float) -> None:
    """Carry P along with a q_nb that was `q` and has been turned in n: ``q_nb = e q``.

    The errors turn with it: about the axes of the body they stay.
    """
    ew, ex, ey, ez = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], qw, -qx, -qy, -qz)
    (
        w[W_A], w[W_A + 1], w[W_A + 2], w[W_A + 3],
        w[W_A + 4], w[W_A + 5], w[W_A + 6], w[W_A + 7],
        w[W_A + 8], w[W_A + 9], w[W_A + 10], w[W_A + 11],
        w[W_A + 12], w[W_A + 13], w[W_A + 14], w[W_A + 15],
    ) = (
        ew, -ex, -ey, -ez,
        ex, ew, -ez, ey,
        ey, ez, ew, -ex,
        ez, -ey, ex, ew,
    )  # fmt: skip
    for i in range(12):
        w[W_B + i] = 0.0
    spread(P, w)
    x[Q_P], x[Q_P + 1], x[Q_P + 2], x[Q_P + 3] = mul(
        ew, ex, ey, ez, x[Q_P], x[Q_P + 1], x[Q_P + 2], x[Q_P + 3]
    )


# --- where turns are known or forgotten -------------------------------------------------------


@kernel
def axis_row(x: Vec, w: Vec, i: int) -> None:
    """Write ``(0, e_i) q``: where a turn about axis i of n takes the quaternion, twice."""
    w[W_PH], w[W_PH + 1], w[W_PH + 2], w[W_PH + 3] = mul(
        0.0,
        1.0 if i == 0 else 0.0,
        1.0 if i == 1 else 0.0,
        1.0 if i == 2 else 0.0,
        x[Q_P], x[Q_P + 1], x[Q_P + 2], x[Q_P + 3],
    )  # fmt: skip


@kernel
def add_turn(x: Vec, P: Mat, w: Vec, i: int, variance: float) -> None:
    """Add an error about axis i of n."""
    axis_row(x, w, i)
    for a in range(4):
        for b in range(4):
            P[3 + a, 3 + b] += 0.25 * variance * w[W_PH + a] * w[W_PH + b]


@kernel
def turn_variance(x: Vec, P: Mat, w: Vec, i: int) -> float:
    """Variance of the error about axis i of n; round-off below zero is none."""
    axis_row(x, w, i)
    v = 0.0
    for a in range(4):
        for b in range(4):
            v += w[W_PH + a] * P[3 + a, 3 + b] * w[W_PH + b]
    return max(0.0, 4.0 * v)


@kernel
def reset_attitude(x: Vec, P: Mat, w: Vec, tilt: float, heading: float) -> None:
    """Set the attitude's covariance after an alignment: variances of tilt and heading."""
    for i in range(3, 7):
        for j in range(7):
            P[i, j] = 0.0
            P[j, i] = 0.0
    belongs(x)
    add_turn(x, P, w, 0, tilt)
    add_turn(x, P, w, 1, tilt)
    add_turn(x, P, w, 2, heading)


@kernel
def reset_heading(x: Vec, P: Mat, w: Vec, variance: float) -> None:
    """Make the heading's error independent, with this variance; all else keeps its own."""
    axis_row(x, w, 2)
    for j in range(7):  # P <- (I - u u^T) P, on the rows of q
        along = 0.0
        for a in range(4):
            along += w[W_PH + a] * P[3 + a, j]
        for a in range(4):
            P[3 + a, j] -= w[W_PH + a] * along
    for i in range(7):  # P <- P (I - u u^T), on its columns
        along = 0.0
        for a in range(4):
            along += P[i, 3 + a] * w[W_PH + a]
        for a in range(4):
            P[i, 3 + a] -= along * w[W_PH + a]
    for i in range(7):  # round-off: the lower triangle is it
        for j in range(i):
            P[j, i] = P[i, j]
    add_turn(x, P, w, 2, variance)


@kernel
def write_std(x: Vec, P: Mat, w: Vec) -> None:
    """Write the standard deviations of attitude."""
    for i in range(3):
        x[STD_ATT + i] = sqrt(turn_variance(x, P, w, i))
