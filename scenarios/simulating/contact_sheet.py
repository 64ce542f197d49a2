"""One picture of all figures of several scenarios, with their verdicts."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from scenarios.drawing.sheet import INK, LAW, NOISE
from scenarios.simulating.result import Result

TILE = (520, 460)  # px, of a figure with its line of text
TEXT = 40  # px, above a figure
MARGIN = 14  # px
COLUMNS = 5
FONT = 17  # px


def write_contact_sheet(results: Sequence[Result], target: Path) -> Path:
    """Write the figures of all results as one PNG, each with its scenario's id and verdict."""
    tiles = [(result, figure) for result in results for figure in (result.figures or (None,))]
    columns = min(COLUMNS, len(tiles))
    size = (columns * TILE[0], ceil(len(tiles) / columns) * TILE[1])
    page = Image.new("RGB", size, "white")
    for i, (result, figure) in enumerate(tiles):
        page.paste(_tile(result, figure), (i % columns * TILE[0], i // columns * TILE[1]))
    page.save(target, optimize=True)
    return target


def _tile(result: Result, figure: Path | None) -> Image.Image:
    """A figure at a small size, below the scenario's id and its verdict."""
    tile = Image.new("RGB", TILE, "white")
    pen, font = ImageDraw.Draw(tile), ImageFont.load_default(FONT)
    held = sum(finding.holds for finding in result.expectations)
    if result.interrupted_at is not None:
        verdict = f"interrupted at {result.interrupted_at:g} s"
    else:
        verdict = f"{held} of {len(result.expectations)} expectations met"
    pen.text((MARGIN, MARGIN), result.id, INK, font)
    width = pen.textlength(verdict, font)
    pen.text((TILE[0] - MARGIN - width, MARGIN), verdict, NOISE if result.ok else LAW, font)
    if figure is not None:
        with Image.open(figure) as picture:
            small = picture.convert("RGB")
            small.thumbnail((TILE[0] - 2 * MARGIN, TILE[1] - TEXT - MARGIN), Image.Resampling.LANCZOS)
            tile.paste(small, (MARGIN, TEXT))
    return tile
