"""A wheel that wears: points of its profile, which move into the metal, and the file that holds them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.geometry.profile import Profile
from fmus.files import write_at_once

APART = 2e-4  # m between the points along the profile
FINE = 1e-5  # m of the lateral grid by which these are laid
UPRIGHT = 20.0  # slope beyond which a wall is no part of what is kept
MILLI = 1e3


@dataclass(frozen=True)
class WornWheel:
    """Points (n,) of a profile, m, in the frame of the new wheel, and the new radius at its tape circle, m.

    worn: (n,) depth that each point has lost, m.
    """

    y: Array
    z: Array
    worn: Array
    r0: float

    @staticmethod
    def of(profile: Profile, r0: float) -> "WornWheel":
        """The points of a new wheel."""
        grid = np.arange(profile.begin, profile.end, FINE)
        slope = np.abs(profile.slope(grid))
        kept = grid[np.isfinite(slope) & (slope < UPRIGHT)]
        z = profile.height(kept)
        along = _way(kept, z)
        y = np.interp(np.arange(0.0, along[-1], APART), along, kept)
        return WornWheel(y, profile.height(y), np.zeros_like(y), r0)

    def after(self, eta: Array, depth: Array) -> "WornWheel":
        """The wheel that has lost a depth (m,), m, normal to its profile at places eta (m,), m."""
        lost = np.interp(self.y, eta, depth)
        slope = np.gradient(self.z, self.y)
        steep = np.hypot(1.0, slope)
        moved = self.y - lost * slope / steep, self.z + lost / steep
        return WornWheel(*moved, self.worn + lost, self.r0)

    @property
    def lowered(self) -> float:
        """How much lower the tape circle lies than that of the new wheel, m."""
        return float(np.interp(0.0, self.y, self.z))

    @property
    def radius(self) -> float:
        """Radius at the tape circle, m."""
        return self.r0 - self.lowered

    @property
    def section(self) -> float:
        """Area of the cross-section that is lost, m2."""
        return float(np.trapezoid(self.worn, _way(self.y, self.z)))

    def write(self, file: Path, about: str) -> Path:
        """Write a point file in mm; about: a line that says what it is."""
        rows = [f"{y:.6f} {z:.6f}" for y, z in zip(MILLI * self.y, MILLI * self.z, strict=True)]
        write_at_once(file, "\n".join([f"# {about}", "# y z [mm]", *rows, ""]).encode())
        return file


def _way(y: Array, z: Array) -> Array:
    """Length of the profile from its first point to each (n,), m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
