"""What a record of the challenge was made with: kept in a file apart from the record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from estimator.sensor_faults import FAULTS

Pair = tuple[str, str]  # kind, location
Scalars = Mapping[str, float | list[float] | str]

# group: share of the set in 240
SHARES = {"none": 100, "single": 60, "outside": 30, "confusable": 20, "sensor": 20, "double": 10}
SYSTEMS = ("rig", "vehicle", "wheelset")


@dataclass(frozen=True)
class Item:
    """One effect: kind, location, and its true parameters by the names of docs/effects.md, SI."""

    kind: str
    location: str
    parameters: Scalars = field(default_factory=dict)

    @property
    def pair(self) -> Pair:
        """Kind and location."""
        return self.kind, self.location

    @property
    def is_fault(self) -> bool:
        """A fault of a sensor."""
        return self.kind in FAULTS


@dataclass(frozen=True)
class Truth:
    """Truth of one record.

    items: the effects, none of a record without; snr: rms change of each output by them over its noise;
    near: pairs that are nearly what happened, where it is outside the vocabulary; quiet: whether
    no_discrepancy is a right answer, since the data cannot show the effect.
    """

    name: str
    group: str
    system: str
    items: tuple[Item, ...] = ()
    true: Mapping[str, float] = field(default_factory=dict)  # parameters that differ from the declared ones
    noise: Mapping[str, float] = field(default_factory=dict)
    snr: Mapping[str, float] = field(default_factory=dict)
    near: tuple[Pair, ...] = ()
    quiet: bool = False
    note: str = ""
    each: tuple[float, ...] = ()  # of several effects, the largest ratio of each alone

    @property
    def largest_snr(self) -> float:
        """The largest of the outputs' ratios, 0 without an effect."""
        return max(self.snr.values(), default=0.0)

    @property
    def label(self) -> str:
        """kind@location of each, joined."""
        return " + ".join(f"{i.kind}@{i.location}" for i in self.items) or "none"

    def write(self, path: Path) -> None:
        """Write as JSON, whole or not at all."""
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        part.replace(path)

    @classmethod
    def read(cls, path: Path) -> Truth:
        """Read what `write` wrote."""
        d = json.loads(path.read_text(encoding="utf-8"))
        items = tuple(Item(**i) for i in d.pop("items"))
        near = tuple((k, p) for k, p in d.pop("near"))
        return cls(**d | {"items": items, "near": near, "each": tuple(d["each"])})
