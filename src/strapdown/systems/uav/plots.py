"""Figures of chapter 4 in its colours: truth blue, multi-mode green, standard red."""

from typing import Any, Final

from strapdown._types import FloatArray
from strapdown.report.figures import Figure, Panel, Series, time_figure
from strapdown.solution import Solution
from strapdown.systems.uav.flight import ANGLES, AXES, Log, errors, rpy_deg
from strapdown.units import DEG

TRUTH: Final = "#1f4fd8"
MULTI: Final = "#1a9641"
STANDARD: Final = "#d7191c"


def angles(flown: Log, multi: Solution, standard: Solution) -> Figure:
    """Return the three angles and both filters' errors.

    Parameters
    ----------
    flown : Log
        The flight.
    multi, standard : Solution
        What the filters make of it.

    Returns
    -------
    Figure
    """
    t, panels = flown.t, []
    curves = ((flown.rpy / DEG, "model", TRUTH), (rpy_deg(multi), "multi-mode", MULTI),
              (rpy_deg(standard), "standard", STANDARD))  # fmt: skip
    for k, name in enumerate(ANGLES):
        items: list[Any] = [
            Series(x=t, y=values[:, k], name=label, color=color, period=360.0 if k == 2 else None)
            for values, label, color in curves
        ]
        panels.append(Panel(y_label=f"{name} [deg]", items=items, height=150))
    # errors have colours of their own in the thesis
    off = ((errors(multi, flown), "error, multi-mode", TRUTH),
           (errors(standard, flown), "error, standard", MULTI))  # fmt: skip
    for k, name in enumerate(ANGLES):
        items = [
            Series(x=t, y=values[:, k], name=label, color=color) for values, label, color in off
        ]
        panels.append(Panel(y_label=f"error of {name} [deg]", items=items, height=130))
    return time_figure(panels)


def biases(flown: Log, curves: tuple[tuple[FloatArray, str, str], ...]) -> Figure:
    """Return the biases of the three axes.

    Parameters
    ----------
    flown : Log
        The flight.
    curves : tuple of (ndarray, str, str)
        Estimates of shape (n, 3) [rad/s], their names and colours.

    Returns
    -------
    Figure
    """
    panels = []
    for k, name in enumerate(AXES):
        items: list[Any] = [
            Series(x=flown.t, y=values[:, k], name=label, color=color)
            for values, label, color in (*curves, (flown.bias, "model", TRUTH))
        ]
        panels.append(Panel(y_label=f"b_{name} [rad/s]", items=items, height=150))
    return time_figure(panels)
