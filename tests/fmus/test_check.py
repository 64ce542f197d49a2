"""The grade of an FMU: ours are clean, and each kind of bad one is told in the right words."""

import json
import re
import textwrap
import time
import zipfile
from pathlib import Path

import pytest

from fmus.errors import BadInput
from fmus.export.container.coupled import build_coupled
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from fmus.host.grading import check
from fmus.host.grading.check import Check, Grade, grade
from fmus.host.grading.fitness import LETTER, fitness
from fmus.host.grading.trials import TRIALS
from scenarios.cli.app import run_safely
from tests.helpers.foreign import AT_START, GOOD, HIDDEN
from tests.helpers.packed import repacked, with_description
from tests.helpers.sizes import bare_and_with_all_effects

FMI1 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="one" modelIdentifier="one" guid="{0}"
    numberOfContinuousStates="0" numberOfEventIndicators="0">
  <ModelVariables><ScalarVariable name="x" valueReference="0"><Real/></ScalarVariable></ModelVariables>
  <Implementation><CoSimulation_StandAlone><Capabilities/></CoSimulation_StandAlone></Implementation>
</fmiModelDescription>
"""


def outcome(path, title):
    return next(c for c in grade(path).checks if c.title == title)


def assert_only(path, title, words):
    """One check fails, for the right reason; everything else is as in a good FMU."""
    found = grade(path)
    assert [c.title for c in found.checks if c.passed is False] == [title]
    assert not found.ok
    assert re.search(words, next(c.sentence for c in found.checks if c.title == title))


@bare_and_with_all_effects
def test_our_builds_are_clean(built, name, effects):
    found = grade(built(name, *effects))
    assert found.name.lower() == name
    assert [(c.title, c.passed) for c in found.checks] == [(title, True) for title in TRIALS]
    assert found.ok


def test_a_coupled_build_is_clean_but_for_a_saved_state(foreign, tmp_path):
    ports = [PortNames("point", "u", "x", "x")]
    path = build_coupled(foreign(), ports, [("viscous_damping", "point")], tmp_path)
    found = grade(path)
    assert {c.title: c.passed for c in found.checks} == {**dict.fromkeys(TRIALS, True), "saved state": None}


@pytest.mark.slow
def test_every_outcome_is_one_sentence(built, foreign):
    for path in (built("testrig", "all"), foreign(), foreign(HIDDEN)):
        for c in grade(path).checks:
            assert c.sentence.endswith(".")
            assert c.sentence[0].isupper()
            assert "\n" not in c.sentence


def test_where_isolation_matters_is_printed(foreign, capfd):
    """And where every trial came to its end, nothing is said of it: a failure is no crash."""
    assert grade(foreign(HIDDEN)).isolation == ""
    assert run_safely(["check", str(foreign("if dt < 0:\n    os._exit(0)\n" + GOOD))]) == 1
    last = capfd.readouterr().out.splitlines()[-1]
    assert last.startswith("isolation matters: it ended or held up its process in the trial refusals; ")
    assert "--trust-fmu" in last


def test_what_is_not_offered_is_no_failure(foreign):
    found = grade(foreign())
    assert {c.title: c.passed for c in found.checks if c.passed is not True} == {
        "saved state": None,
        "refusals": None,
    }
    assert found.ok
    assert "does not offer to save and restore" in outcome(foreign(), "saved state").sentence
    taken = outcome(foreign(), "refusals").sentence
    assert re.search("takes a step back in time and NaN in 'k' without a word; a reset mends it", taken)


def test_a_grade_fails_by_one_check():
    good, open_, bad = (Check("a", passed, "It is so.") for passed in (True, None, False))
    assert Grade("x", (good, open_)).ok
    assert not Grade("x", (good, bad)).ok
    assert Grade("x", (good, Check(LETTER, False, "It is so."))).ok


def test_hidden_state(foreign):
    words = r"hidden state: restarted from those it shows \(x\) it differs, 'x' by \S+ at step 1"
    assert_only(foreign(HIDDEN), "restart", words)


def test_no_state_shown_is_not_offered(foreign):
    seen = outcome(foreign(initial="calculated"), "restart")
    assert seen.passed is None
    assert "shows no state" in seen.sentence


def test_no_state_needed_is_no_pass(foreign):
    seen = outcome(foreign("self.x = self.k * self.u + t", initial="calculated"), "restart")
    assert seen.passed is None
    assert seen.sentence.endswith("could be set before a start, and its outputs do not miss one.")


def test_state_shared_by_all_instances(foreign):
    shared = "SHARED.x += dt * (self.u - self.k * SHARED.x)\nself.x = SHARED.x"
    path = foreign(shared, AT_START.format("SHARED.x = self.x"))
    assert_only(path, "instances", r"influence each other: of three at once, number 1 is off, 'x' by")


def test_what_survives_a_reset(foreign):
    found = grade(foreign(GOOD + "\nself.x += SHARED.made * 1e-3"))
    failed = {c.title: c.sentence for c in found.checks if c.passed is False}
    assert {"repeatable", "instances"} <= set(failed)
    assert re.search(r"does not repeat: 'x' by .*; something survives the reset", failed["repeatable"])


def test_saved_state_that_is_not_all(foreign):
    # PythonFMU saves the variables it knows of, so h stays
    path = foreign(HIDDEN, canGetAndSetFMUstate=True)
    seen = outcome(path, "saved state")
    assert seen.passed is False
    assert re.search(
        "not all of its state: after going back to a saved state it differs, 'x' by", seen.sentence
    )


def test_saved_state_that_is_all(foreign):
    seen = outcome(foreign(GOOD, canGetAndSetFMUstate=True), "saved state")
    assert seen == Check(
        "saved state", True, "It saves and restores all of its state; as bytes it does not offer it."
    )


def test_bytes_that_lose_digits(foreign):
    more = """
    @staticmethod
    def _fmu_state_to_bytes(state):
        return repr({k: round(v, 6) for k, v in state.items()}).replace("'", '"').encode()
    """
    path = foreign(GOOD, textwrap.dedent(more), canGetAndSetFMUstate=True, canSerializeFMUstate=True)
    assert_only(path, "saved state", "after going back to a state saved as bytes it differs, 'x' by")


def test_tunable_parameter_that_is_refused(foreign):
    path = foreign("if self.k != self.h:\n    return False\n" + GOOD, AT_START.format("self.h = self.k"))
    assert_only(
        path, "tunable parameters", "refuses to change the tunable parameter 'k' while running: fmi2DoStep"
    )


def test_tunable_parameter_that_is_ignored(foreign):
    path = foreign("self.x += dt * (self.u - self.h * self.x)", AT_START.format("self.h = self.k"))
    assert_only(path, "tunable parameters", "ignores a change of the tunable parameter 'k'")


def test_tunable_parameter_without_effect_is_counted(foreign):
    seen = outcome(foreign("self.x += dt * self.u"), "tunable parameters")
    assert seen.passed is True
    assert "(0 of 1 change this short run)" in seen.sentence


def test_refusal_that_cannot_be_survived(foreign):
    path = foreign("if math.isnan(self.k):\n    raise ValueError('a bad number')\n" + GOOD)
    assert_only(path, "refusals", "After NaN in 'k' no reset helps: .*fatal failure.*a bad number")


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (
            "os.kill(os.getpid(), signal.SIGSEGV)",
            r"brings down the process that runs it \(Segmentation fault\)",
        ),
        ("os._exit(3)", r"brings down the process that runs it \(exit code 3\)"),
        ("os._exit(0)", r"brings down the process that runs it \(exit code 0\)"),
    ],
)
def test_a_crash_is_one_failed_check(foreign, end, words):
    path = foreign(f"if dt < 0:\n    {end}\n" + GOOD)
    assert_only(path, "refusals", words)


def test_a_crash_in_the_middle_leaves_the_rest(foreign):
    path = foreign("if self.k != 2.0:\n    os._exit(1)\n" + GOOD)
    found = grade(path)
    assert [c.title for c in found.checks] == list(TRIALS)
    assert {c.title for c in found.checks if c.passed is False} == {"tunable parameters", "refusals"}
    assert "process in the trials tunable parameters and refusals" in found.isolation


@pytest.mark.slow
def test_a_run_without_end_is_ended(foreign, built):
    found = grade(foreign("while dt < 0:\n    time.sleep(1)\n" + GOOD), patience=12.0)
    assert [c.passed for c in found.checks][-1] is False
    assert re.fullmatch(r"It did not come to an end within \d+ s\.", found.checks[-1].sentence)
    assert found.isolation.startswith("isolation matters: ")
    assert all(c.passed is not False for c in found.checks[:-1])


@pytest.mark.slow
def test_all_trials_have_one_time(foreign):
    """Each of them would hang; seven times the time was taken before."""
    begun = time.monotonic()
    found = grade(foreign("while True:\n    time.sleep(1)"), patience=6.0)
    assert time.monotonic() - begun < 12
    assert [c.passed for c in found.checks][1:] == 6 * [False]
    assert found.checks[-1].sentence.startswith("It was not tried, since the trials before took the 6 s")


def test_what_an_fmu_writes_into_the_results_is_no_traceback(foreign):
    """Into every file of its process, among them the one in which the outcomes lie."""
    spoils = (
        "for n in range(3, 64):\n    try:\n        os.write(n, b'{\\n')\n    except OSError:\n        pass\n"
    )
    found = grade(foreign(spoils + GOOD))
    assert len(found.checks) == 7
    assert not found.ok


def test_outputs_that_are_not_finite(foreign):
    path = foreign("self.x = math.nan")
    assert "not finite from its own start values" in outcome(path, "repeatable").sentence


def test_inputs_that_it_cannot_bear_are_made_smaller(foreign):
    assert grade(foreign("if abs(self.u) > 0.5:\n    return False\n" + GOOD)).ok


def test_a_step_that_is_always_refused(foreign):
    found = grade(foreign("return False"))
    assert not found.ok
    assert "It refused a call: fmi2DoStep failed with status 2 (discard)." in [
        c.sentence for c in found.checks
    ]


def test_model_description_that_breaks_the_letter_of_the_standard(built, tmp_path):
    """It is told, but what works is no failure."""
    path = with_description(built("drive"), tmp_path / "x.fmu", rb'unit="kg"', b'unit="stone"')
    found = grade(path)
    [broken] = [c for c in found.checks if c.passed is False]
    assert broken.title == LETTER
    assert re.search(r'not valid: The unit "stone" of variable "M" .* is not defined\.$', broken.sentence)
    assert found.ok
    assert answers(found) == ["yes", "yes", "yes"]


def answers(found):
    assert [f.use for f in found.fit] == ["simulation", "estimation", "close-loop"]
    return [f.answer for f in found.fit]


@pytest.mark.parametrize(
    ("body", "more", "expected", "words"),
    [
        (GOOD, {}, ["yes", "yes", "yes"], "for 10 000 samples"),
        (HIDDEN, {}, ["yes", "no", "no"], "hidden state: .*; export all of its states as outputs"),
        (GOOD, {"initial": "calculated"}, ["yes", "no", "yes"], 'as outputs with initial="exact"'),
        (GOOD + "\nself.x += SHARED.made * 1e-3", {}, ["yes", "no", "no"], "not repeat: .*; mend its reset"),
        ("return False", {}, ["no", "no", "no"], "refused a call: fmi2DoStep.*; give it start values"),
        ("os._exit(3)", {}, ["no", "no", "no"], "brings down the process"),
        ("sum(range(40_000))\n" + GOOD, {}, ["yes", "yes", "slow"], "of one core for 10 000 samples"),
    ],
    ids=["good", "hidden state", "no state", "does not repeat", "refuses", "crashes", "slow"],
)
def test_the_conclusion_says_what_an_fmu_is_fit_for(foreign, body, more, expected, words):
    found = grade(foreign(body, **more))
    assert answers(found) == expected
    assert re.search(words, found.conclusion)
    assert found.conclusion.startswith("fit for simulation: ")
    assert "\n" not in found.conclusion


def test_the_time_of_a_step_grows_with_its_work(foreign):
    d = describe(foreign())
    good = dict.fromkeys(TRIALS, (True, "It is so."))
    sentences = [fitness(good, d, step)[0].sentence for step in (1e-5, 1e-3, 1.0, None)]
    assert sentences[:3] == [f"about {t} of one core for 10 000 samples" for t in ("0.1 s", "10 s", "2.8 h")]
    assert "could not be measured" in sentences[3]


def test_one_instance_in_a_process(built, tmp_path):
    once = b'canBeInstantiatedOnlyOncePerProcess="true"'
    path = with_description(built("drive"), tmp_path / "x.fmu", rb"canBeInst\w+=\"false\"", once)
    seen = outcome(path, "instances")
    assert (seen.passed, seen.sentence) == (None, "It allows one instance in a process, and says so.")


def test_no_output(built, tmp_path):
    path = with_description(built("drive"), tmp_path / "x.fmu", rb'causality="output"', b'causality="local"')
    assert "no output that is a number" in outcome(path, "repeatable").sentence


def test_the_step_is_the_usual_one_of_the_fmu(foreign, tmp_path):
    path = foreign("if abs(dt) != 0.25:\n    return False\n" + GOOD)
    assert not grade(path).ok
    element = rb'<DefaultExperiment stepSize="0.25"/><ModelVariables>'
    assert grade(with_description(path, tmp_path / "x.fmu", rb"<ModelVariables>", element)).ok


def test_a_file_that_is_no_fmu(tmp_path):
    with pytest.raises(BadInput, match="no such FMU file"):
        grade(tmp_path / "gone.fmu")


def test_a_version_that_is_not_read_here(tmp_path):
    with zipfile.ZipFile(tmp_path / "one.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", FMI1)
    for use in (grade, describe, Fmu):
        why = r"one\.fmu: its modelDescription\.xml is FMI 1\.0; FMI 2\.0 and 3\.0 are read here"
        with pytest.raises(BadInput, match=why):
            use(tmp_path / "one.fmu")


def test_an_error_of_the_check_itself_is_not_blamed_on_the_fmu(built, monkeypatch):
    def broken(module, arguments, patience):
        Path(arguments[1]).write_text(json.dumps({"traceback": "KeyError: 'x'"}))
        return ""

    monkeypatch.setattr(check, "_process", broken)
    with pytest.raises(RuntimeError, match=r"the check itself failed:\nKeyError"):
        grade(built("drive"))


def test_repacking_changes_nothing(built, tmp_path):
    assert grade(repacked(built("drive"), tmp_path / "x.fmu")).ok
