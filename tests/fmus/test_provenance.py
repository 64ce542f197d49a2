"""Records of provenance: what a build says of itself, repeatable and checkable."""

import json
import zipfile
from hashlib import sha256

import pytest

from fmus.drive.model import Drive
from fmus.effects import parse_effect
from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.coupled import build_coupled
from fmus.export.provenance import (
    PLACE,
    Origin,
    altered,
    provenance,
)
from fmus.host.archive import problems
from fmus.models import MODELS
from fmus.wheelset.model import Wheelset
from fmus.wheelset.track import Track
from tests.helpers.packed import repacked

BUILDS = {"python": build_python, "native": build_native}
every_build = pytest.mark.parametrize("kind", BUILDS)
ORIGIN = Origin("emps", {"viscous_damping_carriage_c": (21.5, 0.3)}, {"data.csv": "00ff"}, "traced")


def augmented():
    return Drive([parse_effect("viscous_damping@carriage")])


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("built")
    return {kind: build(augmented(), folder / kind, origin=ORIGIN) for kind, build in BUILDS.items()}


@every_build
def test_a_build_says_what_it_is_and_what_its_estimates_rest_on(built, kind):
    record = provenance(built[kind])
    assert (record["model"], record["kind"], record["fmi"]) == ("Drive", kind, 2)
    assert record["parameters"]["M"] == {"value": 95.0, "unit": "kg"}
    (effect,) = record["effects"]
    assert (effect["kind"], effect["location"]) == ("viscous_damping", "carriage")
    assert effect["parameters"] == {"c": {"value": 0.0, "unit": "N.s/m"}}
    assert record["origin"] == {
        "experiment": "emps",
        "estimates": {"viscous_damping_carriage_c": [21.5, 0.3]},
        "data": {"data.csv": "00ff"},
        "verdict": "traced",
    }


@every_build
def test_its_checksums_are_those_of_all_other_files(built, kind):
    record = provenance(built[kind])
    with zipfile.ZipFile(built[kind]) as packed:
        sums = {n: sha256(packed.read(n)).hexdigest() for n in packed.namelist() if n != PLACE}
    assert record["sha256"] == sums
    assert "modelDescription.xml" in sums
    assert record["fmu_sha256"] == sha256(built[kind].read_bytes()).hexdigest()
    assert altered(built[kind]) == []
    assert problems(built[kind]) == []


@every_build
def test_the_page_shows_it(built, kind):
    with zipfile.ZipFile(built[kind]) as packed:
        page = packed.read("documentation/index.html").decode()
    for said in ("Provenance", "emps", "traced", "21.5", "0.3", "00ff", "viscous_damping", PLACE):
        assert said in page


@every_build
def test_the_same_build_gives_the_same_bytes_and_another_origin_others(built, kind, tmp_path):
    again = BUILDS[kind](augmented(), tmp_path / "again", origin=ORIGIN)
    assert again.read_bytes() == built[kind].read_bytes()
    without = BUILDS[kind](augmented(), tmp_path / "without")
    assert provenance(without)["origin"] is None
    assert provenance(without)["effects"] == provenance(built[kind])["effects"]


def test_what_is_changed_added_or_gone_is_named(built, tmp_path):
    def change(name, data):
        if name == "documentation/index.html":
            return None
        return name, data + b"\n" if name == "modelDescription.xml" else data

    other = repacked(built["native"], tmp_path / "other.fmu", change)
    with zipfile.ZipFile(other, "a") as packed:
        packed.writestr("resources/new.txt", "new")
    assert altered(other) == ["documentation/index.html", "modelDescription.xml", "resources/new.txt"]


def test_a_wheelset_says_its_profiles_and_point_files_by_checksum(tmp_path):
    track = Track(cant=1 / 20)
    record = provenance(build_python(Wheelset(track=track), tmp_path))
    assert record["profiles"]["cant"] == 1 / 20
    assert (record["profiles"]["wheel"], record["profiles"]["rail"]) == ("S1002", "60E1")


def test_an_fmu_that_carries_another_says_so(tmp_path):
    base = build_python(MODELS["drive"](), tmp_path / "base")
    record = provenance(build_coupled(base, (), (), tmp_path / "coupled", name="Carrier"))
    assert (record["model"], record["kind"]) == ("Carrier", "python")
    assert altered(tmp_path / "coupled" / "Carrier.fmu") == []


def test_without_a_record_there_is_one_clear_line(built, tmp_path):
    bare = repacked(built["python"], tmp_path / "bare.fmu", lambda n, d: None if n == PLACE else (n, d))
    odd = repacked(built["python"], tmp_path / "odd.fmu", lambda n, d: (n, b"[]" if n == PLACE else d))
    bad = repacked(built["python"], tmp_path / "bad.fmu", lambda n, d: (n, b"{" if n == PLACE else d))
    (tmp_path / "text.fmu").write_text("text")
    for file, words in (
        (bare, "has no extra"),
        (odd, "no table"),
        (bad, "no JSON"),
        (tmp_path / "text.fmu", "cannot be read"),
        (tmp_path / "gone.fmu", "cannot be read"),
    ):
        with pytest.raises(BadInput, match=words) as refused:
            provenance(file)
        assert "\n" not in str(refused.value)


def test_the_record_names_no_place_of_the_machine_that_built_it(built, tmp_path):
    for fmu in built.values():
        text = json.dumps(provenance(fmu))
        assert str(tmp_path.parent) not in text
        assert str(fmu.parent) not in text
