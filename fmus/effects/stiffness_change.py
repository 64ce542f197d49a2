"""A spring that has lost or gained stiffness: a broken coil, a leaking air spring, an aged bush.

In data: a residual in phase with the deflection there, and natural frequencies that have moved.
"""

from fmus.component import Component
from fmus.effects.component_effect import ComponentEffect


class StiffnessChange(ComponentEffect):
    """k (1 + change) from t0 on; half is left at change = -0.5."""

    kind = "stiffness_change"
    over = "displacement"
    source = (
        "the multiplicative parametric fault, Isermann, Fault-Diagnosis Systems (2006); of railway "
        "suspensions: Bruni et al., Vehicle System Dynamics 49 (2011), 1021-1072"
    )

    @classmethod
    def of(cls, part: Component) -> tuple[str, ...]:
        """See ComponentEffect.of."""
        return part.stiffness
