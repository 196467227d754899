"""Whether the gyroscope explains how a field turns: all 48 signed permutations are asked.

Gravity and the Earth's field stand still while the box turns: with R the box's attitude, found
by adding up ``omega``, the means of ``R f`` over neighbouring windows are equal, up to the
change of velocity between them, which a window of some seconds makes small. Hypothesis Q says
that ``Q omega`` is the rate in the axes of `f`. For a rotation P, adding up ``P omega`` gives
``P R P'``, and for ``-P`` it gives ``P R_- P'`` with R_- from ``-omega``: two sums serve all 48.
``-f`` turns as `f` does, so this says nothing about the sign of the field itself.

The gyroscope's unit is a further unknown: each hypothesis is asked at each of `scales`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.doctor._axes48 import DETERMINANTS, SIGNED

STEP_S: Final = 0.01  # samples are averaged to about this interval
SPANS_S: Final = (1.0, 2.0, 4.0, 8.0)  # twice the window; slow motion needs long ones
_BLOCK_S: Final = 8.0  # stretch of time whose evidence counts as one, independent of the next
_DRAWS: Final = 400
# What drift of the gyroscope's bias leaves at rest, relative to the field: 0.03 deg/s for 8 s.
_LEAST: Final = 0.004
# A difference of log likelihoods that is taken for a decision: odds of 3000 to 1.
DECIDED: Final = 8.0
SURE: Final = 0.99


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """How well each hypothesis explains the data, by block of time.

    Attributes
    ----------
    loss : ndarray, shape (blocks, scales, 48)
        Negative log likelihood of ``Q omega`` as the rate in the field's axes.
    residual : float
        Typical residual of the best hypothesis, relative to the field.
    """

    loss: FloatArray
    residual: float

    def best(self) -> tuple[int, int]:
        """Return the scale and the hypothesis of least loss."""
        total = self.loss.sum(axis=0)
        k, q = np.unravel_index(int(total.argmin()), total.shape)
        return int(k), int(q)

    def lead(self) -> float:
        """Return by how much the best hypothesis leads the second at the same scale."""
        k, _ = self.best()
        first, second = np.partition(self.loss[:, k].sum(axis=0), 1)[:2]
        return float(second - first)


def averaged(t: FloatArray, *fields: FloatArray) -> tuple[FloatArray, ...]:
    """Return times and samples as means of about `STEP_S`, incomplete ones left out."""
    dt = float(np.median(np.diff(t)))
    k = max(round(STEP_S / dt), 1)
    n = len(t) // k * k
    if k == 1:
        return (t, *fields)
    return (
        t[:n].reshape(-1, k).mean(axis=1),
        *(v[:n].reshape(-1, k, v.shape[1]).mean(axis=1) for v in fields),
    )


def rest_bias(gyr: FloatArray, dt: float) -> FloatArray:
    """Return the rate on which the quietest seconds agree, else zero, shape (3,).

    At rest they do; in a slow, smooth motion the quietest are those of the largest rates.
    """
    m = max(round(1.0 / dt), 1)
    blocks = gyr[: len(gyr) // m * m].reshape(-1, m, 3)
    if not len(blocks):
        return np.zeros(3)
    noise = np.linalg.norm(blocks.std(axis=1), axis=1)
    quiet = noise <= 2.0 * np.quantile(noise, 0.05)
    means = blocks.mean(axis=1)[quiet]
    bias = np.median(means, axis=0)
    spread = float(np.median(np.linalg.norm(means - bias, axis=1)))
    return np.asarray(bias if spread < 0.6 * np.linalg.norm(bias) else np.zeros(3))


def turning(
    gyr: FloatArray,
    field: FloatArray,
    dt: float,
    bad: BoolArray,
    scales: Sequence[float],
    spans: Sequence[float] = SPANS_S,
) -> Evidence | None:
    """Return how well each of the 48 hypotheses explains the turning of a field.

    Parameters
    ----------
    gyr : ndarray, shape (n, 3)
        Angular rate, evenly spaced, its bias taken off, in the recorded unit.
    field : ndarray, shape (n, 3)
        Specific force or magnetic field at the same times, in any unit.
    dt : float
        Interval [s].
    bad : ndarray of bool, shape (n,)
        Where a sample cannot be used.
    scales : sequence of float
        Factors for the rate that are asked.
    spans : sequence of float
        Lengths of two neighbouring windows [s]; the one that decides best is returned.

    Returns
    -------
    Evidence or None
        None if there are fewer than three blocks of time.
    """
    size = float(np.median(np.linalg.norm(field[~bad], axis=1))) if (~bad).any() else 0.0
    if size == 0.0:
        return None
    unit_field = field / size
    turns = [[_attitudes(sign * scale * dt * gyr) for sign in (1.0, -1.0)] for scale in scales]
    found: Evidence | None = None
    for span in spans:
        evidence = _at_span(turns, unit_field, dt, bad, span)
        if evidence is not None and (found is None or evidence.lead() > found.lead()):
            found = evidence
    return found


def _at_span(
    turns: list[list[FloatArray]], field: FloatArray, dt: float, bad: BoolArray, span: float
) -> Evidence | None:
    """Return the evidence of windows of one length."""
    h = round(0.5 * span / dt)
    count = len(field) // h if h >= 4 else 0
    if count * h * dt < 3.0 * _BLOCK_S:
        return None
    window = np.sin(np.pi * (np.arange(h) + 0.5) / h) ** 2
    weighted = (field[: count * h].reshape(count, h, 3)) * (window / window.sum())[:, None]
    sound = np.logical_not(np.any(bad[: count * h].reshape(count, h), axis=1))
    pairs = sound[1:] & sound[:-1]
    if not pairs.any():
        return None
    residual = np.empty((int(pairs.sum()), len(turns), len(SIGNED)))
    for k, both in enumerate(turns):
        for sign, R in zip((1.0, -1.0), both, strict=True):
            rows = R[: count * h].reshape(count, h, 9).transpose(0, 2, 1)
            mean = (rows @ weighted).reshape(count, 3, 9)  # of R_ij f_l
            change = np.diff(mean, axis=0)[pairs]
            chosen = sign == DETERMINANTS
            P = sign * SIGNED[chosen]
            turned = change @ P.transpose(0, 2, 1).reshape(-1, 9).T  # R_ij (P' f)_j
            residual[:, k, chosen] = np.sqrt((turned * turned).sum(axis=1))
    typical = max(float(np.median(residual, axis=0).min()), _LEAST)
    loss: FloatArray = np.log1p((residual / typical) ** 2)
    seconds = np.flatnonzero(pairs) * h * dt
    return Evidence(by_block(loss, np.asarray(seconds), len(field) * dt), typical)


def by_block(loss: FloatArray, seconds: FloatArray, duration: float) -> FloatArray:
    """Return losses summed over each block of time; `seconds` from the start do not decrease."""
    block = (seconds // _BLOCK_S).astype(np.int64)
    out = np.zeros((int(duration // _BLOCK_S) + 1, *loss.shape[1:]))
    first = np.flatnonzero(np.diff(block, prepend=-1))
    out[block[first]] = np.add.reduceat(loss, first, axis=0)
    return out


def survivors(loss: FloatArray) -> tuple[IntArray, float]:
    """Return the hypotheses that the data do not exclude, best first, and the best's confidence.

    Parameters
    ----------
    loss : ndarray, shape (blocks, hypotheses)
        Negative log likelihoods.

    Returns
    -------
    indices : ndarray of int
        Those whose loss is within `DECIDED` of the best, or that win in one of a hundred
        resamplings of the blocks.
    confidence : float
        Share of resamplings that the best wins.
    """
    total = loss.sum(axis=0)
    order = np.argsort(total, kind="stable")
    blocks = len(loss)
    draws = np.random.default_rng(0).multinomial(blocks, np.full(blocks, 1.0 / blocks), _DRAWS)
    wins = np.bincount((draws @ loss).argmin(axis=1), minlength=len(total)) / _DRAWS
    alive = (total - total[order[0]] < DECIDED) | (wins > 1.0 - SURE)
    return order[alive[order]], float(wins[order[0]])


def _attitudes(dtheta: FloatArray) -> FloatArray:
    """Return the products of rotations by `dtheta` as matrices, rows first, shape (n, 9).

    The chain is cut into about sqrt(n) pieces that are multiplied side by side.
    """
    n = len(dtheta)
    length = int(np.sqrt(n)) + 1
    pieces = -(-n // length)
    angle = np.sqrt((dtheta * dtheta).sum(axis=1))
    q = np.zeros((4, pieces * length))
    q[0, :n] = np.cos(0.5 * angle)
    q[0, n:] = 1.0
    q[1:, :n] = dtheta.T * (0.5 * np.sinc(angle / (2.0 * np.pi)))
    q = np.ascontiguousarray(q.reshape(4, pieces, length).transpose(2, 0, 1))
    for i in range(1, length):
        q[i] = _product(q[i - 1], q[i])
    start = np.empty((4, pieces))
    head = np.array([1.0, 0.0, 0.0, 0.0])
    for i in range(pieces):
        start[:, i] = head
        head = _product(head, q[-1, :, i])
        head /= np.sqrt((head * head).sum())
    q = _product(start[:, None, :], q.transpose(1, 0, 2))
    w, x, y, z = q.transpose(0, 2, 1).reshape(4, -1)[:, :n]
    R = np.empty((n, 9))
    R[:, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[:, 1] = 2.0 * (x * y - w * z)
    R[:, 2] = 2.0 * (x * z + w * y)
    R[:, 3] = 2.0 * (x * y + w * z)
    R[:, 4] = 1.0 - 2.0 * (x * x + z * z)
    R[:, 5] = 2.0 * (y * z - w * x)
    R[:, 6] = 2.0 * (x * z - w * y)
    R[:, 7] = 2.0 * (y * z + w * x)
    R[:, 8] = 1.0 - 2.0 * (x * x + y * y)
    return R


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the Hamilton products of quaternions whose components come first."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        )
    )
