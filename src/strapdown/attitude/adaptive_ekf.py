"""Adaptive extended Kalman filter of thesis E, with its Control Unit: 7 states."""

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._adaptive_streams import events, most_rows, rows_of
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import CELLS, Estimator, State, entry, real_samples, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording
from strapdown.rotation import dcm_from_rpy, quat_from_rpy
from strapdown.solution import COLUMNS, Solution
from strapdown.units import DEG

Triple = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]

_IDENTITY: Final[Nine] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_ZERO: Final[Triple] = (0.0, 0.0, 0.0)
_METHODS: Final = {"auto": 0.0, "master-slave": 1.0, "gauss-newton": 2.0}
_LAWS: Final = {"exact": 0.0, "inverse": 1.0, "square": 2.0}
_KERNEL_ORDER: Final = (0, 2, 1)  # the thesis's columns: alignment, GPS active, GPS inactive


@register(
    source="thesis gnssins, ch. 7",
    cost="7 states, 7x7 covariance; measured attitude every second",
    uses=("mag", "gnss", "temperature"),
    rank=8,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveEkf(AttitudeEstimator):
    """Adaptive EKF of quaternion and gyro bias, fed with a measured attitude once a second.

    State: q_nb and gyro bias; the error of the quaternion is additive. The gyroscope is integrated
    at its rate. Every `period` the *measured attitude* is a linear measurement of all four
    components: Master-Slave (gravity levels, the field turns) in alignment and at resets, else
    Gauss-Newton on both vectors. Gravity is minus the specific force, with the vehicle's own
    acceleration removed where a receiver gives speed. The measurement's covariance grows with the
    severity of the manoeuvre: ``R = quat_std^2 10^(k_acc ||f| - g|) base_rate^|r|``.

    A *Control Unit* rules. Modes: alignment, while the box rests at the start; then GPS active or
    GPS inactive. In uniform motion the parameters of alignment hold, and the attitude is *reset*
    to the measured one. A measured attitude that is far off is rejected; so long as that lasts,
    Master-Slave measures, and after `recover`, or a gap, the attitude is reset. Status ``REST`` is
    uniform motion, ``OUTAGE`` a GPS that was there and is not, ``AIDING_REJECTED`` a rejected
    attitude. Diagnostics ``attitude`` holds residuals, ``control_unit`` for each run of the filter
    the mode (0 alignment or reset, 1 GPS inactive, 2 GPS active), whether it reset, whether
    Gauss-Newton measured, and R.

    Values with three elements are for alignment, GPS active and GPS inactive, as table 7.3.

    Parameters
    ----------
    gyr_noise : float
        Density of the rate's noise [rad/s/sqrt(Hz)], root of Gyrcov.
    bias_walk : tuple of 3 floats
        Random walk of the bias [rad/s/sqrt(s)], root of RWncov. Larger follows faster.
    quat_std : tuple of 3 floats
        Standard deviation of each component of the measured quaternion, root of QuatCOV.
    k_acc : tuple of 3 floats
        KA [1/(m/s^2)]. Larger trusts the measurement less when ``|f|`` is not g.
    base_rate : tuple of 3 floats
        baseR, per rad/s of yaw rate. One switches the term off.
    exponent : {'linear', 'root'}
        The two readings of (7.7.8): ``10^(KA d)`` or ``10^sqrt(KA d)``.
    period : float
        Interval of the attitude filter [s].
    propagation : {'sampled', 'printed'}
        Sampled: the covariance follows every sample. Printed: once per period, with ``exp(F T)``
        of the rate at its end and F as in (7.2.8); wrong where the box turns within the period.
    integration : {'exact', 'square', 'inverse'}
        Of the quaternion. Exact for a constant rate; or first order with the normalisation of
        (2.8.4), ``1 - |q|^2``, or of (7.2.2), ``1/|q| - 1``.
    method : {'auto', 'master-slave', 'gauss-newton'}
        How attitude is measured; auto is the choice of 7.6.3.
    use_down : bool
        Whether Gauss-Newton uses all three components of gravity. The thesis leaves the z
        component out, which has no solution for a box on its side whose z axis points east.
    stop : float
        Change of the quaternion at which Gauss-Newton stops.
    roll : {'arctangent', 'tables'}
        Roll by arctangent, or by arcsine and table 7.1 (with its column g_x read as g_z).
    hold_time : float
        TKF: how long after a reset the bias waits [s].
    hold : {'corrections', 'bias'}
        What waits: new corrections of the bias, or the bias as a whole, which is null for so long.
    alignment_time : float
        Longest static alignment [s]; motion ends it.
    uniform_time : float
        How long motion must be uniform for a reset [s].
    uniform_gyr, uniform_acc : float
        Uniform motion: rate less bias is below the one; ``||f| - g|``, the change of the force
        and that of the receiver's speed below the other [rad/s], [m/s^2].
    reset_every : float
        Least time between resets [s]. Infinite switches resets off.
    limit : float
        Measured attitudes that are off by more about north, east or down are rejected [rad].
    recover : float
        Rejections that last so long end in a reset [s].
    fix_timeout : float
        GPS is active for so long after a fix [s].
    min_speed : float
        From this speed on the course stands in for a heading where there is no field [m/s].
    mount : tuple of 3 floats
        Roll, pitch, yaw of the box in the vehicle [rad]. Its x axis is where the vehicle goes.
    mag_reference : tuple of 2 floats, optional
        Horizontal part and part down of the field [T], as of the world magnetic model; see `at`.
        None: as measured in alignment.
    std_attitude : float
        Standard deviation of each quaternion component at the start, root of P_0.
    std_gyr_bias : float
        Standard deviation of the bias at the start [rad/s].
    gap_rate : float
        Rate that may have gone unseen in a gap or beyond the gyro's range [rad/s].
    gravity : float
        Magnitude of gravity [m/s^2].
    gyr_matrix, acc_matrix : tuple of 9 floats
        S, row after row: ``measured = S true + offset``.
    gyr_offset, acc_offset : tuple of 3 floats
        Offsets [rad/s], [m/s^2].
    gyr_slope, acc_slope : tuple of 3 floats
        Change of the offsets with temperature from 25 degC [rad/s/K], [m/s^2/K].

    Notes
    -----
    Online. Thresholds, TKF, durations and the units of table 7.3 are not given in the thesis: they
    are read as SI, `as_printed` has the table. The defaults differ where the printed value claims
    too much: an attitude measured at rest is good to half a degree, not to ``1e-9``, and ``P_0``
    of ``1e10`` would let two noisy attitudes set the bias. The covariance is honest where its R
    is: with `quat_std` of the sensors' true noise.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = AdaptiveEkf(exponent="root").run(demo.recording())
    """

    NAME: ClassVar[str] = "adaptive-ekf"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias")
    gyr_noise: float = 0.1 / 60.0
    bias_walk: Triple = (3e-4, 1e-4, 1e-4)
    quat_std: Triple = (0.005, 0.05, 0.1)
    k_acc: Triple = (0.0, 1.0, 3.0)
    base_rate: Triple = (1.0, 1.5, 6.0)
    exponent: Literal["linear", "root"] = "linear"
    period: float = 1.0
    propagation: Literal["sampled", "printed"] = "sampled"
    integration: Literal["exact", "square", "inverse"] = "exact"
    method: Literal["auto", "master-slave", "gauss-newton"] = "auto"
    use_down: bool = True
    stop: float = 0.01
    roll: Literal["arctangent", "tables"] = "arctangent"
    hold_time: float = 2.0
    hold: Literal["corrections", "bias"] = "corrections"
    alignment_time: float = 10.0
    uniform_time: float = 5.0
    uniform_gyr: float = 0.1
    uniform_acc: float = 0.3
    reset_every: float = 30.0
    limit: float = 30.0 * DEG
    recover: float = 10.0
    fix_timeout: float = 2.5
    min_speed: float = 2.0
    mount: Triple = _ZERO
    mag_reference: tuple[float, float] | None = None
    std_attitude: float = 0.05
    std_gyr_bias: float = 1.0 * DEG
    gap_rate: float = 0.5
    gravity: float = G0
    gyr_matrix: Nine = _IDENTITY
    acc_matrix: Nine = _IDENTITY
    gyr_offset: Triple = _ZERO
    acc_offset: Triple = _ZERO
    gyr_slope: Triple = _ZERO
    acc_slope: Triple = _ZERO

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in _POSITIVE:
            _checks.positive(name, getattr(self, name))
        for name in _NOT_NEGATIVE:
            _checks.positive(name, getattr(self, name), allow_zero=True)
        if self.reset_every != math.inf:
            _checks.positive("reset_every", self.reset_every)
        for name in ("bias_walk", "quat_std", "k_acc", "base_rate"):
            least = 1.0 if name == "base_rate" else 0.0
            values = _checks.as_vector(name, getattr(self, name))
            if not (values > 0.0 if name == "quat_std" else values >= least).all():
                bound = "positive" if name == "quat_std" else f"at least {least:g}"
                raise ValueError(f"`{name}` must be {bound}, got {getattr(self, name)}.")
        _checks.one_of("exponent", self.exponent, ("linear", "root"))
        _checks.one_of("propagation", self.propagation, ("sampled", "printed"))
        _checks.one_of("integration", self.integration, _LAWS)
        _checks.one_of("method", self.method, _METHODS)
        _checks.one_of("roll", self.roll, ("arctangent", "tables"))
        _checks.one_of("hold", self.hold, ("corrections", "bias"))
        if not isinstance(self.use_down, bool):
            raise TypeError(f"`use_down` must be True or False, got {self.use_down!r}.")
        for name in ("mount", "gyr_offset", "acc_offset", "gyr_slope", "acc_slope"):
            _checks.as_vector(name, getattr(self, name))
        for name in ("gyr_matrix", "acc_matrix"):
            matrix = _checks.as_vector(name, getattr(self, name), 9).reshape(3, 3)
            if not abs(np.linalg.det(matrix)) > 0.1:
                raise ValueError(f"`{name}` must be near the identity, got {matrix.tolist()}.")
        if self.mag_reference is not None:
            horizontal, _ = _checks.as_vector("mag_reference", self.mag_reference, 2)
            _checks.positive("mag_reference", horizontal)

    @classmethod
    def as_printed(cls, **parameters: Any) -> Self:
        """Return the filter with table 7.3, ``P_0 = 1e10 I`` and the formulas as printed.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        AdaptiveEkf
        """
        return cls(**{**_PRINTED, **parameters})

    @classmethod
    def at(cls, lla: ArrayLike, date: dt.date | float, **parameters: Any) -> Self:
        """Return the filter with the field of the world magnetic model of a place and a date.

        Parameters
        ----------
        lla : array_like, shape (3,)
            Latitude, longitude, height [rad, rad, m].
        date : date or float
            Date or decimal year.
        **parameters
            Other fields.

        Returns
        -------
        AdaptiveEkf
        """
        from strapdown.attitude.heading import reference_field

        return cls(**{**reference_field(lla, date), **parameters})

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels.gnssins import step

        return step

    def _params(self) -> FloatArray:
        from strapdown.kernels.gnssins import layout as k

        p = self._common(k.P_SIZE)
        p[_m.P_REALIGN] = 0.0
        for at, name in ((k.P_GYR, "gyr"), (k.P_ACC, "acc")):
            matrix = np.array(getattr(self, f"{name}_matrix")).reshape(3, 3)
            p[at : at + 9] = np.linalg.inv(matrix).ravel()
            p[at + 9 : at + 12] = getattr(self, f"{name}_offset")
            p[at + 12 : at + 15] = getattr(self, f"{name}_slope")
        p[k.P_GYR_VAR : k.P_GYR_VAR + 3] = self.gyr_noise**2
        for at, values in (
            (k.P_BIAS_VAR, np.square(self.bias_walk)),
            (k.P_QUAT_VAR, np.square(self.quat_std)),
            (k.P_KA, np.array(self.k_acc)),
            (k.P_BASE, np.array(self.base_rate)),
        ):
            p[at : at + 3] = values[list(_KERNEL_ORDER)]
        p[k.P_C_VB : k.P_C_VB + 9] = dcm_from_rpy(self.mount).ravel()
        for cell, value in {
            "P_ROOT": self.exponent == "root", "P_PERIOD": self.period,
            "P_AT_TRIGGER": self.propagation == "printed", "P_LAW": 2.0,
            "P_EULER": _LAWS[self.integration],
            "P_VAR_Q": self.std_attitude**2, "P_VAR_B": self.std_gyr_bias**2,
            "P_GAP_RATE": self.gap_rate, "P_METHOD": _METHODS[self.method],
            "P_USE_Z": self.use_down, "P_STOP": self.stop, "P_TABLES": self.roll == "tables",
            "P_TKF": self.hold_time, "P_NULL": self.hold == "bias",
            "P_ALIGN_TIME": self.alignment_time, "P_QUIET_TIME": self.uniform_time,
            "P_QUIET_GYR": self.uniform_gyr, "P_QUIET_ACC": self.uniform_acc,
            "P_RESET_EVERY": self.reset_every, "P_LIMIT": self.limit,
            "P_RECOVER": self.recover, "P_TIMEOUT": self.fix_timeout,
            "P_MIN_SPEED": self.min_speed, "P_GRAVITY": self.gravity,
        }.items():  # fmt: skip
            p[getattr(k, cell)] = value
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        from strapdown.kernels.gnssins import layout as k

        head, _ = Estimator._memory(self)
        x = np.zeros(k.X_SIZE)
        x[: _m.HEAD] = head
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi  # nothing is known
        x[_m.STD_BG : _m.STD_BG + 3] = self.std_gyr_bias
        x[_m.Q_VB : _m.Q_VB + 4] = quat_from_rpy(self.mount)
        x[k.MAG_AGE] = x[k.FIX_AGE] = math.inf
        x[k.U] = x[k.COURSE] = math.inf  # none yet
        x[k.FIX_V : k.FIX_V + 3] = math.inf
        x[k.FIX_T] = -math.inf
        x[k.GRAVITY] = self.gravity
        x[k.LAST_F + 2] = -self.gravity
        if self.mag_reference is not None:
            x[k.REF_H], x[k.REF_D] = self.mag_reference
        P = np.zeros((7, 7))
        P[:4, :4] = self.std_attitude**2 * np.eye(4)
        P[4:, 4:] = self.std_gyr_bias**2 * np.eye(3)
        return x, P

    def step(
        self,
        state: State,
        t: float,
        gyr: ArrayLike | None,
        acc: ArrayLike | None,
        mag: ArrayLike | None = None,
        *,
        temperature: ArrayLike | None = None,
        **aiding: ArrayLike,
    ) -> State:
        """Return the state after one more IMU sample; `state` is left as it was.

        Parameters
        ----------
        state, t, gyr, acc, mag
            See `Estimator.step`.
        temperature : float, optional
            Of the sensors [degC], if a new one came.
        **aiding
            See `Estimator.step`; ``gnss`` is used.

        Returns
        -------
        State
        """
        if temperature is not None:
            from strapdown.kernels.gnssins import layout as k

            state = self._own(state)
            x = state.x.copy()
            x[k.TEMP] = 1.0
            x[k.TEMP + 1] = _checks.finite("temperature", temperature)
            state = State(state.name, x, state.P)
        return Estimator.step(self, state, t, gyr, acc, mag, **aiding)

    def advance(
        self, state: State, rec: Recording, *, diagnostics: bool = True
    ) -> tuple[Solution, State]:
        """Go on from `state` over the next piece of a recording.

        Parameters
        ----------
        state : State
            Left as it is.
        rec : Recording
            Later than `state`; may be empty.
        diagnostics : bool
            Whether to keep a row per run of a filter.

        Returns
        -------
        Solution, State
        """
        from strapdown.kernels.gnssins import layout as k

        _checks.recording("rec", rec)
        state = self._own(state)
        x, P = state.x.copy(), state.P.copy()
        imu = rec.need("imu")
        for name in entry(self.NAME).needs:
            rec.need(name)
        if len(imu) and imu.t[0] <= state.t:
            raise ValueError(f"`rec` must begin after the state, got {imu.t[0]} after {state.t}.")
        mag = rec.mag
        t_mag, field = (np.empty(0), np.empty((0, 3))) if mag is None else (mag.t, mag.mag)
        gyr, acc = real_samples(imu)
        aiding = self._events(rec)
        last = max(CELLS[name] + len(COLUMNS[name]) for name in self.OUTPUTS)
        out = np.empty((len(imu), last - _m.STATUS))
        rows = most_rows(imu.t, state.t, self.period, len(aiding)) if diagnostics else 0
        diag = np.full((rows, 1 + k.N_ROW + k.N_FIX), np.nan)
        self._kernel().run(
            x, P, self._params(), np.zeros(k.W_SIZE),
            imu.t, gyr, acc, t_mag, field, aiding, out, diag,
        )  # fmt: skip
        return self._solution(rec, imu.t, out, rows_of(diag)), State(self.NAME, x, P)

    def _events(self, rec: Recording) -> FloatArray:
        return events(rec)

    def _heading_reference(self, rec: Recording) -> str:
        if rec.gnss is not None and (rec.mag is None or not self.use_mag):
            return "true"
        return AttitudeEstimator._heading_reference(self, rec)


_POSITIVE: Final = (
    "gyr_noise", "period", "stop", "uniform_time", "uniform_gyr", "uniform_acc", "limit",
    "recover", "fix_timeout", "min_speed", "std_attitude", "gravity",
)  # fmt: skip
_NOT_NEGATIVE: Final = ("hold_time", "alignment_time", "std_gyr_bias", "gap_rate")
_PRINTED: Final[Mapping[str, Any]] = {
    "gyr_noise": 0.1 / 60.0,
    "bias_walk": (math.sqrt(1e-4), math.sqrt(1e-5), math.sqrt(1e-5)),
    "quat_std": (math.sqrt(1e-9), math.sqrt(1e-2), math.sqrt(1e-2)),
    "k_acc": (0.0, 1.0, 3.0),
    "base_rate": (1.0, 1.5, 6.0),
    "std_attitude": 1e5,
    "std_gyr_bias": 1e5,
    "propagation": "printed",
    "integration": "inverse",
    "use_down": False,
    "roll": "tables",
}
