"""The result of compare, as it is written to result.json and printed in lines."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.output import written
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

SMALLEST = 1e-6  # share of the nominal value below which an output is rounding error at rest


@dataclass(frozen=True)
class Difference:
    """The difference b minus a of a common output, in the unit of `a`, over all samples of the record.

    largest: the largest difference, at `time` in s; infinite if one of the two outputs is not a number.
    relative, rms_relative: divided by the rms of the output of `a`, or by SMALLEST times its nominal value if
    this is larger.
    in_noise: rms of the difference over the declared standard deviation of the noise, None without one.
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
    """An attribute of a variable that differs between the FMUs."""

    variable: str
    what: str
    a: str | float | None
    b: str | float | None


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """The result of compare; `outputs` is sorted by the relative difference, the largest first."""

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
    not_compared: tuple[str, ...]  # common outputs whose units cannot be converted

    @property
    def ok(self) -> bool:
        """Whether all common outputs were compared and agree within the tolerance."""
        return not self.not_compared and all(d.agrees for d in self.outputs.values())

    def write(self, file: Path) -> None:
        """Write the result as JSON; an interrupted write leaves no partial file."""
        table = {"ok": self.ok, **asdict(self)}
        table["outputs"] = {n: {k: _known(v) for k, v in d.items()} for n, d in table["outputs"].items()}
        text = json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False)
        written(file, f"{text}\n")

    def lines(self) -> list[str]:
        """The verdict, then each output, then other differences."""
        return [*self._lines()]

    def to_frame(self) -> "pd.DataFrame":
        """A row for each common output; `largest` and `rms` in its unit, `time` in s."""
        import pandas as pd  # takes longer to load than what needs no table

        rows = {name: asdict(d) for name, d in self.outputs.items()}
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("output")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The largest difference of each output over its rms, and the tolerance."""
        drawn = axes_or_new(ax)
        sizes = {name: max(d.relative or 0.0, 1e-17) for name, d in self.outputs.items()}
        drawn.barh(list(sizes), list(sizes.values()))
        drawn.axvline(max(self.tolerance, 1e-17), color="0.3", linestyle="--")
        drawn.set(xscale="log", xlabel="largest difference over the output's rms")
        return drawn

    def _lines(self) -> Iterator[str]:
        bad = sum(not d.agrees for d in self.outputs.values()) + len(self.not_compared)
        total = len(self.outputs) + len(self.not_compared)
        verdict = f"{bad} of {total} common outputs differ" if bad else f"all {total} common outputs agree"
        yield f"{verdict} (tolerance {self.tolerance:g} of an output's rms)"
        for name, d in self.outputs.items():
            yield f"  {name}: {_sentence(d)}"
        for name in self.not_compared:
            yield f"  {name}: not compared, because its units cannot be converted"
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
    """A number for JSON, which cannot represent infinity."""
    return None if isinstance(value, float) and not isfinite(value) else value
