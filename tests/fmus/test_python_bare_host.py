"""PythonFMU builds in a host that is not Python: it runs them and ends without an error."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.helpers.native import compiler, description, unpacked
from tests.helpers.paths import ROOT
from tests.helpers.runs import every_model

HOST = ROOT / "tests" / "helpers" / "c" / "bare_host.c"


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    program = tmp_path_factory.mktemp("host") / "host"
    subprocess.run([compiler(), "-std=gnu99", "-Wall", "-Wextra", HOST, "-o", program, "-ldl"], check=True)
    return program


@pytest.fixture(scope="module")
def environment():
    """What a host that is not Python needs for a PythonFMU build: the interpreter, and where packages lie."""
    library = Path(sysconfig.get_config_var("LIBDIR") or "") / (sysconfig.get_config_var("LDLIBRARY") or "")
    if sys.platform != "linux" or library.suffix != ".so" or not library.exists():
        pytest.skip("the Python here has no shared library to load into another program")
    python = {"PYTHONHOME": sys.base_prefix, "PYTHONPATH": sysconfig.get_path("purelib")}
    return {**os.environ, **python, "LD_PRELOAD": str(library)}


@every_model
def test_a_host_without_python_ends_cleanly(built, name, host, environment, tmp_path):
    folder, root = unpacked(built(name), tmp_path / "fmu"), description(built(name))
    identifier = root.find("CoSimulation").get("modelIdentifier")
    library = folder / "binaries" / "linux64" / f"{identifier}.so"
    call = [host, library, root.get("guid"), (folder / "resources").as_uri()]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert done.stdout.splitlines()[-1] == "ended"
