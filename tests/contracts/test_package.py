"""The package `railfmi`: one name for what is documented, loaded on first use, with types."""

import subprocess
import sys

import numpy as np
import pytest

import railfmi
from fmus.drive.model import Drive
from fmus.export.builders.pythonfmu import build_python
from tests.helpers.paths import ROOT


@pytest.mark.parametrize("name", railfmi.__all__)
def test_each_name_is_there(name):
    assert getattr(railfmi, name) is not None
    assert name in dir(railfmi)


def test_it_is_what_the_packages_offer():
    from scenarios import close_loop

    assert railfmi.close_loop is close_loop
    assert railfmi._HOMES.keys() == {*railfmi.__all__} - {"__version__"}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return build_python(Drive(), tmp_path_factory.mktemp("drive"))


def test_a_simulation_is_a_table_with_units_and_needs_no_start(drive):
    t = [0.0, 0.1, 0.2, 0.3]
    with railfmi.Fmu(drive) as fmu:
        assert repr(fmu).startswith("<Fmu Drive (Drive.fmu), FMI 2.0: ")
        table = fmu.simulate(t, {"F": 50.0})
        assert table.attrs["units"] == {"q": "m", "q_dot": "m/s", "q_ddot": "m/s2"}
        assert list(table.index) == t
        assert fmu.time == 0.3
        moved = fmu.simulate(t, {"F": [0.0, 10.0, 0.0, 0.0]}, ["q"], {"q": 2.0})
        assert list(moved.columns) == ["q"]
        assert moved["q"].iloc[0] == 2.0
        samples = {"F": np.full(4, 50.0)}
        arrays = fmu.host.simulate(np.array(t), samples, list(table.columns), {})
        np.testing.assert_array_equal(table.to_numpy(), arrays)


def test_an_fmu_is_stepped_and_read_by_names(drive):
    with railfmi.Fmu(drive) as fmu:
        fmu.restart(q=1.0, q_dot=0.5)
        fmu.step(1e-3, F=0.0)
        assert fmu["q"] == pytest.approx(1.0005, rel=1e-5)
        fmu.set(F=95.0)
        assert fmu.read(["q_dot", "q"])[1] == fmu["q"]
        assert "F" in fmu.description.inputs
        with pytest.raises(railfmi.BadInput, match="did you mean"):
            fmu.read(["q_dott"])


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'closeloop'"):
        _ = railfmi.closeloop


def test_importing_it_loads_nothing_heavy():
    heavy = ("numpy", "pandas", "scipy", "casadi", "matplotlib", "pydantic")
    script = f"import sys, railfmi\nprint(*(n for n in {heavy!r} if n in sys.modules), end='')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == ""


def test_it_carries_types():
    for package in ("railfmi", "fmus", "estimator", "scenarios"):
        assert (ROOT / package / "py.typed").exists()
        assert f'"{package}"' in (ROOT / "pyproject.toml").read_text()
