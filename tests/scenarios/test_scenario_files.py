"""Scenario files: what is read, and that whatever is wrong with them is said in one line."""

import pytest

from fmus.errors import BadInput
from scenarios.simulating import load_scenario, run, run_all
from tests.helpers.scenario_files import (
    GOOD,
    SHIPPED_FILES,
    VARIANTS,
    edited,
    write,
)


def test_a_good_file_says_what_it_says(tmp_path):
    s = load_scenario(write(tmp_path))
    assert (s.id, list(s.variants)) == ("carriage", ["run"])
    assert s.declared.fmus["drive"].parameters == {"M": 50.0, "F_v": 100.0}
    assert s.declared.events[0].set == {"drive.F_v": 400.0}
    assert s.declared.record.format == "parquet"


def test_variants_change_what_they_name_and_keep_the_rest(tmp_path):
    s = load_scenario(write(tmp_path, GOOD + VARIANTS))
    light, heavy = s.variants["light"], s.variants["heavy"]
    assert light.fmus["drive"].parameters == {"M": 10.0, "F_v": 100.0}
    assert heavy.fmus["drive"].parameters == {"M": 500.0, "F_v": 100.0}
    assert heavy.inputs == {"drive.F": 30}
    assert light.inputs == s.declared.inputs


@pytest.mark.parametrize("file", SHIPPED_FILES, ids=lambda f: f.stem)
def test_a_shipped_scenario_is_named_as_its_file_and_asks_something(file):
    s = load_scenario(file)
    assert s.id == file.stem
    assert s.declared.question.endswith("?")
    assert s.declared.figure
    assert all(e.because.strip() for e in s.declared.expect)


# the wrong edit of the good file, and words the message must hold
BAD = [
    ("duration = 2.0", "duratoin = 2.0", "key 'duratoin' is not known; did you mean 'duration'?"),
    ("duration = 2.0", "", "key 'duration' is missing"),
    ("duration = 2.0", "duration = -2.0", "key 'duration' must be greater than 0"),
    ("step = 1e-3", 'step = "1e-3"', "key 'step' must be a number"),
    ('id = "carriage"', 'id = "a/b"', "key 'id'"),
    ('model = "drive"', 'modle = "drive"', "key 'fmus.drive.modle' is not known; did you mean 'model'?"),
    ('model = "drive"', "", "[fmus.drive] needs exactly one of the keys 'model', 'source' and 'fmu'"),
    ('model = "drive"', 'model = "driev"', "[fmus.drive] model 'driev' is not known; did you mean 'drive'?"),
    ('model = "drive"', 'fmu = "none.fmu"', "none.fmu"),
    ('model = "drive"', 'source = "none.py"', "none.py': cannot be read"),
    ('model = "drive"', 'model = "drive"\neffects = ["rust@carriage"]', "rust"),
    ('model = "drive"', 'model = "drive"\ncontact = {cant = 0.05}', "drive has no build option 'cant'"),
    ('model = "drive"', 'model = "drive"\noptions = {cant = 0.05}', "it offers none; leave it out"),
    ('model = "drive"', 'model = "wheelset"\noptions = {wheel = 3}', "wheel = 3.0 must be a name or a file"),
    ('model = "drive"', 'model = "drive"\nfriction = "damp"', "must be one of dry, wet, low, very_low"),
    ("M = 50.0", "Mass = 50.0", "no variable 'Mass'"),
    ("M = 50.0", "M = -1.0", "parameter 'drive.M': -1 is outside"),
    ("M = 50.0", 'M = "50"', "key 'fmus.drive.parameters.M' must be a number"),
    ("{q_dot = 0.5}", "{q_dott = 0.5}", "no variable 'q_dott'; did you mean 'q_dot'?"),
    ('"drive.F" = "100', '"drive.G" = "100', "input 'drive.G'"),
    ('"drive.F" = "100', '"drvie.F" = "100', "there is no FMU 'drvie'; did you mean 'drive'?"),
    ("100 * sin(2 * pi * t)", "100 * sine(t)", "function 'sine' is not known; did you mean 'sin'?"),
    ('"100 * sin(2 * pi * t)"', "[1, 2]", "must be a number, an expression in t in quotes, or a table"),
    ('"100 * sin(2 * pi * t)"', "{times = [0, 1], valeus = [0, 1]}", "did you mean 'values'?"),
    ('"100 * sin(2 * pi * t)"', "{times = [0, 1], values = [0, 1]}", "its table runs from 0 to 1 s"),
    ('"100 * sin(2 * pi * t)"', '{data = "no.csv", time = "t", column = "F"}', "cannot be read"),
    ("time = 1.0\nset", "time = 3.0\nset", "comes after the end at 2 s"),
    ('{"drive.F_v" = 400.0}', '{"drive.q" = 400.0}', "'drive.q' is no parameter"),
    ("rate = 50.0", "rate = -50.0", "key 'sensors.speed.rate' must be greater than 0"),
    ('of = "drive.q_dot"', 'of = "drive.q_dto"', "key 'sensors.speed.of' must name a signal"),
    ("[record]", '[record]\nnames = ["drive.nothing"]', "no variable 'nothing'"),
    ("[record]", '[record]\nformat = "xls"', "key 'record.format' must be one of parquet, csv"),
    ("max(abs(drive.M", "max(abs(drive.Mm", "key 'expect[0].that': there is no signal 'drive.Mm'"),
    ("< 1e-9", "", "key 'expect[0].that'"),
    ("[[expect]]", '[[expect]]\nvariants = ["wet"]', "key 'expect[0].variants': there is no variant 'wet'"),
    ('because = "Newton"', "", "key 'expect[0].because' is missing"),
    ('draw = ["drive.q_dot",', 'draw = ["drive.q_do",', "key 'figure[0].panels[0].draw[0]': there is no"),
    ('names = ["true", "measured"]', 'names = ["true"]', "has 1 'names' for 2 curves"),
    ("[[figure]]", "[contact]\n[[figure]]", "[contact] is a table without motion"),
    ("[[figure]]", '[track]\nkind = "defect"\n[[figure]]', "[track] and [ride]"),
    ("[[figure]]", '[[connections]]\nfrom = "drive.q"\n[[figure]]', "key 'connections[0].to' is missing"),
    ("[[figure]]", '[[connections]]\nform = "a"\nto = "b"\n[[figure]]', "did you mean 'from'?"),
    ("[[figure]]", '[[connections]]\nfrom = "drive.q"\nto = "drive.F_ext"\n[[figure]]', "unit 'm'"),
    ('id = "carriage"', "id = ", "is not valid TOML"),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD)
def test_bad_files_in_one_line(tmp_path, old, new, words):
    file = write(tmp_path, edited(GOOD, (old, new)))
    with pytest.raises(BadInput) as refused:
        run(file, tmp_path / "out")
    message = str(refused.value)
    assert message.startswith(f"{file}: ")
    assert message.count(str(file)) == 1
    assert words in message
    for leaked in ("\n", "pydantic", "Input should", "Value error", "[type="):
        assert leaked not in message


TRACK = """
[track]
kind = "spectrum"
spectrum = "erri_low"
length = 100.0
wavelengths = [3.0, 25.0]
seed = 1

[ride]
V = 20.0
on.drive = {as = "wheelset"}
"""
BAD_TRACKS = [
    ("seed = 1", "sede = 1", "key 'track.sede' is not known; did you mean 'seed'?"),
    ('"erri_low"', '"erri_lwo"', "did you mean 'erri_low'?"),
    ("V = 20.0", 'V = "fast"', "key 'ride.V' must be a number or a table"),
    ("V = 20.0", "V = {times = [0, 1]}", "key 'ride.V.speeds' is missing"),
    ("on.drive", "on.dirve", "key 'ride.on.dirve': there is no FMU 'dirve'; did you mean 'drive'?"),
    ('as = "wheelset"', 'as = "wheel"', "key 'ride.on.drive': model 'wheel' takes no inputs from a track"),
    ('as = "wheelset"', 'as = "wheelset", a1 = 2.0', "on a track has no 'a1'"),
    ('as = "wheelset"', 'as = "wheelset", offset = "far"', "'ride.on.drive.offset' must be a number"),
    ("seed = 1", "seed = 1\n", "input 'drive.y_irr'"),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD_TRACKS)
def test_bad_tracks_in_one_line_with_the_file(tmp_path, old, new, words):
    file = write(tmp_path, GOOD + edited(TRACK, (old, new)))
    with pytest.raises(BadInput) as refused:
        run(file, tmp_path / "out")
    assert str(refused.value).startswith(f"{file}: ")
    assert words in str(refused.value)


BAD_VARIANTS = [
    ('name = "light"', "", "key 'variants[0].name' is missing"),
    ('name = "light"', 'name = "heavy"', "key 'variants[1].name' = 'heavy' is in use already"),
    ('name = "light"', 'name = "drive"', "'drive' is in use already"),
    ('name = "light"', 'name = "very light"', "must be a name of letters"),
    ('name = "light"', 'name = "light"\nquestion = "other"', "cannot differ between variants"),
    ("fmus.drive.parameters.M = 10.0", "fmus.drive.parameter.M = 10.0", "variant 'light': key 'fmus.drive.p"),
    (
        "fmus.drive.parameters.M = 10.0",
        "fmus.drive.parameters.M = -1",
        "variant 'light': parameter 'drive.M'",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD_VARIANTS)
def test_bad_variants_in_one_line(tmp_path, old, new, words):
    file = write(tmp_path, GOOD + edited(VARIANTS, (old, new)))
    with pytest.raises(BadInput) as refused:
        run(file, tmp_path / "out")
    assert str(refused.value).startswith(f"{file}: ")
    assert words in str(refused.value)


BAD_TABLES = [
    ('search = "rigid"', 'search = "rgid"', "[contact] search = 'rgid' is not known; did you mean 'rigid'?"),
    ('search = "rigid"', "reach = 0.5", "[contact] shifts"),
    ('search = "rigid"', 'wheel = "S1003"', "[contact] "),
    ('search = "rigid"', "cnat = 0.05", "key 'contact.cnat' is not known; did you mean 'cant'?"),
    ("contact.phi", "contact.phy", "there is no signal 'contact.phy'; did you mean 'contact.phi'?"),
]
GEOMETRY = """
id = "table"
question = "Does a wheelset roll?"
contact = {search = "rigid"}
expect = [{that = "max(contact.phi) > 0", because = "it climbs"}]
"""


@pytest.mark.parametrize(("old", "new", "words"), BAD_TABLES)
def test_bad_contact_tables_in_one_line(tmp_path, old, new, words):
    file = write(tmp_path, edited(GEOMETRY, (old, new)))
    with pytest.raises(BadInput) as refused:
        run(file, tmp_path / "out")
    assert str(refused.value).startswith(f"{file}: ")
    assert words in str(refused.value)


def test_a_missing_file_an_empty_list_and_an_id_twice_are_refused(tmp_path):
    with pytest.raises(BadInput, match=r"none.toml: cannot be read .* give the path of a scenario"):
        run(tmp_path / "none.toml", tmp_path / "out")
    with pytest.raises(BadInput, match="no scenario given"):
        run_all([], tmp_path / "out")
    file = write(tmp_path)
    with pytest.raises(BadInput, match="id 'carriage' occurs twice"):
        run_all([file, file], tmp_path / "out")
    assert not (tmp_path / "out").exists()
