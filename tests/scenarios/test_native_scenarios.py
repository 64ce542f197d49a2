"""Every shipped scenario gives the same by PythonFMU builds and by native ones of both FMI versions."""

import json

import numpy as np
import pytest

from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.provenance import provenance
from fmus.host.master.recording import read_recording
from scenarios.simulating import run
from scenarios.simulating.building import Builder, model_of
from scenarios.simulating.reading import load_scenario
from tests.helpers.scenario_files import SHIPPED_FILES

MOVING = [f for f in SHIPPED_FILES if not any(d.contact for d in load_scenario(f).variants.values())]
PROMISED = 1e-9  # of the largest value of each signal
BUILDS = {
    "python": build_python,
    "fmi2": lambda model, out: build_native(model, out, 2),
    "fmi3": lambda model, out: build_native(model, out, 3),
}


class Forced(Builder):
    """Builds all models in one way, each once; what is given as a file stays as it is."""

    def __init__(self, folder, build):
        super().__init__(folder)
        self._own, self._build_model, self._known, self._used = folder, build, {}, {}

    def path(self, member, key, scenario):
        if member.model is None:
            return super().path(member, key, scenario)
        recipe = json.dumps([member.model, member.effects, member.options, str(scenario.parent)])
        if recipe not in self._known:
            out = self._own / f"forced{len(self._known)}"
            self._known[recipe] = self._build_model(model_of(member, scenario.parent), out)
        self._used.setdefault(scenario, set()).add(self._known[recipe])
        return self._known[recipe]

    def made(self, scenario):
        """The FMUs of our models that a scenario got."""
        return self._used[scenario]


@pytest.fixture(scope="module")
def builders(tmp_path_factory):
    return {name: Forced(tmp_path_factory.mktemp(name), build) for name, build in BUILDS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("file", MOVING, ids=lambda f: f.stem)
def test_a_scenario_is_the_same_by_every_build(file, builders, tmp_path):
    found = {}
    for name, builder in builders.items():
        assert run(file, tmp_path / name, builder=builder).ok
        files = sorted(p for p in (tmp_path / name).glob("*.parquet") if "measured" not in p.name)
        found[name] = {p.name: read_recording(p).data for p in files}
        kinds = {(provenance(fmu)["kind"], provenance(fmu)["fmi"]) for fmu in builder.made(file)}
        assert kinds == {("python" if name == "python" else "native", 3 if name == "fmi3" else 2)}
    assert found["fmi2"]
    for variant, native in found["fmi2"].items():
        assert (found["fmi3"][variant].to_numpy() == native.to_numpy()).all()  # bit for bit
    for variant, expected in found["python"].items():
        native = found["fmi2"][variant]
        assert list(native) == list(expected)
        gap = np.abs(native.to_numpy() - expected.to_numpy()).max(axis=0)
        size = np.abs(expected.to_numpy()).max(axis=0)
        print(f"{file.stem} {variant}: {np.max(gap / np.maximum(size, 1e-300)):.1e} of the largest value")
        assert (gap <= PROMISED * size).all()


def test_scenarios_about_motion_are_most():
    assert len(MOVING) >= len(SHIPPED_FILES) - 2
