"""Sizes of a wheel by which its wear is judged: height, thickness and slope of its flange (EN 15313)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from fmus.contact.geometry.pair import TAPE
from fmus.contact.geometry.profile import Profile

BELOW = 0.010  # m under the tape circle's level, where the thickness is measured
ABOVE_TIP = 0.002  # m over the flange's tip, to which its slope is measured
PLACES = 4000
THINNEST, FLATTEST, HIGHEST = 22e-3, 6.5e-3, 36e-3  # m, limits of EN 15313 for wheels of 840 mm and more


@dataclass(frozen=True)
class Sizes:
    """Height Sh and thickness Sd of the flange, and its slope qR, m (EN 15313)."""

    Sh: float
    Sd: float
    qR: float

    @property
    def beyond(self) -> tuple[str, ...]:
        """Which of them are beyond their limit in service."""
        holds = {"Sh": self.Sh <= HIGHEST, "Sd": self.Sd >= THINNEST, "qR": self.qR >= FLATTEST}
        return tuple(name for name, kept in holds.items() if not kept)


def sizes(wheel: Profile) -> Sizes:
    """The sizes of a profile, whose flange back is TAPE from the tape circle.

    A part that the profile does not reach counts as nan.
    """
    eta = np.linspace(wheel.begin, 0.0, PLACES)
    z = wheel.height(eta)
    tip = int(np.argmin(z))
    level = float(wheel.height(0.0))

    def place(height: float) -> float:
        """Lateral place of the flank at a height, m."""
        if not z[tip] < height < level:
            return float("nan")
        return float(brentq(lambda y: float(wheel.height(y)) - height, eta[tip], 0.0, xtol=1e-9))

    flank = place(level - BELOW)
    return Sizes(level - float(z[tip]), TAPE + flank, flank - place(float(z[tip]) + ABOVE_TIP))
