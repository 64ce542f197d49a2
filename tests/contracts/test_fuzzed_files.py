"""Whatever is spoiled in a file from outside: what reads it answers, or raises BadInput."""

import os
import random
import subprocess
import sys

import pytest

from scenarios.cli.app import run_safely
from tests.helpers.fuzzing import spoiled, targets, wrong
from tests.helpers.paths import ROOT

QUICK, MANY = 40, 2000
LONG = 20  # s, that a fuzzer may look for what fails
PATIENCE = 240  # s, with its start


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [QUICK, pytest.param(MANY, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", targets())
def test_a_spoiled_file_is_read_or_bad_input(name, count, tmp_path):
    target, rng = targets()[name], random.Random(count)
    (tmp_path / target.name).write_bytes(target.good)
    target.read(tmp_path / target.name)  # else all spoiled ones could be refused for what is wrong in it
    for _ in range(count):
        data = spoiled(target.good, rng)
        told = wrong(target, data, tmp_path)
        assert not told, (data, told)


@pytest.mark.slow
@pytest.mark.parametrize("name", targets())
def test_a_fuzzer_that_sees_what_is_run_finds_nothing(name, tmp_path):
    pytest.importorskip("atheris", reason="atheris is installed by make test-all, where it can be")
    asked = [sys.executable, "-m", "tests.helpers.fuzzing_by_coverage", name, str(LONG)]
    # libFuzzer ends the process, so that nothing there could remove its files
    env = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)}
    done = subprocess.run(asked, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr[-4000:]


def test_a_message_is_one_line_whatever_it_quotes(tmp_path, capfd):
    """A name in a file may hold line ends, and codes that a terminal obeys."""
    (tmp_path / "scenario.toml").write_text('id = "a"\n"\\u001b[2Jtwo\\nlines" = 1\n')
    assert run_safely(["run", str(tmp_path / "scenario.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capfd.readouterr().err
    assert len(said.splitlines()) == 1
    assert said.rstrip("\n").isprintable()
    assert "[2Jtwo lines" in said
