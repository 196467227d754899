"""Thesis B, a sensor for human motion: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.kinematic import static

PARTS: tuple[Part, ...] = (static.PART,)
