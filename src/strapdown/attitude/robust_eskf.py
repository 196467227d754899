"""Robust error-state Kalman filter: attitude with a bounded velocity, and its smoother."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import Taken, real_samples, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording
from strapdown.solution import Solution
from strapdown.units import DEG, DPS, UT

_POSITIVE = (
    "gyr_noise", "gyr_bias_std", "acc_noise", "acc_bias_std", "velocity_std", "velocity_time",
    "mag_std", "mag_time", "tails", "rest_gyr", "rest_acc", "rest_time", "interval", "gravity",
)  # fmt: skip
_NOT_NEGATIVE = (
    "gyr_rate_noise", "gyr_bias_walk", "gyr_scale_std", "mag_walk", "mag_delay_std", "rate_walk",
    "latency", "field_std",
)  # fmt: skip
# Deviation of the latency [s] where none is declared, and where one is.
_TIMING_UNKNOWN, _TIMING_DECLARED = 2e-3, 5e-4


@register(
    source="this project; docs/attitude-flagship.md",
    cost="22 error states, covariance 10 times a second",
    uses=("mag",),
    rank=50,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class RobustEskf(AttitudeEstimator):
    """Robust error-state filter for 6 and 9 axes: bounded velocity, gyro scale, disturbed field.

    Error state, 22 elements: attitude in n, velocity in n, gyro bias, accelerometer bias, scale
    and misalignment of the gyro (3 x 3), delay of the magnetometer. Each sample turns the
    attitude; every `interval` the covariance is propagated and three measurements enter, one
    scalar at a time:

    * velocity is zero with the deviation `velocity_std`: what moves about comes back. This
      tells gravity from acceleration, better the longer one looks;
    * at rest velocity is zero and the mean rate is the gyro's bias;
    * the horizontal field points to magnetic north. Its deviation is not fixed but inferred from
      how far horizontal and vertical strength are off their usual values: two components of a
      disturbance show how large the third may be (Student's t).

    The field corrects heading, and what is correlated with it; dip is not used for tilt.

    Parameters
    ----------
    gyr_noise : float
        Angle random walk [rad/s/sqrt(Hz)], errors of integration included. Larger follows the
        accelerometer and the field more quickly.
    gyr_rate_noise : float
        The part of it that grows with the rate [1/sqrt(Hz)].
    gyr_bias_walk : float
        Random walk of the gyro bias [rad/s/sqrt(s)].
    gyr_bias_std : float
        Deviation of the gyro bias at switch-on [rad/s].
    gyr_scale_std : float
        Deviation of scale factors and misalignments of the gyro; zero switches their
        estimation off.
    acc_noise : float
        Velocity random walk [m/s^2/sqrt(Hz)].
    acc_bias_std : float
        Deviation of the accelerometer bias [m/s^2].
    velocity_std : float
        Deviation of the velocity from zero [m/s]. Larger admits longer accelerations and takes
        longer to find the vertical.
    velocity_time : float
        Correlation time of that velocity [s].
    mag_std : float
        Deviation of the field's components from their usual values where nothing disturbs [T].
    mag_time : float
        How long a disturbance of the field lasts [s]. Larger follows the field more slowly.
    mag_walk : float
        Random walk of the usual field [T/sqrt(s)].
    mag_delay_std : float
        Deviation of the magnetometer's delay behind the gyro [s]; zero switches its
        estimation off.
    tails : float
        Degrees of freedom of Student's t of velocity, rest and field. Smaller forgives more.
    rest_gyr, rest_acc : float
        At rest rate and specific force stay so near their recent means [rad/s], [m/s^2].
    rest_time : float
        Rest is believed after so long [s].
    rate_walk : float
        Random walk of the rate [rad/s/sqrt(s)]: uncertainty where samples are missing.
    interval : float
        Time between two updates [s].
    latency : float
        How far the solution is turned forward [s], for sensors whose samples come late.
    timing_std : float, optional
        Deviation of the latency [s]; enters the stated deviations only. None: 2 ms where no
        latency is declared, 0.5 ms where one is.
    field_std : float
        Deviation of the local field's heading [rad], which no averaging takes away; enters
        the stated deviation of the heading only.
    gravity : float
        Magnitude of gravity [m/s^2].

    Notes
    -----
    Online; `smooth` is offline.

    References
    ----------
    .. [1] D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias
           estimation and magnetic disturbance rejection", Information Fusion 91, 2023: what a
           filter of this kind is measured by.
    .. [2] G. J. Bierman, "Fixed interval smoothing with discrete measurements", International
           Journal of Control 18(1), 1973: the backward pass.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> rec = demo.recording(duration=20.0)
    >>> flt = RobustEskf()
    >>> filtered, smoothed = flt.run(rec), flt.smooth(rec)
    >>> filtered.causal, smoothed.causal
    (True, False)
    """

    NAME: ClassVar[str] = "robust-eskf"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias")
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise", floor=True),
        Taken("gyr_bias_walk", "gyr_bias_walk", floor=True),
        Taken("gyr_bias_std", "gyr_bias_std"),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("acc_bias_std", "acc_bias_std"),
    )
    gyr_noise: float = 1.5e-3
    gyr_rate_noise: float = 5e-4
    gyr_bias_walk: float = 8e-5
    gyr_bias_std: float = 2.0 * DPS
    gyr_scale_std: float = 5e-3
    acc_noise: float = 0.05
    acc_bias_std: float = 0.02
    velocity_std: float = 0.35
    velocity_time: float = 0.5
    mag_std: float = 0.2 * UT
    mag_time: float = 10.0
    mag_walk: float = 0.04 * UT
    mag_delay_std: float = 0.015
    tails: float = 4.0
    rest_gyr: float = 1.5 * DPS
    rest_acc: float = 0.4
    rest_time: float = 1.5
    rate_walk: float = 2.0
    interval: float = 0.1
    latency: float = 0.0
    timing_std: float | None = None
    field_std: float = 2.0 * DEG
    gravity: float = G0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in _POSITIVE:
            _checks.positive(name, getattr(self, name))
        for name in _NOT_NEGATIVE:
            _checks.positive(name, getattr(self, name), allow_zero=True)
        if self.timing_std is not None:
            _checks.positive("timing_std", self.timing_std, allow_zero=True)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import robust_eskf

        return robust_eskf

    def _params(self) -> FloatArray:
        from strapdown.kernels import robust_eskf_layout as layout

        p = self._common(layout.P_SIZE)
        p[_m.P_REALIGN] = 0.0  # over a gap the filter keeps what it knows
        for name in _POSITIVE + _NOT_NEGATIVE:
            p[getattr(layout, f"P_{name.upper()}")] = getattr(self, name)
        timing = self.timing_std
        if timing is None:
            timing = _TIMING_DECLARED if self.latency > 0.0 else _TIMING_UNKNOWN
        p[layout.P_TIMING_STD] = timing
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        from strapdown.kernels.robust_eskf_covariance import N
        from strapdown.kernels.robust_eskf_layout import X_SIZE

        x = np.zeros(X_SIZE)
        x[: _m.HEAD], _ = AttitudeEstimator._memory(self)
        x[_m.STD_ATT : _m.STD_ATT + 3] = np.pi  # nothing is known
        P = np.zeros((N, N))
        self._kernel().init(x, P, self._params())
        return x, P

    def smooth(self, rec: Recording) -> Solution:
        """Estimate each sample from the whole recording.

        Parameters
        ----------
        rec : Recording
            With an IMU; a magnetometer is used if present.

        Returns
        -------
        Solution
            Not causal; `std_attitude_n` and `std_gyr_bias` are the smoother's.

        Raises
        ------
        MissingStream
            If the recording has no IMU.
        """
        from strapdown.kernels import robust_eskf_smoother as smoother
        from strapdown.kernels.robust_eskf_covariance import INTERVAL, N
        from strapdown.kernels.robust_eskf_layout import RECORD_SIZE

        _checks.recording("rec", rec)
        imu = rec.need("imu")
        x, P = self._memory()
        p, w = self._params(), np.zeros(self._kernel().W_SIZE)
        t_mag, field = (
            (np.empty(0), np.empty((0, 3))) if rec.mag is None else (rec.mag.t, rec.mag.mag)
        )
        gyr, acc = real_samples(imu)
        n = len(imu)
        out = np.empty((n, _m.STD_BG + 3 - _m.STATUS))
        most = int((imu.t[-1] - imu.t[0]) / self.interval) + 1 if n else 0
        records = np.empty((min(n, most), RECORD_SIZE))
        ends = np.zeros(len(records), dtype=np.int64)
        count = smoother.forward(
            x, P, p, w, imu.t, gyr, acc, t_mag, field, self._events(rec), out,
            np.empty((0, _m.W_HEAD)), records, ends,
        )  # fmt: skip
        correction = np.empty((int(count), smoother.CORRECTION_SIZE))
        smoother.backward(records, count, np.empty((N + 2, N)), np.empty(INTERVAL), correction)
        smoother.apply(imu.t, imu.gyr, p, records, ends, count, correction, out)
        smoother.level_back(imu.t, gyr, records, ends, count, out)
        return replace(self._solution(rec, imu.t, out, {}), causal=False)
