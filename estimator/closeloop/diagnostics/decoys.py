"""Decoys: random regressors with the spectra of real ones, which show the gain that chance can reach.

The phases are drawn at random for each frequency, equal for all outputs, so that spectra and the relations
between outputs are kept (Prichard and Theiler, Physical Review Letters 73 (1994), 951-954). A promise with no
more gain than a decoy is not significant.
"""

from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.screening.regressors import Batch, Calibration, Changes, batches, is_wave
from estimator.record import Array
from fmus.aside import let_go, set_aside

FAMILIES = 12  # leading effects from which decoys are made
BROAD = 8.0  # effective spectral lines, above which random phases give a different regressor


def decoy_gain(base: Fit, change: Changes, outputs: int, rng: np.random.Generator, copies: int = 15) -> float:
    """Reduction of the sum of squares by the best of a set of decoys, the median over the copies.

    base: fit of the calibrated FMU; change: candidates with their changes (m, k), outputs sample by sample.
    A set holds one decoy for each leading effect, cut from one that is a little longer, whose length has
    small factors. The result is comparable with Promise.gain. It is 0 if no regressor has a broad enough
    spectrum, as in a record of one steady state.
    """
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    length = next_fast_len(len(residual) // outputs, real=True)
    spectra = [
        set_aside(np.fft.rfft(g.reshape(-1, outputs, g.shape[1]), length, axis=0))
        for g in leading(base, change, outputs)
    ]
    if not spectra:
        return 0.0
    best = []
    for _ in range(copies):
        made = (decoy(spectrum, length, rng)[: len(residual)] for spectrum in spectra)
        best.append(max(_gain(calibration, g, residual) for g in made))
    return float(np.median(best))


def _gain(calibration: Calibration, g: Array, residual: Array) -> float:
    """That of a decoy (m, k), whose spectrum need not stay in memory any longer."""
    let_go()
    return calibration.left(Batch([g]), residual).gain(slice(None))


def leading(base: Fit, change: Changes, outputs: int) -> list[Array]:
    """Projected changes (m, k) of the leading effects that can have decoys, the best shape of each.

    Sine waves are left out, because their phase is free and a decoy would be the same candidate again.
    """
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    best: dict[str, tuple[float, Array]] = {}
    some = iter([(c, g) for c, g in change if not is_wave(c)])
    for batch in batches(g for c, g in change if not is_wave(c)):
        left = calibration.left(batch, residual)
        for at, (c, g) in zip(batch.places, some, strict=False):
            reached = left.gain(at)
            if c.label not in best or reached > best[c.label][0]:
                best[c.label] = reached, g
    order = sorted(best.values(), key=lambda found: -found[0])
    projected = (set_aside(calibration.without(g)) for _, g in order)
    return list(islice((g for g in projected if lines(g, outputs) >= BROAD), FAMILIES))


def decoy(spectrum: NDArray[np.complex128], samples: int, rng: np.random.Generator) -> Array:
    """A regressor (m, k) with a given spectrum (f, n_y, k) and random phases; its mean is kept."""
    turn = np.exp(2j * np.pi * rng.random(len(spectrum)))
    turn[0] = 1.0
    if samples % 2 == 0:
        turn[-1] = rng.choice([-1.0, 1.0])
    made: Array = np.fft.irfft(spectrum * turn[:, None, None], samples, axis=0)
    return made.reshape(-1, spectrum.shape[2])


def lines(g: Array, outputs: int) -> float:
    """Effective number of spectral lines of columns (m, k), the participation ratio of their power."""
    power = np.sum(np.abs(np.fft.rfft(g.reshape(-1, outputs, g.shape[1]), axis=0)) ** 2, axis=(1, 2))
    return float(power.sum() ** 2 / (np.sum(power**2) + 1e-300))
