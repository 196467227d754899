"""The page that carries a report: one HTML file that opens anywhere, without a network.

A `Page` has sections, a section has blocks: tables, figures, a scene, text. Scripts that the
blocks need are put in once. The page forbids itself, by its content security policy, to load
anything from elsewhere.
"""

import html
import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import strapdown
from strapdown.io._atomic import written_aside
from strapdown.report.figures import Figure

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A piece of HTML, and the scripts it needs: ``"plotly"``, ``"scene"``."""

    html: str
    needs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A heading and what stands below it.

    Attributes
    ----------
    title : str
        Heading, also the entry in the bar at the top.
    blocks : sequence of Block
        From top to bottom.
    intro : str
        A sentence or two in plain text below the heading.
    """

    title: str
    blocks: Sequence[Block]
    intro: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A title and sections; those without blocks are left out."""

    title: str
    subtitle: str = ""
    sections: Sequence[Section] = field(default_factory=tuple)


# --- blocks -----------------------------------------------------------------------------


def escape(value: object) -> str:
    """Return text that HTML shows as it is."""
    return html.escape(str(value), quote=True)


def number(value: float | int | None, digits: int = 4) -> str:
    """Return a number for a table: `digits` significant ones, a dash for none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"  # noqa: RUF001 - a dash, for there is no number
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if value == 0.0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if -3 <= decimals <= digits + 2:
        return f"{value:.{max(0, min(decimals, digits))}f}"
    return f"{value:.{digits - 1}g}"


def text(*sentences: str) -> Block:
    """Return a paragraph of plain text."""
    return Block(html=f"<p>{escape(' '.join(sentences))}</p>")


def listed(title: str, items: Iterable[str]) -> Block:
    """Return a list of plain sentences under a small heading."""
    body = "".join(f"<li>{escape(item)}</li>" for item in items)
    return Block(html=f"<h3>{escape(title)}</h3><ul>{body}</ul>")


def cards(items: Iterable[tuple[str, str, str]]) -> Block:
    """Return a row of figures to see at once: label, value and unit of each."""
    body = "".join(
        f'<div class="card"><div class="label">{escape(label)}</div>'
        f'<div class="value">{escape(value)}'
        + (f' <span class="unit">{escape(unit)}</span>' if unit else "")
        + "</div></div>"
        for label, value, unit in items
    )
    return Block(html=f'<div class="cards">{body}</div>')


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    caption: str = "",
    digits: int = 4,
) -> Block:
    """Return a table.

    Parameters
    ----------
    columns : sequence of str
        Headings, with units.
    rows : iterable of sequences
        Cells: text, whole numbers, floats or None. Numbers stand to the right.
    caption : str
        Heading of the table.
    digits : int
        Significant digits of the numbers.

    Returns
    -------
    Block
    """

    def cell(value: object) -> str:
        if isinstance(value, bool):
            return f"<td>{'yes' if value else 'no'}</td>"
        if value is None or isinstance(value, (int, float)):
            return f'<td class="number">{escape(number(value, digits))}</td>'
        return f"<td>{escape(value)}</td>"

    body = [list(row) for row in rows]
    right = [
        all(
            row[i] is None or (isinstance(row[i], (int, float)) and not isinstance(row[i], bool))
            for row in body
        )
        for i in range(len(columns))
    ]
    head = "".join(
        f'<th class="number">{escape(name)}</th>' if flush and body else f"<th>{escape(name)}</th>"
        for name, flush in zip(columns, right, strict=True)
    )
    lines = "".join(f"<tr>{''.join(map(cell, row))}</tr>" for row in body)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return Block(
        html=f'<div class="table"><table>{title}<thead><tr>{head}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div>"
    )


def beside(*blocks: Block) -> Block:
    """Return blocks next to each other where the page is wide enough."""
    needs = tuple(dict.fromkeys(need for block in blocks for need in block.needs))
    inner = "".join(f"<div>{block.html}</div>" for block in blocks)
    return Block(html=f'<div class="beside">{inner}</div>', needs=needs)


def folded(title: str, block: Block) -> Block:
    """Return a block that opens with a click on its title."""
    inner = f"<details><summary>{escape(title)}</summary>{block.html}</details>"
    return Block(html=inner, needs=block.needs)


def plot(figure: Figure, caption: str = "") -> Block:
    """Return a figure, drawn when it comes into view."""
    note = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return Block(
        html=f'<figure><div class="plot" style="height:{figure.height}px"></div>'
        f"{data_script(figure.spec)}{note}</figure>",
        needs=("plotly",),
    )


def data_script(content: object) -> str:
    """Return a JSON script element; nothing in it can end it early."""
    data = json.dumps(content, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    data = data.replace("<", "\\u003c")
    return f'<script type="application/json">{data}</script>'


# --- the file ---------------------------------------------------------------------------


def render(page: Page) -> str:
    """Return the page as HTML text."""
    sections = [section for section in page.sections if section.blocks]
    needs = {need for section in sections for block in section.blocks for need in block.needs}
    scripts = [_asset("page.js")]
    if "scene" in needs:
        scripts.append(_asset("scene.js"))
    if "plotly" in needs:
        scripts.insert(0, _plotly())
    anchors = [f"s{i}" for i in range(1, len(sections) + 1)]
    linked = (
        '<label class="tools"><input type="checkbox" id="linked" checked> zoom all time axes '
        "together</label>"
        if "plotly" in needs
        else ""
    )
    links = "".join(
        f'<a href="#{anchor}">{escape(section.title)}</a>'
        for anchor, section in zip(anchors, sections, strict=True)
    )
    return "".join(
        (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<meta name="generator" content="strapdown {escape(strapdown.__version__)}">'
            f"<title>{escape(page.title)}</title><style>{_asset('page.css')}</style></head>\n",
            f"<body><header><h1>{escape(page.title)}</h1>",
            f'<p class="subtitle">{escape(page.subtitle)}</p>' if page.subtitle else "",
            f"</header><nav>{links}{linked}</nav><main>\n",
            '<noscript><p class="note">Figures need JavaScript; the tables do not.</p></noscript>',
            *(
                _section(anchor, section)
                for anchor, section in zip(anchors, sections, strict=True)
            ),
            f"</main><footer>strapdown {escape(strapdown.__version__)}</footer>\n",
            *(f"<script>{script}</script>\n" for script in scripts),
            "</body></html>\n",
        )
    )


def write(page: Page, path: str | os.PathLike[str]) -> Path:
    """Write the page aside, then put it in its place, so that no half file is ever seen.

    Parameters
    ----------
    page : Page
        What to write.
    path : str or path
        The HTML file; one that is there is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FormatError
        If the folder does not exist or cannot be written to.
    """
    target = Path(path)
    content = render(page).encode("utf-8")
    with written_aside(target) as stream:
        stream.write(content)
    return target


def _section(anchor: str, section: Section) -> str:
    intro = f'<p class="intro">{escape(section.intro)}</p>' if section.intro else ""
    blocks = "\n".join(block.html for block in section.blocks)
    return f'<section id="{anchor}"><h2>{escape(section.title)}</h2>{intro}{blocks}</section>\n'


def _asset(name: str) -> str:
    return (resources.files("strapdown.report") / "assets" / name).read_text("utf-8")


def _plotly() -> str:
    """Return plotly.js; reading the file spares the import of the Python part."""
    return (resources.files("plotly") / "package_data" / "plotly.min.js").read_text("utf-8")
