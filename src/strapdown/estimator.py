"""What every estimator is, and the one registry in which they all stand.

An estimator is a frozen dataclass of its parameters. What it remembers is a `State`; the same
compiled kernel makes ``run``, ``advance``, ``step`` and the ``tracker``, so all four agree to
the last bit.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._from_sensor import Noisy as Noisy
from strapdown._from_sensor import Taken as Taken
from strapdown._from_sensor import parameters_of
from strapdown._tracker import ABSENT, NO_VECTOR, as_kernel_input, wrong_lengths
from strapdown._tracker import State as State
from strapdown._tracker import Tracker as Tracker
from strapdown._types import FloatArray, IntArray
from strapdown.errors import MissingStream
from strapdown.kernels import memory as _m
from strapdown.kernels import status as _s
from strapdown.kernels._jit import is_compiled
from strapdown.recording import Imu, Recording
from strapdown.solution import COLUMNS, Diagnostics, Solution

_NO_TIMES: FloatArray = np.empty(0)
_NO_ROWS: FloatArray = np.empty((0, 3))
_NO_EVENTS: FloatArray = np.empty((0, 3))
_NO_DIAGNOSTICS: FloatArray = np.empty((0, _m.W_HEAD))

# Where the arrays of a solution stand in the memory.
CELLS: Mapping[str, int] = {
    "q_nb": _m.Q,
    "gyr_bias": _m.BG,
    "std_attitude_n": _m.STD_ATT,
    "std_gyr_bias": _m.STD_BG,
    "lla": _m.LLA,
    "v_n": _m.V,
    "std_position_n": _m.STD_POS,
    "std_velocity_n": _m.STD_V,
    "acc_bias": _m.BA,
    "std_acc_bias": _m.STD_BA,
    "q_vb": _m.Q_VB,
}


class KernelModule(Protocol):
    """What a module under `strapdown.kernels` offers to be an estimator."""

    W_SIZE: int
    run: Any
    step: Any
    update: Any


class Estimator:
    """Base of all estimators: a frozen dataclass of parameters with pure methods.

    A subclass gives its kernel module, its parameter vector and its empty memory; batch,
    pieces, single samples and the tracker follow from them.
    """

    __slots__ = ("_kept", "_sizes")
    _kept: tuple[Any, FloatArray, FloatArray]  # what `_ready` makes; not a parameter
    _sizes: tuple[tuple[int, ...], tuple[int, ...]]
    NAME: ClassVar[str]
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias")
    LABELS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "acc": ("x", "y", "z"),
        "mag": ("x", "y", "z"),
    }
    # Where the innovations, sigmas and outcome of each sensor stand in a row of the diagnostics.
    DIAGNOSED: ClassVar[Mapping[str, int]] = {"acc": _m.D_ACC, "mag": _m.D_MAG}
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = ()

    @classmethod
    def from_sensor(cls, sensor: Noisy, **parameters: Any) -> Self:
        """Return the estimator with the noise of a sensor for its noise parameters.

        Which parameters those are stands in ``FROM_SENSOR``. A noise that the sensor does not
        state leaves the default. A parameter that also stands for motion, vibration or a
        disturbed field is never below its default: a datasheet knows the sensor lying still.

        Parameters
        ----------
        sensor : Device or NoiseRecord
            ``strapdown.sensors.preset("mpu6050")``, or ``strapdown.noise.load("noise.toml")``.
        **parameters
            Fields of its dataclass, which win.

        Returns
        -------
        Estimator

        Raises
        ------
        ValueError
            If the estimator has no noise parameter, or the sensor states none of its noises.
        TypeError
            If `sensor` is neither a device nor a noise record.
        """
        if not cls.FROM_SENSOR:
            takers = (e.name for e in entries() if e.cls.FROM_SENSOR)
            raise ValueError(
                f"{cls.NAME} has no noise parameter that a sensor could fill; set its gains, or "
                f"take one of {', '.join(takers)}."
            )
        return cls(**{**parameters_of(cls, sensor), **parameters})

    @staticmethod
    def _kernel() -> Any:
        """Return the kernel module."""
        raise NotImplementedError

    def _params(self) -> FloatArray:
        """Return the parameter vector `p` of the kernel."""
        raise NotImplementedError

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        """Return `x` and `P` before the first sample."""
        x = np.zeros(_m.HEAD)
        x[_m.T] = np.nan
        x[_m.Q] = x[_m.Q_VB] = 1.0
        x[_m.STATUS] = _s.ALIGNING
        return x, np.zeros((0, 0))

    def init(self, *, attitude: ArrayLike | None = None) -> State:
        """Return the state before the first sample.

        Parameters
        ----------
        attitude : array_like, shape (4,), optional
            Known q_nb; without it alignment is part of the state.

        Returns
        -------
        State
        """
        x, P = self._memory()
        if attitude is not None:
            x[_m.Q : _m.Q + 4] = _checks.as_quats(
                "attitude", _checks.as_vector("attitude", attitude, 4)
            )
            x[_m.ALIGNED] = _m.GIVEN
            x[_m.STATUS] = 0.0
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
            Later than `state`; may be empty.
        diagnostics : bool
            Whether to keep a row per measurement.

        Returns
        -------
        Solution, State
            What it believes at each IMU sample, and what it remembers after the last.

        Raises
        ------
        MissingStream
            If the recording lacks a stream that the estimator needs.
        ValueError
            If the recording begins before the state ends, or the state is another estimator's.
        """
        _checks.recording("rec", rec)
        state = self._own(state)
        x, P = state.x.copy(), state.P.copy()
        imu = rec.need("imu")
        for name in entry(self.NAME).needs:
            rec.need(name)
        if len(imu) and imu.t[0] <= state.t:
            raise ValueError(f"`rec` must begin after the state, got {imu.t[0]} after {state.t}.")
        mag = rec.mag
        t_mag, field = (_NO_TIMES, _NO_ROWS) if mag is None else (mag.t, mag.mag)
        gyr, acc = real_samples(imu)
        last = max(CELLS[name] + len(COLUMNS[name]) for name in self.OUTPUTS)
        out = np.empty((len(imu), last - _m.STATUS))
        width = max(self.DIAGNOSED.values()) + 7
        diag = np.empty((len(imu), width)) if diagnostics else _NO_DIAGNOSTICS
        kernel = self._kernel()
        events = self._events(rec)
        kernel.run(
            x, P, self._params(), np.zeros(kernel.W_SIZE),
            imu.t, gyr, acc, t_mag, field, events, out, diag,
        )  # fmt: skip
        rows = _diagnostics(imu.t, diag, self.DIAGNOSED, self.LABELS) if diagnostics else {}
        return self._solution(rec, imu.t, out, rows), State(self.NAME, x, P)

    def run(self, rec: Recording, *, diagnostics: bool = True) -> Solution:
        """Estimate over a whole recording: ``advance(init(), rec)[0]``.

        Parameters
        ----------
        rec : Recording
            With all streams that the estimator needs.
        diagnostics : bool
            Whether to keep a row per measurement.

        Returns
        -------
        Solution
        """
        return self.advance(self.init(), rec, diagnostics=diagnostics)[0]

    def step(
        self,
        state: State,
        t: float,
        gyr: ArrayLike | None,
        acc: ArrayLike | None,
        mag: ArrayLike | None = None,
        **aiding: ArrayLike,
    ) -> State:
        """Return the state after one more IMU sample; `state` is left as it was.

        Parameters
        ----------
        state : State
            After the sample before.
        t : float
            Time [s].
        gyr : array_like, shape (3,), or None
            Angular rate [rad/s]; None where a slower gyroscope has no new sample: the last
            rate is held.
        acc : array_like, shape (3,), or None
            Specific force [m/s^2]; None where a slower accelerometer has no new sample.
        mag : array_like, shape (3,), optional
            Field [T] that came since the last sample.
        **aiding
            Other aiding that came, by stream: ``star`` q_nb (4,), ``gnss`` (14,) as
            (t, lla, v_n, std_position_n, std_velocity_n, heading), ``baro`` [Pa],
            ``speed`` and ``airspeed`` [m/s].

        Returns
        -------
        State
        """
        state = self._own(state)
        x, P = state.x.copy(), state.P.copy()
        if t <= x[_m.T] or not math.isfinite(t):
            raise ValueError(f"`t` must increase, got {t} after {state.t}.")
        for name, value in aiding.items():
            cell, count = _INBOX[_checks.one_of("aiding", name, _INBOX)]
            x[cell] = 1.0
            x[cell + 1 : cell + 1 + count] = _checks.as_vector(
                name, np.atleast_1d(np.asarray(value, dtype=np.float64)), count, allow_nan=True
            )
        update, p, w = self._ready()
        if mag is None:
            mag = NO_VECTOR
        if acc is None:
            acc = ABSENT
        if gyr is None:
            gyr = ABSENT
        try:
            ok = update(x, P, p, w, t, gyr, acc, mag)
        except TypeError:  # not float64 vectors
            t, gyr, acc, mag = as_kernel_input(t, gyr, acc, mag)
            ok = update(x, P, p, w, t, gyr, acc, mag)
        if not ok:
            raise wrong_lengths(gyr, acc, mag)
        return State(state.name, x, P)

    def tracker(self, state: State | None = None) -> Tracker:
        """Return the stateful form, for real-time code.

        Parameters
        ----------
        state : State, optional
            Where to begin.

        Returns
        -------
        Tracker
        """
        return Tracker(self, state)

    def parameters(self) -> dict[str, Any]:
        """Return the parameters by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]

    def _ready(self) -> tuple[Any, FloatArray, FloatArray]:
        """Return the kernel of a single sample, its parameters and its scratch, made once."""
        try:
            return self._kept
        except AttributeError:
            kernel = self._kernel()
            x, P = self._memory()
            p, w, zero = self._params(), np.zeros(kernel.W_SIZE), np.zeros(3)
            kernel.update(x, P, p, w, 0.0, zero, zero, zero)
            # From now on other types are refused, not compiled for: they are converted then.
            if hasattr(kernel.update, "disable_compile"):
                kernel.update.disable_compile()
            object.__setattr__(self, "_kept", (kernel.update, p, w))
            return kernel.update, p, w

    def _own(self, state: State) -> State:
        """Return the state if it is this estimator's; a restored name may be an array."""
        _checks.instance("state", state, State, "`init`, `advance` and `step` give one")
        if state.name != self.NAME:
            raise ValueError(f"`state` must belong to {self.NAME}, got one of {state.name}.")
        if (state.x.shape, state.P.shape) != self._shapes():  # kernels check no index
            x, P = self._shapes()
            raise ValueError(
                f"`state` must have x of shape {x} and P of shape {P}, got {state.x.shape} and "
                f"{state.P.shape}; another version or other parameters may have made it."
            )
        return state

    def _shapes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the shapes of `x` and `P`, made once."""
        try:
            return self._sizes
        except AttributeError:
            x, P = self._memory()
            object.__setattr__(self, "_sizes", (x.shape, P.shape))
            return x.shape, P.shape

    def _events(self, rec: Recording) -> FloatArray:
        """Return the rare aiding that the estimator uses, as rows for `load_events`."""
        return _NO_EVENTS

    def _heading_reference(self, rec: Recording) -> str:
        """Return what the heading of a solution is measured from."""
        return "arbitrary"

    def _solution(
        self, rec: Recording, t: FloatArray, out: FloatArray, rows: Mapping[str, Diagnostics]
    ) -> Solution:
        """Return the solution whose arrays stand in the columns of `out`."""
        arrays: dict[str, Any] = {}
        for name in self.OUTPUTS:
            first = CELLS[name] - _m.STATUS
            arrays[name] = out[:, first : first + len(COLUMNS[name])]
        return Solution(
            t=t,
            status=out[:, 0].astype(np.int64),
            filter=self.NAME,
            causal=True,
            heading_reference=self._heading_reference(rec),
            diagnostics=rows,
            meta={"parameters": self.parameters(), **kept_facts(rec)},
            **arrays,
        )


def real_samples(imu: Imu) -> tuple[FloatArray, FloatArray]:
    """Return rates and specific forces as kernels take them: held samples are infinite.

    Parameters
    ----------
    imu : Imu
        With masks of the real samples, or without.

    Returns
    -------
    gyr, acc : ndarray, shape (n, 3)
    """
    gyr, acc = imu.gyr, imu.acc
    if imu.gyr_real is not None:
        gyr = np.where(imu.gyr_real[:, None], gyr, np.inf)
    if imu.acc_real is not None:
        acc = np.where(imu.acc_real[:, None], acc, np.inf)
    return gyr, acc


def kept_facts(rec: Recording) -> dict[str, Any]:
    """Return what a solution keeps of its recording's metadata: when ``t = 0`` was.

    Parameters
    ----------
    rec : Recording
        What was estimated from.

    Returns
    -------
    dict
    """
    return {key: rec.meta[key] for key in ("epoch_utc",) if rec.meta.get(key)}


_INBOX: Mapping[str, tuple[int, int]] = {
    "star": (_m.STAR, 4),
    "gnss": (_m.GNSS, 14),
    "baro": (_m.BARO, 1),
    "speed": (_m.SPEED, 1),
    "airspeed": (_m.AIRSPEED, 1),
}


def _diagnostics(
    t: FloatArray,
    diag: FloatArray,
    cells: Mapping[str, int],
    labels: Mapping[str, tuple[str, ...]],
) -> dict[str, Diagnostics]:
    """Return the rows at which there was a measurement, by sensor."""
    found = {}
    for name, cell in cells.items():
        outcome: IntArray = diag[:, cell + 6].astype(np.int64)
        rows = np.flatnonzero(outcome != _s.NOT_MEASURED)
        if len(rows):
            n = len(labels[name])
            found[name] = Diagnostics(
                t=t[rows],
                innovation=diag[rows, cell : cell + n],
                sigma=diag[rows, cell + 3 : cell + 3 + n],
                outcome=outcome[rows],
                labels=labels[name],
            )
    return found


# --- registry ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """What the registry knows of an estimator.

    Attributes
    ----------
    name : str
        What users type.
    cls : type
        Its class.
    needs, uses : tuple of str
        Streams it cannot do without besides the IMU, and those it takes if present.
    gives : {'attitude', 'navigation'}
        What its solution holds.
    source : str
        Thesis and section, or paper.
    cost : str
        What a sample costs, in words.
    rank : int
        Among those whose needs a recording meets, the highest is preferred.
    """

    name: str
    cls: type[Estimator]
    needs: tuple[str, ...]
    uses: tuple[str, ...]
    gives: str
    source: str
    cost: str
    rank: int

    @property
    def smooths(self) -> bool:
        """Whether it has an offline twin."""
        return hasattr(self.cls, "smooth")

    @property
    def summary(self) -> str:
        """First line of its docstring."""
        return (self.cls.__doc__ or "").strip().splitlines()[0]

    def is_compiled(self) -> bool:
        """Whether its kernel runs at once, without compiling first."""
        return is_compiled(self.cls._kernel().run)


_ENTRIES: dict[str, Entry] = {}
_PROVIDERS = ("strapdown.attitude", "strapdown.navigation")  # they register when imported
E = TypeVar("E", bound=type[Estimator])


def register(
    *,
    source: str,
    cost: str,
    needs: tuple[str, ...] = (),
    uses: tuple[str, ...] = (),
    gives: str = "attitude",
    rank: int = 0,
) -> Any:
    """Return a class decorator that enters an estimator under its ``NAME``.

    Parameters
    ----------
    source, cost, needs, uses, gives, rank
        See `Entry`.
    """

    def enter(cls: E) -> E:
        if cls.NAME in _ENTRIES and _ENTRIES[cls.NAME].cls.__qualname__ != cls.__qualname__:
            raise ValueError(f"`NAME` must be unique, got {cls.NAME!r} twice.")
        _ENTRIES[cls.NAME] = Entry(
            name=cls.NAME, cls=cls, needs=needs, uses=uses, gives=gives,
            source=source, cost=cost, rank=rank,
        )  # fmt: skip
        return cls

    return enter


def _loaded() -> dict[str, Entry]:
    """Return the entries after all providers had their say."""
    for module in _PROVIDERS:
        _import(module)
    return _ENTRIES


def _import(module: str) -> ModuleType | None:
    """Import a provider; None if this version does not have it."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None


def names() -> tuple[str, ...]:
    """Return the names of all estimators."""
    return tuple(sorted(_loaded()))


def entries() -> Iterator[Entry]:
    """Yield what the registry knows of each estimator, by name."""
    for name in names():
        yield _ENTRIES[name]


def entry(name: str) -> Entry:
    """Return what the registry knows of `name`.

    Raises
    ------
    ValueError
        If there is none; the nearest name is offered.
    """
    if name not in _ENTRIES:
        _checks.one_of("filter", name, names())
    return _ENTRIES[name]


def create(name: str, **parameters: Any) -> Any:
    """Return the estimator `name` with the given parameters.

    Parameters
    ----------
    name : str
        As in `names`.
    **parameters
        Fields of its dataclass.

    Returns
    -------
    Estimator

    Raises
    ------
    ValueError
        If the name or a parameter is not there, or a value is out of range.
    """
    cls = entry(name).cls
    known = [f.name for f in fields(cls)]  # type: ignore[arg-type]
    for key in parameters:
        if key not in known:
            raise ValueError(
                f"`{key}` must be a parameter of {name} ({', '.join(known)})"
                f"{_checks.nearest(key, known)}."
            )
    return cls(**parameters)


def preferred(rec: Recording) -> str:
    """Return the name of the estimator that suits the streams of a recording best.

    Parameters
    ----------
    rec : Recording
        What there is.

    Returns
    -------
    str

    Raises
    ------
    MissingStream
        If the recording has no inertial stream.
    """
    _checks.recording("rec", rec)
    rec.need("imu")
    fit = [e for e in entries() if all(getattr(rec, stream) is not None for stream in e.needs)]
    if not fit:
        raise MissingStream("no estimator fits the streams of the recording.")
    return max(fit, key=lambda e: e.rank).name
