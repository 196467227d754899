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
        doctor,
        earth,
        errors,
        evaluation,
        io,
        kalman,
        navigation,
        noise,
        report,
        rotation,
        sensors,
        simulation,
        systems,
        units,
    )
    from strapdown import estimator as estimators
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
    "kalman",
    "navigation",
    "noise",
    "report",
    "rotation",
    "sensors",
    "simulation",
    "systems",
    "units",
)
_NAMES = {
    "read": "strapdown.io",
    "write": "strapdown.io",
    "Recording": "strapdown.recording",
    "from_arrays": "strapdown.recording",
    "Solution": "strapdown.solution",
    "Status": "strapdown.solution",
    "estimators": "strapdown.estimator",  # the module itself
}
__all__ = [
    "Recording",
    "Solution",
    "Status",
    "attitude",
    "calibration",
    "conventions",
    "doctor",
    "earth",
    "errors",
    "estimators",
    "evaluation",
    "from_arrays",
    "io",
    "kalman",
    "navigation",
    "noise",
    "read",
    "report",
    "rotation",
    "sensors",
    "simulation",
    "systems",
    "units",
    "write",
]


def __getattr__(name: str) -> Any:
    """Load a module or a name on its first use."""
    if name in _MODULES:
        value = _module(name)
    elif name in _NAMES:
        module = import_module(_NAMES[name])
        value = module if name == "estimators" else getattr(module, name)
    else:
        raise AttributeError(f"module 'strapdown' has no attribute {name!r}")
    globals()[name] = value
    return value


def _module(name: str) -> Any:
    """Import a part of the package; one that this version lacks is no attribute of it."""
    full = f"strapdown.{name}"
    try:
        return import_module(full)
    except ModuleNotFoundError as error:
        if error.name != full:  # a dependency is missing, and its name must be seen
            raise
        raise AttributeError(f"strapdown {__version__} has no {name!r} yet") from None


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
