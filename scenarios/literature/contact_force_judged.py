"""Errors of the contact forces, creepages and motions of a filter, and its spikes at transitions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.record import Array
from scenarios.literature.case import Case
from scenarios.literature.following import BAND, Followed, covered, rmse
from scenarios.literature.outcome import Finding

SIDES = ("left", "right")
JUDGED = ("y_dot", "psi_dot", *(f"{q}_{side}" for q in ("xi_x", "xi_y", "F_x", "F_y") for side in SIDES))
QUANTITIES: Mapping[str, str] = {
    "y_dot": "lateral velocity", "psi_dot": "yaw rate", "creep": "creep", "force": "creep force",
}  # fmt: skip
START_UP = 0.5  # s, in which estimates leave their start
SPIKE = 0.25  # s after a transition, in which its spike is looked for
NEAR = 0.1  # of its rms: what an error may be; of the friction coefficient, within which it is found

Seen = Mapping[str, Array]  # quantity -> (N,), of the wheels (N, 2)


@dataclass(frozen=True)
class Judged:
    """The estimates of a filter for a case, and the true values, by QUANTITIES."""

    case: Case
    way: str
    found: Followed
    true: Seen
    seen: Seen

    @property
    def mu0(self) -> Array:
        """The true friction coefficient (N,)."""
        return self.case.truth("mu0", self.found.t)

    def error(self, quantity: str) -> Array:
        """Estimate minus truth, divided by the truth's rms."""
        true = self.true[quantity]
        size = float(np.sqrt(np.mean(np.square(true))))
        off: Array = (self.seen[quantity] - true) / size
        return off

    def findings(self) -> list[Finding]:
        """Errors over the run, and the spike and delay at each transition."""
        late, note = self.found.t >= START_UP, self.found.reason
        made = []
        for quantity, words in QUANTITIES.items():
            off = self.error(quantity)[late]
            made.append(self._finding(f"error of {words}, rms over rms", rmse(off, np.zeros_like(off)),
                                      NEAR, note=note))  # fmt: skip
        mu0 = self.found.value["mu0"]
        made.append(self._finding("RMSE of mu0", rmse(mu0[late], self.mu0[late])))
        made.append(self._finding(BAND, covered(self.found, "mu0", self.mu0, START_UP)))
        made.append(self._finding("mu0 at the end less its true value", float(mu0[-1] - self.mu0[-1])))
        return made + self._transitions()

    def spikes(self) -> dict[float, float]:
        """The largest error of a creep force soon after each transition [s], over the force's rms."""
        off = np.abs(self.error("force")).max(axis=1)
        return {when: float(off[self._after(when, SPIKE)].max()) for when, _ in self.case.jumps}

    def calm(self) -> float:
        """The largest error of a creep force elsewhere, over the force's rms."""
        soon = [self._after(when, SPIKE) for when, _ in self.case.jumps]
        elsewhere = ~np.any([self.found.t < START_UP, *soon], axis=0)
        return float(np.abs(self.error("force")[elsewhere]).max())

    def _transitions(self) -> list[Finding]:
        if not self.case.jumps:
            return []
        made = [
            self._finding(f"spike of creep force at {when:g} s, over its rms", size)
            for when, size in self.spikes().items()
        ]
        made.append(self._finding("largest error of creep force elsewhere, over its rms", self.calm()))
        for (when, _), until in zip(self.case.jumps, self._ends(), strict=True):
            made.append(
                self._finding(f"mu0 within {NEAR:.0%} after {when:g} s", self._found(when, until), unit="s")
            )
        return made

    def _ends(self) -> list[float]:
        return [*(when for when, _ in self.case.jumps[1:]), self.case.duration]

    def _found(self, when: float, until: float) -> float:
        """Time [s] from a transition until mu0 is first near its new value; inf if it never is."""
        part = (self.found.t >= when) & (self.found.t < until)
        near = np.abs(self.found.value["mu0"] - self.mu0)[part] <= NEAR * self.mu0[part]
        return float(self.found.t[part][int(np.argmax(near))] - when) if near.any() else np.inf

    def _after(self, when: float, length: float) -> np.ndarray:
        return (self.found.t >= when) & (self.found.t < when + length)

    def _finding(
        self, what: str, ours: float, target: float | None = None, unit: str = "1", note: str = ""
    ) -> Finding:
        return Finding(self.case.name, f"{self.way}: {what}", unit, ours, target=target, note=note)


def gathered(outputs: Mapping[str, Array]) -> Seen:
    """Total creep and creep force [N] of both wheels (N, 2) from outputs (N,), beside the motions."""

    def total(quantity: str) -> Array:
        return np.column_stack(
            [np.hypot(outputs[f"{quantity}_x_{side}"], outputs[f"{quantity}_y_{side}"]) for side in SIDES]
        )

    return {**{q: outputs[q] for q in ("y_dot", "psi_dot")}, "creep": total("xi"), "force": total("F")}
