"""Units at the borders: inside the package everything is SI and radians.

A factor turns a number in that unit into SI: ``30 * DEG`` is in radians and
``omega / DPS`` in degrees per second. `parse_unit` finds a unit by any of its
common spellings, for headers of files and options of commands.

>>> from strapdown.units import DEG, parse_unit
>>> round(180 * DEG, 6)
3.141593
>>> parse_unit("deg/s").name
'dps'
>>> parse_unit("g", quantity="acceleration").to_si(1.0)
9.80665
"""

import math
import re
from dataclasses import dataclass
from typing import Final, Literal, TypeVar, get_args

from strapdown._checks import nearest, one_of
from strapdown._types import FloatArray
from strapdown.constants import G0, ZERO_CELSIUS
from strapdown.errors import InputError

# --- time -------------------------------------------------------------------------------
MS: Final = 1e-3
US: Final = 1e-6
NS: Final = 1e-9
MINUTE: Final = 60.0
HOUR: Final = 3600.0
DAY: Final = 86_400.0

# --- angle and angular rate -------------------------------------------------------------
DEG: Final = math.pi / 180.0
ARCMIN: Final = DEG / 60.0
ARCSEC: Final = DEG / 3600.0
TURN: Final = 2.0 * math.pi
DPS: Final = DEG  # degrees per second
MDPS: Final = 1e-3 * DEG
RPM: Final = TURN / MINUTE
DEG_PER_HR: Final = DEG / HOUR

# --- specific force ---------------------------------------------------------------------
MG: Final = 1e-3 * G0  # milli-g, not milligauss
UG: Final = 1e-6 * G0

# --- magnetic flux density --------------------------------------------------------------
GAUSS: Final = 1e-4
MILLIGAUSS: Final = 1e-7
MT: Final = 1e-3
UT: Final = 1e-6
NT: Final = 1e-9

# --- length, speed, pressure ------------------------------------------------------------
MM: Final = 1e-3
CM: Final = 1e-2
KM: Final = 1e3
FOOT: Final = 0.3048
NAUTICAL_MILE: Final = 1852.0
KMH: Final = KM / HOUR
KNOT: Final = NAUTICAL_MILE / HOUR
MPH: Final = 1609.344 / HOUR
HPA: Final = 100.0
KPA: Final = 1e3

# --- noise: amplitude densities (root of a power density) -------------------------------
DEG_PER_SQRT_HR: Final = DEG / 60.0  # angle random walk -> rad/s/sqrt(Hz); 60 = sqrt(3600)
DPS_PER_SQRT_HZ: Final = DEG  # rate noise density -> rad/s/sqrt(Hz)
UG_PER_SQRT_HZ: Final = UG  # acceleration noise density -> m/s^2/sqrt(Hz)
MPS_PER_SQRT_HR: Final = 1.0 / 60.0  # velocity random walk -> m/s^2/sqrt(Hz)
NT_PER_SQRT_HZ: Final = NT  # magnetic noise density -> T/sqrt(Hz)

Quantity = Literal[
    "time",
    "frequency",
    "angle",
    "angular_rate",
    "acceleration",
    "magnetic_field",
    "length",
    "speed",
    "pressure",
    "temperature",
    "voltage",
    "angular_rate_density",
    "acceleration_density",
    "magnetic_field_density",
    "dimensionless",
]
QUANTITIES: Final[tuple[str, ...]] = get_args(Quantity)

Number = TypeVar("Number", float, FloatArray)


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of measurement: ``si = value * factor + offset``.

    Parameters
    ----------
    name : str
        Name as column names carry it: ``gyr_x_dps`` is in ``dps``.
    symbol : str
        Symbol as text and plots show it.
    quantity : str
        What it measures; one of `QUANTITIES`.
    factor : float
        Size of the unit in SI.
    offset : float
        Its zero in SI. Temperature alone has one; its SI here is degC.
    spellings : tuple of str
        Other ways to write it.
    """

    name: str
    symbol: str
    quantity: Quantity
    factor: float = 1.0
    offset: float = 0.0
    spellings: tuple[str, ...] = ()

    def to_si(self, value: Number) -> Number:
        """Return `value`, given in this unit, in SI."""
        if self.offset:
            return value * self.factor + self.offset
        return value if self.factor == 1.0 else value * self.factor

    def from_si(self, value: Number) -> Number:
        """Return `value`, given in SI, in this unit."""
        if self.offset:
            return (value - self.offset) / self.factor
        return value if self.factor == 1.0 else value / self.factor


# The first unit of a quantity is its SI unit. Spellings are compared as `_key` makes them:
# upper and lower case count only where a quantity needs them (mT is not MT).
# fmt: off
UNITS: Final[tuple[Unit, ...]] = (
    Unit("s", "s", "time", spellings=("sec", "secs", "second", "seconds")),
    Unit("ms", "ms", "time", MS, spellings=("msec", "millis", "millisecond", "milliseconds")),
    Unit("us", "µs", "time", US,
         spellings=("usec", "micros", "microsec", "microsecond", "microseconds")),
    Unit("ns", "ns", "time", NS, spellings=("nsec", "nanos", "nanosecond", "nanoseconds")),
    Unit("min", "min", "time", MINUTE, spellings=("minute", "minutes")),
    Unit("hr", "h", "time", HOUR, spellings=("hour", "hours")),
    Unit("day", "d", "time", DAY, spellings=("days",)),

    Unit("hz", "Hz", "frequency", spellings=("hertz", "1/s", "sps")),
    Unit("khz", "kHz", "frequency", 1e3),

    Unit("rad", "rad", "angle", spellings=("radian", "radians")),
    Unit("deg", "°", "angle", DEG, spellings=("degree", "degrees")),
    Unit("mrad", "mrad", "angle", 1e-3),
    Unit("arcmin", "arcmin", "angle", ARCMIN, spellings=("'", "arcminutes")),
    Unit("arcsec", "arcsec", "angle", ARCSEC, spellings=('"', "arcseconds")),
    Unit("turn", "turn", "angle", TURN, spellings=("rev", "revolution", "revolutions", "turns")),
    Unit("deg_1e7", "1e-7 °", "angle", 1e-7 * DEG, spellings=("1e-7deg", "dege7", "deg*1e7")),

    Unit("rad_s", "rad/s", "angular_rate",
         spellings=("rad/sec", "rad/second", "radps", "rads-1", "rad.s-1", "radian/s",
                    "radians/s", "radians/second")),
    Unit("dps", "°/s", "angular_rate", DPS,
         spellings=("deg/sec", "deg/second", "degps", "degs-1", "deg.s-1", "deg_s", "degree/s",
                    "degree/sec", "degrees/s", "degrees/sec", "degrees/second")),
    Unit("mdps", "m°/s", "angular_rate", MDPS),
    Unit("mrad_s", "mrad/s", "angular_rate", 1e-3),
    Unit("rpm", "rpm", "angular_rate", RPM, spellings=("rev/min", "1/min")),
    Unit("deg_per_hr", "°/h", "angular_rate", DEG_PER_HR,
         spellings=("deg/h", "deg/hr", "deg/hour", "dph", "degree/h", "degrees/hour")),

    Unit("m_s2", "m/s²", "acceleration",
         spellings=("m/s/s", "m/sec^2", "m/sec/sec", "ms^-2", "m.s^-2", "mps2", "mpss", "ms2",
                    "m_s_2", "meters/second^2", "metres/second^2")),
    Unit("g", "g", "acceleration", G0, spellings=("g0", "gn", "gee", "gees", "g-force")),
    Unit("mg", "mg", "acceleration", MG, spellings=("millig", "milli-g")),
    Unit("ug", "µg", "acceleration", UG, spellings=("microg", "micro-g")),
    Unit("cm_s2", "cm/s²", "acceleration", CM, spellings=("gal",)),

    Unit("t", "T", "magnetic_field", spellings=("tesla",)),
    Unit("mt", "mT", "magnetic_field", MT, spellings=("millitesla",)),
    Unit("ut", "µT", "magnetic_field", UT, spellings=("microtesla", "utesla")),
    Unit("nt", "nT", "magnetic_field", NT, spellings=("nanotesla", "gamma")),
    Unit("gauss", "G", "magnetic_field", GAUSS, spellings=("g", "gs", "ga")),
    Unit("mgauss", "mG", "magnetic_field", MILLIGAUSS,
         spellings=("mg", "milligauss", "mga", "mgs")),

    Unit("m", "m", "length", spellings=("meter", "meters", "metre", "metres")),
    Unit("mm", "mm", "length", MM),
    Unit("cm", "cm", "length", CM),
    Unit("km", "km", "length", KM),
    Unit("ft", "ft", "length", FOOT, spellings=("foot", "feet")),
    Unit("nmi", "NM", "length", NAUTICAL_MILE, spellings=("nm",)),

    Unit("m_s", "m/s", "speed",
         spellings=("mps", "m/sec", "ms-1", "m.s-1", "meters/second", "meter/s", "metres/second")),
    Unit("mm_s", "mm/s", "speed", MM, spellings=("mm/s",)),
    Unit("cm_s", "cm/s", "speed", CM, spellings=("cm/s",)),
    Unit("kmh", "km/h", "speed", KMH, spellings=("km/h", "kph", "km/hr", "km_h", "kmph")),
    Unit("kn", "kn", "speed", KNOT, spellings=("kt", "kts", "knot", "knots")),
    Unit("mph", "mph", "speed", MPH, spellings=("mi/h", "miles/hour")),
    Unit("ft_s", "ft/s", "speed", FOOT, spellings=("ft/s", "fps")),

    Unit("pa", "Pa", "pressure", spellings=("pascal", "n/m^2")),
    Unit("hpa", "hPa", "pressure", HPA, spellings=("mbar", "millibar", "mb")),
    Unit("kpa", "kPa", "pressure", KPA),
    Unit("bar", "bar", "pressure", 1e5),
    Unit("psi", "psi", "pressure", 6894.757293168361),
    Unit("mmhg", "mmHg", "pressure", 133.322387415),
    Unit("inhg", "inHg", "pressure", 3386.388640341),

    Unit("degc", "°C", "temperature", spellings=("c", "celsius", "deg_c")),
    Unit("k", "K", "temperature", 1.0, -ZERO_CELSIUS, spellings=("kelvin", "degk")),
    Unit("degf", "°F", "temperature", 5.0 / 9.0, -160.0 / 9.0,
         spellings=("f", "fahrenheit", "deg_f")),

    Unit("v", "V", "voltage", spellings=("volt", "volts")),
    Unit("mv", "mV", "voltage", 1e-3, spellings=("millivolt",)),

    Unit("rad_s_per_sqrt_hz", "rad/s/√Hz", "angular_rate_density",
         spellings=("rad/√s", "rad_per_sqrt_s")),
    Unit("dps_per_sqrt_hz", "°/s/√Hz", "angular_rate_density", DPS_PER_SQRT_HZ,
         spellings=("deg/√s",)),
    Unit("mdps_per_sqrt_hz", "m°/s/√Hz", "angular_rate_density", MDPS),
    Unit("deg_per_sqrt_hr", "°/√h", "angular_rate_density", DEG_PER_SQRT_HR),

    Unit("m_s2_per_sqrt_hz", "m/s²/√Hz", "acceleration_density", spellings=("m/s/√s",)),
    Unit("ug_per_sqrt_hz", "µg/√Hz", "acceleration_density", UG_PER_SQRT_HZ),
    Unit("mg_per_sqrt_hz", "mg/√Hz", "acceleration_density", MG),
    Unit("m_s_per_sqrt_hr", "m/s/√h", "acceleration_density", MPS_PER_SQRT_HR,
         spellings=("m/s/√hr",)),

    Unit("t_per_sqrt_hz", "T/√Hz", "magnetic_field_density"),
    Unit("ut_per_sqrt_hz", "µT/√Hz", "magnetic_field_density", UT),
    Unit("nt_per_sqrt_hz", "nT/√Hz", "magnetic_field_density", NT_PER_SQRT_HZ),

    Unit("1", "1", "dimensionless", spellings=("-", "none", "unitless", "ratio")),
    Unit("percent", "%", "dimensionless", 1e-2, spellings=("%", "pct")),
    Unit("ppm", "ppm", "dimensionless", 1e-6),
)
# fmt: on


_ALPHABET = str.maketrans({"µ": "u", "μ": "u", "°": "deg", "º": "deg", "√": "rt", "·": ".",
                           "⁻": "-", "¹": "1", "²": "2"})  # fmt: skip


def _key(text: str) -> str:
    """Return the form in which spellings are compared: ASCII, lower case, bare."""
    key = re.sub(r"[\s()\[\]{}^*]+", "", text.translate(_ALPHABET)).lower()
    key = re.sub(r"_?per_?", "/", key) if key != "percent" else key
    return re.sub(r"(sqrt|root|rt)[-_]?", "rt", key)


def _index() -> dict[str, list[Unit]]:
    """Return the units that each spelling can mean."""
    index: dict[str, list[Unit]] = {}
    for unit in UNITS:
        for key in {_key(text) for text in (unit.name, unit.symbol, *unit.spellings)}:
            index.setdefault(key, []).append(unit)
    return index


_BY_KEY: Final = _index()


def units_of(quantity: str) -> tuple[Unit, ...]:
    """Return the units of a quantity, its SI unit first."""
    one_of("quantity", quantity, QUANTITIES)
    return tuple(unit for unit in UNITS if unit.quantity == quantity)


def parse_unit(text: str, quantity: str | None = None) -> Unit:
    """Return the unit that `text` spells.

    Parameters
    ----------
    text : str
        A unit in a common spelling: ``deg/s``, ``°/s``, ``dps``, ``m/s^2``, ``uT``.
        Upper and lower case matter only where they tell two units apart.
    quantity : str, optional
        What must be measured; one of `QUANTITIES`. It decides what ``g`` or ``mG``
        means; without it, ``g`` is the acceleration and ``G`` is gauss.

    Returns
    -------
    Unit
        With its name, quantity and factor to SI.

    Raises
    ------
    InputError
        If no unit is spelled so, or it measures something else. The message offers
        the nearest name.
    TypeError
        If `text` is not a string.
    """
    if quantity is not None:
        one_of("quantity", quantity, QUANTITIES)
    if not isinstance(text, str):
        raise TypeError(f"a unit must be text, got {text!r}.")
    found = _BY_KEY.get(_key(text), [])
    fitting = [unit for unit in found if quantity in (None, unit.quantity)]
    if len(fitting) > 1:  # let the letters' case decide
        fitting = [unit for unit in fitting if text.strip("()[]{} ") in (unit.symbol, unit.name)]
    if len(fitting) == 1:
        return fitting[0]
    if fitting or (found and quantity is None):
        raise InputError(
            f"unit {text!r} can mean {' or '.join(unit.quantity for unit in found)}; "
            f"write {' or '.join(repr(unit.symbol) for unit in found)}."
        )
    if quantity is None:
        raise InputError(f"unknown unit {text!r}{nearest(text, _BY_KEY)}.")
    known = [unit.name for unit in units_of(quantity)]
    if found:
        measured = " or ".join(unit.quantity.replace("_", " ") for unit in found)
        raise InputError(
            f"unit {text!r} measures {measured}, but {_article(quantity)} is needed; "
            f"write one of {', '.join(known)}."
        )
    raise InputError(
        f"unknown unit {text!r} of {_article(quantity)}{nearest(text, known)}; "
        f"known are {', '.join(known)}."
    )


def _article(quantity: str) -> str:
    """Return ``a speed`` or ``an angular rate``."""
    words = quantity.replace("_", " ")
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"
