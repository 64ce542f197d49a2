"""What a force law has of its own: the part of its force along a motion that no plain law can make."""

from collections.abc import Mapping

from estimator.closeloop.screening.missing_force import MissingForce
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw, unexplained


def of_its_own(law: type[ForceLaw], values: Mapping[str, float], missing: MissingForce) -> float:
    """Share of the squares of a law's force that a constant and plain laws over its motion cannot make.

    values: parameters of the law by name; missing: the motion at its port. Plain laws have no shape, such as
    viscous and quadratic damping. The share is 0 for a law without a force.
    """
    motion = missing.t, missing.displacement, missing.velocity
    force = law.along(values, *motion)
    plain = [x.along(dict.fromkeys(x.amplitudes, 1.0), *motion) for x in plain_laws(law.over)]
    return unexplained(force, plain) / (float(force @ force) + 1e-300)


def plain_laws(over: str) -> list[type[ForceLaw]]:
    """The laws over a motion, velocity or displacement, whose parameters are all amplitudes."""
    laws = (e for e in EFFECTS.values() if issubclass(e, ForceLaw) and e.over == over)
    return [e for e in laws if len(e.parameters("translation")) == len(e.amplitudes)]
