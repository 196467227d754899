"""Alignment on a straight drive: the vehicle points where it goes."""

import math

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown.attitude.determination import triad
from strapdown.earth import earth_rate_n, gravity_n, transport_rate_n
from strapdown.errors import InputError
from strapdown.navigation.alignment.result import Alignment, fixes, stretch
from strapdown.recording import Recording
from strapdown.rotation import quat_conj, rotate, wrap_pi
from strapdown.units import DEG


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
        If the vehicle is too slow, turns, or there are fewer than two seen.

    Notes
    -----
    Offline. The mean acceleration of the span, from its first and last velocity, is taken from the
    specific force before that gives level. A vehicle that backs points the other way.
    """
    seen = fixes(rec, span, velocity_std)
    samples = stretch(rec, (float(seen.t[0]), float(seen.t[-1])))
    duration = float(seen.t[-1] - seen.t[0])
    speed = np.hypot(seen.v_n[:, 0], seen.v_n[:, 1])
    if not speed.min() >= _checks.positive("min_speed", min_speed):
        slow = int(np.argmin(speed))
        raise InputError(
            f"the vehicle must go at least {min_speed:g} m/s for its course to be its heading, it "
            f"goes {speed[slow]:.2f} m/s at {seen.t[slow]:g} s; take a faster stretch."
        )
    bias = _checks.as_vector("gyr_bias", gyr_bias)
    headings = np.arctan2(seen.v_n[:, 1], seen.v_n[:, 0])
    turn = max(
        float(np.abs(wrap_pi(headings - headings[0])).max()),
        float(np.linalg.norm((samples.gyr.mean(axis=0) - bias) * duration)),
    )
    if not turn <= _checks.positive("max_turn", max_turn):
        raise InputError(
            f"the vehicle must go straight ahead from {seen.t[0]:g} to {seen.t[-1]:g} s, it "
            f"turns by {turn / DEG:.2g} deg; take a straighter or shorter span, or "
            "`velocity_matching`, which needs turns."
        )
    mean_v = seen.v_n.mean(axis=0)
    lla = seen.lla[len(seen.t) // 2]
    acceleration = (seen.v_n[-1] - seen.v_n[0]) / duration
    carried = np.cross(2.0 * earth_rate_n(lla[0]) + transport_rate_n(lla, mean_v), mean_v)
    force_n = acceleration + carried - gravity_n(lla)
    mount = _checks.as_quats("q_vb", _checks.as_vector("q_vb", q_vb, 4))
    forward_b = rotate(quat_conj(mount), [1.0, 0.0, 0.0])
    ahead_n = mean_v / np.linalg.norm(mean_v)
    q_nb = triad([samples.acc.mean(axis=0), forward_b], [force_n, ahead_n]).q_nb
    level_std = math.hypot(acc_bias_std, math.sqrt(2.0) * float(seen.std.mean()) / duration)
    tilt = level_std / float(np.linalg.norm(force_n))
    yaw = math.hypot(
        _checks.positive("sideslip_std", sideslip_std, allow_zero=True),
        float(seen.std[:, :2].mean()) / math.sqrt(len(seen.t)) / float(speed.mean()),
    )
    return Alignment(
        t=float(0.5 * (seen.t[0] + seen.t[-1])),
        q_nb=q_nb,
        covariance_n=np.diag([tilt**2, tilt**2, yaw**2]),
        heading_reference="true",
        method="course",
        span=samples.span,
    )
