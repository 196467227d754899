"""The page of reproduced tables: per experiment its rows and its figures."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from strapdown.report import page
from strapdown.systems._parts import SYSTEMS, Part
from strapdown.systems._rows import Shown, Verdict

COLUMNS = ("item", "thesis", "here", "unit", "tolerance", "verdict", "remark")


def _cell(value: Any) -> Any:
    """Return a cell in the letters of print: the console has ``+-`` for any terminal."""
    return value.replace("+-", "±") if isinstance(value, str) else value


def write(system: str, found: Sequence[tuple[Part, Shown]], path: str | os.PathLike[str]) -> Path:
    """Write what the experiments of a system show as one HTML file.

    Parameters
    ----------
    system : str
        One of `SYSTEMS`.
    found : sequence of (Part, Shown)
        Experiments and what they show.
    path : path-like
        File to write.

    Returns
    -------
    Path
    """
    rows = [row for _, shown in found for row in shown.rows]
    counts = page.cards(
        (verdict.value, str(sum(row.verdict is verdict for row in rows)), "rows")
        for verdict in Verdict
    )
    sections = [page.Section(title="Verdicts", blocks=(counts,))]
    for part, shown in found:
        cells = [[_cell(getattr(row, column)) for column in COLUMNS] for row in shown.rows]
        table = page.table(COLUMNS, cells)
        sections.append(
            page.Section(
                title=part.title, intro=f"Thesis, {part.source}.", blocks=(table, *shown.blocks)
            )
        )
    return page.write(
        page.Page(
            title=f"{system}: thesis and here", subtitle=SYSTEMS[system].title, sections=sections
        ),
        path,
    )
