"""What `railfmi bifurcation` has found, and the files that hold it."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, pi
from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.bifurcation.branch import Branch, Change, Fold
from scenarios.bifurcation.equilibria import Crossing, Rest
from scenarios.bifurcation.released import Release
from scenarios.bifurcation.shooting import Cycle
from scenarios.drawing.typography import quantity, unit, with_error
from scenarios.output import written

KINK = 5e-3  # of the range, by which the smallest cycle may be off the crossing where rest is smooth
LEAST = 1e-6  # of a value, by which it is said to be uncertain
ROUGH = 1e-2  # error of a multiplier, from which the multipliers of a branch are told to be rough


@dataclass(frozen=True)
class Limb:
    """A branch of limit cycles with its folds, other changes of its stability, and simulations beside it.

    reach: the range over which the parameter is varied.
    """

    reach: float
    branch: Branch
    folds: tuple[Fold, ...]
    changes: tuple[Change, ...]
    releases: tuple[Release, ...]

    @property
    def start(self) -> float | None:
        """The parameter of the smallest cycle."""
        return self.branch.cycles[0].parameter if self.branch.cycles else None

    @property
    def kinked(self) -> bool:
        """Whether small motions are not those of the rates: the equations have a kink at rest."""
        return self.start is not None and abs(self.start - self.branch.crossing.parameter) > KINK * self.reach

    @property
    def error(self) -> float:
        """By how much the multiplier that has to be 1 misses it, at most."""
        return max((cycle.error for cycle in self.branch.cycles), default=0.0)


@dataclass(frozen=True)
class Bifurcation:
    """The question as understood, positions of rest, where they become unstable, and branches of cycles."""

    fmu: str
    parameter: str
    output: str
    low: float
    high: float
    held: Mapping[str, float]
    states: tuple[str, ...]
    step: float
    parameter_unit: str | None
    output_unit: str | None
    rests: tuple[Rest, ...]
    crossings: tuple[Crossing, ...]
    limbs: tuple[Limb, ...]

    @property
    def linear(self) -> tuple[float, float] | None:
        """The linear critical value, the least at which small motions about rest begin to grow; its error.

        It is where the rates of rest cross zero or, where these do not hold for small motions, that of the
        smallest limit cycle.
        """
        return min((place for place, crossing in self.turns() if crossing.begins), default=None)

    def turns(self) -> list[tuple[tuple[float, float], Crossing]]:
        """Every crossing with its place and error for small motions, in the order of the parameter."""
        kinked = {id(limb.branch.crossing): limb for limb in self.limbs if limb.kinked}
        found = []
        for crossing in self.crossings:
            limb = kinked.get(id(crossing))
            own = (crossing.parameter, crossing.error)
            found.append((own if limb is None else (limb.start or 0.0, limb.branch.error), crossing))
        return sorted(found, key=lambda turn: turn[0][0])

    def rest_stretches(self) -> Iterator[tuple[float, float, bool]]:
        """Ranges of the parameter, from and to, and whether rest is unstable in them."""
        begin, growing = self.low, self.rests[0].unstable
        for (at, _), crossing in self.turns():
            yield begin, at, growing > 0
            growing += (1 if crossing.begins else -1) * (2 if crossing.frequency else 1)
            begin = at
        yield begin, self.high, growing > 0

    @property
    def nonlinear(self) -> tuple[float, float] | None:
        """The nonlinear critical value, the least with a stable limit cycle, and its error.

        None where there is no such cycle, or where they leave the range at its beginning.
        """
        if self.stable_throughout:
            return None
        known = [(c.parameter, float("nan")) for c in self._stable if c.parameter <= self.high]
        known += [(f.parameter, f.error) for limb in self.limbs for f in limb.folds if f.stable]
        return min(known, default=None)

    @property
    def stable_throughout(self) -> bool:
        """Whether stable limit cycles leave the range at its beginning, and the critical value with them."""
        return any(c.parameter < self.low for c in self._stable)

    @property
    def _stable(self) -> list[Cycle]:
        return [c for limb in self.limbs for c in limb.branch.cycles if not c.unstable]

    def write(self, folder: Path) -> None:
        """Write result.json, rest.csv and cycles.csv, in SI."""
        written(folder / "rest.csv", self.rest_table().to_csv(index=False, float_format="%.9g"))
        written(folder / "cycles.csv", self.cycle_table().to_csv(index=False, float_format="%.9g"))
        text = json.dumps(self.result(), indent=1, ensure_ascii=False, allow_nan=False)
        written(folder / "result.json", f"{text}\n")

    def rest_table(self) -> pd.DataFrame:
        """A row a position of rest, with the growth, 1/s, and frequency, Hz, of the least damped motion."""
        rows = [
            {
                self.parameter: r.parameter,
                "growth": r.rates[0].real,
                "frequency": abs(r.rates[0].imag) / (2 * pi),
                "unstable": r.unstable,
                **dict(zip(self.states, r.x.tolist(), strict=True)),
            }
            for r in self.rests
        ]
        return pd.DataFrame(rows)

    def cycle_table(self) -> pd.DataFrame:
        """A row a limit cycle, in the order of its branch."""
        rows = [
            {
                "branch": k,
                **_cycle(self.parameter, cycle),
                **dict(zip(self.states, cycle.x.tolist(), strict=True)),
            }
            for k, limb in enumerate(self.limbs, 1)
            for cycle in limb.branch.cycles
        ]
        return pd.DataFrame(rows)

    def result(self) -> dict[str, Any]:
        """What result.json holds; None where a number is not known."""
        named = ("fmu", "parameter", "parameter_unit", "output", "output_unit", "low", "high", "step")
        return {
            **{name: getattr(self, name) for name in named},
            "held": dict(self.held),
            "states": list(self.states),
            "linear_critical": _value(self.linear),
            "nonlinear_critical": _value(self.nonlinear),
            "crossings": [_crossing(c) for c in self.crossings],
            "branches": [_limb(limb) for limb in self.limbs],
        }

    def lines(self) -> Iterator[str]:
        """Lines to print."""
        for name, value in (("linear", self.linear), ("nonlinear", self.nonlinear)):
            said = "none in the range" if value is None else self.of_parameter(*value)
            yield f"{name} critical {self.parameter}: {said}"
        for k, limb in enumerate(self.limbs, 1):
            cycles, turned = len(limb.branch.cycles), len(limb.folds)
            yield f"branch {k}: {cycles} limit cycles, {turned} folds; {limb.branch.end}"
        yield from self.notes()

    def notes(self) -> Iterator[str]:
        """What a reader has to know of the numbers."""
        for limb in self.limbs:
            if limb.kinked and limb.start is not None:
                first = self.of_parameter(limb.start)
                rates = self.of_parameter(limb.branch.crossing.parameter)
                yield (
                    f"the smallest limit cycle is at {first}, but the rates of rest cross zero at {rates}: "
                    "the equations have a kink at rest, so that these rates do not describe small motions; "
                    "the linear critical value is that of the smallest limit cycle"
                )
            if limb.error > ROUGH:
                yield (
                    f"one multiplier has to be 1 by theory, and differs from 1 by up to {limb.error:.2g}: "
                    "the other multipliers have errors of this size there, too; a smaller --step may help"
                )

    def of_parameter(self, value: float, error: float = float("nan")) -> str:
        """A value of the parameter with its error and unit."""
        shown = max(error, LEAST * abs(value))
        known = with_error(value, shown) if isfinite(error) and shown > 0 else f"{value:.5g}"
        return quantity(
            f"({known})" if "±" in known and unit(self.parameter_unit) else known, self.parameter_unit
        )


def _crossing(c: Crossing) -> dict[str, Any]:
    kind = "Hopf" if c.frequency else "static"
    return {
        "value": c.parameter, "error": _known(c.error), "kind": kind, "frequency": c.frequency,
        "begins": c.begins,
    }  # fmt: skip


def _limb(limb: Limb) -> dict[str, Any]:
    cycles = limb.branch.cycles
    return {
        "crossing": limb.branch.crossing.parameter,
        "start": limb.start,
        "start_error": _known(limb.branch.error),
        "end": limb.branch.end,
        "folds": [
            {
                "value": f.parameter, "error": _known(f.error),
                "amplitude": f.cycle.amplitude, "period": f.cycle.period,
            }
            for f in limb.folds
        ],
        "changes": [{"kind": c.kind, "low": c.low, "high": c.high} for c in limb.changes],
        "cycles": [
            {**_cycle("value", cycle), "multipliers": [[m.real, m.imag] for m in cycle.multipliers.tolist()]}
            for cycle in cycles
        ],
        "releases": [
            {
                "value": r.cycle.parameter, "share": r.share, "periods": len(r.amplitudes),
                "amplitude_over_cycle": float(r.amplitudes[-1]), "leaves": r.leaves,
            }
            for r in limb.releases
        ],
    }  # fmt: skip


def _cycle(parameter: str, cycle: Cycle) -> dict[str, Any]:
    low, high = cycle.extremes
    return {
        parameter: cycle.parameter, "amplitude": cycle.amplitude, "least": low, "greatest": high,
        "period": cycle.period, "stable": not cycle.unstable, "unstable": cycle.unstable,
        "largest_multiplier": float(abs(cycle.multipliers[0])) if len(cycle.multipliers) > 1 else 0.0,
        "multiplier_error": cycle.error,
    }  # fmt: skip


def _value(found: tuple[float, float] | None) -> dict[str, float | None] | None:
    return None if found is None else {"value": found[0], "error": _known(found[1])}


def _known(value: float) -> float | None:
    return value if isfinite(value) else None
