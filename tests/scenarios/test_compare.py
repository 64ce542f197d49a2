"""compare: two FMUs on one experiment, judged by laws that say how much they must differ."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fmus.drive.model import Drive
from fmus.effects import parse_effect
from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.host.apart.isolation import FmuEnded
from fmus.host.fmu import FmuError
from fmus.variables import Output, Parameter, State
from scenarios.comparing.comparing import compare
from tests.helpers.foreign import foreign_builder
from tests.helpers.runs import heavier

FORCE, STEP, N = 50.0, 2e-3, 501
TOML = """
id = "push"
fmu = "none.fmu"
data = "data.csv"
time = "t"
parameters = {parameters}
initial = {initial}
inputs = {inputs}

[outputs.{output}]
column = "y"
unit = "{unit}"
noise_std = 1e-3
"""
BARE = '1"\nmodel_unit = "1'  # of an FMU that states no unit


class Millimetres(Drive):
    """The drive with its place in millimetres and without the rate of its velocity."""

    name = "Drive"
    q = State("mm", doc="position of the carriage", nominal=100.0)
    F_v = Parameter("N.s/m", 200.0, min=0.0, max=1e6, doc="viscous friction")
    more = Output("1", doc="one")

    def derivatives(m):
        rates = Drive.derivatives(m)
        return {**rates, "q": 1e3 * rates["q"]}

    def outputs(m):
        return {"more": 1.0}


class Kilograms(Drive):
    """The drive with a place that is a mass."""

    name = "Drive"
    q = State("kg", doc="no position")


def experiment(folder, parameters="{}", initial="{q = 0.0, q_dot = 0.0}", output="q", unit="m", inputs=None):
    """An experiment of a force that swings, or of what `inputs` says."""
    t = STEP * np.arange(N)
    rows = np.column_stack([t, FORCE * np.sin(20 * t), 0.25 + np.zeros(N)])
    np.savetxt(folder / "data.csv", rows, delimiter=",", header="t,F,y", comments="", fmt="%.17g")
    given = '{F = "F"}' if inputs is None else inputs
    words = {"parameters": parameters, "initial": initial, "output": output, "unit": unit, "inputs": given}
    (folder / "experiment.toml").write_text(TOML.format(**words))
    return folder


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return build_python(Drive(), tmp_path_factory.mktemp("drive"))


def test_builds_of_one_model_agree(drive, tmp_path):
    native = build_native(Drive(), tmp_path / "native", fmi=3)
    said = []
    found = compare(drive, native, experiment(tmp_path), tmp_path / "out", tell=said.append)
    assert found.ok
    assert set(found.outputs) == {"q", "q_dot", "q_ddot"}
    assert all(d.relative is not None and d.relative <= 1e-9 for d in found.outputs.values())
    assert found.only_b == ("der_q", "time")  # what FMI 3.0 and model exchange ask for
    assert found.a_sha256 != found.b_sha256
    assert any("second" in line for line in said)
    table = json.loads((tmp_path / "out/result.json").read_text())
    assert table["ok"] is True
    assert (tmp_path / "out/compare.png").stat().st_size > 1000


def test_another_mass_differs_as_newton_says(drive, tmp_path):
    """At the start, with the force at its full size and no speed, by F/M1 - F/M2."""
    other = build_python(heavier(190.0), tmp_path)
    folder = experiment(tmp_path, inputs=f"{{F = {FORCE}}}")
    found = compare(drive, other, folder)
    assert not found.ok
    gap = found.outputs["q_ddot"]
    assert_allclose(gap.largest, FORCE / 95 - FORCE / 190, rtol=1e-12)
    assert gap.time == 0.0
    assert [(m.variable, m.what, m.a, m.b) for m in found.mismatches] == [("M", "start", 95.0, 190.0)]


def test_sizes_are_those_of_the_difference(drive, tmp_path):
    """Without friction and force a carriage goes on: q differs by 0.1 m/s times the time."""
    folder = experiment(tmp_path, parameters="{F_v = 0.0}", initial="{q = 0.0}", inputs="{F = 0.0}")
    faster = Drive()
    faster.variables["q_dot"] = replace(faster.variables["q_dot"], start=0.1)
    gap = compare(drive, build_python(faster, tmp_path / "b"), folder).outputs["q"]
    t = STEP * np.arange(N)
    assert_allclose(gap.largest, 0.1 * t[-1], rtol=1e-9)
    assert gap.time == t[-1]
    assert_allclose(gap.rms, np.sqrt(np.mean((0.1 * t) ** 2)), rtol=1e-9)
    assert_allclose(gap.in_noise, gap.rms / 1e-3)
    assert_allclose(gap.relative, gap.largest / 1e-7)  # at rest: over a millionth of the nominal 0.1 m
    assert_allclose(gap.rms_relative, gap.rms / 1e-7)


def test_the_experiment_s_parameters_and_states_hold_for_both(drive, tmp_path):
    """What the experiment declares is no difference; a measured state starts where it was measured."""
    other = build_python(heavier(190.0), tmp_path)
    found = compare(drive, other, experiment(tmp_path, "{M = 120.0}", initial="{q_dot = 0.0}"))
    assert found.ok
    assert found.mismatches[0].variable == "M"
    still = compare(drive, other, experiment(tmp_path, inputs="{F = 0.0}", initial="{q_dot = 0.0}"))
    assert still.ok
    assert still.outputs["q"].largest == 0.0


def test_units_are_converted_and_named(drive, tmp_path):
    other = build_python(Millimetres(), tmp_path)
    found = compare(drive, other, experiment(tmp_path, initial="{q = 0.3, q_dot = 0.0}"))
    assert found.ok
    said = {(m.variable, m.what): (m.a, m.b) for m in found.mismatches}
    assert said == {("q", "unit"): ("m", "mm"), ("F_v", "max"): (None, 1e6)}
    assert found.only_b == ("more",)
    back = compare(other, drive, experiment(tmp_path, initial="{q = 300.0, q_dot = 0.0}", unit="m"))
    assert back.ok
    assert back.only_a == ("more",)


def test_an_output_whose_units_do_not_fit_is_not_compared_and_fails(drive, tmp_path):
    other = build_python(Kilograms(), tmp_path)
    found = compare(drive, other, experiment(tmp_path, initial="{q_dot = 0.0}", output="q_dot", unit="m/s"))
    assert found.not_compared == ("q",)
    assert set(found.outputs) == {"q_dot", "q_ddot"}
    assert not found.ok
    assert "not compared" in "\n".join(found.lines())


def test_tolerance_decides(drive, tmp_path):
    other = build_python(heavier(95.0 * (1 + 1e-6)), tmp_path)
    folder = experiment(tmp_path)
    found = compare(drive, other, folder, tolerance=1e-5)
    assert found.ok
    worst = max(d.relative for d in found.outputs.values())
    assert 1e-8 < worst < 1e-5
    assert next(iter(found.outputs)) == max(found.outputs, key=lambda n: found.outputs[n].relative)
    assert not compare(drive, other, folder, tolerance=worst / 2).ok


def test_an_effect_is_only_in_the_fmu_that_has_it(drive, tmp_path):
    """Off, it changes nothing."""
    other = build_python(Drive([parse_effect("viscous_damping@carriage")]), tmp_path)
    found = compare(drive, other, experiment(tmp_path))
    assert found.ok
    assert found.only_b == ("viscous_damping_carriage_c",)


def test_versions_of_one_pythonfmu_source_do_not_meet(tmp_path):
    """In one process the second would run the first one's code and agree."""
    bodies = "self.x += dt * (self.u - self.k * self.x)", "self.x += dt * (self.u - 2 * self.k * self.x)"
    made = []
    for name, body in zip("ab", bodies, strict=True):
        (tmp_path / name).mkdir()
        made.append(foreign_builder(tmp_path / name)(body))
    folder = experiment(tmp_path, initial="{x = 1.0}", output="x", unit=BARE, inputs="{u = 0.0}")
    gap = compare(*made, folder).outputs["x"]
    n = np.arange(N)
    expected = np.abs((1 - 4 * STEP) ** n - (1 - 2 * STEP) ** n)
    assert_allclose(gap.largest, expected.max(), rtol=1e-9)


@pytest.mark.parametrize(
    ("body", "kind", "words"),
    [("return False", FmuError, "doStep|step"), ("os.abort()", FmuEnded, "ended the process that runs it")],
)
def test_an_fmu_that_fails_is_one_clear_line(tmp_path, body, kind, words):
    build = foreign_builder(tmp_path)
    good, bad = build(), build(body)
    folder = experiment(tmp_path, initial="{x = 1.0}", output="x", unit=BARE, inputs="{u = 0.0}")
    with pytest.raises(kind, match=words) as refused:
        compare(good, bad, folder)
    assert bad.name in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_no_number_is_a_difference_and_is_null(drive, tmp_path):
    build = foreign_builder(tmp_path)
    good, bad = build(), build('self.x = float("nan") if t > 0.5 else self.x')
    folder = experiment(tmp_path, initial="{x = 1.0}", output="x", unit=BARE, inputs="{u = 0.0}")
    assert compare(bad, bad, folder).outputs["x"].largest == 0.0
    found = compare(good, bad, folder, tmp_path / "out")
    assert not found.ok
    table = json.loads((tmp_path / "out/result.json").read_text())
    assert table["outputs"]["x"]["largest"] is None


def test_wrong_input_is_one_clear_line(drive, tmp_path):
    folder = experiment(tmp_path)
    foreign = foreign_builder(tmp_path)()
    for fmus, more, words in (
        ((drive, foreign), {}, "second FMU"),
        ((drive, drive), {"tolerance": -1.0}, "of 0 or more"),
        ((drive, drive), {"tolerance": float("nan")}, "of 0 or more"),
        ((drive, tmp_path / "gone.fmu"), {}, "no such FMU"),
    ):
        with pytest.raises(BadInput, match=words) as refused:
            compare(*fmus, folder, **more)
        assert "\n" not in str(refused.value)
    with pytest.raises(BadInput, match="cannot be read"):
        compare(drive, drive, tmp_path / "gone.toml")
