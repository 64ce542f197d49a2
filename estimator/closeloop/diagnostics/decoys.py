"""Decoys: regressors that mean nothing but have the spectrum of real ones. What they reach is chance.

Phases are drawn anew at each frequency, the same for all outputs, so that spectra and the relations between
outputs stay (Prichard and Theiler, Physical Review Letters 73 (1994), 951-954). A promise that decoys
reach is none.
"""

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.screening.regressors import RIDGE, Calibration, Changes, is_wave
from estimator.record import Array

FAMILIES = 12  # leading effects of which decoys are made
BROAD = 8.0  # lines of a spectrum, from which a regressor with other phases is another regressor


def decoy_gain(base: Fit, change: Changes, outputs: int, rng: np.random.Generator, copies: int = 15) -> float:
    """Fall of the sum of squares that the best of a set of decoys reaches, the median over the copies.

    base: of the calibrated FMU; change: candidates with their changes (m, k), outputs sample after sample;
    a set holds one decoy of each leading family. Compares with Promise.gain; 0 where no regressor is broad
    enough to have decoys, as in a record at one steady state.
    """
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    spectra = [
        np.fft.rfft(g.reshape(-1, outputs, g.shape[1]), axis=0) for g in leading(base, change, outputs)
    ]
    if not spectra:
        return 0.0
    best = []
    for _ in range(copies):
        made = [decoy(spectrum, len(residual) // outputs, rng) for spectrum in spectra]
        best.append(max(gain(residual, calibration.without(g)) for g in made))
    return float(np.median(best))


def leading(base: Fit, change: Changes, outputs: int) -> list[Array]:
    """Changes (m, k) of the leading families that can have decoys, projected, the best shape of each.

    Waves are left out: their phase is free, so that a decoy would be the same candidate again.
    """
    calibration = Calibration.of(base)
    residual = calibration.without(base.residual)
    best: dict[str, tuple[float, Array]] = {}
    for c, g in change:
        if is_wave(c):
            continue
        left = calibration.without(g)
        reached = gain(residual, left)
        if c.label not in best or reached > best[c.label][0]:
            best[c.label] = reached, left
    order = sorted(best.values(), key=lambda found: -found[0])
    return [g for _, g in order if lines(g, outputs) >= BROAD][:FAMILIES]


def decoy(spectrum: NDArray[np.complex128], samples: int, rng: np.random.Generator) -> Array:
    """A regressor (m, k) with the spectrum (f, n_y, k) of another and phases drawn anew; its mean stays."""
    turn = np.exp(2j * np.pi * rng.random(len(spectrum)))
    turn[0] = 1.0
    if samples % 2 == 0:
        turn[-1] = rng.choice([-1.0, 1.0])
    made: Array = np.fft.irfft(spectrum * turn[:, None, None], samples, axis=0)
    return made.reshape(-1, spectrum.shape[2])


def lines(g: Array, outputs: int) -> float:
    """How many lines a spectrum of columns (m, k) has in effect: the participation ratio of its power."""
    power = np.sum(np.abs(np.fft.rfft(g.reshape(-1, outputs, g.shape[1]), axis=0)) ** 2, axis=(1, 2))
    return float(power.sum() ** 2 / (np.sum(power**2) + 1e-300))


def gain(residual: Array, g: Array) -> float:
    """Fall of the residual's (m,) sum of squares by regression on columns (m, k)."""
    gram, along = g.T @ g, g.T @ residual
    size = np.sqrt(np.diag(gram) + 1e-300)
    scaled = gram / size[:, None] / size + RIDGE * np.eye(len(size))
    return float(along / size @ np.linalg.solve(scaled, along / size))
