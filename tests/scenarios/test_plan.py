"""The command plan: from an experiment whose outputs do not exist yet to the plan, its page and its table."""

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2
from typer.testing import CliRunner

from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.planning.plan import Question
from estimator.closeloop.planning.plan import plan as planned
from estimator.closeloop.planning.responses import unknowns_of
from estimator.plant import PLANTS
from estimator.weighting import Weighting
from fmus.errors import BadInput
from fmus.host.archive import describe
from scenarios import plan
from scenarios.cli.app import loaded, run_safely
from scenarios.closing.closing import builder_for
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.given import given
from scenarios.experiment.record import load_planned
from scenarios.planning.planning import question_of
from scenarios.planning.result import PlanResult
from tests.scenarios.test_close_loop import FOREIGN, write_foreign

FITS = 60
OVER_DISPLACEMENT = {"cubic_stiffness", "bump_stop", "free_play"}
TEXT = """\
id = "planned"
model = "drive"
data = "planned.csv"
time = "t"
[split]
identify = [0.0, 8.0]
test = [8.0, 10.0]
[parameters]
M = 95.0
F_v = 200.0
[calibrate]
M = [90.0, 100.0]
[initial]
q = 0.0
q_dot = 0.0
[inputs]
F = "force"
[outputs.q]
column = "not there yet"
unit = "m"
noise_std = 1e-4
[plan]
ratio = 3.0
"""


def write(folder: Path, text: str = TEXT, sign: float = 1.0) -> Path:
    """A planned experiment of the drive, whose carriage moves in one direction or in both."""
    t = np.linspace(0.0, 10.0, 1001)
    force = 40.0 + 30.0 * np.sin(2 * np.pi * 0.4 * t) + 10 * np.sin(2 * np.pi * 1.7 * t)
    force = np.where(sign > 0, force, force * np.sin(2 * np.pi * 0.15 * t))
    folder.mkdir(parents=True, exist_ok=True)
    rows = np.column_stack([t, force])
    np.savetxt(folder / "planned.csv", rows, delimiter=",", header="t,force", comments="")
    (folder / "experiment.toml").write_text(text)
    return folder / "experiment.toml"


@pytest.fixture(scope="module")
def one_way(tmp_path_factory: pytest.TempPathFactory) -> tuple[PlanResult, Path, str]:
    """A plan of a record in one direction: its result, its folder, and what the command prints."""
    folder = tmp_path_factory.mktemp("plan")
    done = CliRunner().invoke(loaded(["plan"]), ["plan", str(write(folder)), "--out", str(folder / "out")])
    assert done.exit_code == 0, done.output
    told = json.loads((folder / "out" / "plan.json").read_text())
    return PlanResult(**told), folder / "out", done.output


@pytest.mark.slow
def test_a_plan_shows_itself(one_way: tuple[PlanResult, Path, str]) -> None:
    result, _, said = one_way
    assert "\n".join(result.lines()) in said
    assert "<table" in result._repr_html_()
    table = result.to_frame()
    assert len(table) == len(result.visible)
    friction = table[(table["kind"] == "coulomb_friction") & (table["location"] == "carriage")].iloc[0]
    assert "constant_force@carriage" in friction["not_told_from"]  # the record moves in one direction
    matplotlib.use("Agg")
    drawn = result.plot()
    assert drawn.get_xlabel().startswith("residual that is left")
    matplotlib.pyplot.close("all")


def test_a_plan_needs_no_outputs_and_is_written_with_its_page(one_way: tuple[PlanResult, Path, str]) -> None:
    result, out, printed = one_way
    assert result.noise == {"q": {"std": 1e-4, "declared": True}}
    page = (out / "plan.html").read_text()
    for c in result.classes:
        assert ", ".join(c["effects"]) in printed
        assert all(e in page for e in c["effects"])
    assert (out / "classes.png").is_file()
    assert (out / "sizes.png").is_file()
    assert not list(out.glob("*.part"))


def test_one_direction_does_not_split_friction_from_a_force_and_the_plan_says_what_would(
    one_way: tuple[PlanResult, Path, str],
) -> None:
    result, _, _ = one_way
    friction, force = "coulomb_friction@carriage", "constant_force@carriage"
    [found] = [c for c in result.classes if friction in c["effects"]]
    assert force in found["effects"]
    assert any("reversed in the second half" in e["what"] for e in found["excitations"])


def test_both_directions_split_friction_from_a_force(tmp_path: Path) -> None:
    result = plan(write(tmp_path, sign=-1.0))
    friction, force = "coulomb_friction@carriage", "constant_force@carriage"
    together = [c for c in result.classes if {friction, force} <= set(c["effects"])]
    assert together == []


def test_a_plan_may_be_given_as_a_table_with_its_inputs_as_a_frame(tmp_path: Path) -> None:
    """The outputs do not exist in the frame either; their conversions are known all the same."""
    file = write(tmp_path, TEXT.replace('unit = "m"', 'unit = "mm"').replace("1e-4", "0.1"))
    data = pd.read_csv(tmp_path / "planned.csv").set_index("t")
    data.attrs["units"] = {"force": "kN"}
    (tmp_path / "planned.csv").unlink()
    e = given(tomllib.loads(file.read_text()), None, data, tmp_path)
    builder = builder_for(e, tmp_path)
    record = load_planned(e, describe(builder(())))
    assert {c.variable: (c.unit, c.factor) for c in record.conversions} == {
        "q": ("mm", pytest.approx(1e-3)),
        "F": ("kN", pytest.approx(1e3)),
    }
    np.testing.assert_allclose(record.runs[0].u[:, 0], 1e3 * data["force"])
    np.testing.assert_allclose(record.noise_std, 1e-4)


def test_a_port_without_a_displacement_is_planned_for_laws_over_the_velocity_alone(
    foreign: Callable[..., Path], tmp_path: Path
) -> None:
    write_foreign(tmp_path, foreign(), FOREIGN.replace('displacement = "x"\n', "") + "[plan]\ninputs = []\n")
    result = plan(tmp_path)
    seen = {v["kind"] for v in result.visible if v["location"] == "shaft"}
    assert "quadratic_damping" in seen
    assert not seen & OVER_DISPLACEMENT


def test_at_the_stated_size_the_simulated_effect_is_detected_as_often_as_stated(tmp_path: Path) -> None:
    """By simulations with the effect built in, a calibration by least squares, and draws of the noise."""
    e = load_experiment(write(tmp_path, sign=-1.0))
    question = question_of(e, builder_for(e, tmp_path / "work"))
    question = replace(question, excite=())
    found = planned(question)
    [sight] = [s for s in found.sights if s.effect.label == "quadratic_damping@carriage"]
    size = sight.visible[0].detected
    shown = _shown(question, sight.effect.first, size)
    slope = _slope(question, "M", 0.01)
    PLANTS.close()
    rng, limit = np.random.default_rng(2), chi2.isf(found.comparison.test.false_alarm, 1)
    left = shown - slope * (slope @ shown) / (slope @ slope)
    along = left / np.linalg.norm(left)
    draws = rng.standard_normal((4000, len(shown)))
    assert np.mean(((draws + shown) @ along) ** 2 > limit) == pytest.approx(0.8, abs=0.03)
    assert np.mean((draws @ along) ** 2 > limit) < 2e-3


def test_close_loops_own_fit_finds_the_stated_size_about_as_often_as_stated(tmp_path: Path) -> None:
    """Records with the effect built in and drawn noise, fitted together with the mass that is calibrated."""
    e = load_experiment(write(tmp_path, sign=-1.0))
    question = question_of(e, builder_for(e, tmp_path / "work"))
    [sight] = [
        s
        for s in planned(replace(question, excite=())).sights
        if s.effect.label == "viscous_damping@carriage"
    ]
    c, size = sight.effect.first, sight.visible[0].detected
    problem, rng = question.problem.with_effects([(c.kind, c.location)]), np.random.default_rng(3)
    [true] = problem.simulate({"M": 97.0, c.amplitudes[0].name: size})
    [run], unknowns = problem.record.runs, [*unknowns_of(problem), *c.unknowns]
    weighting, found = Weighting.white(question.std[:1]), []
    for _ in range(FITS):
        y = true[:, :1] + question.std[0] * rng.standard_normal((len(run.t), 1))
        record = replace(problem.record, outputs=("q",), runs=(replace(run, y=y, fit=question.parts["fit"]),))
        fitted = fit(replace(problem, record=record), unknowns, weighting)
        found.append(Hypothesis((c,), fitted, ()).significance()[0])
    PLANTS.close()
    share = np.mean(np.array(found) > question.problem.policy.decision.significant)
    # standard errors of fits allow for residuals that are not white, so that they are a little larger
    assert 0.6 < share < 0.92


@pytest.mark.slow
@pytest.mark.parametrize("initial", ["exact", pytest.param("calculated", marks=pytest.mark.slow)])
def test_a_foreign_fmu_is_planned_whether_it_shows_its_state_or_not(
    initial: str, foreign: Callable[..., Path], tmp_path: Path
) -> None:
    write_foreign(tmp_path, foreign(initial=initial), FOREIGN + "[plan]\ninputs = []\n")
    result = plan(tmp_path)
    seen = {(v["kind"], v["location"]): v["smallest"] for v in result.visible}
    assert 0 < seen["quadratic_damping", "shaft"] < 0.3  # of the record that close-loop traces
    assert "quadratic_damping@shaft" not in result.hidden
    assert {kind for kind, location in seen if location == "shaft"} >= OVER_DISPLACEMENT


def _shown(question: Question, c: Candidate, size: float) -> np.ndarray:
    """What the effect changes in the part to identify, over the noise, by a simulation with it built in."""
    here = question.problem.with_effects([(c.kind, c.location)])
    on, off = (here.simulate({c.amplitudes[0].name: value})[0][:, 0] for value in (size, 0.0))
    return ((on - off) / question.std[0])[question.parts["fit"]]


def _slope(question: Question, name: str, step: float) -> np.ndarray:
    start = question.problem.declared[name]
    up, down = (question.problem.simulate({name: start + h})[0][:, 0] for h in (step, -step))
    return ((up - down) / question.std[0])[question.parts["fit"]]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("ratio = 3.0", "ratio = -1.0", "plan.ratio"),
        ("ratio = 3.0", 'inputs = ["v"]', "[plan] inputs: 'v' is not in [inputs]"),
        ("ratio = 3.0", "sensors.w = 0.1", "[plan.sensors] 'w' is not an output"),
        ('"force"', '"forc"', "column 'forc' is not in"),
    ],
)
def test_wrong_input_is_one_line(
    before: str, after: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, TEXT.replace(before, after))
    with pytest.raises(BadInput) as refused:
        plan(file)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
    assert run_safely(["plan", str(file), "--out", str(tmp_path / "out")]) == 2
    assert not list((tmp_path / "out").glob("plan.*"))
