"""Candidates of a record: how far they may go."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.candidates import INERTIAS, _limited, _of_a_force
from estimator.closeloop.screening.missing_force import MissingForce
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw
from fmus.host.description import PortNames
from fmus.models import MODELS
from fmus.variables import Parameter
from tests.helpers.everything import EVERY_MODEL

PARAMETERS = [
    pytest.param(p, id=f"{name}.{p.name}")
    for name in EVERY_MODEL
    for p in MODELS[name]().of(Parameter)
    if p.start > 0
]


def change_of(p: Parameter) -> Unknown:
    return _limited(Unknown("delta", 0.0, -float("inf"), float("inf"), 0.05 * p.start), p, DEFAULT.candidates)


@pytest.mark.parametrize("p", PARAMETERS)
def test_a_change_leaves_an_inertia_and_may_take_away_all_else_that_can_vanish(p):
    least = p.start + change_of(p).low
    if p.unit in INERTIAS:
        assert 0.1 * p.start <= least * (1 + 1e-12)
    elif p.min == 0.0:
        assert least <= 0.0


ROUNDED = [(n, shape) for n, e in EFFECTS.items() if issubclass(e, ForceLaw) for shape in e.rounded]


def test_laws_that_turn_at_once_say_so():
    assert {n for n, _ in ROUNDED} == {"coulomb_friction", "stribeck_friction", "hysteresis"}


@pytest.mark.parametrize(("kind", "shape"), ROUNDED)
@given(st.floats(1e-4, 10.0), st.floats(0.1, 20.0))
def test_a_force_that_turns_sooner_than_the_record_could_show_is_as_sudden_as_any(kind, shape, size, f):
    """It turns while the motion passes the rounding; that takes a sample, on half of the turns."""
    sample = 0.05 / f
    t = np.arange(0.0, 20.0 / f, sample)
    q = size * np.sin(2 * np.pi * f * t)
    v = np.gradient(q, t)
    seen = MissingForce(PortNames("p", "F", "q", "v"), t, np.sign(v), np.full(len(t), 0.1), q, v)
    motion = {"velocity": v, "displacement": q}[EFFECTS[kind].rounded[shape]]
    found = list(_of_a_force(EFFECTS[kind], "p", seen, sample))
    assert found
    for c in found:
        [passed] = c.visible.values()
        assert passed == pytest.approx(np.median(np.abs(np.diff(motion))))
        assert set(c.visible) == {f"{kind}_p_{shape}"}
        assert set(c.visible) <= {u.name for u in c.shape}
