"""Where on its profile a wheel touches at each shift, and how the loss spreads over these places."""

from dataclasses import dataclass

import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.geometry.parts_table import PARTS, Near
from fmus.contact.geometry.search import QUASI_ELASTIC, stand
from fmus.contact.geometry.table import curvature_sums
from fmus.contact.normal import LINDER, hertz
from fmus.wheelset.curves import LOAD, NU, E
from fmus.wheelset.track import Track

SPACING = 5e-5  # m between the shifts for which footprints are made
UPRIGHT = 0.05  # least cosine of a slope; walls that are steeper never touch


@dataclass(frozen=True)
class Footprint:
    """Contacts of one wheel over its shifts (n,) towards its flange, m.

    eta: places (m,) on the profile from the tape circle, m; along: (m,) length of the profile about each, m;
    area: (n,) of each part's contact under LOAD, m2; share: (n, m) of each part, by which a loss of section,
    m2, becomes a depth normal to the profile, m.
    """

    shifts: Array
    eta: Array
    along: Array
    area: dict[str, Array]
    share: dict[str, Array]

    @property
    def reach(self) -> float:
        """The largest shift that is known, m."""
        return float(self.shifts[-1])

    def under(self, load: float) -> float:
        """By how much a contact is larger under a wheel load, N, than under LOAD."""
        return float((max(load, 0.0) / LOAD) ** (2 / 3))

    def depth(self, part: str, shifts: Array, loss: Array) -> Array:
        """Depth (m,) that losses of section (k,), m2, at shifts (k,), m, leave on the profile, m."""
        place = (np.clip(shifts, self.shifts[0], self.shifts[-1]) - self.shifts[0]) / SPACING
        low = np.minimum(place.astype(int), len(self.shifts) - 2)
        over, n = place - low, len(self.shifts)
        held = np.bincount(low, loss * (1 - over), n) + np.bincount(low + 1, loss * over, n)
        return np.asarray(held @ self.share[part])


def footprints(track: Track, reach: float) -> dict[str, Footprint]:
    """Footprints of the left and the right wheel at shifts up to `reach`, m, to either side."""
    sides = track.sides
    steps = int(np.ceil(reach / SPACING))
    y: Array = np.asarray(SPACING * np.arange(-steps, steps + 1), dtype=np.float64)
    standing = stand(sides, y)
    found = {}
    for side, (pair, sign) in sides.named.items():
        near = Near.of(pair, sign, standing, side)
        across = np.maximum(np.cos(np.arctan(pair.wheel.slope(near.grid.eta))), UPRIGHT)
        along = near.grid.width / across  # of the cells on the profile
        area, share = {}, {}
        for part in PARTS:
            _, delta, A, B = curvature_sums(pair, near.contact(part, QUASI_ELASTIC))
            a, b, approach, _ = (np.asarray(x) for x in hertz(A, B, LOAD, E, NU))
            penetration = LINDER * approach / np.cos(delta + sign * standing.phi)
            # where the bodies penetrate, the loss is as deep as they do, as pressure times length is
            deep = near.belonging(part, QUASI_ELASTIC) * np.maximum(
                penetration[:, None] - np.maximum(near.distance - near.gaps[part][:, None], 0.0), 0.0
            )
            deep *= across  # the penetration normal to the profile
            total = deep @ along
            share[part] = np.divide(deep, total[:, None], out=np.zeros_like(deep), where=total[:, None] > 0)[
                ::sign
            ]
            area[part] = (np.pi * a * b)[::sign]
        found[side] = Footprint(y, near.grid.eta, along, area, share)
    return found
