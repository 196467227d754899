"""The report of a comparison: a table, and the errors of all estimators in one picture."""

import os
from collections.abc import Sequence
from pathlib import Path

from strapdown.evaluation.comparison import Trial, means
from strapdown.report import page
from strapdown.report.figures import Panel, Series, time_figure
from strapdown.report.page import Block, Page, Section
from strapdown.units import DEG

# Okabe and Ito's colours, then their darker kin, one per estimator.
COLORS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b6470", "#7a4a00",
)  # fmt: skip


def write(table: Sequence[Trial], path: str | os.PathLike[str]) -> Path:
    """Write the report of a comparison as one HTML file that opens without a network.

    Parameters
    ----------
    table : sequence of Trial
        What each estimator made of each log.
    path : str or path
        The HTML file.

    Returns
    -------
    Path
        The file.
    """
    return page.write(compose(table), path)


def compose(table: Sequence[Trial]) -> Page:
    """Return the page that `write` writes.

    Parameters
    ----------
    table : sequence of Trial
        What each estimator made of each log.

    Returns
    -------
    Page
    """
    logs = list(dict.fromkeys(trial.log for trial in table))
    labels = list(dict.fromkeys(trial.label for trial in table))
    colors = {label: COLORS[i % len(COLORS)] for i, label in enumerate(labels)}
    sections = [Section(title="Summary", blocks=[_mean_table(table)])]
    for log in logs:
        own = [trial for trial in table if trial.log == log]
        sections.append(Section(title=_short(log), blocks=[_table(own), *_figures(own, colors)]))
    return Page(
        title=f"Comparison of {len(labels)} estimators",
        subtitle=f"{len(logs)} logs" if len(logs) > 1 else logs[0],
        sections=sections,
    )


def _short(log: str) -> str:
    return Path(log).stem or log


def _columns(rows: Sequence[dict[str, object]]) -> list[str]:
    """Return the RMSE figures that occur, in the order in which they do."""
    return list(dict.fromkeys(key for row in rows for key in row if "_rmse_" in key))


def heading(key: str) -> str:
    """Return ``total [°]`` of ``total_rmse_deg``.

    Parameters
    ----------
    key : str
        Name of a figure.

    Returns
    -------
    str
    """
    name, _, unit = key.partition("_rmse_")
    return f"{name.replace('_', ' ')} [{unit.replace('m_s', 'm/s').replace('deg', '°')}]"


def _mean_table(table: Sequence[Trial]) -> Block:
    rows = means(table)
    keys = [key for key in _columns(rows) if key.partition("_")[0] not in ("roll", "pitch", "yaw")]
    cells = [
        [row["filter"], row["logs"], *(row.get(key) for key in keys), row["ns_per_sample"] / 1e3]
        for row in rows
    ]
    header = ["filter", "logs", *(heading(key) for key in keys), "time [us/sample]"]
    return page.table(header, cells, caption="RMSE, mean over the logs", digits=3)


def _table(own: Sequence[Trial]) -> Block:
    rows = [trial.summary() for trial in own]
    keys = _columns([row["errors"] or {} for row in rows])
    cells = [[row["filter"], *((row["errors"] or {}).get(key) for key in keys)] for row in rows]
    return page.table(["filter", *(heading(key) for key in keys)], cells, caption="RMSE", digits=3)


def _figures(own: Sequence[Trial], colors: dict[str, str]) -> list[Block]:
    """Return the errors of all estimators on one log over time."""
    panels = []
    for name in ("heading", "inclination"):
        items = [
            Series(
                x=trial.errors.t,
                y=getattr(trial.errors, name) / DEG,
                name=trial.label,
                color=colors[trial.label],
                dash="solid" if trial.causal else "dot",
            )
            for trial in own
            if trial.errors is not None and len(trial.errors)
        ]
        if items:
            panels.append(Panel(y_label=f"{name} error [°]", items=items, height=190))
    positions = [
        Series(
            x=trial.position.t,
            y=trial.position.horizontal,
            name=trial.label,
            color=colors[trial.label],
            dash="solid" if trial.causal else "dot",
        )
        for trial in own
        if trial.position is not None and len(trial.position.t)
    ]
    if positions:
        panels.append(Panel(y_label="horizontal error [m]", items=positions, height=190))
    if not panels:
        return [page.text("No sample of this log can be compared with its reference.")]
    notes = [t.errors.heading_note for t in own if t.errors is not None and t.errors.heading_note]
    return [page.plot(time_figure(panels)), page.text(*dict.fromkeys(notes))]
