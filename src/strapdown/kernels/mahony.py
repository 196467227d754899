"""Mahony's explicit complementary filter with bias. Frames: n = NED, b = body.

References
----------
.. [1] R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on
       the special orthogonal group", IEEE TAC 53(5), 2008.
"""

from math import inf, sqrt

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
from strapdown.kernels.quat import down_in_body

P_KP = P_HEAD  # [1/s]
P_KI = P_HEAD + 1  # [1/s^2]
P_LIMIT = P_HEAD + 2  # of the accelerometer's error, a sine
P_SIZE = P_HEAD + 3
W_SIZE = W_HEAD

MIN_HORIZONTAL = 0.01  # square of the field's horizontal part below which it says less [1]


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` by one sample: the explicit filter of [1]_ with bias."""
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
        size = sqrt(ex * ex + ey * ey + ez * ez)
        if size > p[P_LIMIT]:  # a linear acceleration rather than an error of tilt
            size = p[P_LIMIT] / size
            ex, ey, ez = size * ex, size * ey, size * ez
        note(w, D_ACC, mx - dx, my - dy, mz - dz, s.ACCEPTED)
    if has_mag:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        k = 1.0 / sqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = k * mx, k * my, k * mz
        dx, dy, dz = field_in_body(qw, qx, qy, qz, mx, my, mz, p[P_COS_D], p[P_SIN_D])
        # About down alone, by the sine of the heading's error: dip says nothing of the tilt, and
        # a heading shall settle as quickly near the poles as elsewhere.
        ux, uy, uz = down_in_body(qw, qx, qy, qz)
        along = ux * dx + uy * dy + uz * dz
        turn = ux * (my * dz - mz * dy) + uy * (mz * dx - mx * dz) + uz * (mx * dy - my * dx)
        turn /= max(1.0 - along * along, MIN_HORIZONTAL)
        ex += turn * ux
        ey += turn * uy
        ez += turn * uz
        note(w, D_MAG, mx - dx, my - dy, mz - dz, s.ACCEPTED)
    x[BG] -= p[P_KI] * ex * dt
    x[BG + 1] -= p[P_KI] * ey * dt
    x[BG + 2] -= p[P_KI] * ez * dt
    advance_attitude(
        x,
        (wx - x[BG] + p[P_KP] * ex) * dt,
        (wy - x[BG + 1] + p[P_KP] * ey) * dt,
        (wz - x[BG + 2] + p[P_KP] * ez) * dt,
    )


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
