"""SSP packages: valid, readable by others, and the same scenario when read back."""

import json
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import distributions
from shutil import which

import numpy as np
import pandas as pd
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd, read_ssv
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.export.provenance import PLACE
from fmus.export.ssp import Component, Link, Start, System, read_package, write_package
from fmus.export.ssp.source import signal_source
from fmus.host.fmu import Fmu
from fmus.host.master.recording import read_recording
from fmus.model import Model
from fmus.models import MODELS
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from scenarios.exchange import export_ssp, import_ssp
from scenarios.exchange.toml_text import toml_text
from scenarios.simulating import run
from tests.helpers.packed import repacked, with_description
from tests.helpers.paths import ROOT
from tests.helpers.scenario_files import (
    GOOD,
    SHIPPED_FILES,
    VARIANTS,
    write,
)

INTEROP = ROOT / "tests" / "contracts" / "interop"
LOOP = """
id = "loop"
question = "Does a controller hold the speed?"
duration = 0.3
step = 1e-3
order = "gauss_seidel"
extrapolation = "linear"

[fmus.rig]
model = "testrig"
initial = {omega_w = 12.16, omega_r = 9.36}
friction = "wet"

[fmus.controller]
model = "speedcontroller"
step = 5e-3

[[connections]]
from = "rig.omega_w"
to = "controller.omega"

[[connections]]
from = "controller.T"
to = "rig.T_P"
gain = 0.5
offset = 3.0
delayed = true

[inputs]
"rig.f_sync" = 7.5
"controller.omega_set" = "12.1 + 0.1 * sin(40 * t) if t < 0.1234 else 12"

[[events]]
time = 0.2005
friction = {rig = "low"}

[[expect]]
that = "last(rig.omega_w) > 0 and 300 < count(rig.omega_w) < 302"
because = "it turns"
"""
RIDE = """
id = "ride"
question = "How does a vehicle ride?"
duration = 0.5
step = 1e-3

[fmus.vehicle]
model = "vehicle7dof"
parameters = {m1 = 30e3}
initial = {z1 = 1e-3}

[track]
kind = "spectrum"
spectrum = "erri_low"
length = 60.0
wavelengths = [3.0, 30.0]
seed = 11

[ride]
V = 20.0
on.vehicle = {axle_spacing = 2.5}

[[expect]]
that = "max(abs(vehicle.z1)) > 0"
because = "it moves"
"""
SSD = "SystemStructure.ssd"


class Emitter(Model):
    """A place in millimetres."""

    name = "Emitter"
    step_size = 1e-3
    x = State("m", 1e-3, doc="place")
    mm = Output("mm", doc="the same")

    def derivatives(self):
        return {"x": 1.0}

    def outputs(self):
        return {"mm": 1000 * self.x}


class Taker(Model):
    """Integrates a place in metres and a force."""

    name = "Taker"
    step_size = 1e-3
    area = State("m.s", doc="integral of the place")
    push = State("N.s", doc="integral of the force")
    place = Input("m", doc="a place")
    F = Input("N", doc="a force")
    k = Parameter("1", 1.0, doc="a factor")

    def derivatives(self):
        return {"area": self.k * self.place, "push": self.F}


def recorded(scenario, out):
    result = run(scenario, out)
    return result, read_recording(out / "run.parquet").data


def round_trip(folder, text, kind="python"):
    """Recordings of a scenario and of what came back of it, and the scenario file that came back."""
    file = write(folder, text)
    package = export_ssp(file, folder, kind)
    back = import_ssp(package, folder / "back")
    (one, first), (two, second) = recorded(file, folder / "one"), recorded(back, folder / "two")
    assert one.ok
    assert two.ok
    assert set(first) == set(second)
    return first, second[list(first)], back


def assert_the_same(first, second):
    size = np.abs(first.to_numpy()).max(axis=0)
    assert (np.abs(first.to_numpy() - second.to_numpy()).max(axis=0) <= 1e-12 * size).all()


def edited(package, target, pattern, replacement, file=SSD):
    """A copy of a package with part of a file replaced, which must be there."""

    def change(name, data):
        if name != file:
            return name, data
        text, count = re.subn(pattern, replacement, data.decode(), flags=re.DOTALL)
        assert count, pattern
        return name, text.encode()

    return repacked(package, target, change)


@pytest.fixture(scope="module")
def ride(tmp_path_factory):
    """A native package of a vehicle on a track, and the folder of its scenario."""
    folder = tmp_path_factory.mktemp("ride")
    return export_ssp(write(folder, RIDE), folder)


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    return export_ssp(write(folder, LOOP), folder, "python")


def test_a_scenario_comes_back_as_it_was(tmp_path):
    first, second, back = round_trip(tmp_path, GOOD + "window = [0.5, 1.5]\n")
    assert_the_same(first, second)
    table = tomllib.loads(back.read_text(encoding="utf-8"))
    assert table["expect"][0]["because"] == "Newton"
    panel = table["figure"][0]["panels"][0]
    assert (panel["draw"], panel["window"]) == (["drive.q_dot", "sensors.speed"], [0.5, 1.5])
    readings = [read_recording(tmp_path / n / "run-measured.parquet").data for n in ("one", "two")]
    assert_the_same(*readings)


def test_a_loop_with_steps_delay_and_an_event_amid_a_step_comes_back(tmp_path):
    assert_the_same(*round_trip(tmp_path, LOOP)[:2])


def test_a_track_comes_back_to_the_last_bit(tmp_path):
    """The data hold the track at all times at which the master reads it."""
    first, second, _ = round_trip(tmp_path, RIDE)
    assert (first.to_numpy() == second.to_numpy()).all()


@pytest.mark.slow
@pytest.mark.parametrize("file", SHIPPED_FILES, ids=lambda file: file.stem)
def test_shipped_scenarios_come_back(file, tmp_path):
    from scenarios.simulating.reading import load_scenario

    scenario = load_scenario(file)
    if scenario.declared.contact or any(d.contact for d in scenario.variants.values()):
        pytest.skip("is a scenario of a contact table without FMUs")
    name = next(iter(scenario.variants))
    run(file, tmp_path / "one")
    package = export_ssp(file, tmp_path, "python", variant=name)
    result = run(import_ssp(package, tmp_path / "back"), tmp_path / "two")
    assert result.ok
    first, second = (
        read_recording(p).data for p in (tmp_path / "one" / f"{name}.parquet", tmp_path / "two/run.parquet")
    )
    chosen = scenario.variants[name].record.names  # SSP does not say what is recorded: all outputs are
    both = list(chosen or second)
    assert_the_same(first[both], second[both])


def test_structure_and_values_obey_the_schema(ride, loop):
    for package in (ride, loop):
        assert read_ssd(str(package)).version == "1.0"
        with zipfile.ZipFile(package) as packed:
            sets = [n for n in packed.namelist() if n.endswith(".ssv")]
            assert packed.namelist()[0] == SSD
        assert sets
        for name in sets:
            assert read_ssv(str(package), resource=name).parameters


def test_the_structure_says_what_the_scenario_does(loop):
    system, files = read_package(loop)
    parts = {c.name: c for c in system.components}
    assert list(parts) == ["rig", "inputs_controller", "controller"]
    assert (system.stop, system.step, parts["controller"].step) == (0.3, 1e-3, 5e-3)
    assert parts["rig"].start["mu0"] == Start(0.2, "1")  # wet
    assert parts["rig"].start["omega_w"] == Start(12.16, "rad/s")
    assert parts["rig"].start["f_sync"] == Start(7.5, "Hz")
    assert {c.name: c.unit for c in parts["rig"].connectors if c.kind == "input"} == {"T_P": "N.m"}
    lines = {link.target: (link.source, link.gain, link.offset) for link in system.links}
    assert lines["rig", "T_P"] == (("controller", "T"), 0.5, 3.0)
    assert lines["controller", "omega_set"] == (("inputs_controller", "omega_set"), 1.0, 0.0)
    assert json.loads(files[PLACE])["fmus"]["resources/rig.fmu"]["model"] == "Testrig"


def test_units_are_converted_once(tmp_path):
    """From mm to m, and by a spring to N, through the package and back: by hand, x = 1 mm + t."""
    for model in (Emitter, Taker):
        build_python(model(), tmp_path)
    text = """
        id = "units"
        question = "?"
        duration = 1.0
        step = 1e-2
        extrapolation = "linear"
        fmus.a.fmu = "Emitter.fmu"
        fmus.b.fmu = "Taker.fmu"
        fmus.b.parameters = {k = 2.0}
        connections = [
            {from = "a.mm", to = "b.place", gain = 3.0, offset = 0.5},
            {from = "a.mm", to = "b.F", gain = 7.0, gain_unit = "N/m"},
        ]
        expect = [{that = "count(b.area) > 1", because = "it runs"}]
    """
    first, second, _ = round_trip(tmp_path, text)
    assert_the_same(first, second)
    assert_allclose(first["b.area"].iloc[-1], 2 * (3 * (1e-3 + 0.5) + 0.5), rtol=1e-4)  # first step held
    assert_allclose(first["b.push"].iloc[-1], 7 * (1e-3 + 0.5), rtol=1e-4)
    system, _ = read_package(tmp_path / "units.ssp")
    assert [(link.gain, link.offset, link.plain) for link in system.links] == [
        (pytest.approx(3e-3), 0.5, True),
        (pytest.approx(7e-3), 0.0, True),
    ]


def test_the_same_scenario_gives_the_same_bytes(loop, tmp_path):
    again = export_ssp(loop.parent / "scenario.toml", tmp_path / "again.ssp", "python")
    assert again.read_bytes() == loop.read_bytes()


def told(script, *arguments):
    """Rows that a script prints, in a process of its own."""
    command = [sys.executable, INTEROP / script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    return np.array([line.split()[1:] for line in done.stdout.splitlines() if line[:4] == "row "], float)


def installed(*packages):
    missing = set(packages) - {d.name.replace("_", "-") for d in distributions()}
    if missing:
        pytest.skip(f"not installed: {', '.join(sorted(missing))}; pip install brings it")


MOTION = [f"vehicle.{q}{dot}" for q in ("z1", "phi_y1", "phi_x1", "z2", "z3") for dot in ("", "_dot")]


def ours(package, folder):
    """What our master makes of the scenario, at all of its times."""
    _, data = recorded(package.parent / "scenario.toml", folder)
    return data[MOTION].to_numpy()


def agree(found, expected):
    """A tool's clock may be a product or count nanoseconds, ours is a sum: the last bits of a step differ."""
    assert found.shape == expected.shape
    assert (np.abs(found - expected).max(axis=0) <= 1e-9 * np.abs(expected).max(axis=0)).all()


def test_ecos_runs_it(ride, tmp_path):
    installed("ecospy", "tbb")
    agree(told("ssp_ecos.py", ride, 1e-3, 500, *MOTION), ours(ride, tmp_path))


def test_libcosim_runs_it_with_the_step_that_it_names(ride, tmp_path):
    installed("libcosimpy")
    with zipfile.ZipFile(ride) as packed:
        packed.extractall(tmp_path / "unpacked")
    agree(told("ssp_libcosim.py", tmp_path / "unpacked", 500, *MOTION), ours(ride, tmp_path)[1:])


def test_omsimulator_runs_it(ride, tmp_path):
    """Its rows begin at time 0; its clock and ours differ in the last bits."""
    program = which("OMSimulator") or pytest.skip("OMSimulator is not on the path; its authors publish it")
    options = ["--stopTime=0.5", "--intervals=500", "--resultFile=found.csv", "--stripRoot=true"]
    done = subprocess.run(
        [program, *options, ride], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]
    found = pd.read_csv(tmp_path / "found.csv").drop_duplicates("time", keep="last")
    agree(found[MOTION].to_numpy(), ours(ride, tmp_path))


def test_fmpy_runs_it(tmp_path):
    """FMPy's first step knows no connection, so the rail rises later; its rows are a step early."""
    text = re.sub(
        r"\[track\].*?(?=\[\[expect)",
        '[inputs]\n"vehicle.u_fl" = "2e-3 * step(t - 0.05)"\n\n',
        RIDE,
        flags=re.DOTALL,
    )
    package = export_ssp(write(tmp_path, text), tmp_path)
    found = simulate_ssp(str(package), stop_time=0.4995, step_size=1e-3)
    agree(np.array([found[n] for n in MOTION]).T, ours(package, tmp_path / "out")[1:])


def test_other_tools_start_from_the_scenario_even_where_they_read_no_values(loop, tmp_path):
    """The values are start values of the FMUs too."""
    with zipfile.ZipFile(loop) as packed:
        packed.extract("resources/rig.fmu", tmp_path)
    with Fmu(tmp_path / "resources/rig.fmu") as rig:
        rig.restart()
        assert rig.read(["omega_w", "omega_r", "mu0", "f_sync"]) == [12.16, 9.36, 0.2, 7.5]


def test_the_source_alone_drives_it_too(ride, tmp_path):
    """Without our notes a package is FMUs and connections alone; these run as in any other tool."""
    bare = repacked(ride, tmp_path / "bare.ssp", lambda n, d: None if n.startswith("extra/") else (n, d))
    notes = r"<ssc:Annotation type=\"org.railfmi\">.*?</ssc:Annotation>"
    bare = edited(bare, tmp_path / "barer.ssp", notes, "")
    file = import_ssp(bare, tmp_path / "back")
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    assert set(table["fmus"]) == {"inputs_vehicle", "vehicle"}
    assert "finite" in table["expect"][0]["because"]
    result, data = recorded(file, tmp_path / "out")
    assert result.ok
    agree(data[MOTION].to_numpy(), ours(ride, tmp_path / "ours"))


def test_what_is_changed_in_a_package_counts(loop, tmp_path):
    other = edited(loop, tmp_path / "other.ssp", r'stopTime="0.3"', 'stopTime="0.1"')
    value = r'(<ssv:Parameter name="omega_w">\s*<ssv:Real value=)"12.16"'
    other = edited(other, tmp_path / "more.ssp", value, r'\1"11.0"', "resources/rig.ssv")
    table = tomllib.loads(import_ssp(other, tmp_path / "back").read_text(encoding="utf-8"))
    assert table["duration"] == 0.1
    assert table["fmus"]["rig"]["initial"]["omega_w"] == 11.0


def test_a_value_in_another_unit_is_converted(loop, tmp_path):
    value = r'(<ssv:Parameter name="omega_w">\s*<ssv:Real value=)"12.16" unit="rad/s"'
    other = edited(loop, tmp_path / "other.ssp", value, r'\1"60" unit="rpm"', "resources/rig.ssv")
    table = tomllib.loads(import_ssp(other, tmp_path / "back").read_text(encoding="utf-8"))
    assert table["fmus"]["rig"]["initial"]["omega_w"] == pytest.approx(2 * np.pi)


MAPPING = """<ssm:ParameterMapping version="1.0"
    xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssm:MappingEntry source="set.omega_w" target="omega_w">
    <ssc:LinearTransformation factor="0.5" offset="1.0"/></ssm:MappingEntry>
  <ssm:MappingEntry source="set.omega_w" target="omega_r"/>
  <ssm:MappingEntry source="set.not_there" target="theta_w"/>
</ssm:ParameterMapping>"""


@pytest.mark.parametrize(
    ("more", "expected"),
    [("", 2 * np.pi * 0.5 + 1), (' suppressUnitConversion="true"', 60 * 0.5 + 1)],
)
def test_a_mapping_changes_a_value_behind_its_conversion(loop, tmp_path, more, expected):
    value = r'(<ssv:Parameter name="omega_w">\s*<ssv:Real value=)"12.16" unit="rad/s"'
    other = edited(loop, tmp_path / "other.ssp", value, r'\1"60" unit="rpm"', "resources/rig.ssv")
    first = '<ssm:MappingEntry source="set.omega_w" target="omega_w"'
    within = f">{MAPPING.replace(first, first + more)}</ssd:ParameterMapping></ssd:ParameterBinding>"
    binding = '<ssd:ParameterBinding source="resources/rig.ssv" prefix="set."><ssd:ParameterMapping source=""'
    pattern = r'<ssd:ParameterBinding source="resources/rig.ssv" />'
    mapped = edited(other, tmp_path / "mapped.ssp", pattern, binding + within)
    table = tomllib.loads(import_ssp(mapped, tmp_path / "back").read_text(encoding="utf-8"))
    assert table["fmus"]["rig"]["initial"]["omega_w"] == pytest.approx(expected)
    assert table["fmus"]["rig"]["initial"]["omega_r"] == pytest.approx(2 * np.pi)


@pytest.mark.parametrize("inline", [False, True])
def test_parameters_go_where_a_mapping_says(loop, tmp_path, inline):
    """Two targets of one value, a factor and an offset, a prefix, and names of no variable."""
    inner = f">{MAPPING}</ssd:ParameterMapping>" if inline else ' source="m.ssm"/>'
    binding = f'<ssd:ParameterBinding source="resources/rig.ssv" prefix="set."><ssd:ParameterMapping{inner}'
    pattern = r'<ssd:ParameterBinding source="resources/rig.ssv" />'
    other = edited(loop, tmp_path / "other.ssp", pattern, f"{binding}</ssd:ParameterBinding>")
    with zipfile.ZipFile(other, "a") as packed:
        packed.writestr("m.ssm", MAPPING)
    said = []
    table = tomllib.loads(import_ssp(other, tmp_path / "back", said.append).read_text(encoding="utf-8"))
    assert table["fmus"]["rig"]["initial"] == {"omega_w": 7.08, "omega_r": 12.16}
    left_out = [line for line in said if "is not in its FMU and is left out" in line]
    assert any("'set.omega_r' of component 'rig'" in line for line in left_out)
    assert not any("omega_w'" in line for line in left_out)


@pytest.mark.parametrize(
    ("name", "unit", "line"),
    [("T_P", "kN.m", (500.0, 3000.0)), ("T", "kN.m", (0.0005, 3.0)), ("T", "N.m", (0.5, 3.0))],
)
def test_units_of_connectors_count_between_those_of_the_fmus(loop, tmp_path, name, unit, line):
    """T_P = 0.5 T + 3 without conversion, in the numbers at the connectors."""
    pattern = rf'(<ssd:Connector name="{name}" kind="\w+">\s*<ssc:Real unit=)"[^"]*"'
    other = edited(loop, tmp_path / "other.ssp", pattern, rf'\1"{unit}"')
    table = tomllib.loads(import_ssp(other, tmp_path / "back").read_text(encoding="utf-8"))
    [wire] = [w for w in table["connections"] if w["to"] == "rig.T_P"]
    assert (wire["gain"], wire["offset"]) == pytest.approx(line)


@pytest.mark.parametrize("suppressed", [True, False])
def test_a_connector_converts_where_fmus_have_the_same_unit(loop, tmp_path, suppressed):
    """From rad/s through a connector in rpm into rad/s."""
    pattern = r'(<ssd:Connector name="omega" kind="input">\s*<ssc:Real unit=)"[^"]*"'
    other = edited(loop, tmp_path / "other.ssp", pattern, r'\1"rpm"')
    if not suppressed:
        words = r'(startConnector="omega_w"[^>]*) suppressUnitConversion="true"'
        other = edited(other, tmp_path / "more.ssp", words, r"\1")
    table = tomllib.loads(import_ssp(other, tmp_path / "back").read_text(encoding="utf-8"))
    [wire] = [w for w in table["connections"] if w["to"] == "controller.omega"]
    assert wire.get("gain", 1.0) == pytest.approx(2 * np.pi / 60 if suppressed else 1.0)


@pytest.mark.parametrize("unit", ["rpm", "rad/s"])
def test_a_value_without_a_unit_is_in_that_of_its_connector(loop, tmp_path, unit):
    value = r'(<ssv:Parameter name="omega_w">\s*<ssv:Real value=)"12.16" unit="rad/s"'
    other = edited(loop, tmp_path / "other.ssp", value, r'\1"60"', "resources/rig.ssv")
    more = f'<ssd:Connector name="omega_w" kind="output"><ssc:Real unit="{unit}"/></ssd:Connector>'
    text = r'<ssd:Connector name="omega_w" kind="output">\s*<ssc:Real unit="rad/s" />\s*</ssd:Connector>'
    other = edited(other, tmp_path / "named.ssp", text, more)
    table = tomllib.loads(import_ssp(other, tmp_path / "back").read_text(encoding="utf-8"))
    assert table["fmus"]["rig"]["initial"]["omega_w"] == pytest.approx(2 * np.pi if unit == "rpm" else 60)


def test_what_hangs_on_the_system_s_own_connectors_is_left_out_and_told(loop, tmp_path):
    outer = '<ssd:Connectors><ssd:Connector name="speed" kind="output"/></ssd:Connectors><ssd:Elements>'
    other = edited(loop, tmp_path / "other.ssp", "<ssd:Elements>", outer)
    wire = (
        '<ssd:Connection startElement="rig" startConnector="omega_w" endConnector="speed"/></ssd:Connections>'
    )
    other, said = edited(other, tmp_path / "more.ssp", "</ssd:Connections>", wire), []
    table = tomllib.loads(import_ssp(other, tmp_path / "back", said.append).read_text(encoding="utf-8"))
    assert any("rig.omega_w -> system.speed" in line for line in said)
    assert [wire["to"] for wire in table["connections"]] == ["controller.omega", "rig.T_P"]


def test_a_package_without_an_end_runs_for_a_second_and_says_so(loop, tmp_path):
    other, said = edited(loop, tmp_path / "other.ssp", r' stopTime="0.3"', ""), []
    table = tomllib.loads(import_ssp(other, tmp_path / "back", said.append).read_text(encoding="utf-8"))
    assert table["duration"] == 1.0
    assert any("states no stopTime" in line for line in said)


def test_a_system_around_the_system_changes_no_result(loop, tmp_path):
    """The FMUs one level further down, in a package of SSP 2.0: other names, the same wires."""

    def inward(name, data):
        if name != SSD:
            return name, data
        text = re.sub(r'version="1.0" name', 'version="2.0" name', data.decode())
        begin, end = text.index("<ssd:System "), text.index("</ssd:System>") + len("</ssd:System>")
        inner = text[begin:end]
        outer = f'<ssd:System name="outer"><ssd:Elements>{inner}</ssd:Elements></ssd:System>'
        return name, (text[:begin] + outer + text[end:]).encode()

    tables = [
        tomllib.loads(import_ssp(package, tmp_path / folder).read_text(encoding="utf-8"))
        for package, folder in ((loop, "flat"), (repacked(loop, tmp_path / "in.ssp", inward), "deep"))
    ]
    inner = next(iter(tables[1]["fmus"])).removesuffix(next(iter(tables[0]["fmus"])))
    assert inner.endswith("_")
    assert {f"{inner}{name}": fmu for name, fmu in tables[0]["fmus"].items()} == tables[1]["fmus"]
    assert [
        {k: f"{inner}{v}" if k in ("from", "to") else v for k, v in wire.items() if k != "delayed"}
        for wire in tables[0]["connections"]
    ] == [{k: v for k, v in wire.items() if k != "delayed"} for wire in tables[1]["connections"]]


def test_a_file_that_was_changed_is_told(loop, tmp_path):
    name, said = "resources/inputs_controller.csv", []
    other = edited(loop, tmp_path / "other.ssp", "$", "\n", name)
    import_ssp(other, tmp_path / "back", said.append)
    assert any(name in line and "was changed" in line for line in said)
    said.clear()
    import_ssp(loop, tmp_path / "sound", said.append)
    assert said == []


@pytest.mark.parametrize(
    ("pattern", "replacement", "words"),
    [
        (r'version="1.0" name', 'version="3.0" name', "SSP 3.0"),
        (r"<ssd:Elements>", "<ssd:Elemente>", "no XML"),
        (r'kind="input"', 'kind="entrance"', "schema"),
        (r'source="resources/rig.fmu"', 'source="resources/gone.fmu"', "'resources/gone.fmu', which is not"),
        (r'source="resources/rig.fmu"', 'type="text/x" source="resources/rig.fmu"', "type text/x"),
        (
            r'source="resources/rig.ssv"',
            'source="resources/gone.ssv"',
            "'resources/gone.ssv', which is missing",
        ),
        (r'endElement="rig"', 'endElement="rigg"', "there is no component 'rigg'"),
        (r'startTime="0.0"', 'startTime="1.0"', "startTime 0"),
        (
            r'<ssd:ParameterBinding source="resources/rig.ssv" />',
            '<ssd:ParameterBinding source="resources/rig.ssv"><ssd:ParameterMapping source="m.ssm"/>'
            "</ssd:ParameterBinding>",
            "the mapping of parameters of 'rig' is 'm.ssm', which is missing",
        ),
    ],
)
def test_a_bad_structure_is_one_clear_line(loop, tmp_path, pattern, replacement, words):
    other = edited(loop, tmp_path / "bad.ssp", pattern, replacement)
    with pytest.raises(BadInput, match=re.escape(words)) as refused:
        import_ssp(other, tmp_path / "back")
    assert str(refused.value).startswith(str(other))
    assert "\n" not in str(refused.value)


def test_a_bad_file_is_one_clear_line(loop, tmp_path):
    (tmp_path / "text.ssp").write_text("no package")
    with zipfile.ZipFile(tmp_path / "outside.ssp", "w") as packed:
        packed.writestr("../evil.txt", "x")
    empty = repacked(loop, tmp_path / "empty.ssp", lambda n, d: None if n == SSD else (n, d))
    for file, words in (
        (tmp_path / "text.ssp", "zip"),
        (tmp_path / "gone.ssp", "zip"),
        (tmp_path / "outside.ssp", "leads outside"),
        (empty, "no SystemStructure.ssd"),
    ):
        with pytest.raises(BadInput, match=words):
            import_ssp(file, tmp_path / "back")
    assert not (tmp_path / "evil.txt").exists()


def test_one_variant_is_packed_and_must_be_named(tmp_path):
    joint = '[[expect]]\nthat = "last(light.drive.q) > last(heavy.drive.q)"\nbecause = "lighter"\n'
    file, said = write(tmp_path, GOOD + joint + VARIANTS), []
    with pytest.raises(BadInput, match="light, heavy"):
        export_ssp(file, tmp_path, "python")
    with pytest.raises(BadInput, match="did you mean 'heavy'"):
        export_ssp(file, tmp_path, "python", variant="heavi")
    package = export_ssp(file, tmp_path, "python", variant="heavy", tell=said.append)
    assert package.name == "carriage_heavy.ssp"
    assert any("1 expectations" in line for line in said)
    table = tomllib.loads(import_ssp(package, tmp_path / "back").read_text(encoding="utf-8"))
    assert table["fmus"]["drive"]["parameters"]["M"] == 500.0
    assert table["inputs"] == {"drive.F": 30.0}
    assert len(table["expect"]) == 1


def test_a_contact_table_is_refused(tmp_path):
    text = 'id = "c"\nquestion = "?"\n[contact]\n[[expect]]\nthat = "1 > 0"\nbecause = "x"\n'
    with pytest.raises(BadInput, match="contact table"):
        export_ssp(write(tmp_path, text), tmp_path)


@pytest.mark.parametrize("step", [1e-3, 0.7e-3, 1e-2])
def test_a_source_gives_the_signal_of_the_middle_of_a_step(tmp_path, step):
    rng = np.random.default_rng(3)
    values = rng.standard_normal((101, 2))
    signals = {"V": ("m/s", values[:, 0]), "y_irr": (None, values[:, 1])}
    model = signal_source("inputs_x", step, step / 2, signals)
    with Fmu(build_python(model, tmp_path)) as source:
        source.restart()
        for k in range(50):
            assert source.read(["V", "y_irr"]) == values[2 * k + 1].tolist()
            source.step(step)
        source.restart(ahead=0.0)
        source.step(0.25 * step)  # between the entries: straight lines
        assert source["V"] == pytest.approx((values[0, 0] + values[1, 0]) / 2)


KEYS = st.text(min_size=1, max_size=8)
SCALARS = st.one_of(
    st.booleans(),
    st.integers(-(2**62), 2**62),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=12),
)
TABLES = st.recursive(
    st.dictionaries(
        KEYS.filter(lambda k: k.isprintable()), st.one_of(SCALARS, st.lists(SCALARS, max_size=3)), max_size=3
    ),
    lambda inner: st.dictionaries(
        KEYS.filter(lambda k: k.isprintable()),
        st.one_of(inner, st.lists(inner, min_size=1, max_size=2), SCALARS),
        max_size=3,
    ),
    max_leaves=6,
)


@given(TABLES)
def test_toml_that_is_written_is_read_again(table):
    assert tomllib.loads(toml_text(table)) == table


def test_a_package_whose_variables_have_brackets_is_imported_and_run(tmp_path):
    """Names as Modelica's tools give them, in connections, values and expectations."""
    plain, named = build_python(MODELS["drive"](), tmp_path / "plain"), tmp_path / "named.fmu"
    for old, new in (("q_dot", "der(body[1].q)"), ("F_ext", "body[1].f[2,1]"), ("M", "body[1].mass of it")):
        replacement = f'name="{new}"'.encode()
        with_description(plain, named, f'name="{old}"'.encode(), replacement)
        plain = named.rename(tmp_path / f"{old}.fmu")
    fmu = Component(
        "a", "resources/a.fmu", start={"body[1].mass of it": Start(50.0, "kg"), "F": Start(1.0, "N")}
    )
    other = Component("b", "resources/b.fmu")
    system = System(
        name="brackets",
        components=(fmu, other),
        links=(Link(("a", "der(body[1].q)"), ("b", "body[1].f[2,1]"), gain=100.0),),
        stop=0.1,
        step=0.01,
    )
    data = {c.source: plain.read_bytes() for c in (fmu, other)}
    scenario = import_ssp(write_package(system, data, tmp_path / "it.ssp"), tmp_path / "back")
    result = run(scenario, tmp_path / "out")
    assert result.ok
    table = tomllib.loads(scenario.read_text(encoding="utf-8"))
    assert 'max(abs("a.der(body[1].q)")) < 1e300' in table["expect"][0]["that"]
    recorded = read_recording(result.folder / next(iter(result.runs.values())).recording).data
    assert np.abs(recorded["b.q"]).max() > 0  # pushed through the connection
