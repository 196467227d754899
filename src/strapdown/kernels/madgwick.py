"""Madgwick's gradient-descent filter. Frames: n = NED, b = body.

Equation numbers are those of spec B (thesis "kinematic", section 4.2). Two things are said
otherwise here. n is NED, so the measured direction of gravity is ``-f_b / |f_b|``. And the
gradient (28) is taken along rotations only: its component along the quaternion itself changes
no attitude, but depends on how (29) is written and spoils the normalisation (48). What is left
of ``J^T f`` is the cross product of measured and predicted direction, times q.

The fusion (39) of a step ``mu`` down the gradient with the integrated rate, weighted by (42),
is the simplified step (46) times ``mu / (mu + beta dt)``: both filters are one here. That
factor is one where ``mu`` is infinite.
"""

from math import inf, isnan, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    BG,
    D_ACC,
    D_MAG,
    MAG,
    P_COS_D,
    P_HEAD,
    P_SIN_D,
    SKIP,
    START,
    W_HEAD,
    Q,
    advance_attitude,
    begin,
    field_in_body,
    load,
    note,
    post,
    store,
)
from strapdown.kernels.quat import down_in_body, rotate_inverse

P_BETA = P_HEAD  # [rad/s]
P_ZETA = P_HEAD + 1  # [rad/s^2]
P_SLOW = P_HEAD + 2  # rate at which half of the step is left [rad/s]; 0: simplified filter
P_FIELD = P_HEAD + 3  # direction of the field in n: 3; NaN: rebuilt from what is measured
P_SIZE = P_HEAD + 6
W_SIZE = W_HEAD


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` by one sample, in the order of spec B 2.9.5."""
    # fmt: on
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    if todo == START:
        advance_attitude(x, (wx - x[BG]) * dt, (wy - x[BG + 1]) * dt, (wz - x[BG + 2]) * dt)
        return
    qw, qx, qy, qz = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    ex, ey, ez = 0.0, 0.0, 0.0
    if has_acc:
        k = -1.0 / sqrt(ax * ax + ay * ay + az * az)  # at rest f_b points up
        mx, my, mz = k * ax, k * ay, k * az
        dx, dy, dz = down_in_body(qw, qx, qy, qz)
        ex, ey, ez = my * dz - mz * dy, mz * dx - mx * dz, mx * dy - my * dx
        note(w, D_ACC, mx - dx, my - dy, mz - dz, s.ACCEPTED)
        if has_mag:  # the field alone does not fix an attitude: it joins the accelerometer
            mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
            k = 1.0 / sqrt(mx * mx + my * my + mz * mz)
            mx, my, mz = k * mx, k * my, k * mz
            if isnan(p[P_FIELD]):  # (49)
                dx, dy, dz = field_in_body(qw, qx, qy, qz, mx, my, mz, p[P_COS_D], p[P_SIN_D])
            else:
                bn, be, bd = p[P_FIELD], p[P_FIELD + 1], p[P_FIELD + 2]
                dx, dy, dz = rotate_inverse(qw, qx, qy, qz, bn, be, bd)
            ex += my * dz - mz * dy
            ey += mz * dx - mx * dz
            ez += mx * dy - my * dx
            note(w, D_MAG, mx - dx, my - dy, mz - dz, s.ACCEPTED)
    elif has_mag:
        x[MAG] = 1.0  # waits for the accelerometer
    zeta_dt = p[P_ZETA] * dt
    zeta_k, turn_k = 0.0, 0.0
    norm2 = ex * ex + ey * ey + ez * ez
    if norm2 > 0.0:  # (48): a unit quaternion rate is a rate of two
        norm = sqrt(norm2)
        turn_k = 2.0 * (p[P_BETA] + zeta_dt) * dt / norm  # the bias found here acts at once
        zeta_k = 2.0 * zeta_dt / norm
    rx = (wx - x[BG]) * dt + turn_k * ex  # (25), (52), (46)-(48)
    ry = (wy - x[BG + 1]) * dt + turn_k * ey
    rz = (wz - x[BG + 2]) * dt + turn_k * ez
    if p[P_SLOW] > 0.0 and has_acc:  # (37)-(42), mu dt^-1 = alpha |w| / 2
        wx = wx - x[BG] + zeta_k * ex
        wy = wy - x[BG + 1] + zeta_k * ey
        wz = wz - x[BG + 2] + zeta_k * ez
        rate = sqrt(wx * wx + wy * wy + wz * wz)
        share = rate / (rate + p[P_SLOW])
        rx, ry, rz = share * rx, share * ry, share * rz
    advance_attitude(x, rx, ry, rz)
    x[BG] -= zeta_k * ex  # (50), (51)
    x[BG + 1] -= zeta_k * ey
    x[BG + 2] -= zeta_k * ez


# fmt: off
@kernel
def run(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat,
) -> None:
    """Loop of `step` over a recording."""
    # fmt: on
    j = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
    load(x, inf, j, t_mag, mag)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
