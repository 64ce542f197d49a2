"""The truth of a record of the challenge, which is kept in a separate file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from estimator.sensor_faults import FAULTS

Pair = tuple[str, str]  # kind, location
Scalars = Mapping[str, float | list[float] | str]

# number of records of each group in a set of 240
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
        """Whether it is a sensor fault."""
        return self.kind in FAULTS


@dataclass(frozen=True)
class Truth:
    """The truth of one record.

    items: its effects, possibly none; noise: of the sensors; snr: rms change of each output by the effects
    over the noise there, of the sensor and of what noise of the recorded inputs does to it; near: kind and
    location of effects that are nearly equivalent, if the true one is not in the library; quiet: whether
    no_discrepancy is a right answer because the data cannot show the effect.
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
    each: tuple[float, ...] = ()  # for several effects, the largest signal-to-noise ratio of each alone
    left: tuple[float, ...] = ()  # the ratio of each effect that is left after calibration, see `left_over`
    way: str = "white"  # how the record is measured

    @property
    def largest_snr(self) -> float:
        """The largest signal-to-noise ratio of an output, 0 without an effect."""
        return max(self.snr.values(), default=0.0)

    @property
    def label(self) -> str:
        """kind@location of each effect, joined."""
        return " + ".join(f"{i.kind}@{i.location}" for i in self.items) or "none"

    def write(self, path: Path) -> None:
        """Write as JSON, by a temporary file so that the file is always complete."""
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        part.replace(path)

    @classmethod
    def read(cls, path: Path) -> Truth:
        """Read a truth written by `write`."""
        d = json.loads(path.read_text(encoding="utf-8"))
        items = tuple(Item(**i) for i in d.pop("items"))
        near = tuple((k, p) for k, p in d.pop("near"))
        return cls(
            **d | {"items": items, "near": near, "each": tuple(d["each"]), "left": tuple(d.get("left", ()))}
        )
