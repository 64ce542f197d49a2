"""A small scenario for tests, whole and changed, and where the shipped ones lie."""

import json
from pathlib import Path

from scenarios.simulating import run
from tests.helpers.paths import SHIPPED

SHIPPED_FILES = sorted(SHIPPED.glob("*.toml"))
GOOD = """
id = "carriage"
question = "Does a pushed carriage obey Newton?"
duration = 2.0
step = 1e-3

[fmus.drive]
model = "drive"
parameters = {M = 50.0, F_v = 100.0}
initial = {q_dot = 0.5}

[inputs]
"drive.F" = "100 * sin(2 * pi * t)"

[[events]]
time = 1.0
set = {"drive.F_v" = 400.0}

[sensors.speed]
of = "drive.q_dot"
rate = 50.0
noise = 1e-3

[record]
step = 2e-3

[[expect]]
that = "max(abs(drive.M * drive.q_ddot + drive.F_v * drive.q_dot - drive.F)) < 1e-9"
because = "Newton"

[[figure]]
name = "speed"
title = "Speed of a carriage"

[[figure.panels]]
draw = ["drive.q_dot", "sensors.speed"]
names = ["true", "measured"]
label = "speed"
unit = "mm/s"
"""
VARIANTS = """
[[variants]]
name = "light"
fmus.drive.parameters.M = 10.0

[[variants]]
name = "heavy"
fmus.drive.parameters.M = 500.0
inputs."drive.F" = 30
"""


def write(folder: Path, text: str = GOOD, name: str = "scenario.toml") -> Path:
    """The scenario file with that text."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def ran(folder: Path, text: str = GOOD, **options):
    """The result of a scenario of that text, and what stands in its result.json."""
    result = run(write(folder, text), folder / "out", **options)
    return result, json.loads((folder / "out" / "result.json").read_text(encoding="utf-8"))


def edited(text: str, *changes: tuple[str, str]) -> str:
    """A text with parts replaced, each of which must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text
