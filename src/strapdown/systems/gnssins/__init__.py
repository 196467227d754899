"""Thesis E, a low-cost integrated GNSS/INS: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.gnssins import (
    budget,
    calibrations,
    control,
    models,
    sheets,
    theory,
    trials,
)

PARTS: tuple[Part, ...] = (
    theory.PART,
    calibrations.PART,
    models.PART,
    budget.PART,
    control.PART,
    trials.PART,
    sheets.PART,
)
