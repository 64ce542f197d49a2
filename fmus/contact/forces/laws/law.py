"""A creep law: forces on the wheel from creepages, declared once as CasADi expressions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import casadi as cs

from fmus.contact.forces.coefficients import Kalker
from fmus.variables import Expr

ARGUMENTS = ("a", "b", "N", "mu", "G", "c11", "c22", "c23", "c33", "xi_x", "xi_y", "xi_s", "k_A", "k_S")
SHARED = ("N", "G", "k_A", "k_S")  # what both contacts of a wheelset have in common
GIVEN = ("f11", "f22", "f23", "f33")  # creep coefficients that stand for Kalker's: N, N, N.m, N.m2
RESULTS = ("F_x", "F_y", "M_z")
BOUND_MIN = 1e-9  # N, keeps quotients finite where there is no friction


@dataclass(frozen=True)
class Creep:
    """An elliptical patch and its creepages, as scalar expressions in SI units.

    a, b: semi-axes along and across rolling; N: normal force; mu: friction coefficient; G: shear modulus;
    xi_x, xi_y, xi_s: longitudinal, lateral creepage and spin (1/m), positive where the wheel moves
    forward, left and turns left over the rail; k_A, k_S: Polach's factors for adhesion and slip.
    """

    a: Expr
    b: Expr
    N: Expr
    mu: Expr
    G: Expr
    kalker: Kalker
    xi_x: Expr
    xi_y: Expr
    xi_s: Expr
    k_A: Expr = 1.0
    k_S: Expr = 1.0

    @property
    def bound(self) -> Expr:
        """The largest force that friction transmits, N, kept above zero for use in quotients."""
        return cs.fmax(self.mu * self.N, BOUND_MIN)


class CreepLaw(ABC):
    """F_x, F_y [N] and M_z [N.m] on the wheel, opposing the creepages.

    Finite with finite derivatives everywhere, also without creep, where all three are zero.
    """

    name: ClassVar[str]
    code: ClassVar[int]  # what the parameter creep_law of an FMU selects; the codes count up from 0
    takes_given: ClassVar[bool] = False  # whether creep coefficients may be given in place of Kalker's
    title: ClassVar[str] = ""  # in the description of that parameter; its name where it has none

    @abstractmethod
    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """F_x, F_y, M_z as expressions."""

    def function(self) -> cs.Function:
        """The law as a function of scalars, ARGUMENTS -> RESULTS."""
        given = [cs.SX.sym(name) for name in ARGUMENTS]
        forces = cs.cse([cs.SX(x) for x in self.forces(creep(given))])
        return cs.Function(self.name, given, forces, ARGUMENTS, RESULTS)


def creep(given: list[Expr]) -> Creep:
    """The patch and creepages from their values in the order of ARGUMENTS."""
    named = dict(zip(ARGUMENTS, given, strict=True))
    coefficients = Kalker(*(named.pop(name) for name in Kalker._fields))
    return Creep(kalker=coefficients, **named)


def given_or_kalker(arguments: dict[str, Expr], given: list[Expr]) -> dict[str, Expr]:
    """Kalker's coefficients by name, each replaced by that which is given, GIVEN, where this is above 0."""
    G, area = arguments["G"], arguments["a"] * arguments["b"]
    size = cs.sqrt(area)
    units = (G * area, G * area, G * area * size, G * area**2)
    return {
        name: cs.if_else(f > 0, f / unit, arguments[name])
        for name, f, unit in zip(Kalker._fields, given, units, strict=True)
    }
