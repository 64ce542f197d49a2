"""Fits a free-form force, one smooth curve at one port, if no effect of the library explains the residual.

The period of a curve over an angle is chosen by regression of the smoothed missing force on the splines of
the curve. The port, and the quantity that the force depends on (velocity, displacement or angle), are chosen
by regression of the residual on the changes that the splines cause in the outputs. Both are judged on blocks
that the regression did not use. The best candidates are fitted in the FMU jointly with the calibrated
parameters. A free-form force does not name a cause, but it reduces the residual of the FMU.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.free_form import (
    FREE_FORMS,
    Dependence,
    dependences,
    left_out,
)
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.regressors import Calibration, Changes
from estimator.closeloop.screening.screen import screen
from estimator.record import Array

RESOLVED = 3.0  # standard errors that a spline coefficient of realistic size must exceed


TRIED = 3  # pairs of port and quantity that are fitted by simulation


PLACES = 2  # further ports, those of the best effects of the library


BOUND = 3.0  # bound of a spline coefficient, as a multiple of the largest missing force


CURVE_POINTS = 200  # points at which a fitted curve is evaluated


@dataclass(frozen=True)
class Curve:
    """A fitted free-form force at a port as a function of a quantity x, with its standard error, (n,) each,
    SI.
    """

    kind: str
    location: str
    against: str
    x: Array
    force: Array
    std: Array


def free_form(
    fitter: Fitter, forces: Sequence[MissingForce], near: Sequence[Hypothesis] = ()
) -> Hypothesis | None:
    """The free-form force that is best on the part to choose, fitted jointly; None if none beats the base.

    near: the best effects of the library, best first, whose ports are tried too. A free-form force beats the
    base if its log score on that part is higher by more standard errors than the policy's `telling`.
    """
    baseline, problem = fitter.baseline, fitter.baseline.problem
    base = baseline.hypothesis
    candidates = [c for d in dependences(problem, forces) for c in _candidates(problem, d, forces)]
    if not candidates:
        return None
    screening = Screening(problem, base.fit, baseline.noise.weighting, forces)
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    calibration = Calibration.of(screening.fit)
    chosen = [resolved(calibration, c, g) for c, g in promising(screening.fit, change, near)]
    promises = screen(screening.fit, [((c,), g) for c, g in chosen if c.amplitudes])
    # for a strong force the linearisation is inaccurate, and a start without the force is better
    promises += [replace(p, start=base.fit.theta) for p in promises]
    fitted = fitter.hypotheses(promises, baseline.policy.search.finalist_pairs)
    found = form_of(baseline).ranked(fitted)
    better = [h for h in found if cost(h) < cost(base) and baseline.beats(h, base)]
    return better[0] if better else None


def promising(base: Fit, change: Changes, near: Sequence[Hypothesis]) -> list[tuple[Candidate, Array]]:
    """The candidates that best predict blocks left out, and those at the ports of the best effects."""
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    share = [left_out(calibration.without(g), residual) for _, g in change]
    order = [change[i] for i in np.argsort(share)[::-1]]
    ports = {c.location for c, _ in change}
    places = list(dict.fromkeys(c.location for h in near for c in h.candidates if c.location in ports))
    more = [(c, g) for c, g in order[TRIED:] if c.location in places[:PLACES]]
    return order[:TRIED] + more


def resolved(calibration: Calibration, c: Candidate, g: Array) -> tuple[Candidate, Array]:
    """A candidate with only the spline coefficients that the record resolves; the others stay at zero.

    g: (m, k) changes by the coefficients at their scales. A coefficient that a calibrated parameter can
    compensate, such as a constant force, hardly changes the residual, and its fit would diverge.
    """
    triangle, order = qr(calibration.without(g), mode="r", pivoting=True)
    kept = sorted(order[np.abs(np.diag(triangle)) > RESOLVED])
    return replace(c, amplitudes=tuple(c.amplitudes[i] for i in kept)), g[:, kept]


def _candidates(problem: Problem, d: Dependence, forces: Sequence[MissingForce]) -> list[Candidate]:
    """The candidate for a dependence, its coefficients bounded by a multiple of the largest missing force."""
    shape = {f"{d.kind}_{d.location}_{n}": v for n, v in d.shape.items()}
    [m] = [m for m in forces if m.port.name == d.location]
    scale, most = float(np.sqrt(np.mean(m.force**2))), BOUND * float(np.abs(m.force).max())
    if scale == 0:
        return []
    return [
        replace(c, amplitudes=tuple(Unknown(u.name, 0.0, -most, most, scale) for u in c.amplitudes))
        for c in physical_candidates(problem, ((d.kind, d.location),), forces)
        if dict(c.fixed) == shape
    ]


def curve_of(h: Hypothesis) -> Curve:
    """The curve of a fitted free-form force, with the standard error from the fit's covariance."""
    c = next(c for c in h.candidates if c.kind in FREE_FORMS)
    law, prefix = FREE_FORMS[c.kind], c.prefix
    shape = {n.removeprefix(prefix): v for n, v in c.fixed.items()}
    x = law.span(shape, CURVE_POINTS)
    splines = law.splines(shape, *law.motion(x))
    names = [u.name for u in h.fit.unknowns]
    i = [names.index(u.name) for u in c.amplitudes]
    splines = splines[:, [law.amplitudes.index(u.name.removeprefix(prefix)) for u in c.amplitudes]]
    controls, covariance = h.fit.values[i], h.fit.covariance[np.ix_(i, i)]
    variance = np.einsum("ni,ij,nj->n", splines, covariance, splines)
    std = np.sqrt(np.maximum(variance, 0.0))
    return Curve(c.kind, c.location, law.against, x, -splines @ controls, std)
