"""Fixed-interval smoother of the GNSS/INS filter, without a single matrix inverse.

The backward pass carries the adjoint ``lam`` and its covariance ``Lam`` (modified Bryson-Frazier
[1]_): the smoothed error state is ``-P lam`` and its covariance ``P - P Lam P``. It needs what the
forward pass did, step by step, which the filter writes on a tape: transition matrices, scalar
measurements, and at each tick a mark with the covariance. A drive is cut into segments whose
tape fits; the forward pass keeps the filter's memory at each cut, and the backward pass runs
each segment again to fill the tape. Between two marks the correction is interpolated.

References
----------
.. [1] G. J. Bierman, "Fixed interval smoothing with discrete measurements", International
       Journal of Control 18(1), 1973.
"""

from math import sqrt

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.ins.covariance import apply
from strapdown.kernels.ins.layout import (
    DBA,
    DBG,
    DP,
    DT,
    DV,
    DX,
    GAIN,
    I_BP,
    I_MOUNT,
    MODE,
    MOVED,
    NEXT,
    PH,
    PHI,
    QVB,
    R_E,
    R_MARK,
    R_PREDICT,
    R_RESET,
    R_SCALAR,
    R_START,
    RECORD,
    TAPE,
    G,
    H,
    M,
    N,
)
from strapdown.kernels.ins.step import say, step, store, unseen
from strapdown.kernels.memory import (
    HEAD,
    STATUS,
    STD_ATT,
    STD_BA,
    STD_BG,
    STD_POS,
    STD_V,
    load_events,
)

NOMINAL = R_E + 1 - HEAD  # numbers of `x` that are kept of each sample of a segment
MARGIN = 5000  # more than one sample can write on the tape


@kernel
def mark(x: Vec, P: Mat, p: Vec, w: Vec, k: int) -> None:
    """Put a mark on the tape: the estimates of sample `k` have just been corrected."""
    n = int(p[N])
    at = int(w[NEXT])
    w[at] = float(R_MARK)
    w[at + 1] = float(k)
    for i in range(n):
        w[at + 2 + i] = w[MOVED + i]
        w[MOVED + i] = 0.0
        for j in range(n):
            w[at + 2 + n + i * n + j] = P[i, j]
    w[at + 2 + n + n * n] = 3.0 + n + n * n
    w[NEXT] = at + 3.0 + n + n * n


# fmt: off
@kernel
def forward(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, events: Mat, k: int, j: int,
    out: Mat, nominal: Mat,
) -> tuple[int, int]:
    """Run the filter from sample `k` and event `j` until the tape is full or the data end.

    Returns the sample and the event to go on with. `nominal`, if it has rows, receives the
    estimates of each sample of the segment; if not, `out` receives the filter's solution.
    """
    # fmt: on
    first = k
    w[RECORD] = 1.0 if nominal.shape[0] == 0 else 2.0
    w[NEXT] = float(TAPE)
    for i in range(int(p[N])):
        w[MOVED + i] = 0.0
    if x[MODE] > 0.0:
        mark(x, P, p, w, k - 1)
    while k < t.shape[0]:
        j = load_events(x, t[k], j, events)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        if nominal.shape[0] == 0:
            store(x, k, out)
        else:
            for i in range(NOMINAL):
                nominal[k - first, i] = x[HEAD + i]
        k += 1
        if x[MODE] > 0.0 and x[DT] == 0.0:
            mark(x, P, p, w, k - 1)
            if w[NEXT] > float(w.shape[0] - MARGIN):
                break
    w[RECORD] = 0.0
    return k, j


@kernel
def _back_over_prediction(p: Vec, w: Vec, at: int, lam: Vec, Lam: Mat) -> None:
    """``lam = Phi^T lam``, ``Lam = Phi^T Lam Phi``."""
    n = int(p[N])
    m = int(p[M])
    f = at + 5
    k = int(p[I_BP])
    if k > 0:
        ep, ev, cr, cv = w[at + 1], w[at + 2], w[at + 3], w[at + 4]
        for i in range(k, k + 3):
            lam[i + 3] = ep * lam[i + 3] + cr * lam[i]
            lam[i + 6] = ev * lam[i + 6] + cv * lam[i]
            lam[i] *= ep
            for j in range(n):
                Lam[i + 3, j] = ep * Lam[i + 3, j] + cr * Lam[i, j]
                Lam[i + 6, j] = ev * Lam[i + 6, j] + cv * Lam[i, j]
                Lam[i, j] *= ep
            for j in range(n):
                Lam[j, i + 3] = ep * Lam[j, i + 3] + cr * Lam[j, i]
                Lam[j, i + 6] = ev * Lam[j, i + 6] + cv * Lam[j, i]
                Lam[j, i] *= ep
    for j in range(m):
        w[GAIN + j] = 0.0
    for i in range(9):
        for j in range(m):
            w[GAIN + j] += w[f + i * m + j] * lam[i]
    for j in range(m):
        lam[j] += w[GAIN + j]
    # G = F^T Lam of the nine rows: m x n, built row after row and added with its transpose
    for j in range(m):
        g = G + j * n
        for k in range(n):
            w[g + k] = 0.0
        for i in range(9):
            a = w[f + i * m + j]
            if a != 0.0:
                for k in range(n):
                    w[g + k] += a * Lam[i, k]
    for j in range(m):
        for k in range(j, m):
            a = 0.0
            for i in range(9):
                a += w[G + j * n + i] * w[f + i * m + k]
            a += Lam[j, k] + (w[G + j * n + k] + w[G + k * n + j])
            Lam[j, k] = a
            Lam[k, j] = a
        for k in range(m, n):
            a = Lam[j, k] + w[G + j * n + k]
            Lam[j, k] = a
            Lam[k, j] = a


@kernel
def _back_over_scalar(p: Vec, w: Vec, at: int, lam: Vec, Lam: Mat) -> None:
    """``lam = (I - K h)^T lam - h d / s``, ``Lam`` accordingly."""
    n = int(p[N])
    s = w[at + 1]
    h = at + 3
    a = w[at + 2] / s
    for k in range(n):
        w[GAIN + k] = w[h + n + k] / s
        a += w[GAIN + k] * lam[k]
    for i in range(n):
        lam[i] -= w[h + i] * a
    for i in range(n):
        w[PH + i] = 0.0
    for k in range(n):  # row after row, which the compiler can do four at a time
        u = w[GAIN + k]
        for i in range(n):
            w[PH + i] += u * Lam[k, i]
    c = 1.0 / s
    for i in range(n):
        c += w[GAIN + i] * w[PH + i]
    for i in range(n):
        w[PH + i] -= 0.5 * c * w[h + i]
    for i in range(n):
        b = w[h + i]
        if b != 0.0:
            for k in range(n):
                Lam[i, k] -= b * w[PH + k]
            for k in range(n):
                Lam[k, i] -= b * w[PH + k]


@kernel
def _smoothed_here(p: Vec, w: Vec, at: int, lam: Vec, Lam: Mat) -> None:
    """Correction ``-P lam`` into ``w[DX]``, variances of the core states into ``w[H]``."""
    n = int(p[N])
    c = at + 2 + n
    for i in range(n):
        w[DX + i] = 0.0
    for k in range(n):
        a = lam[k]
        for i in range(n):
            w[DX + i] -= w[c + k * n + i] * a
    for i in range(15):
        for k in range(n):
            w[PH + k] = 0.0
        for j in range(n):
            a = w[c + i * n + j]
            for k in range(n):
                w[PH + k] += a * Lam[j, k]
        s = w[c + i * n + i]
        for k in range(n):
            s -= w[PH + k] * w[c + i * n + k]
        w[H + i] = max(s, 0.0)


# fmt: off
@kernel
def _write(
    x: Vec, p: Vec, w: Vec, d: Vec, t: Vec, k: int, last: int, first: int,
    nominal: Mat, out: Mat,
) -> None:
    """Write the smoothed rows from sample `k` (mark) up to the next mark `last`, its row excluded.

    The correction goes from ``w[DX]`` to `d`.
    """
    # fmt: on
    n = int(p[N])
    span = t[min(last, t.shape[0] - 1)] - t[max(k, 0)]
    for i in range(3):
        x[STD_ATT + i] = sqrt(w[H + PHI + i])
        x[STD_V + i] = sqrt(w[H + DV + i])
        x[STD_BG + i] = sqrt(w[H + DBG + i])
        x[STD_BA + i] = sqrt(w[H + DBA + i])
    for row in range(max(k, first), last):
        part = 0.0
        if span > 0.0:
            part = (t[row] - t[k]) / span
        for i in range(n):
            w[PH + i] = w[DX + i] + part * (d[i] - w[DX + i])
        for i in range(NOMINAL):
            x[HEAD + i] = nominal[row - first, i]
        k_mount = int(p[I_MOUNT])
        if k_mount > 0 and x[QVB] == 1.0:  # not found yet: no part of what comes later
            for i in range(k_mount, k_mount + 3):
                w[PH + i] = 0.0
        x[STATUS] = out[row, 0]
        apply(x, p, w, PH)
        say(x)
        for i in range(3):
            x[STD_POS + i] = sqrt(w[H + DP + i] + unseen(x, p, i))
        store(x, row, out)


# fmt: off
@kernel
def backward(
    x: Vec, p: Vec, w: Vec, lam: Vec, Lam: Mat, d: Vec,
    t: Vec, first: int, last: int, nominal: Mat, out: Mat,
) -> int:
    """Go back over the tape of the segment from sample `first`; smooth its rows of `out`.

    `last` is the sample of the mark that follows, whose correction before its updates is in
    `d`; -1 if there is none. Returns the sample of the first mark, for the segment before.
    `x` is scratch here.
    """
    # fmt: on
    n = int(p[N])
    at = int(w[NEXT])
    while at > TAPE:
        at -= int(w[at - 1])
        kind = int(w[at])
        if kind == R_PREDICT:
            _back_over_prediction(p, w, at, lam, Lam)
        elif kind == R_SCALAR:
            _back_over_scalar(p, w, at, lam, Lam)
        elif kind == R_MARK:
            k = int(w[at + 1])
            _smoothed_here(p, w, at, lam, Lam)
            if last <= k:  # nothing follows here: the correction stays as it is
                last = k + 1
                for i in range(n):
                    d[i] = w[DX + i]
            _write(x, p, w, d, t, k, last, first, nominal, out)
            for i in range(n):
                d[i] = w[DX + i] + w[at + 2 + i]
            last = k
        elif kind == R_RESET:
            k = int(w[at + 1])
            for i in range(k, k + int(w[at + 2])):
                lam[i] = 0.0
                for j in range(n):
                    Lam[i, j] = 0.0
                    Lam[j, i] = 0.0
        elif kind == R_START:
            last = -1
            for i in range(n):
                lam[i] = 0.0
                for j in range(n):
                    Lam[i, j] = 0.0
    return last
