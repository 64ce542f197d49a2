"""Test whether the residual of the calibrated FMU is more than noise and large enough to matter.

The residual is taken from the parts to choose and to test, which no fit has used. The reference distribution
is a parametric bootstrap to first order: white noise is drawn for all parts of the record, the response of
the calibration to the noise in the part to identify is computed from the sensitivities of the FMU, and the
same statistics are evaluated. The FMU is not simulated again, so the reference assumes that the FMU is linear
in its unknowns within their standard errors. A residual that would matter is therefore tested once more,
after calibration to the whole record.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.detection.importance import importance
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit, stacked
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part
from estimator.closeloop.screening.regressors import Calibration, batches, divisors
from estimator.noise_figures import figures_of, figures_of_noise
from estimator.record import Array
from fmus.aside import set_aside

LIKENESS = "likeness to an effect"


@dataclass(frozen=True)
class Detection:
    """Whether the residual is more than noise, and whether it matters.

    p_value: the smallest of all statistics, Bonferroni corrected; the residual is more than noise if it is
    below `level`. figures: each observed statistic over the 95 % quantile of its reference distribution.
    importance: size of the residual over the smallest size that matters; likeness, sets_in: see `detect`.
    whole: the FMU calibrated to the whole record, if its residual was tested.
    """

    level: float
    p_value: float
    figures: Mapping[str, float]
    importance: float
    likeness: float = 1.0
    sets_in: bool = False
    whole: Hypothesis | None = None

    def tested(self, baseline: Baseline) -> Baseline:
        """The baseline with the calibration whose residual was tested: its own or the whole record's."""
        return replace(baseline, hypothesis=self.whole) if self.whole else baseline

    @property
    def detected(self) -> bool:
        """Whether the residual is more than noise."""
        return self.p_value < self.level

    @property
    def material(self) -> bool:
        """Whether the residual is large enough to matter."""
        return self.importance >= 1.0


def detect(
    baseline: Baseline, screened: Fit, regressors: Sequence[Array], found: tuple[Array, Array],
    likeness: float, sets_in: bool, rng: np.random.Generator,
) -> Detection:  # fmt: skip
    """Test the residual of the calibrated FMU.

    screened: its fit as used in the screening, residual in units of the noise; regressors: changes (m, k) of
    that residual, one array per candidate; found: their lengths and cosines, see `alike`; likeness: share of
    the sum of squares beyond noise that one effect could explain by linear regression; sets_in: whether the
    residual sets in during the record. Whether the residual matters is decided by its size beyond noise, with
    an allowance for chance, compared with the signal and with the noise.
    """
    limits = baseline.policy.detection
    left = baseline.in_noise(baseline.hypothesis.residuals, "unseen")
    observed = figures_of(left, limits.slow_blocks)
    slopes = _sensitivities(baseline)
    early, late = (_columns(baseline, slopes, part) for part in ("fit", "unseen"))
    # noise in the part to identify changes the calibrated values by root @ white noise
    root = np.linalg.pinv(np.linalg.qr(early, mode="r")) if slopes else np.zeros((0, 0))
    references = figures_of_noise(left.shape, late, root, limits.slow_blocks, limits.replicates, rng)
    if regressors:
        lengths, cosines = found
        rest = Calibration.of(screened).without(screened.residual)
        along = np.concatenate([batch.along(rest) for batch in batches(regressors)])
        observed[LIKENESS] = float(np.max((along / divisors(lengths)) ** 2))
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
