"""What is installed is pinned with checksums, and the bill of materials says the same."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.helpers.paths import ROOT
from tests.sbom import DECLARED, FILE, LOCK, OURS, WHEEL, Pin, bill, declared, inside, pins

INTEROP = ROOT / "requirements-interop.lock"
OTHERS = {"interop", "fuzz"}  # the extras that have a lock of their own
PLACES = [  # what the lock claims to serve
    {"python_full_version": f"{python}.9", "python_version": python, "sys_platform": system, "extra": ""}
    | {"platform_machine": machine, "platform_python_implementation": "CPython"}
    for python in ("3.11", "3.12", "3.13", "3.14")
    for system, machine in (
        ("linux", "x86_64"),
        ("linux", "aarch64"),
        ("darwin", "arm64"),
        ("win32", "AMD64"),
    )
]


@pytest.fixture(scope="module", params=[LOCK, INTEROP], ids=lambda lock: lock.stem)
def lock(request: pytest.FixtureRequest) -> tuple[str, dict[str, Pin]]:
    path: Path = request.param
    return path.read_text(encoding="utf-8"), pins(path)


def test_every_line_of_a_lock_is_a_pinned_package_with_checksums(lock: tuple[str, dict[str, Pin]]) -> None:
    text, packages = lock
    lines = [line for line in text.splitlines() if line and line[0] not in "# "]
    assert len(lines) == len(packages) > 50
    for pin in packages.values():
        assert pin.hashes, pin.name
        assert all(re.fullmatch("[0-9a-f]{64}", checksum) for checksum in pin.hashes), pin.name


def test_a_lock_names_no_place_to_install_from(lock: tuple[str, dict[str, Pin]]) -> None:
    assert not re.search(r"://|index-url|find-links|trusted-host|@ ", lock[0])


def wanted(extras: set[str]) -> Iterator[Requirement]:
    """What railfmi itself and these extras ask for, and what builds it."""
    for extra, requirements in declared().items():
        if extra in extras:
            yield from map(Requirement, requirements)
    yield from map(Requirement, DECLARED["build-system"]["requires"])


@pytest.mark.parametrize("place", PLACES, ids=lambda place: "-".join(list(place.values())[1:3]))
def test_a_lock_holds_what_is_declared_in_versions_that_are_allowed(place: dict[str, str]) -> None:
    packages, more = pins(), pins(INTEROP)
    for held, extras in ((packages, set(declared()) - OTHERS), (packages | more, OTHERS)):
        for requirement in wanted(extras):
            if requirement.marker and not requirement.marker.evaluate(place):
                continue
            pin = held[canonicalize_name(requirement.name)]
            assert requirement.specifier.contains(pin.version, prereleases=True), requirement
            assert not pin.marker or Marker(pin.marker).evaluate(place), (pin, place)


def test_both_locks_agree() -> None:
    packages, more = pins(), pins(INTEROP)
    both = packages.keys() & more.keys()
    assert len(both) > 50
    for name in both:
        assert (packages[name].version, packages[name].hashes) == (more[name].version, more[name].hashes)


def test_every_way_to_install_here_asks_for_checksums() -> None:
    """But for railfmi itself, of which nothing else is installed by that."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    calls = [line for line in makefile.splitlines() if "pip install" in line and "##" not in line]
    assert len(calls) == 2
    for call in calls:
        assert ("--require-hashes" in call) != ("--no-deps --no-build-isolation -e ." in call)


def without_licences(content: dict[str, Any]) -> dict[str, Any]:
    """What does not depend on the packages that are installed on a machine."""
    plain = [{k: v for k, v in one.items() if k != "licenses"} for one in content["components"]]
    return {k: v for k, v in content.items() if k != "serialNumber"} | {"components": plain}


@pytest.fixture(scope="module")
def shipped() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def test_the_bill_of_materials_is_that_of_the_lock(shipped: dict[str, Any]) -> None:
    """Otherwise write it anew: python -m tests.sbom."""
    assert without_licences(shipped) == without_licences(bill())


def test_the_bill_of_materials_has_each_package_once_and_knows_all_that_it_refers_to(
    shipped: dict[str, Any],
) -> None:
    components = shipped["components"]
    names = [c["name"] for c in components]
    assert sorted(names) == sorted([*pins(), *(c["name"] for c in inside())])
    known = {c["bom-ref"] for c in components} | {shipped["metadata"]["component"]["bom-ref"]}
    assert len(known) == len(components) + 1
    for dependency in shipped["dependencies"]:
        assert {dependency["ref"], *dependency["dependsOn"]} <= known


def test_what_is_needed_to_run_has_a_licence_and_reaches_down(shipped: dict[str, Any]) -> None:
    scope = {c["name"]: c["scope"] for c in shipped["components"]}
    assert scope["casadi"] == scope["python-dateutil"] == scope["uPlot"] == "required"
    assert scope["distributed"] == scope["tornado"] == "optional"
    assert scope["pytest"] == scope["mkdocs"] == "excluded"
    silent = {c["name"] for c in shipped["components"] if c["scope"] == "required" and "licenses" not in c}
    assert silent <= {"fmpy"}  # which states none to its installers


def test_each_file_of_other_people_is_in_the_bill_of_materials() -> None:
    """A library built into one file says in its first line what it is; its licence lies beside it."""
    packages = [ROOT / name for name in WHEEL["packages"]]
    built = [f for package in packages for f in package.rglob("*.js") if _is_packed(f)]
    listed = {c["evidence"]["occurrences"][0]["location"] for c in inside()}
    assert {f.relative_to(ROOT).as_posix() for f in built} == listed
    assert listed


def _is_packed(file: Path) -> bool:
    """Whether it is no source that people write: lines beyond any screen."""
    return max(map(len, file.read_text(encoding="utf-8").splitlines())) > 1000


def test_a_wheel_carries_the_bill_of_materials(tmp_path: Path) -> None:
    """As it is built for a release, in the folder of its metadata that PEP 770 names."""
    from hatchling.builders.wheel import WheelBuilder

    [wheel] = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with ZipFile(wheel) as packed:
        names = packed.namelist()
        [held] = [name for name in names if ".dist-info/sboms/" in name]
        assert held == f"{OURS}-{DECLARED['project']['version']}.dist-info/sboms/{FILE.name}"
        assert packed.read(held) == FILE.read_bytes()
        [record] = [name for name in names if name.endswith(".dist-info/RECORD")]
        assert f"{held},sha256=" in packed.read(record).decode()
    tops = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == set(WHEEL["packages"])
