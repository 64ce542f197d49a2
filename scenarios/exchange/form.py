"""In which form the FMUs of a scenario are built into a package."""

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
    """How models are built into a package; see build_native."""

    kind: Kind = "native"
    fmi: int = 2
    platforms: Sequence[str] | str = ()

    def build(self, model: Model, out: Path) -> Path:
        """Write the FMU of a model into a folder."""
        if self.kind == "native":
            return build_native(model, out, self.fmi, (*self._named, "host"))  # looked at from here too
        if self.fmi != 2:
            raise BadInput(f"FMI {self.fmi}: PythonFMU builds are FMI 2; choose native ones")
        return build_python(model, out)

    @property
    def _named(self) -> Sequence[str]:
        return (self.platforms,) if isinstance(self.platforms, str) else self.platforms


class Packer(Builder):
    """Builds all models of a scenario in one form, and knows where the FMU of each member is.

    The scenario's values are the start values of its FMUs too: libcosim sets none of states, FMPy none.
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
    """Values that a scenario sets before the start, by member and variable; moving inputs are none."""
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
    """Unknown names are left to the master, which says what is wrong with them."""
    for name in values.keys() & model.variables.keys():
        model.variables[name] = replace(model.variables[name], start=values[name])
