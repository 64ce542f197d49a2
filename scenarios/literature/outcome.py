"""The result of a row: its numbers beside those of the source, and the files written."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from scenarios.drawing.sheet import Plot
from scenarios.output import writable, written_at_once

Bound = Literal["<=", ">="]


@dataclass(frozen=True)
class Finding:
    """One number of a case: its meaning, our value, the source's value if it gives one, and the target.

    note: an explanation of the number, if it needs one.
    """

    case: str
    what: str
    unit: str
    ours: float
    source: float | None = None
    target: float | None = None
    bound: Bound = "<="
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None where there is none. What is not finite meets none."""
        if self.target is None:
            return None
        return self.ours <= self.target if self.bound == "<=" else self.ours >= self.target

    @property
    def wanted(self) -> str:
        """The target with its bound; empty where there is none."""
        return "" if self.target is None else f"{self.bound} {self.target:.4g}"


@dataclass(frozen=True)
class Outcome:
    """All findings of a row, its figures, and notes needed to understand them."""

    row: str
    findings: Sequence[Finding]
    plots: Sequence[Plot]
    notes: Sequence[str] = ()

    @property
    def missed(self) -> list[Finding]:
        """The findings that do not meet their target."""
        return [f for f in self.findings if f.met is False]

    @property
    def aimed(self) -> int:
        """How many findings have a target."""
        return sum(f.target is not None for f in self.findings)

    @property
    def met(self) -> int:
        """How many of them meet it."""
        return self.aimed - len(self.missed)

    @property
    def ok(self) -> bool:
        """Whether every target is met."""
        return not self.missed

    def result(self) -> dict[str, Any]:
        """The contents of result.json."""
        found = [{**vars(f), "met": f.met} for f in self.findings]
        return {"row": self.row, "ok": self.ok, "findings": found, "notes": list(self.notes)}

    def write(self, folder: Path) -> None:
        """Write result.json, table.md and the figures; none is if one cannot be written."""
        with written_at_once(writable(folder)) as part:
            (part / "result.json").write_text(json.dumps(self.result(), indent=1), encoding="utf-8")
            (part / "table.md").write_text(table(self.findings), encoding="utf-8")
            for plot in self.plots:
                plot.write(part)


def table(findings: Sequence[Finding]) -> str:
    """Findings as a table in Markdown."""
    lines = ["| case | what | source | ours | target | met |", "|---|---|---|---|---|---|"]
    for f in findings:
        source = "" if f.source is None else f"{f.source:.4g}"
        met = {None: "", True: "yes", False: "**no**"}[f.met]
        what = f"{f.what} [{f.unit}]" if f.unit != "1" else f.what
        lines.append(f"| {f.case} | {what} | {source} | {f.ours:.4g} | {f.wanted} | {met} |")
        if f.note:
            lines[-1] = lines[-1].removesuffix(" |") + f" {f.note} |"
    return "\n".join(lines) + "\n"
