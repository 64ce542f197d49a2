"""A disk that takes no more, from any change of a file on: one line, exit code 2, and no part of a file."""

import shutil

import pytest

from scenarios.cli.app import run_safely
from tests.helpers.full_disk import library, tried
from tests.helpers.misbehaving import Fault, bad_fmu

CASES = {  # command, arguments, and at how many of its changes the disk fails
    "init": (["init", "bad.fmu", "data.csv"], 4),
    "inspect": (["inspect", "data.csv"], 6),
    "report": (["report", "results"], 10),
    "conicity": (["conicity", "--wheel", "S1002", "--rail", "60E1", "--amplitude", "0.003"], 30),
    "run": (["run", "scenario.toml"], 30),
    "compare": (["compare", "bad.fmu", "bad.fmu", "experiment.toml"], 20),
    "estimate": (["estimate", "experiment.toml"], 20),
    "export-ssp": (["export-ssp", "scenario.toml"], 10),
    "import-ssp": (["import-ssp", "bad.ssp"], 20),
    "build": (["build", "testrig"], 10),
    "close-loop --dry-run": (["close-loop", "--dry-run", "experiment.toml"], 10),
    "plan": (["plan", "experiment.toml"], 8),
    "close-loop": (["close-loop", "experiment.toml", "--jobs", "1"], 12),
    "row": (["row", "conicity_step"], 4),
    "conicity-norm": (["conicity-norm", "--pair", "A", "--draws", "1"], 10),
}
QUICK = ("init",)


@pytest.fixture
def folder(tmp_path, tmp_path_factory, monkeypatch):
    if not shutil.which("cc"):
        pytest.skip("no C compiler 'cc' here to make a full disk with")
    bad_fmu(tmp_path, Fault("none", "none", ""), tmp_path_factory.mktemp("compiled"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in QUICK else pytest.mark.slow) for case in CASES]
)
def test_no_part_of_a_file_wherever_it_fails(case, folder):
    arguments, most = CASES[case]
    if case == "report":
        assert run_safely(["run", "scenario.toml", "--out", "results"]) == 0
    if case == "import-ssp":
        assert run_safely(["export-ssp", "scenario.toml", "--out", "bad.ssp"]) == 0
    sound, *full = tried(arguments, folder / "out", most, library(folder))
    assert sound.code in (0, 1), sound.said
    assert sound.changes >= len(full) > 0
    assert not sound.broken
    for outcome in full:
        lines = [line for line in outcome.said.splitlines() if line.startswith("railfmi: ")]
        assert outcome.code == 2, outcome
        assert len(lines) == 1, outcome.said
        assert "No space left on device" in lines[0]
        assert "Traceback" not in outcome.said
        assert not outcome.broken
        assert {f for f in outcome.files if ".stages" not in f} <= set(sound.files)
