"""Thesis B, a sensor for human motion: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.kinematic import (
    filters,
    growth,
    moving,
    relations,
    static,
    still,
    vectors,
)

PARTS: tuple[Part, ...] = (
    static.PART,
    growth.PART,
    relations.PART,
    still.PART,
    moving.PART,
    vectors.PART,
    filters.PART,
)
