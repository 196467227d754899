"""The complete low-cost GNSS/INS of thesis E: attitude chain, Control Unit, position filter."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.adaptive_ekf import _PRINTED as _PRINTED_ATTITUDE
from strapdown.attitude.adaptive_ekf import AdaptiveEkf
from strapdown.estimator import State, Taken, Tracker, register
from strapdown.kernels import memory as _m


@register(
    source="thesis gnssins, ch. 7",
    cost="7 states at 1 Hz, 9 or 12 at the fixes, mechanisation at the IMU's rate",
    needs=("gnss",),
    uses=("mag", "temperature"),
    gives="navigation",
    rank=10,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class Gnssins(AdaptiveEkf):
    """Loosely coupled system of a thesis: attitude filter, Control Unit and position filter.

    Attitude is that of `AdaptiveEkf`, whose parameters hold here too. The compensated specific
    force, turned to NED, with gravity added, is integrated twice on a flat, non-rotating Earth. A
    second Kalman filter of 9 or 12 states estimates the error of position, velocity and
    acceleration, and the accelerometer's bias, from fix less INS. Its corrections go back at once.

    The vehicle is taken to move along its x axis: the box's, unless `mount` says otherwise.
    Without a magnetometer the course gives heading from `min_speed` on. Navigation begins with the
    first fix after heading is known. Status: ``ALIGNING`` before that, ``OUTAGE`` in the mode GPS
    inactive, ``REST`` in uniform motion; diagnostics as in `AdaptiveEkf`, ``gnss_position``,
    ``gnss_velocity``.

    Parameters
    ----------
    states : {12, 9}
        With or without the accelerometer's bias.
    form : {'consistent', 'printed'}
        Printed: ``x+ = x + v dt``, ``a+ = a + b`` and one Q for every step, (7.7.10) to (7.7.22).
        Consistent: Phi and Q integrated exactly, b enters the velocity only.
    acc_noise : float
        White noise of the acceleration [m/s^2/sqrt(Hz)]; 35 mg at 35 Hz.
    acc_walk : float
        Random walk of the acceleration error: what wrong attitudes make [m/s^2/sqrt(s)].
    acc_bias_walk : float
        Random walk of the bias [m/s^2/sqrt(s)].
    std_acc, std_acc_bias : float
        Standard deviations of acceleration error and bias at the start [m/s^2].
    std_start : float, optional
        Of position and velocity at the start, as printed; None: that of the fix.
    std_fix_position, std_fix_velocity : float
        Of each component of a fix [m], [m/s]. The thesis's text swaps the two against (7.7.23).
    receiver_sigmas : bool
        Whether the receiver's own sigmas hold where it states them.
    printed_std : tuple of 3 floats
        Roots of the printed Q: of position [m] and velocity [m/s], acceleration, bias [m/s^2].
    bias_frame : {'body', 'local'}
        Where the bias goes: turned to b, to the accelerometer; or kept in n as it was estimated.
    fix_gate : float
        Fixes beyond so many sigma are rejected until `recover`. Infinite switches it off.
    fix_period : float
        Least time between fixes that count [s].

    Notes
    -----
    Online. Left out, as in the thesis: Earth and transport rate, the arm to the antenna, the
    receiver's latency. Acceleration and bias are told apart by their noise only.

    Examples
    --------
    >>> flt = Gnssins(states=9, mount=(0.0, 0.0, 1.5))
    >>> flt.init().status
    1
    """

    NAME: ClassVar[str] = "gnssins"
    OUTPUTS: ClassVar[tuple[str, ...]] = (
        "q_nb",
        "gyr_bias",
        "std_attitude_n",
        "std_gyr_bias",
        "lla",
        "v_n",
        "std_position_n",
        "std_velocity_n",
        "acc_bias",
        "std_acc_bias",
        "q_vb",
    )
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise"),
        Taken("acc_noise", "acc_noise", floor=True),
    )
    states: Literal[12, 9] = 12
    form: Literal["consistent", "printed"] = "consistent"
    acc_noise: float = 0.06
    acc_walk: float = 0.3
    acc_bias_walk: float = 1e-3
    std_acc: float = 0.5
    std_acc_bias: float = 0.2
    std_start: float | None = None
    std_fix_position: float = 3.0
    std_fix_velocity: float = 2.0
    receiver_sigmas: bool = True
    printed_std: tuple[float, float, float] = (2.0, 2.0, math.sqrt(1.5))
    bias_frame: Literal["body", "local"] = "body"
    fix_gate: float = 6.0
    fix_period: float = 0.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AdaptiveEkf.__post_init__(self)
        if self.states not in (9, 12):
            raise ValueError(f"`states` must be 9 or 12, got {self.states}.")
        _checks.one_of("form", self.form, ("consistent", "printed"))
        _checks.one_of("bias_frame", self.bias_frame, ("body", "local"))
        if not isinstance(self.receiver_sigmas, bool):
            raise TypeError(
                f"`receiver_sigmas` must be True or False, got {self.receiver_sigmas!r}."
            )
        for name in (
            "acc_noise",
            "std_acc",
            "std_acc_bias",
            "std_fix_position",
            "std_fix_velocity",
        ):
            _checks.positive(name, getattr(self, name))
        for name in ("acc_walk", "acc_bias_walk", "fix_period"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        for value in self.printed_std:
            _checks.positive("printed_std", value)
        if self.std_start is not None:
            _checks.positive("std_start", self.std_start)
        if self.fix_gate != math.inf:
            _checks.positive("fix_gate", self.fix_gate)

    @classmethod
    def as_printed(cls, **parameters: Any) -> Self:
        """Return the system with the tables and formulas as printed.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        Gnssins
        """
        return cls(**{**_PRINTED_ATTITUDE, **_PRINTED, **parameters})

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

    def _params(self) -> FloatArray:
        from strapdown.kernels.gnssins import layout as k

        p = AdaptiveEkf._params(self)
        printed = self.form == "printed"
        noise = (self.acc_noise, self.acc_walk, self.acc_bias_walk)
        q_v, q_a, q_b = np.square(self.printed_std if printed else noise)
        for cell, value in {
            "P_STATES": self.states, "P_PRINTED": printed,
            "P_Q_V": q_v, "P_Q_A": q_a, "P_Q_B": q_b,
            "P_R_P": self.std_fix_position**2, "P_R_V": self.std_fix_velocity**2,
            "P_RECEIVER": self.receiver_sigmas,
            "P_0_A": self.std_acc**2, "P_0_B": self.std_acc_bias**2,
            "P_0_X": (self.std_start or 0.0) ** 2,
            "P_IN_BODY": self.bias_frame == "body", "P_GATE": self.fix_gate**2,
            "P_FIX_PERIOD": self.fix_period,
        }.items():  # fmt: skip
            p[getattr(k, cell)] = value
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        x, attitude = AdaptiveEkf._memory(self)
        for cell in (_m.LLA, _m.V, _m.STD_POS, _m.STD_V):
            x[cell : cell + 3] = np.nan
        x[_m.STD_BA : _m.STD_BA + 3] = self.std_acc_bias
        P = np.zeros((7 + self.states, 7 + self.states))
        P[:7, :7] = attitude
        return x, P


# (7.7.22), (7.7.23), P_0, and fixes at 1 Hz; no gate.
_PRINTED: Final[Mapping[str, Any]] = {
    "form": "printed",
    "std_acc": 1e3,
    "std_acc_bias": 1e3,
    "std_start": 1e3,
    "std_fix_position": 3.0,
    "std_fix_velocity": 2.0,
    "receiver_sigmas": False,
    "bias_frame": "local",
    "fix_gate": math.inf,
    "fix_period": 1.0,
}
