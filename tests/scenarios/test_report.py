"""The report: one file that holds all it shows, with the numbers of the result."""

import base64
import re
from pathlib import Path

import pytest

from scenarios import close_loop
from scenarios.closing.result import Result
from tests.truth.rig import write_null_record

LARGEST = 3_000_000  # bytes of a page that can be sent by mail


@pytest.fixture(scope="module")
def page(demo: tuple[Result, Path]) -> str:
    """The demo's report."""
    return (demo[1] / "report.html").read_text(encoding="utf-8")


def words(page: str) -> str:
    """What a reader sees of a page."""
    return re.sub(r"\s+", " ", re.sub(r"<style.*?</style>|<[^>]+>", " ", page, flags=re.S))


def test_the_page_asks_for_nothing_else(page: str) -> None:
    assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)
    assert "<script" not in page
    assert "@import" not in page
    assert len(page) < LARGEST


def test_every_embedded_figure_is_a_picture_and_lies_beside_the_page(
    page: str, demo: tuple[Result, Path]
) -> None:
    embedded = re.findall(r"data:image/(png|svg\+xml);base64,([A-Za-z0-9+/=]+)", page)
    assert len(embedded) >= 5
    for kind, data in embedded:
        raw = base64.b64decode(data)
        assert raw.startswith(b"\x89PNG") if kind == "png" else b"<svg" in raw
    assert len(list(demo[1].glob("*.png"))) >= 5


def test_the_page_says_what_the_result_says(page: str, demo: tuple[Result, Path]) -> None:
    result, text = demo[0], words(page)
    value = result.effects[0].parameters["c"][0]
    assert f"{value:.4f}" in text  # 0.2998
    assert result.effects[0].location in text
    assert "quadratic damping" in text.lower()
    assert result.augmented_fmu in text
    for name, error in result.error.items():
        assert name in text
        assert f"{error['before']:.3g}" in text
    for a in result.alternatives[:3]:
        assert a.kind.replace("_", " ") in text.lower()


def test_a_record_without_a_discrepancy_has_its_page_and_names_are_escaped(tmp_path: Path) -> None:
    made = write_null_record(tmp_path, 6998)
    text = made.read_text()
    made.write_text(re.sub(r"^id = .*$", 'id = "<b>bold</b> & sons"', text, flags=re.M))
    result = close_loop(made, tmp_path / "out", jobs=1)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert result.verdict == "no_discrepancy"
    assert "<b>bold</b>" not in page
    assert "&lt;b&gt;bold&lt;/b&gt; &amp; sons" in page
    assert "nan" not in words(page).lower().split()
