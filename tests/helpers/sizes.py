"""The size of models' programs: what compiles a large one, or builds it with every effect, is a slow test.

A new model is in all contract tests; which of them are slow for it follows from its equations.
"""

import pytest

from fmus.model import equations
from fmus.models import MODELS
from tests.helpers.everything import EVERY_MODEL

LARGE = 500  # instructions; beyond it a compiler or the trials with every effect take 2 s to 40 s
ALL = ("all",)  # effects


def instructions(name):
    """Number of instructions of an internal step of a model, with those of the tables and laws it calls."""
    step = equations(MODELS[name]()).step
    listed = [f for f in (step, *step.find_functions()) if f.class_name() in ("SXFunction", "MXFunction")]
    return sum(f.n_instructions() for f in listed)


SIZES = {name: instructions(name) for name in EVERY_MODEL}
SMALLEST = min(SIZES, key=SIZES.__getitem__)


def _marks(slow):
    return pytest.mark.slow if slow else ()


def marks_of(size):
    """Marks of a test of a model with so many instructions."""
    return _marks(size > LARGE)


by_size = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=marks_of(SIZES[name])) for name in EVERY_MODEL]
)
quick_if_smallest = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=_marks(name != SMALLEST)) for name in EVERY_MODEL]
)
bare_and_with_all_effects = pytest.mark.parametrize(
    ("name", "effects"),
    [pytest.param(name, (), id=f"{name}-bare") for name in EVERY_MODEL]
    + [
        pytest.param(name, ALL, id=f"{name}-all effects", marks=marks_of(SIZES[name])) for name in EVERY_MODEL
    ],
)
