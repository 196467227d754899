"""What an estimator believes: time, attitude, what else it estimates, and how sure it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag, unique
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray, IntArray
from strapdown.kernels import status as _s

HEADING_REFERENCES = ("true", "magnetic", "arbitrary")


@unique
class Status(IntFlag):
    """What happened at a sample; several flags may be set."""

    ALIGNING = _s.ALIGNING  # no attitude yet: q_nb is the identity
    GYR_INVALID = _s.GYR_INVALID  # NaN or absurd rate: sample skipped, integrated over later
    ACC_INVALID = _s.ACC_INVALID  # NaN, zero or absurd specific force: not used
    MAG_INVALID = _s.MAG_INVALID  # NaN, zero or absurd field: not used
    ACC_REJECTED = _s.ACC_REJECTED  # specific force does not look like gravity: not used
    MAG_REJECTED = _s.MAG_REJECTED  # field fails its gate: not used
    AIDING_REJECTED = _s.AIDING_REJECTED  # another aiding measurement fails its gate
    GAP = _s.GAP  # the time since the last sample is longer than `max_gap`
    REST = _s.REST  # the device is found to be at rest
    SATURATED = _s.SATURATED  # a sensor is at the end of its range
    MAG_DISTURBED = _s.MAG_DISTURBED  # the field is not as usual: disturbed
    OUTAGE = _s.OUTAGE  # aiding that bounds the position is missing
    MAG_MISSING = _s.MAG_MISSING  # no valid field for seconds, though there was one
    GYR_STUCK = _s.GYR_STUCK  # rates of exactly zero where the box was just turning: used


@unique
class Outcome(IntEnum):
    """What became of a measurement."""

    NOT_MEASURED = _s.NOT_MEASURED
    ACCEPTED = _s.ACCEPTED
    REJECTED_GATE = _s.REJECTED_GATE
    REJECTED_INVALID = _s.REJECTED_INVALID
    REJECTED_DISTURBED = _s.REJECTED_DISTURBED


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnostics:
    """One row for each measurement that an estimator looked at.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Time of the IMU sample at which it took effect [s].
    innovation : ndarray, shape (m, d)
        Measured less predicted, in `unit`.
    sigma : ndarray, shape (m, d)
        Standard deviation that the estimator expected of it; NaN if it states none.
    outcome : ndarray of int, shape (m,)
        `Outcome` of each row.
    labels : tuple of str
        Name of each of the d components.
    unit : str
        Unit of innovation and sigma; empty for unit vectors.
    """

    t: FloatArray
    innovation: FloatArray
    sigma: FloatArray
    outcome: IntArray
    labels: tuple[str, ...]
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Estimates on the time axis of the IMU.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], the recording's ``imu.t``.
    q_nb : ndarray, shape (n, 4)
        Attitude, body (axes as recorded) to NED, ``(w, x, y, z)``.
    status : ndarray of int, shape (n,)
        `Status` bits.
    filter : str
        Registry name of the estimator.
    causal : bool
        Whether sample k depends on samples up to k only.
    heading_reference : {'true', 'magnetic', 'arbitrary'}
        What heading is measured from.
    gyr_bias, acc_bias : ndarray, shape (n, 3), optional
        Sensor biases in b [rad/s], [m/s^2].
    std_attitude_n : ndarray, shape (n, 3), optional
        Standard deviation of the attitude error about north, east and down [rad].
    std_gyr_bias, std_acc_bias : ndarray, shape (n, 3), optional
        Standard deviations of the biases in b [rad/s], [m/s^2].
    lla : ndarray, shape (n, 3), optional
        Latitude, longitude, height of the IMU [rad, rad, m]; NaN before the first fix.
    v_n : ndarray, shape (n, 3), optional
        Velocity over ground of the IMU, north, east, down [m/s].
    std_position_n, std_velocity_n : ndarray, shape (n, 3), optional
        Standard deviations north, east, down [m], [m/s].
    q_vb : ndarray, shape (n, 4), optional
        Mount: body to vehicle forward-right-down.
    antenna_b : ndarray, shape (n, 3), optional
        From the IMU to the GNSS antenna, in b [m], where it is estimated.
    diagnostics : mapping of str to Diagnostics
        By measurement, empty when switched off.
    meta : mapping
        Parameters of the estimator and other JSON-like facts.
    """

    t: FloatArray
    q_nb: FloatArray
    status: IntArray
    filter: str
    causal: bool = True
    heading_reference: str = "arbitrary"
    gyr_bias: FloatArray | None = None
    acc_bias: FloatArray | None = None
    std_attitude_n: FloatArray | None = None
    std_gyr_bias: FloatArray | None = None
    std_acc_bias: FloatArray | None = None
    lla: FloatArray | None = None
    v_n: FloatArray | None = None
    std_position_n: FloatArray | None = None
    std_velocity_n: FloatArray | None = None
    q_vb: FloatArray | None = None
    antenna_b: FloatArray | None = None
    diagnostics: Mapping[str, Diagnostics] = field(default_factory=dict)
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that all arrays have as many rows as `t`."""
        _checks.one_of("heading_reference", self.heading_reference, HEADING_REFERENCES)
        for name, columns in COLUMNS.items():
            value = getattr(self, name)
            if value is None:
                continue
            want = (len(self.t), len(columns)) if len(columns) > 1 else (len(self.t),)
            if value.shape != want:
                raise ValueError(f"`{name}` must have shape {want}, got {value.shape}.")

    def __len__(self) -> int:
        return len(self.t)

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw of b relative to n, shape (n, 3) [rad]; computed on access."""
        from strapdown.rotation import rpy_from_quat

        return rpy_from_quat(self.q_nb)

    @property
    def is_navigation(self) -> bool:
        """Whether there is a position."""
        return self.lla is not None

    def at(self, lever_arm_b: ArrayLike) -> "Solution":
        """Return the solution moved to another point of the box.

        Parameters
        ----------
        lever_arm_b : array_like, shape (3,)
            From the IMU to the point, in b [m].

        Returns
        -------
        Solution
            Position of the point. Its velocity is that of the IMU plus the lever arm's
            turning with the rate that attitude differences give.

        Raises
        ------
        ValueError
            If there is no position.
        """
        from strapdown.earth import dcm_ne, ecef_from_lla, lla_from_ecef
        from strapdown.rotation import quat_conj, quat_mul, rotate, rotvec_from_quat

        if self.lla is None:
            raise ValueError("`at` needs a solution with position, this one has attitude only.")
        arm_n = rotate(self.q_nb, _checks.as_vector("lever_arm_b", lever_arm_b))
        arm_e = np.einsum("kij,ki->kj", dcm_ne(self.lla), arm_n)
        lla = lla_from_ecef(ecef_from_lla(self.lla) + arm_e)
        v_n = self.v_n
        if v_n is not None and len(self.t) > 1:
            dq = quat_mul(self.q_nb[1:], quat_conj(self.q_nb[:-1]))
            omega_n = rotvec_from_quat(dq) / np.diff(self.t)[:, None]
            omega_n = np.concatenate((omega_n[:1], omega_n))
            v_n = v_n + np.cross(omega_n, arm_n)
        return replace(self, lla=lla, v_n=v_n)

    def between(self, start: float, stop: float) -> "Solution":
        """Return the samples with ``start <= t < stop``; diagnostics too."""
        low, high = (int(i) for i in np.searchsorted(self.t, (start, stop)))
        parts = {
            name: value[low:high] for name in COLUMNS if (value := getattr(self, name)) is not None
        }
        rows = {
            name: replace(
                d,
                **{
                    key: getattr(d, key)[(d.t >= start) & (d.t < stop)]
                    for key in ("t", "innovation", "sigma", "outcome")
                },
            )
            for name, d in self.diagnostics.items()
        }
        return replace(self, t=self.t[low:high], diagnostics=rows, **parts)

    def status_counts(self) -> dict[str, int]:
        """Return the number of samples at which each flag is set, zero counts left out."""
        counts = {f.name or "": int(np.count_nonzero(self.status & f.value)) for f in Status}
        return {name: count for name, count in counts.items() if count}


# The arrays of a solution and their SI columns in files.
COLUMNS: Mapping[str, tuple[str, ...]] = {
    "q_nb": ("q_nb_w", "q_nb_x", "q_nb_y", "q_nb_z"),
    "lla": ("lat_rad", "lon_rad", "height_m"),
    "v_n": ("v_n_m_s", "v_e_m_s", "v_d_m_s"),
    "q_vb": ("q_vb_w", "q_vb_x", "q_vb_y", "q_vb_z"),
    "antenna_b": ("antenna_x_m", "antenna_y_m", "antenna_z_m"),
    "gyr_bias": ("gyr_bias_x_rad_s", "gyr_bias_y_rad_s", "gyr_bias_z_rad_s"),
    "acc_bias": ("acc_bias_x_m_s2", "acc_bias_y_m_s2", "acc_bias_z_m_s2"),
    "std_attitude_n": ("std_att_n_rad", "std_att_e_rad", "std_att_d_rad"),
    "std_gyr_bias": ("std_gyr_bias_x_rad_s", "std_gyr_bias_y_rad_s", "std_gyr_bias_z_rad_s"),
    "std_acc_bias": ("std_acc_bias_x_m_s2", "std_acc_bias_y_m_s2", "std_acc_bias_z_m_s2"),
    "std_position_n": ("std_n_m", "std_e_m", "std_d_m"),
    "std_velocity_n": ("std_v_n_m_s", "std_v_e_m_s", "std_v_d_m_s"),
    "status": ("status",),
}
