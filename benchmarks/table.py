"""The results of a run: as JSON, as the table on the screen, and as the page in docs."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.figure import write_figure
from benchmarks.group import Curve, Row

COLUMNS = ("measurement", "railfmi", "peer", "of peer", "unit", "ratio", "quartiles")
NAME, FIGURE, PAGE = "benchmarks.json", "benchmarks.png", "speed.md"


@dataclass
class Results:
    """Rows and curves by group, with the machine that they are from."""

    machine: Mapping[str, Any]
    quick: bool
    rows: dict[str, list[Row]] = field(default_factory=dict)
    curves: list[Curve] = field(default_factory=list)

    def add(self, group: str, found: Row | Curve) -> None:
        """Add a row or a curve."""
        if isinstance(found, Row):
            self.rows.setdefault(group, []).append(found)
        else:
            self.curves.append(found)

    def write(self, folder: Path) -> None:
        """Write the JSON file, and the figure if there are curves."""
        folder.mkdir(parents=True, exist_ok=True)
        kept = {
            "machine": dict(self.machine),
            "quick": self.quick,
            "rows": [{"group": g, **asdict(row)} for g, rows in self.rows.items() for row in rows],
            "curves": [asdict(curve) for curve in self.curves],
        }
        (folder / NAME).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        if self.curves:
            write_figure(self.curves, folder / FIGURE)

    def text(self) -> str:
        """The table with aligned columns."""
        body = [cells(row) for rows in self.rows.values() for row in rows]
        table = [list(COLUMNS), *body]
        widths = [max(len(line[k]) for line in table) for k in range(len(COLUMNS))]
        lines = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) for line in table]
        return "\n".join(line.rstrip() for line in lines) + "\n"

    def page(self) -> str:
        """The page of docs, which is written by a run only."""
        return "\n".join(self._lines()) + "\n"

    def _lines(self) -> Iterator[str]:
        yield "# Speed"
        yield ""
        yield "This page is written by `python -m benchmarks --write docs`. How to read and repeat it is told"
        yield f"in [benchmarks/README.md](../benchmarks/README.md); all digits are in [{NAME}]({NAME})."
        yield ""
        if self.quick:
            yield "It is from a quick run, with few rounds of short runs: it shows the order of size only."
            yield ""
        yield from _list(self.machine)
        for group, rows in self.rows.items():
            yield from ("", f"## {group}", "", f"| {' | '.join(COLUMNS)} | what was compared |")
            yield "|---" * (len(COLUMNS) + 1) + "|"
            yield from (f"| {' | '.join(cells(row))} | {row.how} |" for row in rows)
        if self.curves:
            yield from ("", "## Figure", "", f"![Cost by number, in four panels]({FIGURE})", "")
            yield "Dashed: the first point of each line, scaled in proportion to the number (for cores,"
            yield "divided by it)."


def cells(row: Row) -> list[str]:
    """A row as text."""
    spread = "-" if row.spread is None else f"{row.spread[0]:.3g} to {row.spread[1]:.3g}"
    peer, ratio = ("-" if v is None else f"{v:.3g}" for v in (row.value, row.ratio))
    return [row.name, f"{row.ours:.3g}", row.peer, peer, row.unit, ratio, spread]


def _list(machine: Mapping[str, Any]) -> Iterator[str]:
    for name, value in machine.items():
        said: Sequence[str] = (
            [f"{k} {v}" for k, v in value.items()] if isinstance(value, dict) else [str(value)]
        )
        yield f"- {name.replace('_', ' in ')}: {', '.join(said)}"
