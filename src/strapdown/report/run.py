"""The report of a run: what an estimator made of a recording."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from strapdown import _checks
from strapdown.errors import DataGap
from strapdown.evaluation import (
    AttitudeErrors,
    NavigationErrors,
    Window,
    attitude_errors,
    navigation_errors,
)
from strapdown.recording import Recording
from strapdown.report import attitude, health, navigation, page, streams
from strapdown.report.page import Block, Page, Section
from strapdown.report.tiles import Tiles
from strapdown.solution import Solution
from strapdown.units import DEG

LISTED = 12  # values of a list that are shown
Errors = AttitudeErrors | NavigationErrors


def write(
    sol: Solution,
    rec: Recording,
    path: str | os.PathLike[str],
    errors: Errors | None = None,
    title: str | None = None,
    *,
    outages: Sequence[Window] = (),
    tiles: Tiles | None = None,
) -> Path:
    """Write the report of a run: one HTML file that opens anywhere, without a network.

    Lines are thinned out for display with their extremes kept; every number is computed
    from all samples.

    Parameters
    ----------
    sol : Solution
        What was estimated.
    rec : Recording
        From what.
    path : str or path
        The HTML file; one that is there is replaced, never half written.
    errors : AttitudeErrors or NavigationErrors, optional
        Errors against a reference. By default they are computed if the recording has a
        reference that the solution overlaps.
    title : str, optional
        Heading of the page; by default the name of the recording and of the filter.
    outages : sequence of Window
        Errors where fixes were withheld from the estimator.
    tiles : Tiles, optional
        Pictures of a map to lie below the track, from a file or folder; they go into the page.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FormatError
        If the file cannot be written.
    """
    return page.write(compose(sol, rec, errors, title, outages=outages, tiles=tiles), path)


def compose(
    sol: Solution,
    rec: Recording,
    errors: Errors | None = None,
    title: str | None = None,
    *,
    outages: Sequence[Window] = (),
    tiles: Tiles | None = None,
) -> Page:
    """Return the page that `write` writes."""
    _checks.instance("sol", sol, Solution, "an estimator's `run` gives one")
    _checks.recording("rec", rec)
    if errors is None:
        errors = _errors(sol, rec)
    of_position = errors if isinstance(errors, NavigationErrors) else None
    of_attitude = errors.attitude if isinstance(errors, NavigationErrors) else errors
    name = str(rec.meta.get("name") or "recording")
    span = (float(sol.t[0]), float(sol.t[-1])) if len(sol.t) else None
    sections = [_summary(sol, rec, of_attitude, of_position)]
    if sol.is_navigation:
        sections.append(navigation.track_section(sol, rec, outages, tiles))
        if outages:
            sections.append(navigation.outage_section(outages, causal=sol.causal))
        if of_position is not None:
            sections.append(navigation.error_section(of_position, span))
        sections += [
            navigation.sigma_section(sol),
            navigation.mount_section(sol, rec.reference),
        ]
    sections += [
        attitude.scene_section(sol, rec.reference, of_attitude),
        attitude.attitude_section(sol, rec.reference, of_attitude),
    ]
    if of_attitude is not None:
        sections.append(attitude.error_section(of_attitude, span))
    sections += [
        health.bias_section(sol),
        health.innovation_section(sol),
        health.status_section(sol),
        streams.sensor_section(rec),
        streams.timing_section(rec, health.skipped_blocks(sol)),
    ]
    return Page(
        title=title or f"{name}: {sol.filter}",
        subtitle=_subtitle(sol, rec),
        sections=sections,
    )


def _errors(sol: Solution, rec: Recording) -> Errors | None:
    """Return the errors against the recording's reference, if there is one that fits."""
    reference = rec.reference
    if reference is None:
        return None
    try:
        if sol.is_navigation and reference.position is not None:
            return navigation_errors(sol, reference)
        return attitude_errors(sol, reference) if reference.attitude is not None else None
    except DataGap:
        return None


def _subtitle(sol: Solution, rec: Recording) -> str:
    parts = [f"Filter {sol.filter}, {'causal' if sol.causal else 'smoothed offline'}"]
    parts += [str(rec.meta[key]) for key in ("source", "epoch_utc") if rec.meta.get(key)]
    return " · ".join(parts)


def _summary(
    sol: Solution,
    rec: Recording,
    of_attitude: AttitudeErrors | None,
    of_position: NavigationErrors | None,
) -> Section:
    """Return what one wants to know first."""
    n = len(sol.t)
    duration = float(sol.t[-1] - sol.t[0]) if n else 0.0
    ready = float(attitude.aligned(sol).mean()) if n else 0.0
    cards = [
        ("duration", page.number(duration), "s"),
        ("samples", page.number(n), ""),
        ("heading from north", sol.heading_reference, ""),
        ("with attitude", f"{100.0 * ready:.1f}", "%"),
    ]
    if of_position is not None:
        s = of_position.statistics()
        cards.append(("horizontal RMSE", page.number(s["horizontal"].rmse, 3), "m"))
    if of_attitude is not None:
        stats = of_attitude.statistics()
        cards += [
            (f"{name} RMSE", f"{stats[name].rmse / DEG:.2f}", "°")
            for name in ("total", "heading", "inclination")
        ]
    tables: list[Block] = []
    if of_position is not None:
        tables.append(navigation.error_table(of_position))
    if of_attitude is not None:
        tables.append(attitude.error_table(of_attitude))
    blocks = [page.cards(cards)]
    if doubts := health.doubts(sol):
        blocks.append(page.listed("Not to be trusted", doubts))
    if tables:
        blocks.append(page.beside(*tables))
    if of_attitude is not None:
        blocks.append(page.text(*attitude.error_notes(of_attitude)))
    blocks.append(streams.stream_table(rec))
    facts = dict(sol.meta)
    parameters = _parameters(facts.pop("parameters", {}))
    if found := _parameters(facts):
        blocks.append(page.table(("fact", "value"), found, caption="From the estimator, in SI"))
    if parameters:
        listed = page.table(("parameter", "value"), parameters)
        blocks.append(page.folded("Parameters of the estimator, SI units", listed))
    notes = rec.meta.get("notes")
    if isinstance(notes, (list, tuple)) and notes:
        blocks.append(page.listed("Notes on the recording", [str(note) for note in notes]))
    return Section(title="Summary", blocks=blocks)


def _parameters(given: object) -> list[tuple[str, str]]:
    """Return names and values of a mapping as text, nested ones with dotted names."""
    rows: list[tuple[str, str]] = []
    for key, value in given.items() if isinstance(given, Mapping) else ():
        if isinstance(value, Mapping):
            rows += [(f"{key}.{name}", inner) for name, inner in _parameters(value)]
        elif isinstance(value, (list, tuple, np.ndarray)):
            shown = ", ".join(_short(item) for item in list(value)[:LISTED])
            more = f", … ({len(value)} values)" if len(value) > LISTED else ""
            rows.append((key, shown + more))
        else:
            rows.append((key, _short(value)))
    return rows


def _short(value: object) -> str:
    """Return a value as one would type it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
