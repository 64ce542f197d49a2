"""What an FMU is fit for here, and what to do where it is not: the conclusion from the trials of `check`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from fmus.host.description import FmuDescription
from fmus.host.grading.trials import CHANGES, HIDDEN, SHARED

LETTER = "valid"  # the trial that asks for the letter of the standard; what breaks it may work all the same
ESSENTIAL = ("repeatable", "restart", "instances")  # without these no estimate means anything
SAMPLES = 10_000  # of the record for which a cost is told
SIMULATIONS = 3000  # of a record in close-loop; the motor of the tutorial took 2900 with 33 candidates
UNKNOWN = 3  # parameters beside the states, of the filter for which a cost is told
PATIENT = 3600.0  # s of one core, beyond which a use is called slow


@dataclass(frozen=True)
class Fit:
    """Whether an FMU serves for a use: yes, slow or no, with what it costs or why not and the way out."""

    use: str
    answer: str
    sentence: str

    def __str__(self) -> str:
        said = f" ({self.sentence})" if self.sentence else ""
        return f"{self.use}: {self.answer}{said}"


Outcomes: TypeAlias = Mapping[str, tuple[bool | None, str]]  # passed and sentence of each trial, by title


def simulates(outcomes: Outcomes) -> bool:
    """Whether a run from its own start values came to its end, even if it does not repeat."""
    passed, said = outcomes["repeatable"]
    return passed is not False or said.startswith(CHANGES)


def fitness(outcomes: Outcomes, d: FmuDescription, step: float | None) -> tuple[Fit, ...]:
    """Fitness for simulation, estimation and close-loop.

    step: processor time of a step, s; None if it could not be measured.
    """
    if not simulates(outcomes):
        said = _clause(outcomes["repeatable"][1])
        why = f"{said}; give it start values with which it runs, or export it anew"
        return tuple(Fit(use, "no", why) for use in ("simulation", "estimation", "close-loop"))
    simulation = _costing("simulation", step, 1)
    wrong = next((s for t in ESSENTIAL for p, s in [outcomes[t]] if p is False), "")
    if wrong:
        why = f"{_clause(wrong)}; {_way_out(wrong)}"
        return (simulation, Fit("estimation", "no", why), Fit("close-loop", "no", why))
    points = 2 * (len(d.states) + UNKNOWN) + 1
    estimation = _costing("estimation", step, points)
    if outcomes["restart"][0] is None and "begins anew" in outcomes["restart"][1]:
        why = (
            "it shows no state that can be set before a start; export its states as outputs with "
            'initial="exact" and a start value'
        )
        estimation = Fit("estimation", "no", why)
    return (simulation, estimation, _costing("close-loop", step, SIMULATIONS))


def _costing(use: str, step: float | None, times: int) -> Fit:
    """Yes or slow, by what a record takes that is simulated so many times."""
    if step is None:
        return Fit(use, "yes", "the time of a step could not be measured")
    seconds = SAMPLES * times * step
    cost = f"about {_duration(seconds)} of one core for {SAMPLES:,} samples".replace(",", " ")
    return Fit(use, "slow" if seconds > PATIENT else "yes", cost)


def _duration(seconds: float) -> str:
    for limit, word, divisor in ((90.0, "s", 1.0), (5400.0, "min", 60.0)):
        if seconds < limit:
            return f"{seconds / divisor:.2g} {word}"
    return f"{seconds / 3600:.2g} h"


def _clause(sentence: str) -> str:
    """A sentence as a part of another one."""
    return (sentence[:1].lower() + sentence[1:]).rstrip(".")


def _way_out(sentence: str) -> str:
    ways = {
        CHANGES: "mend its reset",
        HIDDEN: "export all of its states as outputs",
        SHARED: "keep what an instance remembers in the instance",
    }
    return next((way for said, way in ways.items() if sentence.startswith(said)), "mend the FMU")
