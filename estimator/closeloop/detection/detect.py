"""Test whether the residual of the calibrated FMU is more than noise and large enough to matter.

The residual is taken from the parts to choose and to test, which no fit has used. The reference distribution
is a parametric bootstrap to first order: white noise is drawn for all parts of the record, the response of
the calibration to the noise in the part to identify is computed from the sensitivities of the FMU, and the
same statistics are evaluated. The FMU is not simulated again, so the reference assumes that the FMU is linear
in its unknowns within their standard errors.

The statistics depend on the noise only through its means over blocks, its share along the sensitivities, and
the length of what is left, which are independent of one another. So these few numbers are drawn, and not the
noise of every sample.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.detection.importance import importance
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit, stacked
from estimator.closeloop.hypotheses.hypothesis import Part
from estimator.closeloop.screening.regressors import directions
from estimator.record import Array
from fmus.aside import set_aside

SIZE = "size of the residual that no fit has seen"
SLOW = "slow part of the residual that no fit has seen"
LIKENESS = "likeness to an effect"
UNSEEN = 1e-12  # square of a change by one standard deviation, in units of the noise, below which it is none


@dataclass(frozen=True)
class Detection:
    """Whether the residual is more than noise, and whether it matters.

    p_value: the smallest of all statistics, Bonferroni corrected; the residual is more than noise if it is
    below `level`. figures: each observed statistic over the 95 % quantile of its reference distribution.
    importance: size of the residual over the smallest size that matters; likeness, sets_in: see `detect`.
    """

    level: float
    p_value: float
    figures: Mapping[str, float]
    importance: float
    likeness: float = 1.0
    sets_in: bool = False

    @property
    def detected(self) -> bool:
        """Whether the residual is more than noise."""
        return self.p_value < self.level

    @property
    def material(self) -> bool:
        """Whether the residual is large enough to matter."""
        return self.importance >= 1.0


def detect(
    baseline: Baseline, screened: Fit, regressors: Sequence[Array], likeness: float, sets_in: bool,
    rng: np.random.Generator,
) -> Detection:  # fmt: skip
    """Test the residual of the calibrated FMU.

    screened: its fit as used in the screening, residual in units of the noise; regressors: changes (m, k) of
    that residual, one array per candidate; likeness: share of the sum of squares beyond noise that one
    effect could explain by linear regression; sets_in: whether the residual sets in during the record.
    Whether the residual matters is decided by its size beyond noise, with an allowance for chance, compared
    with the signal and with the noise.
    """
    limits = baseline.policy.detection
    left = baseline.in_noise(baseline.hypothesis.residuals, "unseen")
    observed = _figures(left, limits.slow_blocks)
    slopes = _sensitivities(baseline)
    early, late = (_columns(baseline, slopes, part) for part in ("fit", "unseen"))
    # noise in the part to identify changes the calibrated values by root @ white noise
    root = np.linalg.pinv(np.linalg.qr(early, mode="r")) if slopes else np.zeros((0, 0))
    references = noise_figures(left.shape, late, root, limits.slow_blocks, limits.replicates, rng)
    if regressors:
        along, cosines = directions(screened, regressors)
        observed[LIKENESS] = float(np.max(along**2))
        references[LIKENESS] = _likeness_of_noise(cosines, limits.replicates, rng)
    p_values, figures = [], {}
    for name, value in observed.items():
        reference = references[name]
        p_values.append((1 + np.sum(reference >= value)) / (limits.replicates + 1))
        figures[name] = float(value / np.quantile(reference, 0.95))
    p_value = min(1.0, len(p_values) * float(min(p_values)))
    size = importance(baseline, likeness, sets_in)
    return Detection(limits.level, p_value, figures, size, likeness, sets_in)


def _sensitivities(baseline: Baseline) -> list[list[Array]]:
    """Derivatives of the residuals of each run (N, n_y) with respect to each unknown."""
    here, fit = baseline.hypothesis.residuals, baseline.hypothesis.fit
    aside = [{**fit.theta, u.name: fit.theta[u.name] + STEP * u.scale} for u in fit.unknowns]
    moved = zip(fit.unknowns, baseline.problem.several_residuals(aside), strict=True)
    return [
        [set_aside((r - at) / (STEP * u.scale)) for r, at in zip(there, here, strict=True)]
        for u, there in moved
    ]


def _columns(baseline: Baseline, slopes: Sequence[Sequence[Array]], part: Part) -> Array:
    """Derivatives on a part of the record in units of the noise, (m, n)."""
    made = [set_aside(baseline.in_noise(slope, part).ravel()) for slope in slopes]
    return stacked(made) if made else np.empty((0, 0))


def _likeness_of_noise(cosines: Array, replicates: int, rng: np.random.Generator) -> Array:
    """The largest squared projection of white noise onto directions with given cosines, (replicates,)."""
    values, vectors = np.linalg.eigh(cosines)
    root = vectors * np.sqrt(np.maximum(values, 0))
    drawn = rng.standard_normal((replicates, len(cosines))) @ root.T
    return np.asarray(np.max(drawn**2, axis=1))


def noise_figures(
    shape: tuple[int, int], late: Array, root: Array, pieces: int, replicates: int, rng: np.random.Generator
) -> dict[str, Array]:
    """As `_figures` of each of several draws of white noise after the calibration, (replicates,) each.

    shape: (N, n_y) of the noise; late: (N n_y, n), by which n unknowns change its samples; root: (n, k), by
    which k independent standard normal numbers change the unknowns.
    """
    (n, n_y), k, ends = shape, root.shape[1], _ends(shape[0], pieces)
    sizes = np.diff([*ends, n])
    means, products = np.empty((len(ends), n_y, k)), np.zeros((n_y, k, k))
    for i, (first, size) in enumerate(zip(ends, sizes, strict=True)):
        part = (late[first * n_y : (first + size) * n_y] @ root).reshape(size, n_y, k).swapaxes(0, 1)
        means[i] = part.sum(axis=1) / np.sqrt(size)
        products += part.swapaxes(1, 2) @ part
    by_calibration = rng.standard_normal((replicates, k))
    squares, slow = np.empty((n_y, replicates)), np.empty((n_y, replicates))
    for j in range(n_y):
        values, vectors = np.linalg.eigh(products[j] - means[:, j].T @ means[:, j])
        shown = values > UNSEEN
        along = (vectors[:, shown] * np.sqrt(values[shown])).T  # beside the means
        in_means, beside = (
            np.sum((rng.standard_normal((replicates, len(a))) - by_calibration @ a.T) ** 2, axis=1)
            for a in (means[:, j], along)
        )
        free = n - len(ends) - len(along)
        rest = rng.chisquare(free, replicates) if free > 0 else 0.0
        squares[j], slow[j] = (in_means + beside + rest) / n, in_means / len(ends)
    return {SIZE: np.max(squares, axis=0), SLOW: np.max(slow, axis=0)}


def _figures(left: Array, pieces: int) -> dict[str, float]:
    """Largest mean square of an output of a residual (N, n_y), and that of its means over blocks, in units of
    what white noise leaves.
    """
    ends = _ends(len(left), pieces)
    means = np.add.reduceat(left, ends, axis=0) / np.sqrt(np.diff([*ends, len(left)]))[:, None]
    squares = np.einsum("ij,ij->j", left, left) / len(left)
    return {SIZE: float(np.max(squares)), SLOW: float(np.max(np.mean(means**2, axis=0)))}


def _ends(samples: int, pieces: int) -> list[int]:
    """First sample of each of the blocks."""
    return [int(b[0]) for b in np.array_split(np.arange(samples), min(pieces, samples))]
