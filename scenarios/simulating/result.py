"""The result of a scenario: its expectations with their verdicts, its recordings and figures."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path


@dataclass(frozen=True)
class Finding:
    """The verdict on an expectation; variant: None if it concerns several variants at once.

    values: the numbers on the sides of its comparisons, in order, None for one that is not finite.
    problem: the reason why it could not be evaluated; it then counts as not met.
    """

    that: str
    because: str
    variant: str | None
    holds: bool
    values: tuple[float | None, ...]
    problem: str | None = None

    @property
    def sentence(self) -> str:
        """The expectation and the numbers found, as a line to print."""
        where = f" [{self.variant}]" if self.variant else ""
        found = ", ".join("nothing" if v is None else f"{v:.5g}" for v in self.values)
        return f"{' '.join(self.that.split())}{where} ({self.problem or found})"


def finite(values: tuple[float, ...]) -> tuple[float | None, ...]:
    """Numbers for JSON, which cannot represent nan."""
    return tuple(v if isfinite(v) else None for v in values)


@dataclass(frozen=True)
class RunSummary:
    """A variant's recording, file names relative to the folder of the result, and how fast it ran."""

    recording: str
    measured: str | None
    simulated_seconds: float | None
    wall_seconds: float
    interrupted_at: float | None
    ended: str = ""  # which FMU asked for the end before the scenario's own, and when

    @property
    def speed(self) -> float | None:
        """Simulated seconds per second."""
        return None if self.simulated_seconds is None else self.simulated_seconds / self.wall_seconds


@dataclass(frozen=True)
class Result:
    """The outcome of a scenario; its files are in `folder`."""

    id: str
    question: str
    folder: Path
    expectations: tuple[Finding, ...]
    runs: Mapping[str, RunSummary]
    figures: tuple[Path, ...]
    wall_seconds: float
    interrupted_at: float | None = None

    @property
    def ok(self) -> bool:
        """Whether the scenario ran to its end and all expectations are met."""
        return self.interrupted_at is None and all(finding.holds for finding in self.expectations)

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The expectations that are not met."""
        return tuple(finding for finding in self.expectations if not finding.holds)

    def write(self, file: Path) -> None:
        """Write as JSON."""
        table = {
            "scenario": self.id,
            "question": self.question,
            "ok": self.ok,
            "expectations": [asdict(finding) for finding in self.expectations],
            "runs": {name: asdict(run) | {"speed": run.speed} for name, run in self.runs.items()},
            "figures": [figure.relative_to(self.folder).as_posix() for figure in self.figures],
            "wall_seconds": self.wall_seconds,
            "interrupted_at": self.interrupted_at,
        }
        file.write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
