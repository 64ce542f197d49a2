"""Is there a discrepancy, and does it matter? Tested against records simulated without any effect.

The reference distribution is a parametric bootstrap to first order: white noise of the record's size is
drawn for all parts, what calibration to the noise of the identify part changes in the parts that no fit has
seen follows from the FMU's sensitivities, and the same figures are computed. The FMU itself is not simulated
again, so the reference is as good as the FMU is linear in its unknowns within their standard errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part
from estimator.closeloop.question.problem import Problem
from estimator.record import Array

LIKENESS = "likeness to an effect"
TINY = 1e-300  # of a signal or a noise that is zero


@dataclass(frozen=True)
class Detection:
    """Whether a residual is more than noise, and whether it matters.

    p_value: of the most telling figure, corrected for their number, which counts below `level`; figures:
    observed over the 95 % point of noise; importance: size of the residual over the least that matters.
    """

    level: float
    p_value: float
    figures: Mapping[str, float]
    importance: float

    @property
    def detected(self) -> bool:
        """More than noise."""
        return self.p_value < self.level

    @property
    def material(self) -> bool:
        """Large enough to matter."""
        return self.importance >= 1.0


def detect(
    problem: Problem, base: Hypothesis, noise: Array, screened: Fit, regressors: Sequence[Array],
    likeness: float, sets_in: bool, rng: np.random.Generator,
) -> Detection:  # fmt: skip
    """Test the base hypothesis' residual.

    screened: its fit as it was screened, residual over `noise`; regressors: changes (m, k) of that residual;
    likeness, sets_in: see `matters`.
    """
    limits = problem.policy.detection
    runs = problem.record.runs
    fitted, unseen = (np.concatenate([getattr(r, m) for r in runs]) for m in ("fit", "unseen"))
    left = np.concatenate(base.residuals)[unseen] / noise
    slopes = _sensitivities(problem, base, noise)
    g = _directions(screened.jacobian, regressors) if regressors else None
    observed = _figures(left, limits.slow_blocks)
    n = slopes.shape[2]
    # noise in the part to identify moves the unknowns by root @ white noise
    root = np.linalg.pinv(np.linalg.qr(slopes[fitted].reshape(-1, n), mode="r")) if n else np.zeros((0, 0))
    late, copies = slopes[unseen], []
    for _ in range(limits.replicates):
        e = rng.standard_normal(left.shape)
        if n:
            e -= late @ (root @ rng.standard_normal(root.shape[1]))
        copies.append(_figures(e, limits.slow_blocks))
    references = {name: np.array([c[name] for c in copies]) for name in observed}
    if g is not None:
        observed[LIKENESS] = float(np.max((g.T @ screened.residual) ** 2))
        references[LIKENESS] = _likeness_of_noise(g, limits.replicates, rng)
    p_values, figures = [], {}
    for name, value in observed.items():
        reference = references[name]
        p_values.append((1 + np.sum(reference >= value)) / (limits.replicates + 1))
        figures[name] = float(value / np.quantile(reference, 0.95))
    p_value = min(1.0, len(p_values) * float(min(p_values)))
    clear = figures.get(LIKENESS, 0.0) >= limits.clear_likeness
    return Detection(
        limits.level, p_value, figures, importance(problem, base, noise, likeness, sets_in, clear)
    )


def importance(
    problem: Problem,
    base: Hypothesis,
    noise: Array,
    likeness: float = 1.0,
    sets_in: bool = False,
    clear: bool = False,
) -> float:
    """How large a residual is beside the least that matters, in any output and either part of the record.

    From 1 on it matters. Compared with the signal and with the noise is what it has beyond noise, beyond what
    chance makes of that too. Where the FMU's form leaves something open, what no fit has seen counts alone;
    less than form leaves matters only if one effect could explain much of it, or if it sets in during the
    record, as no form does. likeness: share of what is beyond noise that one effect could explain, by linear
    regression; clear: whether it is so much like one that noise never is.
    """
    limits = problem.policy.detection
    signal, rms, form_open = signal_size(problem), base.rms(problem, "unseen"), problem.form_error > 0
    beyond = _beyond(problem, base, noise, "unseen")
    if not form_open:
        beyond = np.maximum(beyond, _beyond(problem, base, noise, "fit"))
    least = limits.noise_share_of_effects if clear and not form_open else limits.noise_share
    lowest = np.minimum(limits.signal_share * signal, least * noise)
    telling = float(np.max(beyond / np.maximum(lowest, TINY)))
    if not form_open:
        return telling
    form = np.maximum(problem.form_error * signal, TINY)
    large = float(np.max(np.minimum(beyond / form, rms / (limits.open_form_noises * noise))))
    return max(large, telling) if sets_in or likeness >= limits.open_form_likeness else large


def _beyond(problem: Problem, base: Hypothesis, noise: Array, part: Part) -> Array:
    """Root mean square (n_y,) of what a part of the record has beyond noise and what chance makes of it."""
    residual = base.of(problem, part)
    chance = 1 + problem.policy.detection.chance * np.sqrt(2 / max(len(residual), 1))
    return np.asarray(np.sqrt(np.maximum(np.mean(residual**2, axis=0) - chance * noise**2, 0.0)))


def signal_size(problem: Problem) -> Array:
    """Root mean square of each output on the parts that no fit has seen, (n_y,)."""
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    return np.asarray(np.sqrt(np.mean(measured**2, axis=0)))


def _sensitivities(problem: Problem, base: Hypothesis, noise: Array) -> Array:
    """Derivatives of the whole residual by the unknowns, (N, n_y, n)."""
    columns = []
    for u in base.fit.unknowns:
        h = STEP * u.scale
        moved = problem.residuals({**base.fit.theta, u.name: base.fit.theta[u.name] + h})
        change = np.concatenate(moved) - np.concatenate(base.residuals)
        columns.append(change / noise / h)
    shape = np.concatenate(base.residuals).shape
    return np.stack(columns, axis=2) if columns else np.zeros((*shape, 0))


def _directions(jacobian: Array, regressors: Sequence[Array]) -> Array:
    """Changes of the residual that the calibration cannot take over, of length 1, (m, k)."""
    g = np.hstack(regressors)
    if jacobian.shape[1]:
        q = np.linalg.qr(jacobian)[0]
        g = g - q @ (q.T @ g)
    directions: Array = g / (np.linalg.norm(g, axis=0) + 1e-300)
    return directions


def _likeness_of_noise(g: Array, replicates: int, rng: np.random.Generator) -> Array:
    """The largest squared projection of white noise on any direction of g (m, k), (replicates,)."""
    values, vectors = np.linalg.eigh(g.T @ g)
    root = vectors * np.sqrt(np.maximum(values, 0))
    drawn = rng.standard_normal((replicates, g.shape[1])) @ root.T
    return np.asarray(np.max(drawn**2, axis=1))


def _figures(left: Array, pieces: int) -> dict[str, float]:
    means = np.array([b.mean(axis=0) * np.sqrt(len(b)) for b in np.array_split(left, pieces)])
    return {
        "size of the residual that no fit has seen": float(np.max(np.mean(left**2, axis=0))),
        "slow part of the residual that no fit has seen": float(np.max(np.mean(means**2, axis=0))),
    }
