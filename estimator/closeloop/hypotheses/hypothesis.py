"""A hypothesis: candidate effects fitted jointly with the calibrated parameters."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.promise import key, label
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array
from fmus.aside import let_go

Part = Literal["fit", "choose", "test", "unseen"]  # parts of a record, named as the masks of a Run
WHOLE: tuple[Part, ...] = ("fit", "unseen")  # the whole record


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of candidate effects fitted jointly with the calibrated parameters.

    residuals: measured minus simulated outputs of each run (N, n_y), over the whole record. worth: increase
    of the sum of squares without a candidate, all others fitted again, by its label; only if it was tried.
    caused: rms (n_y,) of the outputs' noise that noise of the inputs and times causes if it is right; None if
    it is not told, and is then as in the calibrated FMU.
    """

    candidates: tuple[Candidate, ...]
    fit: Fit
    residuals: tuple[Array, ...]
    worth: Mapping[str, float] = field(default_factory=dict, hash=False)
    caused: Array | None = None

    @property
    def theta(self) -> dict[str, float]:
        """All values by name, including the fixed ones."""
        fixed = {n: v for c in self.candidates for n, v in c.fixed.items()}
        return {**fixed, **self.fit.theta}

    @property
    def label(self) -> str:
        """The labels of its candidates, joined; "none" for the calibrated FMU."""
        return label(self.candidates) or "none"

    @property
    def key(self) -> tuple[str, ...]:
        """The labels of its candidates in sorted order, so that their order does not matter."""
        return key(self.candidates)

    @property
    def own(self) -> set[str]:
        """Names of the unknowns of its candidates."""
        return {u.name for c in self.candidates for u in c.unknowns}

    @property
    def shapes(self) -> set[str]:
        """Names of the unknowns that shape the laws of its candidates, onset times among them."""
        return {u.name for c in self.candidates for u in c.shape}

    @property
    def onset_names(self) -> list[str]:
        """Names of its unknowns that are onset times."""
        return [u.name for c in self.candidates for u in c.shape if u.is_onset]

    @property
    def others(self) -> list[Unknown]:
        """The unknowns that do not belong to its candidates."""
        own = self.own
        return [u for u in self.fit.unknowns if u.name not in own]

    def rms(self, problem: Problem, part: Part) -> Array:
        """Root mean square of the residual on a part of the record, (n_y,)."""
        return np.asarray(np.sqrt(np.mean(self.of(problem, part) ** 2, axis=0)))

    def of(self, problem: Problem, part: Part) -> Array:
        """Residual on a part of the record, (m, n_y)."""
        let_go()
        return problem.record.of(self.residuals, part)

    def significance(self, base: "Hypothesis | None" = None) -> list[float]:
        """Amplitudes of each candidate over their standard error; infinite if they are fixed.

        If the root of a candidate's worth is larger, it is used instead. A very stiff bump stop has no upper
        bound of its stiffness, and a standard error as large as the stiffness, but without the stop the fit
        is much worse. base: the fit without effects, which gives the worth of a single candidate. The worth
        is divided by the variance inflation of the amplitudes, to allow for correlated residuals.
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
    """Weighted sum of squares on the part to identify."""
    return h.fit.cost


def mean_square(h: Hypothesis) -> float:
    """Mean square of the weighted residual on the part that was fitted."""
    return cost(h) / len(h.fit.residual)


def best_by_label(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    """The best hypothesis for each set of labels, sorted by sum of squares, best first.

    Of two with the same labels, the one with fewer unknowns is better unless each further unknown reduces the
    sum of squares by more than 2 (H. Akaike, IEEE Trans. Automatic Control 19 (1974), 716-723).
    """
    best: dict[tuple[str, ...], Hypothesis] = {}
    for h in found:
        if h.key not in best or _criterion(h) < _criterion(best[h.key]):
            best[h.key] = h
    return sorted(best.values(), key=cost)


def _criterion(h: Hypothesis) -> float:
    return cost(h) + 2 * len(h.fit.unknowns)
