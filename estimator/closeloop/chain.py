"""The chain: calibrate, detect, nominate, fit jointly, compare on held-out data, judge."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.allowed import allowed
from estimator.closeloop.calibrate import calibrate
from estimator.closeloop.compare import Hypothesis
from estimator.closeloop.curvature import confirmed
from estimator.closeloop.detect import LEVEL, detect
from estimator.closeloop.freeform import free_form
from estimator.closeloop.honesty import honesty
from estimator.closeloop.likelihood import profiled
from estimator.closeloop.missing_force import MissingForce, missing_forces
from estimator.closeloop.noise import noise_floor
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.problem import Problem
from estimator.closeloop.progress import Progress, Tell
from estimator.closeloop.screened import Screened, screened
from estimator.closeloop.search import Search
from estimator.closeloop.stages import Stages
from estimator.closeloop.verdict import Judgement, judge, without_fits
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
    level = LEVEL / len(detection.figures)
    owed = stages.done(
        "honesty",
        lambda: honesty(problem, base, shown.fit, change, size, level, np.random.default_rng(seed)),
    )
    found = (declared, base, noise, size, detection, tuple(forces), tuple(shown.promises))
    early = without_fits(problem, base, detection, noise)
    if early:
        return Outcome(*found, (), (), early, owed)
    search = Search(shown, tell, jobs)
    singles, pairs = search.run()
    leading, judgement = _judged(shown, forces, singles, pairs, tell)
    if leading.members and not judgement.members and len(leading.members[0].candidates) == 1:
        more = search.instead(leading.members[0], singles)
        if more != singles:
            singles = more
            _, judgement = _judged(shown, forces, singles, pairs, tell, again=True)
    tell("intervals", "asking how far its parameters may be from there")
    judgement = stages.done("intervals", lambda: _profiled(problem, judgement, size, jobs))
    if judgement.verdict == "unexplained":
        tell("free form", "fitting a force of free form")
        curve = stages.done("free form", lambda: free_form(problem, base, forces, size, jobs, singles))
        owed = replace(owed, free_form=curve)
    final = {h.key: h for h in judgement.members}
    singles, pairs = ([final.get(h.key, h) for h in some] for some in (singles, pairs))
    return Outcome(*found, tuple(singles), tuple(pairs), judgement, owed)


def _judged(
    shown: Screened, forces: Sequence[MissingForce], singles: Sequence[Hypothesis],
    pairs: Sequence[Hypothesis], tell: Progress, again: bool = False,
) -> tuple[Judgement, Judgement]:  # fmt: skip
    """What the comparison says, and what is left where each law is asked whether it is the force's curve."""
    problem, base, size, done = shown.problem, shown.base, shown.size, shown.stages.done
    tell("verdict", "asking whether it is the law's curve")
    which = " again" if again else ""
    judged = done(f"allowed{which}", lambda: allowed(problem, singles, size))
    leading = judge(problem, base, judged, pairs, shown.noise, size, shown.began).of([*singles, *pairs])
    return leading, done(f"verdict{which}", lambda: confirmed(problem, base, leading, forces, size))


def _profiled(problem: Problem, judgement: Judgement, size: Array, jobs: int) -> Judgement:
    """The judgement with the errors of its members as the sum of squares says."""
    tasks = (delayed(profiled)(problem, h, size) for h in judgement.members)
    return replace(judgement, members=tuple(Parallel(min(jobs, len(judgement.members) or 1))(tasks)))
