"""The answer of `railfmi wear`: states over mileage, as lines, JSON and CSV."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenarios.output import written
from scenarios.wearing.evolution import Evolution, State
from scenarios.wearing.followed import Followed
from scenarios.wearing.service import SIDES

MILLI = 1e3


@dataclass(frozen=True)
class Wear:
    """An evolution, and what estimators find of its states, nothing if this was not asked for."""

    evolution: Evolution
    followed: tuple[Followed, ...] = ()

    @property
    def last(self) -> State:
        """The state after the way."""
        return self.evolution.states[-1]

    @property
    def deepest(self) -> float:
        """Largest depth that a wheel has lost, m."""
        return max(float(w.worn.max()) for w in self.last.wheels.values())

    def write(self, folder: Path) -> None:
        """Write states.csv and result.json, in SI but for km; an interrupted write leaves no part."""
        written(folder / "states.csv", self.table().to_csv(index=False, float_format="%.9g"))
        text = json.dumps(self.result(), indent=1, ensure_ascii=False, allow_nan=False)
        written(folder / "result.json", f"{text}\n")

    def table(self) -> pd.DataFrame:
        """A row a state."""
        return pd.DataFrame(
            [{k: v for k, v in _row(s).items() if k != "wheels"} for s in self.evolution.states]
        )

    def result(self) -> dict[str, Any]:
        """What result.json holds; None where a number does not exist."""
        e = self.evolution
        return {
            "scenario": e.service.scenario.id,
            "fmu": e.service.fmu,
            "km": self.last.km,
            "asked_km": e.plan.km,
            "step": e.plan.step,
            "both_ways": e.plan.both_ways,
            "ended": e.ended,
            "states": [{k: _known(v) for k, v in _row(s).items()} for s in e.states],
            "followed": [_found(f) for f in self.followed],
        }

    def lines(self) -> Iterator[str]:
        """Lines to print."""
        first, last = self.evolution.states[0], self.last
        yield (
            f"{last.km:.0f} km in {len(self.evolution.states) - 1} steps: {MILLI * self.deepest:.3f} mm worn "
            f"off at most; conicity at 3 mm {_three(first.conicity)} -> {_three(last.conicity)}"
        )
        for side in SIDES:
            now, new = last.sizes[side], first.sizes[side]
            said = ", ".join(
                f"{name} {MILLI * getattr(new, name):.2f} -> {MILLI * getattr(now, name):.2f} mm"
                for name in ("Sh", "Sd", "qR")
            )
            yield f"  {side} wheel: {said}"
        yield from self.notes()

    def notes(self) -> Iterator[str]:
        """What a reader has to know: why it ended early, and sizes beyond their limits."""
        if self.evolution.ended:
            yield f"the wear ended early, {self.evolution.ended}"
        for side in SIDES:
            for name in self.last.sizes[side].beyond:
                first = next(s.km for s in self.evolution.states if name in s.sizes[side].beyond)
                yield f"{name} of the {side} wheel is beyond its limit of EN 15313 from {first:.0f} km on"
        for f in self.followed:
            yield (
                f"least squares at {f.km:.0f} km: conicity at 2 mm {_three(f.conicity)}, true "
                f"{_three(f.true_conicity)}; error of the radii {100 * f.error:.2g} % of their range, and "
                f"{100 * f.looped[0]:.2g} % where the alignment is not known either, which is off by "
                f"{100 * f.looped[1]:.2g} %"
            )


def _row(s: State) -> dict[str, Any]:
    row: dict[str, Any] = {"km": s.km, "conicity": s.conicity}
    for side in SIDES:
        wheel, size = s.wheels[side], s.sizes[side]
        row |= {
            f"worn_{side}": float(wheel.worn.max()), f"section_{side}": wheel.section,
            f"r0_{side}": wheel.radius, f"Sh_{side}": size.Sh, f"Sd_{side}": size.Sd, f"qR_{side}": size.qR,
            f"T_gamma_{side}": s.T_gamma[side], f"at_flange_{side}": s.at_flange[side],
            f"section_rate_{side}": s.rate[side],
        }  # fmt: skip
    wheels = [s.track.wheel, s.track.wheel_right or s.track.wheel]
    return row | {"wheels": [Path(w).name for w in wheels]}


def _found(f: Followed) -> dict[str, Any]:
    columns = {name: getattr(f, name).tolist() for name in ("shift", "found", "std", "true")}
    conicity = {name: _known(getattr(f, name)) for name in ("conicity", "true_conicity")}
    radii, alignment = f.looped
    looped = {"looped_error": radii, "alignment_error": alignment}
    return {"km": f.km, **conicity, "error": f.error, **looped, **columns}


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _three(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "none"
