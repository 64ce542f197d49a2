"""Power spectral densities of track irregularities, as the standards define them, in SI.

All are one-sided densities over the angular spatial frequency Omega = 2 pi/wavelength, m2/(rad/m).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fmus.errors import BadInput, did_you_mean
from scenarios.track.rails import Array, Quantity

Spectra: TypeAlias = "Mapping[Quantity, Spectrum]"


@dataclass(frozen=True)
class Spectrum:
    """S = A Oc²/((O² + Or²)(O² + Oc²)), times O²/(O² + Os²) where Omega_s is given.

    A: m.rad, Omega_*: rad/m, all different; Omega_r may be 0.
    """

    A: float
    Omega_c: float
    Omega_r: float
    Omega_s: float | None = None

    def __post_init__(self) -> None:
        corners = [c for c in (self.Omega_c, self.Omega_r, self.Omega_s) if c is not None]
        if not (np.isfinite([self.A, *corners]).all() and self.A > 0 and self.Omega_c > 0):
            raise BadInput("a spectrum needs a finite A > 0 and Omega_c > 0")
        if min(corners) < 0 or len(set(corners)) < len(corners):
            raise BadInput("a spectrum needs Omega_c, Omega_r and Omega_s that differ and are not negative")

    @classmethod
    def of(
        cls, A: float, Omega_c: float, Omega_r: float, Omega_s: float | None = None,
        per: Literal["rad/m", "1/m"] = "rad/m", sides: Literal[1, 2] = 1,
    ) -> "Spectrum":  # fmt: skip
        """A spectrum of the same form given over another axis.

        per "1/m": A [m] and the corners [1/m] belong to a density over cycles per metre, m2/(1/m). sides 2:
        the density is meant over negative frequencies too, so that half of the variance stands at either.
        """
        turn = 1.0 if per == "rad/m" else 2 * np.pi
        s = None if Omega_s is None else turn * Omega_s
        # S(O) dO = S(n) dn with O = 2 pi n leaves one factor 2 pi in A
        return cls(sides * turn * A, turn * Omega_c, turn * Omega_r, s)

    def density(self, Omega: ArrayLike) -> Array:
        """One-sided density [m2/(rad/m)] at angular spatial frequencies [rad/m], > 0, of any shape."""
        w2 = np.square(np.asarray(Omega, dtype=np.float64))
        S = self.A * self.Omega_c**2 / ((w2 + self.Omega_r**2) * (w2 + self.Omega_c**2))
        return S if self.Omega_s is None else S * w2 / (w2 + self.Omega_s**2)

    def density_per_cycle(self, n: ArrayLike) -> Array:
        """One-sided density [m2/(1/m)] at spatial frequencies [1/m], > 0, of any shape."""
        return 2 * np.pi * self.density(2 * np.pi * np.asarray(n, dtype=np.float64))

    def variance(self, low: ArrayLike, high: ArrayLike) -> Array:
        """Variance [m2] of the band from `low` to `high` [rad/m], 0 < low <= high, in closed form.

        By partial fractions in Omega²: each pole p contributes atan(Omega/p)/p, and -1/Omega for p = 0.
        """
        poles = [p for p in (self.Omega_r, self.Omega_c, self.Omega_s) if p is not None]
        total = np.zeros(np.broadcast_shapes(np.shape(low), np.shape(high)))
        for p in poles:
            others = np.prod([q**2 - p**2 for q in poles if q != p])
            residue = (1.0 if self.Omega_s is None else -(p**2)) / others
            total += residue * (_primitive(p, high) - _primitive(p, low))
        return self.A * self.Omega_c**2 * total


def _primitive(p: float, Omega: ArrayLike) -> Array:
    """Integral of 1/(Omega² + p²)."""
    w = np.asarray(Omega, dtype=np.float64)
    return -1 / w if p == 0 else np.arctan(w / p) / p


# Claus & Schiehlen, Modeling and simulation of railway bogie structural vibrations, Vehicle System Dynamics
# 29 (1998) Suppl., after ORE/ERRI B176; Omega in rad/m, A in m.rad
ERRI_CORNERS = MappingProxyType({"Omega_c": 0.8246, "Omega_r": 0.0206})
ERRI_OMEGA_S = 0.4380
ERRI = MappingProxyType(
    {"low": (2.119e-7, 4.032e-7, 5.32e-8), "high": (6.125e-7, 1.08e-6, 1.032e-7)}
)  # a, v, g

# FRA classes 1 to 6, k = 0.25. A_v: Lei & Noda, J. Sound Vib. 258 (2002), and TTB-2D, SoftwareX 2022; A_a and
# Omega_s: as printed with them throughout the literature, not checked against Hamid & Yang 1981
FRA_K = 0.25
FRA_OMEGA_C = 0.8245  # rad/m
FRA_A_V = (1.2107e-4, 1.0181e-4, 0.6816e-4, 0.5376e-4, 0.2095e-4, 0.0339e-4)  # m2.rad/m
FRA_A_A = (3.3634e-4, 1.2107e-4, 0.4128e-4, 0.3027e-4, 0.0762e-4, 0.0339e-4)  # m2.rad/m
FRA_OMEGA_S = (0.6046, 0.9308, 0.8520, 1.1312, 0.8209, 0.4380)  # rad/m


def _erri(A_a: float, A_v: float, A_g: float) -> Spectra:
    """ERRI defines the cross level as an angle, A_v/b² with b = half the base: as a height it is 4 A_v."""
    corners = dict(ERRI_CORNERS)
    return MappingProxyType(
        {
            "alignment": Spectrum(A_a, **corners),
            "gauge": Spectrum(A_g, **corners, Omega_s=ERRI_OMEGA_S),
            "level": Spectrum(A_v, **corners),
            "cross_level": Spectrum(4 * A_v, **corners, Omega_s=ERRI_OMEGA_S),
        }
    )


def _fra(A_a: float, A_v: float, Omega_s: float) -> Spectra:
    """FRA has Omega² in place of Omega² + Omega_r², and one density for gauge and cross level."""
    across = Spectrum(4 * FRA_K * A_v, FRA_OMEGA_C, Omega_s)
    return MappingProxyType(
        {
            "alignment": Spectrum(FRA_K * A_a, FRA_OMEGA_C, 0.0),
            "gauge": across,
            "level": Spectrum(FRA_K * A_v, FRA_OMEGA_C, 0.0),
            "cross_level": across,
        }
    )


SPECTRA: Mapping[str, Spectra] = MappingProxyType(
    {f"erri_{level}": _erri(*A) for level, A in ERRI.items()}
    | {f"fra_{i}": _fra(*row) for i, row in enumerate(zip(FRA_A_A, FRA_A_V, FRA_OMEGA_S, strict=True), 1)}
)


def spectra(name: str) -> Spectra:
    """The spectra of alignment, gauge, level and cross level by name; raises BadInput if it is unknown."""
    if name not in SPECTRA:
        raise BadInput(f"spectrum '{name}' is not known; {did_you_mean(name, SPECTRA)}")
    return SPECTRA[name]
