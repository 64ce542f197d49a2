"""What all pages have: contents, tables that a telephone shows, charts with their data, narrow figures."""

import json
import re

import numpy as np
import pytest

from scenarios.drawing.chart.chart import Line, Panel, chart, scripts, styles, thinned
from scenarios.drawing.narrow import WIDTH, make_narrow
from scenarios.drawing.pages import rendered
from scenarios.drawing.sheet import Plot, dress, legend, name_axes, png, sheet

TABLE = """<header></header>
<!-- contents -->
<section id="one"><h2><span>1</span>First</h2>
<table><tr><th>name</th><th class="n">value <b>&amp; unit</b></th></tr>
<tr><td>a</td><td class="n">1</td></tr></table>
</section>
<section id="two"><h2>Second</h2>
<table><tr><th>a</th></tr><tr><td rowspan="2">x</td></tr></table></section>"""


@pytest.fixture
def page(tmp_path) -> str:
    (tmp_path / "page.j2").write_text(TABLE)
    return rendered(tmp_path, "page.j2")


def test_a_page_lists_its_sections(page):
    assert '<a href="#one">First</a>' in page
    assert '<a href="#two">Second</a>' in page


def test_a_cell_carries_the_heading_of_its_column(page):
    assert '<td data-head="name">a</td>' in page
    assert '<td data-head="value &amp; unit" class="n">1</td>' in page
    assert '<table data-whole="true"><tr><th>a</th></tr><tr><td rowspan="2">' in page


def test_a_long_line_keeps_its_peaks():
    t = np.linspace(0.0, 10.0, 100_001)
    y = np.sin(t)
    y[77_777], y[3] = 9.0, -7.0
    at, drawn = thinned(t, y, 500)
    assert len(at) == len(drawn) <= 500
    assert (np.diff(at) >= 0).all()
    assert (drawn.min(), drawn.max()) == (-7.0, 9.0)
    np.testing.assert_array_equal(thinned(t[:50], y[:50], 500)[1], y[:50])


def test_the_data_of_a_chart_cannot_end_their_element():
    t = np.arange(3.0)
    line = Line("</script><b>", np.array([1.0, np.nan, 1 / 3]), "--after")
    text = chart([Panel("x", t, [line])], [(1.0, 2.0)], "time in s")
    assert "<" not in text
    [panel] = json.loads(text)["panels"]
    assert panel["series"][0]["name"] == "</script><b>"
    assert panel["series"][0]["y"] == [1.0, None, 0.33333]


def test_scripts_and_styles_ask_for_nothing_else():
    text = scripts() + styles()
    assert "uPlot" in text
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|import\(", text)


def test_the_legend_of_a_narrow_figure_stays_inside_it(tmp_path):
    figure, axes = sheet(2.7, [["a"]])
    for name in ("tolerance", "equivalent", "linear", "harmonic of first order"):
        axes["a"].plot([0, 1], [0, 1], label=name)
    legend(figure, axes["a"])
    Plot("one", figure, "words").write(tmp_path)
    make_narrow(figure)
    png(figure)
    [made] = figure.legends
    assert len(made.get_texts()) == 4
    assert made.get_window_extent().x1 <= figure.bbox.x1
    assert made.get_window_extent().y0 >= axes["a"].get_window_extent().y1 - 1


def test_the_panels_of_a_narrow_figure_stand_below_one_another(tmp_path):
    figure, axes = sheet(2.7, [["left", "right"]])
    for name, ax in axes.items():
        dress(ax)
        ax.plot([0, 1], [0, 1000], label=name)
        name_axes(ax, "time in s", "force in N", name)
    Plot("two", figure, "words").write(tmp_path)
    make_narrow(figure)
    png(figure)
    assert figure.get_size_inches()[0] == WIDTH
    upper, lower = (axes[n].get_tightbbox() for n in ("left", "right"))
    assert lower.y1 <= upper.y0 + 1
    for ax in axes.values():
        frame = ax.get_window_extent()
        for label in (ax.xaxis.label, ax.yaxis.label):
            box = label.get_window_extent()
            assert not box.overlaps(frame)
            assert figure.bbox.x0 <= box.x0
            assert box.x1 <= figure.bbox.x1
