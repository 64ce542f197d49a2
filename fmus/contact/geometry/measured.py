"""Profiles by name or path: the exact ones, and measured ones from point files, made smooth."""

import math
from pathlib import Path

import numpy as np
from scipy.interpolate import BPoly, PPoly

from fmus.contact.arguments import Array
from fmus.contact.cache import Arrays, remembered
from fmus.contact.geometry.course import running_part
from fmus.contact.geometry.exact import exact_names, exact_profile
from fmus.contact.geometry.points import Points, read_points
from fmus.contact.geometry.profile import Kind, Profile, Spline
from fmus.contact.geometry.shape import oriented
from fmus.contact.geometry.smoothing import Curve, smooth_curve
from fmus.errors import BadInput, did_you_mean

NODES = 2.5e-4  # m along the curve between the nodes of the profile's spline
UPRIGHT = math.cos(math.radians(86))  # least dy/du of what is kept, a wall that is nearly upright ends it
LEANS = 0.012  # slope of a head that must have been measured as it is canted; 1:40 is 0.025
LARGEST_NOISE = 1e-3  # m; more is no noise


def load_profile(given: str | Path | Profile, kind: Kind, smoothing: float | None = None) -> Profile:
    """A wheel or a rail: a profile as it is, an exact one by its name, a measured one by its path.

    smoothing: rms distance, m, that counts as noise in a point file; by default it is found from the data.
    BadInput tells what is wrong with the name or the file.
    """
    if isinstance(given, Profile):
        return given
    if str(given) in exact_names():
        return exact_profile(str(given))
    if not Path(given).is_file():
        known = did_you_mean(str(given), exact_names())
        raise BadInput(f"{kind} = '{given}' is neither a file nor an exact profile; {known}")
    return measured_profile(given, kind, smoothing)


def measured_profile(path: str | Path, kind: Kind, smoothing: float | None = None) -> Profile:
    """The profile in a point file (see points.py), oriented by its shape and smooth (see smoothing.py).

    `found` tells what was turned round and how far the points lie from the smooth curve.
    """
    if smoothing is not None and not 0 < smoothing < LARGEST_NOISE:
        raise BadInput(f"smoothing = {smoothing:g} must be above 0 and below {LARGEST_NOISE:g} m")
    points = read_points(path, kind)
    content = "profile", points.y, points.z, kind, smoothing
    made = remembered(content, lambda: _made(points, kind, smoothing))
    spline = Spline(
        float(made["knots"][0]), float(made["knots"][-1]), _tuple(made["knots"]),
        tuple(_tuple(piece) for piece in made["pieces"]),
    )  # fmt: skip
    return Profile(Path(path).stem, kind, (spline,), str(made["found"]))


def _tuple(values: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _made(points: Points, kind: Kind, smoothing: float | None) -> Arrays:
    """Knots (n + 1,) and pieces (n, 6) of the profile's spline, and what was found."""
    running = running_part(points)
    turned = oriented(running, kind)
    curve = smooth_curve(turned.y, turned.z, smoothing)
    spline = _over_y(curve, points.file)
    heights = spline(np.linspace(spline.x[0], spline.x[-1], 10000))
    if kind == "wheel" and not spline.x[0] < 0 < spline.x[-1]:
        raise BadInput(f"{points.file}: does not reach the tape circle, y = 0; measure the tread too")
    spline.c[-1] -= float(spline(0.0)) if kind == "wheel" else heights.max()
    how = "stated" if smoothing is not None else "by generalised cross validation"
    found = [
        *turned.found,
        f"{len(running.y)} of {len(points.y)} points used",
        *(_leaning(spline) if kind == "rail" else []),
        f"smoothed to {curve.rms * 1e6:.2g} um rms, {how}, {curve.parameters:.0f} parameters",
    ]
    return {"knots": spline.x, "pieces": spline.c.T, "found": np.array("; ".join(found))}


def _leaning(spline: PPoly) -> list[str]:
    """What to say of a rail whose head leans: its slope in the middle between places of one height."""
    y = np.linspace(spline.x[0], spline.x[-1], 10000)
    z = spline(y)
    high = y[z > max(z[0], z[-1], z.max() - 0.012)]
    lean = float(spline((high[0] + high[-1]) / 2, 1))
    if abs(lean) < LEANS:
        return []
    way = "inwards" if lean > 0 else "outwards"
    return [f"the head leans {way} by about 1:{1 / abs(lean):.0f}, so give cant = 0"]


def _over_y(curve: Curve, file: str) -> PPoly:
    """The curve's height over y as a quintic spline with continuous curvature, up to its upright walls."""
    u = np.linspace(0, curve.length, int(np.ceil(curve.length / NODES)) + 1)
    (y, z), (y1, z1), (y2, z2) = (curve.spline(u, order).T for order in range(3))
    seen = _longest(y1 > UPRIGHT * np.hypot(y1, z1))
    y, z, y1, z1, y2, z2 = (x[seen] for x in (y, z, y1, z1, y2, z2))
    if len(y) < 2 or not (np.diff(y) > 0).all():
        raise BadInput(
            f"{file}: is too rough to be a profile; state its noise by `smoothing`, or measure again"
        )
    slope, bend = z1 / y1, (y1 * z2 - z1 * y2) / y1**3
    return PPoly.from_bernstein_basis(BPoly.from_derivatives(y, np.column_stack([z, slope, bend])))


def _longest(holds: Array) -> slice:
    """The longest run of places where it holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    begins, stops = edges[::2], edges[1::2]
    if not begins.size:
        return slice(0, 0)
    longest = int(np.argmax(stops - begins))
    return slice(int(begins[longest]), int(stops[longest]))
