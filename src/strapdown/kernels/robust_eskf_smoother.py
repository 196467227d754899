"""Fixed-interval smoother of the robust error-state filter.

The forward pass is the filter itself; it keeps a record of each interval that it closes. The
backward pass is Bryson and Frazier's in its modified form [1]_: it carries the adjoint vector
lambda and its matrix, needs no inverse of a covariance, and takes each scalar measurement
back as it was entered. At the end of an interval::

    x_smoothed = x - P lambda,    P_smoothed = P - P Lambda P

and across a measurement with row h, gain k, innovation y of variance s, and a transition::

    lambda = (I - k h)^T lambda - h^T y / s,    Lambda = (I - k h)^T Lambda (I - k h) + h^T h / s
    lambda = Phi^T lambda,                      Lambda = Phi^T Lambda Phi

References
----------
.. [1] G. J. Bierman, "Fixed interval smoothing with discrete measurements", International
       Journal of Control 18(1), 1973.
"""

from math import inf, sqrt

from strapdown.kernels import status as s
from strapdown.kernels._jit import IntVec, Mat, Vec, kernel
from strapdown.kernels.memory import BG, STATUS, STD_ATT, STD_BG, Q, load, store
from strapdown.kernels.quat import exp, mul, normalize, rotate
from strapdown.kernels.robust_eskf import step
from strapdown.kernels.robust_eskf_covariance import (
    EBG,
    INTERVAL,
    LAG,
    PHI,
    VEL,
    N,
    transpose_on_row,
)
from strapdown.kernels.robust_eskf_layout import (
    MEASURED,
    P_TIMING_STD,
    R_CLOSED,
    R_COUNT,
    R_LEVEL_T,
    R_MEASURED,
    R_RESET,
    R_RESET_T,
    R_ROWS,
    R_STEP,
    R_SUMS,
    R_TURN,
    RECORD,
    RECORD_SIZE,
)

# Columns of the smoothed corrections, six of attitude and gyro bias each: at the end of an
# interval to the filter's state after its update, and to that before it; deviations.
AFTER = 0
BEFORE = 6
STD = 12
TURN = 18  # turn about down that the filter made later on
CORRECTION_SIZE = 19


# fmt: off
@kernel
def forward(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat, records: Mat, ends: IntVec,
) -> int:
    """Run the filter and keep the record of each interval; returns how many were closed.

    `ends` receives the row of the sample that closed each. Stops keeping when `records` is full.
    """
    # fmt: on
    j = 0
    n = 0
    w[R_CLOSED] = 0.0
    w[R_RESET] = 0.0
    w[R_TURN] = 0.0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
        if w[R_CLOSED] > 0.0 and n < records.shape[0]:
            for i in range(RECORD_SIZE):
                records[n, i] = w[RECORD + i]
            ends[n] = k
            n += 1
            w[R_CLOSED] = 0.0
            w[R_RESET] = 0.0
            w[R_TURN] = 0.0
    if t.shape[0] > 0:
        load(x, inf, j, t_mag, mag)
    return n


@kernel
def _take_back(r: Mat, n: int, m: int, adjoint: Mat) -> None:
    """Take the measurement that begins in column m of record n back."""
    i = int(r[n, m])
    h_lag = r[n, m + 1]
    variance = r[n, m + 3]
    k = 1.0 / sqrt(variance)
    g = m + 4
    # rows 0 to N-1: Lambda, row N: lambda, row N+1: Lambda k
    c = r[n, m + 2] / variance
    for j in range(N):
        c += k * r[n, g + j] * adjoint[N, j]
    adjoint[N, i] -= c
    adjoint[N, LAG] -= h_lag * c
    b = 1.0 / variance
    for a in range(N):
        u = 0.0
        for j in range(N):
            u += adjoint[a, j] * r[n, g + j]
        u *= k
        adjoint[N + 1, a] = u
        b += k * r[n, g + a] * u
    for j in range(N):
        u = adjoint[N + 1, j]
        adjoint[i, j] -= u
        adjoint[LAG, j] -= h_lag * u
        adjoint[j, i] -= u
        adjoint[j, LAG] -= h_lag * u
    adjoint[i, i] += b
    adjoint[i, LAG] += h_lag * b
    adjoint[LAG, i] += h_lag * b
    adjoint[LAG, LAG] += h_lag * h_lag * b


@kernel
def _cut(adjoint: Mat, i: int) -> None:
    """Cut element i off: what is learnt of it later says nothing on the time before."""
    for j in range(N + 1):
        adjoint[j, i] = 0.0
    for j in range(N):
        adjoint[i, j] = 0.0


@kernel
def backward(records: Mat, count: int, adjoint: Mat, sums: Vec, correction: Mat) -> None:
    """Smoothed corrections of each record; `adjoint` (N + 2, N) and `sums` are scratch."""
    for i in range(N + 2):
        for j in range(N):
            adjoint[i, j] = 0.0
    turn = 0.0
    for back in range(count):
        n = count - 1 - back
        # at the end of the interval, after its update
        for i in range(6):
            row = R_ROWS - RECORD + i * N
            mean = 0.0
            var = records[n, row + (PHI + i if i < 3 else EBG + i - 3)]
            for a in range(N):
                mean -= records[n, row + a] * adjoint[N, a]
                u = 0.0
                for j in range(N):
                    u += adjoint[a, j] * records[n, row + j]
                var -= u * records[n, row + a]
            correction[n, AFTER + i] = mean
            correction[n, BEFORE + i] = mean + records[n, R_STEP - RECORD + i]
            correction[n, STD + i] = sqrt(max(0.0, var))
        correction[n, TURN] = turn
        for back_m in range(int(records[n, R_COUNT - RECORD])):
            m = int(records[n, R_COUNT - RECORD]) - 1 - back_m
            _take_back(records, n, R_MEASURED - RECORD + m * MEASURED, adjoint)
        for i in range(INTERVAL):
            sums[i] = records[n, R_SUMS - RECORD + i]
        for i in range(N + 1):
            transpose_on_row(adjoint, i, sums, 0)
        for i in range(N):
            for j in range(i):
                u = adjoint[i, j]
                adjoint[i, j] = adjoint[j, i]
                adjoint[j, i] = u
        for i in range(N):
            transpose_on_row(adjoint, i, sums, 0)
        reset = records[n, R_RESET - RECORD]
        turn += records[n, R_TURN - RECORD]
        if reset == 1.0:
            for i in range(3):
                _cut(adjoint, PHI + i)
                _cut(adjoint, VEL + i)
        elif reset == 2.0:
            _cut(adjoint, PHI + 2)


# fmt: off
@kernel
def apply(
    t: Vec, gyr: Mat, p: Vec, records: Mat, ends: IntVec, count: int, correction: Mat, out: Mat
) -> None:
    """Correct the filter's attitude and bias in `out`, and write the smoothed deviations.

    Within an interval the error of the filter's prediction grows linearly.
    """
    # fmt: on
    n = 0  # the record whose interval holds the sample
    base = STATUS
    for k in range(t.shape[0]):
        while n < count and ends[n] < k:
            n += 1
        if count == 0 or int(out[k, 0]) & s.ALIGNING:
            continue
        right = min(n, count - 1)
        left = max(n - 1, 0)
        c_left, c_right = AFTER, BEFORE
        f = 1.0
        if n == 0:
            left = 0
            c_left = BEFORE
        elif n == count or ends[n] == k:  # after the last interval, or right after an update
            c_right = AFTER
        else:
            f = (t[k] - t[ends[left]]) / (t[ends[n]] - t[ends[left]])
            if records[n, R_RESET - RECORD] == 1.0:  # nothing links the two sides
                f = 0.0 if t[k] < records[n, R_RESET_T - RECORD] else 1.0
        turn = correction[right, TURN]
        if n < count and t[k] < records[n, R_RESET_T - RECORD]:
            turn += records[n, R_TURN - RECORD]
        g = 1.0 - f
        e0, e1, e2, e3 = exp(
            g * correction[left, c_left] + f * correction[right, c_right],
            g * correction[left, c_left + 1] + f * correction[right, c_right + 1],
            g * correction[left, c_left + 2] + f * correction[right, c_right + 2] + turn,
        )
        j = Q - base
        q0, q1, q2, q3 = out[k, j], out[k, j + 1], out[k, j + 2], out[k, j + 3]
        q0, q1, q2, q3 = mul(e0, e1, e2, e3, q0, q1, q2, q3)
        q0, q1, q2, q3 = normalize(q0, q1, q2, q3)
        out[k, j], out[k, j + 1], out[k, j + 2], out[k, j + 3] = q0, q1, q2, q3
        bx, by, bz = out[k, BG - base], out[k, BG - base + 1], out[k, BG - base + 2]
        rx, ry, _ = rotate(q0, q1, q2, q3, gyr[k, 0] - bx, gyr[k, 1] - by, gyr[k, 2] - bz)
        rate2 = max(rx * rx, ry * ry)
        for i in range(3):
            std = g * correction[left, STD + i] + f * correction[right, STD + i]
            out[k, STD_ATT - base + i] = std
            out[k, BG - base + i] += (
                g * correction[left, c_left + 3 + i] + f * correction[right, c_right + 3 + i]
            )
            std = g * correction[left, STD + 3 + i] + f * correction[right, STD + 3 + i]
            out[k, STD_BG - base + i] = std
        if rate2 < inf:  # not where the gyro has no sample
            a = p[P_TIMING_STD]
            b = out[k, STD_ATT - base]
            out[k, STD_ATT - base] = sqrt(b * b + a * a * rx * rx)
            b = out[k, STD_ATT - base + 1]
            out[k, STD_ATT - base + 1] = sqrt(b * b + a * a * ry * ry)


@kernel
def level_back(t: Vec, gyr: Mat, records: Mat, ends: IntVec, count: int, out: Mat) -> None:
    """Turn the attitude back from where a level was found to where it began to be sought.

    In between the filter only levels; the gyroscope links these samples to what came of it.
    """
    j = Q - STATUS
    first = 0
    for n in range(count):
        if records[n, R_RESET - RECORD] == 1.0:
            k = ends[n]
            while k > first and t[k] > records[n, R_LEVEL_T - RECORD]:
                k -= 1
            wx, wy, wz = 0.0, 0.0, 0.0
            while k > first and t[k - 1] >= records[n, R_RESET_T - RECORD]:
                if int(out[k - 1, 0]) & s.ALIGNING:
                    break
                x, y, z = gyr[k, 0], gyr[k, 1], gyr[k, 2]
                if x * x + y * y + z * z < inf:  # else that of the sample after is held
                    wx = x - out[k, BG - STATUS]
                    wy = y - out[k, BG - STATUS + 1]
                    wz = z - out[k, BG - STATUS + 2]
                dt = t[k - 1] - t[k]
                e0, e1, e2, e3 = exp(dt * wx, dt * wy, dt * wz)
                q0, q1, q2, q3 = out[k, j], out[k, j + 1], out[k, j + 2], out[k, j + 3]
                q0, q1, q2, q3 = mul(q0, q1, q2, q3, e0, e1, e2, e3)
                q0, q1, q2, q3 = normalize(q0, q1, q2, q3)
                k -= 1
                out[k, j], out[k, j + 1], out[k, j + 2], out[k, j + 3] = q0, q1, q2, q3
                for i in range(STD_ATT - STATUS, STD_BG - STATUS + 3):
                    out[k, i] = out[k + 1, i]
                for i in range(BG - STATUS, BG - STATUS + 3):
                    out[k, i] = out[k + 1, i]
        first = ends[n]
