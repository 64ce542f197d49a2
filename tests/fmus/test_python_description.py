"""What a PythonFMU build says of itself: valid, complete, the same bytes from the same source."""

import os
import subprocess
import sys
import textwrap
import zipfile
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fmus
from fmus.drive.model import Drive
from fmus.export.builders.native.build import build_native
from fmus.export.builders.native.table import table
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.coupled import build_coupled
from fmus.host.archive import problems
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from fmus.host.master.connections import Connection
from fmus.host.master.master import Master
from fmus.model import Model, equations
from fmus.models import MODELS
from fmus.units import base_exponents
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from tests.helpers.everything import EVERY_MODEL
from tests.helpers.runs import every_model, heavier
from tests.helpers.sizes import bare_and_with_all_effects, by_size


def xml_of(path):
    with zipfile.ZipFile(path) as packed:
        return ElementTree.fromstring(packed.read("modelDescription.xml"))


@bare_and_with_all_effects
def test_validation_has_nothing_to_object(built, name, effects):
    assert problems(built(name, *effects)) == []


@pytest.mark.parametrize("build", [build_python, build_native])
def test_description_says_whose_it_is_what_made_it_and_how_to_run_it(build, tmp_path):
    path = build(Drive(), tmp_path)
    root = xml_of(path)
    assert root.get("license") == "Apache-2.0"
    assert root.get("author") == "the authors of railfmi"
    assert root.get("copyright").startswith("Copyright")
    assert root.get("version") == version("railfmi")
    assert root.get("generationTool").startswith(f"railfmi {version('railfmi')}")
    experiment = root.find("DefaultExperiment")
    assert float(experiment.get("stepSize")) == Drive.step_size
    assert float(experiment.get("stopTime")) > float(experiment.get("startTime")) == 0
    assert problems(path) == []
    with zipfile.ZipFile(path) as packed:
        assert {info.external_attr >> 16 for info in packed.infolist()} == {0o644}


def test_a_model_from_elsewhere_is_not_said_to_be_ours(tmp_path):
    class Theirs(Drive):
        """A model of somebody else."""

        name = "Theirs"

    root = xml_of(build_python(Theirs(), tmp_path))
    assert not {"author", "copyright", "license"} & set(root.attrib)
    assert root.get("generationTool").startswith("railfmi")


@every_model
def test_description_says_all_that_the_model_declares(built, name):
    model, root = MODELS[name](), xml_of(built(name))
    nodes = {node.get("name"): node for node in root.iter("ScalarVariable")}
    assert list(nodes) == [v.name for k in (State, Input, Parameter, Output) for v in model.of(k)]
    for v in model.variables.values():
        node, real = nodes[v.name], nodes[v.name].find("Real")
        assert node.get("description") == v.doc
        assert node.get("causality") == v.causality
        assert real.get("unit") == v.unit
        for key in ("min", "max", "nominal"):
            assert real.get(key) == (None if getattr(v, key) is None else repr(float(getattr(v, key))))
        starts = not isinstance(v, Output)
        assert real.get("start") == (repr(float(v.start)) if starts else None)
        initial = {"input": None, "parameter": "exact", "output": "exact" if starts else "calculated"}
        assert node.get("initial") == initial[v.causality]
        tunable = "fixed" if getattr(v, "fixed", False) else "tunable"
        assert node.get("variability") == (tunable if isinstance(v, Parameter) else "continuous")


@by_size
def test_description_defines_every_unit(built, name):
    root = xml_of(built(name, "all"))
    units = {node.get("name"): node.find("BaseUnit").attrib for node in root.iter("Unit")}
    assert {node.get("unit") for node in root.iter("Real")} == set(units)
    for unit, base in units.items():
        assert {k: int(power) for k, power in base.items()} == base_exponents(unit).exponents


@every_model
def test_description_offers_what_the_build_does(built, name):
    root = xml_of(built(name))
    kind = root.find("CoSimulation")
    assert root.get("variableNamingConvention") == "flat"
    assert "generationDateAndTime" not in root.attrib
    assert {kind.get(k) for k in ("canGetAndSetFMUstate", "canSerializeFMUstate", "needsExecutionTool")} == {
        "true"
    }
    with zipfile.ZipFile(built(name)) as packed:
        assert "documentation/index.html" in packed.namelist()
        page = packed.read("documentation/index.html").decode()
    assert all(f"<code>{v.get('name')}</code>" in page for v in root.iter("ScalarVariable"))


@every_model
def test_dependencies_are_those_of_the_native_build(built, name):
    """Of an output on the inputs alone at a communication point, and on all that can be set at the start."""
    model, structure = MODELS[name](), xml_of(built(name)).find("ModelStructure")
    known = table(model, equations(model))
    inputs = range(known.sizes[0], sum(known.sizes[:2]))
    computed = range(sum(known.sizes[:3]), sum(known.sizes))
    for kind, unknowns, among in (
        ("Outputs", known.outputs, inputs),
        ("InitialUnknowns", [u for u in known.initial if u.reference in computed], range(computed.start)),
    ):
        found = {
            int(n.get("index")) - 1: [int(i) - 1 for i in n.get("dependencies").split()]
            for n in structure.findall(f"{kind}/Unknown")
        }
        assert found == {u.reference: [i for i in u.depends_on if i in among] for u in unknowns}
    assert structure.findall("Outputs/Unknown")


@every_model
def test_variables_are_shown_in_the_units_of_the_native_build(built, name):
    root = xml_of(built(name))
    shown = {v.get("name"): v.find("Real").get("displayUnit") for v in root.iter("ScalarVariable")}
    native = table(MODELS[name](), equations(MODELS[name]()))
    assert shown == {e.name: e.display_unit for e in native.entries if e.name in shown}
    defined = {
        u.get("name"): {d.get("name"): d.attrib for d in u.iter("DisplayUnit")} for u in root.iter("Unit")
    }
    for unit, (display, about) in native.display.items():
        assert defined[unit] == {display: about}


def test_rigs_in_a_ring_are_no_algebraic_loop(built):
    """A rig's asynchronous motor follows the supply, not the torque that the other rig sets."""
    links = [Connection("a.T_A", "b.T_P"), Connection("b.T_A", "a.T_P")]
    rigs = {name: built("testrig") for name in "ab"}
    with Master(rigs, links, step=1e-3, record=["a.omega_w", "b.T_A"]) as master:
        data = master.run(0.01).data
    assert np.isfinite(data.to_numpy()).all()
    assert np.ptp(data["a.omega_w"].to_numpy()) > 0


def test_an_fmu_that_carries_another_leaves_open_on_what_its_outputs_depend(built, tmp_path):
    """Nothing stated means all inputs: the laws read what the carried FMU gives."""
    ports = (PortNames("port", "F_ext", "q_dot", "q"),)
    path = build_coupled(built("drive"), ports, [("viscous_damping", "port")], tmp_path / "carrying.fmu")
    assert not any("dependencies" in node.attrib for node in xml_of(path).iter("Unknown"))
    assert problems(path) == []


class Decay(Model):
    """x' = -x, with nothing beside: no input, no parameter, no computed output."""

    name = "Decay"
    step_size = 0.01
    x = State("1", 1.0, doc="what is left", nominal=1.0)

    def derivatives(self):
        return {"x": -self.x}


def test_the_smallest_model_is_a_valid_fmu(tmp_path):
    path = build_python(Decay(), tmp_path)
    assert problems(path) == []
    with Fmu(path) as fmu:
        fmu.restart(x=2.0)
        fmu.step(1.0)
        # 1e-9: the error of the fourth-order method in steps of 0.01
        assert_allclose(fmu["x"], 2 * np.exp(-1), rtol=1e-9)


def test_the_guid_goes_with_the_content(built, tmp_path):
    def guid(path):
        return xml_of(path).get("guid")

    same = guid(build_python(Drive(), tmp_path / "again"))
    others = [
        guid(built("drive", "all")),
        guid(built("testrig")),
        guid(build_python(heavier(96.0), tmp_path / "h")),
    ]
    assert guid(built("drive")) == same
    assert len({same, *others}) == 4


def sums(fmu):
    with zipfile.ZipFile(fmu) as packed:
        return {name: sha256(packed.read(name)).hexdigest() for name in packed.namelist()}


@every_model
def test_two_builds_have_the_same_bytes(built, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    again = build_python(MODELS[name](), Path("out") / "other_name.fmu")
    assert sums(again) == sums(built(name))  # says in which file a difference lies
    assert again.read_bytes() == built(name).read_bytes()


@pytest.mark.slow
def test_a_native_build_before_changes_no_byte(tmp_path):
    model = MODELS["wheelset"]()
    before = sums(build_python(model, tmp_path / "a.fmu"))
    build_native(model, tmp_path)
    assert sums(build_python(model, tmp_path / "same_model.fmu")) == before
    assert sums(build_python(MODELS["wheelset"](), tmp_path / "new_model.fmu")) == before


@pytest.mark.slow
def test_a_build_elsewhere_has_the_same_bytes(built, tmp_path):
    script = """
        import sys
        from pathlib import Path
        from fmus.export.builders.pythonfmu import build_python
        from fmus.models import MODELS
        for name in sys.argv[1:]:
            build_python(MODELS[name](), Path(name + ".fmu"))
    """
    where = {"PYTHONHASHSEED": "4711", "PYTHONPATH": str(Path(fmus.__file__).parents[1]), "TZ": "Asia/Tokyo"}
    command = [sys.executable, "-c", textwrap.dedent(script), *EVERY_MODEL]
    subprocess.run(command, cwd=tmp_path, env=os.environ | where, check=True)
    for name in EVERY_MODEL:
        assert (tmp_path / f"{name}.fmu").read_bytes() == built(name).read_bytes()
