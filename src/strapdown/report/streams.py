"""What the sensors said, and when: the parts of a report that need no estimator."""

from collections.abc import Sequence

import numpy as np

from strapdown._types import FloatArray
from strapdown.recording import Recording, Stream
from strapdown.report.figures import MUTED, Panel, Series, grid_figure, time_figure, xyz
from strapdown.report.page import Block, Section, plot, table, text
from strapdown.units import DEG, DPS, HPA, MS, UT

GAP_FACTOR = 1.5  # an interval this many times the median one is a gap
GAPS_LISTED = 20
HISTOGRAM_BINS = 61


def sensor_panels(rec: Recording) -> list[Panel]:
    """Return a panel for each sensor of the recording, in the units that people read."""
    panels = []
    if rec.imu is not None:
        panels.append(Panel(y_label="rate [°/s]", items=xyz(rec.imu.t, rec.imu.gyr / DPS)))
        panels.append(Panel(y_label="spec. force [m/s²]", items=xyz(rec.imu.t, rec.imu.acc)))
    if rec.mag is not None:
        norm = Series(
            x=rec.mag.t,
            y=np.linalg.norm(rec.mag.mag, axis=1) / UT,
            name="strength of the field",
            color=MUTED,
        )
        panels.append(
            Panel(y_label="mag. field [µT]", items=[*xyz(rec.mag.t, rec.mag.mag / UT), norm])
        )
    if rec.gnss is not None and rec.gnss.v_n is not None:
        axes = xyz(rec.gnss.t, rec.gnss.v_n, ("north", "east", "down"))
        panels.append(Panel(y_label="GNSS velocity [m/s]", items=axes))
    single = (
        ("baro", "pressure", "pressure [hPa]", HPA),
        ("temperature", "temp_degc", "temperature [°C]", 1.0),
        ("airspeed", "airspeed", "airspeed [m/s]", 1.0),
        ("speed", "speed", "wheel speed [m/s]", 1.0),
        ("encoder", "angle", "encoder [°]", DEG),
    )
    for name, field, label, unit in single:
        stream = getattr(rec, name)
        if stream is not None:
            y = getattr(stream, field) / unit
            panels.append(
                Panel(y_label=label, items=[Series(x=stream.t, y=y, name=name)], height=110)
            )
    return [panel for panel in panels if any(len(item.x) for item in panel.items)]


def sensor_section(rec: Recording) -> Section:
    """Return what the sensors said, axes as recorded."""
    panels = sensor_panels(rec)
    return Section(
        title="Sensors",
        intro="As recorded, in the axes of the box.",
        blocks=[plot(time_figure(panels))] if panels else [],
    )


def stream_table(rec: Recording) -> Block:
    """Return rate, span, gaps and missing values of every stream."""
    return table(
        (
            "stream",
            "samples",
            "from [s]",
            "to [s]",
            "rate [Hz]",
            "gaps",
            "longest interval [s]",
            "samples with NaN",
        ),
        [
            (
                info.name,
                info.samples,
                info.start_s,
                info.stop_s,
                info.rate_hz,
                info.gaps,
                info.longest_gap_s,
                info.nan_samples,
            )
            for info in rec.info()
        ],
        caption="Streams",
    )


def interval_panel(name: str, t: FloatArray) -> Panel:
    """Return the histogram of the intervals between samples, on a logarithmic count.

    Intervals beyond three times the median are counted in the last bar.
    """
    interval = np.diff(t) / MS
    median = float(np.median(interval))
    low = float(interval.min())
    high = float(min(interval.max(), 3.0 * median))
    if high - low < 0.2 * median:  # an even clock: the median falls into the middle of a bar
        low, high = 0.9 * median, 1.1 * median
    edges = np.linspace(low, high, HISTOGRAM_BINS + 1)
    count = np.histogram(np.clip(interval, low, high), edges)[0].astype(np.float64)
    centres = 0.5 * (edges[1:] + edges[:-1])
    bars = Series(
        x=centres[count > 0],
        y=count[count > 0],
        name=name,
        color="#4a7fb5",
        kind="bars",
        width=float(edges[1] - edges[0]),
    )
    return Panel(
        y_label="count",
        x_label="interval [ms]",
        title=f"{name}, median {median:.4g} ms",
        items=[bars],
        log_y=True,
        x_range=(low, high),
        y_range=(0.5, 2.0 * float(count.max())),
        height=170,
    )


def gap_rows(name: str, t: FloatArray) -> list[tuple[str, float, float, int]]:
    """Return stream, start [s], length [s] and samples missing of each gap, longest first."""
    if len(t) < 3:
        return []
    interval = np.diff(t)
    median = float(np.median(interval))
    rows = np.flatnonzero(interval > GAP_FACTOR * median)
    rows = rows[np.argsort(-interval[rows], kind="stable")]
    return [
        (name, float(t[k]), float(interval[k]), max(1, round(interval[k] / median) - 1))
        for k in rows
    ]


def timing_section(rec: Recording, skipped: Sequence[Block] = ()) -> Section:
    """Return sample intervals, gaps, and what the caller says about samples left out."""
    streams: list[tuple[str, Stream]] = list(rec.streams())
    panels = [interval_panel(name, stream.t) for name, stream in streams if len(stream) > 2]
    blocks = []
    if panels:
        columns = min(3, max(2, len(panels)))
        note = "Times between neighbouring samples; the last bar also holds all longer ones."
        blocks.append(plot(grid_figure(panels, columns=columns), note))
    gaps = [row for name, stream in streams for row in gap_rows(name, stream.t)]
    if gaps:
        gaps.sort(key=lambda row: -row[2])
        listed = f", the {GAPS_LISTED} longest of {len(gaps)}" if len(gaps) > GAPS_LISTED else ""
        blocks.append(
            table(
                ("stream", "after [s]", "length [s]", "samples missing"),
                gaps[:GAPS_LISTED],
                caption=f"Gaps: intervals over {GAP_FACTOR} times the median{listed}",
            )
        )
    else:
        blocks.append(text(f"No interval is longer than {GAP_FACTOR} times the median one."))
    return Section(title="Timing", blocks=[*blocks, *skipped])
