"""Ports and motions over which a force of free form may act, by regression of the smoothed missing forces."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.effects.free_form import FreeForm

PIECES = 10  # pieces of the part to identify for cross-validation


SPLINE_RIDGE = 1e-3  # share of the splines' mean square; control values without data stay at zero


FREE_FORMS: dict[str, type[FreeForm]] = {k: e for k, e in EFFECTS.items() if issubclass(e, FreeForm)}


@dataclass(frozen=True)
class Dependence:
    """How well a curve over one quantity describes the missing force at a port.

    share: explained share of the squares, cross-validated, at most 1; shape: ends or order of the curve.
    """

    kind: str
    location: str
    against: str
    share: float
    shape: dict[str, float]


def dependences(problem: Problem, forces: Sequence[MissingForce]) -> list[Dependence]:
    """The dependences of the missing forces on the motion, best first; one per kind of curve and port."""
    best: dict[tuple[str, str], Dependence] = {}
    for d in _dependences(problem, forces):
        key = (d.kind, d.location)
        if key not in best or d.share > best[key].share:
            best[key] = d
    return sorted(best.values(), key=lambda d: -d.share)


def offered(problem: Problem, forces: Sequence[MissingForce]) -> list[tuple[str, str]]:
    """Kind and port of every force of free form that fits the port."""
    model = problem.builder.outside().model
    known = model.ports() if model else {}
    return [
        (k, m.port.name)
        for m in forces
        for k, law in FREE_FORMS.items()
        if (m.port.name not in known or law.fits(known[m.port.name]))
        and (m.port.has_displacement or not law.needs_displacement())
    ]


def _dependences(problem: Problem, forces: Sequence[MissingForce]) -> Iterator[Dependence]:
    at_port = {m.port.name: m for m in forces}
    for kind, at in offered(problem, forces):
        law, m = FREE_FORMS[kind], at_port[at]
        for shape in law.guesses(m.t - m.t[0], m.displacement, m.velocity, m.force):
            weight = 1 / np.maximum(m.std, LEAST_STD * np.median(m.std) + 1e-300)
            splines = law.splines(shape, m.displacement, m.velocity) * weight[:, None]
            yield Dependence(kind, at, law.against, left_out(splines, m.force * weight), shape)


def left_out(columns: Array, y: Array) -> float:
    """Share of the squares of y (n,) that regression on columns (n, k) predicts, by cross-validation.

    The share is 1 for a perfect prediction, and negative if the prediction is worse than zero.
    """
    pieces = np.array_split(np.arange(len(y)), PIECES)
    grams = np.array([columns[p].T @ columns[p] for p in pieces])
    along = np.array([columns[p].T @ y[p] for p in pieces])
    ridge = (SPLINE_RIDGE * np.mean(np.diag(grams.sum(axis=0))) + 1e-300) * np.eye(columns.shape[1])
    rest = 0.0
    for i, p in enumerate(pieces):
        seen = np.linalg.solve(grams.sum(axis=0) - grams[i] + ridge, along.sum(axis=0) - along[i])
        rest += float(np.sum((y[p] - columns[p] @ seen) ** 2))
    return 1 - rest / (float(y @ y) + 1e-300)


LEAST_STD = 1e-3  # lower limit of a missing force's standard deviation, as share of its median
