"""A command that a trusted FMU ends together with the process does not pass for one that has finished."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.estimator.test_filters_fmu import PYTHON_VDP, SHOW_SPEED
from tests.helpers.scenario_files import write
from tests.helpers.vdp import SOURCE, build_vdp
from tests.scenarios.test_close_loop import FOREIGN, write_foreign
from tests.scenarios.test_estimate_command import IN_M, write_vdp

C_EXIT = "import ctypes; ctypes.CDLL(None).exit({})"
ENDS = [
    C_EXIT.format(0),
    C_EXIT.format(7),
    "import ctypes; ctypes.PyDLL(None).exit(0)",
    "os._exit(0)",
    "os._exit(3)",
]
SCENARIO = """
id = "ended"
question = "Does an FMU that ends the process pass for a success?"
duration = 1.0
step = 0.1

[fmus.a]
fmu = "{fmu}"

[[expect]]
that = "max(a.x) < 9"
because = "it decays"
"""


def railfmi(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    command = [sys.executable, "-m", "scenarios.cli", *map(str, arguments), "--trust-fmu"]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def assert_said(done: subprocess.CompletedProcess[str], words: str) -> None:
    """Exit code 2 and one line on it."""
    lines = [line for line in done.stderr.splitlines() if line.startswith("railfmi: ")]
    assert done.returncode == 2, done
    assert len(lines) == 1, done.stderr
    assert words in lines[0]
    assert "railfmi check" in lines[0]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("end", ENDS)
def test_a_run_that_the_fmu_ends_has_not_finished(tmp_path, foreign, end):
    fmu = foreign(f"if t > 0.5:\n    {end}\nself.x *= 0.9")
    done = railfmi("run", write(tmp_path, SCENARIO.format(fmu=fmu)), "--out", tmp_path / "out")
    assert_said(done, "ended the process of the command before it had finished")
    assert re.search(r"Foreign\d+\.fmu: fmi2DoStep at t = 0\.[67] s ended", done.stderr)
    assert not (tmp_path / "out" / "result.json").exists()


@pytest.mark.parametrize(
    "call", ["enter_initialization_mode", "exit_initialization_mode", "setup_experiment"]
)
def test_before_the_first_step_too(tmp_path, foreign, call):
    more = f"def {call}(self, *_):\n    {C_EXIT.format(0)}\n"
    done = railfmi("run", write(tmp_path, SCENARIO.format(fmu=foreign(more=more))), "--out", tmp_path / "out")
    assert_said(done, "ended the process of the command before it had finished")


@pytest.fixture
def vdp_that_exits(tmp_path):
    """An FMU in C whose step ends the process."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler 'cc' here to make an FMI 3.0 FMU with")
    step = "fmi3Status fmi3DoStep("
    source = SOURCE.read_text()
    place = source.index("{", source.index(step)) + 1
    spoiled = tmp_path / "vdp_fmi3.c"
    spoiled.write_text("#include <stdlib.h>\n" + source[:place] + "\n    exit(0);\n" + source[place:])
    return build_vdp(compiler, tmp_path, spoiled)


def test_a_library_in_c_that_ends_the_process(tmp_path, vdp_that_exits):
    text = SCENARIO.format(fmu=vdp_that_exits).replace("a.x)", "a.x0)")
    done = railfmi("run", write(tmp_path, text), "--out", tmp_path / "out")
    assert_said(done, "ended the process of the command before it had finished")


def test_an_estimate_that_the_fmu_ends_has_not_finished(tmp_path, foreign):
    step = f"if t > 2.0:\n    {C_EXIT.format(0)}\n{PYTHON_VDP.strip()}"
    file = write_vdp(tmp_path, foreign(step, SHOW_SPEED), ("x", "k"), IN_M, n=100)
    done = railfmi("estimate", file, "--out", tmp_path / "out")
    assert_said(done, "ended the process of the command before it had finished")


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_loop_that_the_fmu_ends_has_not_finished(tmp_path, foreign, jobs):
    """With two jobs it ends the worker processes alone."""
    where = "True" if jobs == 1 else "'loky' in ' '.join(sys.orig_argv)"
    body = f"if {where} and t > 1.0:\n    {C_EXIT.format(0)}\nself.x += dt * (self.u - self.k * self.x)"
    write_foreign(tmp_path, foreign(body), FOREIGN)
    done = railfmi("close-loop", tmp_path, "--out", tmp_path / "out", "--jobs", str(jobs))
    words = (
        "ended the process of the command" if jobs == 1 else "a worker process ended before its work was done"
    )
    assert_said(done, words)
    assert not (tmp_path / "out" / "result.json").exists()


@pytest.mark.slow
def test_a_command_that_finishes_keeps_its_exit_code(tmp_path, foreign):
    text = SCENARIO.format(fmu=foreign("self.x *= 0.9"))
    for that, code in (("< 9", 0), ("> 9", 1), ("< nonsense", 2)):
        file = write(tmp_path, text.replace("< 9", that))
        done = railfmi("run", file, "--out", tmp_path / "out")
        assert done.returncode == code, done.stderr
        assert "ended the process" not in done.stderr
