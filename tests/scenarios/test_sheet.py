"""How a figure is written: laid out once, alike in both formats, in few colours."""

import re

import numpy as np
from matplotlib.layout_engine import ConstrainedLayoutEngine
from PIL import Image

from scenarios.drawing.sheet import COLOURS, DPI, INK, Plot, legend, name_axes, sheet

POINTS_PER_INCH = 72


def a_plot():
    figure, axes = sheet(3.0, [["a"], ["b"]], sharex=True)
    for name, size in (("a", 1.0), ("b", 1e6)):
        axes[name].plot([0.0, 1.0], [0.0, size], color=INK, label="line")
        name_axes(axes[name], "time in s" if name == "b" else "", "value in m", name)
    legend(figure, axes["a"])
    return Plot("one", figure, "caption")


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
