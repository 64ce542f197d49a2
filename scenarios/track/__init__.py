"""Track irregularities: their sources, and the inputs that they give to a vehicle."""

from typing import TYPE_CHECKING, Any

from scenarios.track.inputs import inputs, riders
from scenarios.track.journey import Journey, journey
from scenarios.track.rails import QUANTITIES, Rails
from scenarios.track.reading import read_source, read_track
from scenarios.track.spectra import SPECTRA, Spectrum, spectra
from scenarios.track.track import Track

if TYPE_CHECKING:
    from scenarios.track.figures import profile_figure, spectrum_figure

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


def __getattr__(name: str) -> Any:
    """The figures, loaded when first asked for, since a simulation does without Matplotlib."""
    if name not in ("profile_figure", "spectrum_figure"):
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    from scenarios.track import figures

    return getattr(figures, name)
