"""FMU files: what is read from them, and what is refused in which words."""

import re
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.errors import BadInput
from fmus.host.archive import describe, problems
from fmus.host.fmu import Fmu
from tests.helpers.packed import repacked, with_description


@pytest.fixture
def drive(built):
    return built("drive")


def test_description_in_words(drive):
    said = describe(drive)
    assert (said.name, said.fmi_version, said.identifier) == ("Drive", "2.0", "Drive")
    assert said.states == ["q", "q_dot"]
    assert said.inputs == ["F", "F_ext"]
    assert said.parameters == ["M", "F_v"]
    assert said.outputs == ["q", "q_dot", "q_ddot"]
    assert (said.saves_state, said.serialises_state, said.once_per_process) == (True, True, False)
    mass = said.variables["M"]
    assert (mass.unit, mass.start, mass.min, mass.max, mass.variability) == (
        "kg",
        95.0,
        1e-3,
        None,
        "tunable",
    )


@pytest.mark.parametrize(
    ("attributes", "size"), [('stepSize="0.02"', 0.02), ('startTime="0" stopTime="1"', None), ("", None)]
)
def test_the_usual_step_is_read_where_the_fmu_says_it(drive, tmp_path, attributes, size):
    element = f"<DefaultExperiment {attributes}/><ModelVariables>".encode()
    own = rb"<DefaultExperiment[^>]*/>\s*<ModelVariables>"
    path = with_description(drive, tmp_path / "step.fmu", own, element)
    assert problems(path) == []
    assert describe(path).step_size == size


def test_missing_file(tmp_path):
    with pytest.raises(BadInput, match=r"gone\.fmu: no such FMU file; build one with 'railfmi build'"):
        Fmu(tmp_path / "gone.fmu")
    with pytest.raises(BadInput, match=r"is a folder; give the \.fmu file"):
        describe(tmp_path)


def test_no_zip_at_all(tmp_path):
    path = tmp_path / "text.fmu"
    path.write_text("this is no zip file")
    with pytest.raises(BadInput, match=r"text\.fmu: not a readable zip file"):
        describe(path)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_file_is_refused_or_still_good(tmp_path_factory, drive_now_path, place, by):
    data = bytearray(drive_now_path.read_bytes())
    data[place * len(data) // 10_001] ^= by
    path = tmp_path_factory.mktemp("damaged") / "damaged.fmu"
    path.write_bytes(data)
    said = outcome(path)
    assert said == "Drive" or said.startswith(f"{path}: ")  # a flipped date or such does no harm
    assert "\n" not in said


def outcome(path):
    """The name of an FMU, or why it is none."""
    try:
        return describe(path).name
    except BadInput as error:
        return str(error)


@pytest.fixture(scope="module")
def drive_now_path(built):
    return built("drive")


def test_half_a_file(drive, tmp_path):
    path = tmp_path / "half.fmu"
    path.write_bytes(drive.read_bytes()[: drive.stat().st_size // 2])
    with pytest.raises(BadInput, match="not a readable zip file"):
        Fmu(path)


@pytest.mark.parametrize(
    "name", ["../evil.txt", "resources/../../evil.txt", "/evil.txt", "C:\\evil.txt", "..\\evil.txt"]
)
def test_a_path_that_leads_outside_is_refused(drive, tmp_path, name):
    path = repacked(drive, tmp_path / "evil.fmu")
    with zipfile.ZipFile(path, "a") as packed:
        packed.writestr(name, "evil")
    with pytest.raises(BadInput, match="leads outside; do not use this file"):
        Fmu(path)
    assert not list(tmp_path.parent.rglob("evil.txt"))


def test_no_description(drive, tmp_path):
    path = repacked(drive, tmp_path / "x.fmu", lambda n, d: None if n == "modelDescription.xml" else (n, d))
    with pytest.raises(BadInput, match=r"x\.fmu: has no modelDescription.xml, so it is no FMU"):
        describe(path)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"", "is no XML"),
        (b"<a>", "is no XML"),
        (b'<?xml version="1.0" encoding="Shift_JIS"?><a/>', "cannot be read"),
        (b'<?xml version="1.0" encoding="nobodys"?><a/>', "cannot be read"),
        (b'<?xml version="1.0"?><!-- -->', "is no XML"),
        (b"<fmiModelDescription/>", "states no version of FMI"),
        (b'<fmiModelDescription fmiVersion="1.0"/>', "is FMI 1.0"),
        (b'<fmiModelDescription fmiVersion="2.0"/>', "cannot be read"),
        (b"<other/>", "is none: it holds <other>"),
    ],
)
def test_an_unreadable_description(drive, tmp_path, text, why):
    path = repacked(drive, tmp_path / "x.fmu", lambda n, d: (n, text if n == "modelDescription.xml" else d))
    with pytest.raises(BadInput, match=rf"x\.fmu: its modelDescription.xml {why}") as refused:
        describe(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("encoding", ["Shift_JIS", "GBK", "ISO-8859-1"])
def test_a_description_in_another_encoding_is_read(drive, tmp_path, encoding):
    def encoded(name, data):
        if name != "modelDescription.xml":
            return name, data
        return name, re.sub(
            r"<\?xml.*?\?>", f'<?xml version="1.0" encoding="{encoding}"?>', data.decode()
        ).encode(encoding)

    path = repacked(drive, tmp_path / "x.fmu", encoded)
    assert [*describe(path).variables] == [*describe(drive).variables]


def test_binaries_for_another_platform(drive, tmp_path):
    def moved(name, data):
        return re.sub(r"^binaries/\w+/", "binaries/other64/", name), data

    path = repacked(drive, tmp_path / "x.fmu", moved)
    with pytest.raises(BadInput, match=r"x\.fmu: has no binary for this platform \(\w+\); it holds other64"):
        Fmu(path)
    path = repacked(drive, path, lambda n, d: None if n.startswith("binaries") else (n, d))
    with pytest.raises(BadInput, match="it holds none"):
        Fmu(path)


def test_neither_co_simulation_nor_model_exchange(drive, tmp_path):
    path = with_description(drive, tmp_path / "x.fmu", rb"<CoSimulation[^>]*/>", b"")
    with pytest.raises(
        BadInput, match=r"x\.fmu: is neither for co-simulation nor for model exchange; export"
    ):
        Fmu(path)


def test_nothing_is_left_behind(drive, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with Fmu(drive) as fmu:
        fmu.restart()
        assert len(list(tmp_path.iterdir())) == 1
    for text in (b"", b"<other/>"):
        bad = repacked(
            drive, tmp_path / "x.fmu", lambda n, d, t=text: (n, t if n == "modelDescription.xml" else d)
        )
        with pytest.raises(BadInput):
            describe(bad)
        bad.unlink()
    assert list(tmp_path.iterdir()) == []
