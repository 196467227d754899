"""Navigation: position, velocity and attitude from an IMU and what aids it."""

from strapdown.navigation.loosely_coupled import LooselyCoupled
from strapdown.navigation.mechanisation import (
    Mechanisation,
    SphericalEarth,
    Start,
    mechanise,
    mechanise_plane,
)
from strapdown.navigation.tracker import NavigationTracker

__all__ = [
    "LooselyCoupled",
    "Mechanisation",
    "NavigationTracker",
    "SphericalEarth",
    "Start",
    "mechanise",
    "mechanise_plane",
]
