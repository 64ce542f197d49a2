"""The README's promises for tracks and data: each source, defect and format is one new file, also outside."""

import pandas as pd
import pytest

from tests.helpers.experiment_files import GOOD, table
from tests.helpers.further import Further

SINE = '''
"""A sine of the level."""

from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Positive
from scenarios.track.sources.source import Source
from scenarios.track.track import Track


class Sine(Source):
    """A sine of the level from distance 0 on."""

    kind: ClassVar[str] = "sine"
    amplitude: Positive
    wavelength: Positive
    length: Positive

    def track(self, folder):
        """See Source.track."""
        s = np.linspace(0.0, self.length, 1 + int(self.length / self.wavelength * 40))
        return Track.from_samples(s, {"level": self.amplitude * np.sin(2 * np.pi * s / self.wavelength)})
'''
SQUAT = '''
"""A squat: a short hollow."""

from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Positive
from scenarios.track.defects.defect import Defect
from scenarios.track.rails import Quantity


class Squat(Defect):
    """A bell of a `width` [m]."""

    shape: ClassVar[str] = "squat"
    on: Quantity = "level"
    width: Positive

    def unit(self, x):
        """See Defect.unit."""
        bell = np.exp(-((x / self.width) ** 2))
        return bell, -2 * x / self.width**2 * bell

    @property
    def reach(self):
        """See Defect.reach."""
        return 4 * self.width
'''
ON_TRACK = """
id = "own_track"
question = "Does a vehicle feel a source and a defect of one's own?"
duration = 2.0
step = 1e-2

[fmus.vehicle]
model = "vehicle7dof"

[track]
kind = "sine"
amplitude = 2e-3
wavelength = 10.0
length = 100.0

[ride]
V = 20.0
on.vehicle = {offset = 30.0}

[record]
names = ["vehicle.u_fl", "vehicle.u_rl"]
step = 1e-2

[[variants]]
name = "plain"

[[variants]]
name = "spoilt"
track.add = [{shape = "squat", position = 50.0, height = -6e-3, width = 0.5}]

[[expect]]
that = "abs(max(plain.vehicle.u_fl) - 2e-3) < 1e-5"
because = "the source has this amplitude"

[[expect]]
that = "abs(min(spoilt.vehicle.u_fl - plain.vehicle.u_fl) + 6e-3) < 1e-5"
because = "the defect has this depth"
"""
MOVING = '''
"""Windows in which something moves."""

from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Positive
from scenarios.watching.triggers.trigger import Trigger


class Moving(Trigger):
    """A column changes by `more` at least."""

    kind: ClassVar[str] = "moving"
    column: str
    more: Positive

    @property
    def columns(self):
        """See Trigger."""
        return (self.column,)

    def holds(self, window):
        """See Trigger."""
        return bool(np.ptp(window[self.column]) >= self.more)
'''
WATCH = """
experiment = "experiment.toml"
stream.folder = "."
[[trigger]]
kind = "moving"
column = "v"
more = 2.0
"""
TSV = '''
"""Tables with tabs."""

from typing import ClassVar

import pandas as pd

from scenarios.experiment.readers.reader import Reader
from scenarios.experiment.readers.sheet import Sheet


class Tsv(Reader):
    """Rows are called by the lines of the file."""

    kind: ClassVar[str] = "TSV"
    suffixes: ClassVar[tuple[str, ...]] = (".tbl",)

    def sheet(self, file, time, columns):
        """See Reader.sheet."""
        cells = pd.read_csv(file, sep="\\t")
        return Sheet(file, cells, tuple(cells.columns), row="line", first=2)
'''

LOAD = """
from pathlib import Path
import numpy as np
from fmus.errors import BadInput
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from tests.helpers.experiment_files import RIG

def load(suffix):
    return load_record(load_experiment(Path(f"{suffix}.toml")), RIG).runs[0]
"""


@pytest.fixture
def mine(tmp_path):
    return Further(tmp_path)


@pytest.mark.slow
def test_a_track_source_and_a_track_defect_are_one_file_each(mine):
    mine.write("scenarios/track/sources/sine.py", SINE)
    mine.write("scenarios/track/defects/squat.py", SQUAT)
    (mine.work / "own_track.toml").write_text(ON_TRACK)
    mine.railfmi("run", "own_track.toml", "--out", "out")
    (mine.work / "own_track.toml").write_text(ON_TRACK.replace("amplitude", "amplitud"))
    assert "did you mean 'amplitude'" in mine.refused("run", "own_track.toml", "--out", "out")


@pytest.mark.slow
def test_a_track_defect_gets_the_contract_tests_for_free(mine):
    mine.write("scenarios/track/defects/squat.py", SQUAT)
    assert mine.passes("tests/scenarios/test_track.py", "-k", "squat or by_hand") == 10


@pytest.mark.slow
def test_a_trigger_of_a_stream_is_one_file(mine):
    mine.write("scenarios/watching/triggers/moving.py", MOVING)
    (mine.work / "watch.toml").write_text(WATCH)
    read = """
import numpy as np
from scenarios.watching.declaration import load_watching
[trigger] = load_watching("watch.toml").trigger
print(trigger.holds({"v": np.array([1.0, 3.5])}), trigger.holds({"v": np.ones(2)}), trigger.sentence)
"""
    assert mine.says(read) == "True False outside the trigger moving of v"
    (mine.work / "watch.toml").write_text(WATCH.replace("more", "moore"))
    assert "did you mean 'more'" in mine.refused("watch", "watch.toml", "--out", "out")


def write(mine: Further, data: pd.DataFrame) -> None:
    """An experiment with its data as CSV, and one with them in the format of one's own."""
    mine.write("scenarios/experiment/readers/tbl.py", TSV)
    for suffix, separator in (("csv", ","), ("tbl", "\t")):
        data.to_csv(mine.work / f"data.{suffix}", sep=separator, index=False)
        (mine.work / f"{suffix}.toml").write_text(GOOD.replace("data.csv", f"data.{suffix}"))


def test_a_data_format_is_one_file(mine):
    data = pd.DataFrame(table())
    write(mine, data)
    compare = """
a, b = load("csv"), load("tbl")
print(all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("t", "u", "y", "fit", "test")), a.y.size)
"""
    assert mine.says(LOAD + compare) == f"True {2 * len(data)}"


def test_a_data_format_has_all_checks_of_the_data(mine):
    data = pd.DataFrame(table()).astype({"torque": object})
    data.loc[3, "torque"] = "off"
    write(mine, data)
    said = mine.says(LOAD + "try:\n    load('tbl')\nexcept BadInput as error:\n    print(error)")
    assert "data.tbl line 5: column 'torque' holds 'off', not a number" in said


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('(".tbl",)', '(".csv",)', "'.csv' is also of CSV"),
        ("suffixes:", "suffices:", "has no 'suffixes'"),
    ],
)
def test_a_data_format_that_cannot_be_chosen_is_refused(mine, old, new, words):
    mine.write("scenarios/experiment/readers/tbl.py", TSV.replace(old, new))
    (mine.work / "experiment.toml").write_text(GOOD)
    said = mine.refused("estimate", "experiment.toml", "--out", "out")
    assert words in said
    assert "Tsv of scenarios.experiment.readers.tbl" in said
