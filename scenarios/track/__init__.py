"""Track irregularities: their sources, and the inputs that they give to a vehicle."""

from scenarios.track.figures import profile_figure, spectrum_figure
from scenarios.track.inputs import inputs, riders
from scenarios.track.journey import Journey, journey
from scenarios.track.rails import QUANTITIES, Rails
from scenarios.track.reading import read_source, read_track
from scenarios.track.spectra import SPECTRA, Spectrum, spectra
from scenarios.track.track import Track

__all__ = [
    "QUANTITIES",
    "SPECTRA",
    "Journey",
    "Rails",
    "Spectrum",
    "Track",
    "inputs",
    "journey",
    "profile_figure",
    "read_source",
    "read_track",
    "riders",
    "spectra",
    "spectrum_figure",
]
