"""Probabilities of answers are true: of answers said with 70 %, 70 % are right."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimator.closeloop.decision.verdict import completes
from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.evidence import Verdict
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.probability import NO_DISCREPANCY, probabilities
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.size_odds import Left
from estimator.record import Array, Record, Run
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.verdicts import judged

SAMPLES, LIBRARY = 1000, 8
T = np.arange(float(SAMPLES))
FIT = T % 100 < 60  # parts of the record: to identify, to choose, to test
CHOOSE = (T % 100 >= 60) & (T % 100 < 80)
LAWS = [np.sin(0.05 * T + 0.35 * i) for i in range(LIBRARY)]  # neighbours have a correlation of 0.94
STRANGER = np.sign(np.sin(0.021 * T))
SEEN = Detection(0.01, 0.001, {}, 10.0)
UNSEEN = Detection(0.01, 0.5, {}, 0.1)


def asked() -> Problem:
    signal = 100 * np.sin(T)[:, None]
    run = Run(T, signal[:, :0], signal, FIT, CHOOSE, T % 100 >= 80)
    return Problem(lambda _: Path(), Record((run,), (), ("y",), np.ones(1)), {}, {})


def fitted(measured: Array, *laws: int) -> Hypothesis:
    """The least-squares fit of some laws to the part to identify."""
    shapes = np.array([LAWS[i] for i in laws]).reshape(-1, SAMPLES).T
    covariance = np.linalg.inv(shapes[FIT].T @ shapes[FIT])
    sizes = covariance @ (shapes[FIT].T @ measured[FIT])
    unknowns = tuple(Unknown(f"constant_force_{i}_F_0", 0.0, -np.inf, np.inf, 1.0) for i in laws)
    left = measured - shapes @ sizes
    fit = fit_with(unknowns, sizes, covariance, left[FIT], -shapes[FIT])
    candidates = tuple(Candidate("constant_force", str(i), (u,)) for i, u in zip(laws, unknowns, strict=True))
    return Hypothesis(candidates, fit, (left[:, None],))


def answered(measured: Array, verdict: Verdict = "traced") -> dict[str, float]:
    found = [fitted(measured, i) for i in range(LIBRARY)]
    return probabilities(on(measured), SEEN, judged(verdict), promised(measured), found)


def on(measured: Array) -> Baseline:
    return baseline(asked(), fitted(measured), np.ones(1))


def promised(measured: Array) -> list[Promise]:
    base = fitted(measured).fit.cost
    found = (fitted(measured, i) for i in range(LIBRARY))
    return [Promise(h.candidates, base - h.fit.cost, {}) for h in found]


def drawn(rng: np.random.Generator) -> tuple[str, Array]:
    """A label and a record: nothing, a law of the library, or a stranger, as probable as the policy says."""
    prior, noise = DEFAULT.prior, rng.standard_normal(SAMPLES)
    size = rng.normal(0.0, np.sqrt(2))  # whose information is that of one sample
    if rng.random() > prior.effect:
        return NO_DISCREPANCY, noise
    if rng.random() < prior.outside:
        return "outside", noise + size * STRANGER
    law = int(rng.integers(LIBRARY))
    return f"constant_force@{law}", noise + size * LAWS[law]


@pytest.mark.slow
def test_of_what_is_said_with_a_probability_as_many_are_right():
    rng = np.random.default_rng(3)
    said, right = [], []
    for _ in range(1500):
        truth, measured = drawn(rng)
        for label, p in answered(measured).items():
            said.append(p)
            right.append(label == truth)
    said, right = np.array(said), np.array(right)
    for low, high in ((0.05, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 0.95), (0.95, 1.0)):
        held = (said >= low) & (said < high)
        expected, n = said[held].mean(), int(held.sum())
        assert n > 20
        chance = np.sqrt(expected * (1 - expected) / n)
        assert abs(right[held].mean() - expected) < 0.05 + 2 * chance, (low, n, right[held].mean(), expected)


def test_what_outside_mechanisms_leave_is_said_to_be_none_of_these():
    rng = np.random.default_rng(4)
    rest = [1 - sum(answered(rng.standard_normal(SAMPLES) + STRANGER).values()) for _ in range(20)]
    assert min(rest) > 0.99


@given(st.floats(5.0, 10.0), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_noise_that_is_not_declared_may_be_all_that_a_right_answer_leaves(size, seed):
    """It may also be a mechanism outside the library; only the priors tell these apart."""
    rng, prior = np.random.default_rng(seed), DEFAULT.prior
    slow = lfilter([1.0], [1.0, -0.95], rng.standard_normal(SAMPLES))
    measured = rng.standard_normal(SAMPLES) + slow + size * LAWS[2]
    known = on(measured)
    unknown = replace(known, noise=replace(known.noise, declared=np.zeros(1, bool)))
    found = [fitted(measured, i) for i in range(LIBRARY)]
    declared, undeclared = (
        1 - sum(probabilities(b, SEEN, judged("traced"), promised(measured), found).values())
        for b in (known, unknown)
    )
    within = (1 - prior.outside) * (1 - DEFAULT.detection.level)
    assert declared > 0.9
    assert undeclared == pytest.approx(prior.outside / (prior.outside + within * prior.coloured), abs=0.05)


@given(st.floats(3.0, 100.0), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_checks_that_refuse_every_hypothesis_are_evidence_for_none_of_these(size, seed):
    measured = np.random.default_rng(seed).standard_normal(SAMPLES) + size * LAWS[2]
    passed, refused = (
        answered(measured, verdict)["constant_force@2"] for verdict in ("traced", "unexplained")
    )
    error = DEFAULT.detection.level
    odds = passed / (1 - passed) * error / (1 - error)
    assert refused / (1 - refused) == pytest.approx(odds, rel=1e-6)


@given(st.floats(3.0, 100.0), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_a_strong_effect_of_the_library_is_certain(size, seed):
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    found = answered(noise + size * LAWS[2])
    assert next(iter(found)) == "constant_force@2"
    assert found["constant_force@2"] > 0.97


@given(st.floats(0.0, 3.0), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_probabilities_are_probabilities(size, seed):
    found = answered(np.random.default_rng(seed).standard_normal(SAMPLES) + size * LAWS[0])
    assert all(0 <= p <= 1 for p in found.values())
    assert sum(found.values()) <= 1 + 1e-9
    assert list(found.values()) == sorted(found.values(), reverse=True)


def test_two_names_for_one_equation_are_equally_probable():
    noise = np.random.default_rng(5).standard_normal(SAMPLES)
    measured = noise + 2 * LAWS[0]
    one = fitted(measured, 0)
    twin = replace(one, candidates=(replace(one.candidates[0], location="twin"),))
    found = probabilities(
        on(measured), SEEN, judged("ambiguous", [one, twin]), promised(measured), [one, twin]
    )
    assert found["constant_force@0"] == pytest.approx(found["constant_force@twin"], rel=1e-12)
    assert found["constant_force@0"] == pytest.approx(0.5, abs=0.01)


def test_correlated_residuals_are_less_evidence():
    """What a slow error of form leaves cannot tell neighbours apart as white noise could."""
    rng = np.random.default_rng(6)
    white = rng.standard_normal(SAMPLES)
    slow = 20 * np.convolve(rng.standard_normal(SAMPLES + 99), np.ones(100) / 100, "valid")
    sure = answered(white + 3 * LAWS[2])
    less = answered(white + slow + 3 * LAWS[2])
    assert sure["constant_force@2"] > 0.97 > less.get("constant_force@2", 0.0)


@given(st.floats(1.0, 5.0), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_two_effects_that_act_are_more_probable_than_one(size, seed):
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    measured = noise + 2 * LAWS[2] + size * LAWS[6]
    assert completes(on(measured), fitted(measured, 2, 6), fitted(measured, 2), LIBRARY)


def test_what_the_form_leaves_is_no_second_effect():
    """A second effect can take a part of it, which is better than chance but no more probable."""
    better = complete = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        slow = 40 * np.convolve(rng.standard_normal(SAMPLES + 99), np.ones(100) / 100, "valid")
        measured = rng.standard_normal(SAMPLES) + slow + 30 * LAWS[2]
        one = fitted(measured, 2)
        two = min((fitted(measured, 2, i) for i in range(LIBRARY) if i != 2), key=cost)
        better += cost(one) - cost(two) > DEFAULT.decision.noticed
        complete += completes(on(measured), two, one, LIBRARY)
    assert better > 50
    assert complete < 5


@pytest.mark.parametrize(
    ("form", "size", "least", "most"), [(0.0, 0.6, 30, 50), (0.05, 0.6, 0, 2), (0.05, 2.0, 49, 50)]
)
def test_an_open_form_takes_a_second_effect_that_would_not_matter_alone(form, size, least, most):
    """However certain it is: another contact leaves as much in every record."""
    complete = named = 0
    for seed in range(50):
        measured = np.random.default_rng(seed).standard_normal(SAMPLES) + 30 * LAWS[2] + size * LAWS[6]
        problem = replace(asked(), form_error=form)
        found = baseline(problem, fitted(measured), np.ones(1))
        one, two = fitted(measured, 2), fitted(measured, 2, 6)
        complete += completes(found, two, one, LIBRARY)
        said = probabilities(found, SEEN, judged("several"), promised(measured), [one, two])
        named += said.get(two.label, 0.0) > 0.5
    assert least <= complete <= named <= most


def test_what_an_open_form_leaves_is_no_evidence_for_a_pair_by_any_name():
    """Nor is it any against the best single effect beside others of which it is told."""
    measured = np.random.default_rng(7).standard_normal(SAMPLES) + 30 * LAWS[2] + 0.6 * LAWS[6]
    found = baseline(replace(asked(), form_error=0.05), fitted(measured), np.ones(1))
    one, near, two = fitted(measured, 2), fitted(measured, 1), fitted(measured, 2, 6)
    pair = replace(two, candidates=(replace(two.candidates[0], location="twin"), two.candidates[1]))
    assert not completes(found, pair, one, LIBRARY)
    said = probabilities(found, SEEN, judged("traced"), promised(measured), [one, near, pair])
    assert said[one.label] > 0.9
    assert said.get(near.label, 0.0) < 0.01


@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
def test_what_its_own_checks_refuse_is_less_probable_by_their_error(size):
    measured = np.random.default_rng(0).standard_normal(SAMPLES) + size * LAWS[2]
    one = fitted(measured, 2)
    like = replace(one, candidates=(replace(one.candidates[0], location="like"),))
    said, after = (
        probabilities(on(measured), SEEN, judged("traced"), promised(measured), [one, like], refused)
        for refused in ([], [like])
    )
    assert said[one.label] == pytest.approx(said[like.label])
    assert after[like.label] / after[one.label] == pytest.approx(0.01 / 0.99)


@pytest.mark.parametrize("verdict", ["traced", "no_discrepancy", "unexplained"])
def test_an_effect_that_changes_nothing_is_not_what_others_are_compared_with(verdict):
    """It is no discrepancy where the form is open. What fits badly must not be as probable as the rest."""
    measured = np.random.default_rng(0).standard_normal(SAMPLES) + 30 * LAWS[2]
    found = baseline(replace(asked(), form_error=0.05), fitted(measured), np.ones(1))
    right, near = fitted(measured, 2), fitted(measured, 1)
    idle = replace(fitted(measured, 5), fit=found.hypothesis.fit, residuals=found.hypothesis.residuals)
    said = probabilities(found, SEEN, judged(verdict), promised(measured), [right, near, idle])
    assert said.get(idle.label, 0.0) == 0.0
    assert said.get(near.label, 0.0) < 0.01 < said[right.label]


@pytest.mark.parametrize(("size", "declared", "none"), [(5.0, False, True), (30.0, True, False)])
def test_what_changes_less_than_the_form_is_no_discrepancy_unless_more_is_left(size, declared, none):
    """Noise of unknown size may leave anything; noise of a declared size and the form may not."""
    measured = size * np.random.default_rng(4).standard_normal(SAMPLES) + 3 * LAWS[2]
    found = baseline(replace(asked(), form_error=0.2), fitted(measured), np.ones(1))
    found = replace(found, noise=replace(found.noise, declared=np.full(1, declared)))
    small = fitted(measured, 2)
    said = probabilities(found, SEEN, judged("unexplained"), promised(measured), [small])
    assert said.get(small.label, 0.0) == 0.0
    assert (said.get(NO_DISCREPANCY, 0.0) > 0.5) is none


def test_where_the_answer_is_refused_so_are_all_others():
    measured = np.random.default_rng(3).standard_normal(SAMPLES) + LAWS[1] + LAWS[2]
    every = [fitted(measured, i) for i in (1, 2, 3)]
    none, all_of_them = (
        probabilities(on(measured), SEEN, judged("unexplained"), promised(measured), every, refused)
        for refused in ([], every)
    )
    assert none == all_of_them


def test_without_fits_the_screening_says_whether_there_is_an_effect():
    rng, early = np.random.default_rng(7), judged("no_discrepancy")
    quiet = rng.standard_normal(SAMPLES)
    for measured, least, most in ((quiet, 0.9, 1.0), (quiet + 0.5 * LAWS[0], 0.0, 0.01)):
        found = probabilities(on(measured), UNSEEN, early, promised(measured), [])
        assert least <= found[NO_DISCREPANCY] <= most


def test_a_small_residual_may_be_of_an_effect_and_a_large_one_is():
    rng = np.random.default_rng(8)
    for size, least, most in ((0.0, 0.75, 0.95), (0.3, 0.7, 0.95), (15.0, 0.0, 0.01)):
        measured = rng.standard_normal(SAMPLES) + size * LAWS[0]
        found = probabilities(on(measured), SEEN, judged("no_discrepancy"), [], [])
        assert least <= found[NO_DISCREPANCY] <= most, size


@pytest.mark.parametrize("samples", [10, 1000, 10**5, 10**7])
@pytest.mark.parametrize("signal_over_noise", [1.0, 30.0, 1000.0])
def test_the_larger_what_is_left_the_more_probable_is_an_effect(samples, signal_over_noise):
    error = np.sqrt(2 / samples) / signal_over_noise**2
    left = Left(DEFAULT.prior.material, min(0.02, 0.5 / signal_over_noise))
    odds = [odds_of(left, np.array([s]), np.array([error])) for s in np.geomspace(1e-9, 1.0, 60)]
    assert np.diff(odds).min() > -1e-3 * max(odds)
    assert odds[0] < 1.0
    assert odds[-1] > 1e3 or error > 0.1


def odds_of(left: Left, share: Array, error: Array) -> float:
    return float(np.exp(left.by_effect(share, error) - left.by_form(share, error)))


@pytest.mark.parametrize("signals", [1, 4])
@pytest.mark.parametrize("spread", [0.5, 0.8])
def test_the_probability_of_no_effect_is_true_on_sizes_of_another_form(spread, signals):
    """What a right model leaves is lognormal, not exponential; effects have a Pareto tail, and leave most."""
    rng, form, matters, n = np.random.default_rng(9), DEFAULT.prior.material, 1e-3, 2000
    effect = rng.random(n) < 0.5
    strong = np.minimum(matters * (1 + rng.pareto(0.5, n)), 1.0)[:, None] * rng.beta(2, 1.5, (n, signals))
    mean = form * 10.0 ** rng.uniform(-4, 0, n)[:, None]
    weak = mean * np.exp(rng.normal(-(spread**2) / 2, spread, (n, signals)))
    error = 10.0 ** rng.uniform(-7, -5, (n, signals))
    share = np.where(effect[:, None], strong, weak) ** 2 + error * rng.standard_normal((n, signals))
    left = Left(form, matters)
    said = np.array([1 / (1 + odds_of(left, s, e)) for s, e in zip(share, error, strict=True)])
    for low, high in ((0.0, 0.2), (0.2, 0.7), (0.7, 1.0)):
        held = (said >= low) & (said < high)
        assert held.sum() > 100
        assert (~effect[held]).mean() == pytest.approx(said[held].mean(), abs=0.15), (low, high)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_what_several_signals_leave_does_not_depend_on_their_order(seed):
    rng = np.random.default_rng(seed)
    share, error = 10.0 ** rng.uniform(-8, -2, 4), 10.0 ** rng.uniform(-7, -4, 4)
    left, turned = Left(0.01, 1e-3), rng.permutation(4)
    assert odds_of(left, share, error) == pytest.approx(odds_of(left, share[turned], error[turned]))
    none = np.zeros(0)
    assert odds_of(left, none, none) == pytest.approx(1.0)


def test_a_record_that_shows_nothing_leaves_the_prior():
    found = probabilities(on(np.zeros(SAMPLES)), UNSEEN, judged("insufficient_excitation"), [], [])
    assert found == {NO_DISCREPANCY: 1 - DEFAULT.prior.effect}


def test_a_dead_sensor_is_no_comparison():
    assert probabilities(on(np.zeros(SAMPLES)), SEEN, judged("sensor_fault"), [], []) == {}
