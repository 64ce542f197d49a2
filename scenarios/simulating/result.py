"""The result of a scenario: its expectations with their verdicts, its recordings and figures."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.errors import BadInput, did_you_mean
from fmus.host.master.recording import read_recording
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


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


@dataclass(frozen=True, repr=False)
class Result(Shown):
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

    def lines(self) -> list[str]:
        """How many expectations are met, and those that are not."""
        held = len(self.expectations) - len(self.failed)
        if self.interrupted_at is not None:
            said = f"interrupted at {self.interrupted_at:g} s; the recording up to then is kept"
        else:
            said = f"{held} of {len(self.expectations)} expectations met ({self.wall_seconds:.1f} s)"
        lines = [f"{self.id}: {said}"]
        for name, ran in self.runs.items():
            if ran.ended:
                which = f" of variant '{name}'" if len(self.runs) > 1 else ""
                lines.append(f"  the run{which} ended early: {ran.ended}")
        lines += [f"  not met: {finding.sentence}; {finding.because}" for finding in self.failed]
        return lines

    def to_frame(self) -> "pd.DataFrame":
        """A row for each expectation: variant, whether it holds, its reason, and the numbers found."""
        import pandas as pd  # takes longer to load than what needs no table

        rows = [asdict(finding) for finding in self.expectations]
        columns = ["that", "variant", "holds", "values", "because", "problem"]
        return pd.DataFrame(rows, columns=columns).set_index("that")

    def recording(self, variant: str | None = None) -> "pd.DataFrame":
        """What was recorded of a variant, by default the first: a column for each variable over time, s.

        Units are in `attrs["units"]`, by column. The index is the time, of a contact table the shift, m.
        Raises BadInput if no such variant was run.
        """
        name = next(iter(self.runs), "") if variant is None else variant
        if name not in self.runs:
            raise BadInput(f"{self.id}: no variant '{name}' was run; {did_you_mean(name, self.runs)}")
        read = read_recording(self.folder / self.runs[name].recording)
        table = read.data.set_index(read.data.columns[0])
        table.attrs["units"] = {n: read.units[n] for n in table.columns if read.units[n] is not None}
        return table

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The first variable that was recorded, of every variant."""
        drawn = axes_or_new(ax)
        for name in self.runs:
            table = self.recording(name)
            first = table.columns[0]
            unit = table.attrs["units"].get(first)
            drawn.plot(table.index, table[first], label=name, linewidth=0.9)
            drawn.set(xlabel=table.index.name, ylabel=f"{first} in {unit}" if unit else first)
        drawn.legend()
        return drawn

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
