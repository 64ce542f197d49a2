"""Noise floor, correlation time and weights of residuals."""

import numpy as np

from estimator.record import Array, Record

# weights of the third difference; white noise of variance 1 leaves variance 20
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])


def noise_floor(record: Record) -> Array:
    """Standard deviation of each output's noise (n_y,): as declared, else what third differences leave."""
    measured = []
    for j in range(len(record.outputs)):
        rough = np.concatenate([np.convolve(run.y[:, j], DIFFERENCE, "valid") for run in record.runs])
        measured.append(1.4826 * np.median(np.abs(rough)) / np.linalg.norm(DIFFERENCE))
    spread = np.std(np.vstack([run.y for run in record.runs]), axis=0)
    floor = np.where(np.isnan(record.noise_std), measured, record.noise_std)
    lowest: Array = np.maximum(floor, 1e-12 * spread + 1e-300)
    return lowest


def correlation_time(residual: Array) -> float:
    """Samples from one independent sample of a residual (N,) to the next: 1 for white noise.

    Integrated autocorrelation with Sokal's automatic window (five correlation times).
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


def weights(record: Record, residuals: list[Array]) -> Array:
    """Size of a residual that counts as one, for each output (n_y,).

    Declared noise counts as it is. Otherwise the residual itself says how large it is and, by its
    correlation time, how many of its samples are independent (a composite likelihood).
    """
    size = record.noise_std.copy()
    for j in np.flatnonzero(np.isnan(size)):
        parts = [r[run.fit, j] for r, run in zip(residuals, record.runs, strict=True) if run.fit.any()]
        tau = np.mean([correlation_time(p) for p in parts])
        size[j] = np.sqrt(np.mean(np.concatenate(parts) ** 2) * tau)
    return np.maximum(size, noise_floor(record))
