"""Figures for a page: what to draw goes in, a plotly description comes out.

The description is a plain dict that plotly.js draws. It is built here by hand: plotly's own
Python objects check every property, which takes longer than all else in a report. Arrays
travel as base64 of float32, a third of their text.
"""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from strapdown._types import BoolArray, FloatArray
from strapdown.report import decimate

# Okabe and Ito's colours: told apart on paper and by colour-blind eyes.
AXIS_COLORS = ("#d55e00", "#009e73", "#0072b2")  # x, y, z or north, east, down
ESTIMATE = "#0b5cad"
REFERENCE = "#98a1ac"
REFERENCE_PALE = "#e0d3b8"  # where a reference does not count
ALARM = "#c81e1e"
MUTED = "#5b6470"
BAND_OPACITY = 0.16

MARGIN_LEFT, MARGIN_RIGHT, MARGIN_TOP, MARGIN_BOTTOM = 72, 16, 34, 46
PANEL_GAP = 16
BAND_BUCKETS = 500  # standard deviations are smooth
DECADES_WITH_MINOR = 1.5  # a logarithmic axis of more shows powers of ten alone
QUARTER_DEG = 90  # ticks of angles; the page frees them when one zooms in
LARGE_TIME = 1e5  # beyond it a float32 of seconds is too coarse to read

_TITLE_PX = 18  # room for the titles of panels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """One line, cloud of points or row of bars in a panel.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        Values in the units of the panel's labels.
    name : str
        Name in the legend; one entry for all series of that name.
    color : str
        CSS colour.
    kind : {'line', 'points', 'bars', 'path'}
        A line is over increasing x; a path may turn back.
    width : float
        Width of a line or size of a point [px]; width of a bar in units of x.
    dash : str
        ``"solid"``, ``"dash"`` or ``"dot"``.
    period : float, optional
        Length of a turn for angles that wrap.
    """

    x: FloatArray
    y: FloatArray
    name: str
    color: str = ESTIMATE
    kind: Literal["line", "points", "bars", "path"] = "line"
    width: float = 1.2
    dash: str = "solid"
    period: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Band:
    """A shaded range between `low` and `high` over `x`, all of shape (n,)."""

    x: FloatArray
    low: FloatArray
    high: FloatArray
    name: str
    color: str = MUTED


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture below all lines: a ``data:`` URL, its west and north edge and its size."""

    url: str
    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    y_label : str
        Quantity and unit.
    items : sequence of Series or Band
        From back to front.
    x_label : str
        Quantity and unit; in a time figure only the lowest panel shows it.
    title : str
        Short heading above the panel.
    height : int
        Height of the axes [px].
    log_x, log_y : bool
        Logarithmic axes.
    x_range, y_range : tuple of float, optional
        Limits, in the panel's unit; otherwise what fits. A time figure has one `span`.
    y_ticks : mapping of float to str, optional
        Names at heights, instead of numbers.
    equal : bool
        Whether both axes have one scale, as a map needs; its numbers then have no powers of ten.
    pictures : sequence of Picture
        Below all items; in a grid figure only.
    """

    y_label: str
    items: Sequence[Series | Band]
    x_label: str = "time [s]"
    title: str = ""
    height: int = 150
    log_x: bool = False
    log_y: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    y_ticks: dict[float, str] | None = None
    equal: bool = False
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Figure:
    """A plotly description: ``{"data": [...], "layout": {...}}``, and its height [px]."""

    spec: dict[str, Any]
    height: int


def packed(values: NDArray[Any], dtype: str = "f4") -> dict[str, str]:
    """Return an array as plotly.js reads it: type and base64 of its bytes."""
    raw = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    return {"dtype": dtype, "bdata": base64.b64encode(raw.tobytes()).decode("ascii")}


def xyz(
    t: FloatArray, values: FloatArray, names: Sequence[str] = ("x", "y", "z"), width: float = 1.0
) -> list[Series]:
    """Return a series for each column of `values`, shape (n, 3), in the axes' colours."""
    return [
        Series(x=t, y=values[:, i], name=names[i], color=AXIS_COLORS[i], width=width)
        for i in range(values.shape[1])
    ]


def sigma_band(
    t: FloatArray, sigma: FloatArray, centre: FloatArray | float = 0.0, name: str = "±3 sigma"
) -> Band:
    """Return the range of three standard deviations to both sides of `centre`."""
    return Band(x=t, low=centre - 3.0 * sigma, high=centre + 3.0 * sigma, name=name)


def time_figure(
    panels: Sequence[Panel],
    *,
    span: tuple[float, float] | None = None,
    buckets: int = decimate.BUCKETS,
) -> Figure:
    """Return panels one above the other that share one time axis.

    All time figures of a page zoom together.

    Parameters
    ----------
    panels : sequence of Panel
        From top to bottom.
    span : tuple of float, optional
        First and last time of the axis [s]; otherwise those of what is drawn.
    buckets : int
        Detail of the lines, see `decimate`.

    Returns
    -------
    Figure
    """
    inner = sum(panel.height for panel in panels) + PANEL_GAP * (len(panels) - 1)
    layout = _layout(inner)
    layout["meta"] = {"time": True}
    layout["hoversubplots"] = "axis"
    layout["xaxis"] = _axis("time [s]") | {
        "range": list(span or _span(panels)),
        "anchor": _axis_name("y", len(panels)),
        "showspikes": True,
        "spikemode": "across",
        "spikethickness": 1,
        "spikecolor": MUTED,
        "spikedash": "dot",
    }
    data: list[dict[str, Any]] = []
    top = inner
    for number, panel in enumerate(panels, 1):
        domain = [(top - panel.height) / inner, top / inner]
        layout["shapes"].append(_frame([0.0, 1.0], domain))
        layout["annotations"].append(_y_title(panel.y_label, 0.0, domain))
        top -= panel.height + PANEL_GAP
        layout["yaxis" + _suffix(number)] = _y_axis(panel) | {"domain": domain, "anchor": "x"}
        data += _traces(panel, "x", _axis_name("y", number), buckets)
    return _finished(data, layout, inner)


def grid_figure(
    panels: Sequence[Panel], *, columns: int = 1, buckets: int = decimate.BUCKETS
) -> Figure:
    """Return panels side by side in rows, each with axes of its own.

    Parameters
    ----------
    panels : sequence of Panel
        Row by row; a row is as high as its highest panel.
    columns : int
        Panels in a row.
    buckets : int
        Detail of the lines, see `decimate`.

    Returns
    -------
    Figure
    """
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    between = 74  # px for the x labels of one row and the titles of the next
    heights = [max(panel.height for panel in row) for row in rows]
    inner = sum(heights) + between * (len(rows) - 1)
    layout = _layout(inner)
    layout["hovermode"] = "closest"
    layout["images"] = []
    data: list[dict[str, Any]] = []
    gap = 0.09 if columns > 1 else 0.0
    width = (1.0 - gap * (columns - 1)) / columns
    top, number = inner, 0
    for row, height in zip(rows, heights, strict=True):
        for column, panel in enumerate(row):
            number += 1
            left = column * (width + gap)
            x_name, y_name = _axis_name("x", number), _axis_name("y", number)
            x_axis = _axis(panel.x_label) | {"domain": [left, left + width], "anchor": y_name}
            if panel.log_x:
                x_axis["type"] = "log"
            if panel.x_range is not None:
                x_axis["range"] = _limits(panel.x_range, log=panel.log_x)
            domain = [(top - height) / inner, top / inner]
            y_axis = _y_axis(panel) | {"domain": domain, "anchor": x_name}
            layout["shapes"].append(_frame([left, left + width], domain))
            layout["annotations"].append(_y_title(panel.y_label, left, domain))
            if panel.equal:
                y_axis |= {"scaleanchor": x_name, "scaleratio": 1}
                x_axis["constrain"] = y_axis["constrain"] = "range"
                x_axis["exponentformat"] = y_axis["exponentformat"] = "none"
            layout["images"] += [_picture(p, x_name, y_name) for p in panel.pictures]
            layout["xaxis" + _suffix(number)] = x_axis
            layout["yaxis" + _suffix(number)] = y_axis
            if panel.title:
                layout["annotations"].append(_heading(panel.title, left, top / inner))
            data += _traces(panel, x_name, y_name, buckets)
        top -= height + between
    if any(panel.title for panel in rows[0]):  # the legend stands above the titles
        layout["legend"]["y"] = 1.0 + _TITLE_PX / inner
        layout["margin"]["t"] += _TITLE_PX
        layout["height"] += _TITLE_PX
    return _finished(data, layout, inner)


def timeline(t: FloatArray, rows: Iterable[tuple[str, str, BoolArray]]) -> Figure:
    """Return a figure of when each of some flags is set.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times.
    rows : iterable of (str, str, ndarray of bool)
        Name, colour and mask, shape (n,), from top to bottom.

    Returns
    -------
    Figure
    """
    flags = list(rows)
    items: list[Series] = []
    ticks: dict[float, str] = {}
    for level, (name, color, mask) in enumerate(reversed(flags)):
        starts, stops = decimate.merged_spans(t, mask)
        x = np.stack((starts, stops, stops), axis=1).ravel()
        y = np.tile([level, level, np.nan], len(starts))
        ticks[float(level)] = name
        items.append(Series(x=x, y=y, name=name, color=color, kind="path", width=11.0))
    if len(t):  # the axis covers the whole time even if no flag does
        ends = t[[0, -1]]
        items.append(Series(x=ends, y=np.full(2, -2.0), name="span", color="#fff"))
    panel = Panel(
        y_label="",
        items=items,
        height=max(40, 24 * len(flags)),
        y_range=(-0.7, len(flags) - 0.3),
        y_ticks=ticks,
    )
    figure = time_figure([panel])
    layout = figure.spec["layout"]
    layout["showlegend"] = False
    layout["hovermode"] = False
    layout["margin"] = {**layout["margin"], "l": 150, "t": 12}
    return figure


# --- inner parts ------------------------------------------------------------------------


def _suffix(number: int) -> str:
    return "" if number == 1 else str(number)


def _axis_name(letter: str, number: int) -> str:
    return letter + _suffix(number)


def _layout(inner: int) -> dict[str, Any]:
    """Return what all figures have in common."""
    return {
        "height": inner + MARGIN_TOP + MARGIN_BOTTOM,
        "margin": {
            "l": MARGIN_LEFT,
            "r": MARGIN_RIGHT,
            "t": MARGIN_TOP,
            "b": MARGIN_BOTTOM,
        },
        "paper_bgcolor": "#fff",
        "plot_bgcolor": "#fff",
        "font": {"family": "system-ui, 'Segoe UI', Roboto, sans-serif", "size": 12,
                 "color": "#252b33"},
        "hovermode": "x unified",
        "hoverlabel": {"font": {"size": 11}},
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1, "yanchor": "bottom",
                   "tracegroupgap": 0, "itemsizing": "constant"},
        "shapes": [],
        "annotations": [],
        "dragmode": "zoom",
        "separators": ".\u202f",
    }  # fmt: skip


def _axis(label: str) -> dict[str, Any]:
    return {
        "title": {"text": label, "standoff": 8},
        "gridcolor": "#e7eaee",
        "zeroline": False,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": "#b9c0c9",
        "exponentformat": "power",
    }


def _y_axis(panel: Panel) -> dict[str, Any]:
    axis = _axis("")
    if panel.log_y:
        axis |= {"type": "log", "dtick": 1 if _decades(panel) > DECADES_WITH_MINOR else "D2"}
    elif _turns(panel):
        axis["dtick"] = QUARTER_DEG
    elif not panel.y_ticks:
        axis |= {"zeroline": True, "zerolinecolor": "#c9ced6", "zerolinewidth": 1}
    if panel.y_range is not None:
        axis["range"] = _limits(panel.y_range, log=panel.log_y)
    if panel.y_ticks:
        axis |= {
            "tickmode": "array",
            "tickvals": list(panel.y_ticks),
            "ticktext": list(panel.y_ticks.values()),
            "fixedrange": True,
            "showgrid": False,
        }
    return axis


def _limits(limits: tuple[float, float], *, log: bool) -> list[float]:
    """Return limits as plotly wants them: exponents on a logarithmic axis."""
    return [float(x) for x in (np.log10(limits) if log else limits)]


def _span(panels: Sequence[Panel]) -> tuple[float, float]:
    """Return the first and the last time of all that is drawn."""
    ends = [x for p in panels for item in p.items if len(item.x) for x in item.x[[0, -1]]]
    return (float(min(ends)), float(max(ends))) if ends else (0.0, 1.0)


def _decades(panel: Panel) -> float:
    """Return how many decades a logarithmic panel spans."""
    if panel.y_range is not None:
        return float(np.log10(panel.y_range[1] / panel.y_range[0]))
    parts = [item.y[item.y > 0.0] for item in panel.items if isinstance(item, Series)]
    parts = [part for part in parts if len(part)]
    if not parts:
        return 0.0
    low, high = min(p.min() for p in parts), max(p.max() for p in parts)
    return float(np.log10(high / low))


def _turns(panel: Panel) -> bool:
    """Return whether the panel shows angles [deg] over more than half a turn."""
    return any(
        isinstance(item, Series)
        and item.period == 360.0
        and len(item.y) > 0
        and not np.isnan(item.y).all()
        and np.nanmax(item.y) - np.nanmin(item.y) > 180.0
        for item in panel.items
    )


def _frame(x: list[float], y: list[float]) -> dict[str, Any]:
    """Return the border of a panel; plotly's own lines stop at the lowest one."""
    return {
        "type": "rect", "xref": "paper", "yref": "paper", "x0": x[0], "x1": x[1], "y0": y[0],
        "y1": y[1], "line": {"color": "#b9c0c9", "width": 1}, "layer": "below",
    }  # fmt: skip


def _y_title(label: str, left: float, domain: list[float]) -> dict[str, Any]:
    """Return the label of a y axis; unlike plotly's own, all stand in one line."""
    return {
        "text": label, "showarrow": False, "textangle": -90, "x": left, "xref": "paper",
        "xanchor": "center", "xshift": -58, "y": 0.5 * (domain[0] + domain[1]), "yref": "paper",
        "yanchor": "middle",
    }  # fmt: skip


def _picture(picture: Picture, x_name: str, y_name: str) -> dict[str, Any]:
    return {
        "source": picture.url, "xref": x_name, "yref": y_name, "x": picture.left,
        "y": picture.top, "sizex": picture.width, "sizey": picture.height, "sizing": "stretch",
        "layer": "below",
    }  # fmt: skip


def _heading(text: str, left: float, top: float) -> dict[str, Any]:
    return {
        "text": f"<b>{text}</b>", "showarrow": False, "x": left, "y": top, "xref": "paper",
        "yref": "paper", "xanchor": "left", "yanchor": "bottom", "yshift": 3,
    }  # fmt: skip


def _times(x: FloatArray) -> dict[str, str]:
    large = x.size > 0 and float(np.nanmax(np.abs(x))) > LARGE_TIME
    return packed(x, "f8" if large else "f4")


def _traces(panel: Panel, x_name: str, y_name: str, buckets: int) -> list[dict[str, Any]]:
    out: list[dict[str, Any]] = []
    for item in panel.items:
        axes = {"xaxis": x_name, "yaxis": y_name, "name": item.name, "legendgroup": item.name}
        if isinstance(item, Band):
            out += [trace | axes for trace in _band(item)]
        else:
            out.append(_series(item, buckets) | axes)
    return out


def _band(band: Band) -> list[dict[str, Any]]:
    """Return the lower edge, and the upper edge filled down to it."""
    there = np.isfinite(band.low) & np.isfinite(band.high)
    x, low, high = band.x[there], band.low[there], band.high[there]
    rows = decimate.path_rows(low, high, buckets=BAND_BUCKETS) if len(x) else np.zeros(0, int)
    red, green, blue = (int(band.color[i : i + 2], 16) for i in (1, 3, 5))
    edge = {
        "type": "scatter",
        "mode": "lines",
        "x": _times(x[rows]),
        "line": {"width": 0.6, "color": f"rgba({red},{green},{blue},0.55)"},
        "hoverinfo": "skip",
    }
    fill = {"fill": "tonexty", "fillcolor": f"rgba({red},{green},{blue},{BAND_OPACITY})"}
    return [
        edge | {"y": packed(low[rows]), "showlegend": False},
        edge | {"y": packed(high[rows])} | fill,
    ]


def _series(series: Series, buckets: int) -> dict[str, Any]:
    """Return the plotly trace, thinned out for display."""
    x, y = series.x, series.y
    if series.kind == "bars":
        return {
            "type": "bar", "showlegend": False, "x": packed(x, "f8"), "y": packed(y, "f8"),
            "marker": {"color": series.color}, "width": series.width,
            "hovertemplate": "%{x:.5g}: %{y}<extra></extra>",
        }  # fmt: skip
    if series.kind == "line":
        x, y = decimate.line(x, y, buckets=buckets, period=series.period)
    elif series.kind == "points":
        there = np.isfinite(x) & np.isfinite(y)
        x, y = x[there], y[there]
        rows = decimate.path_rows(x, y, buckets=buckets)
        x, y = x[rows], y[rows]
    trace: dict[str, Any] = {
        "type": "scatter",
        "x": _times(x),
        "y": packed(y),
        "hovertemplate": "%{y:.5g}",
    }
    if series.kind == "points":
        return trace | {
            "mode": "markers", "marker": {"color": series.color, "size": series.width},
        }  # fmt: skip
    line = {"color": series.color, "width": series.width, "dash": series.dash}
    return trace | {"mode": "lines", "line": line}


def _finished(data: list[dict[str, Any]], layout: dict[str, Any], inner: int) -> Figure:
    """Return the figure, with one legend entry for each name."""
    seen: set[str] = set()
    for trace in data:
        if trace.get("showlegend") is False:
            continue
        trace["showlegend"] = trace["name"] not in seen
        seen.add(trace["name"])
    layout["showlegend"] = len(seen) > 1
    return Figure(spec={"data": data, "layout": layout}, height=layout["height"])
