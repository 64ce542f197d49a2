"""The form in which the FMUs of a scenario are built for a package."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from fmus.contact.forces.conditions import CONDITIONS
from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.model import Model
from scenarios.experiment.validation import of_file
from scenarios.simulating.building import Builder, model_of
from scenarios.simulating.declaration import Declaration, Member

Kind = Literal["native", "python"]


@dataclass(frozen=True)
class Form:
    """The form in which models are built; see build_native."""

    kind: Kind = "native"
    fmi: int = 2
    platforms: Sequence[str] | str = ()

    def build(self, model: Model, out: Path) -> Path:
        """Write the FMU of a model into a folder."""
        if self.kind == "native":
            return build_native(model, out, self.fmi, (*self._named, "host"))  # looked at from here too
        if self.fmi != 2:
            raise BadInput(f"FMI {self.fmi}: PythonFMU builds are FMI 2 only; choose native FMUs")
        return build_python(model, out)

    @property
    def _named(self) -> Sequence[str]:
        return (self.platforms,) if isinstance(self.platforms, str) else self.platforms


class Packer(Builder):
    """Builds all models of a scenario in one form, and keeps the path of each member's FMU.

    The scenario's values are also written into the FMUs as start values, because libcosim does not set start
    values of states, and FMPy does not set any.
    """

    def __init__(self, folder: Path, form: Form, d: Declaration) -> None:
        super().__init__(folder)
        self._own, self._form = folder, form
        self._starts = starts(d)
        self.paths: dict[str, Path] = {}  # by member

    def path(self, member: Member, key: str, scenario: Path) -> Path:
        """See Builder.path."""
        name = key.removeprefix("fmus.")
        if member.model is None:
            self.paths[name] = super().path(member, key, scenario)
            return self.paths[name]
        with of_file(scenario):
            try:
                model = model_of(member, scenario.parent)
                _set_starts(model, self._starts[name])
                self.paths[name] = self._form.build(model, self._own / name)
            except BadInput as error:
                raise BadInput(f"[{key}] {error}") from error
        return self.paths[name]


def starts(d: Declaration) -> dict[str, dict[str, float]]:
    """Values that a scenario sets before the start, by member and variable; without time-varying inputs."""
    found: dict[str, dict[str, float]] = {}
    for name, member in d.fmus.items():
        friction = CONDITIONS[member.friction] if member.friction else {}
        found[name] = {**friction, **member.parameters, **member.initial}
    for full, given in d.inputs.items():
        name, _, variable = full.partition(".")
        if name in found and isinstance(given, int | float) and not isinstance(given, bool):
            found[name][variable] = float(given)
    return found


def _set_starts(model: Model, values: Mapping[str, float]) -> None:
    """Unknown names are passed on, because the master reports them with an error."""
    for name in values.keys() & model.variables.keys():
        model.variables[name] = replace(model.variables[name], start=values[name])
