"""What a stream was until it ended, as it is printed and written as watch.json."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from scenarios.drawing.typography import with_error
from scenarios.output import written
from scenarios.watching.checkpoint import Counts
from scenarios.watching.tracing import Answer

RESULT = "watch.json"


@dataclass(frozen=True)
class WatchResult:
    """The state at the end: counts, time of the last sample [s], share of the reference that is learned,
    estimates with their standard deviations by NAME and NAME_std, the last alarms and what was found about
    the last events.
    """

    experiment: str
    counts: Counts
    until: float
    learned: float
    estimates: dict[str, float]
    alarms: tuple[str, ...]
    answers: tuple[Answer, ...]

    def lines(self) -> Iterator[str]:
        """The result in a few lines."""
        c = self.counts
        states = {
            "tested": c.tested, "learned from": c.learning, "outside the triggers": c.outside,
            "late or repeated": c.past, "not usable": c.unusable,
        }  # fmt: skip
        found = ", ".join(f"{n} {name}" for name, n in states.items() if n)
        yield f"{self.experiment}: {c.windows} windows" + (f" ({found})" if found else "")
        for name, value in self.estimates.items():
            if f"{name}_std" in self.estimates:
                yield f"{name} = {with_error(value, self.estimates[f'{name}_std'])}"
        if self.learned < 1:
            yield f"what is usual is not learned yet ({self.learned:.0%}), so nothing was tested"
        yield f"alarms: {c.alarms}"
        yield from (f"  {alarm}" for alarm in self.alarms)
        yield from (f"  {answer.sentence}" for answer in self.answers)

    def write(self, file: Path) -> None:
        """Write the result as JSON."""
        told: dict[str, Any] = asdict(self)
        told["until"] = self.until if isfinite(self.until) else None
        written(file, json.dumps(told, indent=1, ensure_ascii=False) + "\n")
