"""What compare found, as it is written to result.json and said in lines."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

SMALLEST = 1e-6  # of its nominal value: below it an output is at rest, and its course is rounding


@dataclass(frozen=True)
class Difference:
    """A common output: b less a, in a's unit, over all samples of the record.

    largest is at `time`, s, and without end where one is no number. relative, rms_relative: over the size of
    a's output, its rms, at least SMALLEST of its nominal value; in_noise: the rms over the declared standard
    deviation of the noise. None where that is 0 or not declared.
    """

    unit: str | None
    largest: float
    time: float
    rms: float
    relative: float | None
    rms_relative: float | None
    in_noise: float | None
    agrees: bool


@dataclass(frozen=True)
class Mismatch:
    """What both FMUs say of a variable, differently."""

    variable: str
    what: str
    a: str | float | None
    b: str | float | None


@dataclass(frozen=True)
class Comparison:
    """What compare found; `outputs` from the largest relative difference down."""

    experiment: str
    a: str
    b: str
    a_sha256: str
    b_sha256: str
    tolerance: float
    outputs: Mapping[str, Difference]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    mismatches: tuple[Mismatch, ...]
    not_compared: tuple[str, ...]  # common outputs whose units do not fit

    @property
    def ok(self) -> bool:
        """Whether all common outputs were compared and agree within the tolerance."""
        return not self.not_compared and all(d.agrees for d in self.outputs.values())

    def write(self, file: Path) -> None:
        """Write as JSON, whole or not at all."""
        part = file.with_suffix(".part")
        table = {"ok": self.ok, **asdict(self)}
        table["outputs"] = {n: {k: _known(v) for k, v in d.items()} for n, d in table["outputs"].items()}
        text = json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False)
        part.write_text(f"{text}\n", encoding="utf-8")
        part.replace(file)

    def lines(self) -> Iterator[str]:
        """For people: the verdict, then each output, then what else differs."""
        bad = sum(not d.agrees for d in self.outputs.values()) + len(self.not_compared)
        total = len(self.outputs) + len(self.not_compared)
        verdict = f"{bad} of {total} common outputs differ" if bad else f"all {total} common outputs agree"
        yield f"{verdict} (tolerance {self.tolerance:g} of an output's rms)"
        for name, d in self.outputs.items():
            yield f"  {name}: {_sentence(d)}"
        for name in self.not_compared:
            yield f"  {name}: not compared, its units do not fit"
        for which, file, names in (("first", self.a, self.only_a), ("second", self.b, self.only_b)):
            if names:
                yield f"  only in the {which} FMU, {file}: {', '.join(names)}"
        for m in self.mismatches:
            yield f"  {m.variable}: {m.what} {_shown(m.a)} and {_shown(m.b)}"


def _sentence(d: Difference) -> str:
    if d.largest == 0.0:
        return "the same to the last bit"
    unit = "" if d.unit in (None, "1") else f" {d.unit}"
    parts = [f"largest {d.largest:.3g}{unit} at {d.time:g} s, rms {d.rms:.3g}{unit}"]
    if d.relative is not None and d.rms_relative is not None:
        parts.append(f"{d.relative:.2g} and {d.rms_relative:.2g} of its size")
    if d.in_noise is not None:
        parts.append(f"rms {d.in_noise:.2g} of the noise")
    return ("" if d.agrees else "DIFFERS: ") + "; ".join(parts)


def _shown(value: str | float | None) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else value


def _known(value: Any) -> Any:
    """A number for JSON, which knows none without end."""
    return None if isinstance(value, float) and not isfinite(value) else value
