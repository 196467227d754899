"""Thesis A, the platform of a spacecraft simulator: its experiments."""

from strapdown.systems._parts import Part

PARTS: tuple[Part, ...] = ()
