"""The stored results of all importers, and the page that shows them.

A row is one FMU in one tool. Rows of tools that are not on a machine stay as they were recorded elsewhere.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.contracts.interop.importer import Importer
from tests.helpers.paths import ROOT

RESULTS = Path(__file__).with_name("results.json")
PAGE = ROOT / "docs" / "compatibility.md"
BEGIN, END = "<!-- table: begin -->\n", "<!-- table: end -->\n"


@dataclass(frozen=True)
class Row:
    """What one tool made of one FMU."""

    tool: str
    version: str
    model: str
    build: str
    fmi: int
    kind: str
    difference: float | None  # of a signal's largest value; None where it did not run
    said: str  # why it did not run
    date: str  # YYYY-MM-DD

    @property
    def key(self) -> tuple[str, int, str, str, str]:
        """What a later run replaces."""
        return self.tool, self.fmi, self.kind, self.build, self.model


def stored(file: Path = RESULTS) -> list[Row]:
    """The rows of all runs that were recorded."""
    return [Row(**row) for row in json.loads(file.read_text())] if file.exists() else []


def keep(rows: Iterable[Row], file: Path = RESULTS) -> None:
    """Write rows over those of the same FMU in the same tool."""
    merged = {row.key: row for row in (*stored(file), *rows)}
    lines = [json.dumps(asdict(merged[key])) for key in sorted(merged)]
    file.write_text("[\n" + ",\n".join(lines) + "\n]\n")


def write_page(tools: Sequence[type[Importer]], page: Path = PAGE, results: Path = RESULTS) -> None:
    """Put the table of the stored rows into the page."""
    before, rest = page.read_text().split(BEGIN)
    _, after = rest.split(END)
    page.write_text(before + BEGIN + "\n" + table(tools, stored(results)) + "\n" + END + after)


def table(tools: Sequence[type[Importer]], rows: Sequence[Row]) -> str:
    """The rows of the page: one for each tool, FMI version, kind of simulation and build."""
    lines = [
        "| tool | version | FMI | simulation | build | models that ran | largest difference | date |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for tool in tools:
        groups: dict[tuple[int, str, str], list[Row]] = {}
        for row in rows:
            if row.tool == tool.name:
                groups.setdefault((row.fmi, row.kind, row.build), []).append(row)
        lines += [_line(tool, groups[key]) for key in sorted(groups)]
    return "\n".join(lines) + "\n"


def _line(tool: type[Importer], rows: Sequence[Row]) -> str:
    first = rows[0]
    ran = [row.difference for row in rows if row.difference is not None]
    solver = {"CS": "CS", "ME": f"ME, {SOLVERS.get(tool.solver, '')}"}[first.kind]
    cells = (
        tool.name,
        ", ".join(sorted({row.version for row in rows})) or "tells none",
        f"{first.fmi}.0",
        solver,
        first.build,
        f"{len(ran)} of {len(rows)}",
        shown(max(ran)) if ran else tool.fails.get((first.build, first.kind, first.fmi), first.said),
        max(row.date for row in rows),
    )
    return f"| {' | '.join(cells)} |"


SOLVERS = {"cvode": "CVode", "euler": "Euler"}


def shown(difference: float) -> str:
    """A difference with one digit."""
    return f"{difference:.0e}".replace("e-0", "e-") if difference else "0"
