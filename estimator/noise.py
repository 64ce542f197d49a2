"""Noise of the measured outputs, declared or estimated, and the weights of the residuals."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.record import Array, BoolArray, Record

# weights of the third difference; white noise of variance 1 leaves variance 20
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of the outputs of a record.

    std: (n_y,) standard deviation, declared or estimated; scale: (n_y,) unit of the residuals in fits and
    scores, which is the standard deviation if that is declared; declared: (n_y,) whether it is.
    """

    std: Array
    scale: Array
    declared: BoolArray

    @classmethod
    def of(cls, record: Record, residuals: Sequence[Array]) -> "Noise":
        """Noise of a record, from the residual (N, n_y) of a fit in each run."""
        return cls(noise_floor(record), weights(record, residuals), record.noise_declared)

    @property
    def known(self) -> bool:
        """Whether it is declared for all outputs, so that a residual can be compared with it."""
        return bool(self.declared.all())


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
    spectrum = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    rho = np.fft.irfft(spectrum)[: n // 2]
    if rho[0] <= 0:
        return 1.0
    tau = 2 * np.cumsum(rho / rho[0]) - 1
    window = np.arange(len(tau)) >= 5 * tau
    return float(max(tau[np.argmax(window)] if window.any() else n / 5, 1.0))


def weights(record: Record, residuals: Sequence[Array]) -> Array:
    """The unit of each output's residual (n_y,), by which residuals are weighted.

    It is the declared noise. If noise is not declared, it is the rms of the residual times the root of its
    correlation time, so that only independent samples count (a composite likelihood).
    """
    size = record.noise_std.copy()
    for j in np.flatnonzero(~record.noise_declared):
        parts = [r[run.fit, j] for r, run in zip(residuals, record.runs, strict=True) if run.fit.any()]
        tau = np.mean([correlation_time(p) for p in parts])
        size[j] = np.sqrt(np.mean(np.concatenate(parts) ** 2) * tau)
    return np.maximum(size, noise_floor(record))
