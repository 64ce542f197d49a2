"""Start-up of the command, beside the bare import of the libraries that it cannot do without."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.group import Group, Row, Work
from benchmarks.timing import Run, in_turns
from benchmarks.until_first_step import REACHED

TYPER, FMPY = "python -c 'import typer'", "FMPy: import, load, first step"
SCENARIO = Path(__file__).parents[2] / "scenarios" / "shipped" / "rig_torque_profile.toml"
SCRIPT = "from fmpy import simulate_fmu; simulate_fmu({!r}, stop_time=1e-3, output_interval=1e-3)"


class StartupGroup(Group):
    """Processor time of whole processes, from their start to their end."""

    name = "startup"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        rounds = work.of(7, 2)
        runs = {"ours": ended("-m", "scenarios.cli", "--help"), TYPER: ended("-c", "import typer")}
        how = "whole process; the peer imports the library of the command line alone"
        yield in_turns(runs, rounds).row("railfmi --help", "ours", TYPER, "s", how)
        first = ("-m", "benchmarks.until_first_step", "run", str(SCENARIO), "--out", str(work.folder / "run"))
        runs = {
            "ours": ended(*first, code=REACHED),
            FMPY: ended("-c", SCRIPT.format(str(work.fmu("testrig", "PythonFMU")))),
        }
        how = (
            f"{SCENARIO.name}: start, reading, building the FMU and loading it, until the first step; the "
            "peer is given the built FMU"
        )
        yield in_turns(runs, rounds).row("railfmi run until the first step", "ours", FMPY, "s", how)


def ended(*arguments: str, code: int = 0) -> Run:
    """A call that runs Python in a process of its own, which must end with that code."""

    def run() -> None:
        done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)
        if done.returncode != code:
            said = (done.stderr or done.stdout)[-400:]
            raise RuntimeError(
                f"{' '.join(arguments)}: ended with code {done.returncode}, not {code}: {said}"
            )

    return run
