"""Two-stage quaternion Kalman filter. n = NED, b = body, u = east-north-up of magnetic north.

The source thinks in u, with the specific force up at rest and the field along y; `step` turns
q_nb into q_ub and back. `P` is the covariance of the four components of q_ub. Equation numbers
are those of spec C (thesis "indoor", section 4.2).
"""

from math import inf, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import (
    D_ACC,
    D_MAG,
    HEAD,
    MAG,
    P_HEAD,
    P_MAX_GAP,
    SKIP,
    START,
    W_HEAD,
    Q,
    T,
    begin,
    load,
    note_sigma,
    post,
    store,
)
from strapdown.kernels.quat import exp, mul, normalize, rotate

# --- own states of x -------------------------------------------------------------------
T_ACC = HEAD  # time of the last accelerometer update [s]
T_MAG = HEAD + 1  # time of the last field update [s]
X_SIZE = HEAD + 2

# --- own parameters ------------------------------------------------------------------------
P_PROCESS = P_HEAD  # noise of each component of the quaternion [1/sqrt(s)]
P_ACC_NOISE = P_HEAD + 1  # of the unit specific force [1/sqrt(Hz)]
P_MAG_NOISE = P_HEAD + 2  # of the unit field [1/sqrt(Hz)]
P_VARIANCE = P_HEAD + 3  # of each component of the quaternion at the start
P_Q_UN = P_HEAD + 4  # q_un: 4
P_A_PRIORI = P_HEAD + 8  # 1: the second stage is linearised where the first began
P_YY = P_HEAD + 9  # sign of q3 in rows 2 and 3 of the field model: 1, as printed -1
P_COMPONENTS = P_HEAD + 10  # 1: the stages are kept apart by components, as printed
P_EULER = P_HEAD + 11  # 1: the rate is integrated to first order, as printed
P_SIZE = P_HEAD + 12

# --- scratch -----------------------------------------------------------------------------
W_A = W_HEAD  # transition, or I - K H: 4x4
W_M = W_HEAD + 16  # A P: 4x4
W_PK = W_HEAD + 32  # the covariance that a gain comes from: 4x4
W_H = W_HEAD + 48  # measurement matrix: 3x4
W_PH = W_HEAD + 60  # P H^T: 4x3
W_K = W_HEAD + 72  # gain: 4x3
W_Z = W_HEAD + 84  # predicted measurement, then the residual: 3
W_E = W_HEAD + 87  # correction of the quaternion: 4
W_SIZE = W_HEAD + 91


@kernel
def transition(w: Vec, ew: float, ex: float, ey: float, ez: float) -> None:
    """Write A, ``A q = q e``: the turn of the body by e; (4.29) is ``e = (1, r / 2)``."""
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


@kernel
def congruence(P: Mat, w: Vec) -> None:
    """``P <- A P A^T`` with A of the scratch."""
    for i in range(4):
        for j in range(4):
            v = 0.0
            for k in range(4):
                v += w[W_A + 4 * i + k] * P[k, j]
            w[W_M + 4 * i + j] = v
    for i in range(4):
        for j in range(i + 1):
            v = 0.0
            for k in range(4):
                v += w[W_M + 4 * i + k] * w[W_A + 4 * j + k]
            P[i, j] = v
            P[j, i] = v


@kernel
def gravity_model(w: Vec, q1: float, q2: float, q3: float, q4: float) -> None:
    """Write h1, the direction up in b (4.16), and its derivative H1 (4.18)."""
    w[W_Z] = 2.0 * (q2 * q4 - q1 * q3)
    w[W_Z + 1] = 2.0 * (q1 * q2 + q3 * q4)
    w[W_Z + 2] = q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4
    (
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3],
        w[W_H + 4], w[W_H + 5], w[W_H + 6], w[W_H + 7],
        w[W_H + 8], w[W_H + 9], w[W_H + 10], w[W_H + 11],
    ) = (
        -2.0 * q3, 2.0 * q4, -2.0 * q1, 2.0 * q2,
        2.0 * q2, 2.0 * q1, 2.0 * q4, 2.0 * q3,
        2.0 * q1, -2.0 * q2, -2.0 * q3, 2.0 * q4,
    )  # fmt: skip


@kernel
def field_model(w: Vec, q1: float, q2: float, q3: float, q4: float, yy: float) -> None:
    """Write h2, magnetic north in b (4.21), and its derivative H2 (4.22).

    The sign `yy` of ``q3^2`` and of the two elements of H2 that follow is 1; printed is -1.
    """
    w[W_Z] = 2.0 * (q2 * q3 + q1 * q4)
    w[W_Z + 1] = q1 * q1 - q2 * q2 + yy * q3 * q3 - q4 * q4
    w[W_Z + 2] = 2.0 * (q3 * q4 - q1 * q2)
    (
        w[W_H], w[W_H + 1], w[W_H + 2], w[W_H + 3],
        w[W_H + 4], w[W_H + 5], w[W_H + 6], w[W_H + 7],
        w[W_H + 8], w[W_H + 9], w[W_H + 10], w[W_H + 11],
    ) = (
        2.0 * q4, 2.0 * q3, 2.0 * q2, 2.0 * q1,
        2.0 * q1, -2.0 * q2, yy * 2.0 * q3, -2.0 * q4,
        -2.0 * q2, -2.0 * q1, yy * 2.0 * q4, 2.0 * q3,
    )  # fmt: skip


# fmt: off
@kernel
def inverse(
    a11: float, a21: float, a22: float, a31: float, a32: float, a33: float
) -> tuple[float, float, float, float, float, float]:
    """Inverse of a symmetric 3x3 matrix, as its lower triangle."""
    # fmt: on
    b11 = a22 * a33 - a32 * a32
    b21 = a31 * a32 - a21 * a33
    b31 = a21 * a32 - a31 * a22
    d = 1.0 / (a11 * b11 + a21 * b21 + a31 * b31)
    return (
        d * b11,
        d * b21,
        d * (a11 * a33 - a31 * a31),
        d * b31,
        d * (a21 * a31 - a11 * a32),
        d * (a11 * a22 - a21 * a21),
    )


@kernel
def remember(P: Mat, w: Vec) -> None:
    """Keep the covariance that the next gain comes from."""
    for i in range(4):
        for j in range(4):
            w[W_PK + 4 * i + j] = P[i, j]


# fmt: off
@kernel
def correct(
    P: Mat, w: Vec, cell: int, zx: float, zy: float, zz: float, r: float
) -> None:
    """One stage: gain, correction ``K (z - h)`` into the scratch, covariance.

    Joseph's form stays positive for a gain of another covariance too; for the optimal gain it is
    the ``(I - K H) P`` of the source.
    """
    # fmt: on
    for i in range(4):
        for j in range(3):
            v = 0.0
            for k in range(4):
                v += w[W_PK + 4 * i + k] * w[W_H + 4 * j + k]
            w[W_PH + 3 * i + j] = v
    s11, s21, s22, s31, s32, s33 = r, 0.0, r, 0.0, 0.0, r
    for k in range(4):
        a, b, c = w[W_PH + 3 * k], w[W_PH + 3 * k + 1], w[W_PH + 3 * k + 2]
        s11 += w[W_H + k] * a
        s21 += w[W_H + 4 + k] * a
        s22 += w[W_H + 4 + k] * b
        s31 += w[W_H + 8 + k] * a
        s32 += w[W_H + 8 + k] * b
        s33 += w[W_H + 8 + k] * c
    w[W_Z] = zx - w[W_Z]
    w[W_Z + 1] = zy - w[W_Z + 1]
    w[W_Z + 2] = zz - w[W_Z + 2]
    note_sigma(w, cell, 0, w[W_Z], s11)
    note_sigma(w, cell, 1, w[W_Z + 1], s22)
    note_sigma(w, cell, 2, w[W_Z + 2], s33)
    w[cell + 6] = s.ACCEPTED
    i11, i21, i22, i31, i32, i33 = inverse(s11, s21, s22, s31, s32, s33)
    for i in range(4):
        a, b, c = w[W_PH + 3 * i], w[W_PH + 3 * i + 1], w[W_PH + 3 * i + 2]
        ka = a * i11 + b * i21 + c * i31
        kb = a * i21 + b * i22 + c * i32
        kc = a * i31 + b * i32 + c * i33
        w[W_K + 3 * i] = ka
        w[W_K + 3 * i + 1] = kb
        w[W_K + 3 * i + 2] = kc
        w[W_E + i] = ka * w[W_Z] + kb * w[W_Z + 1] + kc * w[W_Z + 2]
        for j in range(4):
            v = -ka * w[W_H + j] - kb * w[W_H + 4 + j] - kc * w[W_H + 8 + j]
            if i == j:
                v += 1.0
            w[W_A + 4 * i + j] = v
    congruence(P, w)
    for i in range(4):
        for j in range(i + 1):
            v = 0.0
            for k in range(3):
                v += w[W_K + 3 * i + k] * w[W_K + 3 * j + k]
            P[i, j] += r * v
            P[j, i] = P[i, j]


@kernel
def keep_tilt(w: Vec, qw: float, qx: float, qy: float, qz: float, components: float) -> None:
    """Take the part about the vertical out of the correction; printed: its fourth component.

    A turn about the vertical moves q along ``(-q4, -q3, q2, q1)``. Level and heading east that is
    the fourth component.
    """
    if components > 0.0:
        w[W_E + 3] = 0.0
    else:
        v = -qz * w[W_E] - qy * w[W_E + 1] + qx * w[W_E + 2] + qw * w[W_E + 3]
        w[W_E] += v * qz
        w[W_E + 1] += v * qy
        w[W_E + 2] -= v * qx
        w[W_E + 3] -= v * qw


@kernel
def keep_heading(w: Vec, qw: float, qx: float, qy: float, qz: float, components: float) -> None:
    """Leave the part about the vertical only; printed: components one and four."""
    if components > 0.0:
        w[W_E + 1] = 0.0
        w[W_E + 2] = 0.0
    else:
        v = -qz * w[W_E] - qy * w[W_E + 1] + qx * w[W_E + 2] + qw * w[W_E + 3]
        w[W_E] = -v * qz
        w[W_E + 1] = -v * qy
        w[W_E + 2] = v * qx
        w[W_E + 3] = v * qw


@kernel
def reset(x: Vec, P: Mat, p: Vec) -> None:
    """Set the covariance of the start."""
    for i in range(4):
        for j in range(4):
            P[i, j] = 0.0
        P[i, i] = p[P_VARIANCE]
    x[T_ACC] = x[T]
    x[T_MAG] = x[T]


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo == SKIP:
        return
    if p[P_EULER] > 0.0:
        ew, ex, ey, ez = 1.0, 0.5 * wx * dt, 0.5 * wy * dt, 0.5 * wz * dt
    else:
        ew, ex, ey, ez = exp(wx * dt, wy * dt, wz * dt)
    qw, qx, qy, qz = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ew, ex, ey, ez)
    qw, qx, qy, qz = normalize(qw, qx, qy, qz)
    if todo == START:
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = qw, qx, qy, qz
        reset(x, P, p)
        return
    if dt == 0.0:  # the first sample of a given attitude: no interval, nothing to weigh by
        reset(x, P, p)
    transition(w, ew, ex, ey, ez)
    congruence(P, w)
    for i in range(4):
        P[i, i] += p[P_PROCESS] * p[P_PROCESS] * dt

    uw, ux, uy, uz = p[P_Q_UN], p[P_Q_UN + 1], p[P_Q_UN + 2], p[P_Q_UN + 3]
    qw, qx, qy, qz = mul(uw, ux, uy, uz, qw, qx, qy, qz)
    bw, bx, by, bz = qw, qx, qy, qz  # where the second stage is linearised
    remember(P, w)
    if has_acc and t > x[T_ACC]:
        k = 1.0 / sqrt(ax * ax + ay * ay + az * az)
        r = p[P_ACC_NOISE] * p[P_ACC_NOISE] / min(t - x[T_ACC], p[P_MAX_GAP])
        gravity_model(w, qw, qx, qy, qz)
        correct(P, w, D_ACC, k * ax, k * ay, k * az, r)
        keep_tilt(w, qw, qx, qy, qz, p[P_COMPONENTS])
        qw, qx, qy, qz = normalize(qw + w[W_E], qx + w[W_E + 1], qy + w[W_E + 2], qz + w[W_E + 3])
        x[T_ACC] = t
        if p[P_A_PRIORI] == 0.0:
            bw, bx, by, bz = qw, qx, qy, qz
            remember(P, w)
    if has_mag and t > x[T_MAG]:
        mx, my, mz = x[MAG + 1], x[MAG + 2], x[MAG + 3]
        if p[P_YY] > 0.0:  # the model knows no dip: level the field
            mx, my, mz = rotate(bw, bx, by, bz, mx, my, mz)
            m2 = mx * mx + my * my + mz * mz
            if mx * mx + my * my > 1e-12 * m2:
                mx, my, mz = rotate(bw, -bx, -by, -bz, mx, my, 0.0)
            else:  # no horizontal direction
                mx, my, mz = 0.0, 0.0, 0.0
        m2 = mx * mx + my * my + mz * mz
        if m2 > 0.0:
            k = 1.0 / sqrt(m2)
            r = p[P_MAG_NOISE] * p[P_MAG_NOISE] / min(t - x[T_MAG], p[P_MAX_GAP])
            field_model(w, bw, bx, by, bz, p[P_YY])
            correct(P, w, D_MAG, k * mx, k * my, k * mz, r)
            keep_heading(w, qw, qx, qy, qz, p[P_COMPONENTS])
            qw, qx, qy, qz = normalize(
                qw + w[W_E], qx + w[W_E + 1], qy + w[W_E + 2], qz + w[W_E + 3]
            )
            x[T_MAG] = t
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = mul(uw, -ux, -uy, -uz, qw, qx, qy, qz)


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
