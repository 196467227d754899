"""Whether the gyroscope explains how a field turns: all 48 signed permutations are asked.

Gravity and the Earth's field stand still while the box turns: with R the box's attitude, found
by adding up ``omega``, the means of ``R f`` over neighbouring windows are equal, up to the
change of velocity between them, which a window of some seconds makes small. Hypothesis Q says
that ``Q omega`` is the rate in the axes of `f`. For a rotation P, adding up ``P omega`` gives
``P R P'``, and for ``-P`` it gives ``P R_- P'`` with R_- from ``-omega``: two sums serve all 48.
``-f`` turns as `f` does, so this says nothing about the sign of the field itself.

The gyroscope's unit is a further unknown: each hypothesis is asked at several scales.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
_CLEAR: Final = 0.6
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
    still : ndarray, shape (blocks,)
        The same of a box that does not turn.
    residual : float
        Typical residual of the best hypothesis, relative to the field, in the windows that leave
        least: fast motion accelerates, and long windows average it.
    clear : bool
        Whether the best hypothesis leaves much less than a box that does not turn.
    """

    loss: FloatArray
    still: FloatArray
    residual: float
    clear: bool

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


class Turning:
    """How the fields of a log turn, seen by its gyroscope; each scale is computed once.

    Parameters
    ----------
    gyr : ndarray, shape (n, 3)
        Angular rate, evenly spaced, its bias taken off, in the recorded unit.
    fields : mapping of str to ndarray, shape (n, 3)
        Specific force and magnetic field at the same times, in any unit.
    dt : float
        Interval [s].
    bad : ndarray of bool, shape (n,)
        Where a sample cannot be used.
    drift : float
        How far off the rates may be, the rest of a bias [rad/s].
    velocity : ndarray, shape (n, 3), optional
        Velocity over ground [m/s], NaN where it is not known. How it changes says which
        changes of the specific force are no turning.
    """

    def __init__(
        self,
        gyr: FloatArray,
        fields: Mapping[str, FloatArray],
        dt: float,
        bad: BoolArray,
        drift: float = 0.0,
        velocity: FloatArray | None = None,
    ) -> None:
        self._gyr, self._dt, self._drift = gyr, dt, drift
        self._windows = {
            (name, span): windows
            for name, field in fields.items()
            for span in SPANS_S
            if (windows := _windows_of(field, dt, bad, span, velocity if name == "acc" else None))
            is not None
        }
        self._residuals: dict[float, dict[tuple[str, float], FloatArray]] = {}

    def evidence(self, field: str, scales: Sequence[float]) -> Evidence | None:
        """Return how well each hypothesis explains the turning of a field.

        Parameters
        ----------
        field : str
            Which one.
        scales : sequence of float
            Factors for the rate that are asked.

        Returns
        -------
        Evidence or None
            Of the windows that decide best; None if there are too few.
        """
        found: Evidence | None = None
        weight = -1.0
        for span in SPANS_S:
            windows = self._windows.get((field, span))
            if windows is None:
                continue
            residual = np.stack([self._at(scale)[field, span] for scale in scales], axis=1)
            typical = max(float(np.median(residual, axis=0).min()), _LEAST)
            other = np.hypot(windows.moved, 0.5 * span * self._drift)
            allowed = np.hypot(typical, other)[:, None, None]
            loss: FloatArray = np.log1p((residual / allowed) ** 2)
            seconds = np.asarray(np.flatnonzero(windows.pairs) * (0.5 * span), dtype=np.float64)
            unturned = self._at(0.0)[field, span][:, :1]
            still = np.log1p((unturned / allowed[:, 0]) ** 2)
            blocks = by_block(
                np.concatenate((loss.reshape(len(loss), -1), still), axis=1),
                seconds,
                len(self._gyr) * self._dt,
            )
            asked = blocks[:, :-1].reshape(len(blocks), *loss.shape[1:])
            least = typical if found is None else min(typical, found.residual)
            clear = typical < _CLEAR * float(np.median(unturned))
            evidence = Evidence(asked, blocks[:, -1], least, clear)
            # Windows that leave much are those in which acceleration passes for turning.
            if found is None or evidence.lead() / typical > weight:
                found, weight = evidence, evidence.lead() / typical
            elif least < found.residual:
                found = replace(found, residual=least)
        return found

    def _at(self, scale: float) -> dict[tuple[str, float], FloatArray]:
        """Return the residuals of all fields and windows at one scale, shape (pairs, 48)."""
        if scale not in self._residuals:
            dtheta = scale * self._dt * self._gyr
            out = {key: np.empty((int(w.pairs.sum()), 48)) for key, w in self._windows.items()}
            for sign in (1.0, -1.0):
                R = _attitudes(sign * dtheta)
                chosen = sign == DETERMINANTS
                P = sign * SIGNED[chosen]
                columns = P.transpose(0, 2, 1).reshape(-1, 9).T  # R_ij (P' f)_j
                for key, windows in self._windows.items():
                    turned = windows.changes(R) @ columns
                    out[key][:, chosen] = np.sqrt((turned * turned).sum(axis=1))
            self._residuals[scale] = out
        return self._residuals[scale]


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """A field in neighbouring windows, weighted, and the pairs that can be used."""

    weighted: FloatArray
    pairs: BoolArray
    moved: FloatArray  # (pairs,), change of acceleration that is known, relative to the field

    def changes(self, R: FloatArray) -> FloatArray:
        """Return the changes of the means of R_ij f_l from window to window, (pairs, 3, 9)."""
        count, h, _ = self.weighted.shape
        rows = R[: count * h].reshape(count, h, 9).transpose(0, 2, 1)
        mean = (rows @ self.weighted).reshape(count, 3, 9)
        return np.asarray(np.diff(mean, axis=0)[self.pairs])


def _windows_of(
    field: FloatArray, dt: float, bad: BoolArray, span: float, velocity: FloatArray | None
) -> _Windows | None:
    """Return the field's windows of half a span; None if there are too few of them."""
    h = round(0.5 * span / dt)
    count = len(field) // h if h >= 4 else 0
    if count * h * dt < 3.0 * _BLOCK_S or bad.all():
        return None
    size = float(np.median(np.linalg.norm(field[~bad], axis=1)))
    sound = np.logical_not(np.any(bad[: count * h].reshape(count, h), axis=1))
    pairs = np.asarray(sound[1:] & sound[:-1])
    if size == 0.0 or not pairs.any():
        return None
    window = np.sin(np.pi * (np.arange(h) + 0.5) / h) ** 2
    window /= window.sum() * size
    moved = np.zeros(count - 1)
    if velocity is not None:
        rate = np.gradient(velocity[: count * h], dt, axis=0).reshape(count, h, 3)
        moved = np.linalg.norm(np.diff(np.einsum("kij,i->kj", rate, window), axis=0), axis=1)
        known = np.isfinite(moved)
        if (pairs & known).any():  # else no fix tells of accelerations at all
            pairs &= known
        moved = np.nan_to_num(moved)
    return _Windows(
        field[: count * h].reshape(count, h, 3) * window[:, None], pairs, np.asarray(moved[pairs])
    )


def by_block(loss: FloatArray, seconds: FloatArray, duration: float) -> FloatArray:
    """Return losses summed over each block of time; `seconds` from the start do not decrease.

    What is later than the duration, as where samples were lost, falls into the last block.
    """
    last = int(duration // _BLOCK_S)
    block = np.minimum((seconds // _BLOCK_S).astype(np.int64), last)
    out = np.zeros((last + 1, *loss.shape[1:]))
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
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[0] = aw * bw - ax * bx - ay * by - az * bz
    out[1] = aw * bx + ax * bw + ay * bz - az * by
    out[2] = aw * by - ax * bz + ay * bw + az * bx
    out[3] = aw * bz + ax * by - ay * bx + az * bw
    return out
