# ruff: noqa: E501 - a refusal and its sentence stand side by side
"""Units: factors against the definitions, spellings, refusals."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from truth.compare import assert_close

from strapdown import units
from strapdown.errors import InputError
from strapdown.units import UNITS, parse_unit

PI = Fraction(math.pi)  # the float that the package uses


@pytest.mark.parametrize(
    ("factor", "exact"),
    [
        (units.DEG, PI / 180),
        (units.DPS, PI / 180),
        (units.ARCSEC, PI / 648_000),
        (units.RPM, PI / 30),
        (units.DEG_PER_HR, PI / 648_000),
        (units.DEG_PER_SQRT_HR, PI / 10_800),  # deg/sqrt(3600 s)
        (units.MG, Fraction("0.00980665")),
        (units.UG_PER_SQRT_HZ, Fraction("0.00000980665")),
        (units.MPS_PER_SQRT_HR, Fraction(1, 60)),
        (units.GAUSS, Fraction(1, 10_000)),
        (units.MILLIGAUSS, Fraction(1, 10_000_000)),
        (units.KNOT, Fraction(1852, 3600)),
        (units.KMH, Fraction(1000, 3600)),
        (units.MPH, Fraction("1609.344") / 3600),
        (units.FOOT, Fraction("0.3048")),
        (units.DAY, Fraction(86_400)),
    ],
)
def test_factor_is_what_the_unit_is_defined_as(factor, exact):
    assert factor == pytest.approx(float(exact), rel=3e-16)


def factor(text, quantity=None):
    return parse_unit(text, quantity).factor


@pytest.mark.parametrize(
    ("value", "unit", "si"),
    [
        (32.0, "degF", 0.0),
        (212.0, "°F", 100.0),
        (273.15, "K", 0.0),
        (21.5, "°C", 21.5),
        (1.0, "psi", 0.45359237 * 9.80665 / 0.0254**2),
        (760.0, "mmHg", 101_325.0),
        (29.92, "inHg", 101_320.748),
        (1013.25, "hPa", 101_325.0),
        (1.0, "bar", 1e5),
        (450_000_000, "deg_1e7", math.pi / 4),
    ],
)
def test_value_in_si(value, unit, si):
    # the barometer units are conventions of nine digits
    assert parse_unit(unit).to_si(value) == pytest.approx(si, rel=2e-7, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "spellings"),
    {
        "dps": "dps DPS deg/s °/s [deg/s] (°/s) deg/sec degrees/second deg_s degs-1 deg_per_s",
        "rad_s": "rad/s rad_s RAD/S rad/sec radians/s rad.s-1 rad_per_s",
        "mdps": "mdps mdeg/s m°/s",
        "deg_per_hr": "deg/h deg/hr °/h deg_per_hr deg/hour",
        "m_s2": "m/s^2 m/s2 m/s² m/s**2 m/s/s m_s2 m_s_2 [m/s^2] mps2 m.s^-2 m_per_s2",
        "g": "g G0 gee",
        "mg": "mg millig",
        "ug": "ug µg μg",
        "ut": "uT µT μT ut UT microtesla [uT]",
        "nt": "nT nt nanotesla",
        "t": "T tesla",
        "gauss": "G gauss Gauss Gs",
        "mgauss": "mG mgauss milligauss",
        "us": "us µs μs usec micros microseconds",
        "ms": "ms msec millis milliseconds",
        "s": "s sec seconds [s]",
        "m_s": "m/s m_s mps m/sec m_per_s",
        "kmh": "km/h kmh kph",
        "kn": "kn kt kts knots",
        "degc": "degC °C celsius C deg_c",
        "pa": "Pa pascal",
        "hpa": "hPa mbar millibar",
        "rad": "rad radians",
        "deg": "deg ° degrees",
        "deg_per_sqrt_hr": "deg/sqrt(h) deg/sqrt(hr) °/√h °/√hr deg/rt-hr deg_per_sqrt_hr",
        "ug_per_sqrt_hz": "ug/sqrt(Hz) µg/√Hz ug/rtHz ug_per_sqrt_hz",
        "dps_per_sqrt_hz": "dps/√Hz deg/s/sqrt(Hz) °/s/√Hz dps/rtHz",
        "rad_s_per_sqrt_hz": "rad/s/sqrt(Hz) rad/s/√Hz rad/sqrt(s)",
        "m_s_per_sqrt_hr": "m/s/√h m/s/sqrt(hr)",
        "percent": "% percent pct",
        "1": "1 - none",
    }.items(),
)
def test_common_spellings_are_understood(name, spellings):
    for text in spellings.split():
        assert parse_unit(text).name == name, text


@pytest.mark.parametrize(
    ("text", "quantity", "name"),
    [
        ("g", "acceleration", "g"),
        ("G", "acceleration", "g"),
        ("g", "magnetic_field", "gauss"),
        ("mG", "acceleration", "mg"),
        ("mg", "magnetic_field", "mgauss"),
        ("m s-2", "acceleration", "m_s2"),
        ("rad s⁻¹", "angular_rate", "rad_s"),
        ("deg per hour", "angular_rate", "deg_per_hr"),
    ],
)
def test_quantity_decides_where_a_symbol_has_two_meanings(text, quantity, name):
    assert parse_unit(text, quantity).name == name


def test_names_and_symbols_are_unique_and_understood():
    assert len({unit.name for unit in UNITS}) == len(UNITS)
    assert len({unit.symbol for unit in UNITS}) == len(UNITS)
    for unit in UNITS:
        assert parse_unit(unit.name) is unit
        assert parse_unit(unit.symbol) is unit
        assert parse_unit(unit.name.upper(), unit.quantity) is unit


def test_every_quantity_has_si_as_its_first_unit():
    for quantity in units.QUANTITIES:
        first = units.units_of(quantity)[0]
        assert (first.factor, first.offset) == (1.0, 0.0)


def test_si_values_are_passed_on_untouched():
    values = np.array([1.0, np.nan])
    assert parse_unit("rad/s").to_si(values) is values
    assert parse_unit("rad/s").from_si(values) is values


@given(st.sampled_from(UNITS), st.floats(-1e6, 1e6))
def test_there_and_back_is_the_same_number(unit, value):
    back = unit.from_si(unit.to_si(np.array([value])))
    # the zero of a temperature scale costs digits of a small value
    assert_close(back, value, rtol=4e-16, atol=2e-13 if unit.offset else 1e-300)


@pytest.mark.parametrize(
    ("text", "quantity", "sentence"),
    [
        ("dsp", "angular_rate", r"unknown unit 'dsp' of an angular rate; the nearest name is 'dps'; known are rad_s, dps, "),
        ("m/s", "angular_rate", r"unit 'm/s' measures speed, but an angular rate is needed; write one of rad_s, dps, "),
        ("uT", "speed", r"unit 'uT' measures magnetic field, but a speed is needed; "),
        ("Mg", None, r"unit 'Mg' can mean acceleration or magnetic_field; write 'mg' or 'mG'\.$"),
        ("furlong", None, r"unknown unit 'furlong'\.$"),
        ("degg", None, r"unknown unit 'degg'; the nearest name is 'deg'\.$"),
        ("", None, r"unknown unit ''\.$"),
        ("s", "speeed", r"`quantity` must be one of .*, got 'speeed'; the nearest name is 'speed'\.$"),
    ],
)  # fmt: skip
def test_unit_is_refused_with_a_sentence(text, quantity, sentence):
    with pytest.raises(ValueError, match=sentence) as refused:
        parse_unit(text, quantity)
    if quantity != "speeed":
        assert refused.type is InputError


def test_unit_that_is_no_text_is_refused():
    with pytest.raises(TypeError, match=r"a unit must be text, got 3\.$"):
        parse_unit(3)
