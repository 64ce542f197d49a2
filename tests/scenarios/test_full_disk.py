"""A disk that takes no more, from any change of a file on: one line, exit code 2, and no part of a file."""

import shutil

import pytest

from scenarios.cli.app import run_safely
from tests.helpers.full_disk import EVERYWHERE, OUT, TEMPORARY, library, tried
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
    "bifurcation": (
        ["bifurcation", "bad.fmu", "--parameter", "k", "--from", "1", "--to", "4", "--output", "y"],
        8,
    ),
    "conicity-norm": (["conicity-norm", "--pair", "A", "--draws", "1"], 10),
    "fleet": (["fleet", "fleet.toml", "--workers", "2"], 8),
    "campaign": (["campaign", "campaign.toml", "--workers", "2"], 8),
    "watch": (["watch", "watch.toml", "--once"], 12),
    "check": (["check", "bad.fmu"], 8),
}
QUICK = ("init",)
WHERE = {"fleet": EVERYWHERE, "campaign": EVERYWHERE, "watch": EVERYWHERE, "check": TEMPORARY}
FLEET = """id = "two"
records = "records.csv"
[setups.bad]
experiment = "experiment.toml"
commands = ["check", "estimate"]
"""
CAMPAIGN = """id = "two"
scenario = "scenario.toml"
sample = "grid"
[vary]
"fmus.m.parameters.k" = {values = [1.5, 2.5]}
[measure]
highest = "max(m.x)"
"""
WATCH = """experiment = "experiment.toml"
[stream]
folder = "windows"
settle = 0.0
[test]
learn = 0.5
[trace]
run = false
"""


@pytest.fixture
def folder(tmp_path, tmp_path_factory, monkeypatch):
    if not shutil.which("cc"):
        pytest.skip("no C compiler 'cc' here to make a full disk with")
    bad_fmu(tmp_path, Fault("none", "none", ""), tmp_path_factory.mktemp("compiled"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def many(folder):
    """The inputs of the commands that work on many records, points or windows."""
    shutil.copy(folder / "data.csv", folder / "again.csv")
    records = "record,vehicle,data\na,v1,data.csv\nb,v2,again.csv\n"
    for name, text in (
        ("fleet.toml", FLEET), ("records.csv", records), ("campaign.toml", CAMPAIGN), ("watch.toml", WATCH),
    ):  # fmt: skip
        (folder / name).write_text(text)
    names, *rows = (folder / "data.csv").read_text().splitlines(keepends=True)
    (folder / "windows").mkdir()
    for i in range(4):
        part = rows[i * len(rows) // 4 : (i + 1) * len(rows) // 4]
        (folder / "windows" / f"w{i}.csv").write_text("".join([names, *part]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in QUICK else pytest.mark.slow) for case in CASES]
)
def test_no_part_of_a_file_wherever_it_fails(case, folder):
    arguments, most = CASES[case]
    if case == "report":
        assert run_safely(["run", "scenario.toml", "--out", "results"]) == 0
    if case == "import-ssp":
        assert run_safely(["export-ssp", "scenario.toml", "--out", "bad.ssp"]) == 0
    many(folder)
    sound, *full = tried(arguments, folder / "out", most, library(folder), WHERE.get(case, OUT))
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
