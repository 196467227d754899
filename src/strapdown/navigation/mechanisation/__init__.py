"""Strapdown mechanisations: inertial, Earth, local level and wander azimuth, and in a plane."""

from strapdown.navigation.mechanisation.earth_model import SphericalEarth
from strapdown.navigation.mechanisation.frames import (
    Mechanisation,
    MechanisationState,
    mechanise,
)
from strapdown.navigation.mechanisation.increments import coning_sculling, means_from_points
from strapdown.navigation.mechanisation.inputs import Start
from strapdown.navigation.mechanisation.plane import PlaneSolution, mechanise_plane
from strapdown.navigation.mechanisation.terms import VelocityTerms, velocity_terms

__all__ = [
    "Mechanisation",
    "MechanisationState",
    "PlaneSolution",
    "SphericalEarth",
    "Start",
    "VelocityTerms",
    "coning_sculling",
    "means_from_points",
    "mechanise",
    "mechanise_plane",
    "velocity_terms",
]
