"""Which systems there are, and which experiments each has."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from strapdown import _checks
from strapdown.systems._rows import Shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """An experiment of a thesis.

    Attributes
    ----------
    name : str
        What users type after ``--part``.
    title : str
        What it shows, with the tables and figures it covers.
    source : str
        Sections of the thesis.
    run : callable
        Takes a seed, returns what it shows.
    """

    name: str
    title: str
    source: str
    run: Callable[[int], Shown]


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """A device that a thesis built.

    Attributes
    ----------
    name : str
        What users type.
    title : str
        What it is.
    """

    name: str
    title: str


SYSTEMS: Mapping[str, System] = {
    system.name: system
    for system in (
        System(name="platform", title="Attitude unit of a spacecraft simulator's platform"),
        System(name="kinematic", title="Low-cost sensor for human motion"),
        System(name="indoor", title="Attitude unit of an indoor explorer"),
        System(name="uav", title="Standard and multi-mode AHRS of a micro UAV"),
        System(name="gnssins", title="Low-cost integrated GNSS/INS"),
    )
}


def parts(system: str, name: str | None = None) -> tuple[Part, ...]:
    """Return the experiments of a system.

    Parameters
    ----------
    system : str
        One of `SYSTEMS`.
    name : str, optional
        One experiment only.

    Returns
    -------
    tuple of Part

    Raises
    ------
    ValueError
        If there is no such system or experiment.
    """
    _checks.one_of("system", system, tuple(SYSTEMS))
    found: tuple[Part, ...] = import_module(f"strapdown.systems.{system}").PARTS
    if name is None:
        return found
    _checks.one_of("part", name, tuple(part.name for part in found))
    return tuple(part for part in found if part.name == name)
