"""Conditions of the rail's surface by name: the friction law and Polach's factors on each of them.

Source: Table 4.1 of the thesis; B in s/m, the others without unit.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, get_args

Condition = Literal["dry", "wet", "low", "very_low"]
PARAMETERS = ("mu0", "A", "B", "k_A", "k_S")  # see friction_coefficient and laws.polach.creep_force

CONDITIONS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        name: MappingProxyType(dict(zip(PARAMETERS, row, strict=True)))
        for name, row in zip(
            get_args(Condition),
            (
                (0.5, 0.4, 0.6, 1.0, 0.4),
                (0.2, 0.4, 0.2, 1.0, 0.4),
                (0.08, 0.4, 0.2, 0.6, 0.2),
                (0.04, 0.4, 0.1, 0.3, 0.1),
            ),
            strict=True,
        )
    }
)
