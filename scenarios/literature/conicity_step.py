"""Response of wheelset and suspended mass to a step of the track (Charles et al. 2008, Fig. 3)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.record import Array
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    Plot,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.case import TRUE, Case, Record
from scenarios.literature.conicity_model import DT, V
from scenarios.literature.conicity_run import TREAD, response, simulated
from scenarios.literature.following import rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell

WHEN = 1.0  # s
JUDGED = ("y", "psi", "y_m", "conicity")
STEPS = {"10 mm": 10e-3, "1 mm": 1e-3}  # m; the second stays on the tread, so that it is linear
SMALL = 1e-3  # of the quantity's largest value: difference of two integrations by half a step of time

CASES = tuple(
    Case(name, "wheelset", 6.0, DT, V, ("y_irr",), {}, {"alignment_step": step}, when=WHEN, judged=JUDGED)
    for name, step in STEPS.items()
)


@dataclass(frozen=True)
class Stepped:
    """The response of a case by the row's equations; step: m; d, and what is found by name: (N,)."""

    case: Case
    record: Record
    found: dict[str, Array]

    @property
    def step(self) -> float:
        """Height of the step, m."""
        return self.case.true["alignment_step"]

    @property
    def after(self) -> slice:
        """The samples from the step on."""
        return slice(int(np.searchsorted(self.record.t, self.case.when - DT / 2)), None)

    def time_to(self, share: float) -> float:
        """Time from the step until the wheelset has gone that share of it, s."""
        gone = self.found["y"][self.after] >= share * self.step
        return float(np.argmax(gone) * DT) if gone.any() else np.inf

    def beyond(self, name: str) -> float:
        """How far a displacement goes beyond the step, over the step."""
        return float(self.found[name].max() / self.step - 1)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row; no FMU is needed, the equations are the source's."""
    every = []
    for case, record in measured:
        tell(f"{case.name}: the response")
        every.append(Stepped(case, record, response(record.columns["y_irr"])))
    findings = [finding for one in every for finding in _judged(one)]
    return Outcome(ROW.name, findings, [_figure(one) for one in every], NOTES)


def _judged(one: Stepped) -> list[Finding]:
    name, found, record = one.case.name, one.found, one.record.columns
    made = [
        Finding(
            name, f"{of}: difference from the record, rms over its largest value", "1",
            rmse(found[of], record[of + TRUE]) / float(np.abs(record[of + TRUE]).max()), target=SMALL,
        )
        for of in JUDGED
    ]  # fmt: skip
    rest = max(abs(float(found[of][-1]) / one.step - 1) for of in ("y", "y_m"))
    begun = float(found["conicity"][one.after][0])
    made += [
        Finding(name, "distance from the new centre line at the end, over the step", "1", rest, target=SMALL),
        Finding(name, "conicity under the wheelset just after the step", "1", begun),
        Finding(name, "half of the step is gone after", "s", one.time_to(0.5)),
        Finding(name, "wheelset beyond the step, over it", "1", one.beyond("y")),
        Finding(name, "suspended mass beyond the step, over it", "1", one.beyond("y_m")),
        Finding(name, "largest yaw over the step", "rad/m", float(np.abs(found["psi"]).max() / one.step)),
    ]
    return made


def _figure(one: Stepped) -> Plot:
    figure, axes = sheet(4.6, [["y"], ["psi"], ["conicity"]], sharex=True)
    t, d = one.record.t, one.record.columns["y_irr"]
    axes["y"].plot(t, 1e3 * d, color=CLOUD, linewidth=2.0, label="track")
    axes["y"].plot(t, 1e3 * one.found["y"], color=AFTER, linewidth=1.0, label="wheelset")
    axes["y"].plot(t, 1e3 * one.found["y_m"], color=BEFORE, linewidth=1.0, label="suspended mass")
    axes["psi"].plot(t, 1e3 * one.found["psi"], color=AFTER, linewidth=1.0)
    axes["conicity"].plot(t, one.found["conicity"], color=AFTER, linewidth=1.0)
    axes["conicity"].axhline(TREAD, color=INK, linewidth=0.6, linestyle=":")
    name_axes(axes["y"], "", "lateral [mm]", f"a step of {one.case.name} at {V:g} m/s")
    name_axes(axes["psi"], "", "yaw [mrad]")
    name_axes(axes["conicity"], "time [s]", "conicity")
    axes["y"].set_xlim(one.case.when - 0.2, t[-1])
    legend(figure, axes["y"])
    name = f"conicity_step_{one.case.name.replace(' ', '_')}"
    return Plot(name, figure, "Wheelset and suspended mass after a step of the track.")


NOTES = (
    "The source draws a generic conicity without figures; here 0.08 on the tread, 0.4 beyond some 3 mm.",
    "It draws the response to 10 mm and prints no number of it; 1 mm, which stays on the tread, is ours.",
)

ROW = Row(
    "conicity_step",
    "Response of the wheelset with nonlinear conicity to a step of the track",
    "Charles et al. 2008, Fig. 3",
    "wheelset",
    CASES,
    rebuilt,
    simulated,
)
