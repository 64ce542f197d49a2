"""Records as loggers write them and files that are mixed up: what is taken as it is, and what is said."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.kept import Kept
from fmus.errors import BadInput
from scenarios.cli.app import run_safely
from scenarios.experiment.checks import check_time
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers import read_sheet
from scenarios.preparing.draft import draft
from scenarios.preparing.initialising import Initialised
from scenarios.preparing.lines_above import lines_above
from scenarios.preparing.survey import survey
from scenarios.preparing.text import toml_of
from scenarios.preparing.trial import dry_run
from tests.helpers.paths import SHIPPED
from tests.scenarios.test_preparing import MOTOR, T, log

DEMO = SHIPPED / "demo" / "rig-drag"
ABOVE = st.lists(st.sampled_from(["Logger 7", "Serial;1234", "", "rate,100 Hz", '"a, b"']), max_size=8)


def edited(folder, change, **record):
    """The record of a motor with its lines changed."""
    file = log(folder, **record)
    file.write_text("\n".join(change(file.read_text().splitlines())) + "\n")
    return file


def told(folder, file):
    """What init says of a record, and the experiment that it writes, as text and as it is read."""
    [raster] = survey(file)
    made = draft(folder / "Motor.fmu", MOTOR, [raster])
    toml = folder / "experiment.toml"
    toml.write_text(toml_of(made, folder))
    return Initialised(toml, made).lines(), toml.read_text(), load_experiment(toml)


# --- lines above the names


@given(ABOVE, st.sampled_from([",", ";", "\t"]))
def test_lines_above_the_names_are_counted(tmp_path_factory, above, separator):
    file = tmp_path_factory.mktemp("above") / "log.csv"
    table = [["time", "speed", "current"], ["s", "rpm", "mA"]]
    table += [[str(0.1 * i), str(i % 7), "1,5" if separator == ";" else "1.5"] for i in range(40)]
    file.write_text("\n".join([*above, *(separator.join(row) for row in table)]) + "\n")
    assert lines_above(file) == len(above)
    sheet = read_sheet(file, options={"skiprows": len(above)} if above else {})
    assert sheet.known == ("time", "speed", "current")


def test_without_names_no_line_is_above_them(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("".join(f"{i},{2 * i}\n" for i in range(30)))
    assert lines_above(file) == 0
    file.write_text("time,speed\ns,rpm,mA\n" + "".join(f"{i},{i % 3},2\n" for i in range(30)))
    assert lines_above(file) == 0  # a name is missing, and units are no names
    with pytest.raises(BadInput, match="has more cells than line 1 has names"):
        survey(file)
    assert lines_above(tmp_path / "gone.csv") == 0
    assert lines_above(DEMO / "experiment.toml") == 0


def test_what_no_experiment_can_mend_is_told_without_one(tmp_path):
    with pytest.raises(BadInput, match="is a folder; give the path of the data file in it"):
        survey(tmp_path)
    file = edited(tmp_path, lambda lines: [*lines[:60], "1,2,3,4,5,6", *lines[61:]])
    with pytest.raises(BadInput, match=r"line 61: has 6 cells, and the lines above it have 4; mend it$"):
        survey(file)


def test_an_experiment_is_drafted_from_a_record_with_lines_above_its_names(tmp_path):
    file = edited(tmp_path, lambda lines: ["Logger 7 export", "Serial;1234", "", *lines])
    lines, _, e = told(tmp_path, file)
    assert lines[0].endswith("time in column 'time'; 3 lines above the names are left out")
    assert (e.data_file, e.data_options) == ("log.csv", {"skiprows": 3})


# --- the time


def test_milliseconds_are_known_by_the_name_of_the_time(tmp_path):
    file = log(tmp_path, "", names="time_ms,voltage,speed,current", t=10 * np.arange(T.size))
    lines, text, e = told(tmp_path, file)
    assert "1000 rows from 0 to 9.99 s, 100 Hz, time in column 'time_ms', in ms by its name" in lines[0]
    assert 'time_unit = "ms"  # a guess, by the name of the column' in text
    assert e.time_unit == "ms"
    assert e.split.test[1] == pytest.approx(9.99)


def test_a_stated_unit_counts_more_than_a_name(tmp_path):
    file = log(tmp_path, "s,V,rpm,mA", names="time_ms,voltage,speed,current", begin=0.0)
    [raster] = survey(file)
    assert raster.time_unit is None
    assert raster.t[-1] == pytest.approx(9.99)


def blank(cell):
    """The first cell of line 52 replaced."""
    return lambda lines: [*lines[:51], f"{cell},{lines[51].partition(',')[2]}", *lines[52:]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (blank(""), ["line 52: time column 'time' holds no number"]),
        (blank("pause"), ["line 52: column 'time' holds 'pause', not a number"]),
        (lambda lines: [*lines[:102], *lines[52:]], ["line 103: time column 'time' goes from"]),
        (
            lambda lines: [*lines[:2], *(f"{i // 60:02d}:{i % 60:05.2f},1,2,3" for i in range(50))],
            ["line 3: time column 'time' holds '00:00.00'; write seconds, hours:minutes:seconds"],
        ),
    ],
    ids=["an empty cell", "a word", "it goes back", "minutes or hours"],
)
def test_a_time_that_does_not_increase_is_shown_where(tmp_path, change, words):
    with pytest.raises(BadInput, match=r"or name another column with --time: time, voltage") as raised:
        survey(edited(tmp_path, change))
    assert all(word in str(raised.value) for word in words)


@pytest.mark.parametrize(
    ("names", "cells", "words"),
    [
        ("Nr,Zeit,v", "{i},noon {i},{x}", "line 2: column 'Zeit' holds 'noon 0'"),
        ("sample,time,v", "{i},{half},{x}", "line 3: time column 'time' goes from 0 to 0 s"),
        ("Weg,Uhrzeit,v", "{i},12:{i:02},{x}", "line 2: time column 'Uhrzeit' holds '12:00'; write"),
        ("Nr,lap [s],v", "{i},{x},{x}", "line 9: time column 'lap [s]' goes from"),
        ("time [S],n,v", "{i},{i},{x}", "unit 'S' does not fit 's'"),
        ("Weg [m],t [degC],v", "{i},{i},{x}", "unit 'degC' does not fit 's'"),
    ],
)
def test_no_other_column_stands_in_for_one_that_is_called_time(tmp_path, names, cells, words):
    file = tmp_path / "log.csv"
    rows = [cells.format(i=i, half=i // 2, x=i % 7) for i in range(40)]
    file.write_text("\n".join([names, *rows]) + "\n")
    with pytest.raises(BadInput, match="; or name another column with --time: ") as raised:
        survey(file)
    assert words in str(raised.value)


def test_a_column_that_no_one_calls_time_is_a_guess_and_has_no_other_unit(tmp_path):
    file = log(
        tmp_path, "", names="voltage,T_load,speed,current", t=np.sin(T), u=np.cos(T), n=np.arange(T.size)
    )
    lines, text, e = told(tmp_path, file)
    assert lines[0].endswith("time in column 'speed', a guess: it increases, and no column is called time")
    assert 'time = "speed"  # a guess: it increases, and no column is called time\n' in text
    assert e.time == "speed"
    [named] = survey(file, "speed")
    assert not named.time_guessed
    [called] = survey(log(tmp_path))
    assert not called.time_guessed
    with pytest.raises(BadInput, match="no column increases"):
        survey(log(tmp_path, "V,N.m,rpm,A", names="a,b,c,d", t=np.sin(T), u=np.cos(T), n=np.arange(T.size)))


@pytest.mark.parametrize(
    ("name", "unit"),
    [("TIME_MS", "ms"), ("t_min", "min"), ("timeUs", "us"), ("Zeit_h", "h"), ("t", None), ("t_0", None)],
)
def test_the_unit_at_the_end_of_the_name_of_the_time(tmp_path, name, unit):
    [raster] = survey(log(tmp_path, "", names=f"{name},voltage,speed,current"))
    assert (raster.time, raster.time_unit) == (name, unit)


@pytest.mark.parametrize(
    ("t", "way"),
    [([0.0, 0.1, 0.1], "write them with more digits, or drop"), ([0.0, 0.1, 0.0], "cut the file")],
)
def test_times_that_do_not_increase_are_refused_with_the_way_out(t, way):
    with pytest.raises(BadInput, match=rf"a\.csv line 4: .* must increase from row to row: .*{way}"):
        check_time("a.csv", "time", np.array(t), np.arange(2, 5))


# --- columns, units and names


def test_a_column_that_is_left_out_for_one_word_is_named(tmp_path):
    file = edited(tmp_path, lambda lines: [*lines[:60], "1235.08,0.1,overrun,3", *lines[61:]])
    lines, _, e = told(tmp_path, file)
    assert "omega" not in e.outputs
    [said] = [line for line in lines if line.startswith("not used: ")]
    assert "line 61: column 'speed' holds 'overrun', not a number" in said


def test_a_unit_that_is_not_known_is_told(tmp_path):
    lines, text, _ = told(tmp_path, log(tmp_path, "s,V,furlong,mA"))
    assert any("furlong (not known)" in line for line in lines)
    assert 'a guess: the record states "furlong", which is not known' in text


def test_numbers_in_place_of_names_are_told(tmp_path):
    with pytest.raises(BadInput, match=r"the line of the column names holds numbers \(1234\.5, "):
        survey(edited(tmp_path, lambda lines: lines[2:]))


@pytest.mark.parametrize("command", ["close-loop", "estimate", "plan", "run"])
def test_a_record_in_place_of_an_experiment_is_told(tmp_path, capsys, command):
    assert run_safely([command, str(DEMO / "data.csv"), "--out", str(tmp_path / "out")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "data.csv: is no file of TOML; give " in said
    assert ("'railfmi init MODEL.fmu RECORD' drafts one" in said) == (command != "run")


# --- the trial


def test_the_simulation_whose_time_is_told_is_made_and_not_remembered(monkeypatch):
    remembered, get = [], Kept.get

    def watched(kept, *asked):
        found = get(kept, *asked)
        remembered.append(found is not None)
        return found

    monkeypatch.setattr(Kept, "get", watched)
    assert dry_run(DEMO).seconds > 0
    assert len(remembered) >= 2
    assert not any(remembered)


def test_the_trial_is_one_object_with_json(tmp_path, capsys):
    command = ["close-loop", str(DEMO), "--dry-run", "--out", str(tmp_path), "--json"]
    assert run_safely(command) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert set(result["outputs"]) == {"omega_w", "omega_r"}
    assert 0 < result["expected_seconds"][0] < result["expected_seconds"][1]
