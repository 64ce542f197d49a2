"""Importers that nobody here wrote run native FMUs and give our trajectory.

The tools come from the package index: pip install ecospy tbb libcosimpy fmu-manipulation-toolbox.
Those that a plain install does not bring here, and why, are in docs/native.md.
"""

import json
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from numpy.testing import assert_allclose

from fmus.host.fmu import Fmu
from fmus.models import MODELS
from fmus.variables import Input, Output, State
from tests.helpers.everything import near_start
from tests.helpers.native import every_version, native
from tests.helpers.runs import every_model, names, start_of

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent
DT, STEPS = 0.01, 50


def case(name):
    """Start values off the usual ones, and what to compare."""
    model = MODELS[name]()
    start = start_of(model, near_start(model, np.random.default_rng(12)))
    settable = {n: v for n, v in start.items() if n in names(model, (State, Input))}
    return settable, names(model, (State, Output))


def ours(path, start, outputs):
    with Fmu(path) as fmu:
        fmu.restart(**start)
        rows = []
        for _ in range(STEPS):
            fmu.step(DT)
            rows.append(fmu.read(outputs))
    return np.array(rows)


def told(script, path, start, outputs):
    """Rows that a script prints, in a process of its own."""
    command = [sys.executable, HERE / script, path, str(DT), str(STEPS), json.dumps(start), *outputs]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    rows = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("row ")]
    return np.array(rows, dtype=float)


def agree(found, expected):
    """A tool's clock may be a product or count nanoseconds, ours is a sum: the last bits of a step differ."""
    size = np.abs(expected).max(axis=0)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * size[size > 0].min())


def installed(*packages):
    missing = set(packages) - {d.name.replace("_", "-") for d in distributions()}
    if missing:
        pytest.skip(f"not installed: {', '.join(sorted(missing))}; pip install brings it")


@every_model
@every_version
def test_fmpy(name, fmi):
    start, outputs = case(name)
    path = native(name, fmi=fmi)
    stop = {"stop_time": DT * STEPS, "step_size": DT, "output_interval": DT}
    found = simulate_fmu(str(path), start_values=start, output=outputs, fmi_type="CoSimulation", **stop)
    rows = np.array([list(row)[1:] for row in found])[1:]
    agree(rows, ours(path, start, outputs))


@every_model
@every_version
def test_ecos(name, fmi):
    installed("ecospy", "tbb")
    start, outputs = case(name)
    path = native(name, fmi=fmi)
    agree(told("run_ecos.py", path, start, outputs), ours(path, start, outputs))


@every_model
def test_libcosim_with_the_fmi_library(name):
    """FMI 2.0 alone: libcosim 0.0.6 ends the process at any FMI 3.0 file."""
    installed("libcosimpy")
    start, outputs = case(name)
    path = native(name)
    agree(told("run_libcosim.py", path, start, outputs), ours(path, start, outputs))


@every_version
def test_container_of_the_manipulation_toolbox(fmi, tmp_path):
    """Two models in one FMU, run by the container's own C code."""
    installed("fmu-manipulation-toolbox")
    start, outputs = case("testrig")
    drive, rig = native("drive", fmi=fmi), native("testrig", fmi=fmi)
    for path in (drive, rig):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    both = {
        "name": "both.fmu",
        "step_size": DT,
        "fmu": [rig.name, drive.name],
        "start": [[rig.name, n, str(v)] for n, v in start.items()],
    }
    (tmp_path / "both.json").write_text(json.dumps(both))
    tool = [
        sys.executable,
        "-c",
        "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer as f; f()",
    ]
    arguments = ["-container", "both.json", "-fmu-directory", ".", "-fmi", str(fmi)]
    subprocess.run([*tool, *arguments], cwd=tmp_path, check=True, capture_output=True)
    inputs = names(MODELS["testrig"](), Input)
    found = ours(tmp_path / "both.fmu", {n: start[n] for n in inputs}, outputs)
    agree(found, ours(rig, start, outputs))
