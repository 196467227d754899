"""Thesis C, the attitude unit of an indoor explorer: its experiments."""

from strapdown.systems._parts import Part

PARTS: tuple[Part, ...] = ()
