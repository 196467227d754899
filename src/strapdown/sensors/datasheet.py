"""Datasheet figures as the sources print them, and their way to SI."""

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from strapdown import _checks
from strapdown.errors import InputError
from strapdown.units import parse_unit

_SQRT_HZ = "_sqrt_hz"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a datasheet.

    Attributes
    ----------
    sensor : str
        ``gyr``, ``acc``, ``mag``, ``gnss``, ``encoder``, ``star``, ``temperature`` or
        ``device``.
    quantity, condition : str
        What it is, and where it holds; of a figure without a number, what is said.
    least, typical, most : float or None
        The values in their unit; None where none is given.
    unit : str
        As printed, in this package's spelling.
    """

    sensor: str
    quantity: str
    condition: str
    least: float | None
    typical: float | None
    most: float | None
    unit: str

    @property
    def value(self) -> float:
        """The typical value in SI, or else the largest, or else the least."""
        for given in (self.typical, self.most, self.least):
            if given is not None:
                return si_value(given, self.unit)
        raise InputError(f"{self.sensor} {self.quantity!r} ({self.condition}) has no number.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Datasheet:
    """All figures of one type of sensor, with where they come from.

    Attributes
    ----------
    name, title, source : str
        Name of the preset, what it is, and which pages the figures were taken from.
    figures : tuple of Figure
        In the order of the source.
    """

    name: str
    title: str
    source: str
    figures: tuple[Figure, ...]

    def find(self, sensor: str, quantity: str, condition: str = "") -> tuple[Figure, ...]:
        """Return the figures of a quantity whose condition holds the given words.

        Raises
        ------
        InputError
            If there is none; the nearest quantity is offered.
        """
        found = tuple(
            figure
            for figure in self.figures
            if (figure.sensor, figure.quantity) == (sensor, quantity)
            and condition in figure.condition
        )
        if not found:
            known = [f.quantity for f in self.figures if f.sensor == sensor]
            raise InputError(
                f"the datasheet of {self.name} has no {quantity!r} of {sensor}"
                f"{' (' + condition + ')' if condition else ''}{_checks.nearest(quantity, known)}."
            )
        return found

    def value(self, sensor: str, quantity: str, condition: str = "") -> float:
        """Return the first such figure, in SI."""
        return self.find(sensor, quantity, condition)[0].value

    def values(self, sensor: str, quantity: str, condition: str = "") -> tuple[float, ...]:
        """Return all such figures, in SI, such as one per axis."""
        return tuple(figure.value for figure in self.find(sensor, quantity, condition))


def si_value(value: float, unit: str) -> float:
    """Return a figure in SI; knows units per count, per degree and squared ones too.

    Parameters
    ----------
    value : float
        The number.
    unit : str
        ``"dps"``, ``"LSB/dps"`` (which becomes SI per count), ``"mg/degc"``, ``"dps/g"``,
        ``"g^2"``, ``"% FS"``.

    Returns
    -------
    float

    Examples
    --------
    >>> round(si_value(16384, "LSB/g"), 6)  # m/s^2 per count
    0.000599
    """
    if unit == "":
        return value
    if unit.startswith("LSB/"):
        return _factor(unit[4:]) / value
    return value * _factor(unit)


def _factor(unit: str) -> float:
    """Return the size of a unit in SI."""
    unit = unit.removesuffix(" rms")
    if unit in ("% FS", "%"):
        return 0.01
    if unit in ("LSB", "SPS", "1"):
        return 1.0
    if unit in ("mA", "uA"):
        return 1e-3 if unit == "mA" else 1e-6
    if unit.endswith("^2"):
        return _factor(unit[:-2].strip("()")) ** 2
    if "/" in unit:
        top, below = unit.split("/")
        return _factor(top) / (1.0 if below in ("LSB", "degc") else _factor(below))
    if unit.endswith("_per" + _SQRT_HZ):  # a density has its quantity's factor
        return parse_unit(unit.removesuffix("_per" + _SQRT_HZ)).factor
    if unit.endswith(_SQRT_HZ):
        return parse_unit(unit.removesuffix(_SQRT_HZ)).factor
    return parse_unit(unit.lower()).factor


def datasheet(name: str) -> Datasheet:
    """Return the datasheet of a preset.

    Raises
    ------
    ValueError
        If there is none of this name; the nearest one is offered.
    """
    return _datasheet(_checks.one_of("name", name, datasheet_names()))


@lru_cache(maxsize=32)
def _datasheet(name: str) -> Datasheet:
    text = (files("strapdown.sensors") / "datasheets" / f"{name}.toml").read_text("utf-8")
    table = tomllib.loads(text)
    figures = tuple(
        Figure(
            sensor=sensor,
            quantity=quantity,
            condition=condition,
            least=_number(least),
            typical=_number(typical),
            most=_number(most),
            unit=unit,
        )
        for sensor, quantity, condition, least, typical, most, unit in table["figures"]
    )
    return Datasheet(
        name=table["name"], title=table["title"], source=table["source"], figures=figures
    )


def datasheet_names() -> tuple[str, ...]:
    """Return the names of all datasheets."""
    folder = files("strapdown.sensors") / "datasheets"
    return tuple(
        sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))
    )


def _number(value: float | str) -> float | None:
    return None if isinstance(value, str) else float(value)
