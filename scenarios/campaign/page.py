"""The page of a campaign and its figures: indices with their intervals, and measures over what was varied."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.campaign.campaign import Assembled, Row
from scenarios.campaign.indices import Index
from scenarios.campaign.result import Measured
from scenarios.drawing.pages import rendered
from scenarios.drawing.sheet import AFTER, BEFORE, CLOUD, Plot, legend, name_axes, sheet, sheets
from scenarios.drawing.typography import NOTHING, number
from scenarios.output import written

HERE = Path(__file__).parent
LISTED = 100  # failures on the page
SCATTERED = 12  # panels of a measure over a key, those with the largest total index first
BESIDE = 2  # panels beside one another
INDEX_ROW = 0.42  # inches of a key


def write_page(folder: Path, found: Assembled) -> None:
    """Write campaign.html and its figures into a folder; the page loads no other file."""
    r = found.result
    page = rendered(
        HERE,
        "page.html.j2",
        result=r,
        headline=r.headline.partition(": ")[2],
        measured=[_measured(m) for m in r.measured],
        indices=[_index(i) for i in r.indices],
        index_figures=[p.embedded(folder) for p in index_plots(r.indices)],
        scatters=[p.embedded(folder) for p in scatter_plots(found)],
        failed=r.failed[:LISTED],
    )
    written(folder / "campaign.html", page)


def _measured(m: Measured) -> dict[str, str]:
    texts = [
        NOTHING if v is None else number(v, 4) for v in (m.least, *m.quantiles, m.greatest, m.mean, m.std)
    ]
    keys = ("least", "low", "median", "high", "greatest", "mean", "std")
    return {"measure": m.measure, "points": str(m.points), **dict(zip(keys, texts, strict=True))}


def _index(i: Index) -> dict[str, Any]:
    return {
        "measure": i.measure,
        "key": i.key,
        "first": f"{i.first:.3f}",
        "first_interval": f"{i.first_low:.3f} to {i.first_high:.3f}",
        "total": f"{i.total:.3f}",
        "total_interval": f"{i.total_low:.3f} to {i.total_high:.3f}",
        "used": i.used,
    }


def index_plots(indices: Sequence[Index]) -> Iterator[Plot]:
    """First and total indices of each measure, with their intervals."""
    for n, measure in enumerate(dict.fromkeys(i.measure for i in indices)):
        some = [i for i in indices if i.measure == measure]
        figure, axes = sheet(0.9 + INDEX_ROW * len(some), [["a"]])
        ax, at = axes["a"], np.arange(len(some))
        for shift, colour, word, name in (
            (-0.17, BEFORE, "alone", "first"), (0.17, AFTER, "with all others", "total"),
        ):  # fmt: skip
            value, low, high = (np.array([getattr(i, name + e) for i in some]) for e in ("", "_low", "_high"))
            ax.barh(at + shift, value, height=0.3, color=colour, label=word)
            ax.hlines(at + shift, low, high, color="black", linewidth=0.9)
        ax.set_yticks(at, short_names([i.key for i in some]), fontsize=8)
        ax.invert_yaxis()
        legend(figure, ax)
        name_axes(ax, f"share of the variance of {measure}")
        yield Plot(f"indices_{n + 1}", figure, f"Sobol's indices of {measure}; lines: 95 % intervals.")


def short_names(keys: Sequence[str]) -> list[str]:
    """The last part of each key, or whole keys where these are not unique."""
    last = [key.rpartition(".")[2] for key in keys]
    return last if len({*last}) == len(last) else list(keys)


def scatter_plots(found: Assembled) -> Iterator[Plot]:
    """Measures over varied keys, the strongest pairs first; the points of all simulations."""
    strength = {(i.measure, i.key): i.total for i in found.result.indices}
    varied = list(found.plan.declared.vary)
    names = dict(zip(varied, short_names(varied), strict=True))
    pairs = [(m, k) for m in found.plan.declared.measure for k in varied]
    pairs.sort(key=lambda pair: -strength.get(pair, 0.0))
    pairs = pairs[:SCATTERED]
    rows = [pairs[i : i + BESIDE] for i in range(0, len(pairs), BESIDE)]
    for ending, some in sheets(rows, 3):
        layout = [[f"{i}.{min(j, len(row) - 1)}" for j in range(BESIDE)] for i, row in enumerate(some)]
        figure, axes = sheet(0.3 + 2.0 * len(some), layout)
        for i, row in enumerate(some):
            for j, (measure, key) in enumerate(row):
                _scatter(axes[f"{i}.{j}"], found.rows, measure, key, names[key])
        yield Plot(f"scatter{ending}", figure, "Measures over varied keys, a point for each simulation.")


def _scatter(ax: Any, rows: Sequence[Row], measure: str, key: str, name: str) -> None:
    known = [row for row in rows if row[measure] is not None]
    x = [row[key] for row in known]
    if any(isinstance(v, str) for v in x):
        names = list(dict.fromkeys(map(str, x)))
        x = [names.index(str(v)) for v in x]
        ax.set_xticks(range(len(names)), names, fontsize=6)
    ax.plot(x, [row[measure] for row in known], ".", color=AFTER if len(known) < 500 else CLOUD, markersize=3)
    name_axes(ax, name, measure)
