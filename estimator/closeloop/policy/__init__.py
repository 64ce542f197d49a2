"""Every limit that can change an answer, with its value, unit, meaning and source, in one object.

A limit is listed here if another value could lead to another verdict or another effect. Constants that only
change the computing time or the last digits of a result are kept beside the code that uses them.

The source is a paper, a derivation given in words, a convention, or a calibration. A calibration names the
challenge on whose records the value was found; such a limit is empirical.
"""

from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any

from estimator.closeloop.policy.candidates import CandidatePolicy
from estimator.closeloop.policy.decision import DecisionPolicy
from estimator.closeloop.policy.detection import DetectionPolicy
from estimator.closeloop.policy.inputs import InputPolicy
from estimator.closeloop.policy.interval import IntervalPolicy
from estimator.closeloop.policy.prior import PriorPolicy
from estimator.closeloop.policy.search import SearchPolicy
from estimator.closeloop.policy.start import StartPolicy
from estimator.limits import Limits

__all__ = [
    "DEFAULT",
    "CandidatePolicy",
    "DecisionPolicy",
    "DetectionPolicy",
    "InputPolicy",
    "IntervalPolicy",
    "Policy",
    "PriorPolicy",
    "SearchPolicy",
    "StartPolicy",
]


@dataclass(frozen=True)
class Policy(Limits):
    """All limits, grouped by the stage of a run that they decide."""

    start: StartPolicy = field(default_factory=StartPolicy)
    inputs: InputPolicy = field(default_factory=InputPolicy)
    detection: DetectionPolicy = field(default_factory=DetectionPolicy)
    candidates: CandidatePolicy = field(default_factory=CandidatePolicy)
    search: SearchPolicy = field(default_factory=SearchPolicy)
    interval: IntervalPolicy = field(default_factory=IntervalPolicy)
    decision: DecisionPolicy = field(default_factory=DecisionPolicy)
    prior: PriorPolicy = field(default_factory=PriorPolicy)

    def limits(self) -> Iterator[tuple[str, Any, Field[Any]]]:
        """Name (group.limit), value and field of each limit."""
        for stage in fields(self):
            group = getattr(self, stage.name)
            if is_dataclass(group):
                for f in fields(group):
                    yield f"{stage.name}.{f.name}", getattr(group, f.name), f

    def table(self) -> str:
        """One Markdown table per group; docs/policy.md holds the tables of the default policy."""
        lines: list[str] = []
        stage = ""
        for name, value, about in self.limits():
            now, _, short = name.partition(".")
            if now != stage:
                stage = now
                lines += ["", f"## {stage.capitalize()}", "", "| limit | value | unit | meaning | source |"]
                lines += ["|---|---|---|---|---|"]
            m = about.metadata
            lines.append(f"| `{short}` | {value:g} | {m['unit']} | {m['meaning']} | {m['source']} |")
        return "\n".join(lines).strip() + "\n"


DEFAULT = Policy()
