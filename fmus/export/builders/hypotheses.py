"""FMUs with effects built in, made when first asked for: one model or foreign FMU, many hypotheses."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from fmus.effects import EFFECTS, offers
from fmus.errors import BadInput
from fmus.export.around.effects_alone import EffectsAlone
from fmus.export.around.outside import Outside
from fmus.export.builders.native.build import build_native
from fmus.export.builders.native.working import Working, build_working
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import COUPLING_STEP, build_coupled
from fmus.export.provenance import Origin
from fmus.host.apart.isolation import Isolation
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, PortNames
from fmus.model import Model, joins
from fmus.models import model_class

Effects = tuple[tuple[str, str], ...]  # (kind, location)
LONGEST = 100  # characters of a folder's name, well below what file systems take
# effects that share an FMU where they are not switched: to build one takes the time of fifty simulations
ABOARD = 10
PLAIN = re.compile(r"[\w@+ .-]+")  # a name that is that of a folder on every file system


@dataclass(frozen=True)
class ModelBuilder:
    """Builds of one of our models, with its locations opened by probes; kept in a folder."""

    model: str
    folder: Path
    quick: ClassVar[bool] = True  # with effects as without
    isolation: ClassVar[Isolation | None] = None  # our own models run where they are used
    coupling: ClassVar[float] = 0.0  # effects are part of the equations

    @property
    def form(self) -> Mapping[str, tuple[float, float]]:
        """Bounds of the parameters that stand for what the model's form is uncertain in."""
        return model_class(self.model).form

    @property
    def form_choices(self) -> Mapping[str, tuple[float, ...]]:
        """Values of the parameters that choose a form of the model, where several are plausible."""
        return model_class(self.model).form_choices

    @property
    def form_error(self) -> float:
        """Share of an output that the model's form leaves open."""
        return model_class(self.model).form_error

    @property
    def offers(self) -> Effects:
        """Every effect at every location where it makes sense, and where another form would be none."""
        return _offered(self.model)

    @property
    def ports(self) -> tuple[PortNames, ...]:
        """The model's locations by the names of their probes."""
        return _ports(self.model)

    def coupled_every(self, step: float) -> "ModelBuilder":
        """The same, for there is nothing to couple."""
        return self

    def outside(self) -> Outside:
        """The FMU without effects as a site for them, seen from outside."""
        return Outside(_described(self(())), self.ports, _bare(self.model))

    def __call__(self, effects: Effects) -> Path:
        """Path of an FMU with these effects and those that share it, all off at their start values.

        Which ones share it does not depend on the record, so that its library is kept for the next one.
        Native where a C compiler is at hand, since hypotheses are run many times; otherwise a PythonFMU, with
        these alone.
        """
        try:
            if effects and {*effects} <= {*_offered(self.model)} and joins(_bare(self.model)):
                chosen = [(EFFECTS[kind], at) for kind, at in effects]
                return _once(self.folder, effects, lambda to: _whole(self.model).write(to, chosen))
            aboard = _aboard(self.model, effects)
            return _once(
                self.folder,
                aboard,
                lambda to: build_working(self._made(aboard, probes=True), to, in_rows=True),
            )
        except BadInput:
            return _once(self.folder, effects, lambda to: build_python(self._made(effects, probes=True), to))

    def final(
        self, effects: Effects, starts: Mapping[str, float], out: Path, origin: Origin | None = None
    ) -> Path:
        """Write the FMU with effects and start values that were found, for use elsewhere."""
        model = self._found(effects, starts)
        return build_python(model, out / f"{model.name}_augmented.fmu", origin)

    def final_native(
        self, effects: Effects, starts: Mapping[str, float], out: Path, origin: Origin | None = None
    ) -> Path:
        """The same as a native FMU; BadInput where no compiler is at hand."""
        model = self._found(effects, starts)
        return build_native(model, out / f"{model.name}_augmented_native.fmu", origin=origin)

    def _found(self, effects: Effects, starts: Mapping[str, float]) -> Model:
        model = self._made(effects)
        for name in starts.keys() & model.variables.keys():
            model.variables[name] = replace(model.variables[name], start=starts[name])
        return model

    def _made(self, effects: Effects, probes: bool = False) -> Model:
        return model_class(self.model)([(EFFECTS[k], at) for k, at in effects], probes)


@dataclass(frozen=True)
class ForeignBuilder:
    """A foreign FMU for co-simulation with effects around it; kept in a folder.

    isolation: how its builds run, see Archive; carried: the FMU for model exchange alone that is inside of
    `fmu`, if there is one, see `co_simulated`; coupling: longest time between two readings of the ports, s.
    """

    fmu: Path
    ports: tuple[PortNames, ...]
    folder: Path
    isolation: Isolation | None = None
    carried: Path | None = None
    coupling: float = COUPLING_STEP
    quick: ClassVar[bool] = False
    form: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType({})
    form_choices: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType({})
    form_error: ClassVar[float] = 0.0

    @property
    def source(self) -> Path:
        """The FMU as its owner gave it."""
        return self.carried or self.fmu

    @property
    def offers(self) -> Effects:
        """Every force law at every port, for only its owner knows what makes sense there; and what can
        befall its tunable parameters and its inputs.
        """
        return offers(Outside(describe(self.fmu), self.ports))

    def coupled_every(self, step: float) -> "ForeignBuilder":
        """The same with effects that read the ports every so many s."""
        return replace(self, coupling=step)

    def outside(self) -> Outside:
        """The FMU without effects as a site for them, seen from outside."""
        return Outside(_described(self(())), self.ports)

    def __call__(self, effects: Effects) -> Path:
        """Path of the FMU with these effects, all off at their start values.

        Without an effect too it runs inside another FMU, so that all hypotheses take the same steps: a native
        one where a C compiler is at hand, a PythonFMU otherwise.
        """
        if not self.ports and not effects:
            return self.fmu
        return _once(
            self.folder if self.coupling == COUPLING_STEP else self.folder / f"every {self.coupling:g} s",
            effects,
            lambda to: _quickest(
                to,
                lambda path: build_carrier(self.fmu, self.ports, effects, path, self.coupling),
                lambda path: build_coupled(self.fmu, self.ports, effects, path, step=self.coupling),
            ),
            self.fmu.name,  # by which messages call it
        )

    def final(
        self, effects: Effects, starts: Mapping[str, float], out: Path, origin: Origin | None = None
    ) -> Path:
        """Write the FMU with effects around it and start values that were found, for use elsewhere."""
        target = out / f"{self.fmu.stem}_augmented.fmu"
        return build_coupled(
            self.fmu, self.ports, effects, target, starts=starts, origin=origin, source=self.carried,
            step=self.coupling,
        )  # fmt: skip

    def alone(self, effects: Effects, starts: Mapping[str, float], step: float) -> EffectsAlone:
        """The effects as a model of their own, to be connected to the FMU every `step`, s.

        BadInput where an effect changes a parameter while running.
        """
        return EffectsAlone(describe(self.fmu), self.ports, effects, starts, step)


def co_simulated(fmu: Path, folder: Path) -> Path:
    """The FMU or, if it is for model exchange alone, one for co-simulation that carries and integrates it.

    That one is kept in the folder. BadInput where no compiler is at hand, or the FMU has no library for this
    platform.
    """
    if _described(fmu).exchange is None:
        return fmu
    target = folder / "co_simulation" / fmu.name
    if not target.exists():
        part = target.with_name(f"{os.getpid()}.fmu")
        build_carrier(fmu, (), (), part)
        part.replace(target)  # workers may build the same at once
    return target


@cache
def _whole(model: str) -> Working:
    """The library of a model with all effects that it offers, each of which may be off."""
    effects = [(EFFECTS[kind], at) for kind, at in _offered(model)]
    return Working.of(model_class(model).with_switches()(effects, probes=True), in_rows=True)


@cache
def _bare(model: str) -> Model:
    return model_class(model)()


@cache
def _offered(model: str) -> Effects:
    """See ModelBuilder.offers."""
    made = model_class(model)
    return tuple(e for e in offers(_bare(model)) if e[1] not in {*made.form, *made.form_alike})


@cache
def _aboard(model: str, effects: Effects) -> Effects:
    """The effects and those that share an FMU with one of them."""
    sharing = _sharing(model)
    return tuple(sorted({other for e in effects for other in sharing.get(e, (e,))}))


@cache
def _sharing(model: str) -> Mapping[tuple[str, str], Effects]:
    """For each effect that a model offers, those that share an FMU with it.

    Those at one place go together. Effects with states of their own share no FMU: they would slow it down.
    """
    own = [e for e in _offered(model) if not EFFECTS[e[0]].states("translation")]
    by_place = sorted(own, key=lambda e: (e[1], e[0]))
    groups = [tuple(by_place[i : i + ABOARD]) for i in range(0, len(by_place), ABOARD)]
    return {e: group for group in groups for e in group}


@cache
def _ports(model: str) -> tuple[PortNames, ...]:
    names = _bare(model).ports()
    return tuple(PortNames(n, f"{n}_force", f"{n}_velocity", f"{n}_displacement") for n in names)


@cache
def _described(fmu: Path) -> FmuDescription:
    return describe(fmu)


def _once(folder: Path, effects: Effects, build: Callable[[Path], object], file: str = "model.fmu") -> Path:
    """The build with these effects, made if it is not there yet."""
    name = "+".join(["base", *(f"{k}@{at}" for k, at in effects)])
    if len(name) > LONGEST or not PLAIN.fullmatch(name):  # a slash would lead out of the folder
        name = f"{len(effects)}_effects_{sha256(name.encode()).hexdigest()[:16]}"
    target = folder / name / file
    if not target.exists():
        part = target.with_name(f"{os.getpid()}.fmu")
        build(part)
        part.replace(target)  # workers may build the same at once
    return target


def build_quick(model: Model, folder: Path) -> Path:
    """An FMU of a model for many steps on this machine: native, or a PythonFMU if there is no compiler."""
    out = folder / f"{model.name}.fmu"
    _quickest(out, lambda path: build_working(model, path), lambda path: build_python(model, path))
    return out


def _quickest(out: Path, native: Callable[[Path], Path], python: Callable[[Path], Path]) -> None:
    try:
        native(out)
    except BadInput:
        python(out)
