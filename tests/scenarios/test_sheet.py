"""How a figure is written: laid out once, alike in both formats, in few colours."""

import re
from io import BytesIO

import numpy as np
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.testing import assert_allclose
from PIL import Image

from scenarios.drawing.sheet import COLOURS, DPI, INK, Plot, legend, name_axes, sheet

POINTS_PER_INCH = 72


def a_plot():
    figure, axes = sheet(3.0, [["a", "b"], ["c", "b"]])
    for i, (name, ax) in enumerate(axes.items()):
        ax.plot(np.linspace(0, 1, 50), 10.0 ** (3 * i) * np.sin(np.arange(50)), color=INK, label="sine")
        name_axes(ax, "time in s", "force in N", title=name)
    legend(figure, axes["a"])
    return Plot("one", figure, "caption")


def places(svg):
    """Every number of translations and paths in an SVG, in points."""
    drawn = " ".join(re.findall(r'(?: d="|translate\()([^")]+)', svg))
    return np.array([float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", drawn)])


def test_a_figure_is_laid_out_once_for_both_formats(tmp_path, monkeypatch):
    made = []
    real = ConstrainedLayoutEngine.execute
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda *a: made.append(a) or real(*a))
    a_plot().write(tmp_path)
    assert len(made) == 1
    assert {f.name for f in tmp_path.iterdir()} == {"one.png", "one.svg"}


def test_the_second_format_keeps_axes_and_labels_where_the_first_has_them(tmp_path):
    plot = a_plot()
    plot.write(tmp_path)
    with Image.open(tmp_path / "one.png") as picture:
        dark = np.asarray(picture.convert("L")) < 80
    width = plot.figure.get_figwidth() * DPI
    assert dark.shape[1] == round(width)
    for ax in plot.figure.axes:
        label = ax.yaxis.label
        x, y = label.get_transform().transform(label.get_position()) / plot.figure.dpi * DPI
        text = dark[int(dark.shape[0] - y) - 40 : int(dark.shape[0] - y) + 40, int(x) - 16 : int(x) + 1]
        assert text.any()  # the label was drawn where the second format puts it


def test_dollars_in_words_are_no_mathematics(tmp_path):
    """Broken mathematics would end the command; the powers of ten at the ticks are written as such."""
    broken = "$\\frac{1$ of $\\nonsense$"
    figure, axes = sheet(2.0, [["a"]])
    ax = axes["a"]
    ax.semilogy([1, 2], [1e-3, 1e3], label=broken)
    name_axes(ax, broken, broken, broken)
    legend(figure, ax)
    figure.suptitle(broken)
    Plot("one", figure, broken).embedded(tmp_path)
    assert not any(t.get_parse_math() for t in (ax.title, ax.xaxis.label, *figure.legends[0].get_texts()))
    ticks = [tick.label1 for tick in ax.yaxis.majorTicks]
    assert len(ticks) > 2
    assert all(text.get_parse_math() for text in ticks)


def test_the_picture_has_few_colours_and_a_white_ground(tmp_path):
    data = a_plot().write(tmp_path)
    assert data == (tmp_path / "one.png").read_bytes()
    with Image.open(tmp_path / "one.png") as picture:
        colours = picture.convert("RGB").getcolors(COLOURS)
    assert colours is not None
    assert max(colours)[1] == (255, 255, 255)


def test_a_vector_graphic_has_the_size_of_the_figure_and_no_date(tmp_path):
    a_plot().write(tmp_path)
    text = (tmp_path / "one.svg").read_text(encoding="utf-8")
    found = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', text)
    assert found is not None
    assert float(found[2]) == 3.0 * POINTS_PER_INCH
    assert "<dc:date>" not in text


def test_the_png_is_the_picture_but_for_the_number_of_its_colours(tmp_path):
    full = BytesIO()
    a_plot().figure.savefig(full, format="png", dpi=DPI)
    a_plot().write(tmp_path)
    with Image.open(full) as expected, Image.open(tmp_path / "one.png") as found:
        assert found.mode == "P"
        difference = np.abs(np.asarray(found.convert("RGB"), int) - np.asarray(expected.convert("RGB"), int))
    assert difference.mean() < 0.5  # of 255 steps of brightness


def test_the_svg_has_everything_where_a_layout_of_its_own_would_place_it(tmp_path):
    full = BytesIO()
    a_plot().figure.savefig(full, format="svg")
    a_plot().write(tmp_path)
    expected, found = places(full.getvalue().decode()), places((tmp_path / "one.svg").read_text())
    assert len(found) > 1000
    assert_allclose(found, expected, atol=1.0)  # a point; text is measured in pixels for the one layout
