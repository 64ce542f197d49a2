"""The FMUs of a scenario: files are used unchanged, models and PythonFMU sources are built once each."""

import json
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.export.builders.script import build_script
from fmus.model import Model
from scenarios.experiment.validation import of_file
from scenarios.simulating.declaration import Member


class Builder:
    """Builds FMUs into a folder and reuses them for further variants and scenarios."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._made = folder, dict[str, Path]()

    def path(self, member: Member, key: str, scenario: Path) -> Path:
        """The FMU of a member that stands at `key` of a scenario file."""
        if member.fmu is not None:
            return scenario.parent / member.fmu
        origin = member.model or str((scenario.parent / (member.source or "")).resolve())
        recipe = json.dumps([origin, member.effects, member.options, member.kind], sort_keys=True)
        if recipe not in self._made:
            with of_file(scenario):
                self._made[recipe] = self._build(member, key, scenario.parent)
        return self._made[recipe]

    def _build(self, member: Member, key: str, folder: Path) -> Path:
        out = self._folder / str(len(self._made))
        try:
            if member.source is not None:
                return build_script(folder / member.source, out)
            return _built(model_of(member, folder), member.kind, out)
        except BadInput as error:
            raise BadInput(f"[{key}] {error}") from error


def _built(model: Model, kind: str, out: Path) -> Path:
    if kind == "native":
        from fmus.export.builders.native.build import (
            build_native,
        )  # imported here, because few scenarios need a compiler

        return build_native(model, out)
    from fmus.export.builders.pythonfmu import build_python

    return build_python(model, out)


def model_of(member: Member, folder: Path) -> Model:
    """The model of a member with its effects and build options; files that these name are found in `folder`.

    BadInput where one of them is wrong.
    """
    # here because it loads CasADi, which a foreign FMU does without
    from fmus.models import model_class, model_with

    name = member.model or ""
    files = [option.name for option in model_class(name).build_options if option.type is Path]
    given = {n: beside(value, folder) if n in files else value for n, value in member.options.items()}
    return model_with(name, member.effects, given)


def beside(given: Any, folder: Path) -> Any:
    """The file of that name in a folder, where there is one."""
    if isinstance(given, str) and (folder / given).is_file():
        return str(folder / given)
    return given
