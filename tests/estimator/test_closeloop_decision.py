"""Which residual matters, and when an effect accounts for it: with and without an open form of the FMU."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.decision.equivalence import equivalent
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import clear_as_reported, judge, needed, probable
from estimator.closeloop.detection.importance import importance
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.relations import becomes, limits
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.probability import NO_DISCREPANCY
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.size_odds import beyond_form
from estimator.record import Record, Run
from fmus.effects import EFFECTS
from scenarios.closing.result import effects_of
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.verdicts import DETECTED

SAMPLES, SIGNAL, NOISE = 4000, 30.0, np.ones(2)  # SIGNAL: rms of each output over its noise
T = np.arange(2.0 * SAMPLES)
FORM = 0.2  # of an output, so 6 times the noise


def matters(problem: Problem, h: Hypothesis, likeness: float = 1.0) -> bool:
    return importance(baseline(problem, h, NOISE), likeness, False) >= 1.0


def asked(form_error: float = 0.0) -> Problem:
    y = SIGNAL * np.sqrt(2) * np.sin(T)[:, None] * np.ones(2)
    run = Run(T, y[:, :0], y, T < SAMPLES, T >= SAMPLES, T >= SAMPLES)
    return Problem(lambda _: Path(), Record((run,), (), ("a", "b"), NOISE), {}, {}, form_error=form_error)


def alike(best: Hypothesis, found: list[Hypothesis], form: float = 0.0) -> list[Hypothesis]:
    return equivalent(baseline(asked(form), noise=NOISE), best, found)


def left(*rms: float) -> Hypothesis:
    """What leaves residuals of exactly these rms values."""
    one = np.where(np.arange(len(T)) % 2, 1.0, -1.0)
    nothing = fit_with((), np.zeros(0), np.zeros((0, 0)), one, np.zeros((len(T), 0)))
    return Hypothesis((), nothing, (one[:, None] * np.array(rms),))


@pytest.mark.parametrize(
    ("rms", "matter"),
    [((1.0, 1.0), False), ((1.02, 0.98), False), ((1.0, 1.2), True), ((3.0, 1.0), True)],
)
def test_what_chance_makes_of_noise_does_not_matter(rms, matter):
    assert matters(asked(), left(*rms)) is matter


@pytest.mark.parametrize(
    ("early", "late", "matter"),
    [
        (5.0, 1.0, True),  # an actuator that saturates in the part to identify alone
        (1.02, 1.0, False),
        (1.06, 1.06, False),
        (1.2, 1.0, True),
        (1.0, 1.2, True),
    ],
)
def test_both_parts_matter(early, late, matter):
    assert matters(asked(), in_parts(early, late)) is matter


def in_parts(early: float, late: float) -> Hypothesis:
    """What leaves residuals of these rms values in the part to identify and in the held-out part."""
    h = left(1.0, 1.0)
    return replace(h, residuals=(np.where(T < SAMPLES, early, late)[:, None] * h.residuals[0],))


@pytest.mark.parametrize(
    ("rms", "likeness", "matter"),
    [
        ((1.3, 1.0), 0.05, False),  # what another form of contact leaves
        ((5.0, 1.0), 0.05, False),
        ((1.3, 1.0), 0.3, False),
        ((1.3, 1.0), 0.6, True),  # what one effect could explain
        ((1.02, 1.0), 0.9, False),
        ((8.0, 1.0), 0.05, True),
    ],
)
def test_an_open_form_leaves_what_is_like_no_effect_alone(rms, likeness, matter):
    assert matters(asked(FORM), left(*rms), likeness) is matter


@given(st.floats(1.0, 20.0), st.floats(1.0, 20.0), st.floats(0.0, 1.0))
def test_less_matters_where_the_form_is_open(a, b, likeness):
    if matters(asked(FORM), left(a, b), likeness):
        assert matters(asked(), left(a, b))
    assert likeness >= DEFAULT.decision.most or not matters(
        asked(FORM), left(min(a, 5.9), min(b, 5.9)), likeness
    )


@pytest.mark.parametrize(
    ("form", "before", "after", "found"),
    [
        (0.0, (5.0, 1.0), (1.01, 1.0), (True, True)),
        (
            0.0,
            (5.0, 1.0),
            (1.19, 1.0),
            (False, True),
        ),  # 95 % of the way, but 2 % of the signal left
        (0.0, (50.0, 1.0), (2.0, 1.0), (False, True)),
        (0.0, (50.0, 1.0), (1.15, 1.0), (True, True)),  # as little as any form leaves
        (0.0, (1.5, 1.0), (1.15, 1.0), (False, True)),  # but not 95 % of the way
        (0.0, (5.0, 1.0), (2.0, 1.0), (False, True)),
        (FORM, (20.0, 1.5), (5.0, 1.5), (True, True)),  # within what the form leaves, and no worse
        (FORM, (20.0, 1.5), (5.0, 1.7), (True, False)),
        (
            FORM,
            (20.0, 1.5),
            (7.0, 1.5),
            (False, True),
        ),  # three quarters of it gone, but more left than form leaves
        (FORM, (200.0, 1.5), (7.0, 1.5), (False, True)),
        (FORM, (20.0, 1.5), (12.0, 1.5), (False, True)),
        (FORM, (7.0, 1.5), (5.5, 1.5), (False, False)),  # within it, but hardly anything of it gone
        (FORM, (3.0, 1.3), (2.6, 1.2), (False, False)),  # all was small: half of it has to go
        (FORM, (3.0, 1.3), (2.0, 1.2), (True, True)),
    ],
)
def test_an_effect_accounts_for_what_it_brings_down(form, before, after, found):
    problem, one = (
        asked(form),
        replace(left(*after), candidates=(law("constant_force", 0, 0.0).candidates[0],)),
    )
    assert tuple(form_of(baseline(problem, left(*before), NOISE)).reached(one).tolist()) == found


@pytest.mark.parametrize(("early", "found"), [(1.0, True), (1.3, False)])
def test_what_is_left_where_the_effect_was_fitted_counts_too(early, found):
    """A transient may show in the part to identify alone; a wrong law leaves some of it there."""
    [one] = [replace(in_parts(early, 1.0), candidates=law("coulomb_friction", 0, 1.0).candidates)]
    assert form_of(baseline(asked(), left(4.0, 4.0), NOISE)).reached(one).all() == found


@pytest.mark.parametrize(
    ("before", "after", "at", "found"),
    [
        ((1.9, 1.3), (1.9, 1.0), "b", True),  # form is left in the other one
        ((1.9, 1.3), (1.9, 1.0), "a", False),
        ((1.9, 1.3), (1.9, 1.15), "b", False),  # a gain that makes up for half of the form there
        ((1.9, 1.3), (2.1, 1.0), "b", False),
        ((1.9, 1.1), (1.9, 1.0), "b", False),  # as little as that is form
    ],
)
def test_a_fault_of_a_sensor_takes_nearly_all_from_its_own_output(before, after, at, found):
    fault = replace(left(*after), candidates=(Candidate("sensor_gain", at, ()),))
    assert form_of(baseline(asked(FORM), left(*before), NOISE)).reached(fault).all() == found


@pytest.mark.parametrize(
    ("before", "after", "at", "more"),
    [
        ((1.5, 1.0), (1.0, 1.0), None, True),  # weak, but all that is beyond noise
        ((20.0, 20.0), (19.9, 19.9), None, False),  # hardly anything of what coloured noise may be
        ((20.0, 20.0), (14.5, 14.5), None, False),  # less than half of it, and less than the form
        ((20.0, 20.0), (13.0, 13.0), None, True),  # 7 times the noise, more than the form leaves
        ((20.0, 5.0), (20.0, 2.0), "b", True),  # most of its own output
        ((20.0, 5.0), (20.0, 2.0), "a", False),
    ],
)
def test_what_an_effect_changes_is_more_than_form_or_most_of_the_residual(before, after, at, more):
    one = law("constant_force", 0, 0.0) if at is None else fault_of(at)
    one = replace(left(*after), candidates=one.candidates)
    found = baseline(asked(FORM), left(*before), NOISE)
    assert (beyond_form(found, one) >= 1.0) is more
    assert beyond_form(baseline(asked(), left(*before), NOISE), one) == np.inf


@given(st.floats(0.0, 1.0), st.floats(1.0, 50.0))
def test_a_larger_change_is_never_less_than_form(share, size):
    found = baseline(asked(FORM), left(size, 1.0), NOISE)
    smaller, larger = (
        beyond_form(found, replace(left(size * (1 - part), 1.0), candidates=fault_of("a").candidates))
        for part in (share / 2, share)
    )
    assert larger >= smaller - 1e-9


def fault_of(output):
    """A gain of the sensor of an output."""
    return replace(left(1.0, 1.0), candidates=(Candidate("sensor_gain", output, ()),))


@pytest.mark.parametrize(
    ("early", "late", "found"),
    [
        (3.0, 2.8, False),  # hardly anything of it in either part
        (4.5, 1.5, False),  # what makes up for form in the held-out part alone
        (1.2, 2.8, True),  # an effect that acts in the part to identify
        (2.2, 2.8, False),
        (1.7, 1.7, True),
    ],
)
def test_where_the_form_is_open_an_effect_may_act_in_one_part(early, late, found):
    def hypothesis(identify: float, held_out: float) -> Hypothesis:
        h = left(held_out, 1.0)
        return replace(h, fit=replace(h.fit, residual=identify * h.fit.residual))

    base, one = hypothesis(5.0, 3.0), hypothesis(early, late)
    one = replace(one, candidates=law("constant_force", 0, 0.0).candidates)
    assert form_of(baseline(asked(FORM), base, NOISE)).reached(one).all() == found


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ((3.0, 1.3), (1.25, 1.1), False),
        ((7.0, 1.3), (3.2, 1.3), False),
        ((70.0, 1.3), (3.2, 1.0), False),  # within what the form leaves
        ((70.0, 1.3), (1.02, 1.0), True),
    ],
)
def test_several_effects_leave_noise_alone_because_they_can_imitate_form(before, after, found):
    two = tuple(law(kind, 0, 0.0).candidates[0] for kind in ("constant_force", "viscous_damping"))
    several = replace(left(*after), candidates=two)
    assert form_of(baseline(asked(FORM), left(*before), NOISE)).reached(several).all() == found


@pytest.mark.parametrize(
    ("early", "late", "said"),
    [
        (1.0, 5.0, "begins after it"),
        (5.0, 1.0, "is not in it"),
        (1.2, 5.0, "best fit:"),
        (5.0, 1.2, "best fit:"),
    ],
)
def test_what_is_in_one_part_alone_is_said_to_be(early, late, said):
    base = in_parts(early, late)
    told = judge(baseline(asked(), base, NOISE), [base], [], 1).after(DETECTED)
    assert told.verdict == "unexplained"
    assert said in told.reason
    assert bool(told.next_experiment) == (said != "best fit:")


@given(st.floats(0.0, 1.0), st.sampled_from([0.0, FORM]), st.booleans())
def test_a_verdict_without_an_answer_says_what_is_more_probable(p, form, known):
    base = left(8.0, 1.1)
    asked_of = baseline(asked(form), base, NOISE)
    b = replace(asked_of, noise=replace(asked_of.noise, declared=np.full(2, known)))
    told = needed(b, judge(b, [base], [], 1).after(DETECTED), {NO_DISCREPANCY: p})
    assert told.verdict == ("no_discrepancy" if p > 0.5 else "unexplained")
    assert ("best fit:" in told.reason) == (p <= 0.5)
    if p > 0.5:
        assert ("form" in told.reason) == (form > 0)
        assert ("not declared" in told.reason) == (not known)


@given(st.floats(0.0, 1.0))
def test_an_effect_that_passes_is_not_named_if_none_is_more_probable(p):
    best = law("harmonic_excitation", 0, 1.0)
    b = baseline(asked(), left(8.0, 1.1), NOISE)
    told = needed(b, Judgement.naming([best]).after(DETECTED), {NO_DISCREPANCY: p, best.label: 1 - p})
    assert told.verdict == ("no_discrepancy" if p > 0.5 else "traced")
    assert bool(told.members) == (p <= 0.5)
    assert best.label in told.reason


# ---- simpler laws


def law(kind: str, extra: int, gain: float) -> Hypothesis:
    """A law with one unknown and some more that leaves so much less log score than nothing would."""
    unknowns = tuple(Unknown(f"{kind}_wheel_{i}", 1.0, 0.0, 9.0, 1.0) for i in range(1 + extra))
    n, one = len(unknowns), np.where(np.arange(len(T)) % 2, 1.0, -1.0)
    fit = fit_with(unknowns, np.ones(n), np.eye(n), one, np.zeros((len(T), n)))
    left = one * np.sqrt(0.01 - 2 * gain / SAMPLES)
    return Hypothesis((Candidate(kind, "wheel", unknowns),), fit, (np.column_stack([left, 0 * left]),))


@pytest.mark.parametrize(
    ("gain", "stays"), [(0.5, "coulomb_friction"), (3.5, "coulomb_friction"), (4.5, "stribeck_friction")]
)
def test_further_unknowns_have_to_be_worth_their_price(gain, stays):
    complex_one, simple = law("stribeck_friction", 2, gain), law("coulomb_friction", 0, 0.0)
    [only] = alike(complex_one, [complex_one, simple])
    assert only.candidates[0].kind == stays


@pytest.mark.parametrize(
    ("form", "left", "stays"),
    [
        (0.0, 1.0, "stribeck_friction"),
        (0.0, 3.0, "stribeck_friction"),
        (0.05, 1.0, "stribeck_friction"),
        (0.05, 3.0, "coulomb_friction"),  # the difference is little of what the form leaves anyhow
    ],
)
def test_a_simpler_law_that_the_identify_part_denies_does_not_take_its_place(form, left, stays):
    complex_one, simple = law("stribeck_friction", 2, 0.5), law("coulomb_friction", 0, 0.0)
    one = simple.fit.residual
    complex_one = replace(complex_one, fit=replace(complex_one.fit, residual=left * one))
    denied = replace(simple, fit=replace(simple.fit, residual=np.sqrt(left**2 + 1.25) * one))
    assert cost(denied) - cost(complex_one) > DEFAULT.decision.noticed
    [only] = alike(complex_one, [complex_one, denied], form)
    assert only.candidates[0].kind == stays


def test_a_law_that_the_record_prefers_is_not_replaced_by_its_limit_however_alike_both_are():
    best, simple = law("stribeck_friction", 2, 19.0), law("coulomb_friction", 0, 0.0)
    noise = np.where(np.arange(len(T)) % 2, 1.0, -1.0)
    ahead, behind = (
        replace(h, residuals=(h.residuals[0] + [0.0, 1.0] * noise[:, None],)) for h in (best, simple)
    )
    asked_for = baseline(asked(), noise=NOISE)
    gained = asked_for.lead(ahead, behind)[0]
    assert 2 * DEFAULT.decision.unknown < gained < DEFAULT.decision.alike * -asked_for.score(ahead)
    assert alike(ahead, [ahead, behind]) == [ahead, behind]
    assert alike(ahead, [ahead, behind], FORM) == [behind]  # the form may have gained it


def test_where_the_motion_does_not_show_the_curve_what_lies_between_stays():
    """At one speed constant, Coulomb and viscous are alike; Coulomb friction becomes viscous damping."""
    found = [law(kind, extra, 0.0) for kind, extra in (("coulomb_friction", 1), ("viscous_damping", 0))]
    assert [h.label for h in alike(found[0], found)] == ["viscous_damping@wheel"]
    more = [law("stribeck_friction", 3, 0.0), *found, law("constant_force", 0, 0.0)]
    kinds = {h.candidates[0].kind for h in alike(more[0], more)}
    assert kinds == {"coulomb_friction", "viscous_damping", "constant_force"}
    curved = [h for h in more if h.candidates[0].kind != "viscous_damping"]
    kinds = {h.candidates[0].kind for h in alike(curved[0], curved)}
    assert kinds == {"coulomb_friction", "constant_force"}  # Stribeck's is Coulomb's there


def test_a_group_of_parameters_stands_for_one_of_them():
    one, other = law("parameter_step", 0, 0.0), law("parameter_step", 0, 0.0)
    names = [f"parameter_step_friction_condition_delta_{n}" for n in ("mu0", "k_A")]
    members = tuple(Unknown(n, 0.0, -1.0, 1.0, 0.1) for n in names)
    group = replace(one, candidates=(Candidate("parameter_step", "friction_condition", members),))
    inside = replace(one, candidates=(replace(one.candidates[0], location="k_A"),))
    outside = replace(other, candidates=(replace(one.candidates[0], location="F_n"),))
    for best in (group, inside):
        assert alike(best, [group, inside, outside])[-2:] == [group, outside]


@pytest.mark.parametrize("kind", sorted(EFFECTS))
def test_laws_do_not_become_one_another(kind):
    for other in limits(kind):
        assert other in EFFECTS
        assert kind not in limits(other)


# ---- figures of a result


@given(st.floats(-3.0, 3.0), st.floats(0.2, 1.0), st.floats(-0.9, 0.9))
def test_the_error_of_a_wave_is_that_along_its_phase(phase, ratio, correlation):
    """As many draws of sine and cosine scatter in size."""
    unknowns = tuple(Unknown(f"periodic_force_wheel_F_{s}", 0.0, -9e9, 9e9, 1.0) for s in ("sin", "cos"))
    values, std = 50.0 * np.array([np.sin(phase), np.cos(phase)]), 0.1 * np.array([1.0, ratio])
    covariance = np.outer(std, std) * np.array([[1.0, correlation], [correlation, 1.0]])
    wave = Candidate("periodic_force", "wheel", unknowns)
    fit = fit_with(unknowns, values, covariance, np.zeros(1), np.zeros((1, 2)))
    size, error = effects_of(Hypothesis((wave,), fit, ()))[0].parameters["amplitude"]
    drawn = np.random.default_rng(0).multivariate_normal(values, covariance, 20_000)
    assert size == pytest.approx(50.0)
    assert error == pytest.approx(np.hypot(*drawn.T).std(), rel=0.05)


# ---- second effects


@given(st.floats(0.0, 1.0), st.floats(0.02, 0.98))
def test_an_answer_that_is_improbable_is_none(one, share):
    """Its members count together, and what they fit is still said to be the nearest."""
    members = [law(kind, 0, 0.0) for kind in ("constant_force", "coulomb_friction")]
    told = Judgement.naming(members).after(DETECTED)
    by_label = {m.label: one * p for m, p in zip(members, (share, 1 - share), strict=True)}
    found = probable(baseline(asked(), left(5.0, 5.0), NOISE), told, by_label)
    if sum(by_label.values()) >= DEFAULT.decision.probable:
        assert found.verdict == "ambiguous"
        assert set(found.members) == set(members)
    else:
        assert found.verdict == "unexplained"
        assert not found.members
        assert members[0].label in found.reason


@pytest.mark.parametrize(
    ("shares", "kept", "verdict"),
    [
        ((0.5, 0.3, 0.1), 3, "ambiguous"),
        ((0.6, 0.2, 0.004), 2, "ambiguous"),
        ((0.3, 0.0015, 0.0014), 1, "traced"),  # of 0.3029, the last two hold less than a hundredth
        ((0.3, 0.004, 0.0035), 3, "ambiguous"),  # the last one holds more
        ((0.06, 0.0, 0.0), 1, "traced"),
    ],
)
@given(order=st.permutations((0, 1, 2)))
def test_a_class_holds_its_most_probable_members_alone(shares, kept, verdict, order):
    members = [law(kind, 0, 0.0) for kind in ("constant_force", "viscous_damping", "cubic_stiffness")]
    told = Judgement.naming([members[i] for i in order]).after(DETECTED)
    found = told.credible({m.label: p for m, p in zip(members, shares, strict=True) if p}, 0.01)
    assert list(found.members) == members[:kept]
    assert found.verdict == verdict
    assert found.checks[: len(DETECTED)] == tuple(DETECTED)
    places = [found.reason.index(m.label) for m in found.members]
    assert places == sorted(places)
    assert (found.next_experiment == "") == (kept == 1)


@pytest.mark.parametrize(("wider", "named"), [(1.0, True), (2.4, True), (2.6, False), (100.0, False)])
def test_an_effect_is_named_if_its_reported_size_is_clear_of_zero(wider, named):
    """Of 5 standard errors as it was judged; those that are reported are wider."""
    judged = law("constant_force", 0, 0.0)
    judged = replace(judged, fit=replace(judged.fit, covariance=0.04 * np.eye(1)))
    reported = replace(judged, fit=replace(judged.fit, covariance=0.04 * wider**2 * np.eye(1)))
    b = replace(baseline(asked(), left(5.0, 5.0), NOISE), hypothesis=judged)  # worth nothing beside its size
    found = clear_as_reported(b, Judgement.naming([judged]).after(DETECTED), reported)
    assert (found.verdict == "traced") is named
    [check] = [c for c in found.checks if c.name == "the reported size is clear of zero"]
    assert check.value == pytest.approx(5.0 / wider)
    assert check.limit == DEFAULT.decision.telling


def test_a_stiffness_without_bounds_is_judged_by_what_its_lack_costs():
    """Its errors are as large as it is, and those that are reported are no wider."""
    stop = law("bump_stop", 0, 0.0)
    b = baseline(asked(), left(5.0, 5.0), NOISE)
    assert cost(b.hypothesis) <= cost(stop)
    worth = replace(stop, worth={stop.label: 900.0})
    found = clear_as_reported(b, Judgement.naming([worth]).after(DETECTED), worth)
    assert found.verdict == "traced"
    assert clear_as_reported(b, Judgement.naming([stop]), stop).members == ()


@given(st.floats(1.0, 20.0), st.floats(1.0, 1e4), st.floats(1.0, 50.0))
def test_the_reported_size_falls_as_the_errors_widen_whatever_shows_it(size, gained, wider):
    """What the fit loses without the effect counts beside its errors, also where these show its size."""
    law_of = law("constant_force", 0, 0.0)
    judged = replace(
        law_of, fit=replace(law_of.fit, covariance=(law_of.fit.values[0] / size) ** 2 * np.eye(1))
    )
    reported = replace(judged, fit=replace(judged.fit, covariance=wider**2 * judged.fit.covariance))
    before = replace(judged, fit=replace(judged.fit, residual=np.append(judged.fit.residual, gained**0.5)))
    b = replace(baseline(asked(), left(5.0, 5.0), NOISE), hypothesis=before)
    found = clear_as_reported(b, Judgement.naming([judged]).after(DETECTED), reported)
    [check] = [c for c in found.checks if c.name == "the reported size is clear of zero"]
    assert check.value == pytest.approx(max(judged.significance(before)) / wider)


def test_an_effect_without_a_size_is_not_judged_by_it():
    """A delay of an input has a time alone."""
    delay = replace(left(1.0, 1.0), candidates=(Candidate("input_delay", "u", ()),))
    b = baseline(asked(), left(5.0, 5.0), NOISE)
    assert clear_as_reported(b, Judgement.naming([delay]).after(DETECTED), delay).members


def test_a_pair_becomes_a_simpler_one_in_either_order():
    friction = [law(kind, 0, 0.0).candidates[0] for kind in ("stribeck_friction", "coulomb_friction")]
    offset = law("constant_force", 0, 0.0).candidates[0]
    rich, simple = (replace(law("constant_force", 0, 0.0), candidates=(c, offset)) for c in friction)
    swapped = replace(simple, candidates=simple.candidates[::-1])
    assert becomes(rich, simple)
    assert becomes(rich, swapped)
    assert not becomes(simple, rich)
    assert not becomes(swapped, rich)
