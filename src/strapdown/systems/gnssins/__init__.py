"""Thesis E, a low-cost integrated GNSS/INS: its experiments."""

from strapdown.systems._parts import Part

PARTS: tuple[Part, ...] = ()
