"""A hypothesis: candidates fitted jointly with the calibrated parameters."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import BLOCKS, Fit
from estimator.closeloop.hypotheses.promise import key, label
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array

Part = Literal["fit", "choose", "test", "unseen"]  # of a record, as the masks of a Run


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


def cost(h: Hypothesis) -> float:
    """Sum of squares on the identify part."""
    return float(h.fit.residual @ h.fit.residual)


def mean_square(h: Hypothesis) -> float:
    """Of the residual on the part that was fitted."""
    return cost(h) / len(h.fit.residual)


def best_by_label(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Of several hypotheses with the same labels the one that fits better; best first."""
    best: dict[tuple[str, ...], Hypothesis] = {}
    for h in found:
        if h.key not in best or cost(h) < cost(best[h.key]):
            best[h.key] = h
    return sorted(best.values(), key=cost)
