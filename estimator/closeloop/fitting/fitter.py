"""Joint fits of hypotheses by simulation: brief fits of all promises, then full fits of the leading ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.fitting.fit import REFUSED, fit
from estimator.closeloop.fitting.noise_left import caused_rms
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.question.problem import Problem, Unknown, simulate_ahead
from estimator.record import Array
from estimator.weighting import Weighting
from fmus.host.fmu import FmuError

BRIEF, LONG = 4, 20  # evaluations of a brief fit, which only ranks, and of a full fit
GAINS = 0.98  # ratio of the sums of squares after and before a round, above which no other round follows
FURTHER_ROUNDS, LAST = 4, 2  # rounds of further LONG fits, and leading hypotheses that they continue

NEAR = 2.0  # mean square of the weighted residual, below which what noise of the inputs causes is simulated

Columns = Mapping[str, Array]  # derivatives (m,) of the weighted residual, by the name of the unknown


@dataclass(frozen=True)
class Fitter:
    """Fits hypotheses to the record of a baseline; jobs: number of processes."""

    baseline: Baseline
    jobs: int = 1

    @property
    def alone(self) -> Fitter:
        """The same fitter with one process."""
        return replace(self, jobs=1)

    def asked(self, problem: Problem) -> Fitter:
        """The same fitter with another problem."""
        return replace(self, baseline=self.baseline.asked(problem))

    def hypotheses(self, promises: Sequence[Promise], finalists: int) -> list[Hypothesis]:
        """Brief fits of all promises, then full fits of the best ones that improve the calibrated FMU."""
        return self.to_the_end(self.briefly(promises), finalists)

    def briefly(self, promises: Sequence[Promise], known: bool = True) -> list[Hypothesis]:
        """Fits of few evaluations, one per label, sorted by sum of squares, best first.

        Start states hardly matter for the ranking and keep the values and derivatives of the calibrated FMU.
        known: whether the derivatives of the other unknowns are taken from the calibrated FMU too. With an
        effect of size zero, every hypothesis is the calibrated FMU. Where a fit is worse, its start by the
        linearisation was, and it begins there.
        """
        problem, base = self.baseline.problem, self.baseline.hypothesis.fit
        states = {n: v for n, v in base.theta.items() if n in problem.free_states}
        started = self.asked(replace(problem, declared={**problem.declared, **states}))
        others = [u for u in base.unknowns if u.name not in states]
        columns = base.columns if known else None
        found = started.fitted(promises, BRIEF, others, columns)
        worse = [_without_effect(h, base) for h in found if cost(h) > base.cost]
        found = best_by_label([*found, *started.fitted(worse, BRIEF, others, columns)])
        return [replace(h, fit=h.fit.extended(base, states)) for h in found]

    def to_the_end(
        self, brief: Sequence[Hypothesis], finalists: int | None = None, least: float = np.inf
    ) -> list[Hypothesis]:
        """Full fits of the finalists among brief fits, and all other brief fits unchanged; best first.

        least: the least sum of squares of hypotheses that were fitted before. What is no rival of these, or
        of the first finalists, is not continued.
        """
        limits, base = self.baseline.policy.search, self.baseline.hypothesis
        limit = min([limits.worth_a_fit * cost(base), *(limits.hopeless * cost(h) for h in brief)])
        hopeful = [h for h in brief if cost(h) < limit][: finalists or limits.finalists]
        done: list[Hypothesis] = []
        for part in (hopeful[: limits.first_finalists], hopeful[limits.first_finalists :]):
            least = min([least, *map(cost, done)])
            again = [
                Promise(h.candidates, 0.0, {**base.fit.theta, **h.fit.theta})
                for h in part
                if cost(h) < limits.rival * least
            ]
            done = best_by_label([*done, *self.finished(again, guess=base.fit.columns)])
        keys = {h.key for h in done}
        return best_by_label([*done, *(h for h in brief if h.key not in keys)])

    def finished(
        self, promises: Sequence[Promise], unknowns: Sequence[Unknown] | None = None,
        guess: Columns | None = None, step: float = STEP,
    ) -> list[Hypothesis]:  # fmt: skip
        """Full fits of all promises, best first; the leading ones are continued until they hardly gain.

        unknowns: those that are fitted with the candidates' own, by default those of the calibrated FMU;
        guess, step: see `fit`.
        """
        rival = self.baseline.policy.search.rival
        found = self.fitted(promises, LONG, unknowns, guess=guess, step=step)
        for _ in range(FURTHER_ROUNDS):
            short = [h for h in found[:LAST] if not h.fit.converged and cost(h) < rival * cost(found[0])]
            if not short:
                break
            before = sum(cost(h) for h in short)
            rest = [h for h in found if h not in short]
            longer = self.fitted(from_there(short), LONG, unknowns, step=step)
            found = best_by_label([*rest, *short, *longer])
            if sum(cost(h) for h in longer) > GAINS * before:
                break
        return found

    def fitted(
        self, promises: Sequence[Promise], evaluations: int, unknowns: Sequence[Unknown] | None = None,
        known: Columns | None = None, guess: Columns | None = None, step: float = STEP,
    ) -> list[Hypothesis]:  # fmt: skip
        """Fits of all promises with a number of evaluations; one hypothesis per label, best first.

        unknowns: see `finished`; known, guess, step: see `fit`.
        """
        problem, weighting = self.baseline.problem, self.baseline.noise.weighting
        others = self.baseline.hypothesis.fit.unknowns if unknowns is None else unknowns
        tasks = (
            delayed(_hypotheses)(problem, some, others, weighting, evaluations, known, guess, step)
            for some in ([promises] if self.jobs == 1 else ([p] for p in promises))
        )
        found = [h for some in Parallel(n_jobs=self.jobs)(tasks) for h in some if h is not None]
        # processes return copies of the derivatives that were known
        return best_by_label(replace(h, fit=h.fit.sharing(known)) if known else h for h in found)


def hypothesis(
    problem: Problem,
    unknowns: Sequence[Unknown],
    promise: Promise,
    weighting: Weighting,
    evaluations: int,
    known: Columns | None = None,
    guess: Columns | None = None,
    step: float = STEP,
) -> Hypothesis | None:
    """Fit the candidates of a promise jointly with other unknowns, from the start values of the promise.

    known, guess, step: see `fit`. Returns None if the FMU cannot be simulated with the fitted values or its
    simulation diverges.
    """
    [found] = _hypotheses(problem, [promise], unknowns, weighting, evaluations, known, guess, step)
    return found


def _hypotheses(
    problem: Problem,
    promises: Sequence[Promise],
    unknowns: Sequence[Unknown],
    weighting: Weighting,
    evaluations: int,
    known: Columns | None,
    guess: Columns | None,
    step: float,
) -> list[Hypothesis | None]:
    """As `hypothesis` for each of several promises.

    Those that share an FMU come one after the other, for each FMU is opened once then. Their fitted values
    are simulated at once, over the whole record.
    """
    where = [built(problem, p.candidates) for p in promises]
    sharing = defaultdict(list)
    for i, here in enumerate(where):
        sharing[here.fmu].append(i)
    made: dict[int, Hypothesis | None] = {}
    for same in sharing.values():
        at_once = where[same[0]].at_once
        for some in (same[i : i + at_once] for i in range(0, len(same), at_once)):
            fits = {}
            for i in some:
                p = promises[i]
                own = [u for c in p.candidates for u in c.unknowns]
                every = [*_doubting(problem, p.candidates, unknowns), *own]
                fits[i] = fit(where[i], every, weighting, p.start, None, evaluations, known, guess, step=step)
            simulate_ahead([(where[i], fits[i].theta) for i in some])
            made |= {i: _shown(where[i], promises[i], fits[i], weighting, evaluations > BRIEF) for i in some}
    return [made[i] for i in range(len(promises))]


def _shown(
    here: Problem, promise: Promise, found: Fit, weighting: Weighting, full: bool
) -> Hypothesis | None:
    """The hypothesis of a brief or full fit, with its residuals; None as for `hypothesis`."""
    try:
        residuals = here.residuals(found.theta)
    except FmuError:
        return None
    if not all(np.all(np.abs(r) < REFUSED * weighting.size) for r in residuals):
        return None
    near = full and np.mean(found.residual**2) < NEAR
    noise = caused_rms(here, found.theta, residuals) if near else None
    return Hypothesis(promise.candidates, found, tuple(residuals), caused=noise)


def _doubting(
    problem: Problem, candidates: Sequence[Candidate], unknowns: Sequence[Unknown]
) -> list[Unknown]:
    """The unknowns without the bounds that a start state has from a sensor, if this sensor is held faulty."""
    doubted = {c.location for c in candidates if c.is_fault}
    return [
        replace(u, low=-np.inf, high=np.inf) if u.name in doubted and u.name in problem.free_states else u
        for u in unknowns
    ]


def _without_effect(h: Hypothesis, base: Fit) -> Promise:
    """A promise of the effects of h that starts at the calibrated FMU, with sizes of zero."""
    off = {u.name: 0.0 for c in h.candidates for u in c.amplitudes}
    return Promise(h.candidates, 0.0, {**h.theta, **base.theta, **off})


def from_there(found: Sequence[Hypothesis]) -> list[Promise]:
    """Promises whose start values are the fitted values of hypotheses."""
    return [Promise(h.candidates, 0.0, h.fit.theta) for h in found]
