"""FMUs built once for all tests."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fmus.effects import parse_effect
from fmus.export.pythonfmu import build_python
from fmus.models import model_class
from tests.everything import fitting

Built = Callable[..., Path]


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """built(model, "kind@location", ...) is the path of that FMU; "all" stands for every effect that fits."""
    folder = tmp_path_factory.mktemp("built")
    made: dict[tuple[str, ...], Path] = {}

    def build(name: str, *effects: str) -> Path:
        key = (name, *effects)
        if key not in made:
            chosen = fitting(name) if effects == ("all",) else map(parse_effect, effects)
            made[key] = build_python(model_class(name)(chosen), folder / str(len(made)))
        return made[key]

    return build
