"""What an estimator says of itself: biases, status, innovations, as sections of a report."""

import math
from typing import NamedTuple

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.report import decimate
from strapdown.report.figures import (
    ALARM,
    AXIS_COLORS,
    MUTED,
    Band,
    Panel,
    Series,
    sigma_band,
    time_figure,
    timeline,
)
from strapdown.report.page import Block, Section, plot, table, text
from strapdown.solution import Diagnostics, Outcome, Solution, Status
from strapdown.units import DPS

DOUBTFUL = 1.0 / 3.0  # share of measurements that are rejected
LEAST_REFUSED = 10
DWARFED = 10.0  # one over the other, from which on both cannot be seen in one panel


class Flag(NamedTuple):
    """How a status flag is shown: colour, and what it means."""

    color: str
    meaning: str


FLAGS: dict[Status, Flag] = {
    Status.ALIGNING: Flag("#7d8794", "no attitude yet"),
    Status.GYR_INVALID: Flag(ALARM, "rate missing or absurd: sample skipped"),
    Status.ACC_INVALID: Flag(ALARM, "specific force missing or absurd: not used"),
    Status.MAG_INVALID: Flag(ALARM, "magnetic field missing or absurd: not used"),
    Status.ACC_REJECTED: Flag("#e08a1e", "specific force does not look like gravity: not used"),
    Status.MAG_REJECTED: Flag("#e08a1e", "magnetic field fails its gate: not used"),
    Status.AIDING_REJECTED: Flag("#e08a1e", "another aiding measurement fails its gate"),
    Status.GAP: Flag(ALARM, "longer without a sample than the estimator bridges"),
    Status.REST: Flag("#3b9b6d", "found to be at rest"),
    Status.SATURATED: Flag(ALARM, "a sensor is at the end of its range"),
    Status.MAG_DISTURBED: Flag("#b4549c", "magnetic field found to be disturbed"),
    Status.MAG_MISSING: Flag("#7a3b6a", "no valid field for 5 s: heading drifts"),
    Status.GYR_STUCK: Flag("#8c2f39", "rates of exactly zero while the box was turning"),
    Status.OUTAGE: Flag("#b4549c", "aiding that bounds the position is missing"),
}


# --- doubts -----------------------------------------------------------------------------


def doubts(sol: Solution) -> list[str]:
    """Return why a solution is not to be trusted, one sentence each; none if nothing speaks so."""
    _checks.instance("sol", sol, Solution, "an estimator's `run` gives one")
    found = []
    if len(sol) and ((sol.status & Status.ALIGNING) != 0).all():
        what = "position" if sol.is_navigation else "attitude"
        found.append(
            f"{sol.filter} was still aligning at the end of the log: the solution holds no {what}."
        )
    for name, d in sol.diagnostics.items() if sol.is_navigation else ():
        refused = int(np.count_nonzero(d.outcome == Outcome.REJECTED_GATE))
        if refused >= LEAST_REFUSED and refused > DOUBTFUL * len(d.t):
            found.append(
                f"{refused} of {len(d.t)} measurements of {name} were rejected: the solution is "
                "not to be trusted; look at the axes of the box and at the clocks of its sensors."
            )
    return found


# --- biases -----------------------------------------------------------------------------


def bias_section(sol: Solution) -> Section:
    """Return the sensor biases with 3 sigma where it is stated."""
    blocks = []
    for name, values, std, unit, symbol in (
        ("gyroscope bias", sol.gyr_bias, sol.std_gyr_bias, DPS, "°/s"),
        ("accelerometer bias", sol.acc_bias, sol.std_acc_bias, 1.0, "m/s²"),
    ):
        if values is None:
            continue
        panels = []
        for i, axis in enumerate("xyz"):
            items: list[Series | Band] = []
            if std is not None:
                items.append(sigma_band(sol.t, std[:, i] / unit, values[:, i] / unit))
            items.append(Series(x=sol.t, y=values[:, i] / unit, name=axis, color=AXIS_COLORS[i]))
            limits = _settled(values[:, i] / unit, None if std is None else std[:, i] / unit)
            label = f"{axis} [{symbol}]"
            panels.append(Panel(y_label=label, items=items, height=100, y_range=limits))
        blocks.append(plot(time_figure(panels), f"Estimated {name}."))
    return Section(title="Biases", blocks=blocks)


# --- status -----------------------------------------------------------------------------


def status_section(sol: Solution) -> Section:
    """Return when each flag is set."""
    shown = [flag for flag in Status if (sol.status & flag).any()]
    if not shown:
        return Section(title="Status", blocks=[text("No flag is set at any sample.")])
    rows = [
        (flag.name or "", FLAGS[flag].color, (sol.status & flag).astype(np.bool_))
        for flag in shown
    ]
    return Section(title="Status", blocks=[plot(timeline(sol.t, rows)), status_table(sol)])


def status_table(sol: Solution) -> Block:
    """Return how often each flag is set, and what it means."""
    rows = []
    interval = float(np.median(np.diff(sol.t))) if len(sol.t) > 1 else 0.0
    for flag in Status:
        mask = (sol.status & flag).astype(np.bool_)
        first, last = decimate.runs(mask)
        if len(first):
            rows.append(
                (
                    flag.name or "",
                    int(np.count_nonzero(mask)),
                    100.0 * float(mask.mean()),
                    len(first),
                    float(sol.t[first[0]]),
                    float((sol.t[last] - sol.t[first]).max()) + interval,
                    FLAGS[flag].meaning,
                )
            )
    heads = ("flag", "samples", "share [%]", "times", "first at [s]", "longest [s]", "meaning")
    return table(heads, rows)


def skipped_blocks(sol: Solution) -> list[Block]:
    """Return which samples the estimator skipped, by reason."""
    reasons = (Status.GYR_INVALID, Status.ACC_INVALID, Status.MAG_INVALID)
    rows = []
    for flag in reasons:
        hit = np.flatnonzero(sol.status & flag)
        if len(hit):
            first, last = float(sol.t[hit[0]]), float(sol.t[hit[-1]])
            rows.append((flag.name or "", len(hit), first, last, FLAGS[flag].meaning))
    if not rows:
        return [text("No sample was skipped.")]
    heads = ("reason", "samples", "first at [s]", "last at [s]", "meaning")
    return [table(heads, rows, caption="Skipped samples")]


# --- innovations ------------------------------------------------------------------------


def innovation_section(sol: Solution) -> Section:
    """Return measured less predicted of each aiding sensor, with 3 sigma and rejections."""
    blocks: list[Block] = []
    gate = _gate(sol)
    if sol.diagnostics:
        blocks.append(_innovation_table(sol))
    for name, d in sol.diagnostics.items():
        if len(d.t):
            panels = _innovation_panels(d, gate)
            blocks.append(plot(time_figure(panels), f"Innovations of {name}."))
    gated = (
        "" if gate is None else f" Dotted is the gate, {gate:g} sigma of all components together."
    )
    return Section(
        title="Innovations",
        intro="Measured less predicted, one row for each measurement that was looked at. What is "
        f"far beyond the others lies beyond the panel; drag an axis to see it.{gated}",
        blocks=blocks,
    )


def _gate(sol: Solution) -> float | None:
    """Return the gate of the estimator in sigmas, None where it has none."""
    gate = dict(sol.meta.get("parameters", {})).get("gate")
    return float(gate) if isinstance(gate, (int, float)) and 0.0 < gate < math.inf else None


def _innovation_table(sol: Solution) -> Block:
    rows = []
    for name, d in sol.diagnostics.items():
        counts = np.bincount(d.outcome, minlength=len(Outcome))
        accepted = d.outcome == Outcome.ACCEPTED
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.square(d.innovation[accepted] / d.sigma[accepted])
        ratio = ratio[np.isfinite(ratio)]
        rows.append(
            (
                name,
                len(d.t),
                int(counts[Outcome.ACCEPTED]),
                int(counts[Outcome.REJECTED_GATE]),
                int(counts[Outcome.REJECTED_DISTURBED]),
                int(counts[Outcome.REJECTED_INVALID]),
                float(ratio.mean()) if len(ratio) else None,
            )
        )
    heads = ("measurement", "rows", "accepted", "rejected by gate", "rejected as disturbed",
             "rejected as invalid", "mean of (innovation / sigma)²")  # fmt: skip
    return table(heads, rows)


def _innovation_panels(d: Diagnostics, gate: float | None) -> list[Panel]:
    accepted = d.outcome == Outcome.ACCEPTED
    refused = d.outcome > Outcome.ACCEPTED
    panels = []
    for i, label in enumerate(d.labels):
        items: list[Series | Band] = []
        if np.isfinite(d.sigma[:, i]).any():
            items.append(sigma_band(d.t, d.sigma[:, i]))
            if gate is not None:
                items += [
                    Series(x=d.t, y=side * d.sigma[:, i], name="gate", color=ALARM, width=0.7,
                           dash="dot")
                    for side in (gate, -gate)
                ]  # fmt: skip
        x, y = d.t[accepted], d.innovation[accepted, i]
        items.append(Series(x=x, y=y, name="accepted", color=MUTED, width=0.9))
        if refused.any():
            x, y = d.t[refused], d.innovation[refused, i]
            items.append(Series(x=x, y=y, name="rejected", color=ALARM, kind="points", width=3.5))
        unit = f" [{d.unit}]" if d.unit else ""
        limits = _innovation_limits(d, i, gate)
        panels.append(Panel(y_label=f"{label}{unit}", items=items, height=105, y_range=limits))
    return panels


def _innovation_limits(d: Diagnostics, column: int, gate: float | None) -> tuple[float, float]:
    """Return limits that show what was accepted, and the gate as it mostly is.

    The first innovations come with a sigma that would dwarf all others, and so may what is
    rejected: both are beyond the panel then.
    """
    size = np.abs(d.innovation[:, column])
    used = size[np.isfinite(size) & (d.outcome == Outcome.ACCEPTED)]
    size, sigma = size[np.isfinite(size)], d.sigma[np.isfinite(d.sigma[:, column]), column]
    largest = float((used if len(used) else size).max(initial=0.0))
    wide = max(3.0, gate or 0.0) * float(np.median(sigma)) if len(sigma) else 0.0
    if wide > DWARFED * largest > 0.0:
        wide = largest
    limit = 1.1 * max(largest, wide)
    if (outside := size[size > limit]).size and outside.max() < DWARFED * limit:
        limit = 1.1 * float(outside.max())
    return (-limit, limit) if limit > 0.0 else (-1.0, 1.0)


def _settled(values: FloatArray, std: FloatArray | None) -> tuple[float, float] | None:
    """Return limits that show a state and its 3 sigma once the start is over."""
    if std is None or not len(values):
        return None
    sure = float(np.nanmax(std[len(values) // 2 :]))
    settled = values[std <= 3.0 * sure]
    low, high = float(np.nanmin(settled)), float(np.nanmax(settled))
    room = 3.0 * sure + 0.1 * (high - low)
    return (low - room, high + room) if room > 0.0 else None
