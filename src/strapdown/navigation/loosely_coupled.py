"""The flagship: loosely coupled GNSS/INS filter that finds its own mounting, and its smoother."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.estimator import CELLS, Estimator, State, Taken, Tracker, register
from strapdown.kernels import memory as _m
from strapdown.kernels import status as _s
from strapdown.recording import Recording
from strapdown.solution import COLUMNS, Diagnostics, Solution
from strapdown.units import DEG, UT

STATES: Final = (
    "gyro_scale", "acc_scale", "mount", "antenna", "delay", "fix_error", "odometer", "barometer",
    "magnetometer",
)  # fmt: skip
# Where the index of an optional block stands in `p`, and its number of states.
_BLOCKS: Final = {
    "gyro_scale": (("I_SG", 3),),
    "acc_scale": (("I_SA", 3),),
    "mount": (("I_MOUNT", 3), ("I_ARM_V", 1)),
    "antenna": (("I_ARM_A", 3),),
    "delay": (("I_DELAY", 1),),
    "fix_error": (("I_BP", 9),),
    "odometer": (("I_SODO", 1),),
    "barometer": (("I_BARO", 1),),
    "magnetometer": (("I_MAG", 4),),
}
_EVENT: Final = 17  # time, cell, count, 14 values of a fix
_TAPE: Final = 1_000_000  # numbers on the smoother's tape: 8 MB, about 80 s at 10 Hz
_MISFIT: Final = 2.5  # velocity errors per receiver sigma, above which something is wrong
_DO_NOT_FIT: Final = "the accelerations of the box do not fit the fixes"
_CHECK: Final = (
    "check axes (swapped, mirrored), units, and the time stamps of `imu` against `gnss`"
)
_AXES: Final = ("north", "east", "down")


@register(
    source="error-state INS/GNSS filter (Groves 2013, ch. 14); smoother of Bierman 1973",
    cost="15 to 40 states at 10 Hz, mechanisation at the IMU's rate",
    needs=("gnss",),
    uses=("speed", "baro", "mag"),
    gives="navigation",
    rank=100,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class LooselyCoupled(Estimator):
    """Loosely coupled GNSS/INS filter for land vehicles; nothing has to be given.

    State: attitude, velocity, position, gyro and accelerometer bias (15 error states), and by
    `states` the mount of the box in the vehicle with the arm to its point without side slip, the
    arm to the antenna, the delay between the clocks of receiver and IMU, the slow errors of the
    fixes, scale errors, a wheel speed's scale, a barometer's offset, and iron and declination of a
    magnetometer, which need not be calibrated. Strapdown mechanisation
    in NED on WGS-84; error state ``phi_n, dv_n, dp_n, db_g, db_a`` with
    ``q_true = exp(phi_n) q_nb``.

    It begins by *aligning in motion*: the best rotation of the integrated specific force onto
    the changes of the fixes' velocity (Wahba's problem) gives level and heading in any mounting;
    a few seconds of pulling away suffice. *Forward* is where the box travels. Both are part of the
    causal state. Fixes count at the antenna and at the time they say; velocity and position pass
    a gate; a jump is believed once three fixes agree on it for `recover`. The sigmas of the
    receiver are scaled by what its innovations show. While the car drives, it moves forward at
    its point without side slip (non-holonomic constraint); while both sensors are quiet and
    neither filter nor fix contradict, it stands (zero velocity, zero rate).

    Parameters
    ----------
    states : tuple of str
        Optional blocks that are estimated, of ``gyro_scale``, ``acc_scale``, ``mount``,
        ``antenna``, ``delay``, ``fix_error``, ``odometer``, ``barometer``, ``magnetometer``.
        Without ``mount`` the mount is found once and then kept; without ``barometer`` or
        ``magnetometer`` that sensor is not used.
    vehicle : {'car', 'none'}
        ``'none'``: any carrier; no mount, no constraint, no standstill.
    standstill : bool
        Whether zero-velocity and zero-rate updates are made.
    gyr_noise, acc_noise : float
        White noise [(rad/s)/sqrt(Hz)], [(m/s^2)/sqrt(Hz)], vibration of the carrier included.
    gyr_bias_walk, acc_bias_walk : float
        Random walk of the biases [(rad/s)/sqrt(s)], [(m/s^2)/sqrt(s)]. Larger follows warming
        sensors faster and coasts worse.
    gyr_scale_noise, acc_scale_noise : float
        Noise in proportion to the angular rate and to the acceleration [sqrt(s)]: what errors of
        scale and axes do in a turn.
    std_gyr_bias, std_acc_bias : float
        Sigma of the biases before anything is known [rad/s], [m/s^2].
    std_gyr_scale, std_acc_scale : float
        Sigma of the errors of scale and axes that are estimated: of the gyroscope what each of its
        axes reads of a turn about the vertical, of the accelerometer each axis of itself.
    std_mount : float
        Sigma of the mount once it is found [rad].
    mount_walk : float
        Random walk of the mount: springs, tyres, load [rad/sqrt(s)].
    arm_v, std_arm_v : float
        Point without side slip ahead of the IMU along the vehicle, and its sigma [m]; behind it is
        negative.
    std_antenna : float
        Sigma of each component of the arm from IMU to antenna [m].
    std_delay : float
        Sigma of the delay between the clocks [s].
    fix_share : float
        Slow error of the fixes' position in sigmas of the receiver, to begin with.
    fix_time : float
        Both time constants of that error, which drifts smoothly [s].
    velocity_share : float
        Error of the fixes' velocity in sigmas of the receiver, to begin with.
    velocity_time : float
        How long it lasts [s]. What lasts is in the drift of the position too.
    velocity_lag : float
        Error of the fixes' velocity per horizontal acceleration [s]: a receiver smooths.
    learning : float
        Rate at which the scales of the fixes' errors follow, per fix. Zero keeps them, which with
        ``fix_share=1, velocity_share=1`` takes the receiver by its word.
    gate : float
        Fixes beyond so many sigma are rejected.
    recover : float
        A rejection that lasts so long is overruled [s].
    std_side, std_up : float
        Sigma of the sideways and upward velocity that a driving car has [m/s].
    slip : float
        Sideways velocity per sideways acceleration [s].
    constraint_time : float
        How long what the constraint leaves out stays the same [s].
    rest_gyr, rest_acc : float
        How much a parked car shakes: deviation over a second, all axes together, beyond the
        noise of the sensor, below which it may stand [rad/s], [m/s^2].
    tick : float
        Interval of covariance and constraints [s].
    max_gap : float
        A longer interval between samples is a gap [s]: the covariance is widened.
    realign_gap : float
        A longer gap ends navigation: attitude is aligned again, biases and mount are kept [s].
    std_start : float
        Heading sigma at which alignment ends [rad].
    std_speed, std_height : float
        Sigma of wheel speed [m/s] and of pressure height [m].
    std_field : float
        Sigma of the field across magnetic north where nothing disturbs it [T].
    field_time : float
        How long a disturbance of the field lasts [s]. Larger follows the field more slowly.
    gyr_range, acc_range : float
        Ends of the sensors' ranges; samples there are flagged.

    Notes
    -----
    Online; `smooth` is offline. The time of the solution is the receiver's clock: estimates go
    back by the delay, which at 30 m/s and 50 ms is 1.5 m. Left out of the error model: Coriolis
    and Schuler terms, side slip on ice. Not for positions within 64 m of a pole.

    Memory: 330 numbers and the covariance; with smoothing 8 kB for each 80 s and a tape of 8 MB
    besides the solution itself.

    References
    ----------
    .. [1] P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
           Systems", 2nd edition, Artech House, 2013, chapters 5, 14 and 16.
    .. [2] G. J. Bierman, "Fixed interval smoothing with discrete measurements", International
           Journal of Control 18(1), 1973.

    Examples
    --------
    >>> flt = LooselyCoupled(gyr_noise=2e-4)
    >>> flt.init().status
    1
    """

    NAME: ClassVar[str] = "loosely-coupled"
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
        Taken("gyr_noise", "gyr_noise", floor=True),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("gyr_bias_walk", "gyr_bias_walk", floor=True),
        Taken("acc_bias_walk", "acc_bias_walk", floor=True),
        Taken("std_gyr_bias", "gyr_bias_std"),
        Taken("std_acc_bias", "acc_bias_std"),
    )
    states: tuple[str, ...] = (
        "gyro_scale",
        "mount",
        "antenna",
        "delay",
        "fix_error",
        "odometer",
        "barometer",
        "magnetometer",
    )
    vehicle: Literal["car", "none"] = "car"
    standstill: bool = True
    gyr_noise: float = 1e-4
    acc_noise: float = 5e-3
    gyr_bias_walk: float = 5e-6
    acc_bias_walk: float = 1e-4
    gyr_scale_noise: float = 3e-3
    acc_scale_noise: float = 3e-3
    std_gyr_bias: float = 0.01
    std_acc_bias: float = 0.15
    std_gyr_scale: float = 0.005
    std_acc_scale: float = 0.005
    std_mount: float = 3.0 * DEG
    mount_walk: float = 2e-4
    arm_v: float = -1.0
    std_arm_v: float = 1.0
    std_antenna: float = 0.7
    std_delay: float = 0.05
    fix_share: float = 1.0
    fix_time: float = 3.0
    velocity_share: float = 0.2
    velocity_time: float = 1.0
    velocity_lag: float = 0.02
    learning: float = 0.02
    gate: float = 5.5
    recover: float = 15.0
    std_side: float = 0.05
    std_up: float = 0.2
    slip: float = 0.03
    constraint_time: float = 1.0
    rest_gyr: float = 1.5e-3
    rest_acc: float = 0.06
    tick: float = 0.1
    max_gap: float = 0.5
    realign_gap: float = 2.0
    std_start: float = 0.22
    std_speed: float = 0.2
    std_height: float = 0.5
    std_field: float = 1.0 * UT
    field_time: float = 10.0
    gyr_range: float = math.inf
    acc_range: float = math.inf

    def __post_init__(self) -> None:
        """Check the parameters."""
        states = tuple(self.states)
        for name in states:
            _checks.one_of("states", name, STATES)
        object.__setattr__(self, "states", tuple(name for name in STATES if name in states))
        _checks.one_of("vehicle", self.vehicle, ("car", "none"))
        if not isinstance(self.standstill, bool):
            raise TypeError(f"`standstill` must be True or False, got {self.standstill!r}.")
        _checks.finite("arm_v", self.arm_v)
        for name in _POSITIVE:
            _checks.positive(name, getattr(self, name))
        for name in _NOT_NEGATIVE:
            _checks.positive(name, getattr(self, name), allow_zero=True)
        for name in ("gyr_range", "acc_range"):
            if getattr(self, name) != math.inf:
                _checks.positive(name, getattr(self, name))

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels.ins import step

        return step

    def _params(self) -> FloatArray:
        from strapdown.kernels.ins import layout as k

        p = np.zeros(k.P_SIZE)
        p[_m.P_MAX_GAP] = self.max_gap
        p[_m.P_GYR_RANGE] = self.gyr_range
        p[_m.P_ACC_RANGE] = self.acc_range
        n = k.CORE
        p[k.M] = n + 3 * len({"gyro_scale", "acc_scale"} & set(self.states))
        for name, blocks in _BLOCKS.items():
            for cell, count in blocks:
                on = name in self.states and not (name == "mount" and self.vehicle == "none")
                p[getattr(k, cell)] = n if on else -1
                n += count if on else 0
        p[k.N] = n
        white = self.learning == 0.0 and "fix_error" not in self.states
        for cell, value in {
            "Q_G": self.gyr_noise, "Q_A": self.acc_noise,
            "Q_BG": self.gyr_bias_walk, "Q_BA": self.acc_bias_walk,
            "Q_MOUNT": self.mount_walk,
            "SD_BG": self.std_gyr_bias, "SD_BA": self.std_acc_bias,
            "Q_SG": self.gyr_scale_noise, "Q_SA": self.acc_scale_noise,
            "SD_SCALE_G": self.std_gyr_scale, "SD_SCALE_A": self.std_acc_scale,
            "SD_MOUNT": self.std_mount,
            "SD_ARM_V": self.std_arm_v, "ARM_V_0": self.arm_v,
            "SD_ARM_A": self.std_antenna, "SD_DELAY": self.std_delay,
            "TAU_BP": self.fix_time, "SHARE_BP": self.fix_share,
            "WHITE_P": self.fix_share if white else 0.05 * self.fix_share,
            "TAU_BV": self.velocity_time, "LAG": self.velocity_lag,
            "SCALE_V": self.velocity_share, "LEARN": self.learning,
            "GATE": self.gate**2, "RECOVER": self.recover,
            "CAR": float(self.vehicle == "car"),
            "SD_SIDE": self.std_side, "SD_UP": self.std_up, "SLIP": self.slip,
            "T_CON": self.constraint_time, "V_CON": 1.0, "SD_ROLL": 2.0 * DEG,
            "ZUPT": float(self.standstill), "SD_REST_V": 0.05, "SD_REST_G": 3e-4,
            "REST_G": self.rest_gyr, "REST_A": self.rest_acc, "REST_T": 1.0,
            "SD_SPEED": self.std_speed, "SD_BARO": self.std_height, "SD_SODO": 0.03,
            "SD_MAG": self.std_field, "T_MAG": self.field_time,
            "TICK": self.tick, "REALIGN_GAP": self.realign_gap, "SD_HEADING": self.std_start,
        }.items():  # fmt: skip
            p[getattr(k, cell)] = value
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        from strapdown.kernels.ins import layout as k

        head, _ = Estimator._memory(self)
        x = np.zeros(k.X_SIZE)
        x[: _m.HEAD] = head
        x[k.Q] = x[k.QVB] = x[k.A_Q] = 1.0
        x[k.FIX_T] = -math.inf
        x[_m.LLA : _m.LLA + 3] = x[_m.V : _m.V + 3] = np.nan
        x[_m.STD_POS : _m.STD_POS + 3] = x[_m.STD_V : _m.STD_V + 3] = np.nan
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi
        x[_m.STD_BG : _m.STD_BG + 3] = self.std_gyr_bias
        x[_m.STD_BA : _m.STD_BA + 3] = self.std_acc_bias
        n = int(self._params()[k.N])
        return x, np.zeros((n, n))

    def init(self, *, attitude: Any = None) -> State:
        """Return the state before the first sample; attitude is always found in motion.

        Parameters
        ----------
        attitude : None
            Accepted for the protocol's sake; there is no way to give one.

        Returns
        -------
        State
        """
        if attitude is not None:
            raise ValueError(
                f"`attitude` must be None, got {attitude}: {self.NAME} aligns itself in motion."
            )
        x, P = self._memory()
        return State(self.NAME, x, P)

    def advance(
        self, state: State, rec: Recording, *, diagnostics: bool = True
    ) -> tuple[Solution, State]:
        """Go on from `state` over the next piece of a recording.

        Parameters
        ----------
        state : State
            Left as it is.
        rec : Recording
            Later than `state`, with ``imu`` and ``gnss``; may be empty.
        diagnostics : bool
            Whether to keep a row per fix.

        Returns
        -------
        Solution, State
        """
        state = self._own(state)
        x, P = state.x.copy(), state.P.copy()
        imu, events = self._streams(rec, state)
        kernel = self._kernel()
        k = _layout()
        out = np.empty((len(imu), k.OUT_SIZE))
        fixes = int(np.count_nonzero(events[:, 1] == _m.GNSS)) + 1
        diag = np.full((fixes if diagnostics else 0, 1 + k.N_DIAG), np.nan)
        kernel.run(
            x, P, self._params(), np.zeros(kernel.W_SIZE), imu.t, imu.gyr, imu.acc,
            np.empty(0), np.empty((0, 3)), events, out, diag,
        )  # fmt: skip
        sol = self._navigation(imu.t, out, x, _rows(diag), causal=True)
        return sol, State(self.NAME, x, P)

    def smooth(self, rec: Recording) -> Solution:
        """Estimate over a whole recording with what comes after each sample as well.

        Parameters
        ----------
        rec : Recording
            With ``imu`` and ``gnss``.

        Returns
        -------
        Solution
            Samples before the filter's alignment are the filter's own.

        Notes
        -----
        Offline. Fixed-interval smoother without matrix inverses [2]_; covariance included.
        """
        from strapdown.kernels.ins import smooth as s

        x, P = self._memory()
        imu, events = self._streams(rec, State(self.NAME, x, P))
        k = _layout()
        p = self._params()
        n = int(p[k.N])
        w = np.zeros(k.TAPE + _TAPE)
        out = np.empty((len(imu), k.OUT_SIZE))
        cuts: list[tuple[int, int, FloatArray, FloatArray]] = []
        nothing = np.empty((0, s.NOMINAL))
        row = j = 0
        while row < len(imu):
            cuts.append((row, j, x.copy(), P.copy()))
            row, j = s.forward(x, P, p, w, imu.t, imu.gyr, imu.acc, events, row, j, out, nothing)
        end = x.copy()
        stops = [cut[0] for cut in cuts[1:]] + [len(imu)] * bool(cuts)
        longest = max((b - c[0] for b, c in zip(stops, cuts, strict=True)), default=0)
        nominal = np.empty((longest, s.NOMINAL))
        lam, Lam, d = np.zeros(n), np.zeros((n, n)), np.zeros(n)
        after = -1
        for row, j, x, P in reversed(cuts):
            s.forward(x, P, p, w, imu.t, imu.gyr, imu.acc, events, row, j, out, nominal)
            after = s.backward(x, p, w, lam, Lam, d, imu.t, row, after, nominal, out)
        return self._navigation(imu.t, out, end, {}, causal=False)

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

    def _streams(self, rec: Recording, state: State) -> tuple[Any, FloatArray]:
        """Return the IMU stream and the aiding as events, in order of time."""
        imu = rec.need("imu")
        rec.need("gnss")
        if len(imu) and imu.t[0] <= state.t:
            raise ValueError(f"`rec` must begin after the state, got {imu.t[0]} after {state.t}.")
        return imu, self._events(rec)

    def _events(self, rec: Recording) -> FloatArray:
        parts = []
        fixes = rec.gnss
        if fixes is not None:
            e = np.full((len(fixes), _EVENT), np.nan)
            e[:, 0] = e[:, 3] = fixes.t
            e[:, 1:3] = _m.GNSS, 14
            e[:, 4:7] = fixes.lla
            for at, value in (
                (7, fixes.v_n), (10, fixes.std_position_n), (13, fixes.std_velocity_n),
            ):  # fmt: skip
                if value is not None:
                    e[:, at : at + 3] = value
            parts.append(e)
        for stream, cell, name in (
            (rec.speed, _m.SPEED, "speed"), (rec.baro, _m.BARO, "pressure"),
            (rec.mag, _m.MAG, "mag"),
        ):  # fmt: skip
            if stream is not None:
                values = getattr(stream, name).reshape(len(stream), -1)
                e = np.zeros((len(stream), _EVENT))
                e[:, 0] = stream.t
                e[:, 1:3] = cell, values.shape[1]
                e[:, 3 : 3 + values.shape[1]] = values
                parts.append(e)
        if not parts:
            return np.empty((0, _EVENT))
        events = np.concatenate(parts)
        return np.ascontiguousarray(events[np.argsort(events[:, 0], kind="stable")])

    def _heading_reference(self, rec: Recording) -> str:
        return "true"

    def _navigation(
        self,
        t: FloatArray,
        out: FloatArray,
        x: FloatArray,
        rows: dict[str, Diagnostics],
        *,
        causal: bool,
    ) -> Solution:
        """Return the solution whose arrays stand in the columns of `out`."""
        k = _layout()
        arrays: dict[str, Any] = {}
        for name in self.OUTPUTS:
            first = CELLS[name] - _m.STATUS
            arrays[name] = out[:, first : first + len(COLUMNS[name])]
        arrays["antenna_b"] = out[:, k.OUT_HEAD : k.OUT_HEAD + 3]
        status = out[:, 0].astype(np.int64)
        learned = {
            "mount_found": bool(x[k.MOUNTED]),
            "antenna_b_m": x[k.ARM_A : k.ARM_A + 3].tolist(),
            "side_slip_free_point_m": float(x[k.ARM_V]),
            "delay_s": float(x[k.DELAY]),
            "fix_slow_scale": x[k.K_SLOW : k.K_SLOW + 2].tolist(),
            "fix_fast_scale": x[k.K_WHITE : k.K_WHITE + 2].tolist(),
            "velocity_slow_scale": x[k.K_SLOW + 2 : k.K_SLOW + 4].tolist(),
            "velocity_fast_scale": x[k.K_WHITE + 2 : k.K_WHITE + 4].tolist(),
        }
        meta: dict[str, Any] = {"parameters": self.parameters(), "learned": learned}
        if len(status) and np.all(status & _s.ALIGNING):
            meta["advice"] = _advice(float(x[k.A_COUNT]), float(x[k.A_VAR]))
        elif max(learned["velocity_slow_scale"] + learned["velocity_fast_scale"]) > _MISFIT:
            meta["advice"] = f"{_DO_NOT_FIT}: trust nothing; {_CHECK}"
        return Solution(
            t=t, status=status, filter=self.NAME, causal=causal, heading_reference="true",
            diagnostics=rows, meta=meta, **arrays,
        )  # fmt: skip


_POSITIVE: Final = (
    "gyr_noise", "acc_noise", "std_gyr_bias", "std_acc_bias", "std_gyr_scale", "std_acc_scale",
    "std_mount", "std_arm_v", "std_antenna", "std_delay", "fix_share", "fix_time",
    "velocity_share", "velocity_time", "gate", "recover", "std_side", "std_up",
    "constraint_time", "rest_gyr", "rest_acc", "tick", "max_gap", "realign_gap", "std_start",
    "std_speed", "std_height", "std_field", "field_time",
)  # fmt: skip
_NOT_NEGATIVE: Final = (
    "gyr_bias_walk", "acc_bias_walk", "gyr_scale_noise", "acc_scale_noise", "mount_walk",
    "velocity_lag", "learning", "slip",
)  # fmt: skip


def _layout() -> Any:
    from strapdown.kernels.ins import layout

    return layout


def _advice(fixes: float, variance: float) -> str:
    """Say why there was no alignment."""
    if fixes == 0.0:
        return (
            "no two usable fixes in a row: navigation did not begin; check `gnss` for position, "
            "latitude within 90 deg and sigmas below 10 km"
        )
    if not 0.0 < variance < 1.0:
        return (
            "the fixes hardly move: navigation did not begin; a few seconds of pulling away "
            "suffice"
        )
    return f"{_DO_NOT_FIT}: navigation did not begin; {_CHECK}"


def _rows(diag: FloatArray) -> dict[str, Diagnostics]:
    """Return innovations of position and velocity, one row per fix that was looked at."""
    k = _layout()
    diag = diag[~np.isnan(diag[:, 0])]
    found = {}
    for name, at, sigma, outcome, unit in (
        ("gnss_position", k.D_POS, k.D_SPOS, k.D_OPOS, "m"),
        ("gnss_velocity", k.D_VEL, k.D_SVEL, k.D_OVEL, "m/s"),
    ):
        first = 1 - k.D_POS
        code = diag[:, first + outcome].astype(np.int64)
        rows = np.flatnonzero(code != _s.NOT_MEASURED)
        if len(rows):
            found[name] = Diagnostics(
                t=diag[rows, 0],
                innovation=diag[rows, first + at : first + at + 3],
                sigma=diag[rows, first + sigma : first + sigma + 3],
                outcome=code[rows],
                labels=_AXES,
                unit=unit,
            )
    return found
