"""Polach's law where spin is left out: as with spin, at xi_s = 0 (thesis eq. 3.65 to 3.68, 3.83)."""

from dataclasses import replace

from fmus.contact.forces.laws.law import Creep, CreepLaw
from fmus.contact.forces.laws.polach import Polach
from fmus.variables import Expr


class PolachNoSpin(CreepLaw):
    """Force along the creepage, whatever the spin; moment of the lateral creepage alone."""

    name = "polach_no_spin"
    code = 3
    title = "Polach without spin"

    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """See CreepLaw.forces."""
        return Polach().forces(replace(c, xi_s=0.0))
