"""What an FMU that carries another one says of that one: display units and the default experiment."""

import re
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from fmus.export.container.coupled import build_coupled
from fmus.host.archive import problems
from tests.helpers.native import native
from tests.helpers.packed import with_description


def described(path):
    with zipfile.ZipFile(path) as packed:
        return packed.read("modelDescription.xml")


def xml_of(path):
    return ElementTree.fromstring(described(path))


def shown(root):
    """By variable its display unit with what defines that, numbers as numbers."""
    units = {(u.get("name"), d.get("name")): d for u in root.iter("Unit") for d in u.iter("DisplayUnit")}
    found = {}
    for v in root.find("ModelVariables"):
        real = v if v.find("Real") is None else v.find("Real")
        if "displayUnit" in real.attrib:
            unit = units[real.get("unit"), real.get("displayUnit")]
            numbers = (float(unit.get("factor", 1)), float(unit.get("offset", 0)))
            found[v.get("name")] = unit.get("name"), *numbers
    return found


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_that_carries_another_shows_and_runs_it_as_that_one_says(fmi, tmp_path):
    """Display units and the default experiment of the carried FMU, here a native one, which has both."""
    base = native("testrig", fmi=fmi)
    path = build_coupled(base, (), [("input_delay", "T_P")], tmp_path / "carrying.fmu")
    inside, outside = xml_of(base), xml_of(path)
    both = {v.get("name") for v in outside.iter("ScalarVariable")}
    expected = {name: unit for name, unit in shown(inside).items() if name in both}
    assert shown(outside) == expected
    assert expected["omega_w"] == ("rpm", pytest.approx(30 / np.pi), 0.0)
    assert expected["theta_w"][0] == "deg"
    assert outside.find("DefaultExperiment").attrib == inside.find("DefaultExperiment").attrib
    assert problems(path) == []


SPEED = b"""<Unit name="m/s"><BaseUnit m="1" s="-1"/>
      <DisplayUnit name="km/h" factor="3.6"/>
      <DisplayUnit name="pace" inverse="true"/></Unit>"""
OF_A_TYPE = b'<Float64Type name="Speed" unit="m/s" displayUnit="'


def coupled_with(vdp, folder, *changes):
    """What the FMU says that carries the oscillator with a changed description."""
    for i, (old, new) in enumerate(changes):
        assert old in described(vdp)
        vdp = with_description(vdp, folder / f"changed_{i}.fmu", re.escape(old), new)
    path = build_coupled(vdp, (), [("input_delay", "u")], folder / "carrying.fmu")
    assert problems(path) == []
    return xml_of(path)


def test_a_display_unit_may_stand_in_a_type_and_have_an_offset(vdp, tmp_path):
    root = coupled_with(
        vdp,
        tmp_path,
        (b'<Unit name="m"><BaseUnit m="1"/>', b'<Unit name="m"><BaseUnit m="1"/><DisplayUnit '
         b'name="mm above" factor="1e3" offset="-2"/>'),
        (b'<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>', SPEED),
        (b'<Float64Type name="Speed" unit="m/s"', OF_A_TYPE + b'km/h"'),
        (b'start="2" unit="m"', b'start="2" unit="m" displayUnit="mm above"'),
        (b'startTime="0" stopTime="20"', b'startTime="1" stopTime="INF" tolerance="1e-6"'),
    )  # fmt: skip
    assert shown(root) == {"x0": ("mm above", 1e3, -2.0), "x1": ("km/h", 3.6, 0.0)}
    experiment = {"startTime": 1.0, "tolerance": 1e-6, "stepSize": 0.01}
    assert {k: float(v) for k, v in root.find("DefaultExperiment").attrib.items()} == experiment


def test_what_the_carried_fmu_does_not_say_or_fmi_2_cannot_say_is_left_out(vdp, tmp_path):
    root = coupled_with(
        vdp,
        tmp_path,
        (b'<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>', SPEED),
        (b'<Float64Type name="Speed" unit="m/s"', OF_A_TYPE + b'pace"'),
        (b'<DefaultExperiment startTime="0" stopTime="20" stepSize="0.01"/>', b""),
    )
    assert shown(root) == {}
    assert root.find("DefaultExperiment") is None
