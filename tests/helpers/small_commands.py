"""A command line with a small input for every command, from the parameters that the command declares.

A new command is covered if the names of its parameters are known here; else the tests say which is not.
"""

from collections.abc import Iterator
from pathlib import Path

from typer.main import get_command

from scenarios.cli.app import COMMANDS, loaded, run_safely
from tests.helpers.misbehaving import Fault, bad_fmu
from tests.helpers.paths import SHIPPED

INPUTS = {  # by the name of a parameter, or of a command and its parameter
    "fmu": "bad.fmu",
    "compare.a": "bad.fmu",
    "compare.b": "bad.fmu",
    "experiment": "experiment.toml",
    "experiments": "experiment.toml",
    "scenario": "scenario.toml",
    "wear.scenario": str(SHIPPED / "bogie_in_service.toml"),
    "km": "1",
    "scenarios": "scenario.toml",
    "init.data": "data.csv",
    "inspect.file": "data.csv",
    "campaign.file": str(SHIPPED / "campaign" / "settling.toml"),
    "fleet.file": str(SHIPPED / "fleet" / "fleet.toml"),
    "watching": str(SHIPPED / "watch"),
    "import-ssp.package": "results/bad.ssp",
    "folder": "results",
    "bifurcation.parameter": "k",
    "bifurcation.low": "1",
    "bifurcation.high": "4",
    "bifurcation.output": "y",
    "conicity.wheel": "S1002",
    "conicity.rail": "60E1",
    # what makes a command small, or lets it start other processes
    "amplitude": "0.003",
    "models": "drive",
    "build.kind": "native",
    "pair": "A",
    "draws": "1",
    "row.name": "conicity_step",
    "jobs": "2",
    "workers": "2",
    "once": "",
}


def prepare(folder: Path, compiled: Path) -> None:
    """Write the inputs into a folder: an FMU, its scenario, experiment and record, a package, and results."""
    bad_fmu(folder, Fault("none", "none", ""), compiled)
    for command, out in (("run", folder / "results" / "run"), ("export-ssp", folder / "results" / "bad.ssp")):
        code = run_safely([command, str(folder / "scenario.toml"), "--out", str(out)])
        if code:
            raise RuntimeError(f"the inputs of the commands cannot be made: {command} ends with {code}")


def command_line(command: str, out: Path) -> list[str]:
    """The words of a command in a folder that `prepare` has filled; LookupError for an unknown parameter."""
    declared = get_command(loaded([command])).commands[command]  # type: ignore[attr-defined]
    return [command, *_words(command, declared.params, out)]


def _words(command: str, parameters: list[object], out: Path) -> Iterator[str]:
    for parameter in parameters:
        name, option = str(parameter.name), parameter.opts[-1]  # type: ignore[attr-defined]
        is_option = option.startswith("--")
        given = INPUTS.get(f"{command}.{name}", INPUTS.get(name))
        if name == "out":
            given = str(out)
        if given is None and parameter.required:  # type: ignore[attr-defined]
            raise LookupError(f"'{name}' of railfmi {command} has no small input; give it one in {__name__}")
        if given is not None:
            yield from ([option, given] if given and is_option else [given or option])


EVERY_COMMAND = sorted(COMMANDS)
