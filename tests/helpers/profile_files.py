"""Point files of profiles as an instrument would write them, and profiles of simple shapes."""

from pathlib import Path

import numpy as np

from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.profile import Arc, Polynomial, Profile


def points_of(name, n, rng, noise=0.0, begin=None, end=None):
    """Unevenly spaced points (n, 2), m, along an exact profile, with noise square to the surface, m."""
    profile = exact_profile(name)
    fine = np.linspace(profile.begin + 2e-6 if begin is None else begin, end or profile.end, 200_001)
    along = np.append(0, np.cumsum(np.hypot(np.diff(fine), np.diff(profile.height(fine)))))
    y = np.interp(np.sort(rng.uniform(0, along[-1], n)), along, fine)
    angle, off = np.arctan(profile.slope(y)), noise * rng.standard_normal(n)
    return np.column_stack([y - np.sin(angle) * off, profile.height(y) + np.cos(angle) * off])


def write_points(file: Path, points, separator=" ", header="") -> Path:
    """The points (n, 2), m, in mm in a file."""
    rows = [separator.join(f"{value * 1e3:.6f}" for value in row) for row in points]
    file.write_text(header + "\n".join(rows) + "\n")
    return file


def cone(conicity, half_width=0.06):
    """A wheel whose radius falls to the field side by the conicity."""
    return Profile("cone", "wheel", (Polynomial(-half_width, half_width, (0.0, conicity)),))


def round_rail(radius, side=0.030):
    """A rail whose crown is a circle of that radius, m, with steep lines to 30 mm below at both sides."""
    low = radius - np.sqrt(radius**2 - side**2)
    line = Polynomial(side, side + 0.0015, (20 * side - low, -20.0))
    mirror = Polynomial(-side - 0.0015, -side, (20 * side - low, 20.0))
    return Profile(f"R{radius:g}", "rail", (mirror, Arc(-side, side, 0.0, -radius, radius, 1), line))


def round_wheel(radius, half_width=0.06):
    """A wheel whose tread is hollow by a circle of that radius, m, or bulges where it is negative."""
    bulge = -1 if radius < 0 else 1
    return Profile(
        "round", "wheel", (Arc(-half_width, half_width, 0.0, -bulge * abs(radius), abs(radius), bulge),)
    )
