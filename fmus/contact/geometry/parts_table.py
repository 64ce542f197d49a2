"""Tread and flange of a wheel as two contacts: where each is nearest to the rail, and how far apart they are.

The contact table has one contact of a wheel, whose place is a mean over all places that are near. Where tread
and flange may carry at once, each is a contact of its own here. Equations: geometry/README.md.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fmus.contact.arguments import Array
from fmus.contact.cache import Arrays, remembered
from fmus.contact.geometry.nearest import WheelGrid
from fmus.contact.geometry.pair import Pair, Sides
from fmus.contact.geometry.search import FLANGE_ANGLE, QUASI_ELASTIC, Contact, Stand, averaged, stand
from fmus.contact.geometry.table import SEARCHES, curvature_sums, pair_content
from fmus.contact.normal import hertz, virtual_penetration

PARTS = ("tread", "flange")
OPEN = 5e-4  # m, gap beyond which a part is taken to be this far away: approaches are a tenth of it
NEAREST = 1e-6  # m, width of the means of the rigid search, which are the nearest place of the grid then
COLUMNS = ("gap", "r", "delta", "a_hertz", "b_hertz", "a_virtual", "b_virtual", "approach")


def parts_table(sides: Sides, shifts: Array, search: str, N: float, E: float, nu: float) -> pd.DataFrame:
    """Tread and flange of both wheels over the wheelset's lateral shifts (n,), m, as its index `y`.

    search: "rigid" or "quasi_elastic"; N, N: the normal force under which the patches are given; E, Pa, and
    nu of both bodies. The flange is where the wheel is steeper than FLANGE_ANGLE.

    Columns, per wheel and part as `gap_left_flange`: gap, m, vertical distance from the rail when the
    wheelset stands on its nearest places, at most OPEN; r, m, and delta, rad, as in contact_table; semi-axes
    by Hertz and by virtual penetration, m; approach of the bodies, m. Per wheel `barrier_left`: the largest
    distance on the way between both nearest places, m. Where it is no larger than the gap of a part, this
    part has no contact of its own: its nearest place lies at its border to the other part.
    """
    content = "parts", pair_content(sides.left), pair_content(sides.right), shifts, search, N, E, nu
    made = remembered(content, lambda: _columns(sides, shifts, SEARCHES.index(search), N, E, nu))
    return pd.DataFrame(
        {name: values for name, values in made.items() if name != "y"}, index=pd.Index(made["y"], name="y")
    )


def _columns(sides: Sides, y: Array, search: int, N: float, E: float, nu: float) -> Arrays:
    standing = stand(sides, y)
    made: Arrays = {"y": y}
    for side, (pair, sign) in sides.named.items():
        near = Near.of(pair, sign, standing, side)
        made[f"barrier_{side}"] = near.barrier
        for part in PARTS:
            contact = near.contact(part, QUASI_ELASTIC if search else NEAREST)
            values = _patch(pair, contact, N, E, nu) | {"gap": near.gaps[part]}
            made |= {f"{name}_{side}_{part}": values[name] for name in COLUMNS}
    return made


def _patch(pair: Pair, contact: Contact, N: float, E: float, nu: float) -> dict[str, Array]:
    """Radius, contact angle and patch of one contact."""
    r, delta, A, B = curvature_sums(pair, contact)
    a, b, approach, _ = (np.asarray(x) for x in hertz(A, B, N, E, nu))
    a_virtual, b_virtual = (np.asarray(x) for x in virtual_penetration(A, B, approach))
    found = {"r": r, "delta": delta, "a_hertz": a, "b_hertz": b}
    return found | {"a_virtual": a_virtual, "b_virtual": b_virtual, "approach": approach}


@dataclass(frozen=True)
class Near:
    """Distances (n, m) of the places of one wheel from its rail, m, beyond the least one, and of its parts.

    steep: which of the m places are flange; barrier: (n,) see parts_table; gaps: (n,) of each part.
    """

    grid: WheelGrid
    y: Array
    phi: Array
    distance: Array
    steep: NDArray[np.bool_]
    barrier: Array
    gaps: dict[str, Array]

    @staticmethod
    def of(pair: Pair, sign: int, standing: Stand, side: str) -> "Near":
        """The distances of one side of a wheelset that stands on its rails."""
        grid = WheelGrid.of(pair)
        y, phi = sign * standing.y, sign * standing.phi
        distance = grid.gaps(y, phi) - getattr(standing, side).gap[:, None]
        distance = np.clip(distance, 0.0, OPEN)
        steep = grid.eta < flange_begins(grid)
        outside = grid.eta < grid.tip  # the flange's other face
        distance[:, outside] = OPEN
        at = {
            part: np.argmin(np.where(steep == (part == "flange"), distance, np.inf), axis=1) for part in PARTS
        }
        row = np.arange(len(y))
        gaps = {part: distance[row, column] for part, column in at.items()}
        column = np.arange(distance.shape[1])
        between = (column >= at["flange"][:, None]) & (column <= at["tread"][:, None])
        barrier = np.max(np.where(between, distance, 0.0), axis=1)
        return Near(grid, y, phi, distance, steep, barrier, gaps)

    def contact(self, part: str, width: float) -> Contact:
        """The mean contact of a part, with weights that fall by e where the distance grows by `width`, m.

        What lies beyond the barrier belongs to the other part. The lower the barrier, the more of it belongs
        to this one: where there is none, there is one contact, in which both parts have the same mean.
        """
        beyond = np.maximum(self.distance - self.gaps[part][:, None], 0.0)
        weight = np.exp(-beyond / width) * self.belonging(part, width)
        weight[self.distance >= OPEN] = 0.0
        # a part that is nowhere near has the contact of the other one
        nowhere = weight.sum(axis=1) == 0.0
        weight[nowhere] = np.exp(-self.distance[nowhere] / width)
        return averaged(self.grid, weight, self.y, self.phi)

    def belonging(self, part: str, width: float) -> Array:
        """How far each place (n, m) belongs to a part: 1 its own, others the less, the higher the barrier.

        width: m, by which the barrier rises for e times less.
        """
        depth = self.barrier - np.maximum(self.gaps["tread"], self.gaps["flange"])
        return np.where(self.steep == (part == "flange"), 1.0, np.exp(-depth / width)[:, None])


def flange_begins(grid: WheelGrid) -> float:
    """Place on the wheel, m from the tape circle, from which on it is steeper than FLANGE_ANGLE."""
    angle = np.arctan(grid.pair.wheel.slope(grid.eta))
    steep = grid.eta[(angle > FLANGE_ANGLE) & (grid.eta < 0.0) & (grid.eta > grid.tip)]
    return float(steep.max()) if steep.size else float(grid.eta[0])
