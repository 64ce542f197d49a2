"""What sets in and when, what is left once an effect explains, and how long it all takes."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from estimator.closeloop import progress
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import one_curve
from estimator.closeloop.fitting import fitter
from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.search import dating
from estimator.closeloop.search.onset import grown
from estimator.closeloop.search.pairs import beside, beyond_doubt, enough_beside, try_pairs, with_worth
from estimator.record import Record, Run
from estimator.weighting import Weighting
from fmus.effects import EFFECTS
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.carriage import (
    looked_at,
    problem,
    record,
    to_and_fro,
)
from tests.helpers.problems import OneByOne, record_with

LIMITS = DEFAULT.search

# ---- what sets in


@given(st.integers(6, 44), st.floats(12.0, 50.0), st.integers(0, 99))
def test_growth_is_dated(k, times, seed):
    squares = np.random.default_rng(seed).chisquare(40, 50) / 40
    assert grown(squares, 5, LIMITS.sets_in_times, LIMITS.sets_in_chance) is None
    squares[k:] *= times
    assert grown(squares, 5, LIMITS.sets_in_times, LIMITS.sets_in_chance) == pytest.approx(k, abs=1)
    assert grown(squares, 5, 2 * times, LIMITS.sets_in_chance) is None


def test_a_single_burst_does_not_set_in():
    squares = np.ones(50) + 0.01 * np.arange(50) % 0.05
    squares[30] = 400.0
    assert grown(squares, 5, LIMITS.sets_in_times, LIMITS.sets_in_chance) is None


@given(st.floats(0.0, 0.5), st.floats(0.6, 1.0), st.floats(0.0, 1.0), st.floats(-50.0, 50.0))
def test_shares_of_the_fitted_part_are_dated_wherever_it_lies(first, last, share, begin):
    t = begin + np.linspace(0.0, 40.0, 2001)
    fit = (t - begin >= 40.0 * first) & (t - begin <= 40.0 * last)
    run = Run(t, t[:, None], t[:, None], fit, ~fit, ~fit)
    at = run.fit_time(share)
    assert at == pytest.approx(40.0 * (first + share * (last - first)), abs=0.03)
    assert run.fit_share(at) == pytest.approx(share, abs=1e-6)
    assert np.mean(t[fit] - begin < at) == pytest.approx(share, abs=0.01)
    assert (run.fit_share(0.0), run.fit_share(41.0)) == (0.0, 1.0)


# ---- second effects


def one(kind: str, location: str = "wheel") -> Candidate:
    return Candidate(kind, location, (Unknown(f"{kind}_{location}_c", 0.0, -np.inf, np.inf, 1.0),))


def several(*kinds: tuple[str, str], squares: float = 100.0) -> Hypothesis:
    candidates = tuple(one(*kind) for kind in kinds)
    unknowns = tuple(u for c in candidates for u in c.unknowns)
    n = len(unknowns)
    residual = np.full(100, np.sqrt(squares / 100))
    return Hypothesis(candidates, fit_with(unknowns, np.ones(n), np.eye(n), residual, np.zeros((100, n))), ())


@pytest.mark.parametrize(
    ("kinds", "curve"),
    [
        ((("coulomb_friction", "wheel"), ("quadratic_damping", "wheel")), True),
        ((("coulomb_friction", "wheel"), ("quadratic_damping", "roller")), False),
        ((("coulomb_friction", "wheel"), ("constant_force", "wheel")), False),
        ((("viscous_damping", "wheel"), ("cubic_stiffness", "wheel")), False),
        ((("bump_stop", "wheel"), ("cubic_stiffness", "wheel")), True),
        ((("sensor_gain", "wheel"), ("sensor_bias", "wheel")), False),
    ],
)
def test_two_laws_of_one_motion_at_one_place_are_a_curve(kinds, curve):
    assert one_curve(several(*kinds)) is curve


@pytest.mark.parametrize("kind", sorted(k for k, e in EFFECTS.items() if e.over))
def test_a_law_and_its_limits_are_over_the_same_motion_or_none(kind):
    limits = [other for other in EFFECTS[kind].becomes if other != "constant_force"]
    assert {EFFECTS[other].over for other in limits} <= {EFFECTS[kind].over}


@pytest.mark.parametrize(("before", "enough"), [(9e3, DEFAULT.decision.noticed), (5e6, 5e3)])
@pytest.mark.parametrize(
    ("richer", "counts"),
    [
        ([("stribeck_friction", "wheel")], True),
        ([("stribeck_friction", "roller")], False),
        ([("step_force", "roller"), ("coulomb_friction", "wheel")], True),
        ([("step_force", "roller"), ("coulomb_friction", "roller")], False),
    ],
)
def test_a_law_is_outgrown_where_more_gains_much_more_than_chance(before, enough, richer, counts):
    simple, base = several(("coulomb_friction", "wheel"), squares=2e4), several(squares=2e4 + before)
    for gain, expected in ((0.0, False), (0.9 * enough, False), (1.1 * enough, counts)):
        form = form_of(baseline(SimpleNamespace(policy=DEFAULT, form_error=0.0), base))
        assert form.outgrown(simple, several(*richer, squares=2e4 - gain)) is expected


def test_a_second_effect_is_compared_with_noise_and_not_with_what_the_calibrated_fmu_leaves():
    h = several(("coulomb_friction", "wheel"), squares=4000.0)
    h = replace(h, fit=replace(h.fit, residual=np.ones(4000)))
    declared = SimpleNamespace(policy=DEFAULT, noise=SimpleNamespace(std=np.ones(1), scale=np.ones(1)))
    noise = SimpleNamespace(std=np.ones(1), scale=np.full(1, 2.0))  # weights by twice as much
    limit = DEFAULT.search.second_effect**2 * 4000
    assert enough_beside(declared, h) == pytest.approx(limit)
    assert enough_beside(SimpleNamespace(policy=DEFAULT, noise=noise), h) == pytest.approx(limit / 4)
    noise.scale = np.full(1, 100.0)  # chance remains
    assert enough_beside(SimpleNamespace(policy=DEFAULT, noise=noise), h) == DEFAULT.decision.noticed


class Seen:
    """A screening of white noise; see Screening."""

    weighting, group = Weighting.white(np.ones(1)), 1


@pytest.mark.parametrize(
    ("second", "form", "asked"),
    [
        (0.0, 0.0, []),
        (4.0, 0.0, []),
        (12.0, 0.0, []),
        (20.0, 0.0, ["viscous_damping@roller"]),
        (20.0, 0.02, []),  # a third of the noise: another form leaves as much
        (50.0, 0.02, ["viscous_damping@roller"]),
    ],
)
def test_a_second_effect_is_asked_for_where_the_residual_is_like_it(second, form, asked):
    rng = np.random.default_rng(3)
    laws = [one(kind, at) for kind in ("viscous_damping", "cubic_stiffness") for at in ("wheel", "roller")]
    change = [(c, rng.standard_normal((4000, 1))) for c in laws]
    best = one("viscous_damping", "wheel")
    g = {c.label: column[:, 0] / np.linalg.norm(column) for c, column in change}
    residual = rng.standard_normal(4000) - second * g["viscous_damping@roller"]
    found = fit_with(best.unknowns, np.ones(1), np.eye(1), residual, change[0][1])
    t, every = np.arange(4000.0), np.ones(4000, bool)
    measured = 100 * np.sin(t)[:, None]
    run = Run(t, measured[:, :0], measured, every, every, every)
    made = Record((run,), (), ("y",), np.ones(1))
    at = Problem(lambda _: Path(), made, {}, {}, form_error=form)
    fitted = []
    asking = SimpleNamespace(
        baseline=baseline(at), hypotheses=lambda promises, _: fitted.extend(promises) or []
    )
    beside(asking, [Hypothesis((best,), found, (residual[:, None],))], Seen(), change)
    assert [p.candidates[1].label for p in fitted] == asked
    assert all(p.candidates[0] is best for p in fitted)


@pytest.mark.parametrize(("further", "asked"), [(1, True), (0, False)])
def test_a_second_effect_is_asked_for_beside_a_law_with_fewer_unknowns_than_the_best(further, asked):
    """A law with a further unknown may have taken up some of it; another law of one unknown has not."""
    rng = np.random.default_rng(3)
    simple, second, rich = (one("viscous_damping"), one("viscous_damping", "roller"), one("bump_stop"))
    rich = replace(rich, shape=further * (Unknown("bump_stop_wheel_gap", 1.0, 0.0, np.inf, 1.0),))
    column = rng.standard_normal((4000, 1))
    g, noise = column[:, 0] / np.linalg.norm(column), rng.standard_normal(4000)

    def fitted(law, left):
        n = len(law.unknowns)
        slopes = rng.standard_normal((4000, n))
        found = fit_with(law.unknowns, np.ones(n), np.eye(n), noise - left * g, slopes)
        return Hypothesis((law,), found, ())

    promised = []
    asking = SimpleNamespace(
        baseline=baseline(SimpleNamespace(policy=DEFAULT, form_error=0.0)),
        hypotheses=lambda promises, _: promised.extend(promises) or [],
    )
    beside(asking, [fitted(rich, 10.0), fitted(simple, 30.0)], Seen(), [(second, column)])
    labels = [[c.label for c in p.candidates] for p in promised]
    assert (["viscous_damping@wheel", "viscous_damping@roller"] in labels) is asked


@pytest.mark.parametrize(
    ("freed", "alone", "idle"),
    [
        (900.0, None, []),  # much worse without the stop, whose stiffness has no upper bound
        (104.0, None, ["bump_stop"]),  # hardly worse
        (900.0, 104.0, ["bump_stop"]),  # the fit without it had only not arrived
    ],
)
def test_a_member_that_errors_leave_in_doubt_is_needed_if_the_fit_without_it_is_worse(freed, alone, idle):
    pair = several(("viscous_damping", "wheel"), ("bump_stop", "wheel"))
    pair = replace(pair, fit=replace(pair.fit, values=np.array([10.0, 1.0])))  # of errors of 1
    rest = several(("viscous_damping", "wheel"), squares=freed)
    asked = []
    fitter = SimpleNamespace(
        baseline=baseline(SimpleNamespace(policy=DEFAULT)),
        finished=lambda promises: asked.extend(promises) or [rest],
    )
    singles = [] if alone is None else [several(("viscous_damping", "wheel"), squares=alone)]
    [valued], _ = with_worth(fitter, [pair], singles)
    assert [p.label for p in asked] == ["viscous_damping@wheel"]
    assert [c.kind for c in fitter.baseline.idle(valued)] == idle


def test_a_pair_that_is_clear_by_its_errors_is_fitted_without_nothing():
    pair = several(("viscous_damping", "wheel"), ("bump_stop", "wheel"))
    pair = replace(pair, fit=replace(pair.fit, values=np.array([10.0, 10.0])))
    fitter = SimpleNamespace(baseline=baseline(SimpleNamespace(policy=DEFAULT)))
    assert with_worth(fitter, [pair], []) == ([pair], [])


@pytest.mark.parametrize(
    ("converged", "size", "squares", "again"),
    [
        (False, 1.0, 300.0, True),
        (True, 1.0, 300.0, False),  # the record leaves it in doubt
        (False, 10.0, 300.0, False),  # nothing is in doubt
        (False, 1.0, 500.0, False),  # no rival of the best pair
    ],
)
def test_an_unfinished_fit_leaves_no_pair_in_doubt(converged, size, squares, again):
    best = several(("viscous_damping", "wheel"), ("bump_stop", "wheel"), squares=100.0)
    best = replace(best, fit=replace(best.fit, values=np.array([10.0, 10.0])))
    short = several(("viscous_damping", "wheel"), ("cubic_stiffness", "wheel"), squares=squares)
    short = replace(short, fit=replace(short.fit, values=np.array([10.0, size]), converged=converged))
    right = replace(short, fit=replace(short.fit, residual=0.1 * short.fit.residual))
    asked = []
    fitter = SimpleNamespace(
        baseline=baseline(SimpleNamespace(policy=DEFAULT)),
        finished=lambda promises: asked.extend(promises) or [right],
    )
    found = beyond_doubt(fitter, [best, short])
    assert [p.label for p in asked] == [short.label] * again
    assert found == ([right, best] if again else [best, short])


def test_a_partner_is_sought_in_the_shape_that_what_the_first_effect_leaves_suggests(tmp_path):
    """A harmonic force at 2.3 Hz that does not show beside a spring of ten times its size."""

    def truth(t: float, q: float, v: float) -> float:
        return 2e3 * q**3 + 30.0 * float(np.sin(2 * np.pi * 2.3 * t))

    asked = problem(ModelBuilder("drive", tmp_path), record(to_and_fro(2.0), truth, 1))
    o = looked_at("spring", asked, ("cubic_stiffness",)).found
    offers = [(kind, "carriage") for kind in ("cubic_stiffness", "harmonic_excitation")]
    candidates = physical_candidates(asked, offers, o.forces)
    screening = Screening(asked, o.base.fit, o.baseline.noise.weighting, o.forces)
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    found, _ = try_pairs(Fitter(o.baseline), screening, o.singles, change)
    both = min(found, key=cost)
    assert both.theta["harmonic_excitation_carriage_f"] == pytest.approx(2.3, abs=0.01)
    assert both.theta["cubic_stiffness_carriage_k_3"] == pytest.approx(2e3, rel=0.02)
    assert both.fit.beyond_noise < 5 * np.sqrt(2 * len(both.fit.residual))
    before = [c.shape[0].start for c in candidates if c.kind == "harmonic_excitation"]
    assert min(abs(f - 2.3) for f in before) > 0.1


# ---- dating


class Swinging(OneByOne):
    """A force that sets in on an oscillator; the sum of squares over its moment has a minimum a swing."""

    policy, fmu = DEFAULT, Path("swinging.fmu")

    def __init__(self, moment: float) -> None:
        t = np.linspace(0.0, 20.0, 4000)
        fit = t < 15.0
        self.run = Run(t, t[:, None], self.simulate(t, 1.0, moment), fit, ~fit, ~fit)
        self.record = record_with(runs=(self.run,), noise_declared=np.array([True]), outputs=("y",))
        self.free_states = ()

    def simulate(self, t: np.ndarray, size: float, moment: float) -> np.ndarray:
        since = np.maximum(t - moment, 0.0)
        return (size * (1.0 - np.cos(6.0 * since)) * np.exp(-0.2 * since))[:, None]

    def residuals(self, theta: Mapping[str, float]) -> list[np.ndarray]:
        return [self.run.y - self.simulate(self.run.t, *theta.values())]

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        return self.residuals(theta)[0][self.run.fit]


@settings(max_examples=10, deadline=None)
@given(st.floats(4.0, 9.0), st.floats(-0.7, 0.7))
def test_a_moment_some_swings_off_is_found(moment, off):
    asked, size = Swinging(moment), np.array([0.1])
    own = Unknown("F_0", 0.0, -9.0, 9.0, 1.0), Unknown("step_t0", moment + off, -np.inf, np.inf, 0.1)
    late = Candidate("step_force", "wheel", own[:1], own[1:])
    start = fit(asked, own, Weighting.white(size), {"F_0": 1.0})
    assume(abs(start.theta["step_t0"] - moment) < 0.7)  # as far as is looked
    h = Hypothesis((late,), start, tuple(asked.residuals(start.theta)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dating, "built", lambda problem, _: problem)
        patch.setattr(fitter, "built", lambda problem, _: problem)
        [best] = dating.dated(Fitter(baseline(asked, noise=size)), [h])
    assert best.theta["step_t0"] == pytest.approx(moment, abs=0.01)
    assert cost(best) <= cost(h)


# ---- laws that the part to identify cannot tell apart


# ---- progress


def test_the_time_of_each_stage_is_counted(monkeypatch):
    clock = iter([0.0, 1.0, 3.0, 7.0, 12.0])
    monkeypatch.setattr(progress, "monotonic", lambda: next(clock))
    said = []
    stages = progress.Progress(said.append)
    stages("a", "beginning")
    stages("b", "going on")
    stages("a", "once more")
    stages.end()
    assert stages.seconds == {"a": 7.0, "b": 4.0}
    assert said == ["beginning", "going on", "once more"]


# ---- labels


def test_the_order_of_a_pair_makes_no_other_hypothesis():
    a, b = ("coulomb_friction", "wheel"), ("actuator_gain", "T_P")
    better, worse = several(a, b, squares=90.0), several(b, a, squares=100.0)
    assert best_by_label([worse, better]) == [better]


def test_what_sets_in_is_no_part_of_a_curve():
    late = Candidate(
        "damping_change", "wheel", one("damping_change").amplitudes, (Unknown("x_t0", 9.0, 0.0, 20.0, 1.0),)
    )
    h = several(("coulomb_friction", "wheel"), ("damping_change", "wheel"))
    assert one_curve(h)
    assert not one_curve(replace(h, candidates=(h.candidates[0], late)))
