"""Alignment in motion: by the direction of travel, or by accelerations that both sides saw."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.determination import svd, triad
from strapdown.earth import earth_rate_n, gravity_n, transport_rate_n
from strapdown.errors import InputError
from strapdown.navigation.alignment.result import Alignment, Stretch, stretch
from strapdown.recording import Recording
from strapdown.rotation import (
    dcm_from_quat,
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    rotate,
    wrap_pi,
)
from strapdown.units import DEG

Span = tuple[float, float] | None
_LEAST_INTERVAL = 0.4  # between fixes: velocities of nearer ones share their error [s]
_LEAST_PAIRS = 3
_WORST_FIT = 25.0  # mean square residual, of what is expected, above which nothing is believed


class _Fixes(NamedTuple):
    t: FloatArray
    lla: FloatArray
    v_n: FloatArray
    std: FloatArray  # of each component of velocity [m/s]


def course(
    rec: Recording,
    *,
    span: tuple[float, float],
    q_vb: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    min_speed: float = 3.0,
    max_turn: float = 3.0 * DEG,
    sideslip_std: float = 0.5 * DEG,
    velocity_std: float = 0.1,
    acc_bias_std: float = 0.02,
    gyr_bias: ArrayLike = (0.0, 0.0, 0.0),
) -> Alignment:
    """Align on a straight stretch of a drive: the vehicle points where it goes.

    Parameters
    ----------
    rec : Recording
        With ``imu`` and ``gnss`` with velocities.
    span : tuple of float
        From when to when the vehicle goes straight ahead [s]; one to some seconds.
    q_vb : array_like, shape (4,)
        Mount: body to vehicle forward-right-down. Where it is not known, `velocity_matching`
        does without.
    min_speed : float
        Least speed [m/s]; below, the direction of travel is noise.
    max_turn : float
        Greatest turn within the span [rad].
    sideslip_std : float
        Sigma of the angle between the vehicle's axis and its way [rad].
    velocity_std : float
        Sigma of the fixes' velocity where the receiver states none [m/s].
    acc_bias_std : float
        Sigma of the accelerometer's bias [m/s^2].
    gyr_bias : array_like, shape (3,)
        Known bias of the gyroscope [rad/s].

    Returns
    -------
    Alignment
        At the middle of the span.

    Raises
    ------
    InputError
        If the vehicle is too slow, turns, or there are fewer than two fixes.

    Notes
    -----
    Offline. The mean acceleration of the span, from its first and last velocity, is taken from the
    specific force before that gives level. A vehicle that backs points the other way.
    """
    fixes = _fixes(rec, span, velocity_std)
    samples = stretch(rec, (float(fixes.t[0]), float(fixes.t[-1])))
    duration = float(fixes.t[-1] - fixes.t[0])
    speed = np.hypot(fixes.v_n[:, 0], fixes.v_n[:, 1])
    if not speed.min() >= _checks.positive("min_speed", min_speed):
        slow = int(np.argmin(speed))
        raise InputError(
            f"the vehicle must go at least {min_speed:g} m/s for its course to be its heading, it "
            f"goes {speed[slow]:.2f} m/s at {fixes.t[slow]:g} s; take a faster stretch."
        )
    bias = _checks.as_vector("gyr_bias", gyr_bias)
    headings = np.arctan2(fixes.v_n[:, 1], fixes.v_n[:, 0])
    turn = max(
        float(np.abs(wrap_pi(headings - headings[0])).max()),
        float(np.linalg.norm((samples.gyr.mean(axis=0) - bias) * duration)),
    )
    if not turn <= _checks.positive("max_turn", max_turn):
        raise InputError(
            f"the vehicle must go straight ahead from {fixes.t[0]:g} to {fixes.t[-1]:g} s, it "
            f"turns by {turn / DEG:.2g} deg; take a straighter or shorter span, or "
            "`velocity_matching`, which needs turns."
        )
    mean_v = fixes.v_n.mean(axis=0)
    lla = fixes.lla[len(fixes.t) // 2]
    acceleration = (fixes.v_n[-1] - fixes.v_n[0]) / duration
    carried = np.cross(2.0 * earth_rate_n(lla[0]) + transport_rate_n(lla, mean_v), mean_v)
    force_n = acceleration + carried - gravity_n(lla)
    mount = _checks.as_quats("q_vb", _checks.as_vector("q_vb", q_vb, 4))
    forward_b = rotate(quat_conj(mount), [1.0, 0.0, 0.0])
    ahead_n = mean_v / np.linalg.norm(mean_v)
    q_nb = triad([samples.acc.mean(axis=0), forward_b], [force_n, ahead_n]).q_nb
    level_std = math.hypot(acc_bias_std, math.sqrt(2.0) * float(fixes.std.mean()) / duration)
    tilt = level_std / float(np.linalg.norm(force_n))
    yaw = math.hypot(
        _checks.positive("sideslip_std", sideslip_std, allow_zero=True),
        float(fixes.std[:, :2].mean()) / math.sqrt(len(fixes.t)) / float(speed.mean()),
    )
    return Alignment(
        t=float(0.5 * (fixes.t[0] + fixes.t[-1])),
        q_nb=q_nb,
        covariance_n=np.diag([tilt**2, tilt**2, yaw**2]),
        heading_reference="true",
        method="course",
        span=samples.span,
    )


def velocity_matching(
    rec: Recording,
    *,
    span: Span = None,
    velocity_std: float = 0.1,
    acc_bias_std: float = 0.05,
    gyr_bias: ArrayLike = (0.0, 0.0, 0.0),
    max_heading_std: float = 10.0 * DEG,
) -> Alignment:
    """Align in motion, in any mount: the rotation that makes accelerations fit those of fixes.

    Between two fixes the specific force, summed in the axes that the box had at the start, has to
    become the change of velocity less gravity; the best rotation of the one set of vectors onto
    the other (Wahba's problem) is the attitude. Gravity gives level, every change of speed or
    direction gives heading.

    Parameters
    ----------
    rec : Recording
        With ``imu`` and ``gnss`` with velocities.
    span : tuple of float, optional
        From when to when [s]; 10 to 60 s with some acceleration in it. The whole recording by
        default.
    velocity_std : float
        Sigma of the fixes' velocity where the receiver states none [m/s].
    acc_bias_std : float
        Sigma of the accelerometer's bias [m/s^2].
    gyr_bias : array_like, shape (3,)
        Known bias of the gyroscope, such as its mean at rest [rad/s]. What is left of it turns
        the result by itself times half of the span.
    max_heading_std : float
        Greatest heading sigma that is taken [rad].

    Returns
    -------
    Alignment
        At the last fix of the span.

    Raises
    ------
    InputError
        If there are fewer than four fixes, the motion leaves the heading open, or the vectors do
        not fit each other.

    Notes
    -----
    Offline. The covariance holds the fixes' noise and the accelerometer's bias, and grows with
    the residuals; it does not know of a gyro bias.

    References
    ----------
    .. [1] G. Wahba, "A least squares estimate of satellite attitude", SIAM Review 7(3), 1965.
    """
    fixes = _fixes(rec, span, velocity_std)
    samples = stretch(rec, (float(fixes.t[0]), float(fixes.t[-1])))
    turned, gained = _trace(samples, _checks.as_vector("gyr_bias", gyr_bias))
    spin = earth_rate_n(fixes.lla[0, 0])
    seen_b, seen_n, sigma = _vectors(fixes, samples, gained, spin, acc_bias_std)
    if len(seen_b) < _LEAST_PAIRS:
        raise InputError(
            f"the span must hold at least {_LEAST_PAIRS + 1} fixes {_LEAST_INTERVAL:g} s apart, "
            f"got {len(seen_b) + 1}."
        )
    heading_std = _heading_std(seen_n, sigma)
    if not heading_std <= max_heading_std:
        sideways = float(np.hypot(seen_n[:, 0], seen_n[:, 1]).max())
        raise InputError(
            f"the motion must show its heading to {max_heading_std / DEG:.3g} deg, it shows it to "
            f"{min(heading_std / DEG, 180.0):.3g} deg: its greatest change of velocity between "
            f"fixes is {sideways:.2g} m/s; take a span in which the vehicle pulls away, brakes or "
            "turns."
        )
    found = svd(seen_b, seen_n, sigma=sigma, min_angle=1e-6)
    fit = max(1.0, 2.0 * float(found.loss) / (2 * len(seen_b) - 3))
    if not fit < _WORST_FIT:
        raise InputError(
            "the accelerations of the box must fit those of the fixes, they are "
            f"{math.sqrt(fit):.1f} times as far off as their sigmas say; check axes (swapped, "
            "mirrored), units, and the time stamps of `imu` against `gnss`; take the bias out."
        )
    # from the axes at the start, which keep still in space, to those of the end
    elapsed = float(samples.t[-1] - fixes.t[0])
    q_nn0 = quat_from_rotvec(-spin * elapsed)
    q_nb = quat_mul(quat_mul(q_nn0, found.q_nb), turned[-1])
    C = dcm_from_quat(q_nn0)
    return Alignment(
        t=float(samples.t[-1]),
        q_nb=q_nb,
        covariance_n=fit * C @ found.covariance_n @ C.T,
        heading_reference="true",
        method="velocity_matching",
        span=samples.span,
    )


def _fixes(rec: Recording, span: Span, velocity_std: float) -> _Fixes:
    """Return the fixes with velocity of a span."""
    rec.need("imu")
    gnss = rec.need("gnss")
    default = _checks.positive("velocity_std", velocity_std)
    first, last = (-math.inf, math.inf) if span is None else span
    if not first < last:
        raise ValueError(f"`span` must end after it starts, got {first:g} to {last:g} s.")
    imu = rec.need("imu").t
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
    return _Fixes(gnss.t[rows], gnss.lla[rows], v_n, std)


def _trace(samples: Stretch, gyr_bias: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the turn since the first sample, and the velocity gained in its axes."""
    from strapdown.kernels import trace

    out = np.empty((len(samples.t), 7))
    gyr = np.ascontiguousarray(samples.gyr - gyr_bias)
    trace.run(samples.t, gyr, np.ascontiguousarray(samples.acc), out)
    return out[:, :4], out[:, 4:]


def _vectors(
    fixes: _Fixes, samples: Stretch, gained: FloatArray, spin: FloatArray, acc_bias_std: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the changes of velocity that box and fixes saw, and the sigma of their angle.

    Both are in axes that keep still in space: those of the box and of NED at the first fix.
    """
    rows = [0]
    for k in range(1, len(fixes.t)):
        if fixes.t[k] - fixes.t[rows[-1]] >= _LEAST_INTERVAL:
            rows.append(k)
    bias = _checks.positive("acc_bias_std", acc_bias_std, allow_zero=True)
    at = np.stack([np.interp(fixes.t, samples.t, gained[:, axis]) for axis in range(3)], axis=-1)
    seen_b, seen_n, sigma = [], [], []
    for i, k in pairwise(rows):
        dt = float(fixes.t[k] - fixes.t[i])
        middle = 0.5 * (fixes.v_n[i] + fixes.v_n[k])
        turn = 2.0 * earth_rate_n(fixes.lla[i, 0]) + transport_rate_n(fixes.lla[i], middle)
        change = (
            fixes.v_n[k] - fixes.v_n[i] + (np.cross(turn, middle) - gravity_n(fixes.lla[i])) * dt
        )
        since = 0.5 * float(fixes.t[i] + fixes.t[k]) - float(fixes.t[0])
        seen_n.append(rotate(quat_from_rotvec(spin * since), change))
        seen_b.append(at[k] - at[i])
        noise = float(np.sqrt(np.mean(fixes.std[i] ** 2 + fixes.std[k] ** 2)))
        sigma.append(math.hypot(noise, bias * dt) / float(np.linalg.norm(change)))
    return np.array(seen_b), np.array(seen_n), np.array(sigma)


def _heading_std(seen_n: FloatArray, sigma: FloatArray) -> float:
    """Return the heading sigma that the directions allow: their information about down."""
    unit = seen_n / np.linalg.norm(seen_n, axis=1)[:, np.newaxis]
    total = np.einsum("k,kij->ij", sigma**-2.0, np.eye(3) - unit[:, :, None] * unit[:, None, :])
    # what is left about down once the other two are known from the same vectors
    left = total[2, 2] - total[2, :2] @ np.linalg.solve(total[:2, :2], total[:2, 2])
    return float(1.0 / math.sqrt(left)) if left > 0.0 else math.inf
