"""What a simulator knows: the exact motion of the box."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from strapdown import _checks
from strapdown._types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Exact motion on one time axis.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s].
    q_nb : ndarray, shape (n, 4)
        Attitude, body to NED.
    omega_ib_b : ndarray, shape (n, 3)
        Angular rate of b relative to inertial space at `t` [rad/s].
    f_b : ndarray, shape (n, 3)
        Specific force at `t` [m/s^2].
    lla : ndarray, shape (n, 3)
        Latitude, longitude, height of the box [rad, rad, m].
    v_n : ndarray, shape (n, 3)
        Velocity over ground, north, east, down [m/s].
    m_n : ndarray, shape (n, 3)
        Magnetic field, north, east, down [T].
    meta : mapping
        Name, epoch and settings of the scenario.
    """

    t: FloatArray
    q_nb: FloatArray
    omega_ib_b: FloatArray
    f_b: FloatArray
    lla: FloatArray
    v_n: FloatArray
    m_n: FloatArray
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes and values."""
        n = len(_checks.as_times("t", self.t))
        for name in ("omega_ib_b", "f_b", "lla", "v_n", "m_n"):
            array = _checks.as_samples(name, getattr(self, name))
            object.__setattr__(self, name, array)
        object.__setattr__(self, "q_nb", _checks.as_quats("q_nb", self.q_nb))
        for name in ("q_nb", "omega_ib_b", "f_b", "lla", "v_n", "m_n"):
            if len(getattr(self, name)) != n:
                raise ValueError(
                    f"`{name}` must have as many rows as `t`, got {len(getattr(self, name))} "
                    f"and {n}."
                )
