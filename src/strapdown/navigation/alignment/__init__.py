"""Alignment: the attitude at the start, from a stretch at rest or in motion, with covariance.

All functions are pure: a recording and a span in, an `Alignment` out. Those for rest refuse a
span in which the box moves, those for motion one whose geometry leaves the heading open.

===================  ======================  ==========================================
Function             Needs                   Heading from
===================  ======================  ==========================================
`level`              rest                    what is given
`magnetic`           rest, magnetometer      the field
`gyrocompass`        rest, a good gyroscope  the Earth's rate, after levelling
`analytic`           rest, a good gyroscope  gravity and Earth's rate at once (TRIAD)
`course`             straight drive, GNSS    the direction of travel; mount known
`velocity_matching`  motion, GNSS            accelerations; any mount
`mount`              motion, GNSS            gives the mount itself: box in the vehicle
===================  ======================  ==========================================
"""

from strapdown.navigation.alignment.at_rest import (
    analytic,
    gyrocompass,
    heading_std,
    level,
    magnetic,
)
from strapdown.navigation.alignment.matching import velocity_matching
from strapdown.navigation.alignment.mounting import Mount, mount
from strapdown.navigation.alignment.result import Alignment
from strapdown.navigation.alignment.travel import course

__all__ = [
    "Alignment",
    "Mount",
    "analytic",
    "course",
    "gyrocompass",
    "heading_std",
    "level",
    "magnetic",
    "mount",
    "velocity_matching",
]
