"""``--set key=value``: converted to what the estimator's annotations ask for."""

import re
from dataclasses import dataclass
from typing import Literal

import pytest

from strapdown.cli._settings import pairs, parameters
from strapdown.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Example:
    gain: float = 1.0
    order: int = 2
    robust: bool = False
    mode: Literal["fast", "exact"] = "fast"
    declination: float | None = None
    name: str = ""
    sigma: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gate: float | Literal["off"] = "off"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("gain=0.12", 0.12),
        ("gain=-3e-2", -0.03),
        (" gain = 2 ", 2.0),
        ("order=3", 3),
        ("robust=true", True),
        ("robust=OFF", False),
        ("mode=exact", "exact"),
        ("declination=none", None),
        ("declination=0.07", 0.07),
        ("name=a=b", "a=b"),
        ("sigma=1,2,3", (1.0, 2.0, 3.0)),
        ("sigma=(1, 2, 3)", (1.0, 2.0, 3.0)),
        ("gate=5", 5.0),
        ("gate=off", "off"),
    ],
)
def test_text_becomes_what_the_annotation_says(text, value):
    ((_, got),) = parameters("example", Example, [text]).items()
    assert got == value
    assert type(got) is type(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gain=large", "--set gain: must be a number, got 'large'."),
        ("order=2.5", "--set order: must be a whole number, got '2.5'."),
        ("robust=maybe", "--set robust: must be true or false, got 'maybe'."),
        ("mode=slow", "--set mode: must be one of fast, exact, got 'slow'."),
        ("sigma=1,2", "--set sigma: must be 3 numbers with commas between, got '1,2'."),
        ("declination=east", "--set declination: must be a number, got 'east'."),
        ("gian=1", "--set gian: example has no parameter 'gian'; the nearest name is 'gain'."),
        ("xyz=1", "--set xyz: example has no parameter 'xyz'; it has gain, order, robust"),
    ],
)
def test_what_cannot_be_converted_is_told(text, message):
    with pytest.raises(InputError, match=re.escape(message)):
        parameters("example", Example, [text])


def test_pairs_keep_their_order():
    assert list(pairs("--set", ["b=1", "a=2"])) == ["b", "a"]
