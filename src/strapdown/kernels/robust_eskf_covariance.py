"""Covariance of the robust error-state filter, between two updates and at each of them.

The error state is what has to be added to the estimate to get the truth: attitude error in n
(left), velocity in n, gyro bias, accelerometer bias, scale and misalignment of the gyro (3 x 3,
row after row) and the delay of the magnetometer.

Between two updates the transition differs from the identity in the rows of attitude and
velocity only::

    dphi' = dphi + int C_nb dt (-db_g + dM theta / tau)
    dv'   = dv + dphi x dv_n - int C_nb dt db_a

where theta is the angle turned in b and dv_n the velocity that specific force gave in n.
"""

from math import sqrt

from strapdown.kernels._jit import Mat, Vec, kernel

N = 22  # length of the error state
PHI = 0  # attitude error, n [rad]
VEL = 3  # velocity, n [m/s]
EBG = 6  # gyro bias, b [rad/s]
EBA = 9  # accelerometer bias, b [m/s^2]
EMG = 12  # scale and misalignment of the gyro, row after row
LAG = 21  # delay of the magnetometer [s]

# What is summed up over an interval.
C_DT = 0  # int C_nb dt: 9
THETA = 9  # angle turned, b [rad]: 3
DV = 12  # velocity gained from specific force, n [m/s]: 3
TAU = 15  # length [s]
INTERVAL = 16


@kernel
def _moving_rows(P: Mat, columns: int, s: Vec, s0: int, out: Vec, o0: int) -> None:
    """Rows of attitude and velocity of ``Phi P``, the first columns of them.

    The interval's sums begin at ``s[s0]``; row i of the result begins at ``out[o0 + i * N]``.
    """
    c11, c12, c13 = s[s0], s[s0 + 1], s[s0 + 2]
    c21, c22, c23 = s[s0 + 3], s[s0 + 4], s[s0 + 5]
    c31, c32, c33 = s[s0 + 6], s[s0 + 7], s[s0 + 8]
    k = 1.0 / s[s0 + TAU]
    tx, ty, tz = k * s[s0 + THETA], k * s[s0 + THETA + 1], k * s[s0 + THETA + 2]
    vx, vy, vz = s[s0 + DV], s[s0 + DV + 1], s[s0 + DV + 2]
    for j in range(columns):
        ux = tx * P[EMG, j] + ty * P[EMG + 1, j] + tz * P[EMG + 2, j] - P[EBG, j]
        uy = tx * P[EMG + 3, j] + ty * P[EMG + 4, j] + tz * P[EMG + 5, j] - P[EBG + 1, j]
        uz = tx * P[EMG + 6, j] + ty * P[EMG + 7, j] + tz * P[EMG + 8, j] - P[EBG + 2, j]
        fx, fy, fz = P[PHI, j], P[PHI + 1, j], P[PHI + 2, j]
        bx, by, bz = P[EBA, j], P[EBA + 1, j], P[EBA + 2, j]
        gx = P[VEL, j] + fy * vz - fz * vy
        gy = P[VEL + 1, j] + fz * vx - fx * vz
        gz = P[VEL + 2, j] + fx * vy - fy * vx
        out[o0 + j] = fx + c11 * ux + c12 * uy + c13 * uz
        out[o0 + N + j] = fy + c21 * ux + c22 * uy + c23 * uz
        out[o0 + 2 * N + j] = fz + c31 * ux + c32 * uy + c33 * uz
        out[o0 + 3 * N + j] = gx - (c11 * bx + c12 * by + c13 * bz)
        out[o0 + 4 * N + j] = gy - (c21 * bx + c22 * by + c23 * bz)
        out[o0 + 5 * N + j] = gz - (c31 * bx + c32 * by + c33 * bz)


@kernel
def propagate(P: Mat, s: Vec, s0: int, w: Vec, w0: int) -> None:
    """``P = Phi P Phi^T`` in place; scratch: ``12 * N`` numbers from ``w[w0]`` on."""
    _moving_rows(P, N, s, s0, w, w0)
    # Phi (Phi P)^T: the rows just made are put where they are read as columns
    w1 = w0 + 6 * N
    for i in range(6):
        for j in range(N):
            P[j, i] = w[w0 + i * N + j]
    _moving_rows(P, 6, s, s0, w, w1)
    for i in range(6):
        for j in range(6, N):
            P[i, j] = w[w0 + i * N + j]
        for j in range(i + 1):
            P[i, j] = w[w1 + i * N + j]
            P[j, i] = w[w1 + i * N + j]


@kernel
def enter(P: Mat, i: int, h_lag: float, r: float, g: Vec, g0: int) -> float:
    """Update P in place with a scalar that measures element i and `h_lag` times the delay.

    Writes ``g = P h / sqrt(s)`` from ``g[g0]`` on, so that the gain is ``g / sqrt(s)``, and
    returns the variance ``s = h^T P h + r`` of the innovation. ``P - g g^T`` stays symmetric
    to the last bit.
    """
    for j in range(N):
        g[g0 + j] = P[i, j] + h_lag * P[LAG, j]
    s = float(g[g0 + i] + h_lag * g[g0 + LAG] + r)
    k = 1.0 / sqrt(s)
    for j in range(N):
        g[g0 + j] *= k
    for m in range(N):
        a = g[g0 + m]
        for j in range(N):
            P[m, j] -= a * g[g0 + j]
    return s


@kernel
def forget(P: Mat, i: int, variance: float) -> None:
    """Make element i uncorrelated with the others and give it a variance."""
    for j in range(N):
        P[i, j] = 0.0
        P[j, i] = 0.0
    P[i, i] = variance


@kernel
def transpose_on_row(M: Mat, m: int, s: Vec, s0: int) -> None:
    """Row m of ``M Phi`` in place: ``Phi^T`` on that row, for the smoother."""
    k = 1.0 / s[s0 + TAU]
    vx, vy, vz = s[s0 + DV], s[s0 + DV + 1], s[s0 + DV + 2]
    fx, fy, fz = M[m, PHI], M[m, PHI + 1], M[m, PHI + 2]
    gx, gy, gz = M[m, VEL], M[m, VEL + 1], M[m, VEL + 2]
    for i in range(3):
        a, b, c = s[s0 + i], s[s0 + 3 + i], s[s0 + 6 + i]  # column i of int C_nb dt
        y = a * fx + b * fy + c * fz
        M[m, EBG + i] -= y
        M[m, EBA + i] -= a * gx + b * gy + c * gz
        y *= k
        M[m, EMG + 3 * i] += y * s[s0 + THETA]
        M[m, EMG + 3 * i + 1] += y * s[s0 + THETA + 1]
        M[m, EMG + 3 * i + 2] += y * s[s0 + THETA + 2]
    M[m, PHI] = fx + vy * gz - vz * gy
    M[m, PHI + 1] = fy + vz * gx - vx * gz
    M[m, PHI + 2] = fz + vx * gy - vy * gx
