"""The result of close-loop on a measured benchmark, and the table of all results."""

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
    """The result of a benchmark with what the literature knows; seconds: processor time."""

    benchmark: Benchmark
    result: Result
    seconds: float

    @property
    def named(self) -> set[tuple[str, str]]:
        """Kind and location of the effects in the answer."""
        return {(e.kind, e.location) for e in self.result.effects}

    @property
    def answer(self) -> Answer:
        """The grade of the answer: only effects known from the literature are right; no name is no error."""
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
        """Lines of the table, one per output."""
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
        """The result with what the literature knows, for JSON."""
        b = self.benchmark
        about = {"missing": b.missing, "source": b.source, "target": dict(b.target), "answer": self.answer}
        return {**about, "cpu_seconds": round(self.seconds, 1), "result": asdict(self.result)}


def table(outcomes: Sequence[Outcome]) -> str:
    """All outcomes as a Markdown table; errors in the unit of the output."""
    lines = [HEAD, tuple("---" for _ in HEAD), *(row for o in outcomes for row in o.rows())]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
