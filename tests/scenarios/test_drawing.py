"""Figures look in both formats as Matplotlib would lay them out for each, though they are laid out once."""

import re
from io import BytesIO

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from scenarios.drawing.sheet import DPI, Plot, legend, name_axes, sheet


def _figure():
    figure, axes = sheet(3.0, [["a", "b"], ["c", "b"]])
    for i, (name, ax) in enumerate(axes.items()):
        ax.plot(np.linspace(0, 1, 50), 10.0**i * np.sin(np.arange(50)), label="sine")
        name_axes(ax, "time in s", "force in N", title=name)
    legend(figure, axes["a"])
    return figure


def _places(svg):
    """Every number of translations and paths in an SVG, in points."""
    drawn = " ".join(re.findall(r'(?: d="|translate\()([^")]+)', svg))
    return np.array([float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", drawn)])


@pytest.fixture
def written(tmp_path):
    Plot("figure", _figure(), "a figure").write(tmp_path)
    return tmp_path


def test_the_png_is_the_picture_but_for_the_number_of_its_colours(written):
    full = BytesIO()
    _figure().savefig(full, format="png", dpi=DPI)
    with Image.open(full) as expected, Image.open(written / "figure.png") as found:
        assert found.mode == "P"
        difference = np.abs(np.asarray(found.convert("RGB"), int) - np.asarray(expected.convert("RGB"), int))
    assert difference.mean() < 0.5  # of 255 steps of brightness


def test_the_svg_has_everything_where_a_layout_of_its_own_would_place_it(written):
    full = BytesIO()
    _figure().savefig(full, format="svg")
    expected, found = _places(full.getvalue().decode()), _places((written / "figure.svg").read_text())
    assert len(found) > 1000
    assert_allclose(found, expected, atol=1.0)  # a point; text is measured in pixels for the one layout
