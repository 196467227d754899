"""What an alignment returns, and the stretch of samples and fixes that it looks at."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import DataGap, InputError
from strapdown.motion import RestTest, rest_mask, segments
from strapdown.navigation.mechanisation import Start
from strapdown.recording import Recording
from strapdown.rotation import rpy_from_quat


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alignment:
    """Attitude at one time, and how sure it is.

    Attributes
    ----------
    t : float
        Time of the attitude [s].
    q_nb : ndarray, shape (4,)
        Attitude, body to NED.
    covariance_n : ndarray, shape (3, 3)
        Of the attitude error ``phi_n`` about north, east, down [rad^2].
    gyr_bias : ndarray, shape (3,), or None
        Mean rate at rest [rad/s]; less that of the Earth where `method` knows it. What it has
        along east is then in the heading.
    heading_reference : {'true', 'magnetic', 'arbitrary'}
        What heading is measured from.
    method : str
        Name of the function.
    span : tuple of float
        First and last time of the samples [s].
    """

    t: float
    q_nb: FloatArray
    covariance_n: FloatArray
    gyr_bias: FloatArray | None = None
    heading_reference: str = "arbitrary"
    method: str
    span: tuple[float, float]

    @property
    def std_n(self) -> FloatArray:
        """Standard deviations about north, east, down [rad]."""
        return np.asarray(np.sqrt(np.diag(self.covariance_n)))

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw [rad]."""
        return rpy_from_quat(self.q_nb)

    def start(self, lla: ArrayLike, v_n: ArrayLike = (0.0, 0.0, 0.0)) -> Start:
        """Return the start of a mechanisation with this attitude.

        Parameters
        ----------
        lla : array_like, shape (3,)
            Latitude, longitude [rad], height [m].
        v_n : array_like, shape (3,)
            Velocity over ground [m/s].

        Returns
        -------
        Start
        """
        return Start(t=self.t, lla=lla, v_n=v_n, q_nb=self.q_nb)


class Stretch(NamedTuple):
    """Inertial samples of a span."""

    t: FloatArray
    gyr: FloatArray
    acc: FloatArray

    @property
    def span(self) -> tuple[float, float]:
        """First and last time [s]."""
        return float(self.t[0]), float(self.t[-1])


def _ends(span: object) -> tuple[float, float]:
    """Return first and last time of a span, checked [s]."""
    start, stop = _checks.as_vector("span", span, 2)  # type: ignore[arg-type]
    if not start < stop:
        raise ValueError(f"`span` must end after it starts, got {start:g} to {stop:g} s.")
    return float(start), float(stop)


def stretch(rec: Recording, span: tuple[float, float] | None) -> Stretch:
    """Return the valid inertial samples of a span, the whole recording by default."""
    _checks.recording("rec", rec)
    imu = rec.need("imu")
    if span is not None:
        start, stop = _ends(span)
        imu = imu.rows((imu.t >= start) & (imu.t <= stop))
    imu = imu.rows(~imu.nan_rows())
    if len(imu) < 3:
        where = "" if span is None else f" from {span[0]:g} to {span[1]:g} s"
        raise DataGap(f"stream imu must hold at least three valid samples{where}, got {len(imu)}.")
    return Stretch(imu.t, imu.gyr, imu.acc)


class Fixes(NamedTuple):
    """Fixes of a span, all with position and velocity."""

    t: FloatArray
    lla: FloatArray
    v_n: FloatArray
    std: FloatArray  # of each component of velocity [m/s]


def fixes(rec: Recording, span: tuple[float, float] | None, velocity_std: float) -> Fixes:
    """Return the fixes with velocity of a span."""
    _checks.recording("rec", rec)
    imu = rec.need("imu").t
    gnss = rec.need("gnss")
    default = _checks.positive("velocity_std", velocity_std)
    first, last = (-math.inf, math.inf) if span is None else _ends(span)
    if len(imu):
        first, last = max(first, float(imu[0])), min(last, float(imu[-1]))
    rows = (gnss.t >= first) & (gnss.t <= last) & np.isfinite(gnss.lla).all(axis=1)
    if gnss.v_n is None:
        raise InputError(
            "stream gnss must have velocities to align in motion, it has positions only; "
            "the filter 'loosely-coupled' aligns with positions as well."
        )
    rows &= np.isfinite(gnss.v_n).all(axis=1)
    if np.count_nonzero(rows) < 2:
        raise InputError(
            f"the span must hold at least two fixes with velocity, got {np.count_nonzero(rows)}."
        )
    v_n = gnss.v_n[rows]
    std = np.full(v_n.shape, default)
    if gnss.std_velocity_n is not None:
        stated = gnss.std_velocity_n[rows]
        std = np.where(stated > 0.0, stated, std)
    return Fixes(gnss.t[rows], gnss.lla[rows], v_n, std)


def at_rest(rec: Recording, span: tuple[float, float] | None, test: RestTest) -> Stretch:
    """Return the samples of a span in which the box rests; refuse one in which it moves."""
    _checks.instance("test", test, RestTest, "`strapdown.motion.DEFAULT` is one")
    samples = stretch(rec, span)
    first, last = samples.span
    if last - first < test.window:
        raise ValueError(
            f"`span` must be at least one window of {test.window:g} s long to tell rest from "
            f"motion, got {last - first:.3g} s."
        )
    imu = rec.need("imu")
    mask = rest_mask(imu.t, imu.gyr, imu.acc, test)  # the noise floor is that of the whole log
    known = (imu.t >= first) & (imu.t <= last)
    moving = segments(imu.t, known & ~mask & ~imu.nan_rows())
    if not moving:
        return samples
    still = [s for s in segments(imu.t, known & mask) if s.duration >= test.min_duration]
    best = max(still, key=lambda s: s.duration, default=None)
    advice = (
        "it never rests there: align with `velocity_matching` or `course`"
        if best is None
        else f"it rests from {best.t_start:.2f} to {best.t_stop:.2f} s: give that as `span`"
    )
    raise InputError(
        f"the box must rest from {first:.2f} to {last:.2f} s to be aligned there, it moves from "
        f"{moving[0].t_start:.2f} to {moving[0].t_stop:.2f} s; {advice}."
    )


def mean_with_std(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of each axis and the standard deviation that white noise gives it."""
    deviation = np.std(samples, axis=0, ddof=1) / np.sqrt(len(samples))
    return np.asarray(samples.mean(axis=0)), np.asarray(deviation)
