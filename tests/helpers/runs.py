"""Runs of models' FMUs with inputs that move: what several tests of builds share."""

import numpy as np
import pytest

from fmus.drive.model import Drive
from fmus.variables import Input, Parameter, State
from tests.helpers.everything import EVERY_MODEL, near_start

DT = 1e-4  # s, a communication step that is one internal step
every_model = pytest.mark.parametrize("name", EVERY_MODEL)


def names(model, kind):
    return [v.name for v in model.of(kind)]


def start_of(model, point):
    """States, inputs and parameters by name, from x, u, p."""
    kinds = (State, Input, Parameter)
    return {
        n: float(v)
        for k, part in zip(kinds, point, strict=True)
        for n, v in zip(names(model, k), part, strict=True)
    }


def stirred(model, rng, steps=30):
    """Rows of inputs about their start."""
    return [
        dict(zip(names(model, Input), near_start(model, rng)[1].tolist(), strict=True)) for _ in range(steps)
    ]


def run(fmu, rows, dt=DT):
    """All outputs after each step."""
    found = []
    for row in rows:
        fmu.step(dt, **row)
        found.append(fmu.read(fmu.description.outputs))
    return np.array(found)


def heavier(mass):
    """The drive with another start value: another version of the FMU of that name."""
    return type(
        "Drive", (Drive,), {"M": Parameter("kg", mass, min=1e-3, doc=Drive.M.doc), "__doc__": Drive.__doc__}
    )()
