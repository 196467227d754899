"""Indirect (error-state) extended Kalman filter of Trawny and Roumeliotis. n = NED, b = body.

Error state ``(dtheta_b, dbg)`` with ``q_nb_true = q_nb exp(dtheta_b)``. The source's quaternion is
JPL's of n to b, scalar last: the same four numbers as the Hamilton q_nb, the scalar moved to
the front; and its error ``dq x q`` is ``q_nb dq`` here. Equation numbers are those of spec A
(thesis "three-axis platform", chapter 7). Layouts of `P`, `p` and scratch begin as the MEKF's.
"""

from math import cos, inf, sin, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.mekf import (
    P_ACC_NOISE,
    P_BIAS_NOISE,
    P_GATE,
    P_GRAVITY,
    P_GYR_NOISE,
    P_MAG_NOISE,
    P_STD_HEADING,
    STARTED,
    T_ACC,
    T_MAG,
    W_A,
    W_B,
    W_DX,
    bridge_gap,
    predict,
    reset_attitude,
    reset_heading,
    transition,
    unseen,
    update_scalar,
    write_std,
)
from strapdown.kernels.mekf import P_SIZE as MEKF_P_SIZE
from strapdown.kernels.mekf import W_SIZE as MEKF_W_SIZE
from strapdown.kernels.mekf import X_SIZE as MEKF_X_SIZE
from strapdown.kernels.memory import (
    ALIGNED,
    BG,
    D_ACC,
    D_MAG,
    FULL,
    MAG,
    NO,
    P_COS_D,
    P_MAX_GAP,
    P_SIN_D,
    SKIP,
    STAR,
    START,
    STATUS,
    TILT,
    Q,
    T,
    begin,
    load,
    load_events,
    note_sigma,
    post,
    set_status,
    store,
)
from strapdown.kernels.quat import exp, mul, normalize, rotate, rotate_inverse

# --- own states of x, after those of the MEKF --------------------------------------------
REF_H = MEKF_X_SIZE  # horizontal part of the reference field [T], zero before it is known
REF_D = MEKF_X_SIZE + 1  # its part down [T]
X_SIZE = MEKF_X_SIZE + 2

# --- own parameters, after those of the MEKF; P_MAG_NOISE is [T/sqrt(Hz)], k included ----------
P_STD_STAR = MEKF_P_SIZE  # of each component of the star tracker's quaternion
P_STAR_ONLY = MEKF_P_SIZE + 1  # 1: space
P_TRUNCATED = MEKF_P_SIZE + 2  # 1: v2
P_SIZE = MEKF_P_SIZE + 3
W_SIZE = MEKF_W_SIZE

# Beyond this angle per sample [rad] the truncated series say nothing: v2 then takes the exact.
MAX_TRUNCATED = 0.5


@kernel
def series(y: float, n: int) -> float:
    """Sum of ``(-y)^k n! / (n + 2k)!``; the first term left out is ``y^9 n! / (n + 18)!``."""
    total = 1.0
    for k in range(8):
        m = n + 2 * (7 - k)
        total = 1.0 - y * total / float((m + 1) * (m + 2))
    return total


@kernel
def coefficients(psi2: float) -> tuple[float, float, float, float]:
    """Functions of the angle psi in (7.24), (7.27), (7.28), divided by its power.

    ``(1 - cos) / psi^2``, ``(psi - sin) / psi^3``, ``(psi^2 / 2 + cos - 1) / psi^4`` and
    ``(psi^3 / 3 + 2 sin - 2 psi) / psi^5``. At 1 rad cancellation costs the last one two digits.
    """
    if psi2 < 1.0:
        f2 = series(psi2, 2) / 2.0
        f3 = series(psi2, 3) / 6.0
        f4 = series(psi2, 4) / 24.0
        f5 = series(psi2, 5) / 60.0
    else:
        psi = sqrt(psi2)
        f2 = (1.0 - cos(psi)) / psi2
        f3 = (psi - sin(psi)) / (psi2 * psi)
        f4 = (0.5 * psi2 + cos(psi) - 1.0) / (psi2 * psi2)
        f5 = (psi2 * psi / 3.0 + 2.0 * sin(psi) - 2.0 * psi) / (psi2 * psi2 * psi)
    return f2, f3, f4, f5


# fmt: off
@kernel
def transition_exact(
    w: Vec, phi_x: float, phi_y: float, phi_z: float, dt: float, f2: float, f3: float
) -> None:
    """Write Theta (7.23) and Psi (7.24) of the turn phi_b into the scratch."""
    # fmt: on
    transition(w, phi_x, phi_y, phi_z, dt)  # its first block is Theta
    psi2 = phi_x * phi_x + phi_y * phi_y + phi_z * phi_z
    a, b = dt * f2, dt * f3
    w[W_B] = -dt - b * (phi_x * phi_x - psi2)
    w[W_B + 1] = -a * phi_z - b * phi_x * phi_y
    w[W_B + 2] = a * phi_y - b * phi_x * phi_z
    w[W_B + 3] = a * phi_z - b * phi_x * phi_y
    w[W_B + 4] = -dt - b * (phi_y * phi_y - psi2)
    w[W_B + 5] = -a * phi_x - b * phi_y * phi_z
    w[W_B + 6] = -a * phi_y - b * phi_x * phi_z
    w[W_B + 7] = a * phi_x - b * phi_y * phi_z
    w[W_B + 8] = -dt - b * (phi_z * phi_z - psi2)


@kernel
def transition_truncated(w: Vec, phi_x: float, phi_y: float, phi_z: float, dt: float) -> None:
    """Write Theta (8.1) and Psi (8.2) into the scratch."""
    (
        w[W_A], w[W_A + 1], w[W_A + 2],
        w[W_A + 3], w[W_A + 4], w[W_A + 5],
        w[W_A + 6], w[W_A + 7], w[W_A + 8],
    ) = 1.0, phi_z, -phi_y, -phi_z, 1.0, phi_x, phi_y, -phi_x, 1.0  # fmt: skip
    for i in range(9):
        w[W_B + i] = 0.0
    w[W_B] = -dt
    w[W_B + 4] = -dt
    w[W_B + 8] = -dt


# fmt: off
@kernel
def add_noise(
    P: Mat, phi_x: float, phi_y: float, phi_z: float, dt: float,
    n2: float, k2: float, f3: float, f4: float, f5: float,
) -> None:
    """Add Q_d, (7.26) to (7.29), of spectral densities n2 and k2.

    All f zero leaves the truncated form, (8.3) to (8.5).
    """
    # fmt: on
    psi2 = phi_x * phi_x + phi_y * phi_y + phi_z * phi_z
    c = k2 * dt * dt
    u, v = c * f3, c * f4
    for i in range(3):
        a = phi_x if i == 0 else (phi_y if i == 1 else phi_z)
        for j in range(3):
            b = phi_x if j == 0 else (phi_y if j == 1 else phi_z)
            square = a * b
            if i == j:
                square -= psi2
                P[i, j] += n2 * dt + c * dt / 3.0
                P[i, 3 + j] -= 0.5 * c
                P[3 + i, 3 + j] += k2 * dt
            P[i, j] += c * dt * f5 * square
            P[i, 3 + j] -= v * square
    P[0, 4] -= u * phi_z
    P[0, 5] += u * phi_y
    P[1, 3] += u * phi_z
    P[1, 5] -= u * phi_x
    P[2, 3] -= u * phi_y
    P[2, 4] += u * phi_x
    for i in range(3):
        for j in range(3):
            P[3 + j, i] = P[i, 3 + j]


@kernel
def propagate(P: Mat, w: Vec, p: Vec, rx: float, ry: float, rz: float, dt: float) -> None:
    """Covariance over one interval, in which the body turns by r_b."""
    psi2 = rx * rx + ry * ry + rz * rz
    f2, f3, f4, f5 = 0.0, 0.0, 0.0, 0.0
    if p[P_TRUNCATED] > 0.0 and psi2 < MAX_TRUNCATED * MAX_TRUNCATED:
        transition_truncated(w, rx, ry, rz, dt)
    else:
        f2, f3, f4, f5 = coefficients(psi2)
        transition_exact(w, rx, ry, rz, dt, f2, f3)
    predict(P, w, 0.0, 0.0)
    n2 = p[P_GYR_NOISE] * p[P_GYR_NOISE]
    k2 = p[P_BIAS_NOISE] * p[P_BIAS_NOISE]
    add_noise(P, rx, ry, rz, dt, n2, k2, f3, f4, f5)


# fmt: off
@kernel
def update_vector(
    P: Mat, w: Vec, cell: int,
    dx: float, dy: float, dz: float,
    mx: float, my: float, mz: float,
    r: float, gate: float,
) -> bool:
    """Update with the measured vector m, predicted as d in b: ``H = [d x]`` (7.39)."""
    # fmt: on
    a, va, ok_a = update_scalar(P, w, 0.0, -dz, dy, mx - dx, r, gate)
    b, vb, ok_b = update_scalar(P, w, dz, 0.0, -dx, my - dy, r, gate)
    c, vc, ok_c = update_scalar(P, w, -dy, dx, 0.0, mz - dz, r, gate)
    note_sigma(w, cell, 0, a, va)
    note_sigma(w, cell, 1, b, vb)
    note_sigma(w, cell, 2, c, vc)
    accepted = ok_a and ok_b and ok_c
    w[cell + 6] = s.ACCEPTED if accepted else s.REJECTED_GATE
    return accepted


# fmt: off
@kernel
def update_star(
    x: Vec, P: Mat, w: Vec,
    sw: float, sx: float, sy: float, sz: float,
    r: float, gate: float,
) -> bool:
    """Update with the star tracker's q_nb: ``dq = q_nb^-1 q_star``, ``H = [I/2 0]`` (7.32)."""
    # fmt: on
    ew, ex, ey, ez = mul(x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3], sw, sx, sy, sz)
    if ew < 0.0:  # the same rotation, taken the short way
        ex, ey, ez = -ex, -ey, -ez
    _, _, ok_x = update_scalar(P, w, 0.5, 0.0, 0.0, ex, r, gate)
    _, _, ok_y = update_scalar(P, w, 0.0, 0.5, 0.0, ey, r, gate)
    _, _, ok_z = update_scalar(P, w, 0.0, 0.0, 0.5, ez, r, gate)
    return ok_x and ok_y and ok_z


@kernel
def inject(x: Vec, w: Vec) -> None:
    """Move the error state found into the estimate, (7.51) to (7.55)."""
    ex, ey, ez = 0.5 * w[W_DX], 0.5 * w[W_DX + 1], 0.5 * w[W_DX + 2]
    n2 = ex * ex + ey * ey + ez * ez
    ew = 1.0
    if n2 <= 1.0:  # beyond, (7.54): normalised below
        ew = sqrt(1.0 - n2)
    qw, qx, qy, qz = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ew, ex, ey, ez)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(qw, qx, qy, qz)
    for i in range(3):
        x[BG + i] += w[W_DX + 3 + i]


@kernel
def learn_reference(x: Vec) -> None:
    """Take dip and magnitude of the reference from the field of the inbox, if not vertical."""
    mx, my, mz = rotate(
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3], x[MAG + 1], x[MAG + 2], x[MAG + 3]
    )
    h2 = mx * mx + my * my
    if h2 > 1e-12 * (h2 + mz * mz):
        x[REF_H] = sqrt(h2)
        x[REF_D] = mz


@kernel
def restart(x: Vec, P: Mat, p: Vec) -> None:
    """Set covariance and clocks after an alignment."""
    x[STARTED] = 1.0
    reset_attitude(x, P, p)
    x[T_ACC] = x[T]
    x[T_MAG] = x[T]
    write_std(x, P)


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` and `P` by one sample."""
    # fmt: on
    if p[P_STAR_ONLY] > 0.0:
        ax, ay, az = inf, inf, inf
    todo, dt, wx, wy, wz, has_acc, has_mag = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if (int(x[STATUS]) & s.GYR_INVALID) != 0:  # the star tracker waits, too
        return
    sw, sx, sy, sz = x[STAR + 1], x[STAR + 2], x[STAR + 3], x[STAR + 4]
    has_star = x[STAR] > 0.0
    x[STAR] = 0.0
    if has_star:
        n2 = sw * sw + sx * sx + sy * sy + sz * sz
        if n2 > 0.98 and n2 < 1.02:
            sw, sx, sy, sz = normalize(sw, sx, sy, sz)
        else:
            has_star = False
            set_status(x, s.AIDING_REJECTED)
    if has_star and (x[ALIGNED] == NO or x[ALIGNED] == TILT):
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = sw, sx, sy, sz
        x[ALIGNED] = FULL
        x[STATUS] = float(int(x[STATUS]) & ~s.ALIGNING)
        restart(x, P, p)
        return
    if todo == SKIP:
        return
    rx, ry, rz = (wx - x[BG]) * dt, (wy - x[BG + 1]) * dt, (wz - x[BG + 2]) * dt
    ew, ex, ey, ez = exp(rx, ry, rz)  # (7.9)
    qw, qx, qy, qz = mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ew, ex, ey, ez)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = normalize(qw, qx, qy, qz)
    if todo == START and has_mag and x[ALIGNED] == FULL and x[REF_H] == 0.0:
        learn_reference(x)
    if x[STARTED] == 0.0:
        if todo == START:  # not so if the attitude was given
            restart(x, P, p)
            return
        x[STARTED] = 1.0
        x[T_ACC] = x[T]
        x[T_MAG] = x[T]
    propagate(P, w, p, rx, ry, rz, dt)
    if (int(x[STATUS]) & (s.SATURATED | s.GYR_STUCK)) != 0:
        for i in range(3):
            P[i, i] += unseen(p, dt)
    if (int(x[STATUS]) & s.GAP) != 0:
        bridge_gap(x, P, p, dt, has_acc, ax, ay, az)
    if todo == START:  # the first field, or the first after a gap, has just set the heading
        reset_heading(x, P, p[P_STD_HEADING] * p[P_STD_HEADING])
        x[T_MAG] = x[T]
        write_std(x, P)
        return

    for i in range(6):
        w[W_DX + i] = 0.0
    if has_star:
        r = p[P_STD_STAR] * p[P_STD_STAR]
        if not update_star(x, P, w, sw, sx, sy, sz, r, p[P_GATE]):
            set_status(x, s.AIDING_REJECTED)
    if has_acc and t > x[T_ACC]:
        k = 1.0 / p[P_GRAVITY]
        dx, dy, dz = rotate_inverse(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, 0.0, -1.0)
        # A sample stands for the time since the last one, but not for what a gap has hidden.
        r = k * k * p[P_ACC_NOISE] * p[P_ACC_NOISE] / min(t - x[T_ACC], p[P_MAX_GAP])
        if not update_vector(P, w, D_ACC, dx, dy, dz, k * ax, k * ay, k * az, r, p[P_GATE]):
            set_status(x, s.ACC_REJECTED)
        x[T_ACC] = t
    if (int(x[STATUS]) & s.MAG_DISTURBED) != 0 and not has_mag:
        x[T_MAG] = t  # the next one does not stand for the time of those left out
    if has_mag and t > x[T_MAG]:
        if x[REF_H] == 0.0:
            learn_reference(x)
        elif x[ALIGNED] != TILT:
            k = 1.0 / sqrt(x[REF_H] * x[REF_H] + x[REF_D] * x[REF_D])
            north, east, down = x[REF_H] * p[P_COS_D], x[REF_H] * p[P_SIN_D], x[REF_D]
            dx, dy, dz = rotate_inverse(
                x[Q], x[Q + 1], x[Q + 2], x[Q + 3], k * north, k * east, k * down
            )
            mx, my, mz = k * x[MAG + 1], k * x[MAG + 2], k * x[MAG + 3]
            r = k * k * p[P_MAG_NOISE] * p[P_MAG_NOISE] / min(t - x[T_MAG], p[P_MAX_GAP])
            if not update_vector(P, w, D_MAG, dx, dy, dz, mx, my, mz, r, p[P_GATE]):
                set_status(x, s.MAG_REJECTED)
            x[T_MAG] = t
    inject(x, w)
    write_std(x, P)


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
    e = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        e = load_events(x, t[k], e, events)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
    load(x, inf, j, t_mag, mag)
    load_events(x, inf, e, events)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
