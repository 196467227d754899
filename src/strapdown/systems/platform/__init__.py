"""Thesis A, the platform of a spacecraft simulator: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.platform import (
    allan,
    calibrations,
    encoders,
    equations,
    low_pass,
    multiplier,
    offline,
    online,
    sheets,
    sweep,
    temperature,
    timing,
)

PARTS: tuple[Part, ...] = (
    allan.PART,
    low_pass.PART,
    sheets.PART,
    calibrations.PART,
    temperature.PART,
    encoders.PART,
    equations.PART,
    sweep.PART,
    offline.PART,
    multiplier.PART,
    online.PART,
    timing.PART,
)
