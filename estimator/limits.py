"""Limits that can change what is said, with value, unit, meaning and source, in one object a room."""

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields
from typing import Any


def limit(value: Any, unit: str, meaning: str, source: str) -> Any:
    """A field of limits with its default value, unit, meaning and source."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})


@dataclass(frozen=True)
class Limits:
    """What the limits of a room have in common; each field is one, made by `limit`.

    A limit is listed if another value could lead to another sentence, alarm or interval. Constants that only
    change the computing time or the last digits stay beside the code that uses them.
    """

    @property
    def values(self) -> dict[str, Any]:
        """All limits by name, as they stand in a result."""
        return asdict(self)

    @property
    def version(self) -> str:
        """A short hash of all values: what has the same version was said with the same limits."""
        return hashlib.sha256(json.dumps(self.values, sort_keys=True).encode()).hexdigest()[:12]

    def table(self) -> str:
        """A Markdown table of all limits, as it stands in the documentation."""
        lines = ["| limit | value | unit | meaning | source |", "|---|---|---|---|---|"]
        for f in fields(self):
            m = f.metadata
            value = f"{getattr(self, f.name):g}"
            lines.append(f"| `{f.name}` | {value} | {m['unit']} | {m['meaning']} | {m['source']} |")
        return "\n".join(lines) + "\n"
