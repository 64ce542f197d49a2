"""A force law as it was fitted at a port."""

from dataclasses import dataclass

import casadi as cs
import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw


@dataclass(frozen=True)
class Law:
    """The fitted force law at a port, and its force (n,) along the motion there."""

    candidate: Candidate
    effect: type[ForceLaw]
    values: dict[str, float]
    missing: MissingForce

    def along(self, q: Array, v: Array) -> Array:
        """Force at displacement q (n,) and velocity v (n,)."""
        x = cs.SX.sym("q"), cs.SX.sym("v")
        made = self.effect({n: cs.SX(a) for n, a in self.values.items()})
        force = cs.Function("law", x, [made.force(*x)])
        return np.array(force.map(len(q))(q[None, :], v[None, :])).ravel()

    @property
    def force(self) -> Array:
        """Force along the recorded motion."""
        return self.along(self.missing.displacement, self.missing.velocity)

    @property
    def of_displacement(self) -> bool:
        """Whether the force depends on the displacement."""
        q, v = self.missing.displacement, self.missing.velocity
        return not np.allclose(self.along(q[::-1], v), self.force, rtol=1e-6, atol=1e-12)

    @property
    def period(self) -> float | None:
        """The displacement after which a periodic law repeats itself."""
        order = self.values.get("order")
        return 2 * np.pi / order if order else None


def law_at(h: Hypothesis | None, missing: MissingForce) -> Law | None:
    """The fitted law of a hypothesis at the port of a missing force, if any."""
    if h is None:
        return None
    for c in h.candidates:
        effect = EFFECTS.get(c.kind)
        if c.location == missing.port.name and effect and issubclass(effect, ForceLaw):
            prefix = c.prefix
            own = {n.removeprefix(prefix): x for n, x in h.theta.items() if n.startswith(prefix)}
            return Law(c, effect, own, missing)
    return None
