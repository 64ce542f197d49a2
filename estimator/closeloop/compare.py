"""Joint fits of hypotheses and their comparison on data that no fit has seen."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.fit import BLOCKS, REFUSED, Fit, fit
from estimator.closeloop.problem import Problem, Unknown
from estimator.closeloop.screen import Promise, built, key, label
from estimator.closeloop.slopes import STEP
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.host.fmu import FmuError

Part = Literal["fit", "choose", "test", "unseen"]  # of a record, as the masks of a Run
BRIEF, LONG = 4, 20  # steps of a fit to rank it, and to finish it
FINALISTS = 5
GAINS = 0.98  # of the sum of squares that a further round must come below to be followed by another
ROUNDS, LAST = 4, 2  # of further LONG fits of the leading finalists, where they have not converged
ABOARD = 6  # effects in one FMU
LEADERS = 2  # of the finalists that are fitted to the end before the others, and
RIVAL = 4.0  # times the best sum of squares, up to which others are fitted to the end
HOPELESS = 10.0  # times the best sum of squares after the brief fits
WORTH = 0.95  # of the base's sum of squares: a candidate that leaves more is not fitted to the end
CURVE = 40.0  # fall of the sum of squares; what noise makes of a hundred laws is less than half of it
CHANCE = 3.0  # standard deviations of the sum of squares of white noise
TELLING = 2.0  # standard errors over blocks, from which one hypothesis counts as better


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of candidates fitted jointly with the calibrated parameters.

    residuals: measured minus simulated of each run (N, n_y), whole record, free run. worth: of a candidate,
    by its label, what the sum of squares grows by without it, all else fitted again; where it was tried.
    """

    candidates: tuple[Candidate, ...]
    fit: Fit
    residuals: tuple[Array, ...]
    worth: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def theta(self) -> dict[str, float]:
        """All values by name, the fixed ones too."""
        fixed = {n: v for c in self.candidates for n, v in c.fixed.items()}
        return {**fixed, **self.fit.theta}

    @property
    def label(self) -> str:
        """Its candidates' labels joined; "none" for the base."""
        return label(self.candidates) or "none"

    @property
    def key(self) -> tuple[str, ...]:
        """The same whatever the order of its candidates."""
        return key(self.candidates)

    @property
    def own(self) -> set[str]:
        """Names of the unknowns of its candidates."""
        return {u.name for c in self.candidates for u in c.unknowns}

    @property
    def others(self) -> list[Unknown]:
        """The unknowns beside those of its candidates."""
        own = self.own
        return [u for u in self.fit.unknowns if u.name not in own]

    def rms(self, problem: Problem, part: Part) -> Array:
        """Root mean square of the residual on a part of the record, (n_y,)."""
        return np.asarray(np.sqrt(np.mean(self.of(problem, part) ** 2, axis=0)))

    def of(self, problem: Problem, part: Part) -> Array:
        """Residual on a part of the record, (m, n_y)."""
        runs = zip(self.residuals, problem.record.runs, strict=True)
        return np.concatenate([r[getattr(run, part)] for r, run in runs])

    def scores(self, problem: Problem, size: Array, part: Part = "choose") -> Array:
        """Log score of each block of a part of the record, up to a constant, (BLOCKS,)."""
        squares = np.sum((self.of(problem, part) / size) ** 2, axis=1)
        return np.array([-0.5 * b.sum() for b in np.array_split(squares, BLOCKS)])

    def significance(self, base: "Hypothesis | None" = None) -> list[float]:
        """Size of each candidate's amplitudes over their standard error; infinite where they are fixed.

        Where more is known, the root of its worth: the stiffness of a stop so hard that nothing enters it has
        no upper bound, and a standard error as large as itself, but without the stop nothing fits. base: the
        fit without effects, which tells what a single one is worth. The worth counts for less where residuals
        are correlated, by as much as the variance of the amplitudes is larger than in white noise.
        """
        names = [u.name for u in self.fit.unknowns]
        worth = dict(self.worth)
        if base is not None and len(self.candidates) == 1:
            worth.setdefault(self.candidates[0].label, cost(base) - cost(self))
        found = []
        for c in self.candidates:
            i = [names.index(u.name) for u in c.amplitudes if u.name not in c.fixed]
            if not i:
                found.append(np.inf)
                continue
            value, covariance = self.fit.values[i], self.fit.covariance[np.ix_(i, i)]
            z = float(np.sqrt(value @ np.linalg.pinv(covariance) @ value))
            over = float(np.min(self.fit.inflation[i]))
            found.append(max(z, float(np.sqrt(max(worth.get(c.label, 0.0), 0.0) / over))))
        return found


def hypothesis(
    problem: Problem,
    unknowns: Sequence[Unknown],
    promise: Promise,
    size: Array,
    evaluations: int,
    known: Mapping[str, Array] | None = None,
    guess: Mapping[str, Array] | None = None,
    step: float = STEP,
) -> Hypothesis | None:
    """Fit a set of candidates jointly with the base unknowns, from where the screening left them.

    known, guess, step: see `fit`. None where the FMU does not run with them, or runs away: a residual that is
    not finite, or of the size that stands for a refusal, is no answer.
    """
    here = built(problem, promise.candidates)
    own = [u for c in promise.candidates for u in c.unknowns]
    found = fit(here, [*unknowns, *own], size, promise.start, None, evaluations, known, guess, step=step)
    try:
        residuals = here.residuals(found.theta)
    except FmuError:
        return None
    if not all(np.all(np.abs(r) < REFUSED * size) for r in residuals):
        return None
    return Hypothesis(promise.candidates, found, tuple(residuals))


def hypotheses(
    problem: Problem, base: Hypothesis, promises: Sequence[Promise], size: Array, jobs: int, finalists: int
) -> list[Hypothesis]:
    """Fit each promise briefly, and to the end the best of those that better the base; best first."""
    brief = briefly(problem, base, promises, size, jobs)
    return to_the_end(problem, base, brief, size, jobs, finalists)


def briefly(
    problem: Problem,
    base: Hypothesis,
    promises: Sequence[Promise],
    size: Array,
    jobs: int,
    known: bool = True,
) -> list[Hypothesis]:
    """A fit of few evaluations to each promise, best first on the identify part; one a label.

    Start states, which hardly matter for the ranking, stay where the base has them, with the derivatives that
    the base has. known: what the base's other unknowns do is taken from the base too.
    """
    states = {n: v for n, v in base.fit.theta.items() if n in problem.free_states}
    started = replace(problem, declared={**problem.declared, **states})
    others = [u for u in base.fit.unknowns if u.name not in states]
    found = fitted(started, others, promises, size, BRIEF, jobs, base.fit.columns if known else None)
    return [replace(h, fit=h.fit.extended(base.fit, states)) for h in found]


def to_the_end(
    problem: Problem, base: Hypothesis, brief: Sequence[Hypothesis], size: Array, jobs: int,
    finalists: int = FINALISTS,
) -> list[Hypothesis]:  # fmt: skip
    """The finalists of brief fits fitted to the end, and all others as they are; best first."""
    limit = min([WORTH * cost(base), *(HOPELESS * cost(h) for h in brief)])
    hopeful = [h for h in brief if cost(h) < limit][:finalists]
    done: list[Hypothesis] = []
    for part in (hopeful[:LEADERS], hopeful[LEADERS:]):
        again = [
            Promise(h.candidates, 0.0, {**base.fit.theta, **h.fit.theta})
            for h in part
            if not done or cost(h) < RIVAL * cost(done[0])
        ]
        done = best_by_label(
            [*done, *finished(problem, base.fit.unknowns, again, size, jobs, base.fit.columns)]
        )
    keys = {h.key for h in done}
    return best_by_label([*done, *(h for h in brief if h.key not in keys)])


def finished(
    problem: Problem, unknowns: Sequence[Unknown], promises: Sequence[Promise], size: Array, jobs: int,
    guess: Mapping[str, Array] | None = None, step: float = STEP,
) -> list[Hypothesis]:  # fmt: skip
    """Fit each promise to the end; the leading ones, best first, until they converge or hardly gain.

    guess, step: see `fit`.
    """
    found = fitted(problem, unknowns, promises, size, LONG, jobs, guess=guess, step=step)
    for _ in range(ROUNDS):
        short = [h for h in found[:LAST] if not h.fit.converged and cost(h) < RIVAL * cost(found[0])]
        if not short:
            break
        before = sum(cost(h) for h in short)
        rest = [h for h in found if h not in short]
        longer = fitted(problem, unknowns, from_there(short), size, LONG, jobs, step=step)
        found = best_by_label([*rest, *short, *longer])
        if sum(cost(h) for h in longer) > GAINS * before:
            break
    return found


def fitted(
    problem: Problem,
    unknowns: Sequence[Unknown],
    promises: Sequence[Promise],
    size: Array,
    evaluations: int,
    jobs: int,
    known: Mapping[str, Array] | None = None,
    guess: Mapping[str, Array] | None = None,
    step: float = STEP,
) -> list[Hypothesis]:
    """Fit each promise with so many evaluations; one hypothesis a label, best first on the identify part."""
    where = together(problem, promises)
    tasks = (
        delayed(hypothesis)(here, unknowns, p, size, evaluations, known, guess, step)
        for here, p in zip(where, promises, strict=True)
    )
    return best_by_label(h for h in Parallel(n_jobs=jobs)(tasks) if h is not None)


def together(problem: Problem, promises: Sequence[Promise]) -> list[Problem]:
    """For each promise the problem with an FMU that has its effects and those of some others, all off.

    To build an FMU may take longer than the fits with it. Effects with a memory would cost steps.
    """
    labels = sorted({(c.kind, c.location) for p in promises for c in p.candidates if not c.is_fault})
    light = [(kind, at) for kind, at in labels if not EFFECTS[kind].states("translation")]
    size = ABOARD if problem.builder.quick else 1
    groups = [light[i : i + size] for i in range(0, len(light), size)]
    found = []
    for p in promises:
        own = {(c.kind, c.location) for c in p.candidates}
        group = next((g for g in groups if own <= set(g)), [])
        found.append(problem.with_effects(sorted({*problem.effects, *group})))
    return found


def from_there(found: Sequence[Hypothesis]) -> list[Promise]:
    """Promises that begin where hypotheses are."""
    return [Promise(h.candidates, 0.0, h.fit.theta) for h in found]


def best_by_label(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Of several hypotheses with the same labels the one that fits better; best first."""
    best: dict[tuple[str, ...], Hypothesis] = {}
    for h in found:
        if h.key not in best or cost(h) < cost(best[h.key]):
            best[h.key] = h
    return sorted(best.values(), key=cost)


def cost(h: Hypothesis) -> float:
    """Sum of squares on the identify part."""
    return float(h.fit.residual @ h.fit.residual)


def mean_square(h: Hypothesis) -> float:
    """Of the residual on the part that was fitted."""
    return cost(h) / len(h.fit.residual)


def leaves_noise(h: Hypothesis) -> bool:
    """Whether nothing but noise is left in the part to identify."""
    return bool(h.fit.beyond_noise < CHANCE * np.sqrt(2 * len(h.fit.residual)))


def ranked(problem: Problem, found: Sequence[Hypothesis], size: Array) -> list[Hypothesis]:
    """Best first, by log score on the part to choose.

    Where the FMU's form leaves something open, by that of the whole record: forms differ from one part to the
    next, and what acts in one part alone would lose to what makes up for form in the other.
    """
    share = 0.5 if problem.form_error > 0 else 0.0
    return sorted(found, key=lambda h: share * cost(h) - float(h.scores(problem, size).sum()))


def lead(
    problem: Problem, a: Hypothesis, b: Hypothesis, size: Array, part: Part = "choose"
) -> tuple[float, float]:
    """Sum over blocks of the log score of a over b on a part of the record, and its standard error."""
    difference = a.scores(problem, size, part) - b.scores(problem, size, part)
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))


def beats(problem: Problem, a: Hypothesis, b: Hypothesis, size: Array, part: Part = "choose") -> bool:
    """Whether a is better than b by more than TELLING standard errors over blocks of a part."""
    mean, error = lead(problem, a, b, size, part)
    return mean > TELLING * error


def beyond_noise(problem: Problem, h: Hypothesis, size: Array) -> float:
    """What the sum of squares of the part to choose has more than noise would."""
    return float(np.sum((h.of(problem, "choose") / size) ** 2 - 1))


def beyond_noise_of_all(problem: Problem, h: Hypothesis, size: Array) -> float:
    """The same of both parts."""
    return h.fit.beyond_noise + beyond_noise(problem, h, size)
