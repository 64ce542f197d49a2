"""A damper that has lost or gained damping: worn valves, lost oil, cold oil.

In data: a residual in phase with the rate of deflection there, resonances that are higher or lower.
"""

from fmus.component import Component
from fmus.effects.component_effect import ComponentEffect


class DampingChange(ComponentEffect):
    """b (1 + change) from t0 on; half is left at change = -0.5."""

    kind = "damping_change"
    over = "velocity"
    source = (
        "the multiplicative parametric fault, Isermann, Fault-Diagnosis Systems (2006); of railway "
        "suspensions: Bruni et al., Vehicle System Dynamics 49 (2011), 1021-1072"
    )

    @classmethod
    def of(cls, part: Component) -> tuple[str, ...]:
        """See ComponentEffect.of."""
        return part.damping
