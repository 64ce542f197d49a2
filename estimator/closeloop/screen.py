"""Screening by simulated sensitivity: how much of the residual could each candidate explain?

One simulation per amplitude at a realistic size; what the calibrated parameters could take over is
projected out. It nominates; the joint fit decides.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.fit import Fit, weighted
from estimator.closeloop.problem import Problem
from estimator.record import Array

NOTHING = 1e-9  # of a regressor left after projection: it says nothing new


@dataclass(frozen=True)
class Promise:
    """What a set of candidates (one, or a pair) could explain, by linear regression.

    gain: fall of the sum of squares on the identify part; start: values to start the joint fit from.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    start: dict[str, float]

    @property
    def label(self) -> str:
        """Its candidates' labels joined."""
        return label(self.candidates)


def label(candidates: Sequence[Candidate]) -> str:
    """Labels of a set of candidates, joined."""
    return " + ".join(sorted(c.label for c in candidates))


def built(problem: Problem, candidates: Sequence[Candidate]) -> Problem:
    """The problem with the FMU that has these candidates' effects."""
    extra = [(c.kind, c.location) for c in candidates if not c.is_fault]
    return problem.with_effects(sorted({*problem.effects, *extra}))


def changes(
    problem: Problem, base: Fit, candidates: Sequence[Candidate], size: Array, jobs: int
) -> list[Array]:
    """Change of the weighted residual by each candidate's amplitudes at their scales, (m, k) each."""
    work = Parallel(n_jobs=jobs)(delayed(_change)(problem, base, c, size) for c in candidates)
    return list(work)


def _change(problem: Problem, base: Fit, candidate: Candidate, size: Array) -> Array:
    here = built(problem, [candidate])
    shape = {u.name: u.start for u in candidate.shape}
    columns = []
    for u in candidate.amplitudes:
        moved = weighted(here, {**base.theta, **shape, u.name: u.scale}, size)
        columns.append(moved - base.residual)
    return np.column_stack(columns)


def screen(base: Fit, sets: Sequence[tuple[tuple[Candidate, ...], Array]]) -> list[Promise]:
    """Promise of each set of candidates with its changes (m, k), best first."""
    n = base.jacobian.shape[1]
    basis = np.linalg.qr(base.jacobian)[0] if n else np.zeros((len(base.residual), 0))
    return sorted((_promise(base, basis, c, raw) for c, raw in sets), key=lambda p: -p.gain)


def _promise(base: Fit, basis: Array, candidates: tuple[Candidate, ...], raw: Array) -> Promise:
    g = raw - basis @ (basis.T @ raw)
    r = base.residual - basis @ (basis.T @ base.residual)
    amplitudes = [u for c in candidates for u in c.amplitudes]
    size, left = np.linalg.norm(raw, axis=0) + 1e-300, np.linalg.norm(g, axis=0)
    usable = left > NOTHING * size
    beta = np.zeros(len(amplitudes))
    beta[usable] = np.linalg.lstsq(g[:, usable] / size[usable], -r, rcond=NOTHING)[0] / size[usable]
    beta = np.maximum(beta, [u.low / u.scale for u in amplitudes])
    gain = float(r @ r - np.sum((r + g @ beta) ** 2))
    start = {u.name: float(b * u.scale) for u, b in zip(amplitudes, beta, strict=True)}
    start |= {u.name: u.start for c in candidates for u in c.shape}
    if len(base.values):
        shift = np.linalg.lstsq(base.jacobian, -(base.residual + raw @ beta), rcond=None)[0]
        low, high = ([getattr(u, side) for u in base.unknowns] for side in ("low", "high"))
        moved = np.clip(base.values + shift, low, high)
        start |= {u.name: float(v) for u, v in zip(base.unknowns, moved, strict=True)}
    return Promise(candidates, gain, start)
