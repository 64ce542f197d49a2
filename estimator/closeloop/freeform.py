"""The fallback where no law explains: a force of free form, one smooth curve at one port.

How often a curve comes back in a turn is chosen by regression of the smoothed missing forces on its splines;
which port, and over what (velocity, displacement, angle), by regression of the residual on what the splines
do to the outputs; both are judged on pieces left out. The best are fitted inside the FMU jointly with the
calibrated parameters. It names no cause, but the FMU with it is nearer to the measurement.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from estimator.closeloop.candidates import Candidate, physical_candidates
from estimator.closeloop.compare import Hypothesis, beats, cost, hypotheses, ranked
from estimator.closeloop.fit import Fit
from estimator.closeloop.missing_force import MissingForce
from estimator.closeloop.problem import Problem, Unknown
from estimator.closeloop.regressors import Calibration, Changes
from estimator.closeloop.screen import Screening, screen
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.effects.free_form import FreeForm

PIECES = 10  # of the identify part, each left out in turn
RIDGE = 1e-3  # of the splines' mean square: controls that nothing visits stay at zero
RESOLVED = 3.0  # standard errors that a control of realistic size must be worth
FINALISTS = 2  # of them, fitted to the end
TRIED = 3  # places and quantities that are fitted by simulation
LEAST = 1e-3  # of the median standard deviation of a missing force: it is nowhere known better
PLACES = 2  # ports of the effects that came nearest
BOUND = 3.0  # times the largest missing force: more than that no curve has
GRID = 200  # points of a curve
FREE_FORMS: dict[str, type[FreeForm]] = {k: e for k, e in EFFECTS.items() if issubclass(e, FreeForm)}


@dataclass(frozen=True)
class Dependence:
    """How much of a port's missing force is a curve over one quantity; share: on pieces left out, 1 at most.

    shape: the curve's ends or order.
    """

    kind: str
    location: str
    against: str
    share: float
    shape: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """A fitted force of free form on a port: what it is over, force, its standard error, (GRID,) each, SI."""

    kind: str
    location: str
    against: str
    x: Array
    force: Array
    std: Array


def free_form(
    problem: Problem,
    base: Hypothesis,
    forces: Sequence[MissingForce],
    size: Array,
    jobs: int,
    near: Sequence[Hypothesis] = (),
) -> Hypothesis | None:
    """The force of free form that is best on the part to choose, fitted jointly; None where none is better.

    near: effects that came nearest, best first, whose ports are tried too. Better than the base means by
    TELLING standard errors over blocks of that part.
    """
    candidates = [c for d in dependences(problem, forces) for c in _candidates(problem, d, forces)]
    if not candidates:
        return None
    screening = Screening(problem, base.fit, size, forces)
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    calibration = Calibration.of(screening.fit)
    chosen = [resolved(calibration, c, g) for c, g in promising(screening.fit, change, near)]
    promises = screen(screening.fit, [((c,), g) for c, g in chosen if c.amplitudes])
    # a strong law differs from its linear picture, and then a start without it is the better one
    promises += [replace(p, start=base.fit.theta) for p in promises]
    found = ranked(problem, hypotheses(problem, base, promises, size, jobs, FINALISTS), size)
    better = [h for h in found if cost(h) < cost(base) and beats(problem, h, base, size)]
    return better[0] if better else None


def promising(base: Fit, change: Changes, near: Sequence[Hypothesis]) -> list[tuple[Candidate, Array]]:
    """Candidates that predict the residual best in pieces left out, and those at the ports of the nearest."""
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    share = [left_out(calibration.without(g), residual) for _, g in change]
    order = [change[i] for i in np.argsort(share)[::-1]]
    ports = {c.location for c, _ in change}
    places = list(dict.fromkeys(c.location for h in near for c in h.candidates if c.location in ports))
    more = [(c, g) for c, g in order[TRIED:] if c.location in places[:PLACES]]
    return order[:TRIED] + more


def resolved(calibration: Calibration, c: Candidate, g: Array) -> tuple[Candidate, Array]:
    """A candidate with those of its controls that the record resolves; the others stay at zero.

    g: (m, k) changes by its controls at their scales. A constant part, or one that a calibrated parameter
    makes up for, moves nothing and would run away.
    """
    triangle, order = qr(calibration.without(g), mode="r", pivoting=True)
    kept = sorted(order[np.abs(np.diag(triangle)) > RESOLVED])
    return replace(c, amplitudes=tuple(c.amplitudes[i] for i in kept)), g[:, kept]


def dependences(problem: Problem, forces: Sequence[MissingForce]) -> list[Dependence]:
    """Over what the missing force at each port is a curve, most first; of several shapes the best."""
    best: dict[tuple[str, str], Dependence] = {}
    for d in _dependences(problem, forces):
        key = (d.kind, d.location)
        if key not in best or d.share > best[key].share:
            best[key] = d
    return sorted(best.values(), key=lambda d: -d.share)


def offered(problem: Problem, forces: Sequence[MissingForce]) -> list[tuple[str, str]]:
    """(kind, port) of every force of free form that makes sense at the port."""
    model = problem.builder.outside().model
    known = model.ports() if model else {}
    ports = [m.port.name for m in forces]
    return [
        (k, at) for at in ports for k, law in FREE_FORMS.items() if at not in known or law.fits(known[at])
    ]


def _dependences(problem: Problem, forces: Sequence[MissingForce]) -> Iterator[Dependence]:
    at_port = {m.port.name: m for m in forces}
    for kind, at in offered(problem, forces):
        law, m = FREE_FORMS[kind], at_port[at]
        for shape in law.guesses(m.t - m.t[0], m.displacement, m.velocity, m.force):
            weight = 1 / np.maximum(m.std, LEAST * np.median(m.std) + 1e-300)
            splines = law.splines(shape, m.displacement, m.velocity) * weight[:, None]
            yield Dependence(kind, at, law.against, left_out(splines, m.force * weight), shape)


def left_out(columns: Array, y: Array) -> float:
    """Share of the squares of y (n,) that regression on columns (n, k) predicts in pieces left out.

    1 is all of it; below 0 the prediction is worse than none.
    """
    pieces = np.array_split(np.arange(len(y)), PIECES)
    grams = np.array([columns[p].T @ columns[p] for p in pieces])
    along = np.array([columns[p].T @ y[p] for p in pieces])
    ridge = (RIDGE * np.mean(np.diag(grams.sum(axis=0))) + 1e-300) * np.eye(columns.shape[1])
    rest = 0.0
    for i, p in enumerate(pieces):
        seen = np.linalg.solve(grams.sum(axis=0) - grams[i] + ridge, along.sum(axis=0) - along[i])
        rest += float(np.sum((y[p] - columns[p] @ seen) ** 2))
    return 1 - rest / (float(y @ y) + 1e-300)


def _candidates(problem: Problem, d: Dependence, forces: Sequence[MissingForce]) -> list[Candidate]:
    """The candidate of a dependence in its shape, its controls bound to what the missing force is at most."""
    offers, site = ((d.kind, d.location),), problem.builder.outside()
    shape = {f"{d.kind}_{d.location}_{n}": v for n, v in d.shape.items()}
    [m] = [m for m in forces if m.port.name == d.location]
    scale, most = float(np.sqrt(np.mean(m.force**2))), BOUND * float(np.abs(m.force).max())
    if scale == 0:
        return []
    return [
        replace(c, amplitudes=tuple(Unknown(u.name, 0.0, -most, most, scale) for u in c.amplitudes))
        for c in physical_candidates(offers, site, problem.record, forces)
        if dict(c.fixed) == shape
    ]


def curve_of(h: Hypothesis) -> Curve:
    """The curve of a force of free form with the standard error that its fit gives."""
    c = next(c for c in h.candidates if c.kind in FREE_FORMS)
    law, prefix = FREE_FORMS[c.kind], c.prefix
    shape = {n.removeprefix(prefix): v for n, v in c.fixed.items()}
    x = law.span(shape, GRID)
    splines = law.splines(shape, *law.motion(x))
    names = [u.name for u in h.fit.unknowns]
    i = [names.index(u.name) for u in c.amplitudes]
    splines = splines[:, [law.amplitudes.index(u.name.removeprefix(prefix)) for u in c.amplitudes]]
    controls, covariance = h.fit.values[i], h.fit.covariance[np.ix_(i, i)]
    variance = np.einsum("ni,ij,nj->n", splines, covariance, splines)
    std = np.sqrt(np.maximum(variance, 0.0))
    return Curve(c.kind, c.location, law.against, x, -splines @ controls, std)
