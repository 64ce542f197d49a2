"""Our hosts make no call that FMI's state machine forbids, tried on an FMU that allows nothing else."""

import shutil

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.testing import assert_allclose, assert_array_equal

from estimator.access.copies import Copies
from estimator.access.recipe import Way
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host import loop
from fmus.host.archive import Archive
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu, FmuError
from fmus.host.grading.bench import Bench
from fmus.host.grading.trials import TRIALS
from fmus.host.master.connections import Connection
from fmus.host.master.master import Master
from tests.helpers.packed_fmu import FOLDER, build_packed

DESCRIPTIONS = {
    2: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Strict" guid="{strict}" variableNamingConvention="flat">
  <CoSimulation modelIdentifier="strict" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" initial="exact">
      <Real start="1"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="p" valueReference="2" causality="parameter" variability="tunable">
      <Real start="0.5"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="4"/></Outputs>
    <InitialUnknowns><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
""",
    3: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Strict" instantiationToken="{strict}">
  <CoSimulation modelIdentifier="strict" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="x" valueReference="1" causality="output" initial="exact" start="1"/>
    <Float64 name="u" valueReference="2" causality="input" start="0"/>
    <Float64 name="p" valueReference="3" causality="parameter" variability="tunable" start="0.5"/>
    <Float64 name="y" valueReference="4" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><Output valueReference="4"/>
    <InitialUnknown valueReference="4"/>
  </ModelStructure>
</fmiModelDescription>
""",
}
T = np.arange(6) * 0.01


@pytest.fixture(scope="module", params=DESCRIPTIONS, ids=lambda fmi: f"fmi{fmi}")
def strict(request, tmp_path_factory):
    compiler = next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)
    if compiler is None:
        pytest.skip("no C compiler")
    source = FOLDER / f"strict_fmi{request.param}.c"
    path = tmp_path_factory.mktemp("strict") / "strict.fmu"
    return build_packed(compiler, source, DESCRIPTIONS[request.param], path)


@pytest.fixture
def breaches(tmp_path, monkeypatch):
    """What the FMU wrote of forbidden calls."""
    log = tmp_path / "breaches.txt"
    monkeypatch.setenv("STRICT_LOG", str(log))
    return lambda: log.read_text().splitlines() if log.exists() else []


def test_the_strict_fmu_is_strict(strict, breaches):
    expected = []
    for name in ("reset", "exitInitializationMode", "get"):
        with Fmu(strict) as fmu:
            three = fmu.instance.FMI3
            name = {"get": "getFloat64" if three else "getReal"}.get(name, name)
            arguments = [[1]] if name.startswith("get") else []
            with pytest.raises(FMICallException):
                getattr(fmu.instance._slave, name)(*arguments)
            expected.append(f"fmi{3 if three else 2}{name[0].upper()}{name[1:]}")
    assert [line.partition(":")[0] for line in breaches()] == expected


def test_one_fmu_from_its_start_to_its_end(strict, breaches, monkeypatch):
    with Fmu(strict) as fmu:
        for call in (lambda: fmu["x"], lambda: fmu.step(0.1)):
            with pytest.raises(FmuError, match="it is not initialised; restart it first"):
                call()
        fmu.restart(x=2.0, p=1.0, u=0.5)
        assert fmu["y"] == 2.5
        fmu.step(0.1, u=0.0)
        assert fmu["x"] == pytest.approx(1.8)
        saved = fmu.save()
        copy = fmu.deserialised(fmu.serialised(saved))
        x = fmu["x"]
        for state in (saved, copy):
            fmu.step(0.1)
            fmu.restore(state)
            fmu.time = 0.1
            assert fmu["x"] == x
            fmu.forget(state)
        with pytest.raises(FmuError):  # it discards steps of more than 0.5 s
            fmu.step(0.6)
        runs = [fmu.simulate(T, {"u": np.sin(T)}, ["x", "y"], {"x": 1.0})]
        with pytest.raises(FmuError):
            fmu.step(0.1, u=np.nan)
        monkeypatch.setattr(loop, "LONG", 3)
        runs.append(fmu.simulate(T, {"u": np.sin(T)}, ["x", "y"], {"x": 1.0}))
        assert_array_equal(*runs)
        fmu.instance.enter(fmu.references(["x"]), [3.0], 0.0)  # and closed in the midst of initialisation
    with Fmu(strict) as fmu, pytest.raises(FmuError):
        fmu.restart(u=np.nan)
    assert breaches() == []


def test_every_trial_of_check(strict, breaches):
    with Archive(strict) as archive:
        bench = Bench(archive)
        for title, trial in TRIALS.items():
            passed, sentence = trial(bench)
            assert passed, f"{title}: {sentence}"
    assert breaches() == []


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("way", [Way.RESTART, Way.RESUME])
def test_copies_for_filters(strict, breaches, way, compiled):
    values = np.array([[1.0], [2.0], [0.0]])
    with (
        Archive(strict) as archive,
        Copies(archive, way, ["x"], ["x"], {"p": 1.0}, free_time=True, compiled=compiled) as copies,
    ):
        for t in (0.0, 0.0, 0.0):
            assert_allclose(copies.advance(values, t, 0.1), 0.9 * values, rtol=1e-12)
    assert breaches() == []


@pytest.mark.parametrize("build", [build_coupled, build_carrier])
def test_an_fmu_that_carries_it(strict, breaches, build, tmp_path):
    ports = (PortNames("port", "u", "y", "x"),)
    path = build(strict, ports, [("viscous_damping", "port")], tmp_path / "carrying.fmu")
    with Fmu(path) as fmu:
        runs = [fmu.simulate(T, {}, ["x"], {"x": 2.0}) for _ in range(3)]
    assert_array_equal(runs[1], runs[0])
    assert_array_equal(runs[2], runs[0])
    assert breaches() == []


def test_connected_ones(strict, breaches):
    links = [Connection("a.x", "b.u"), Connection("b.x", "a.u")]
    with Master({"a": strict, "b": strict}, links, step=0.01, record=["a.x", "b.x"]) as master:
        runs = [master.run(0.1).data["a.x"].to_numpy() for _ in range(2)]
    assert_array_equal(*runs)
    assert breaches() == []
