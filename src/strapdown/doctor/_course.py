"""Whether the gyroscope explains how the course over ground turns.

Between two fixes the course changes by the rate about the vertical, ``-(Q omega) . u`` with u
the direction of the specific force, averaged until it is the vertical: right-handed about down.
The course knows which way is up, so this sees the accelerometer's sign, which turning alone
does not: ``-f`` asks for ``-Q``.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.doctor._axes48 import SIGNED
from strapdown.doctor._turning import by_block
from strapdown.recording import Gnss

_SLOWEST_M_S: Final = 3.0  # below, the course is noise
_LEVEL_S: Final = 10.0  # means of the specific force over this time are the vertical
_LONGEST_S: Final = 1.5  # between two fixes
_NOISE_RAD: Final = 0.01  # of a course from a velocity of 0.1 m/s at 10 m/s
_FEWEST: Final = 30


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """Changes of course and of the box, from fix to fix.

    Attributes
    ----------
    seconds : ndarray, shape (m,)
        Time of the later fix, from the start of the samples.
    course : ndarray, shape (m,)
        Change of course [rad].
    products : ndarray, shape (m, 9)
        ``-u_i theta_j`` with the turning theta of the box in the gyroscope's unit.
    """

    seconds: FloatArray
    course: FloatArray
    products: FloatArray


def turns_of(
    gnss: Gnss, t: FloatArray, gyr: FloatArray, acc: FloatArray, lag: float = 0.0
) -> Turns | None:
    """Return the changes between fixes at which the course is known, or None for too few.

    Parameters
    ----------
    gnss : Gnss
        With velocities.
    t, gyr, acc : ndarray
        Samples, the gyroscope's bias taken off.
    lag : float
        Seconds by which the fixes are late.
    """
    if gnss.v_n is None or len(gnss.t) < _FEWEST or len(t) < 2:
        return None
    at = gnss.t - lag
    speed = np.hypot(gnss.v_n[:, 0], gnss.v_n[:, 1])
    known = (speed > _SLOWEST_M_S) & (at > t[0]) & (at < t[-1])
    pairs = known[1:] & known[:-1] & (np.diff(at) < _LONGEST_S)
    if pairs.sum() < _FEWEST:
        return None
    course = np.arctan2(gnss.v_n[:, 1], gnss.v_n[:, 0])
    change = np.diff(course)[pairs]
    change = (change + np.pi) % (2.0 * np.pi) - np.pi
    dt = np.diff(t, prepend=t[0])[:, None]
    angle = np.cumsum(gyr * dt, axis=0)
    force = np.cumsum(acc * dt, axis=0)
    later, earlier = at[1:][pairs], at[:-1][pairs]
    theta = _at(later, t, angle) - _at(earlier, t, angle)
    up = _at(later + 0.5 * _LEVEL_S, t, force) - _at(earlier - 0.5 * _LEVEL_S, t, force)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
    products = -(up[:, :, None] * theta[:, None, :]).reshape(-1, 9)
    return Turns(later - t[0], change, products)


def course_loss(turns: Turns, scales: list[float], duration: float) -> FloatArray:
    """Return how badly each scale and signed permutation explains the course.

    Parameters
    ----------
    turns : Turns
        Changes of course.
    scales : list of float
        Factors for the rate.
    duration : float
        Of the samples [s].

    Returns
    -------
    ndarray, shape (blocks, scales, 48)
        Negative log likelihoods, in the blocks of `turning`.
    """
    explained = turns.products @ SIGNED.reshape(48, 9).T
    residual = np.abs(
        turns.course[:, None, None] - np.asarray(scales)[:, None] * explained[:, None, :]
    )
    typical = max(float(np.median(residual, axis=0).min()), _NOISE_RAD)
    return by_block(np.log1p((residual / typical) ** 2), turns.seconds, duration)


def _at(times: FloatArray, t: FloatArray, sums: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(times, t, sums[:, j]) for j in range(sums.shape[1])])
