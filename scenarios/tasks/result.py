"""What the results of commands that do many tasks have in common."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from scenarios.shown import Shown


@dataclass(frozen=True, repr=False, kw_only=True)
class TasksResult(Shown):
    """A result of many tasks; each field is a key of result.json.

    tasks: how many are `planned`, `finished`, `failed` (answered with a reason) and `left` (not done, with a
    reason that may pass). railfmi, program_sha256: version and checksum of the program that did them.
    """

    tasks: dict[str, int]
    railfmi: str
    program_sha256: str
    wall_seconds: float

    @property
    def complete(self) -> bool:
        """Whether each task has an answer, if only the reason why there is none."""
        return self.tasks["left"] == 0

    def write(self, file: Path) -> None:
        """Write as JSON."""
        file.write_text(json.dumps(asdict(self), indent=1, ensure_ascii=False), encoding="utf-8")
