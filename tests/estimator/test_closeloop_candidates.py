"""Candidates of a record: how far they may go."""

import pytest

from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.candidates import INERTIAS, _limited
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
