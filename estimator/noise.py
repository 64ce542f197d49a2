"""Noise of the measured outputs, declared or estimated, and the weights of the residuals."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.fft import next_fast_len

from estimator.record import Array, BoolArray, Record
from estimator.weighting import Weighting, correlation_of, joint_of

# weights of the third difference; white noise of variance 1 leaves variance 20
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])


Left = Literal["effect", "noise", "form"]  # what a residual is held for where noise is not declared


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of the outputs of a record.

    std: (n_y,) standard deviation, declared or estimated; weighting: the weights of residuals in fits and
    scores, whose sizes are the standard deviations if these are declared; declared: (n_y,) whether they are;
    uneven: (n_y,) how much more its mean square scatters because the sensors round; see `rounding`; caused:
    (n_y,) rms of that part of it which noise of the inputs and times causes.
    """

    std: Array
    weighting: Weighting
    declared: BoolArray
    uneven: Array | float = 1.0
    caused: Array | float = 0.0

    @classmethod
    def of(
        cls, record: Record, residuals: Sequence[Array], chance: float, caused: Sequence[Array] = (),
        left: Left = "noise",
    ) -> "Noise":  # fmt: skip
        """Noise of a record, from the residual (N, n_y) of a fit in each run.

        A declared size says how large the noise is, not that it is white. If the residual is no larger than
        that, it is taken as noise, and its correlation in time is estimated from it. chance: how far its mean
        square may exceed the declared one, in standard deviations; caused: draws (n, n_y) of further noise,
        which is added to that of the sensors and which the outputs may share.

        left: what the residual is held for where noise is not declared. Of an effect, its motion says nothing
        about the noise, and its rms alone balances the outputs. Noise has a correlation, which is estimated.
        An error of the model's form has one too, but predictions of it from its past are no measure of a
        model: only independent samples count (a composite likelihood).
        """
        white = noise_floor(record)
        if caused:
            return cls._shared(record, white, caused, scales(record, residuals, left))
        said = record.noise_declared
        size = np.where(said, white, scales(record, residuals, left))
        most = np.where(said, chance, np.inf if left == "noise" else -np.inf)
        correlation, fitted = [], _stretches(record, residuals)
        for j in range(len(said)):
            found = _of_noise([r[:, j] / size[j] for r in fitted], most[j])
            correlation.append(np.ones(1) if found is None else found)
        return cls(white, Weighting(size, tuple(correlation)), said)

    @classmethod
    def _shared(cls, record: Record, white: Array, caused: Sequence[Array], unsaid: Array) -> "Noise":
        """Noise of the sensors (n_y,) and the noise that is caused; see `of`.

        unsaid: units (n_y,) of the outputs whose noise is not declared.
        """
        part = np.sqrt(np.mean(np.concatenate(caused) ** 2, axis=0))
        std = np.hypot(white, part)
        joint = joint_of([d / std for d in caused], white / std)
        correlation = tuple(joint[:, j, j] / joint[0, j, j] for j in range(len(std)))
        size = np.where(record.noise_declared, std, unsaid)
        return cls(std, Weighting(size, correlation, joint), record.noise_declared, caused=part)

    @property
    def scale(self) -> Array:
        """Unit of the residuals in fits and scores, (n_y,)."""
        return self.weighting.size

    @property
    def redundancy(self) -> Array:
        """Samples per independent one in a mean square, (n_y,)."""
        return self.weighting.redundancy * self.uneven

    @property
    def floor(self) -> Weighting:
        """Weights by the standard deviations, also where noise is not declared."""
        return replace(self.weighting, size=self.std)

    @property
    def known(self) -> bool:
        """Whether it is declared for all outputs, so that a residual can be compared with it."""
        return bool(self.declared.all())


def _fitted(record: Record, residuals: Sequence[Array]) -> list[Array]:
    """The residual on the part to identify of each run that has one, (n, n_y) each."""
    return [r[run.fit] for r, run in zip(residuals, record.runs, strict=True) if run.fit.any()]


def _stretches(record: Record, residuals: Sequence[Array]) -> list[Array]:
    """The residual on each uninterrupted stretch of the part to identify, (n, n_y) each."""
    ends = np.cumsum(record.stretches("fit"))[:-1]
    return np.split(np.concatenate(_fitted(record, residuals)), ends)


def whitening(record: Record, residuals: Sequence[Array]) -> Weighting:
    """Weights that make a residual (N, n_y) of each run white, whatever has left it."""
    fitted = _stretches(record, residuals)
    size = np.maximum(np.sqrt(np.mean(np.concatenate(fitted) ** 2, axis=0)), noise_floor(record))
    alone = (correlation_of([r[:, j] / size[j] for r in fitted]) for j in range(len(size)))
    return Weighting(size, tuple(alone))


def larger(record: Record, residuals: Sequence[Array], chance: float) -> bool:
    """Whether the residual of an output is larger than its declared noise; chance: see Noise.of."""
    fitted, std = _stretches(record, residuals), record.noise_std
    declared = np.flatnonzero(record.noise_declared)
    return any(_of_noise([r[:, j] / std[j] for r in fitted], chance) is None for j in declared)


def _of_noise(parts: Sequence[Array], chance: float) -> Array | None:
    """Autocorrelation of a residual in units of its noise, in stretches (n,); None if it is larger."""
    found = correlation_of(parts)
    redundancy = Weighting(np.ones(1), (found,)).redundancy[0]
    squares = np.concatenate(parts) ** 2
    alike = squares.mean() <= 1 + chance * np.sqrt(2 * redundancy / len(squares))
    return found if alike else None


def white_noise(pieces: Iterable[Array], quantised: bool = False) -> float:
    """Standard deviation of the white noise on pieces (N,) of a channel, by third differences.

    A signal that is smooth over four samples has little influence. quantised: whether differences of zero are
    left out, of which a slow channel with few digits has many.
    """
    rough = np.abs(np.concatenate([np.convolve(x, DIFFERENCE, "valid") for x in pieces]))
    if quantised:
        rough = rough[rough > 0]
    # 1.4826 converts the median of absolute Gaussian values into their standard deviation
    return 1.4826 * float(np.median(rough)) / float(np.linalg.norm(DIFFERENCE)) if rough.size else 0.0


def noise_floor(record: Record) -> Array:
    """Standard deviation of each output's noise (n_y,), declared or else estimated by third differences."""
    estimated = [white_noise(run.y[:, j] for run in record.runs) for j in range(len(record.outputs))]
    spread = np.std(np.vstack([run.y for run in record.runs]), axis=0)
    floor = np.where(record.noise_declared, record.noise_std, estimated)
    lowest: Array = np.maximum(floor, 1e-12 * spread + 1e-300)
    return lowest


def correlation_time(residual: Array) -> float:
    """Number of samples of a residual (N,) per independent sample; 1 for white noise.

    It is the integrated autocorrelation with Sokal's automatic window of five correlation times.
    """
    r = residual - residual.mean()
    n = len(r)
    length = next_fast_len(n + n // 2, real=True)
    spectrum = np.abs(np.fft.rfft(r, length)) ** 2
    rho = np.fft.irfft(spectrum, length)[: n // 2]
    if rho[0] <= 0:
        return 1.0
    tau = 2 * np.cumsum(rho / rho[0]) - 1
    window = np.arange(len(tau)) >= 5 * tau
    return float(max(tau[np.argmax(window)] if window.any() else n / 5, 1.0))


def scales(record: Record, residuals: Sequence[Array], left: Left) -> Array:
    """The unit of each output's residual (n_y,): its declared noise, or else the residual's own rms.

    left: see Noise.of. The rms of an error of form is multiplied by the root of its correlation time.
    """
    size = record.noise_std.copy()
    for j in np.flatnonzero(~record.noise_declared):
        parts = [r[:, j] for r in _fitted(record, residuals)]
        tau = np.mean([correlation_time(p) for p in parts]) if left == "form" else 1.0
        size[j] = np.sqrt(np.mean(np.concatenate(parts) ** 2) * tau)
    return np.maximum(size, noise_floor(record))
