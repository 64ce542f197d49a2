"""Wheel-rail contact: geometry, patch, creep coefficients and creep laws; equations in README.md.

What is public is imported when it is first asked for: a model that takes a creep law needs no tables.
"""

from importlib import import_module
from typing import Any

PUBLIC = {  # name: module
    "contact_table": "geometry.table",
    "creep_forces": "forces.creep",
    "equivalent_conicity": "geometry.conicity",
    "harmonic_conicity": "geometry.conicity",
    "hertz": "normal",
    "kalker": "forces.coefficients",
    "klingel_wavelength": "geometry.conicity",
    "linear_conicity": "geometry.conicity",
    "nonlinearity_parameter": "geometry.conicity",
    "virtual_penetration": "normal",
}


def __getattr__(name: str) -> Any:
    if name not in PUBLIC:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{PUBLIC[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})
