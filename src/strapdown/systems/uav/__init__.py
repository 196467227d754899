"""Thesis D, the AHRS of a micro UAV: its experiments."""

from strapdown.systems._parts import Part

PARTS: tuple[Part, ...] = ()
