"""From a bare MEMS sensor to a validated navigation solution.

The names that most users need; each is loaded when it is first used, so that a bare
``import strapdown`` costs hardly more than NumPy. Start with `conventions`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from strapdown import (
        attitude,
        calibration,
        conventions,
        earth,
        estimator,
        estimators,
        evaluation,
        io,
        noise,
        report,
        rotation,
        units,
    )
    from strapdown.io import read, write
    from strapdown.recording import Recording, from_arrays
    from strapdown.solution import Solution, Status

_MODULES = (
    "attitude",
    "calibration",
    "conventions",
    "doctor",
    "earth",
    "errors",
    "evaluation",
    "io",
    "navigation",
    "noise",
    "report",
    "rotation",
    "sensors",
    "simulation",
    "units",
)
_NAMES = {
    "read": "strapdown.io",
    "write": "strapdown.io",
    "Recording": "strapdown.recording",
    "from_arrays": "strapdown.recording",
    "Solution": "strapdown.solution",
    "Status": "strapdown.solution",
}
