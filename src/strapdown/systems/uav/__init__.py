"""Thesis D, the AHRS of a micro UAV: its experiments."""

from strapdown.systems._parts import Part
from strapdown.systems.uav import ahrs, equations, ins, outages, sensors, slow_biases, tight, wind

PARTS: tuple[Part, ...] = (
    sensors.PART,
    equations.PART,
    ahrs.PART,
    outages.PART,
    slow_biases.PART,
    tight.PART,
    wind.PART,
    ins.PART,
)
