"""What a native FMU says of itself: valid by the standard, complete, the same bytes from the same source."""

import inspect
import os
import re
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path

import casadi as cs
import fmpy
import numpy as np
import pytest
from lxml import etree
from numpy.testing import assert_allclose
from PIL import Image

import fmus
from fmus.export.builders.native.build import build_native
from fmus.export.builders.native.dependencies import dependencies
from fmus.export.builders.native.table import free_name, rate_unit
from fmus.host.archive import problems
from fmus.host.fmu import Fmu
from fmus.host.grading.check import grade
from fmus.model import Model, equations
from fmus.models import MODELS
from fmus.units import base_exponents
from fmus.variables import (
    Input,
    Output,
    Parameter,
    Rate,
    State,
)
from tests.helpers.everything import near_start, values
from tests.helpers.native import (
    description,
    every_version,
    native,
)
from tests.helpers.runs import heavier, names
from tests.helpers.sizes import by_size

SCHEMAS = Path(fmpy.__file__).parent / "schema"
SCHEMA = {  # file in the FMU: its schema
    2: {"modelDescription.xml": "fmi2ModelDescription"},
    3: {
        "modelDescription.xml": "fmi3ModelDescription",
        "sources/buildDescription.xml": "fmi3BuildDescription",
        "terminalsAndIcons/terminalsAndIcons.xml": "fmi3TerminalsAndIcons",
    },
}


def variables(path, fmi):
    """Attributes of each variable by name, in order."""
    root = description(path)
    if fmi == 3:
        return {n.get("name"): dict(n.attrib) for n in root.iter("Float64")}
    return {n.get("name"): dict(n.attrib) | dict(n.find("Real").attrib) for n in root.iter("ScalarVariable")}


def unknowns(path, fmi, kind):
    """Place -> (places depended on, kinds) of a part of the model structure, in order.

    By FMI 2.0 it numbers the variables from 1; by FMI 3.0 it names references, which begin at 1 here, because
    OMSimulator takes 0 for an error.
    """
    root = description(path).find("ModelStructure")
    attribute = "index" if fmi == 2 else "valueReference"
    nodes = root.findall(f"{kind}s/Unknown") if fmi == 2 else root.findall(kind)
    return {
        int(n.get(attribute)) - 1: (
            [int(i) - 1 for i in n.get("dependencies").split()],
            n.get("dependenciesKind", "").split(),
        )
        for n in nodes
    }


@by_size
@every_version
def test_the_standard_has_nothing_to_object(name, fmi):
    path = native(name, fmi=fmi)
    assert problems(path) == []
    with zipfile.ZipFile(path) as packed:
        for file, schema in SCHEMA[fmi].items():
            xsd = etree.XMLSchema(etree.parse(SCHEMAS / f"fmi{fmi}" / f"{schema}.xsd"))
            xsd.assertValid(etree.fromstring(packed.read(file)))


@every_version
def test_all_effects_change_nothing_in_that(fmi):
    assert problems(native("drive", "all", fmi=fmi)) == []


@by_size
@every_version
def test_it_grades_as_fit_for_use_here(name, fmi):
    found = grade(native(name, fmi=fmi))
    assert [c for c in found.checks if c.passed is not True] == []


@by_size
@every_version
def test_description_says_all_that_the_model_declares(name, fmi):
    model, found = MODELS[name](), variables(native(name, fmi=fmi), fmi)
    declared = [v for k in (State, Input, Parameter, Output) for v in model.of(k)]
    assert list(found)[: len(declared)] == [v.name for v in declared]
    first = 0 if fmi == 2 else 1
    assert [int(v["valueReference"]) for v in found.values()] == list(range(first, first + len(found)))
    for v in declared:
        shown = found[v.name]
        assert (shown["causality"], shown["unit"], shown["description"]) == (v.causality, v.unit, v.doc)
        for key in ("min", "max", "nominal"):
            expected = getattr(v, key)
            assert shown.get(key) == (None if expected is None else repr(float(expected)))
        starts = not isinstance(v, Output)
        assert shown.get("start") == (repr(float(v.start)) if starts else None)
        initial = {"input": None, "parameter": "exact", "output": "exact" if starts else "calculated"}
        assert shown.get("initial") == initial[v.causality]
        tunable = "fixed" if getattr(v, "fixed", False) else "tunable"
        assert shown["variability"] == (tunable if isinstance(v, Parameter) else "continuous")


@by_size
@every_version
def test_every_state_has_its_derivative(name, fmi):
    model, path = MODELS[name](), native(name, fmi=fmi)
    found = variables(path, fmi)
    of = {n: int(v["derivative"]) - 1 for n, v in found.items() if "derivative" in v}
    states, order = names(model, State), list(found)
    assert sorted(of.values()) == list(range(len(states)))
    assert {r.name: r.of.name for r in model.of(Rate)}.items() <= {n: order[i] for n, i in of.items()}.items()
    listed = list(unknowns(path, fmi, "Derivative" if fmi == 2 else "ContinuousStateDerivative"))
    assert [of[order[i]] for i in listed] == list(range(len(states)))
    for n, i in of.items():
        state, rate = (base_exponents(found[m]["unit"]).exponents for m in (order[i], n))
        assert {**state, "s": state.get("s", 0) - 1} == {"s": 0, **rate}
        assert found[n]["causality"] == ("output" if n in names(model, Output) else "local")


@by_size
@every_version
def test_dependencies_are_complete(name, fmi):
    """What is not listed does not matter: moved alone, it changes no output."""
    model, path = MODELS[name](), native(name, fmi=fmi)
    order = [v["valueReference"] for v in variables(path, fmi).values()]
    outputs, initial = (unknowns(path, fmi, k) for k in ("Output", "InitialUnknown"))
    settable, states = len(model.of(State, Input, Parameter)), len(model.of(State))
    assert sorted(outputs) == [*range(states), *range(settable, settable + len(model.of(Output)))]
    assert sorted(initial) == list(range(settable, len(order) - (fmi == 3)))
    rng, h = np.random.default_rng(1), equations(model).h
    x, u, p = near_start(model, rng)
    base, moved = np.concatenate([x, u, p]), {}
    splits = [len(x), len(x) + len(u)]
    assert not any(kinds for _, kinds in initial.values())  # the standard has only some of the words for them
    y = values(h, x, u, p)
    for i, v in enumerate(model.of(State, Input, Parameter)):
        other = base.copy()
        other[i] += 1e-3 * (abs(other[i]) or v.nominal or 1.0)
        moved[i] = np.flatnonzero(values(h, *np.split(other, splits)) != y)
    for i, changed in moved.items():
        for j in changed:
            assert i in initial[settable + j][0]
            assert i in outputs[settable + j][0] or i >= len(x) + len(u)


def test_kinds_of_dependence_are_as_strong_as_they_must_be():
    found = dependencies(equations(Springs()), Springs())
    # x_dot = v; v_dot = (u - k x - x^3 c)/m0 with m0 fixed, k, c tunable
    assert found[0] == {1: "constant"}
    assert found[1] == {0: "dependent", 2: "fixed", 3: "dependent", 4: "dependent", 5: "dependent"}
    assert found[2] == {0: "tunable", 3: "dependent"}


class Springs(Model):
    """A mass on springs."""

    name = "Springs"
    step_size = 0.01
    x = State("m", doc="place", nominal=1.0)
    x_dot = State("m/s", doc="speed", nominal=1.0)
    u = Input("N", doc="force")
    k = Parameter("N/m", 3.0, doc="stiffness")
    c = Parameter("N/m3", 2.0, doc="cubic stiffness")
    m0 = Parameter("kg", 2.0, doc="mass", fixed=True)
    F = Output("N", doc="force of the linear spring")

    def derivatives(self):
        return {"x": self.x_dot, "x_dot": (self.u - self.k * self.x - self.c * self.x**3) / self.m0}

    def outputs(self):
        return {"F": -self.k * self.x}


class Decay(Model):
    """x' = -x / time, with nothing beside but a name that FMI wants for itself. */"""

    name = "Decay"
    step_size = 0.01
    x = State("1", 1.0, doc='what is "left" & <less>', nominal=1.0)
    time = Parameter("s", 1.0, min=1e-3, doc="time constant")

    def derivatives(self):
        return {"x": -self.x / self.time}


class Jumps(Springs):
    """Dependences that derivatives do not see."""

    name = "Jumps"
    F = Output("N", doc="force that a comparison switches")
    s = Output("1", doc="sign of the force outside")
    r = Output("1", doc="what is left of a rounding, and a constant share")

    def outputs(self):
        force = cs.if_else(self.x > self.c, self.u, 2 * self.u)
        return {"F": force, "s": cs.sign(self.u), "r": self.u - cs.floor(self.u) + 3 * self.x}


def test_what_a_comparison_decides_is_no_constant_dependence():
    found = dependencies(equations(Jumps()), Jumps())
    x, u, c = ([v.name for v in Jumps().settable()].index(name) for name in ("x", "u", "c"))
    assert found[2] == {x: "dependent", u: "dependent", c: "dependent"}
    assert found[3] == {u: "dependent"}
    assert found[4] == {x: "constant", u: "dependent"}


class Open(Springs):
    """Limits that are none."""

    name = "Open"
    k = Parameter("N/m", 3.0, min=0.0, max=float("inf"), doc="stiffness")
    u = Input("N", min=float("-inf"), max=float("inf"), doc="force")


@pytest.mark.parametrize("model", [Springs, Decay, Open])
@every_version
def test_small_models_are_valid_fmus(model, fmi, tmp_path):
    path = build_native(model(), tmp_path, fmi)
    assert problems(path) == []
    with Fmu(path) as fmu:
        fmu.restart(x=2.0)
        fmu.step(1.0)
        # 1e-7: the error of the fourth-order method in steps of 0.01
        if model is Decay:
            assert_allclose(fmu["x"], 2 * np.exp(-1), rtol=1e-7)
            assert fmu["x_dot"] == -fmu["x"]
    local = [n for n, v in variables(path, fmi).items() if v["causality"] == "local"]
    assert local == (["x_dot"] if model is Decay else ["der_x", "x_ddot"])


def test_names_and_units_of_derivatives_never_clash():
    assert free_name(("q_dot", "der_q"), {"q_dot", "der_q", "der_q_2"}) == "der_q_3"
    assert [rate_unit(u) for u in ("m", "rad/s", "m/s2", "1", "N.s", "s", "1/s")] == (
        ["m/s", "rad/s2", "m/s3", "1/s", "N", "1", "1/s2"]
    )


@by_size
@every_version
def test_units_and_display_units_are_defined(name, fmi):
    path = native(name, fmi=fmi)
    units = {n.get("name"): n for n in description(path).iter("Unit")}
    for v in variables(path, fmi).values():
        base = dict(units[v["unit"]].find("BaseUnit").attrib)
        assert {k: int(e) for k, e in base.items()} == base_exponents(v["unit"]).exponents
        if "displayUnit" in v:
            shown = {n.get("name"): n for n in units[v["unit"]].iter("DisplayUnit")}[v["displayUnit"]]
            of = base_exponents(v["displayUnit"])
            assert of.exponents == base_exponents(v["unit"]).exponents
            assert float(shown.get("factor")) * of.factor == pytest.approx(1)


def test_display_units_are_what_a_person_reads():
    found = variables(native("testrig"), 2)
    shown = {n: found[n].get("displayUnit") for n in ("theta_w", "omega_w", "N", "T_P", "r_w")}
    assert shown == {"theta_w": "deg", "omega_w": "rpm", "N": "kN", "T_P": None, "r_w": None}


@every_version
def test_description_offers_what_the_build_does(fmi):
    root = description(native("testrig", fmi=fmi))
    state = ("canGetAndSetFMUstate", "canSerializeFMUstate") if fmi == 2 else ("canGetAndSetFMUState",)
    derivative = ["providesDirectionalDerivative"] if fmi == 2 else ["providesDirectionalDerivatives"]
    derivative += ["providesAdjointDerivatives"] * (fmi == 3)
    for kind in ("CoSimulation", "ModelExchange"):
        offered = root.find(kind)
        assert {offered.get(k) for k in (*state, *derivative)} == {"true"}
        assert offered.get("needsExecutionTool") == "false"
        assert offered.get("canBeInstantiatedOnlyOncePerProcess") == "false"
    assert float(root.find("DefaultExperiment").get("stepSize")) == MODELS["testrig"].step_size
    assert "generationDateAndTime" not in root.attrib


def test_ports_are_terminals():
    with zipfile.ZipFile(native("testrig", fmi=3)) as packed:
        root = etree.fromstring(packed.read("terminalsAndIcons/terminalsAndIcons.xml"))
    found = {
        t.get("name"): {m.get("memberName"): m.get("variableName") for m in t} for t in root.iter("Terminal")
    }
    # the contact pushes on both shafts: no single input is its force
    assert found == {
        "wheel": {"force": "T_w_ext", "displacement": "theta_w", "velocity": "omega_w"},
        "roller": {"force": "T_r_ext", "displacement": "theta_r", "velocity": "omega_r"},
    }


def test_probes_are_terminals_of_every_port(tmp_path):
    path = build_native(MODELS["testrig"](probes=True), tmp_path, 3)
    with zipfile.ZipFile(path) as packed:
        root = etree.fromstring(packed.read("terminalsAndIcons/terminalsAndIcons.xml"))
    assert [t.get("name") for t in root.iter("Terminal")] == list(MODELS["testrig"]().ports())


@by_size
@every_version
def test_page_and_icon_are_inside(name, fmi):
    path = native(name, fmi=fmi)
    with zipfile.ZipFile(path) as packed:
        page = packed.read("documentation/index.html").decode()
        icon = "model.png" if fmi == 2 else "terminalsAndIcons/icon.png"
        with packed.open(icon) as file, Image.open(file) as picture:
            assert picture.size == (100, 100)
            assert len(picture.convert("RGB").getcolors()) > 2
    for v in MODELS[name]().variables:
        assert f"<code>{v}</code>" in page
    readme = Path(inspect.getfile(MODELS[name])).with_name("README.md")
    assert ("<h2>Equations</h2>" in page) == readme.is_file()
    assert not re.search(r"\.\./|/work|/tmp", page)


def test_the_token_goes_with_the_content(tmp_path):
    def token(path, attribute="guid"):
        return description(path).get(attribute)

    same = token(build_native(MODELS["drive"](), tmp_path / "again"))
    others = [
        token(native("drive", "all")),
        token(native("testrig")),
        token(native("drive", fmi=3), "instantiationToken"),
        token(build_native(heavier(96.0), tmp_path / "h")),
    ]
    assert token(native("drive")) == same
    assert len({same, *others}) == 5


def test_builds_elsewhere_have_the_same_bytes(tmp_path):
    script = """
        import sys
        from pathlib import Path
        from fmus.export.builders.native.build import build_native
        from fmus.models import MODELS
        for name in sys.argv[1:]:
            build_native(MODELS[name](), Path(name + ".fmu"), 3)
    """
    where = {"PYTHONHASHSEED": "4711", "PYTHONPATH": str(Path(fmus.__file__).parents[1]), "TZ": "Asia/Tokyo"}
    tried = ["drive", "testrig"]
    command = [sys.executable, "-c", textwrap.dedent(script), *tried]
    subprocess.run(command, cwd=tmp_path, env=os.environ | where, check=True)
    for name in tried:
        assert (tmp_path / f"{name}.fmu").read_bytes() == native(name, fmi=3).read_bytes()
