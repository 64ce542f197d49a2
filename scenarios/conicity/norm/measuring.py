"""Points as an instrument would measure them on a reference profile, and their reading."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from estimator.record import Array
from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.measured import load_profile
from fmus.contact.geometry.profile import Kind, Profile
from fmus.errors import BadInput

Reader: TypeAlias = Callable[[Path, Kind], Profile]
Error: TypeAlias = Literal["random", "grid"]
ERRORS: tuple[Error, ...] = ("random", "grid")
FINE = 200_000  # places along a profile by which its length is measured
LEAST, MOST = 1e-9, 2e-3  # m, of errors and distances; greater numbers are mm
STEEP = 12.0  # slope beyond which the ends of a profile are not measured, 85 degrees


def reader_of(given: str | None, smoothing: float | None) -> Reader:
    """The reader FILE.py:FUNCTION of a path and "wheel" or "rail"; by default that of point files."""
    if given is None:
        return partial(_own, smoothing=smoothing)
    file, _, name = given.rpartition(":")
    spec = spec_from_file_location("reader_of_points", file) if file.endswith(".py") else None
    if spec is None or spec.loader is None or not Path(file).is_file():
        raise BadInput(f"--reader {given}: give FILE.py:FUNCTION, a function of a path and a kind")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises
        raise BadInput(f"--reader {given}: {file} cannot be loaded ({error}); correct the file") from error
    found = getattr(module, name, None)
    if not callable(found):
        raise BadInput(f"--reader {given}: {file} has no function '{name}'")
    reader: Reader = found
    return reader


def _own(path: Path, kind: Kind, smoothing: float | None) -> Profile:
    return load_profile(path, kind, smoothing)


@dataclass
class Instrument:
    """Measures reference profiles with an error and reads them; each draw once.

    random: standard deviation across the surface, m; grid: width of the grid that both coordinates are
    rounded to, m, with its place drawn at random; spacing: m along the profile between points.
    """

    read: Reader
    random: float = 1e-5
    grid: float = 2e-5
    spacing: float = 2e-4
    seed: int = 1
    _measured: dict[tuple[str, Error, int, int], Profile] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("random", "grid", "spacing"):
            low, value = (0.0 if name == "random" else LEAST), getattr(self, name)
            if not low <= value <= MOST:
                raise BadInput(f"--{name} {value:g}: give it in m, from {low:g} to {MOST:g}")

    def profile(self, name: str, error: Error, draw: int, side: int) -> Profile:
        """The reference profile of a name as measured in a draw on the left (0) or the right (1) side."""
        key = name, error, draw, side
        if key not in self._measured:
            self._measured[key] = self._read(name, self.points(*key))
        return self._measured[key]

    def points(self, name: str, error: Error, draw: int, side: int) -> Array:
        """The points (n, 2), m, in the frame of the profile."""
        rng = np.random.default_rng([self.seed, *name.encode(), ERRORS.index(error), draw, side])
        exact = exact_profile(name)
        fine = np.linspace(exact.begin, exact.end, FINE)[1:-1]
        fine = fine[np.abs(exact.slope(fine)) < STEEP]
        z = exact.height(fine)
        along = np.append(0.0, np.cumsum(np.hypot(np.diff(fine), np.diff(z))))
        y = np.interp(np.arange(rng.uniform(0, self.spacing), along[-1], self.spacing), along, fine)
        points = np.column_stack([y, exact.height(y)])
        if error == "random":
            angle, off = np.arctan(exact.slope(y)), self.random * rng.standard_normal(len(y))
            return points + np.column_stack([-np.sin(angle) * off, np.cos(angle) * off])
        place = rng.uniform(0, self.grid, 2)
        return np.asarray(np.round((points - place) / self.grid) * self.grid + place)

    def _read(self, name: str, points: Array) -> Profile:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{name}.txt"
            np.savetxt(file, points * 1e3, fmt="%.7f")
            found = self.read(file, exact_profile(name).kind)
        if not isinstance(found, Profile):
            raise BadInput(f"--reader: gave a {type(found).__name__} for {name}; return a Profile")
        return found
