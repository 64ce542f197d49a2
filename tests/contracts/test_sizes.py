"""Which tests of models are slow follows from the length of the models' programs, and none is left out."""

import casadi as cs
import pytest

from fmus.drive.model import Drive
from fmus.models import MODELS
from tests.helpers.everything import EVERY_MODEL
from tests.helpers.sizes import (
    LARGE,
    SIZES,
    SMALLEST,
    bare_and_with_all_effects,
    by_size,
    instructions,
    quick_if_smallest,
)


class Tabled(Drive):
    """The drive with a function that its equations call."""

    name = "Tabled"
    x = cs.MX.sym("x")
    called = cs.Function("called", [x], [x * cs.sin(cs.cos(cs.exp(x)))])

    def derivatives(self):
        (more,) = self.call(self.called, self.q)
        found = super().derivatives()
        return {name: dot + more * (name == "q_dot") for name, dot in found.items()}


def slow(parameters):
    """Names of the parameters that are marked slow, and of those that are not."""
    marked = {True: [], False: []}
    for p in parameters.args[1]:
        marked[any(mark.name == "slow" for mark in p.marks)].append(p.values)
    return marked


def test_what_a_model_calls_counts(monkeypatch):
    monkeypatch.setitem(MODELS, "tabled", Tabled)
    assert instructions("tabled") > instructions("drive") > 0


@pytest.mark.parametrize("divided", [by_size, quick_if_smallest, bare_and_with_all_effects])
def test_every_model_is_in_every_division_and_some_are_quick(divided):
    found = slow(divided)
    assert {name for name, *_ in found[True] + found[False]} == set(EVERY_MODEL)
    assert found[False]
    assert found[True]


def test_a_large_model_is_slow_where_it_is_compiled_or_has_every_effect():
    large = {name for name, size in SIZES.items() if size > LARGE}
    assert {name for (name,) in slow(by_size)[True]} == large
    assert {name for name, _ in slow(bare_and_with_all_effects)[True]} == large
    assert {name for name, effects in slow(bare_and_with_all_effects)[False] if not effects} == set(
        EVERY_MODEL
    )
    assert SMALLEST not in large
