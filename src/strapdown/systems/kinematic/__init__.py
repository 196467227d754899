"""Thesis B, a sensor for human motion: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.kinematic import growth, relations, static

PARTS: tuple[Part, ...] = (static.PART, growth.PART, relations.PART)
