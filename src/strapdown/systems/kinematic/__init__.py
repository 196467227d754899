"""Thesis B, a sensor for human motion: its experiments."""

from strapdown.systems._parts import Part

PARTS: tuple[Part, ...] = ()
