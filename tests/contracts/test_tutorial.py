"""The tutorial, executed as a reader would: its files are saved, its commands are typed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.helpers.pages import Step, steps_of
from tests.helpers.paths import ROOT

PAGE = ROOT / "docs" / "tutorial.md"
BIN = Path(sys.executable).parent


def follow(steps: list[Step], folder: Path) -> str:
    """Do the steps in a folder, outside the repository; what the commands said."""
    said = []
    path = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    for step in steps:
        if step.file:
            (folder / step.file).write_text(step.text, encoding="utf-8")
            continue
        command = step.command or ("python", "-c", step.text)
        done = subprocess.run(command, cwd=folder, env=path, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        said.append(done.stdout + done.stderr)
    return "\n".join(said)


STEPS = list(steps_of(PAGE))
ANSWER = next(i for i, s in enumerate(STEPS) if s.command == ("railfmi", "close-loop", "experiment.toml"))


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> tuple[Path, str]:
    """A folder in which everything up to the trial was done, and what was said."""
    folder = tmp_path_factory.mktemp("tutorial")
    return folder, follow(STEPS[:ANSWER], folder)


@pytest.mark.slow
def test_the_tutorial_comes_to_a_trial(begun):
    folder, said = begun
    assert len(pd.read_csv(folder / "log.csv", skiprows=[1])) == 4000
    assert "no number in 12 of 4000 rows, which are left out" in said
    for row in (
        "u             input   voltage  V     V (guess)",
        "omega         output  speed    rpm   rad/s (guess)",
    ):
        assert row in said
        assert row in PAGE.read_text(encoding="utf-8")
    assert "0.10472 * column" in said
    assert "fit for simulation: yes" in said
    assert "estimation: no (it shows no state" in said
    assert "close-loop: yes" in said
    assert (folder / "out" / "inspect" / "record.png").stat().st_size > 10_000
    assert (folder / "out" / "close-loop" / "dry_run.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.timeout(2400)  # it closes the loop twice, with an FMU in Python
def test_the_tutorial_comes_to_the_right_answer(begun):
    folder, _ = begun
    said = follow(STEPS[ANSWER : ANSWER + 1], folder)
    result = json.loads((folder / "out" / "close-loop" / "result.json").read_text())
    assert result["verdict"] == "traced", said
    [effect] = result["effects"]
    assert (effect["kind"], effect["location"]) == ("coulomb_friction", "shaft")
    value, error = effect["parameters"]["F_c"]
    assert abs(value - 0.012) < 4 * error
    assert error < 0.1 * value
    assert "traced: coulomb_friction@shaft accounts for the residual" in PAGE.read_text(encoding="utf-8")
    assert "traced: coulomb_friction@shaft" in follow(STEPS[ANSWER + 1 :], folder)  # the same from Python
