"""Synthetic irregularities from the spectrum of a standard or from the user's own spectrum."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from fmus.errors import did_you_mean
from scenarios.experiment.table import Interval, Number, Positive, Table
from scenarios.track.rails import (
    PLANES,
    Array,
    Quantity,
    Rails,
    check_direction,
    rails_of,
)
from scenarios.track.sources.source import Source
from scenarios.track.spectra import Spectra, Spectrum, spectra
from scenarios.track.statistics import KNOWN, Statistics, fit
from scenarios.track.synthesis import generator, realise
from scenarios.track.track import Track

NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Deviation = Literal["alignment", "gauge", "level", "cross_level"]
FINE = 40  # samples in the shortest wave: cubics are exact to 0.01 % of the sd, slopes to 0.5 %
COARSE = 8  # smallest number allowed, exact to 0.3 % and 5 %


class OwnSpectrum(Table):
    """The user's own: the numbers of `Spectrum`, over the axis and sides that they belong to."""

    A: Positive
    Omega_c: Positive
    Omega_r: NotNegative
    Omega_s: Positive | None = None
    per: Literal["rad/m", "1/m"] = "rad/m"
    sides: Literal[1, 2] = 1

    @model_validator(mode="after")
    def _sound(self) -> Self:
        self.spectrum()
        return self

    def spectrum(self) -> Spectrum:
        """The spectrum in SI, one-sided over rad/m."""
        return Spectrum.of(**dict(self))


class SpectrumSource(Source):
    """Waves of random phase in a band of wavelengths [m], by a named spectrum or one's own.

    `quantities` picks some of the spectrum's; `statistics` brings quantities or rails to given figures [m],
    as `like` does by the name of a line; `run_in` [m] lets the irregularities grow from nothing.
    """

    kind: ClassVar[str] = "spectrum"
    spectrum: str | None = None
    own: dict[Deviation, OwnSpectrum] = Field(default_factory=dict)
    quantities: tuple[Deviation, ...] | None = None
    length: Positive
    wavelengths: Interval
    seed: Annotated[int, Field(strict=True, ge=0)]
    step: Positive | None = None
    statistics: dict[Quantity, Statistics] = Field(default_factory=dict)
    like: str | None = None
    run_in: Number = 0.0

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.spectrum is None) == (not self.own):
            raise ValueError("needs either 'spectrum', the name of one, or [own] spectra")
        if self.like is not None and self.like not in KNOWN:
            raise ValueError(f"'like' = '{self.like}' is no known line; {did_you_mean(self.like, KNOWN)}")
        if self.like is not None and self.statistics:
            raise ValueError("'like' and 'statistics' both set the statistics; leave one of the two out")
        shortest, longest = self.wavelengths
        if shortest <= 0:
            raise ValueError(f"'wavelengths' must be greater than 0, not {list(self.wavelengths)}")
        if longest > self.length:
            raise ValueError(f"'length' {self.length:g} m is shorter than the longest wave {longest:g} m")
        if self.step is not None and self.step > shortest / COARSE:
            raise ValueError(
                f"'step' {self.step:g} m is too coarse for waves of {shortest:g} m; "
                f"take at most {shortest / COARSE:g} m"
            )
        if not 0 <= self.run_in <= self.length:
            raise ValueError(
                f"'run_in' must lie between 0 and the length {self.length:g} m, not {self.run_in:g}"
            )
        for rails, means in PLANES:
            check_direction(self.targets.keys(), rails, means)
        self._check_quantities()
        return self

    def _check_quantities(self) -> None:
        """Raise BadInput if a requested quantity has no spectrum, or statistics are for one not requested."""
        offered = self._offered()
        for name in self.quantities or ():
            if name not in offered:
                raise ValueError(f"'{name}' has no spectrum; {did_you_mean(name, offered)}")
        realised = set(self._realised())
        for rails, means in PLANES:
            for target in {*rails, *means} & self.targets.keys():
                if not realised & ({target} if target in means else {*means}):
                    raise ValueError(
                        f"'{target}' has statistics but no spectrum among the quantities realised"
                    )

    def _realised(self) -> Spectra:
        """The requested ones of the offered spectra, before any statistics."""
        wanted = self.quantities
        return {n: s for n, s in self._offered().items() if wanted is None or n in wanted}

    def _offered(self) -> Spectra:
        if self.spectrum is not None:
            return spectra(self.spectrum)
        found: dict[Quantity, Spectrum] = {}
        for name, own in self.own.items():
            found[name] = own.spectrum()
        return found

    @property
    def requested(self) -> Spectra:
        """The spectra that the track has to have.

        Where a quantity has statistics, with its variance in the band; where the rails of its direction
        have, none, for theirs are mixtures.
        """
        mixed = {mean for rails, means in PLANES if self.targets.keys() & set(rails) for mean in means}
        found: dict[Quantity, Spectrum] = {}
        for name, spectrum in self._realised().items():
            target = self.targets.get(name)
            scale = target.sd**2 / float(spectrum.variance(*self.band)) if target else 1.0
            if name not in mixed:
                found[name] = replace(spectrum, A=scale * spectrum.A)
        return MappingProxyType(found)

    @property
    def targets(self) -> Mapping[Quantity, Statistics]:
        """The statistics that the track has to have."""
        return self.statistics if self.like is None else KNOWN[self.like]

    @property
    def band(self) -> tuple[float, float]:
        """The wavelengths as angular spatial frequencies, rad/m."""
        return 2 * np.pi / self.wavelengths[1], 2 * np.pi / self.wavelengths[0]

    def track(self, folder: Path) -> Track:
        """The track from 0 to `length`; without a run-in its end joins its beginning."""
        samples = 2 * int(np.ceil(self.length / (2 * (self.step or self.wavelengths[0] / FINE))))
        waves: dict[Quantity, Array] = {
            name: realise(spectrum, self.length, samples, self.band, generator(self.seed, name))
            for name, spectrum in self._realised().items()
        }
        rails = _with_statistics(rails_of(waves, np.zeros(samples)), self.targets)
        distance = self.length * np.arange(samples + 1) / samples
        fade = _grown(distance / self.run_in) if self.run_in else np.ones(samples + 1)
        closed = {name: fade * np.append(x := getattr(rails, name), x[0]) for name in _RAILS}
        return Track.from_samples(distance, closed)


_RAILS: tuple[Quantity, ...] = tuple(name for rails, _ in PLANES for name in rails)


def _grown(x: Array) -> Array:
    """From 0 at x = 0 to 1 at x = 1, smooth to the second derivative."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def _with_statistics(rails: Rails, targets: Mapping[Quantity, Statistics]) -> Rails:
    """The rails with each of the quantities brought to its statistics."""
    given: dict[Quantity, Array] = {}
    for pair, means in PLANES:
        names = pair if targets.keys() & set(pair) else means
        for name in names:
            x: Array = getattr(rails, name)
            given[name] = fit(x, targets[name]) if name in targets else x
    return rails_of(given, rails.y_left)
