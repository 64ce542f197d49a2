"""PythonFMU builds run under the oldest and the newest CasADi for this Python, and without any."""

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fmus.models import MODELS
from tests.helpers.everything import near_start
from tests.helpers.runs import start_of

OLDEST, NEWEST = "casadi==3.6.0", "casadi"  # the first version with a package for Python 3.11; the latest
RUN = Path(__file__).with_name("run_bare.py")
pytestmark = pytest.mark.slow


def installed(place, *packages):
    """The interpreter of a new environment with packages; skips where the package index is out of reach."""
    subprocess.run([sys.executable, "-m", "venv", place], check=True)
    python = place / "bin" / "python"
    call = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run([*call, *packages], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"pip cannot install {packages}: {done.stderr.strip().splitlines()[-1:]}")
    return python


def moving(name):
    """Start values off those of rest."""
    model = MODELS[name]()
    return start_of(model, near_start(model, np.random.default_rng(3)))


def run(python, fmus):
    call = [
        python,
        RUN,
        *(str(part) for name, fmu in fmus.items() for part in (json.dumps(moving(name)), fmu)),
    ]
    done = subprocess.run(call, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-2000:]
    line = next(line for line in done.stdout.splitlines() if line.startswith("FOUND"))
    return {name: np.array(rows) for name, rows in json.loads(line[6:]).items()}, done.stdout


@pytest.mark.parametrize("casadi", [OLDEST, NEWEST, None])
def test_every_model_runs_alike_under_any_casadi(built, tmp_path, casadi):
    fmus = {name: built(name) for name in MODELS}
    python = installed(tmp_path / "env", f"fmpy=={version('fmpy')}", *([casadi] if casadi else ()))
    found, said = run(python, fmus)
    expected, _ = run(sys.executable, fmus)
    assert ("plain Python" in said) == (casadi is None)
    assert len(found) == len(expected) == len(MODELS)
    for name, rows in expected.items():
        size = np.maximum(np.abs(rows).max(axis=0), 1e-9)
        off = np.abs(found[name] - rows) / size
        print(f"{casadi} {name}: largest difference {off.max():.1e} of a signal's largest value")
        assert np.ptp(rows, axis=0).max() > 0
        assert_allclose(off, 0, atol=1e-9)
