"""A scenario in which a vehicle wears its wheels: it is run with given wheels, and tells what they do."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.master.recording import TIME
from fmus.models import MODELS, model_class, model_with
from fmus.wheelset.track import OPTIONS, Track
from scenarios.experiment.validation import of_file
from scenarios.simulating import Scenario, load_scenario
from scenarios.simulating.building import Builder, beside
from scenarios.simulating.case import prepared
from scenarios.simulating.declaration import Declaration

SIDES = {"left": 1, "right": -1}  # sign of the wheelset's shift, as each wheel sees it
EXAMPLE = "a scenario, such as scenarios/shipped/bogie_in_service.toml"
SPEED = "V"
DISSIPATED, AT_FLANGE = "T_gamma", "T_gamma_flange"
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Ride:
    """What one wheel does along a run of some length, m: shifts (n,), m, way of each sample (n,), m.

    tread, flange: T gamma (n,), N, of its contacts there; load: mean wheel load, N.
    """

    side: str
    shift: Array
    way: Array
    tread: Array
    flange: Array
    load: float


@dataclass(frozen=True)
class Service:
    """The scenario, the FMU in it whose wheels wear, its wheelsets, and its track with new wheels."""

    scenario: Scenario
    fmu: str
    wheelsets: tuple[str, ...]
    track: Track

    @staticmethod
    def read(file: Path) -> "Service":
        """The service of a scenario file; BadInput unless one of its FMUs has wheels that wear."""
        scenario = load_scenario(file)
        with of_file(scenario.file):
            declared = next(iter(scenario.variants.values()))
            wearing = [name for name, m in declared.fmus.items() if m.model and _wears(m.model)]
            if len(wearing) != 1:
                known = " or ".join(f"'{n}'" for n in MODELS if _wears(n))
                names = ", ".join(wearing) or "none"
                raise BadInput(f"wear needs one FMU with model = {known}; the scenario has {names}")
            [name] = wearing
            member = declared.fmus[name]
            options = {k: beside(v, scenario.file.parent) for k, v in member.options.items()}
            model = model_with(str(member.model), [], options)
            numbers = tuple(
                v.removeprefix(f"{DISSIPATED}_").removesuffix("_left")
                for v in model.variables
                if v.startswith(f"{DISSIPATED}_") and v.endswith("_left") and "flange" not in v
            )
            track = Track.parse(**{o.name: options[o.name] for o in OPTIONS if o.name in options})
        return Service(scenario, name, numbers, track)

    def rides(self, wheels: Mapping[str, Any], tell: Tell) -> Iterator[Ride]:
        """Every wheel of every variant; wheels: build options of the wheels, by name."""
        with ExitStack() as stack:
            folder = Path(stack.enter_context(TemporaryDirectory()))
            builder = Builder(folder)
            for name, d in self.scenario.variants.items():
                tell(f"building and running '{name}'" if len(self.scenario.variants) > 1 else "running")
                with of_file(self.scenario.file):
                    case = prepared(self._asked(d, wheels), self.scenario.file, (), builder, stack)
                data = case.run(None).recording.data
                yield from self._of_run({c: data[c].to_numpy(dtype=float) for c in data.columns})

    def _asked(self, d: Declaration, wheels: Mapping[str, Any]) -> Declaration:
        member = d.fmus[self.fmu]
        own = {k: beside(v, self.scenario.file.parent) for k, v in member.options.items()}
        changed = member.model_copy(update={"options": {**own, **wheels}})
        record = d.record.model_copy(update={"names": tuple(self._signals()), "step": None})
        return d.model_copy(update={"fmus": {**d.fmus, self.fmu: changed}, "record": record, "sensors": {}})

    def _signals(self) -> Iterator[str]:
        yield f"{self.fmu}.{SPEED}"
        for i in self.wheelsets:
            yield from (f"{self.fmu}.{name}_{i}" for name in ("y", "y_irr"))
            for side in SIDES:
                yield from (f"{self.fmu}.{name}_{i}_{side}" for name in ("Q", DISSIPATED, AT_FLANGE))

    def _of_run(self, data: Mapping[str, Array]) -> Iterator[Ride]:
        def column(name: str) -> Array:
            return data[f"{self.fmu}.{name}"]

        way = column(SPEED) * np.gradient(data[TIME])
        for i in self.wheelsets:
            shift = column(f"y_{i}") - column(f"y_irr_{i}")
            for side, sign in SIDES.items():
                whole, flange = (column(f"{name}_{i}_{side}") for name in (DISSIPATED, AT_FLANGE))
                load = float(np.mean(column(f"Q_{i}_{side}")))
                yield Ride(side, sign * shift, way, np.maximum(whole - flange, 0.0), flange, load)


def _wears(model: str) -> bool:
    """Whether a model says what its wheels dissipate."""
    return any(name.startswith(DISSIPATED) for name in vars(model_class(model)))
