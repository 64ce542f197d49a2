"""Adjustment of fitted laws within their standard errors to the part to choose, before they are compared.

It applies to laws that leave only noise in the part to identify. Without it, a parameter that hardly shows in
that part (friction that saturates only in the part to choose) would decide between laws by chance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import pinvh
from scipy.optimize import least_squares

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.record import Array
from fmus.host.fmu import FmuError

ALLOWED_STEPS, ALLOWED_NUDGE = 5, 0.1  # of the search, and of its differences in standard errors


def allowed(baseline: Baseline, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Ranked single hypotheses; those that leave only noise in the part to identify are adjusted.

    Only their residuals change, and only if the part to choose separates them clearly from each other or
    from noise.
    """
    if not baseline.noise.known:
        return list(found)
    alike = [h for h in found if baseline.leaves_noise(h)][: baseline.policy.decision.errors_laws]
    if not alike or not _set_apart(baseline, alike):
        return list(found)
    moved = {id(h): _as_errors_allow(baseline, h) for h in alike}
    return form_of(baseline).ranked([moved.get(id(h), h) for h in found])


def _set_apart(baseline: Baseline, alike: Sequence[Hypothesis]) -> bool:
    limits = baseline.policy
    scores = [float(baseline.scores(h).sum()) for h in alike]
    samples = alike[0].of(baseline.problem, "choose").size
    worst = samples + limits.detection.chance * np.sqrt(2 * samples)
    return max(scores) - min(scores) > limits.decision.errors_apart or -2 * max(scores) > worst


def _as_errors_allow(baseline: Baseline, h: Hypothesis) -> Hypothesis:
    """The hypothesis with its values fitted to the part to choose, their covariance serving as a prior."""
    problem, size = baseline.problem, baseline.noise.scale
    here, unknowns, best = built(problem, h.candidates), h.fit.unknowns, h.fit.values
    error = np.sqrt(np.diag(h.fit.covariance))
    if not np.all(error > 0):
        return h
    values, vectors = np.linalg.eigh(pinvh(h.fit.covariance / np.outer(error, error)))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    runs = problem.record.runs

    def residuals(z: Array) -> list[Array]:
        return here.residuals(dict(zip((u.name for u in unknowns), best + z * error, strict=True)))

    def misfit(z: Array) -> Array:
        left = np.concatenate([r[run.choose] for r, run in zip(residuals(z), runs, strict=True)])
        return np.concatenate([(left / size).ravel(), root @ z])

    def slopes(z: Array) -> Array:
        at = misfit(z)
        return np.column_stack([(misfit(z + d) - at) / ALLOWED_NUDGE for d in ALLOWED_NUDGE * np.eye(len(z))])

    low, high = (np.array([getattr(u, side) for u in unknowns]) for side in ("low", "high"))
    inside = (
        np.clip((low - best) / error, -problem.policy.decision.errors_reach, -ALLOWED_NUDGE),
        np.clip((high - best) / error, ALLOWED_NUDGE, problem.policy.decision.errors_reach),
    )
    try:
        z = least_squares(misfit, np.zeros(len(best)), slopes, inside, max_nfev=ALLOWED_STEPS).x
        return replace(h, residuals=tuple(residuals(z)))
    except FmuError:
        return h
