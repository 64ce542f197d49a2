"""The chain: calibrate, detect, nominate, fit jointly, choose, judge, hold the answer against the test."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision.allowed import allowed
from estimator.closeloop.decision.detect import detect
from estimator.closeloop.decision.law_form import confirmed
from estimator.closeloop.decision.verdict import confirmed_on_test, judge, without_fits
from estimator.closeloop.diagnostics.diagnostics import honesty
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.likelihood_profile import profiled
from estimator.closeloop.fitting.reweighted import best_weights, fitted_again, rescaled
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.scores import beats, ranked
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.progress import Progress, Tell
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.missing_force import MissingForce, missing_forces
from estimator.closeloop.search.free_form import free_form
from estimator.closeloop.search.screened import Screened, screened
from estimator.closeloop.search.search import Search
from estimator.noise import noise_floor
from estimator.record import Array


def trace(
    problem: Problem,
    tell: Tell = lambda _: None,
    jobs: int = 2,
    seed: int = 0,
    stages: Stages = Stages(),  # noqa: B008 - immutable, keeps nothing
) -> Outcome:
    """Run the whole chain on a problem; `tell` hears what is being done, `stages` keeps what was found."""
    progress = Progress(tell)
    found = _traced(problem, progress, jobs, seed, stages)
    progress.end()
    return replace(found, seconds=progress.seconds)


def _traced(problem: Problem, tell: Progress, jobs: int, seed: int, stages: Stages) -> Outcome:
    noise = noise_floor(problem.record)
    tell("calibrate", "calibrating the declared parameters")
    declared, base, size = stages.done("calibrated", lambda: calibrate(problem))
    tell("missing force", "inferring the missing force at each port")
    forces = stages.done("forces", lambda: missing_forces(problem, base.fit.theta, noise))
    shown = screened(problem, base, noise, size, forces, tell, stages)
    tell("detect", "testing for a discrepancy against simulated records without one")
    change, seen = shown.change, shown.screening.fit
    over_noise = replace(seen, residual=(seen.residual.reshape(-1, len(size)) * size / noise).ravel())
    regressors = [g for _, g in change]
    detection = stages.done(
        "detection",
        lambda: detect(
            problem, base, noise, over_noise, regressors, shown.likeness, shown.began,
            np.random.default_rng(seed),
        ),
    )  # fmt: skip
    tell("honesty", "working out what else would explain, and what could have been seen")
    level = detection.level / len(detection.figures)
    owed = stages.done(
        "honesty",
        lambda: honesty(problem, base, shown.fit, change, size, level, np.random.default_rng(seed)),
    )
    found = (declared, base, noise, size, detection, tuple(forces), tuple(shown.promises))
    before, early = without_fits(problem, base, detection, noise)
    if early:
        return Outcome(*found, (), (), early, owed)
    search = Search(shown, tell, jobs)
    singles, pairs = search.run()
    if not problem.record.floor_known and (singles or pairs):
        tell("weights", "weighting the residuals by what the best fit leaves")
        base, size, singles, pairs = stages.done(
            "weights", lambda: _weighted_anew(shown, singles, pairs, jobs)
        )
        shown = replace(shown, base=base, size=size)
        found = (declared, base, noise, size, *found[4:])
    singles, pairs, judgement = _answered(shown, forces, search, singles, pairs, tell)
    tell("test", "holding the answer against the test part")
    judgement = confirmed_on_test(problem, base, judgement, size).after(before)
    if judgement.verdict == "unexplained":
        tell("free form", "fitting a force of free form")
        curve = stages.done("free form", lambda: free_form(problem, base, forces, size, jobs, singles))
        if curve and beats(problem, curve, base, size, "test"):
            owed = replace(owed, free_form=curve)
    return Outcome(*found, tuple(singles), tuple(pairs), judgement, owed)


def _weighted_anew(
    shown: Screened, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], jobs: int
) -> tuple[Hypothesis, Array, list[Hypothesis], list[Hypothesis]]:
    """Base, size of a residual that counts as one, singles and pairs, best first, all by new weights."""
    problem, before = shown.problem, shown.size
    size = best_weights(problem, [*singles, *pairs])
    ones, twos = (fitted_again(problem, found, before, size, jobs) for found in (singles, pairs))
    return rescaled(shown.base, before, size), size, ranked(problem, ones, size), ranked(problem, twos, size)


def _answered(
    shown: Screened, forces: Sequence[MissingForce], search: Search,
    singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], tell: Progress,
) -> tuple[list[Hypothesis], list[Hypothesis], Judgement]:  # fmt: skip
    """Single hypotheses and pairs, best first, and their judgement, whose members are as it saw them.

    What is named has its errors taken from the sum of squares, which may also move it. It is judged again
    with these, until nothing is named that was not judged so: each is asked once, so that this ends.
    """
    problem, size, done = shown.problem, shown.size, shown.stages.done
    asked: set[tuple[str, ...]] = set()
    denied: Hypothesis | None = None
    for turn in count():
        tell("verdict", "asking whether it is the law's curve")
        leading, judgement = _judged(shown, forces, singles, pairs, f"verdict {turn}")
        alone = leading.members and not judgement.members and len(leading.members[0].candidates) == 1
        if alone and denied is None:
            denied = leading.members[0]
            singles = search.instead(denied, singles)
            continue
        members = [h for h in judgement.members if h.key not in asked]
        if not members:
            break
        tell("intervals", "asking how far its parameters may be from there")
        found = done(f"intervals {turn}", partial(_profiled, problem, members, size, search.jobs))
        asked |= {h.key for h in members}
        final = {h.key: h for h in found}
        singles, pairs = (
            ranked(problem, [final.get(h.key, h) for h in some], size) for some in (singles, pairs)
        )
    return list(singles), list(pairs), judgement.of([*singles, *pairs])


def _judged(
    shown: Screened, forces: Sequence[MissingForce], singles: Sequence[Hypothesis],
    pairs: Sequence[Hypothesis], stage: str,
) -> tuple[Judgement, Judgement]:  # fmt: skip
    """What the comparison says, and what is left where each law is asked whether it is the force's curve."""
    problem, base, size, done = shown.problem, shown.base, shown.size, shown.stages.done
    judged = done(f"allowed {stage}", lambda: allowed(problem, singles, size))
    leading = judge(problem, base, judged, pairs, shown.noise, size, shown.began).of([*singles, *pairs])
    return leading, done(stage, lambda: confirmed(problem, base, leading, forces, size))


def _profiled(problem: Problem, members: Sequence[Hypothesis], size: Array, jobs: int) -> list[Hypothesis]:
    """Hypotheses with their errors as the sum of squares says."""
    tasks = (delayed(profiled)(problem, h, size) for h in members)
    return list(Parallel(min(jobs, len(members)))(tasks))
