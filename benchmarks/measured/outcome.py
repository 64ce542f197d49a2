"""What closing the loop made of a measured benchmark, and the table of all."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from benchmarks.measured.benchmark import Benchmark
from scenarios.closing.result import Result

Answer = Literal["named", "partly named", "left open", "misnamed", "error above target"]
ERRORS = ("declared", "before", "after", "black_box", "noise")
HEAD = ("benchmark", "output", *ERRORS, "target", "verdict", "found", "answer", "CPU, s")


@dataclass(frozen=True)
class Outcome:
    """A benchmark's result beside what is known of it; seconds: of this process's own work."""

    benchmark: Benchmark
    result: Result
    seconds: float

    @property
    def named(self) -> set[tuple[str, str]]:
        """Kind and location of the effects that were given a name."""
        return {(e.kind, e.location) for e in self.result.effects}

    @property
    def answer(self) -> Answer:
        """What the finding is worth: only names that the literature gives count, and no name is no error."""
        if not self.named:
            return "left open"
        if not self.named & self.benchmark.known:
            return "misnamed"
        if self.too_large:
            return "error above target"
        return "named" if self.named <= self.benchmark.known else "partly named"

    @property
    def too_large(self) -> list[str]:
        """Outputs whose error after exceeds the target."""
        return [o for o, most in self.benchmark.target.items() if self.result.error[o]["after"] > most]

    def rows(self) -> list[tuple[str, ...]]:
        """Lines of the table, one an output."""
        found = ", ".join(f"{k} at {at}" for k, at in sorted(self.named)) or "none"
        return [
            (
                self.benchmark.title,
                output,
                *(f"{error[k]:.3g}" if k in error else "" for k in ERRORS),
                f"{self.benchmark.target[output]:g}" if output in self.benchmark.target else "",
                self.result.verdict,
                found,
                self.answer,
                f"{self.seconds:.0f}",
            )
            for output, error in self.result.error.items()
        ]

    def as_json(self) -> dict[str, Any]:
        """The result with what is known."""
        b = self.benchmark
        about = {"missing": b.missing, "source": b.source, "target": dict(b.target), "answer": self.answer}
        return {**about, "cpu_seconds": round(self.seconds, 1), "result": asdict(self.result)}


def table(outcomes: Sequence[Outcome]) -> str:
    """All outcomes as a Markdown table; errors in the unit of the output."""
    lines = [HEAD, tuple("---" for _ in HEAD), *(row for o in outcomes for row in o.rows())]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
