"""A law that is named is the curve that the force follows, not one that comes near it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision.law_form import (
    confirmed,
    curvature,
    misnamed,
)
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.reweighted import noise_of_best, reweighted
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.progress import Progress
from estimator.closeloop.search.screened import screened
from estimator.closeloop.search.search import Search
from estimator.closeloop.several.transfer import Traced
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.carriage import (
    Force,
    coulomb,
    looked_at,
    problem,
    record,
    to_and_fro,
    viscous,
)
from tests.helpers.verdicts import judged

NOTICED = DEFAULT.decision.noticed


def root(bump: float, rebound: float) -> Force:
    """A damper with a square-root law, softer one way."""
    return lambda t, q, v: (bump if v > 0 else rebound) * float(np.sign(v) * np.sqrt(abs(v)))


def cubic(size: float) -> Force:
    return lambda t, q, v: size * q**3


def bowl(size: float) -> Force:
    """A spring that pushes one way alone, more and more."""
    return lambda t, q, v: size * max(q, 0.0) ** 1.5


@pytest.fixture(scope="module")
def builder(tmp_path_factory: pytest.TempPathFactory) -> ModelBuilder:
    return ModelBuilder("drive", tmp_path_factory.mktemp("drive"))


def asked(builder: ModelBuilder, resistance: Force, kind: str, seed: int) -> Traced:
    """A record with a resistance, to which one law is fitted."""
    found = looked_at("one", problem(builder, record(to_and_fro(2.0), resistance, seed)), (kind,))
    best = found.found.singles[0]
    named = judged("traced", (best,), "it accounts for the residual")
    return replace(found, found=replace(found.found, judgement=named))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("resistance", "kind"),
    [
        (coulomb(40.0), "coulomb_friction"),
        (viscous(200.0), "viscous_damping"),
        (cubic(3e3), "cubic_stiffness"),
        (viscous(0.0), "constant_force"),
        (lambda t, q, v: 20.0, "constant_force"),
    ],
)
def test_the_right_law_leaves_no_curve(builder, resistance, kind, seed):
    traced = asked(builder, resistance, kind, seed)
    o = traced.found
    assert curvature(o.baseline, o.singles[0], o.forces)[0] < NOTICED
    told = confirmed(o.baseline, o.judgement, o.forces)
    assert (told.verdict, told.members) == (o.judgement.verdict, o.judgement.members)
    assert told.checks[-1].name == "the force follows the law"
    assert told.checks[-1].passed


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("resistance", "kind", "over"),
    [
        (root(80.0, 80.0), "coulomb_friction", "velocity"),
        (root(60.0, 120.0), "coulomb_friction", "velocity"),
        (root(60.0, 120.0), "viscous_damping", "velocity"),
        (bowl(2e3), "cubic_stiffness", "displacement"),
    ],
)
def test_a_law_that_is_near_is_not_named(builder, resistance, kind, over, seed):
    traced = asked(builder, resistance, kind, seed)
    o = traced.found
    told = confirmed(o.baseline, o.judgement, o.forces)
    assert (told.verdict, told.members) == ("unexplained", ())
    assert f"over the {over} at carriage" in told.reason
    assert f"best fit: {kind}@carriage" in told.reason


@pytest.mark.parametrize(
    ("resistance", "kind", "slow", "told"),
    [
        (coulomb(40.0), "coulomb_friction", 0.0, "traced"),
        (coulomb(40.0), "coulomb_friction", 3.0, "traced"),
        (cubic(3e3), "cubic_stiffness", 0.0, "traced"),
        (cubic(3e3), "cubic_stiffness", 3.0, "traced"),
        (root(80.0, 80.0), "coulomb_friction", 0.0, "unexplained"),
        (root(80.0, 80.0), "coulomb_friction", 3.0, "traced"),  # of which noise hides the difference
        (root(60.0, 120.0), "coulomb_friction", 0.0, "unexplained"),
        (root(60.0, 120.0), "coulomb_friction", 3.0, "unexplained"),
    ],
)
def test_noise_that_is_not_declared_is_no_law_and_hides_none(builder, resistance, kind, told, slow):
    """slow: size of noise over ten samples, over that of the white noise."""
    made = record(to_and_fro(2.0), resistance, 1)
    [run] = made.runs
    white = np.random.default_rng(2).standard_normal(run.y.shape)
    more = slow * made.noise_std * lfilter([1.0], [1.0, -0.9], white, axis=0) * np.sqrt(1 - 0.9**2)
    made = replace(made, runs=(replace(run, y=run.y + more),), noise_std=np.full(2, np.nan))
    o = looked_at("one", problem(builder, made), (kind,)).found
    noise = noise_of_best(o.baseline, [o.singles])
    base, [[best]] = reweighted(Fitter(o.baseline), [o.singles], noise)
    b = replace(o.baseline, hypothesis=base, noise=noise)
    assert confirmed(b, judged("traced", (best,)), o.forces).verdict == told


@pytest.mark.parametrize(("truth", "told"), [(coulomb(40.0), "traced"), (root(60.0, 120.0), "unexplained")])
def test_where_the_form_is_open_a_law_is_tested_too(builder, truth, told):
    traced = asked(builder, truth, "coulomb_friction", 1)
    o = traced.found
    opened = o.baseline.asked(replace(traced.problem, form_error=0.05))
    assert confirmed(opened, o.judgement, o.forces).verdict == told


@pytest.mark.parametrize(
    ("left", "own", "elsewhere", "closed", "opened"),
    [
        (0, NOTICED - 1, 0, False, False),
        (0, NOTICED + 1, 0, True, True),
        (0, 60, 80, True, False),
        (20_000, 30, 10, False, False),
        (20_000, 600, 500, False, True),
        (20_000, 600, 700, False, False),
        (20_000, 11_000, 12_000, True, False),  # most of it
    ],
)
def test_an_open_form_leaves_as_much_of_a_curve_elsewhere(left, own, elsewhere, closed, opened):
    one = np.ones(1000)
    base, h = (
        Hypothesis((), fit_with((), one[:0], np.eye(0), one * np.sqrt(squares / 1000), np.eye(1000, 0)), ())
        for squares in (3e4, 1000 + left)
    )
    asked = [SimpleNamespace(policy=DEFAULT, form_error=form) for form in (0.0, 0.02)]
    limits = [form_of(baseline(a, base)).curve_limit(h, elsewhere) for a in asked]
    assert [own > limit for limit in limits] == [closed, opened]
    told = [baseline(a, base) for a in asked]  # what is left may be noise that is not declared
    unsaid = [replace(b, noise=replace(b.noise, declared=np.zeros(1, bool))) for b in told]
    limits = [form_of(b).curve_limit(h, elsewhere) for b in unsaid]
    assert [own > limit for limit in limits] == [closed, closed and opened]


def among(builder: ModelBuilder, resistance: Force, *kinds: str) -> Judgement:
    """What is left of a class of these laws, best first, on a record with a resistance."""
    here = problem(builder, record(to_and_fro(2.0), resistance, 3))
    o = looked_at("one", here, kinds).found
    fitted = {h.candidates[0].kind: h for h in o.singles}
    told = judged("ambiguous", tuple(fitted[k] for k in kinds), "this record cannot tell them apart")
    return confirmed(o.baseline, told, o.forces)


def test_of_a_class_the_law_stays_that_no_curve_denies(builder):
    told = among(builder, viscous(200.0), "quadratic_damping", "viscous_damping")
    assert (told.verdict, [m.label for m in told.members]) == ("traced", ["viscous_damping@carriage"])


@pytest.mark.slow
def test_friction_rounded_all_over_the_motion_is_no_friction(builder):
    told = among(builder, viscous(200.0), "coulomb_friction", "viscous_damping")
    assert (told.verdict, [m.label for m in told.members]) == ("traced", ["viscous_damping@carriage"])
    assert among(builder, root(90.0, 90.0), "stribeck_friction").verdict == "unexplained"
    assert among(builder, coulomb(40.0), "coulomb_friction").verdict == "ambiguous"  # as it was


def test_of_several_laws_each_is_what_its_name_says(builder):
    here = problem(builder, record(to_and_fro(2.0), viscous(200.0), 3))
    o = looked_at("one", here, ("coulomb_friction",)).found
    [h] = o.singles
    both = replace(
        h, candidates=(replace(h.candidates[0], kind="parameter_offset", location="m"), *h.candidates)
    )
    told = confirmed(o.baseline, judged("several", (both,), "both"), o.forces)
    assert told.verdict == "unexplained"
    assert "over the velocity at carriage" in told.reason
    rounded = {n: v / 1e3 if n.endswith("v_s") else v for n, v in h.fit.theta.items()}
    sharp = replace(both, fit=replace(h.fit, values=np.array([rounded[u.name] for u in h.fit.unknowns])))
    told = judged("several", (sharp,), "both")
    assert confirmed(o.baseline, told, o.forces).members == told.members


def test_of_a_class_no_law_stays_where_curves_deny_all_over_that_motion(builder):
    told = among(builder, root(200.0, 60.0), "quadratic_damping", "viscous_damping", "cubic_stiffness")
    assert (told.verdict, told.members) == ("unexplained", ())


ROUNDED = 0.5  # m/s


def rounded(size: float) -> Force:
    """Dry friction that is full at the highest velocities alone."""
    return lambda t, q, v: size * float(np.tanh(v / ROUNDED))


def test_rounded_friction_is_named_where_any_other_curve_would_show(builder):
    here = problem(builder, record(to_and_fro(2.0), rounded(60.0), 3))
    traced = looked_at("one", here, ("coulomb_friction",))
    o, [h] = traced.found, traced.found.singles[:1]
    [(_, own)] = misnamed(h, o.forces)
    explained = cost(o.baseline.hypothesis) - cost(h)
    assert own * explained > NOTICED
    assert h.theta["coulomb_friction_carriage_v_s"] == pytest.approx(ROUNDED, rel=0.05)
    told = judged("traced", (h,), "it accounts for the residual")
    assert confirmed(o.baseline, told, o.forces).members == told.members
    # where the form is open other curves may pass for it, and where it explains little
    assert confirmed(o.baseline.asked(replace(here, form_error=0.05)), told, o.forces).members == ()
    little = replace(o.base, fit=replace(o.base.fit, residual=h.fit.residual * 1.01))
    assert confirmed(replace(o.baseline, hypothesis=little), told, o.forces).members == ()


def test_a_law_that_is_denied_gives_way_to_the_right_one(builder):
    here = problem(builder, record(to_and_fro(2.0), lambda t, q, v: 300.0 * abs(v) * v, 3))
    o = looked_at("one", here, ("viscous_damping",)).found
    shown = screened(o.baseline, o.forces, Progress(lambda _: None), Stages())
    search = Search(shown, Fitter(o.baseline), Progress(lambda _: None))
    singles = search.instead(o.singles)
    assert singles[0].label == "quadratic_damping@carriage"
    assert singles[0].theta["quadratic_damping_carriage_c"] == pytest.approx(300.0, rel=0.02)
    assert [h.label for h in singles].count("viscous_damping@carriage") == 1
    again = search.instead(singles)
    new = {h.label: h for h in again}
    # of what is no better nothing is taken
    assert again[0].label == singles[0].label
    assert set(new) == {h.label for h in singles}
    assert all(new[h.label] is h or cost(new[h.label]) < cost(h) for h in singles)


def test_the_limit_of_the_best_law_is_fitted_if_nobody_has(builder):
    here = problem(builder, record(to_and_fro(2.0), coulomb(30.0), 3))
    o = looked_at("one", here, ("stribeck_friction",)).found
    shown = screened(o.baseline, o.forces, Progress(lambda _: None), Stages())
    search = Search(shown, Fitter(o.baseline), Progress(lambda _: None))
    singles, pairs = search.simplified(o.singles, [], "simplified")
    assert not pairs
    found = {h.label: h for h in singles}
    assert [h.label for h in o.singles] == ["stribeck_friction@carriage"]
    simple = found["coulomb_friction@carriage"]
    assert cost(simple) < cost(found["stribeck_friction@carriage"]) + 10
    assert simple.theta["coulomb_friction_carriage_F_c"] == pytest.approx(30.0, rel=0.02)
    assert search.simplified(singles, [], "simplified")[0] == singles  # what was fitted is not fitted again
