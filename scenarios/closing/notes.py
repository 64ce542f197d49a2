"""Notes of a result: what is unusual about the record, its simulation, and what the answer leaves."""

from collections.abc import Mapping

from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.clock import CLOCK, jitter, times_said
from estimator.closeloop.question.problem import Problem
from estimator.record import Array


def notes_of(problem: Problem, found: Outcome, rms: Mapping[str, Array]) -> list[str]:
    """All notes as sentences; rms: errors on the test part by model, (n_y,) each."""
    return [
        *(n.sentence for n in problem.record.notes),
        *_steps(problem),
        *_times(problem, found),
        *left_by_the_answer(problem, found, rms),
    ]


def _steps(problem: Problem) -> list[str]:
    """Notes if the steps of the simulation had to be divided, or to end with the inputs of a sample."""
    settled = (
        "the FMU computes its outputs in a step, from what acts over it; so the last thousandth of each step "
        "was simulated with the inputs of the sample at its end, and the error after holds for this"
    )
    notes = [settled] if problem.steps.settled else []
    if problem.steps.parts == problem.searched.parts:
        return notes
    return [
        *notes,
        f"the usual steps of the simulation were divided by {problem.steps.parts} for the answer, because "
        "their integration error would have changed the fitted values; the error after holds for the divided "
        "steps",
    ]


def _times(problem: Problem, found: Outcome) -> list[str]:
    """Notes on the errors of the record's times that were found with the answer."""
    h, noise = found.chosen or found.base, found.baseline.noise
    shared = noise.weighting.joint is not None
    scatter = jitter(problem.record, h.residuals, problem.policy.detection.chance) if shared else 0.0
    return times_said(h.fit.theta.get(CLOCK, 0.0), h.fit.std.get(CLOCK, 0.0), scatter)


def left_by_the_answer(problem: Problem, found: Outcome, rms: Mapping[str, Array]) -> list[str]:
    """A note on the outputs for which an answer leaves more than noise on the test part."""
    if not found.chosen:
        return []
    before, after, down = rms["before"], rms["after"], found.baseline.at_noise(found.chosen, "test")
    return [
        f"{output}: the answer explains {1 - (after[j] / before[j]) ** 2:.0%} of the residual's variance on "
        f"the test part; what is left there is {after[j] / found.noise[j]:.1f} times the noise, and the "
        "library does not explain it"
        for j, output in enumerate(problem.record.outputs)
        if not down[j] and after[j] < before[j]
    ]
