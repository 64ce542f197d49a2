"""Scenarios run: results, recordings, sensors, verdicts, the same bits, and Ctrl-C."""

import json
import os
import signal

import numpy as np
import pytest

from fmus.contact.forces.conditions import CONDITIONS
from fmus.errors import BadInput
from fmus.export.builders import script
from fmus.host.fmu import FmuError
from fmus.host.master.recording import read_recording
from fmus.model import equations
from fmus.models import model_class
from fmus.variables import Input, Parameter, State
from scenarios.simulating import run, run_all
from tests.helpers.paths import ROOT, SHIPPED
from tests.helpers.scenario_files import (
    GOOD,
    VARIANTS,
    edited,
    ran,
    write,
)


def test_a_scenario_leaves_its_result_recording_readings_and_figure(tmp_path):
    result, written = ran(tmp_path)
    assert result.ok
    assert written["ok"] is True
    assert written["expectations"][0]["holds"] is True
    assert written["runs"]["run"]["speed"] > 0
    recording = read_recording(tmp_path / "out" / written["runs"]["run"]["recording"])
    assert recording.units["drive.q_dot"] == "m/s"
    np.testing.assert_allclose(np.diff(recording.data["time"]), 2e-3)
    measured = read_recording(tmp_path / "out" / written["runs"]["run"]["measured"])
    np.testing.assert_allclose(np.diff(measured.data["time"]), 0.02)
    true = np.interp(measured.data["time"], recording.data["time"], recording.data["drive.q_dot"])
    assert 0.5e-3 < np.std(measured.data["speed"] - true) < 2e-3
    assert (tmp_path / "out" / "speed.png").read_bytes().startswith(b"\x89PNG")
    assert written["figures"] == ["speed.png"]


def test_an_event_acts_at_its_time(tmp_path):
    ran(tmp_path, edited(GOOD, ("[record]", '[record]\nnames = ["drive.F_v", "drive.q"]')))
    data = read_recording(tmp_path / "out" / "run.parquet").data
    np.testing.assert_array_equal(data["drive.F_v"], np.where(data["time"] < 1.0, 100.0, 400.0))


def test_what_does_not_come_true_is_said_with_its_numbers(tmp_path):
    more = edited(GOOD, ("< 1e-9", "> 1")) + '\n[[expect]]\nthat = "1 < 2"\nbecause = "numbers"\n'
    more += '\n[[expect]]\nthat = "crossing(drive.q, 1e9) < 1"\nbecause = "it gets far"\n'
    more += '\n[[expect]]\nthat = "growth(before(drive.q, 0.1)) < 1"\nbecause = "it swings"\n'
    result, written = ran(tmp_path, more)
    assert not result.ok
    assert written["ok"] is False
    assert [f["holds"] for f in written["expectations"]] == [False, True, False, False]
    assert written["expectations"][0]["values"][1] == 1
    assert written["expectations"][2]["values"] == [None, 1.0]
    assert "a growth needs three" in written["expectations"][3]["problem"]
    assert len(result.failed) == 3
    assert "max(abs(" in result.failed[0].sentence


DIVERGING = """
id = "diverging"
question = "Does what is not finite pass for small?"
duration = 2.0
step = 0.1

[fmus.a]
fmu = "{fmu}"

[[expect]]
that = "not (max(abs(a.x)) > 100)"
because = "it stays small"
"""


def test_a_signal_that_is_not_finite_is_not_small(tmp_path, foreign):
    fmu = foreign('self.x = float("nan") if t > 0.95 else 1.0')
    result, written = ran(tmp_path, DIVERGING.format(fmu=fmu))
    assert not result.ok
    [finding] = written["expectations"]
    assert finding["holds"] is False
    assert finding["values"] == [None, 100.0]
    assert "signal 'a.x' is not finite from t = 1.1 s on" in finding["problem"]
    assert "a.x" in result.failed[0].sentence


def test_expectations_go_through_the_variants(tmp_path):
    more = '\n[[expect]]\nthat = "span(light.drive.q_dot) > span(heavy.drive.q_dot)"\nbecause = "inertia"\n'
    more += '\n[[expect]]\nthat = "max(abs(drive.F)) < 99"\nbecause = "soft"\nvariants = ["heavy"]\n'
    result, written = ran(tmp_path, GOOD + VARIANTS + more)
    assert result.ok
    assert [f["variant"] for f in written["expectations"]] == ["light", "heavy", None, "heavy"]
    assert sorted(written["runs"]) == ["heavy", "light"]


def test_csv_columns_of_files_and_tables_are_inputs(tmp_path):
    t = np.linspace(0, 2, 21)
    rows = "\n".join(f"{a:.17g},{1e-3 * a:.17g}" for a in t)
    write(tmp_path, f"t,kN\n{rows}\n", "force.csv")
    column = '{data = "force.csv", time = "t", column = "kN", unit = "kN", factor = 2.0}'
    table = "{times = [0, 2], values = [0, 4]}"
    found = []
    for i, given in enumerate((column, table)):
        text = edited(GOOD, ('"100 * sin(2 * pi * t)"', given), ("[record]", '[record]\nformat = "csv"'))
        assert ran(tmp_path / str(i), text.replace("force.csv", "../force.csv"))[0].ok
        found.append(read_recording(tmp_path / str(i) / "out" / "run.csv"))
    np.testing.assert_allclose(found[0].data, found[1].data, rtol=1e-12, atol=1e-15)
    assert found[0].units["drive.q"] == "m"


BARE = """
id = "bare"
question = "Is a force in kN converted for an FMU that states no units?"
duration = 2.0
step = 0.1

[fmus.a]
fmu = "{fmu}"

[inputs]
"a.u" = {{data = "force.csv", time = "t", column = "kN", {units}}}

[[expect]]
that = "abs(last(a.x) - 3000) < 1e-6"
because = "a force of 3 kN is 3000 N"
"""


def test_a_column_for_an_fmu_without_units_needs_the_model_unit(tmp_path, foreign):
    write(tmp_path, "t,kN\n0,3\n2,3\n", "force.csv")
    fmu = foreign("self.x = self.u")
    assert ran(tmp_path, BARE.format(fmu=fmu, units='unit = "kN", model_unit = "N"'))[0].ok
    for units, words in (
        ('unit = "kN"', "states no unit for 'a.u' to convert it to; write model_unit"),
        ('unit = "kN", model_unit = "newton"', "unit 'newton' is not known"),
        ('unit = "kN", model_unit = "m"', "unit 'kN' does not fit 'm'"),
    ):
        with pytest.raises(BadInput) as refused:
            ran(tmp_path, BARE.format(fmu=fmu, units=units))
        assert words in str(refused.value)
        assert "scenario.toml" in str(refused.value)


def test_friction_by_name_sets_table_4_1_and_parameters_have_the_last_word(tmp_path):
    text = edited(
        GOOD,
        ('model = "drive"', 'model = "testrig"\nfriction = "low"'),
        ("{M = 50.0, F_v = 100.0}", "{A = 0.5}"),
        ("{q_dot = 0.5}", "{omega_w = 12.2, omega_r = 9.4}"),
        ('"drive.F" = "100', '"drive.T_P" = "100'),
        ('set = {"drive.F_v" = 400.0}', 'friction = {drive = "very_low"}'),
        ("drive.q_dot", "drive.omega_w"),
        ('unit = "mm/s"', 'unit = "rad/s"'),
        ("max(abs(drive.M * drive.q_ddot + drive.F_v * drive.omega_w - drive.F)) < 1e-9", "1 < 2"),
        ("[record]", '[record]\nnames = ["drive.mu0", "drive.k_A", "drive.A"]'),
    ).replace("drive.q_ddot", "drive.omega_w")
    assert ran(tmp_path, text)[0].ok
    data = read_recording(tmp_path / "out" / "run.parquet").data
    assert data["drive.mu0"].iloc[0] == CONDITIONS["low"]["mu0"]
    assert data["drive.A"].iloc[0] == 0.5
    assert data["drive.mu0"].iloc[-1] == CONDITIONS["very_low"]["mu0"]
    assert data["drive.k_A"].iloc[-1] == CONDITIONS["very_low"]["k_A"]


def test_the_same_scenario_gives_the_same_bits(tmp_path):
    for name in ("first", "second"):
        run(write(tmp_path, GOOD + VARIANTS), tmp_path / name)
    names = sorted(p.name for p in (tmp_path / "first").iterdir())
    assert len(names) == 6
    for name in names:
        if name != "result.json":
            assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes(), name


def test_fmus_give_the_numbers_of_plain_casadi(tmp_path):
    """The vehicle on its step, through FMU and master, against the model's own equations."""
    result = run(SHIPPED / "step_of_both_bogies.toml", tmp_path)
    assert result.ok
    recording = read_recording(tmp_path / "run.parquet")
    model = model_class("vehicle7dof")()
    eq = equations(model)
    x = np.array([v.start for v in model.of(State)])
    p = np.array([v.start for v in model.of(Parameter)])
    inputs = [v.name for v in model.of(Input)]
    u = np.zeros(len(inputs))
    rails = [inputs.index(f"u_{c}") for c in ("fl", "fr", "rl", "rr")]
    rows = [x]
    for k in range(8000):
        u[rails] = 1e-3 * ((k + 0.5) * 1e-3 >= 1.0)
        x = eq.step(x, u, p, 1e-3)[0].full().ravel()
        rows.append(x)
    found = recording.data[[f"vehicle.{v.name}" for v in model.of(State)]].to_numpy()
    plain = np.array(rows)
    np.testing.assert_allclose(found, plain, rtol=1e-9, atol=1e-9 * np.abs(plain).max(axis=0).min())


def test_a_broken_vehicle_does_not_pass(tmp_path):
    """The shipped expectations can fail: a weak spring rolls the coach, a stiffer one rings faster."""
    text = (SHIPPED / "step_of_both_bogies.toml").read_text(encoding="utf-8")
    for change, failing in (("h_k1_fl = 0.5", "phi_x1"), ("k1 = 500e3", "frequency")):
        text_then = edited(
            text, ('model = "vehicle7dof"', f'model = "vehicle7dof"\nparameters = {{{change}}}')
        )
        result = run(write(tmp_path, text_then), tmp_path / "out")
        assert any(failing in finding.that for finding in result.failed)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_was_recorded_and_judges_nothing(tmp_path):
    told = []

    def press(line):
        told.append(line)
        if "times real time" in line and len(told) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    text = edited(GOOD, ("duration = 2.0", "duration = 2000.0"), ("rate = 50.0", "rate = 1.0")) + VARIANTS
    result = run(write(tmp_path, text), tmp_path / "out", tell=press)
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert 0 < written["interrupted_at"] < 2000
    assert not result.ok
    assert (written["expectations"], written["figures"], list(written["runs"])) == ([], [], ["light"])
    recording = read_recording(tmp_path / "out" / "light.parquet")
    assert recording.data["time"].iloc[-1] <= result.interrupted_at < recording.data["time"].iloc[-1] + 2e-3
    assert any("variant 'light'" in line and "of 2000 s" in line for line in told)


def test_several_scenarios_get_a_folder_each_and_a_contact_sheet(tmp_path):
    one = write(tmp_path, GOOD, "one.toml")
    two = write(tmp_path, edited(GOOD, ('id = "carriage"', 'id = "other"'), ("< 1e-9", "> 1")), "two.toml")
    seen = []
    results = run_all([one, two], tmp_path / "out", done=seen.append)
    assert results == seen
    assert [r.ok for r in results] == [True, False]
    assert (tmp_path / "out" / "contact-sheet.png").stat().st_size > 10_000
    assert (tmp_path / "out" / "other" / "result.json").is_file()
    alone = run_all([one], tmp_path / "alone")
    assert (tmp_path / "alone" / "result.json").is_file()
    assert alone[0].ok


def test_an_fmu_that_fails_is_named_with_scenario_and_time(tmp_path):
    source = (SHIPPED / "foreign" / "van_der_pol.py").read_text(encoding="utf-8")
    source = edited(
        source,
        (
            "x, h = (self.x0",
            "if current_time > 0.5:\n            raise ValueError('broke')\n        x, h = (self.x0",
        ),
    )
    write(tmp_path, source, "broken.py")
    text = edited(
        GOOD[: GOOD.index("[inputs]")],
        ('model = "drive"', 'source = "broken.py"'),
        ("parameters = {M = 50.0, F_v = 100.0}\ninitial = {q_dot = 0.5}", ""),
    )
    file = write(tmp_path, text + '[[expect]]\nthat = "last(drive.x0) < 9"\nbecause = "bounded"\n')
    with pytest.raises(FmuError, match=r"scenario.toml: its run: .*0\.5"):
        run(file, tmp_path / "out")


def test_a_source_that_cannot_be_built_is_said_in_one_line(tmp_path):
    write(tmp_path, "from pythonfmu import Fmi2Slave\n\nclass A(Fmi2Slave):\n    x = 1 +\n", "broken.py")
    text = edited(GOOD, ('model = "drive"', 'source = "broken.py"'))
    with pytest.raises(BadInput, match=r"broken.py': PythonFMU cannot build it") as refused:
        run(write(tmp_path, text), tmp_path / "out")
    assert "\n" not in str(refused.value)


def test_a_source_that_is_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.py")
    text = edited(GOOD, ('model = "drive"', 'source = "a.py"'))
    with pytest.raises(BadInput, match=r"a\.py: is a folder, a device or a pipe"):
        run(write(tmp_path, text), tmp_path / "out")


def test_a_source_that_does_not_end_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(script, "PATIENCE", 0.2)
    source = "import time\nfrom pythonfmu import Fmi2Slave\nclass A(Fmi2Slave): ...\ntime.sleep(999)\n"
    write(tmp_path, source, "a.py")
    text = edited(GOOD, ('model = "drive"', 'source = "a.py"'))
    with pytest.raises(BadInput, match=r"a.py': was not built within 0\.2 s"):
        run(write(tmp_path, text), tmp_path / "out")


def test_a_model_can_be_built_native(tmp_path):
    pytest.importorskip("ziglang")
    result, _ = ran(tmp_path, edited(GOOD, ('model = "drive"', 'model = "drive"\nkind = "native"')))
    assert result.ok


def test_effects_are_built_in(tmp_path):
    damped = edited(
        GOOD,
        ('model = "drive"', 'model = "drive"\neffects = ["viscous_damping@carriage"]'),
        ("{M = 50.0, F_v = 100.0}", "{M = 50.0, F_v = 0.0, viscous_damping_carriage_c = 100.0}"),
        ('set = {"drive.F_v" = 400.0}', 'set = {"drive.viscous_damping_carriage_c" = 400.0}'),
        ("drive.F_v * drive.q_dot - drive.F", "drive.viscous_damping_carriage_c * drive.q_dot - drive.F"),
    )
    assert ran(tmp_path, damped)[0].ok


CANTED = """
id = "canted"
question = "Does the cant of the rails change where the wheels run?"
duration = 0.01
step = 1e-3
fmus.wheelset = {model = "wheelset", initial = {y = 3e-3}}
variants = [{name = "plain"}, {name = "canted", fmus = {wheelset = {contact = {cant = 0.05}}}}]

[[expect]]
that = '''first(plain.wheelset.r_left - plain.wheelset.r_right) >
    5 * first(canted.wheelset.r_left - canted.wheelset.r_right)'''
because = "S1002 hardly steers at 1:20"
"""


@pytest.mark.slow
def test_a_wheelset_gets_its_profiles(tmp_path):
    assert ran(tmp_path, CANTED)[0].ok


@pytest.mark.slow
def test_a_wheelset_on_a_track_gives_the_same_bits(tmp_path):
    for name in ("first", "second"):
        run(SHIPPED / "wheelset_in_four_frictions.toml", tmp_path / name)
    files = sorted((tmp_path / "first").glob("*.p*"))
    assert len(files) == 7
    for file in files:
        assert file.read_bytes() == (tmp_path / "second" / file.name).read_bytes(), file.name


@pytest.mark.slow
def test_the_example_of_the_documentation_runs(tmp_path):
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    example = text.split("```toml\n")[1].split("```")[0]
    result, written = ran(tmp_path, edited(example, ("duration = 20.0", "duration = 11.0")))
    assert [f.sentence for f in result.failed] == []
    assert sorted(written["runs"]) == ["fast", "slow"]


def test_a_figure_that_cannot_be_drawn_leaves_the_verdicts(tmp_path):
    file = write(tmp_path, edited(GOOD, ('unit = "mm/s"', 'unit = "kg"')))
    with pytest.raises(
        BadInput, match=r"figure\[0\].panels\[0\].unit': curves in 'm/s' cannot be shown in 'kg'"
    ):
        run(file, tmp_path / "out")
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert written["ok"] is True
    assert written["figures"] == []
