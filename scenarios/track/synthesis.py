"""Irregularities from a spectrum: waves of random phase (Shinozuka & Deodatis, Appl. Mech. Rev. 44, 1991)."""

import numpy as np

from scenarios.track.rails import Array
from scenarios.track.spectra import Spectrum


def generator(seed: int, name: str) -> np.random.Generator:
    """Random numbers of a seed for one name, the same whatever other names draw."""
    return np.random.default_rng([seed, *name.encode()])


def realise(
    spectrum: Spectrum, length: float, samples: int, band: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Samples (n,) m, evenly spaced over a length [m] that closes on itself, of a band [rad/m].

    The waves are the harmonics of the length. Each carries the variance that the spectrum has in its cell of
    the band, so the variance of the samples is that of the band in closed form; only the phases are random.
    They are drawn wave by wave: the same seed on a finer spacing gives the same irregularities.
    """
    width = 2 * np.pi / length
    k = np.arange(1, samples // 2)
    low, high = np.clip((k - 0.5) * width, *band), np.clip((k + 0.5) * width, *band)
    used = high > low
    waves = np.zeros(samples // 2 + 1, dtype=np.complex128)
    phases = rng.uniform(0, 2 * np.pi, int(used.sum()))
    amplitudes = np.sqrt(2 * spectrum.variance(low[used], high[used]))
    waves[k[used]] = amplitudes * np.exp(1j * phases) * samples / 2
    return np.asarray(np.fft.irfft(waves, samples), dtype=np.float64)
