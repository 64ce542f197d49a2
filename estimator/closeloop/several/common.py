"""Joint fit of an effect to several records, and the test whether one value accounts for all of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from joblib import Parallel, delayed

from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.several.estimates import Estimates
from estimator.closeloop.several.joint import (
    Likeness,
    Together,
    fit_together,
    likeness,
)
from estimator.closeloop.several.part import Part
from estimator.closeloop.several.transfer import (
    Status,
    Traced,
    Transfer,
    said_of,
)
from fmus.host.fmu import FmuError

SHOWS: tuple[Status, ...] = ("confirmed", "agrees", "differs")  # transfers with a value for the target record


@dataclass(frozen=True, eq=False)
class Common:
    """An effect (label) in several records, fitted to all of them jointly and to each separately.

    alone, costs: each record's own fit and its sum of squares; said: the estimates of the machine's unknowns
    from these fits; samples: number of fitted residuals of each record; accounted: whether the common value
    accounts for each record; level: p-value below which the values of the records differ.
    """

    label: str
    names: tuple[str, ...]
    together: Together
    alone: tuple[Hypothesis, ...]
    said: tuple[Estimates, ...]
    costs: tuple[float, ...]
    likeness: Likeness
    samples: tuple[int, ...]
    accounted: tuple[bool, ...]
    level: float

    @property
    def serves(self) -> bool:
        """Whether one value accounts for all records."""
        return all(self.accounted)

    @property
    def chi2(self) -> tuple[float, ...]:
        """Mean square of each record's weighted residual with the common value, 1 for noise."""
        return tuple(c / n for c, n in zip(self.together.costs, self.samples, strict=True))

    @property
    def chi2_alone(self) -> tuple[float, ...]:
        """Mean square of each record's weighted residual with its own value, 1 for noise."""
        return tuple(c / n for c, n in zip(self.costs, self.samples, strict=True))

    @property
    def sentence(self) -> str:
        """The result as a sentence for the report."""
        every, chance = " and ".join(self.names), f"p = {self.likeness.p_value:.2g}"
        if not self.serves:
            left = [n for n, ok in zip(self.names, self.accounted, strict=True) if not ok]
            return (
                f"no single value of {self.label} accounts for {every}: it fails in {' and '.join(left)} "
                f"({chance})"
            )
        if self.likeness.p_value < self.level:
            return (
                f"one value of {self.label} accounts for {every}, although their separate estimates differ "
                f"({chance})"
            )
        return f"one value of {self.label} accounts for {every} ({chance})"


def commons(
    records: Sequence[Traced], found: Sequence[Transfer], wanted: Sequence[Hypothesis], jobs: int = 1
) -> list[Common]:
    """Joint fits of the wanted effects, each to all records of one FMU that show it."""
    by_name = {r.name: r for r in records}
    alone = {
        labels: {r.name: own for r in records if (own := _own(r, labels, found)) is not None}
        for labels in dict.fromkeys(labels_of(h) for h in wanted)
    }
    several = {labels: owns for labels, owns in alone.items() if len(owns) > 1}
    tasks = [
        ([_part(by_name[n], h, labels) for n, h in owns.items()], list(owns.values()))
        for labels, owns in several.items()
    ]
    fits = Parallel(n_jobs=jobs)(delayed(_fitted)(*task) for task in tasks)
    return [
        _compared([by_name[n] for n in owns], labels, list(owns.values()), *fit)
        for (labels, owns), fit in zip(several.items(), fits, strict=True)
        if fit is not None
    ]


def labels_of(h: Hypothesis) -> tuple[str, ...]:
    """The labels of its candidates in sorted order."""
    return tuple(sorted(c.label for c in h.candidates))


def _own(r: Traced, labels: Sequence[str], found: Sequence[Transfer]) -> Hypothesis | None:
    """A record's own fit of an effect, from its own result or from a transfer; None if it has none."""
    fits = [h for h in r.members if labels_of(h) == labels]
    for t in found:
        if t.target == r.name and labels_of(t.member) == labels and t.status in SHOWS and t.own:
            fits.append(t.own)
    return min(fits, key=cost) if fits else None


def _part(r: Traced, own: Hypothesis, labels: Sequence[str]) -> Part:
    effects = tuple(sorted((c for c in own.candidates if c.label in labels), key=lambda c: c.label))
    beside = tuple(c for c in own.candidates if c.label not in labels)
    return Part.of(r.found.baseline, effects, beside, own.fit.theta)


def _fitted(parts: Sequence[Part], alone: Sequence[Hypothesis]) -> tuple[Together, tuple[float, ...]] | None:
    """The joint fit, and the smallest sum of squares of each record fitted separately.

    The separate fits are repeated from the joint values. Returns None if the FMU cannot be simulated.
    """
    try:
        found = fit_together(parts)
        again = [fit_together([replace(p, start=h.theta)]) for p, h in zip(parts, found.parts, strict=True)]
    except FmuError:
        return None
    return found, tuple(min(a.costs[0], cost(h)) for a, h in zip(again, alone, strict=True))


def _compared(
    records: Sequence[Traced],
    labels: Sequence[str],
    alone: Sequence[Hypothesis],
    together: Together,
    costs: tuple[float, ...],
) -> Common:
    said = tuple(said_of(h, labels) for h in alone)
    return Common(
        " + ".join(labels),
        tuple(r.name for r in records),
        together,
        tuple(alone),
        said,
        costs,
        likeness(together, costs, said),
        tuple(len(h.fit.residual) for h in alone),
        tuple(_accounts(r, h) for r, h in zip(records, together.parts, strict=True)),
        records[0].problem.policy.detection.level,
    )


def _accounts(r: Traced, h: Hypothesis) -> bool:
    return explains(r.found.baseline, h)
