"""All models, effects and the places where they fit: what the contract tests go through."""

from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.effects import EFFECTS, offers
from fmus.effects.effect import Effect
from fmus.effects.force_law import ForceLaw
from fmus.effects.free_form import FreeForm
from fmus.model import Model
from fmus.models import MODELS
from fmus.variables import Input, Parameter, State

Array = NDArray[np.float64]
Place = tuple[str, str, str]  # model, kind of effect, location

EVERY_MODEL = sorted(MODELS)
EVERY_EFFECT = sorted(EFFECTS)
EVERY_PLACE: list[Place] = [
    (name, kind, location) for name in EVERY_MODEL for kind, location in offers(MODELS[name]())
]
FORCE_LAWS = [kind for kind in EVERY_EFFECT if issubclass(EFFECTS[kind], ForceLaw)]
WITH_MEMORY = {kind for kind in EVERY_EFFECT if EFFECTS[kind].states("translation")}
# curves without a cause, never offered
FALLBACK = {kind for kind in EVERY_EFFECT if issubclass(EFFECTS[kind], FreeForm)}


def fitting(model: str) -> list[tuple[type[Effect], str]]:
    """Every effect at every place of a model."""
    return [(EFFECTS[kind], location) for name, kind, location in EVERY_PLACE if name == model]


def start(model: Model, kind: type[Any]) -> Array:
    """Start values of the variables of a kind, (n,)."""
    return np.array([v.start for v in model.of(kind)])


def values(function: cs.Function, *arguments: Array) -> Array:
    """First result of a CasADi function, (n,)."""
    result = function(*arguments)
    flat: Array = (result[0] if isinstance(result, tuple) else result).full().ravel()
    return flat


def near_start(model: Model, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """States, inputs and parameters about the start values: x, u by their nominal, p as declared."""
    x, u = (
        np.array([v.start + (v.nominal or 1.0) * rng.uniform(-1, 1) for v in model.of(kind)])
        for kind in (State, Input)
    )
    low = np.array([-np.inf if v.min is None else v.min for v in model.of(Input)])
    return x, np.maximum(u, low), start(model, Parameter)
