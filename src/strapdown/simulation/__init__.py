"""Motions with exact kinematics, scenarios, and the recordings that simulated sensors make."""

from strapdown.simulation import demo, kinematics, motions, scenario, vehicles
from strapdown.simulation.kinematics import truth
from strapdown.simulation.scenario import Scenario, load, names

__all__ = [
    "Scenario",
    "demo",
    "kinematics",
    "load",
    "motions",
    "names",
    "scenario",
    "truth",
    "vehicles",
]
