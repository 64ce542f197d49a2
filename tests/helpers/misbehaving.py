"""Misbehaving FMUs, compiled from one C file: each fault at one call, and what a user is told of it."""

import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest

SOURCE = Path(__file__).parent / "c" / "misbehaving.c"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Bad" guid="{fault}">
  <CoSimulation modelIdentifier="bad" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
    <Unit name="1/s"><BaseUnit s="-1"/></Unit>
  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.001"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" initial="exact">
      <Real start="1" unit="m"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input">
      <Real start="0" unit="m/s"/></ScalarVariable>
    <ScalarVariable name="k" valueReference="2" causality="parameter" variability="tunable">
      <Real start="2" unit="1/s" min="0.1" max="10"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output"><Real unit="m"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="4"/></Outputs>
    <InitialUnknowns><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
SCENARIO = """id = "bad"
question = "What is kept of a run that does not come to its end?"
duration = 0.2
step = 1e-3
[fmus.m]
fmu = "bad.fmu"
[inputs]
"m.u" = "sin(5 * t)"
[[expect]]
that = "max(abs(m.x)) < 1.2"
because = "it decays"
"""
EXPERIMENT = """id = "bad"
fmu = "bad.fmu"
data = "data.csv"
time = "t"
[split]
identify = [0.0, 1.2]
test = [1.2, 2.0]
[parameters]
k = 2.0
[calibrate]
k = [1.0, 4.0]
[initial]
x = 1.0
[inputs]
u = "u"
[outputs.x]
column = "x"
unit = "m"
noise_std = 0.002
[estimate]
states = ["x"]
parameters.k = {start = 2.2, std = 0.5, bounds = [0.5, 5.0]}
[[ports]]
name = "point"
force = "u"
velocity = "x"
displacement = "y"
"""


@dataclass(frozen=True)
class Fault:
    """One FMU: what happens at which of its calls, and words of what is said of it."""

    what: str
    call: str
    words: str

    @property
    def name(self) -> str:
        """FAULT@CALL, which is the FMU's token."""
        return f"{self.what}@{self.call}"


CALLS = {
    "load": "loading its library", "instantiate": "fmi2Instantiate", "setup": "fmi2SetupExperiment",
    "enter": "fmi2EnterInitializationMode", "leave": "fmi2ExitInitializationMode", "set": "fmi2SetReal",
    "get": "fmi2GetReal", "step": "fmi2DoStep", "late": "fmi2DoStep", "reset": "fmi2Reset",
    "terminate": "fmi2Terminate", "free": "fmi2FreeInstance",
}  # fmt: skip
AFTER = ("terminate", "free")  # calls when the work is done
SIGNALS = {
    "abort": "Aborted", "assert": "Aborted", "says": "Aborted", "twice": "Aborted",
    "segfault": "Segmentation",
    "stack": "Segmentation", "thread": "Segmentation", "jump": "Segmentation", "readonly": "Segmentation",
    "illegal": "Illegal instruction", "bus": "Bus error", "divide": "Floating point exception",
    "kill": "Killed", "terminate": "Terminated", "trap": "trap", "alarm": "Alarm clock",
}  # fmt: skip
EXITS = {"exit0": "exit code 0", "exit1": "exit code 1", "_exit0": "exit code 0", "_exit7": "exit code 7"}
HANGS = ("endless", "sleep", "deadlock")


def _death(what: str, call: str) -> Fault:
    how = {**SIGNALS, **EXITS}.get(what, "did not come back within")
    return Fault(what, call, f"{CALLS[call]}.*{how}")


DEATHS = (
    *(_death(what, "late") for what in (*SIGNALS, *EXITS)),
    *(
        _death(what, call)
        for what in ("segfault", "exit0", "_exit0")
        for call in CALLS
        if call not in ("late", "reset", *AFTER)
    ),
    Fault("memory", "late", "fmi2DoStep.*memory|fmi2DoStep.*Aborted"),
    Fault("shared_memory", "late", "fmi2DoStep.*needs more than .* of memory"),
    Fault("cut_off", "late", "fmi2DoStep.*closed the connection"),
)
ENDLESS = (
    *(_death(what, call) for what in HANGS for call in ("late", "leave", "instantiate")),
    *(_death(what, "late") for what in ("stop", "cuts_memory")),
)
# at the end of a run, whose results are not believed then
AT_THE_END = tuple(_death(what, call) for what in ("segfault", "exit0", "sleep") for call in AFTER)


def _refusal(what: str, call: str, words: str) -> Fault:
    status = {
        "discard": r"2 \(discard\)", "error": r"3 \(error\)", "fatal": r"4 \(fatal\)",
        "status": r"77 \(not of the standard\)",
    }  # fmt: skip
    return Fault(what, call, f"{words}.* failed with status {status[what]}")


# what an FMU says no to, without a word of why
REFUSALS = (
    *(_refusal(what, "late", r"step of 0\.001 s") for what in ("discard", "error", "fatal", "status")),
    _refusal("discard", "leave", "fmi2ExitInitializationMode"),
    _refusal("fatal", "get", "reading outputs"),
    _refusal("error", "set", "setting inputs"),
    Fault("error", "instantiate", "Failed to instantiate model"),
)
NOT_FINITE = (Fault("nan", "none", "is not finite"), Fault("infinite", "none", "is not finite"))


@cache
def library(folder: Path, fault: str = "") -> Path:
    """The compiled library; fault: what happens while it is loaded."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler 'cc' here to make misbehaving FMUs with")
    target = folder / f"bad{fault}.so"
    defined = [f'-DAT_LOAD="{fault}"'] if fault else []
    options = ["-O1", "-shared", "-fPIC", *defined, "-lm", "-lpthread"]
    command = [compiler, str(SOURCE), "-o", str(target), *options]
    subprocess.run(command, check=True)
    return target


def bad_fmu(folder: Path, fault: Fault, compiled: Path) -> Path:
    """An FMU with this fault in a folder, as bad.fmu, with a scenario, an experiment and its data."""
    folder.mkdir(exist_ok=True, parents=True)
    built = library(compiled, fault.what if fault.call == "load" else "")
    with zipfile.ZipFile(folder / "bad.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", DESCRIPTION.replace("{fault}", fault.name))
        packed.write(built, f"binaries/{fmpy.platform}/bad{fmpy.sharedLibraryExtension}")
    (folder / "scenario.toml").write_text(SCENARIO)
    (folder / "experiment.toml").write_text(EXPERIMENT)
    write_data(folder)
    return folder / "bad.fmu"


def write_data(folder: Path) -> None:
    """The data of EXPERIMENT: the motion that it declares, with another k, and noise."""
    t = np.arange(0.0, 2.0, 0.005)
    u = np.sin(5 * t) + 0.5 * np.sin(17 * t)
    x = [1.0]
    for held in (u[1:] + u[:-1]) / 2:
        x.append(x[-1] + 0.005 * (held - 2.3 * x[-1]))
    noisy = np.array(x) + 0.002 * np.random.default_rng(1).standard_normal(t.size)
    rows = [f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(t, u, noisy, strict=True)]
    (folder / "data.csv").write_text("\n".join(["t,u,x", *rows]) + "\n")


# what an FMU may do to its process that is nobody else's concern
HARMLESS = tuple(
    Fault(what, "step", "")
    for what in (
        "none", "warning", "null_message", "formats", "log_flood", "print_flood", "no_line", "closes_output",
        "directory", "locale", "rounding", "traps", "ignores_signals", "leak", "child", "background",
    )
)  # fmt: skip
