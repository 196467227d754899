"""How the box is mounted in the vehicle, from a drive: forward is where it goes, down is below."""

from dataclasses import dataclass

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.errors import InputError
from strapdown.navigation.alignment.matching import velocity_matching
from strapdown.navigation.alignment.result import fixes, stretch
from strapdown.recording import Recording
from strapdown.rotation import dcm_from_quat, quat_conj, quat_from_dcm, quat_mul, rpy_from_quat
from strapdown.units import DEG, DPS

_FEWEST = 5  # straight fixes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mount:
    """Attitude of the box in the vehicle, and how sure it is.

    Attributes
    ----------
    q_vb : ndarray, shape (4,)
        Body to vehicle, forward-right-down.
    covariance_v : ndarray, shape (3, 3)
        Of its error about the vehicle's forward, right and down axis [rad^2].
    span : tuple of float
        First and last time of the fixes [s].
    """

    q_vb: FloatArray
    covariance_v: FloatArray
    span: tuple[float, float]

    @property
    def std_v(self) -> FloatArray:
        """Standard deviations about forward, right, down [rad]."""
        return np.asarray(np.sqrt(np.diag(self.covariance_v)))

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw of the box in the vehicle [rad]."""
        return rpy_from_quat(self.q_vb)


def mount(
    rec: Recording,
    *,
    span: tuple[float, float] | None = None,
    velocity_std: float = 0.1,
    gyr_bias_std: float = 0.5 * DPS,
    acc_bias_std: float = 0.1,
    min_speed: float = 3.0,
    max_rate: float = 3.0 * DPS,
    sideslip_std: float = 0.5 * DEG,
    road_std: float = 2.0 * DEG,
    road_time: float = 20.0,
    max_heading_std: float = 10.0 * DEG,
) -> Mount:
    """Find the mounting of a box in a vehicle, any mounting, from a drive with GNSS.

    `velocity_matching` gives the attitude over the span. Forward is the mean direction of travel
    in the box's axes while the vehicle goes straight; down is gravity's, less its part along
    forward: roads are level sideways in the mean.

    Parameters
    ----------
    rec : Recording
        With ``imu`` and ``gnss`` with velocities.
    span : tuple of float, optional
        From when to when [s]: 20 to 120 s with changes of speed or direction, and straight
        stretches. The whole recording by default.
    velocity_std, gyr_bias_std, acc_bias_std
        See `velocity_matching`.
    min_speed : float
        Least speed of a fix that counts [m/s].
    max_rate : float
        Greatest rate of a box that goes straight [rad/s].
    sideslip_std : float
        Sigma of the angle between the vehicle's axis and its way [rad].
    road_std : float
        Sigma of a road's slope to the side [rad].
    road_time : float
        How long a slope stays the same [s]: after so long it counts anew.
    max_heading_std : float
        See `velocity_matching`.

    Returns
    -------
    Mount

    Raises
    ------
    InputError
        If the vehicle hardly goes straight, or as for `velocity_matching`.

    Notes
    -----
    Offline. The vehicle is taken to go forward for the greater part of its way. The attitude's
    sigma is that of the end of the span, where it is greatest, so that those of the mount are
    rather too large. The filter `loosely-coupled` does the same as it goes, and goes on to
    estimate the mount.
    """
    _checks.positive("min_speed", min_speed)
    _checks.positive("max_rate", max_rate)
    for name, value in (("sideslip_std", sideslip_std), ("road_std", road_std)):
        _checks.positive(name, value, allow_zero=True)
    _checks.positive("road_time", road_time)
    end = velocity_matching(
        rec, span=span, velocity_std=velocity_std, gyr_bias_std=gyr_bias_std,
        acc_bias_std=acc_bias_std, max_heading_std=max_heading_std,
    )  # fmt: skip
    seen = fixes(rec, span, velocity_std)
    rate, C_nb = _attitudes(rec, seen.t, end.q_nb, end.gyr_bias)
    speed = np.linalg.norm(seen.v_n, axis=1)
    straight = (speed >= min_speed) & (rate <= max_rate)
    if np.count_nonzero(straight) < _FEWEST:
        raise InputError(
            f"the vehicle must go straight ahead at {min_speed:g} m/s or more at {_FEWEST} fixes, "
            f"it does at {np.count_nonzero(straight)}; take a longer span or another."
        )
    v_b = np.einsum("kij,ki->kj", C_nb[straight], seen.v_n[straight])
    forward = v_b.sum(axis=0)  # a way counts by its length
    forward /= np.linalg.norm(forward)
    down = C_nb[straight, 2].mean(axis=0)
    down -= (down @ forward) * forward
    down /= np.linalg.norm(down)
    C_vb = np.stack((forward, np.cross(down, forward), down))
    C_vn = C_vb @ C_nb[straight].mean(axis=0).T
    roads = max(1.0, float(seen.t[straight][-1] - seen.t[straight][0]) / road_time)
    across = sideslip_std**2 + float(np.mean(seen.std)) ** 2 / float(np.mean(speed[straight])) ** 2
    P = C_vn @ end.covariance_n @ C_vn.T + np.diag([road_std**2 / roads, across, across])
    return Mount(
        q_vb=quat_from_dcm(C_vb),
        covariance_v=P,
        span=(float(seen.t[0]), float(seen.t[-1])),
    )


def _attitudes(
    rec: Recording, t: FloatArray, q_nb: FloatArray, gyr_bias: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return the rate over a second and the attitude at each fix, back from that of the last."""
    from strapdown.kernels import trace

    samples = stretch(rec, (float(t[0]), float(t[-1])))
    bias = np.zeros(3) if gyr_bias is None else gyr_bias
    out = np.empty((len(samples.t), 7))
    gyr = np.ascontiguousarray(samples.gyr - bias)
    trace.run(samples.t, gyr, np.ascontiguousarray(samples.acc), out)
    q_nb0 = quat_mul(q_nb, quat_conj(out[-1, :4]))
    at = np.clip(np.searchsorted(samples.t, t), 0, len(samples.t) - 1)
    turned = np.concatenate(
        (np.zeros((1, 3)), np.cumsum(gyr[1:].T * np.diff(samples.t), axis=1).T)
    )
    low, high = (
        np.clip(np.searchsorted(samples.t, t + half), 0, len(samples.t) - 1)
        for half in (-0.5, 0.5)
    )
    took = np.maximum(samples.t[high] - samples.t[low], 1e-3)
    rate = np.linalg.norm(turned[high] - turned[low], axis=1) / took
    return rate, dcm_from_quat(quat_mul(np.broadcast_to(q_nb0, (len(t), 4)), out[at, :4]))
