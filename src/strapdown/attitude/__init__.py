"""Attitude estimators; each module reads from top to bottom with its source beside it."""

from typing import Any

from strapdown import estimator as _estimator
from strapdown.attitude.adaptive_ekf import AdaptiveEkf
from strapdown.attitude.determination import (
    Determination,
    Observability,
    compass,
    davenport,
    gauss_newton,
    gradient_descent,
    master_slave,
    quest,
    svd,
    tilt,
    triad,
)
from strapdown.attitude.heading import declination
from strapdown.attitude.indirect_ekf import IndirectEkf
from strapdown.attitude.integration import GyroIntegration
from strapdown.attitude.madgwick import Madgwick
from strapdown.attitude.mahony import Mahony
from strapdown.attitude.mekf import Mekf
from strapdown.attitude.multi_mode_ahrs import MultiModeAhrs
from strapdown.attitude.quest_ekf import QuestEkf
from strapdown.attitude.robust_eskf import RobustEskf
from strapdown.attitude.standard_ahrs import StandardAhrs
from strapdown.attitude.two_stage import TwoStage

__all__ = [
    "AdaptiveEkf",
    "Determination",
    "GyroIntegration",
    "IndirectEkf",
    "Madgwick",
    "Mahony",
    "Mekf",
    "MultiModeAhrs",
    "Observability",
    "QuestEkf",
    "RobustEskf",
    "StandardAhrs",
    "TwoStage",
    "compass",
    "create",
    "davenport",
    "declination",
    "gauss_newton",
    "gradient_descent",
    "master_slave",
    "quest",
    "svd",
    "tilt",
    "triad",
]


def create(name: str, **parameters: Any) -> Any:
    """Return the estimator `name` with the given parameters; see `strapdown.estimators.create`.

    Parameters
    ----------
    name : str
        As `strapdown.estimators.names` lists it.
    **parameters
        Fields of its dataclass.

    Returns
    -------
    Estimator
    """
    return _estimator.create(name, **parameters)
