"""Models by name. Each folder with a model.py that defines a Model is one; there is no other list."""

import fmus
from fmus.errors import BadInput, did_you_mean
from fmus.model import Model
from fmus.registry import classes_in

MODELS: dict[str, type[Model]] = {
    c.name.lower(): c
    for c in classes_in(fmus, Model, "fmus.*.model")  # type: ignore[type-abstract]  # what is found is concrete
}


def model_class(name: str) -> type[Model]:
    """The model of that name, in any case of letters; BadInput with the nearest one otherwise."""
    if name.lower() not in MODELS:
        raise BadInput(f"model '{name}' is not known; {did_you_mean(name.lower(), MODELS)}")
    return MODELS[name.lower()]
