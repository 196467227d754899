"""Blocks of a page and the figures in it."""

import base64
import itertools
import json

import numpy as np
import pytest

from strapdown.report import figures, page


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (1.23456, "1.235"),
        (-0.012345, "-0.0123"),
        (123.456, "123.5"),
        (123456.7, "123457"),
        (1.5e9, "1.5e+09"),
        (2.5e-7, "2.5e-07"),
        (53240, "53\u202f240"),
        (None, "\u2013"),
        (float("nan"), "\u2013"),
    ],
)
def test_numbers_have_four_digits(value, shown):
    assert page.number(value) == shown


def test_a_page_without_figures_carries_no_plotly():
    content = page.render(
        page.Page(title="T", sections=[page.Section(title="S", blocks=[page.text("words")])])
    )
    assert "plotly.js" not in content
    assert len(content) < 20_000


def test_sections_without_blocks_are_left_out():
    sections = [page.Section(title=name, blocks=[]) for name in ("gone", "lost")]
    content = page.render(page.Page(title="T", sections=sections))
    assert "gone" not in content
    assert "<section" not in content


def test_number_columns_stand_to_the_right_and_text_is_escaped():
    block = page.table(("name", "value [m]"), [("<x>", 1.5), ("y", None)], caption="A & B")
    assert "&lt;x&gt;" in block.html
    assert "A &amp; B" in block.html
    assert block.html.count('class="number"') == 3  # heading, value, dash


def test_blocks_beside_each_other_need_what_their_parts_need():
    panel = figures.Panel(y_label="y", items=[])
    both = page.beside(page.text("a"), page.plot(figures.time_figure([panel])))
    assert both.needs == ("plotly",)


def test_a_time_figure_stacks_its_panels_without_overlap():
    t = np.linspace(0, 9, 50)
    panels = [
        figures.Panel(y_label=str(i), items=[figures.Series(x=t, y=t, name="a")], height=100 + i)
        for i in range(4)
    ]
    layout = figures.time_figure(panels).spec["layout"]
    domains = [layout[f"yaxis{i or ''}"]["domain"] for i in ("", 2, 3, 4)]
    assert domains[0][1] == 1.0
    assert domains[-1][0] == pytest.approx(0.0, abs=1e-12)
    for upper, lower in itertools.pairwise(domains):
        assert upper[0] > lower[1]
    assert layout["xaxis"]["range"] == [0.0, 9.0]


def test_one_legend_entry_stands_for_all_series_of_a_name():
    t = np.arange(5.0)
    panels = [figures.Panel(y_label="v", items=figures.xyz(t, np.zeros((5, 3)))) for _ in range(3)]
    data = figures.time_figure(panels).spec["data"]
    assert len(data) == 9
    assert [trace["name"] for trace in data if trace["showlegend"]] == ["x", "y", "z"]


def test_a_band_is_filled_between_its_edges_and_skips_what_is_not_finite():
    t = np.arange(6.0)
    sigma = np.array([1.0, 2.0, np.nan, 1.0, np.inf, 1.0])
    figure = figures.time_figure(
        [figures.Panel(y_label="e", items=[figures.sigma_band(t, sigma, centre=10.0)])]
    )
    low, high = figure.spec["data"]
    assert "fill" not in low
    assert high["fill"] == "tonexty"
    values = [np.frombuffer(base64.b64decode(d["y"]["bdata"]), "<f4")
              for d in (low, high)]  # fmt: skip
    assert values[0].tolist() == [7.0, 4.0, 7.0, 7.0]
    assert values[1].tolist() == [13.0, 16.0, 13.0, 13.0]


def test_grid_panels_have_axes_of_their_own():
    bars = figures.Series(x=np.arange(3.0), y=np.ones(3), name="b", kind="bars")
    panels = [
        figures.Panel(y_label="n", x_label=f"x{i}", items=[bars], log_x=True, log_y=True,
                      y_range=(0.1, 100.0), title=f"<{i}>")
        for i in range(5)
    ]  # fmt: skip
    layout = figures.grid_figure(panels, columns=2).spec["layout"]
    assert layout["xaxis5"]["title"]["text"] == "x4"
    assert layout["xaxis5"]["type"] == "log"
    assert layout["yaxis2"]["range"] == [-1.0, 2.0]
    assert layout["xaxis2"]["domain"][0] > layout["xaxis"]["domain"][1]
    json.dumps(layout, allow_nan=False)


def test_figures_of_nothing_can_be_drawn():
    empty = np.zeros(0)
    items = [
        figures.Series(x=empty, y=empty, name="line"),
        figures.Series(x=empty, y=empty, name="points", kind="points"),
        figures.Band(x=empty, low=empty, high=empty, name="band"),
    ]
    for figure in (
        figures.time_figure([figures.Panel(y_label="y", items=items, log_y=True)]),
        figures.grid_figure([figures.Panel(y_label="y", items=items)]),
        figures.timeline(np.arange(3.0), [("FLAG", "#000000", np.zeros(3, bool))]),
        figures.timeline(empty, []),
    ):
        json.dumps(figure.spec, allow_nan=False)
