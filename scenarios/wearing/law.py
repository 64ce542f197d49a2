"""How much of a wheel wears away, by the energy that its contacts dissipate (Braghin et al. 2006).

F. Braghin, R. Lewis, R. S. Dwyer-Joyce, S. Bruni, A mathematical model to predict railway wheel profile
evolution due to wear, Wear 261 (2006), 1253-1264; of R8T wheel steel on 900A rail, from a twin-disc rig.
"""

import numpy as np
from numpy.typing import ArrayLike

from fmus.contact.arguments import Array

STEEL = 7850.0  # kg/m3
MILD, SEVERE, CATASTROPHIC = 5.3, 55.12, 61.9  # ug/(m mm2) per N/mm2, ug/(m mm2), ug/(m mm2) per N/mm2
BEGINS = (10.4, 77.2)  # N/mm2, of severe and of catastrophic wear
PER_METRE = 1e-9 * 1e6  # kg/(m m2) of ug/(m mm2)
SQUARE_MM = 1e-6  # m2


def wear_rate(index: ArrayLike) -> Array:
    """Mass that a contact loses by the way and its area, kg/(m m2).

    index: T gamma over the area of the contact, N/mm2, at least 0; any shape.
    """
    x = np.asarray(index, dtype=float)
    beyond = SEVERE + CATASTROPHIC * (x - BEGINS[1])
    found = np.where(x < BEGINS[0], MILD * x, np.where(x <= BEGINS[1], SEVERE, beyond))
    return np.asarray(found * PER_METRE)


def section_loss(T_gamma: Array, area: Array, radius: float) -> Array:
    """Area of the wheel's cross-section that is lost by the way, m2/m, in each contact (n,).

    T_gamma: N; area: of the contact, m2; radius: of the wheel, m, over whose circumference the loss spreads.
    """
    mass = wear_rate(T_gamma / (area / SQUARE_MM)) * area
    return np.asarray(mass / (STEEL * 2 * np.pi * radius))
