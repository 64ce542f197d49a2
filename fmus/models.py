"""Models by name. Each folder with a model.py that defines a Model is one; there is no other list."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import fmus
from fmus.effects import parse_effect
from fmus.errors import BadInput, did_you_mean
from fmus.model import Model
from fmus.option import Choice
from fmus.registry import by_name, classes_in, further_folders


def _found() -> dict[str, type[Model]]:
    """Models of the package and of RAILFMI_PATH; BadInput for a further folder that would be passed over."""
    own = {folder.name for folder in Path(__file__).parent.iterdir()}
    for further in further_folders(fmus.__name__):
        for folder in sorted(f for f in further.iterdir() if f.is_dir() and f.name not in own):
            if any(folder.glob("*.py")) and not (folder / "model.py").exists():
                raise BadInput(f"{folder}: holds no model.py; call the file with the model's class so")
    # what is found is concrete
    models = classes_in(fmus, Model, "*/model.py")  # type: ignore[type-abstract]
    return {name.lower(): model for name, model in by_name(models, "name").items()}


MODELS: dict[str, type[Model]] = _found()


def model_class(name: str) -> type[Model]:
    """The model of that name, in any case of letters; BadInput with the nearest one otherwise."""
    if name.lower() not in MODELS:
        raise BadInput(f"model '{name}' is not known; {did_you_mean(name.lower(), MODELS)}")
    return MODELS[name.lower()]


def model_with(name: str, effects: Iterable[str] = (), options: Mapping[str, Choice] | None = None) -> Model:
    """The model of that name with effects KIND@LOCATION and with values of its build options by name.

    BadInput where the model, an effect, a location, an option or a value is not one.
    """
    given: Any = options or {}  # the names are checked by the model
    return model_class(name)([parse_effect(text) for text in effects], **given)
