"""Thesis D, the AHRS of a micro UAV: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.uav import sensors

PARTS: tuple[Part, ...] = (sensors.PART,)
