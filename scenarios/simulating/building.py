"""The FMUs of a scenario: files as they are, models and PythonFMU sources built on the fly, each once."""

import inspect
import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from fmus.effects import parse_effect
from fmus.errors import BadInput, did_you_mean
from fmus.export.builders.script import build_script
from fmus.model import Model
from scenarios.experiment.validation import of_file
from scenarios.simulating.declaration import Member


class Builder:
    """Builds FMUs into a folder; what was built for one variant or scenario serves the next."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._made = folder, dict[str, Path]()

    def path(self, member: Member, key: str, scenario: Path) -> Path:
        """The FMU of a member that stands at `key` of a scenario file."""
        if member.fmu is not None:
            return scenario.parent / member.fmu
        origin = member.model or str((scenario.parent / (member.source or "")).resolve())
        recipe = json.dumps([origin, member.effects, member.contact, member.kind], sort_keys=True)
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
        from fmus.export.builders.native.build import build_native  # here because few ask for a compiler

        return build_native(model, out)
    from fmus.export.builders.pythonfmu import build_python

    return build_python(model, out)


def model_of(member: Member, folder: Path) -> Model:
    """The model of a member with its effects and profiles; point files are found in `folder`.

    BadInput, which names the key, where one of them is wrong.
    """
    from fmus.models import model_class  # here because it loads CasADi, which a foreign FMU does without

    chosen = model_class(member.model or "")
    effects = [parse_effect(text) for text in member.effects]
    if not member.contact:
        return chosen(effects)
    found = inspect.signature(chosen).parameters.get("track")
    if found is None:
        raise BadInput(f"has key 'contact', but model '{member.model}' has no profiles; leave it out")
    kind = type(found.default)
    track = kind(**_profiles(member.contact, {f.name for f in fields(kind)}, folder))
    return chosen(effects, track=track)  # type: ignore[call-arg]  # found above


def _profiles(given: dict[str, Any], known: set[str], folder: Path) -> dict[str, Any]:
    """Fields of a Track; point files are found beside the scenario."""
    for name, value in given.items():
        if name not in known:
            raise BadInput(f"key 'contact.{name}' is not known; {did_you_mean(name, known)}")
        wanted = "a name or a point file" if name in ("wheel", "rail") else "a number"
        if isinstance(value, str) != (name in ("wheel", "rail")):
            raise BadInput(f"key 'contact.{name}' must be {wanted}, not {value!r}")
    return {n: beside(v, folder) for n, v in given.items()}


def beside(profile: Any, folder: Path) -> Any:
    """The point file of that name in a folder, where there is one."""
    if isinstance(profile, str) and (folder / profile).is_file():
        return str(folder / profile)
    return profile
