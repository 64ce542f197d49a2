"""What a measured course looks like, a wheel or a rail, and which of its sides is which."""

from dataclasses import dataclass

import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.geometry.points import Points
from fmus.contact.geometry.profile import Kind
from fmus.errors import BadInput

STEP = 5e-4  # m, along the course, at which its shape is looked at
CHORD = 4  # steps over which its inclination is taken
FLAT = 0.3  # rad, steepest inclination of tread and crown
WHEEL_FLAT, RAIL_FLAT = (0.030, 0.150), (0.020, 0.068)  # m, width of tread and crown
FLANGE = 0.015, 0.050  # m, height of a flange
LEVEL = 0.012  # m, most that a wheel rises on the field side of its tread
SIDE = 0.002  # m, least fall of a rail's sides beyond its crown
HOOK = 0.003  # m, a flange comes back by more behind its tip
TIP = -0.070, -0.040  # m, where a flange's tip is when y = 0 is the tape circle
BACK = -0.070  # m, where its back is then (EN 13715)
DEEPER = 0.003, 0.001  # m, by how much one side of a rail is deeper, or wider, than the other


@dataclass(frozen=True)
class Oriented:
    """Points in the frame of profile.py but for the zero of z, and what was done to them."""

    y: Array
    z: Array
    found: list[str]


@dataclass(frozen=True)
class _Ends:
    """A course with y rising: width of its flat part, and the excursion of z beyond each end of it, m."""

    flat: float
    left: float
    right: float
    hook: bool


def oriented(points: Points, kind: Kind) -> Oriented:
    """The points with y to the field side and z up, as the shape of a wheel or a rail tells.

    BadInput where the course is not of the kind it is given as.
    """
    order = slice(None) if points.y[-1] > points.y[0] else slice(None, None, -1)
    y, z = points.y[order], points.z[order]
    ends = _ends(y, z)
    fits = {"wheel": _like_wheel(ends), "rail": _like_rail(ends)}
    if not fits[kind]:
        raise BadInput(_refusal(points.file, kind, fits, ends))
    found = []
    if max(ends.left, ends.right, key=abs) > 0:
        z, found = -z, ["z of the file points down"]
    y, z, turned = (_wheel_sides if kind == "wheel" else _rail_sides)(y, z, ends)
    if turned:
        found.append(
            "y of the file points to the flange" if kind == "wheel" else "y of the file points inwards"
        )
    if kind == "wheel":
        y, moved = _to_tape(points, y, z)
        found += moved
    return Oriented(y, z, found)


def _ends(y: Array, z: Array) -> _Ends:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    even = np.arange(0.0, along[-1], STEP)
    y, z = np.interp(even, along, y), np.interp(even, along, z)
    angle = np.arctan2(z[CHORD:] - z[:-CHORD], y[CHORD:] - y[:-CHORD])
    flat = np.abs(angle) < FLAT
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flat, [False]]).astype(int)))
    begins, stops = edges[::2], edges[1::2] + CHORD - 1
    if not begins.size:
        return _Ends(0.0, 0.0, 0.0, False)
    widest = int(np.argmax(y[stops] - y[begins]))
    begin, stop = int(begins[widest]), int(stops[widest])
    left, right = z[: begin + 1][::-1] - z[begin], z[stop:] - z[stop]
    far = [side[np.argmax(np.abs(side))] for side in (left, right)]
    higher = max((left, right), key=lambda side: float(np.abs(side).max()))
    hook = bool(np.abs(higher).max() - np.abs(higher[-1]) > HOOK)
    return _Ends(float(y[stop] - y[begin]), float(far[0]), float(far[1]), hook)


def _like_wheel(ends: _Ends) -> bool:
    small, large = sorted((ends.left, ends.right), key=abs)
    level = abs(small) < SIDE or (abs(small) < LEVEL and small * large < 0)
    return WHEEL_FLAT[0] <= ends.flat <= WHEEL_FLAT[1] and FLANGE[0] <= abs(large) <= FLANGE[1] and level


def _like_rail(ends: _Ends) -> bool:
    both = ends.left * ends.right > 0 and min(abs(ends.left), abs(ends.right)) >= SIDE
    return RAIL_FLAT[0] <= ends.flat <= RAIL_FLAT[1] and both and not ends.hook


def _refusal(file: str, kind: Kind, fits: dict[str, bool], ends: _Ends) -> str:
    other = "rail" if kind == "wheel" else "wheel"
    if fits[other]:
        return f"{file}: looks like a {other} but is given as a {kind}; give it as the {other}"
    needs = {
        "wheel": "a tread with a flange of 15 to 50 mm at one side",
        "rail": "a crown of 20 to 68 mm with sides that fall",
    }[kind]
    seen = (
        f"flat over {ends.flat * 1e3:.0f} mm, ends at {ends.left * 1e3:+.0f} and {ends.right * 1e3:+.0f} mm"
    )
    return f"{file}: is no {kind} profile ({seen}); a {kind} shows {needs}, y and z in mm"


def _wheel_sides(y: Array, z: Array, ends: _Ends) -> tuple[Array, Array, bool]:
    turned = abs(ends.right) > abs(ends.left)
    return (-y[::-1], z[::-1], True) if turned else (y, z, False)


def _rail_sides(y: Array, z: Array, ends: _Ends) -> tuple[Array, Array, bool]:
    """The gauge side is measured deeper; else, on a canted rail, it is farther from the crown."""
    crown = int(np.argmax(z))
    depth = z[crown] - np.array([z[0], z[-1]])
    common = float(z[crown] - depth.min())
    reach_left = y[crown] - float(np.interp(common, z[: crown + 1], y[: crown + 1]))
    reach_right = float(np.interp(common, z[crown:][::-1], y[crown:][::-1])) - y[crown]
    turned = depth[1] - depth[0] > DEEPER[0]
    if abs(depth[1] - depth[0]) <= DEEPER[0]:
        turned = reach_right - reach_left > DEEPER[1]
    return (-y[::-1], z[::-1], True) if turned else (y, z, False)


def _to_tape(points: Points, y: Array, z: Array) -> tuple[Array, list[str]]:
    """y from the tape circle: as it is where the flange is in its place, else from the measured back."""
    tip = float(y[np.argmin(z)])
    if TIP[0] <= tip <= TIP[1]:
        return y, []
    steep = abs(z[1] - z[0]) > 2 * abs(y[1] - y[0])
    if z[0] - z.min() > HOOK and steep:
        shift = BACK - float(y[0])
        return y + shift, [
            f"y moved by {shift * 1e3:.2f} mm to set the flange back 70 mm from the tape circle"
        ]
    raise BadInput(
        f"{points.file}: the flange's tip is at y = {tip * 1e3:.1f} mm; shift y so that 0 is the tape "
        "circle, 70 mm from the flange back"
    )
