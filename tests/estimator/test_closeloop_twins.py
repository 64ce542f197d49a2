"""Twins: effects that act in exactly the same way are fitted once, and no experiment tells them apart."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.twins import Twins
from estimator.closeloop.planning.advice import next_experiment
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.noise import Noise
from estimator.record import Record, Run
from fmus.export.builders.hypotheses import ModelBuilder

FREE = (-np.inf, np.inf)
T = np.arange(400) * 0.005


def candidate(kind: str, at: str, parameter: str = "F_0") -> Candidate:
    return Candidate(kind, at, (Unknown(f"{kind}_{at}_{parameter}", 0.0, *FREE, 1.0),))


def nothing_calibrated(residual: np.ndarray) -> Fit:
    return Fit((), np.zeros(0), np.zeros((0, 0)), residual, ())


def hypothesis(c: Candidate, size: float = 3.0) -> Hypothesis:
    fit = replace(nothing_calibrated(np.ones(4)), unknowns=c.unknowns, values=np.array([size]))
    return Hypothesis((c,), fit, (np.ones((2, 2)),))


def test_effects_that_act_alike_are_named_together() -> None:
    g, h = np.arange(4.0)[:, None], np.ones((4, 1))
    one, two, other = (candidate("coulomb_friction", at) for at in ("wheelset_yaw", "primary_yaw", "contact"))
    viscous = candidate("viscous_damping", "primary_yaw")
    twins = Twins.among([(one, g), (two, g.copy()), (other, h), (viscous, g)])
    assert twins.others == {"coulomb_friction@wheelset_yaw": ("coulomb_friction@primary_yaw",)}
    assert twins.left_out == {"coulomb_friction@primary_yaw"}
    first, second = twins.joined([hypothesis(one)])
    assert (first.label, second.label) == ("coulomb_friction@wheelset_yaw", "coulomb_friction@primary_yaw")
    assert second.theta == {"coulomb_friction_primary_yaw_F_0": 3.0}
    assert second.residuals is first.residuals


@given(st.lists(st.sampled_from("abcdef"), unique=True, min_size=1), st.integers(0, 6))
def test_what_is_joined_is_reduced_to_what_was_fitted(places: list[str], cut: int) -> None:
    """Whichever of the joined hypotheses an answer names, work is done on each set of twins once."""
    twins = Twins({f"step_force@{at}": (f"step_force@{at}1", f"step_force@{at}2") for at in "abc"})
    fitted = [hypothesis(candidate("step_force", at), i) for i, at in enumerate(places)]
    joined = twins.joined(fitted)
    assert twins.reduced(joined, fitted) == fitted
    named = joined[cut:]
    found = twins.reduced(named, fitted)
    assert {h.label for h in found} == {twins.fitted(h.label) for h in named}
    assert len({h.label for h in found}) == len(found)


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[Baseline, list[Hypothesis]]]:
    def asked(model: str, u: dict[str, float], outputs: tuple[str, ...], kind: str, *places: str):
        """A record whose inputs all move alike, and hypotheses of one kind at several places."""
        builder = ModelBuilder(model, tmp_path_factory.mktemp(model))
        known = builder.outside().description
        move = np.sin(2 * np.pi * 1.5 * T)
        given = np.column_stack([u.get(n, 0.0) * move for n in known.inputs])
        every = np.ones(len(T), bool)
        noise = 1e-4 * np.random.default_rng(0).standard_normal((len(T), len(outputs)))
        run = Run(T, given, noise, every, every, every)
        record = Record((run,), tuple(known.inputs), outputs, np.full(len(outputs), 1e-4))
        problem = Problem(builder, record, {}, {}, (), builder.ports)
        nothing = nothing_calibrated(np.zeros(len(T) * len(outputs)))
        baseline = Baseline(problem, Hypothesis((), nothing, (run.y,)), Noise.of(record, (run.y,), 3.0))
        return baseline, [hypothesis(candidate(kind, at, "c"), 2e3) for at in places]

    return asked


@pytest.mark.slow
def test_no_experiment_is_advised_for_what_acts_alike_under_any_inputs(asked) -> None:
    """The suspended mass does not yaw, so that a damper of its yaw spring is one of the wheelset's yaw."""
    baseline, members = asked(
        "wheelset", {"y_a": 1e-3, "v": 0.0}, ("y",), "viscous_damping", "wheelset_yaw", "primary_yaw"
    )
    twins = Twins({members[0].label: (members[1].label,)})
    words = next_experiment(baseline, members, twins)
    assert words.startswith("no experiment with this FMU tells viscous_damping at wheelset_yaw and ")
    assert "different amounts" not in words


@pytest.mark.slow
def test_what_is_alike_by_the_symmetry_of_a_record_is_not_alike_in_another(asked) -> None:
    """If all wheels rise alike, both front dampers act alike on the bounce; on other tracks they differ."""
    u = {f"u_{c}": 1e-3 for c in ("fl", "fr", "rl", "rr")}
    baseline, members = asked("vehicle7dof", u, ("z1",), "viscous_damping", "primary_fl", "primary_fr")
    twins = Twins({members[0].label: (members[1].label,)})
    words = next_experiment(baseline, members, twins)
    assert "in exactly the same way" not in words
    assert "different amounts" in words
