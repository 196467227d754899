"""Inertial navigation of the thesis "micro UAV": multi-mode AHRS, then position and velocity."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.multi_mode_ahrs import MultiModeAhrs
from strapdown.estimator import State, Taken, Tracker, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording


@register(
    source="thesis uav, 4.1; its equations are not printed",
    cost="7 states as multi-mode-ahrs; 9 states and mechanisation at the IMU's rate",
    needs=("gnss",),
    uses=("mag",),
    gives="navigation",
    rank=5,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class UavIns(MultiModeAhrs):
    """INS behind the multi-mode AHRS: position, velocity and accelerometer bias from fixes.

    The thesis says what goes in, attitude of the AHRS, accelerometer and GPS, what comes out, that
    the accelerometer's bias is estimated, and (1.2), which makes latitude and longitude of the
    velocity. The rest is chosen here, as plain as the AHRS: the specific force less its bias,
    turned to NED by the AHRS, with gravity added, is integrated twice, on a locally flat Earth
    that does not turn; a Kalman filter of 9 states, position and velocity in NED and bias in b,
    takes the fixes. It corrects no attitude: the AHRS is a system of its own, whose stated errors
    count as noise of the acceleration. Navigation begins at the first fix after heading is known;
    before, position and velocity are NaN.

    Parameters are those of `MultiModeAhrs`, and

    Parameters
    ----------
    force_noise : float
        White noise of the accelerometer, vibration included [m/s^2/sqrt(Hz)].
    acc_bias_walk : float
        Random walk of its bias [m/s^2/sqrt(s)].
    std_acc_bias : float
        Standard deviation of its bias at the start [m/s^2].
    tilt_time : float
        How long an error of attitude lasts [s]. Larger trusts the fixes more.
    std_fix_position, std_fix_velocity : float
        Of each component of a fix, where the receiver states none [m], [m/s].
    fix_gate : float
        Innovations of a fix beyond so many sigma are weighted down. Infinite switches it off.

    Notes
    -----
    Online. Left out: Earth and transport rate, the arm to the antenna. What `gravity` is off, and
    what Coriolis does, ends in the bias: at 9 m/s some mm/s^2.

    Examples
    --------
    >>> from strapdown.simulation import load
    >>> rec = load("flight").record().between(0.0, 60.0)
    >>> sol = UavIns.at(rec.gnss.lla[0], 2026.2).run(rec)
    >>> bool(sol.std_position_n[-1].max() < 2.0)
    True
    """

    NAME: ClassVar[str] = "uav-ins"
    OUTPUTS: ClassVar[tuple[str, ...]] = (
        "q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias", "lla", "v_n",
        "std_position_n", "std_velocity_n", "acc_bias", "std_acc_bias",
    )  # fmt: skip
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **MultiModeAhrs.LABELS,
        "gnss_position": ("north", "east", "down"),
        "gnss_velocity": ("north", "east", "down"),
    }
    DIAGNOSED: ClassVar[Mapping[str, int]] = {
        **MultiModeAhrs.DIAGNOSED,
        "gnss_position": _m.W_HEAD + 7,
        "gnss_velocity": _m.W_HEAD + 14,
    }
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        *MultiModeAhrs.FROM_SENSOR,
        Taken("force_noise", "acc_noise", floor=True),
        Taken("std_acc_bias", "acc_bias_std"),
    )
    force_noise: float = 0.02
    acc_bias_walk: float = 1e-3
    std_acc_bias: float = 0.2
    tilt_time: float = 2.0
    std_fix_position: float = 3.0
    std_fix_velocity: float = 0.2
    fix_gate: float = 5.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        MultiModeAhrs.__post_init__(self)
        for name in ("force_noise", "std_fix_position", "std_fix_velocity"):
            _checks.positive(name, getattr(self, name))
        for name in ("acc_bias_walk", "std_acc_bias", "tilt_time"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        self._positive_or_infinite("fix_gate")

    def tracker(self, state: State | None = None) -> Tracker:
        """Return the stateful form for real-time code, which takes late fixes too.

        Parameters
        ----------
        state : State, optional
            Where to begin.

        Returns
        -------
        strapdown.navigation.NavigationTracker
        """
        from strapdown.navigation.tracker import NavigationTracker

        return NavigationTracker(self, state)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import uav_ins

        return uav_ins

    def _params(self) -> FloatArray:
        k = self._kernel()
        p = MultiModeAhrs._params(self)
        p[k.P_FORCE_NOISE] = self.force_noise
        p[k.P_WALK] = self.acc_bias_walk
        p[k.P_TILT_TIME] = self.tilt_time
        p[k.P_STD_BIAS] = self.std_acc_bias
        p[k.P_FIX_POSITION] = self.std_fix_position
        p[k.P_FIX_VELOCITY] = self.std_fix_velocity
        p[k.P_FIX_GATE] = self.fix_gate
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        x, attitude = MultiModeAhrs._memory(self)
        k = self._kernel()
        for cell in (_m.LLA, _m.V, _m.STD_POS, _m.STD_V, k.FORCE):
            x[cell : cell + 3] = np.nan
        x[_m.STD_BA : _m.STD_BA + 3] = self.std_acc_bias
        P = np.zeros((16, 16))
        P[:7, :7] = attitude
        return x, P

    def _events(self, rec: Recording) -> FloatArray:
        e = MultiModeAhrs._events(self, rec)
        fixes = rec.need("gnss")
        for at, value in ((10, fixes.std_position_n), (13, fixes.std_velocity_n)):
            if value is not None:
                e[:, at : at + 3] = value
        return e
