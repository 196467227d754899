"""Navigation: position, velocity and attitude from an IMU and what aids it."""

from strapdown.navigation import alignment, error_growth, grades
from strapdown.navigation.dead_reckoning import DeadReckoning
from strapdown.navigation.gnssins import Gnssins
from strapdown.navigation.loosely_coupled import LooselyCoupled
from strapdown.navigation.mechanisation import (
    Mechanisation,
    SphericalEarth,
    Start,
    mechanise,
    mechanise_plane,
)
from strapdown.navigation.tracker import NavigationTracker
from strapdown.navigation.uav_ins import UavIns

__all__ = [
    "DeadReckoning",
    "Gnssins",
    "LooselyCoupled",
    "Mechanisation",
    "NavigationTracker",
    "SphericalEarth",
    "Start",
    "UavIns",
    "alignment",
    "error_growth",
    "grades",
    "mechanise",
    "mechanise_plane",
]
