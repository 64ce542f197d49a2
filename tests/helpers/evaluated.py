"""A model's equations by the names of its variables: rates, outputs, state matrix, equilibrium."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from fmus.model import Model, equations
from fmus.variables import Input, Output, Parameter, State
from tests.helpers.everything import values

Array = NDArray[np.float64]


class Evaluated:
    """A model, evaluated at its start values but for those that are given by name."""

    def __init__(self, model: Model) -> None:
        self.model, self.made = model, equations(model)
        self.names = {kind: [v.name for v in model.of(kind)] for kind in (State, Input, Parameter, Output)}
        self._slopes = self.made.f.jacobian()

    def arguments(self, **changed: float) -> list[Array]:
        """Columns of states, inputs and parameters; ValueError for a name that is none of them."""
        kinds = (State, Input, Parameter)
        unknown = set(changed) - {n for kind in kinds for n in self.names[kind]}
        if unknown:
            raise ValueError(f"{self.model.name} has no {', '.join(sorted(unknown))}")
        return [np.array([float(changed.get(v.name, v.start)) for v in self.model.of(k)]) for k in kinds]

    def rates(self, **changed: float) -> dict[str, float]:
        """Derivatives by name of state."""
        found = values(self.made.f, *self.arguments(**changed))
        return dict(zip(self.names[State], found.tolist(), strict=True))

    def outputs(self, **changed: float) -> dict[str, float]:
        """Outputs by name."""
        found = values(self.made.h, *self.arguments(**changed))
        return dict(zip(self.names[Output], found.tolist(), strict=True))

    def state_matrix(self, **changed: float) -> Array:
        """Jacobian of the rates by the states (n, n)."""
        found: Array = self._slopes(*self.arguments(**changed), 0)[0].full()
        return found

    def equilibrium(self, **changed: float) -> dict[str, float]:
        """States at rest, from the given ones on; AssertionError where none is found."""
        x, u, p = self.arguments(**changed)
        sizes = np.array([v.nominal or 1.0 for v in self.model.of(State)])
        found = root(
            lambda z: values(self.made.f, z * sizes, u, p),
            x / sizes,
            jac=lambda z: self._slopes(z * sizes, u, p, 0)[0].full() * sizes,
            method="lm",
            options={"xtol": 1e-14, "ftol": 1e-14, "maxiter": 3000},
        )
        assert np.abs(found.fun).max() < 1e-9, found.message
        return dict(zip(self.names[State], (found.x * sizes).tolist(), strict=True))
