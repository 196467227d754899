"""The 3D view: the box's axes over time, to play and to scrub."""

import numpy as np

from strapdown._types import BoolArray, FloatArray, IntArray
from strapdown.report.figures import AXIS_COLORS, packed
from strapdown.report.page import Block, data_script

FRAMES = 9000  # 50 a second for 3 minutes; the view turns smoothly between them
SPEEDS = (0.25, 0.5, 1, 2, 5, 10, 50)


def frame_rows(t: FloatArray, frames: int = FRAMES) -> IntArray:
    """Return the rows nearest to evenly spaced times, each once: what a page can carry."""
    if len(t) <= frames:
        return np.arange(len(t))
    grid = np.linspace(t[0], t[-1], frames)
    return np.unique(np.searchsorted(t, grid).clip(0, len(t) - 1))


def scene(
    t: FloatArray, q_nb: FloatArray, known: BoolArray, reference: FloatArray | None = None
) -> Block:
    """Return the 3D view of attitudes over time.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s], at least one; all go into the page, see `frame_rows`.
    q_nb : ndarray, shape (n, 4)
        Attitude of the box.
    known : ndarray of bool, shape (n,)
        Where there is one.
    reference : ndarray, shape (n, 4), optional
        Another attitude at the same times, drawn as a ghost; NaN where there is none.

    Returns
    -------
    Block
    """
    bits = known.astype(np.uint8)
    data: dict[str, object] = {
        "t": packed(t, "f8")["bdata"],
        "estimate": packed(q_nb)["bdata"],
        "gap_s": _gap(t),
    }
    if reference is not None:
        there = np.asarray(~np.isnan(reference).any(axis=1))
        bits |= there.astype(np.uint8) << 1
        data["reference"] = packed(np.where(there[:, np.newaxis], reference, 0.0))["bdata"]
    data["known"] = packed(bits, "u1")["bdata"]
    data["start_s"] = float(t[np.argmax(bits)])  # where both are known, or else the estimate
    return Block(html=_html(data, with_reference=reference is not None), needs=("scene",))


def _gap(t: FloatArray) -> float:
    """Return the interval from which on the view holds instead of turning on [s]."""
    return 5.0 * float(np.median(np.diff(t))) if len(t) > 1 else 1.0


def _html(data: dict[str, object], *, with_reference: bool) -> str:
    def line(title: str, name: str) -> str:
        cells = "".join(f'<td class="number" data-row="{name}"></td>' for _ in range(3))
        return f"<tr><td>{title}</td>{cells}</tr>"

    def single(title: str, name: str) -> str:
        return f'<tr><td colspan="3">{title}</td><td class="number" data-row="{name}"></td></tr>'

    options = "".join(
        f'<option value="{speed}"{" selected" if speed == 1 else ""}>{speed:g}×</option>'  # noqa: RUF001
        for speed in SPEEDS
    )
    rows = line("estimate", "estimate")
    if with_reference:
        rows += line("reference", "reference") + single("angle between them [°]", "error")
    axes = "".join(
        f'<span class="swatch" style="background:{color}"></span>{name} &nbsp; '
        for name, color in zip("xyz", AXIS_COLORS, strict=True)
    )
    ghost = "; dashed: the reference" if with_reference else ""
    return (
        '<div class="scene"><canvas role="img" aria-label="Axes of the box in three dimensions">'
        "</canvas><div><table><thead><tr><th></th>"
        '<th class="number">roll [°]</th><th class="number">pitch [°]</th>'
        f'<th class="number">yaw [°]</th></tr></thead><tbody>{rows}'
        f"{single('time [s]', 'time')}</tbody></table>"
        f"<p>{axes}<br>axes of the box as recorded{ghost}</p>"
        '<p class="state"></p>'
        '<p class="intro">Drag the view to turn it. Click into a figure to go to that time; '
        "a line in the figures follows the view.</p></div>"
        '<div class="controls"><button type="button" class="play">Play</button>'
        '<input type="range" min="0" max="1" step="0.0001" value="0" aria-label="time">'
        f'<select aria-label="speed">{options}</select>'
        '<button type="button" class="view">Reset view</button></div>'
        f"{data_script(data)}</div>"
    )
