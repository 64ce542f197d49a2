"""The package `railfmi`: one name for what is documented, loaded on first use, with types."""

import subprocess
import sys

import pytest

import railfmi
from tests.helpers.paths import ROOT


@pytest.mark.parametrize("name", railfmi.__all__)
def test_each_name_is_there(name):
    assert getattr(railfmi, name) is not None
    assert name in dir(railfmi)


def test_it_is_what_the_packages_offer():
    from fmus.host.fmu import Fmu
    from scenarios import close_loop

    assert railfmi.close_loop is close_loop
    assert railfmi.Fmu is Fmu
    assert railfmi._HOMES.keys() == {*railfmi.__all__} - {"__version__"}


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
