"""Thesis E, a low-cost integrated GNSS/INS: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.gnssins import budget, calibrations, models, sheets

PARTS: tuple[Part, ...] = (calibrations.PART, models.PART, budget.PART, sheets.PART)
