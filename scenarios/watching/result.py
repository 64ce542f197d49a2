"""What a stream was until it ended, as it is printed and written as watch.json."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from estimator.monitoring.policy import POLICY as OF_TEST
from scenarios.drawing.typography import with_error
from scenarios.output import written
from scenarios.shown import Shown, axes_or_new
from scenarios.watching.checkpoint import Counts
from scenarios.watching.policy import POLICY
from scenarios.watching.tracing import Answer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RESULT = "watch.json"


@dataclass(frozen=True, repr=False)
class WatchResult(Shown):
    """The state at the end: counts, time of the last sample [s], share of the reference that is learned,
    estimates with their standard deviations by NAME and NAME_std, the last alarms and what was found about
    the last events. limits: those by which the stream was tested, by name.
    """

    experiment: str
    counts: Counts
    until: float
    learned: float
    estimates: dict[str, float]
    alarms: tuple[str, ...]
    answers: tuple[Answer, ...]
    limits: dict[str, float] = field(default_factory=lambda: {**OF_TEST.values, **POLICY.values})

    def lines(self) -> list[str]:
        """See Shown.lines."""
        return [*self._lines()]

    def to_frame(self) -> pd.DataFrame:
        """The last estimates with their standard deviations, a row each."""
        kept = {n: v for n, v in self.estimates.items() if f"{n}_std" in self.estimates}
        std = [self.estimates[f"{name}_std"] for name in kept]
        return pd.DataFrame({"value": [*kept.values()], "std": std}, index=[*kept])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """How many windows were tested, learned from, or not used, and how many alarms there were."""
        drawn = axes_or_new(ax)
        counts = {"windows": self.counts.windows, **self._uses(), "alarms": self.counts.alarms}
        drawn.barh([*counts], [*counts.values()])
        drawn.set(xlabel="number", title=self.experiment)
        return drawn

    def _uses(self) -> dict[str, int]:
        """What windows were used for, or why not."""
        c = self.counts
        return {
            "tested": c.tested, "learned from": c.learning, "outside the triggers": c.outside,
            "late or repeated": c.past, "not usable": c.unusable,
        }  # fmt: skip

    def _lines(self) -> Iterator[str]:
        c = self.counts
        found = ", ".join(f"{n} {name}" for name, n in self._uses().items() if n)
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
