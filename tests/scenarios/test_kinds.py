"""Whole numbers, truths and arrays by the commands: a scenario, its package, a comparison, an experiment."""

import json
import re
import zipfile

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED
from fmus.host.archive import describe
from fmus.host.fmu import Fmu
from fmus.host.master.master import Master
from fmus.host.master.recording import read_recording
from scenarios.cli.app import run_safely
from scenarios.comparing.comparing import compare
from scenarios.exchange import export_ssp, import_ssp
from scenarios.experiment.experiment import check_names, load_experiment
from scenarios.simulating import run

COUNTED = """
id = "counted"
question = "Do whole numbers and truths arrive?"
duration = 2.0
step = 0.125
[fmus.one]
fmu = "{0}"
parameters = {{ mode = 2 }}
initial = {{ count = 5 }}
[fmus.two]
fmu = "{0}"
initial = {{ x = 1.5 }}
[inputs]
"one.n" = 3
"one.on" = 0
[[connections]]
from = "one.product"
to = "two.n"
gain = 2.0
[[connections]]
from = "one.odd"
to = "two.on"
[[expect]]
that = "abs(last(two.product) - 12) < 0.1 and abs(last(one.count) - 21) < 0.1 and min(two.on) > 0.9"
because = "3 times 2 goes in twice, and 3 is odd"
[record]
names = ["one.product", "one.count", "one.odd", "two.n", "two.on", "two.x", "two.product"]
"""
EXPERIMENT = """
id = "whole"
fmu = "{}"
data = "data.csv"
time = "time"
[split]
identify = [0.0, 7.0]
test = [7.0, 14.0]
[parameters]
{}
[inputs]
n = "n"
[outputs.{}]
column = "y"
unit = "1"
model_unit = "1"
"""


@pytest.fixture
def counted(kinds, tmp_path):
    file = tmp_path / "counted.toml"
    file.write_text(COUNTED.format(kinds[2]))
    return file


def recorded(folder):
    return read_recording(folder / "run.parquet").data


def test_a_scenario_and_its_package_run_alike(counted, tmp_path):
    first = run(counted, tmp_path / "out")
    assert first.ok
    data = recorded(tmp_path / "out")
    assert_array_equal(data["two.x"], 1.5 + 0.125 * 12 * np.arange(17))
    package = export_ssp(counted, tmp_path)
    with zipfile.ZipFile(package) as packed:
        structure = packed.read("SystemStructure.ssd").decode()
        values = packed.read("resources/one.ssv").decode()
    assert re.search(r'name="product" kind="output">\s*<ssc:Integer />', structure)
    assert re.search(r'name="odd" kind="output">\s*<ssc:Boolean />', structure)
    assert re.search(r'name="x" kind="output">\s*<ssc:Real />', structure)
    assert re.search(r'name="mode" kind="parameter" />', structure)  # the type of an enumeration is the FMU's
    for name, value in {"mode": 'Integer value="2"', "n": 'Integer value="3"'}.items():
        assert re.search(rf'name="{name}">\s*<ssv:{value}', values)
    assert re.search(r'name="on">\s*<ssv:Boolean value="false"', values)
    again = run(import_ssp(package, tmp_path / "back"), tmp_path / "again")
    assert again.ok
    pd.testing.assert_frame_equal(recorded(tmp_path / "again"), data)


def test_no_line_goes_through_whole_numbers_and_truths(kinds):
    """Extrapolation changes nothing, and a table keeps its last entry."""
    read = ["b.n", "b.on", "b.product"]
    of_b = []
    for extrapolation in ("hold", "linear"):
        with Master(
            {"a": kinds[2], "b": kinds[2]}, [("a.product", "b.n"), ("a.odd", "b.on")], step=0.125,
            order="jacobi", extrapolation=extrapolation, refresh=False, record=read,
            inputs={"a.n": ([0.0, 0.5, 1.0], [1, 4, 5]), "a.on": 1},
        ) as master:  # fmt: skip
            of_b.append(master.run(np.float64(1.0)).data[read].to_numpy())
    assert_array_equal(*of_b)
    assert [*dict.fromkeys(of_b[0][:, 0].tolist())] == [1.0, 4.0]


def test_an_fmu_in_another_process_is_not_coupled(kinds):
    with Fmu(kinds[2], ISOLATED) as apart, pytest.raises(BadInput, match="give its Archive"):
        Master({"a": apart, "b": kinds[2]}, [("a.count", "b.n")], step=0.125)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            '[fmus.it]\nfmu = "{3}"\nparameters = {{ "A[2,1]" = 7.0 }}',
            "element of the array 'A', and SSP 1.0",
        ),
        (
            '[fmus.it]\nfmu = "{3}"\n[inputs]\n"it.n" = "3 * t"',
            "'it.n' takes whole numbers and changes over time",
        ),
        ('[fmus.it]\nfmu = "{3}"\n[inputs]\n"it.u[1]" = "sin(t)"', r"element of the array 'u'"),
    ],
)
def test_what_a_package_cannot_hold_is_said(kinds, tmp_path, line, words):
    file = tmp_path / "it.toml"
    text = 'id = "it"\nquestion = "?"\nduration = 1.0\nstep = 0.125\n' + line.format(
        *[kinds.get(i) for i in range(4)]
    )
    file.write_text(text + '\n[[expect]]\nthat = "last(it.count) >= 0"\nbecause = "it runs"\n')
    assert run(file, tmp_path / "out").ok
    with pytest.raises(BadInput, match=words):
        export_ssp(file, tmp_path)


def test_a_run_that_an_fmu_ends_says_so(kinds, tmp_path, capsys):
    file = tmp_path / "it.toml"
    file.write_text(
        'id = "it"\nquestion = "?"\nduration = 5.0\nstep = 0.125\n'
        f'[fmus.it]\nfmu = "{kinds[3]}"\nparameters = {{ end = 1.0 }}\n'
        '[[expect]]\nthat = \'max(abs("it.y[2]")) < 100\'\nbecause = "it stays small"\n'
    )
    assert run_safely(["run", str(file), "--out", str(tmp_path / "out")]) == 0
    said = "'it' (Kinds.fmu): it asks to end the simulation at t = 1 s: the road ends here"
    assert f"the run ended early: {said}" in " ".join(capsys.readouterr().out.split())
    table = json.loads((tmp_path / "out" / "result.json").read_text())
    assert table["ok"] is True
    assert (table["runs"]["run"]["ended"], table["runs"]["run"]["simulated_seconds"]) == (said, 1.0)
    assert recorded(tmp_path / "out")["time"].iloc[-1] == 1.0


def experiment(kinds, folder, output, parameters=""):
    t = 0.125 * np.arange(113)
    pd.DataFrame({"time": t, "n": np.arange(113) % 5, "y": t}).to_csv(folder / "data.csv", index=False)
    file = folder / "experiment.toml"
    file.write_text(EXPERIMENT.format(kinds[2], parameters, output))
    return file


def test_whole_numbers_are_compared(kinds, tmp_path):
    file = experiment(kinds, tmp_path, "product", "mode = 2")
    found = compare(kinds[2], kinds[2], file)
    assert {"x", "count", "product", "odd"} <= set(found.outputs)
    assert all(d.agrees and d.largest == 0 for d in found.outputs.values())


def test_they_are_not_estimated_from(kinds, tmp_path):
    e = load_experiment(experiment(kinds, tmp_path, "product"))
    with pytest.raises(BadInput, match="'n' of Counted is of type Integer; only scalar real variables"):
        check_names(e, describe(kinds[2]))
