"""Thesis C, the attitude unit of an indoor explorer: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.indoor import convergence, offsets, rotations, servo, timing

PARTS: tuple[Part, ...] = (
    offsets.PART,
    timing.PART,
    rotations.PART,
    convergence.PART,
    servo.PART,
)
