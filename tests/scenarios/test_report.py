"""The report: one file that holds all it shows, with the numbers of the result."""

import ast
import base64
import html
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.question.problem import Problem
from estimator.plant import PLANTS
from estimator.record import Record, Run
from scenarios import close_loop
from scenarios.closing.closing import builder_for, experiment_of, pose
from scenarios.closing.notes import left_by_the_answer
from scenarios.closing.page import sections
from scenarios.closing.page.case import Case
from scenarios.closing.page.wording import explained_words
from scenarios.closing.result import Result, start_values
from tests.helpers.baselines import NOTHING, baseline
from tests.scenarios.test_close_loop import FOREIGN, write_foreign
from tests.truth.rig import write_null_record

LARGEST = 3_000_000  # bytes of a page that can be sent by mail


@pytest.fixture(scope="module")
def page(demo: tuple[Result, Path]) -> str:
    """The demo's report."""
    return (demo[1] / "report.html").read_text(encoding="utf-8")


def words(page: str) -> str:
    """What a reader sees of a page."""
    return re.sub(
        r"\s+", " ", re.sub(r"<style.*?</style>|<script.*?</script>|<[^>]+>", " ", page, flags=re.S)
    )


def test_the_page_asks_for_nothing_else(page: str) -> None:
    assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)
    assert "<script src" not in page
    assert "@import" not in page
    assert len(page) < LARGEST


def test_measured_against_simulated_is_the_first_figure(page: str) -> None:
    """Also without scripts, where the picture is shown."""
    first = page.index("<figure")
    assert page[first:].startswith('<figure id="chart-simulated" class="charted">')
    [data] = re.findall(r'<script type="application/json">(.*?)</script>', page, re.S)
    panels = json.loads(data)["panels"]
    assert {p["title"].split(",")[0] for p in panels} == {"omega_w", "omega_r"}
    for panel in panels:
        measured, before, after = (np.array(s["y"]) for s in panel["series"])
        assert [s["name"] for s in panel["series"]] == ["measured", "before (calibrated)", "after"]
        assert np.std(measured - after) < np.std(measured - before)
    assert page.index("<img") > first


def test_every_embedded_figure_is_a_picture_and_lies_beside_the_page(
    page: str, demo: tuple[Result, Path]
) -> None:
    embedded = re.findall(r"data:image/(png|svg\+xml);base64,([A-Za-z0-9+/=]+)", page)
    assert len(embedded) >= 5
    for kind, data in embedded:
        raw = base64.b64decode(data)
        assert raw.startswith(b"\x89PNG") if kind == "png" else b"<svg" in raw
    assert len(list(demo[1].glob("*.png"))) >= 5


def test_the_page_says_what_the_result_says(page: str, demo: tuple[Result, Path]) -> None:
    result, text = demo[0], words(page)
    value = result.effects[0].parameters["c"][0]
    assert f"{value:.4f}" in text  # 0.2998
    assert result.effects[0].location in text
    assert "quadratic damping" in text.lower()
    assert result.augmented_fmu in text
    for name, error in result.error.items():
        assert name in text
        assert f"{error['before']:.3g}" in text
    for a in result.alternatives[:3]:
        assert a.kind.replace("_", " ") in text.lower()


@pytest.mark.slow
def test_a_record_without_a_discrepancy_has_its_page_and_names_are_escaped(tmp_path: Path) -> None:
    made = write_null_record(tmp_path, 6998)
    text = made.read_text()
    made.write_text(re.sub(r"^id = .*$", 'id = "<b>bold</b> & sons"', text, flags=re.M))
    result = close_loop(made, tmp_path / "out", jobs=1)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert result.verdict == "no_discrepancy"
    assert "<b>bold</b>" not in page
    assert "&lt;b&gt;bold&lt;/b&gt; &amp; sons" in page
    assert "nan" not in words(page).lower().split()
    assert result.calibrated
    assert started(page).keys().isdisjoint(result.calibrated)


def started(page: str) -> dict[str, float]:
    """The start values with which the page runs the augmented FMU."""
    found = re.search(r"^start = (.*)$", page, flags=re.M)
    assert found, "the page does not run the augmented FMU"
    return ast.literal_eval(html.unescape(found[1]))


MORE_OUTPUTS = """
_first = __init__
def __init__(self, **kwargs):
    self._first(**kwargs)
    self.z, self.w, self.v = 3.0, 4.0, 5.0
    for name, initial in (("z", Fmi2Initial.exact), ("w", Fmi2Initial.calculated), ("v", Fmi2Initial.approx)):
        self.register_variable(Real(name, causality=Fmi2Causality.output, initial=initial))
"""


def test_the_page_says_which_start_values_were_fitted_and_why_others_were_not(
    foreign: Callable[..., Path], tmp_path: Path
) -> None:
    """x shows in the residual and z does not; w cannot be set, and the FMU does not say what v is."""
    ports = 'velocity = "w"\ndisplacement = "v"'
    text = FOREIGN.replace('velocity = "x"\ndisplacement = "x"', ports)
    write_foreign(tmp_path, foreign(more=MORE_OUTPUTS), text)
    e = experiment_of(tmp_path)
    problem = pose(e, builder_for(e, tmp_path))
    assert problem.free_states == ("x", "z")
    _, base, _ = calibrate(problem)
    PLANTS.close()
    found = start_values(problem, SimpleNamespace(base=base, built_in=None))
    assert {name: s["how"] for name, s in found.items()} == {
        "x": "fitted", "z": "not seen", "v": "not exact", "w": "not settable",
    }  # fmt: skip
    assert found["x"]["value"] == pytest.approx(1.0, abs=0.01 + 3 * found["x"]["std_error"])
    assert found["z"]["value"] == 3.0
    told = SimpleNamespace(start_values=found)
    case = SimpleNamespace(problem=problem, result=told, words=SimpleNamespace(unit=lambda _: ""))
    said = [(s["sentence"], [n for n, _ in s["states"]]) for s in sections.start_values(case)]
    fitted, unseen, no_start, vague = said
    assert fitted == (
        "Start values that were not declared and were fitted together with the parameters",
        ["x"],
    )
    assert "would not have shown in the residual" in unseen[0]
    assert unseen[1] == ["z"]
    assert "accepts no start value" in no_start[0]
    assert no_start[1] == ["w"]
    assert "can be declared in [initial]" in vague[0]
    assert vague[1] == ["v"]


def test_the_start_values_of_a_file_that_is_held_out_are_told() -> None:
    runs = [SimpleNamespace(fit=np.array([fits])) for fits in (True, False)]
    problem = SimpleNamespace(free_states=("x",), record=SimpleNamespace(runs=runs))
    told = SimpleNamespace(start_values={"x": {"how": "fitted", "value": 1.0, "std_error": 0.1}})
    case = SimpleNamespace(problem=problem, result=told, words=SimpleNamespace(unit=lambda _: "m"))
    first, second = sections.start_values(case)
    assert first["states"][0][1].endswith("m")
    assert "new start value in the test file" in second["sentence"]


def test_the_result_tells_the_start_values(page: str, demo: tuple[Result, Path]) -> None:
    """Turning the rig by an angle at the start changes no speed, so that the angles are left."""
    assert demo[0].start_values == {n: {"how": "not seen", "value": 0.0} for n in ("theta_w", "theta_r")}
    assert "would not have shown in the residual: theta_w = 0 rad, theta_r = 0 rad." in words(page)
    assert "fitted together with the parameters:" not in words(page)


def leaving(after: float) -> SimpleNamespace:
    """An answer of which the first output leaves noise, the second so many times its noise of 2, after 10."""
    t = np.arange(500.0)
    run = Run(t, np.zeros((500, 0)), np.zeros((500, 2)), t < 300, (t >= 300) & (t < 400), t >= 400)
    record = Record((run,), (), ("angle", "speed"), np.array([1.0, 2.0]))
    problem = Problem(lambda _: Path(), record, {}, {})
    before, chosen = (
        replace(NOTHING, residuals=(np.array([first, 2 * second]) * np.ones((500, 2)),))
        for first, second in ((10.0, 10.0), (1.0, after))
    )
    found = baseline(problem, before, record.noise_std)
    return SimpleNamespace(problem=problem, baseline=found, chosen=chosen, noise=found.noise.std)


AFTER = pytest.mark.parametrize(("after", "told"), [(1.0, False), (1.2, False), (5.0, True), (12.0, False)])


@AFTER
def test_what_an_answer_leaves_is_said_beside_it(after: float, told: bool) -> None:
    """It is said where more is left than noise by chance, and not for an output that is not improved."""
    found = leaving(after)
    rms = {"before": np.array([10.0, 20.0]), "after": np.array([1.0, 2.0 * after])}
    notes = left_by_the_answer(found.problem, found, rms)
    assert len(notes) == told
    if told:
        assert "75% of the residual's variance" in notes[0]
        assert "5.0 times the noise" in notes[0]
    found.chosen = None
    assert left_by_the_answer(found.problem, found, rms) == []


def test_the_page_runs_the_augmented_fmu_with_the_values_found(page: str, demo: tuple[Result, Path]) -> None:
    assert started(page).keys().isdisjoint(demo[0].calibrated)


@AFTER
def test_the_lead_says_how_much_an_answer_explains(after: float, told: bool) -> None:
    """A residual of 100 samples is 1.2 times the noise by chance."""
    error = {
        "angle": {"before": 10.0, "after": 1.0, "noise": 1.0},
        "speed": {"before": 20.0, "after": 2.0 * after, "noise": 2.0},
    }
    found = leaving(after)
    case = Case(found.problem, found, SimpleNamespace(error=error), SimpleNamespace())
    explained, rest = explained_words(case)
    if told:
        assert words(explained) == "at least 75.0 % of the residual's variance"
        assert "speed is 5.0 times the noise" in rest
    else:
        assert (explained, rest) == ("the residual", "")
