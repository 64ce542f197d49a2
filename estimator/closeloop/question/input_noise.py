"""White noise of the recorded inputs: declared, or found in their spectra, and smoothed away.

A model that is driven by noisy inputs answers to their noise. A lag of such an input then fits better than
the right effect, because it filters that noise. The inputs are therefore smoothed by their wavelets: those
that noise alone would not cause are kept, so that steps and corners stay as sharp as they can be seen (R. R.
Coifman, D. L. Donoho, Translation-Invariant De-Noising, Lecture Notes in Statistics 103 (1995), 125-150).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pywt
from scipy.signal import welch

from estimator.closeloop.policy import InputPolicy
from estimator.record import Array, Note, Record

WAVELET = "db2"  # it does not see straight lines, and is the shortest that does not


@dataclass(frozen=True, eq=False)
class InputNoise:
    """White noise of the inputs of a record.

    std: (n_u,) standard deviation, zero for an input without noise; levels: see InputPolicy; errors: draws of
    the error (N, n_u) that smoothing has left, for each run.
    """

    std: Array
    levels: int
    errors: tuple[tuple[Array, ...], ...] = ()

    @classmethod
    def of(cls, record: Record, limits: InputPolicy) -> InputNoise | None:
        """The noise of a record's inputs, declared or seen; None if none of them has any."""
        found = [
            record.input_std.get(name) or max(white_part(run.u[:, j], limits) for run in record.runs)
            for j, name in enumerate(record.inputs)
        ]
        return cls(np.array(found), limits.levels) if any(found) else None

    def smoothed(self, record: Record) -> Record:
        """The record with smoothed inputs, and a note for each of them."""
        runs = tuple(replace(run, u=self._without(run.u)) for run in record.runs)
        noisy = [(o, std) for o, std in zip(record.inputs, self.std, strict=True) if std]
        said = "white noise with a standard deviation of {:.2g} was {} and smoothed away"
        how = {name: "declared" if name in record.input_std else "found" for name, _ in noisy}
        notes = [Note("input noise", n, f"{n}: {said.format(std, how[n])}") for n, std in noisy]
        return replace(record, runs=runs, notes=(*record.notes, *notes))

    def drawn(self, record: Record, draws: int) -> InputNoise:
        """The same noise with draws of what smoothing has left in the inputs of a smoothed record."""
        rng = np.random.default_rng(0)
        return replace(self, errors=tuple(tuple(self.left(run.u, rng, draws)) for run in record.runs))

    def left(self, u: Array, rng: np.random.Generator, draws: int) -> list[Array]:
        """Draws of the error that smoothing leaves in inputs (N, n_u), which have been smoothed.

        What has been smoothed has lost details that the input had, and of which the error would hold some.
        How much smaller the errors become by each further smoothing tells by how much these are too small:
        the iterated bootstrap of P. Hall, M. A. Martin, Biometrika 75 (1988), 661-671, twice. The error of an
        input of few steps differs much from draw to draw. All draws are therefore compared together, and
        each smoothing has the same draws of noise, in turn.
        """
        noise = [self.std * rng.standard_normal(u.shape) for _ in range(draws)]
        errors, now = [], [u] * draws
        for _ in range(3):
            errors.append([self._without(x + n) - x for x, n in zip(now, noise, strict=True)])
            now = [x + e for x, e in zip(now, errors[-1], strict=True)]
            noise = [*noise[1:], noise[0]]
        first, second, third = (np.sqrt(np.mean(np.square(some), axis=(0, 1))) for some in errors)
        size = np.divide(first**2 * third, second**3, out=np.ones_like(first), where=second > 0)
        return [e * np.maximum(size, 1.0) for e in errors[0]]

    def _without(self, u: Array) -> Array:
        columns = zip(u.T, self.std, strict=True)
        return np.column_stack([smoothed(x, std, self.levels) if std else x for x, std in columns])


def white_part(u: Array, limits: InputPolicy) -> float:
    """Standard deviation of the white noise of an input (N,); zero if its spectrum is not flat at the end.

    The spectrum is the median over segments, so that single steps of the input do not matter. A smooth input
    has no power of its own in the upper octave of the frequencies; that of a rough one falls there.
    """
    length = len(u) // limits.segments // 4 * 4
    if length < limits.segment or np.ptp(u) == 0:
        return 0.0
    # density over the range 0 to 1, which for white noise is its variance
    _, power = welch(u, 2.0, "hann", length, average="median")
    upper = power[length // 4 : -1]
    low, high = (float(half.mean()) for half in np.array_split(upper, 2))
    # a median of n scatters by 1 / (log 2 root n) of its mean; segments that overlap by half count for 0.6,
    # and neighbours share the window's width of 1.5
    count = 0.6 * (2 * len(u) // length - 1) * len(upper) / 2 / (2 * 1.5)
    white, scatter = float(upper.mean()), 1 / np.log(2.0) / np.sqrt(count)
    flat = abs(low - high) <= limits.flat * scatter * white
    return float(np.sqrt(white)) if flat else 0.0


def smoothed(u: Array, std: float, levels: int) -> Array:
    """A signal (N,) without white noise of a standard deviation; levels: see InputPolicy."""
    n = len(u)
    levels = min(levels, int(np.log2(n)) - 1)
    block = 2**levels
    before = min(block, n - 1)
    after = before + -(n + 2 * before) % block
    padded = np.pad(np.pad(u, before, "reflect"), (0, after - before), "edge")
    rough, *details = pywt.swt(padded, WAVELET, levels, trim_approx=True)
    least = std * np.sqrt(2 * np.log(n))
    kept = [np.where(np.abs(d) > least, d, 0.0) for d in details]
    return np.asarray(pywt.iswt([rough, *kept], WAVELET)[before : before + n])
