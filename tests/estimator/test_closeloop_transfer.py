"""Several records of one machine: what carries over, what is ruled out, and one value for all."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import chi2, kstest

from estimator.closeloop.decision.model_form import gap_closed
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import sandwich
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.several.chart import chart
from estimator.closeloop.several.common import commons
from estimator.closeloop.several.estimates import (
    LOOSE,
    Estimates,
    difference,
    estimates,
)
from estimator.closeloop.several.standing import standing
from estimator.closeloop.several.transfer import Traced, said_of, transfers
from estimator.plant import PLANTS
from fmus.effects import EFFECTS
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.host.description import PortNames
from tests.helpers.baselines import fit_with
from tests.helpers.carriage import (
    NOISE,
    Force,
    T,
    coulomb,
    looked_at,
    one_way,
    problem,
    record,
    to_and_fro,
    viscous,
)
from tests.helpers.verdicts import judged

FREE = (-np.inf, np.inf)
FRICTIONS = ("constant_force", "coulomb_friction", "viscous_damping")


# ---- what is the machine's, and what a run's


@pytest.mark.parametrize("kind", sorted(EFFECTS))
def test_an_effect_says_what_belongs_to_a_run(kind: str) -> None:
    effect = EFFECTS[kind]
    names = {p.name for p in effect.parameters("rotation" if effect.acts_on == "port" else "1")}
    assert set(effect.of_run) <= names | {"phase"}
    waves = sorted(a[-4:] for a in effect.amplitudes) == ["_cos", "_sin"]
    assert ("phase" in effect.of_run) == waves
    assert ("t0" in effect.of_run) == ("t0" in names)
    at_start = {"u_0", "v_0"} & names  # what was before the first sample
    assert at_start <= set(effect.of_run)
    assert not set(effect.amplitudes) & set(effect.of_run)


def wave(sine: float = 1.0, cosine: float = 1.0) -> Candidate:
    prefix = "harmonic_excitation_carriage_"
    ends = tuple(Unknown(f"{prefix}{e}", v, *FREE, 2.0) for e, v in (("F_sin", sine), ("F_cos", cosine)))
    return Candidate("harmonic_excitation", "carriage", ends, (Unknown(f"{prefix}f", 1.0, 0.0, 9.0, 0.1),))


# the product of an amplitude and a phase of 5e-324 rad is no number any more
PHASES = st.floats(-3.1, 3.1).filter(lambda phase: phase == 0 or abs(phase) > 1e-300)


@given(st.floats(0.01, 50.0), PHASES, st.floats(0.1, 5.0))
def test_a_wave_has_an_amplitude_of_the_machine_and_a_phase_of_the_run(
    size: float, phase: float, frequency: float
) -> None:
    made, p = chart([wave()]), "harmonic_excitation_carriage_"
    assert [u.name for u in made.machine] == [f"{p}amplitude", f"{p}f"]
    assert [u.name for u in made.run] == [f"{p}phase"]
    values = {f"{p}amplitude": size, f"{p}phase": phase, f"{p}f": frequency, "M": 95.0}
    native = made.native(values)
    t = np.linspace(0, 3, 50)
    force = native[f"{p}F_sin"] * np.sin(t) + native[f"{p}F_cos"] * np.cos(t)
    assert_allclose(force, size * np.sin(t + phase), atol=1e-12 * size)
    assert_allclose([made.turned(native)[n] for n in values], list(values.values()), rtol=1e-9)
    names, natives = list(values), [f"{p}F_sin", f"{p}F_cos", f"{p}f", "M"]
    slopes = made.slopes(values, natives, names)
    for j, n in enumerate(names):
        h = 1e-6 * max(1.0, abs(values[n]))
        moved = [made.native({**values, n: values[n] + s * h}) for s in (1, -1)]
        central = [(moved[0][x] - moved[1][x]) / (2 * h) for x in natives]
        assert_allclose(slopes[:, j], central, atol=1e-6 * max(1.0, size))


@settings(max_examples=10)
@given(st.integers(0, 999))
def test_what_is_said_of_an_amplitude_is_what_repeated_fits_scatter_by(seed: int) -> None:
    rng, c = np.random.default_rng(seed), wave()
    t = np.linspace(0, 20, 900)
    g = np.column_stack([np.sin(3 * t), 0.5 * np.cos(3 * t)])
    true, found = np.array([3.0, 8.0]), []
    inverse = np.linalg.inv(g.T @ g)
    unknowns = c.amplitudes
    for _ in range(300):
        x = true + inverse @ g.T @ rng.standard_normal(900)
        fit = fit_with(unknowns, x, inverse, rng.standard_normal(900), g)
        found.append(estimates(chart([replace(c, shape=())]), fit))
    sizes = [e.values[0] for e in found]
    errors = [float(np.sqrt(e.white[0, 0])) for e in found]
    assert_allclose(np.mean(sizes), np.hypot(*true), atol=4 * np.std(sizes) / np.sqrt(300) + 0.01)
    assert np.median(errors) == pytest.approx(np.std(sizes), rel=0.2)


def said(values: np.ndarray, covariance: np.ndarray) -> Estimates:
    unknowns = tuple(Unknown(f"p{i}", 0.0, *FREE, 1.0) for i in range(len(values)))
    return Estimates(unknowns, values, covariance, covariance)


def test_a_difference_has_the_chance_that_it_says() -> None:
    rng, chances = np.random.default_rng(1), []
    for _ in range(400):
        roots = rng.standard_normal((2, 3, 3)) * [1.0, 0.1, 0.01]
        covariances = [a @ a.T for a in roots]
        both = [said(a @ rng.standard_normal(3), c) for a, c in zip(roots, covariances, strict=True)]
        told = [n for n in both[0].told if n in both[1].told]
        found = difference(*both)
        assert found.unknowns == len(told)
        assert found.p_value == pytest.approx(float(chi2.sf(found.distance**2, len(told))))
        chances.append(found.p_value)
    assert kstest(chances, "uniform").pvalue > 1e-3


def test_what_one_record_does_not_tell_makes_no_difference() -> None:
    known, blind = said(np.array([2.0, 1.0]), np.eye(2) / 100), np.diag([0.01, LOOSE**2])
    assert difference(known, said(np.array([2.0, 50.0]), blind)).distance == pytest.approx(0.0)
    assert difference(known, said(np.array([3.0, 50.0]), blind)).distance == pytest.approx(1 / np.sqrt(0.02))
    nothing = difference(known, said(np.array([9.0, 9.0]), LOOSE**2 * np.eye(2)))
    assert (nothing.unknowns, nothing.p_value) == (0, 1.0)


def test_an_unknown_without_any_influence_is_not_told() -> None:
    rng = np.random.default_rng(2)
    prefix = "coulomb_friction_carriage_"
    c = Candidate(
        "coulomb_friction",
        "carriage",
        (Unknown(f"{prefix}F_c", 0.0, 0.0, np.inf, 5.0),),
        (Unknown(f"{prefix}v_s", 0.01, 1e-6, np.inf, 0.001),),
    )
    jacobian = np.column_stack([rng.standard_normal(600), np.zeros(600)])
    residual = rng.standard_normal(600)
    scale = np.array([u.scale for u in c.unknowns])
    covariance = sandwich(residual, jacobian, scale, np.full(2, np.inf))
    found = estimates(
        chart([c]), fit_with(c.unknowns, np.array([20.0, 0.01]), covariance, residual, jacobian)
    )
    assert found.told == (f"{prefix}F_c",)
    assert found.figures[f"{prefix}v_s"][1] == pytest.approx(LOOSE * 0.001)


# ---- records of a carriage


@pytest.fixture(scope="module")
def builder(tmp_path_factory: pytest.TempPathFactory):
    """The drive, its builds shared by all tests here."""
    yield ModelBuilder("drive", tmp_path_factory.mktemp("drive"))
    PLANTS.close()


@pytest.fixture(scope="module")
def slow(builder: ModelBuilder) -> Traced:
    """One way at one speed under Coulomb friction: this record cannot tell what it is."""
    made = record(one_way(), coulomb(20.0), 1, speed=0.3)
    asked = replace(problem(builder, made, speed=0.3), calibrate={})
    return looked_at("slow", asked, FRICTIONS)


def fast(builder: ModelBuilder, force: Force, seed: int = 2, name: str = "fast", **more) -> Traced:
    """To and fro at many speeds."""
    made = record(to_and_fro(), force, seed)
    return looked_at(name, problem(builder, made), more.pop("kinds", FRICTIONS), **more)


def labels(hypotheses) -> list[str]:
    return sorted(h.label.partition("@")[0] for h in hypotheses)


def statuses(found) -> dict[str, str]:
    return {t.member.label.partition("@")[0]: t.status for t in found}


def test_a_second_record_splits_the_class_of_the_first(builder: ModelBuilder, slow: Traced) -> None:
    other = fast(builder, coulomb(20.0))
    assert slow.found.judgement.verdict == "ambiguous"
    assert {"constant_force", "coulomb_friction"} <= set(labels(slow.members))
    found = transfers(slow, other)
    assert statuses(found)["coulomb_friction"] == "confirmed"
    assert statuses(found)["constant_force"] == "absent"
    left = standing(slow, found)
    assert labels(left.left) == ["coulomb_friction"]
    assert left.ruled_out["constant_force@carriage"][0] == "fast"
    assert "comes down to coulomb_friction@carriage" in left.sentence
    [right] = [t for t in found if t.carries]
    wrong = next(t for t in found if not t.carries)
    rms = {t.member.label: t.held.rms(other.problem, "test") / other.found.noise for t in (right, wrong)}
    assert rms[right.member.label].max() < 1.1
    assert rms[wrong.member.label].max() > 5
    assert right.loose == ("coulomb_friction_carriage_v_s",)  # one way round, its rounding is not seen


def test_which_member_is_left_follows_the_truth(builder: ModelBuilder) -> None:
    made = record(one_way(), viscous(60.0), 3, speed=0.3)
    asked = replace(problem(builder, made, speed=0.3), calibrate={})
    first = looked_at("slow", asked, FRICTIONS)
    found = transfers(first, fast(builder, viscous(60.0)))
    assert labels(standing(first, found).left) == ["viscous_damping"]


def test_a_law_that_nearly_fits_yields_to_the_one_that_does(builder: ModelBuilder) -> None:
    """Of drag, at speeds about one value, viscous damping takes nearly all: 95 % of the gap is not enough."""

    def drag(t: float, q: float, v: float) -> float:
        return 200.0 * abs(v) * v

    kinds = ("viscous_damping", "quadratic_damping")
    ones = []
    for name, swing, seed in (("even", 1.0, 17), ("uneven", 14.0, 18)):
        made = record(80 + swing * np.sin(2 * np.pi * T / 3), drag, seed, speed=0.3)
        asked = replace(problem(builder, made, speed=0.3), calibrate={})
        ones.append(looked_at(name, asked, kinds))
    even = ones[0].found
    not_told = judged("ambiguous", even.singles, "both, for all that this record tells")
    ones[0] = replace(ones[0], found=replace(even, judgement=not_told))
    found = transfers(*ones)
    assert statuses(found) == {"viscous_damping": "surpassed", "quadratic_damping": "confirmed"}
    nearly = next(t for t in found if t.status == "surpassed")
    assert (
        gap_closed(*(x.rms(ones[1].problem, "test") for x in (ones[1].found.base, nearly.own)), NOISE).min()
        > 0.95
    )
    assert labels(standing(ones[0], found).left) == ["quadratic_damping"]


def test_an_effect_of_another_size_carries_over_as_a_law_and_not_in_its_value(builder: ModelBuilder) -> None:
    one = fast(builder, coulomb(20.0), 4, "before", kinds=("coulomb_friction",))
    other = fast(builder, coulomb(26.0), 5, "after", kinds=("coulomb_friction",))
    found = [*transfers(one, other), *transfers(other, one)]
    assert [t.status for t in found] == ["differs", "differs"]
    own = [
        said_of(t.own, ["coulomb_friction@carriage"]).figures["coulomb_friction_carriage_F_c"] for t in found
    ]
    for (value, error), true in zip(own, (26.0, 20.0), strict=True):
        assert abs(value - true) < 4 * error
    assert found[0].difference.distance == pytest.approx(6 / np.hypot(own[0][1], own[1][1]), rel=0.1)
    left = standing(one, found)
    assert labels(left.left) == ["coulomb_friction"]  # nobody says which of both is another's
    assert "coulomb_friction@carriage has other values in after" in left.sentence
    [both] = commons([one, other], found, left.left)
    assert not both.serves
    assert both.likeness.p_value < 1e-6
    assert "no single value" in both.sentence


def test_a_record_without_the_effect_says_so_where_it_would_show(builder: ModelBuilder) -> None:
    one = fast(builder, coulomb(20.0), 6, kinds=("coulomb_friction",))
    without = fast(builder, coulomb(0.0), 7, "without", kinds=(), quiet=True)
    found = transfers(one, without)
    assert statuses(found) == {"coulomb_friction": "absent"}
    assert standing(one, found).sentence == "coulomb_friction@carriage is not found in without"


def test_a_record_that_would_not_show_an_effect_says_nothing(builder: ModelBuilder) -> None:
    def stop(t: float, q: float, v: float) -> float:
        return 4000.0 * max(q - 0.15, 0.0) + 4000.0 * min(q + 0.15, 0.0)

    large = record(to_and_fro(), stop, 8)
    one = looked_at("large", problem(builder, large), ("bump_stop",))
    assert labels(one.members) == ["bump_stop"]
    small = record(to_and_fro(0.2), stop, 9)
    other = looked_at("small", problem(builder, small), (), quiet=True)
    assert np.abs(small.runs[0].y[:, 0]).max() < 0.15
    found = transfers(one, other)
    assert statuses(found) == {"bump_stop": "silent"}
    assert "would not show" in standing(one, found).sentence
    assert commons([one, other], found, one.members) == []


def test_a_record_that_nothing_explains_says_nothing(builder: ModelBuilder, slow: Traced) -> None:
    rng = np.random.default_rng(10)
    blows = np.repeat(rng.standard_normal(60) * 40, 25)
    other = fast(builder, lambda t, q, v: blows[min(int(t / 0.01), 1499)], name="odd")
    assert other.found.judgement.verdict == "unexplained"
    found = transfers(slow, other)
    assert set(statuses(found).values()) == {"open"}
    assert labels(standing(slow, found).left) == labels(slow.members)


def test_another_port_of_the_same_name_is_another_place(builder: ModelBuilder, slow: Traced) -> None:
    other = fast(builder, coulomb(20.0))
    turned = (PortNames("carriage", "F_ext", "q_dot", "q"),)
    found = transfers(slow, replace(other, problem=replace(other.problem, ports=turned)))
    assert set(statuses(found).values()) == {"impossible"}
    assert "another port" in found[0].reason


def test_a_moment_and_a_phase_are_each_runs_own(builder: ModelBuilder) -> None:
    def steps(at: float) -> Force:
        return lambda t, q, v: 15.0 * (t >= at)

    ones = [
        looked_at(n, problem(builder, record(to_and_fro(), steps(at), seed)), ("step_force",))
        for n, at, seed in (("early", 3.0, 11), ("late", 7.0, 12))
    ]
    [found] = transfers(*ones)
    assert found.status == "confirmed"
    t0 = [h.theta["step_force_carriage_t0"] for h in (found.member, found.held)]
    assert_allclose(t0, [3.0, 7.0], atol=0.05)

    def hums(phase: float) -> Force:
        return lambda t, q, v: -12.0 * float(np.sin(2 * np.pi * 1.7 * t + phase))

    ones = [
        looked_at(n, problem(builder, record(to_and_fro(), hums(phase), seed)), ("harmonic_excitation",))
        for n, phase, seed in (("a", 0.4, 13), ("b", 2.9, 14))
    ]
    found = transfers(*ones)
    assert [t.status for t in found] == ["confirmed"]
    [both] = commons(ones, found, ones[0].members)
    size, error = both.together.shared.figures["harmonic_excitation_carriage_amplitude"]
    assert abs(size - 12.0) < 4 * error
    assert error < 0.1
    phases = [np.arctan2(h.theta[f"{p}F_cos"], h.theta[f"{p}F_sin"]) for h in both.together.parts
              for p in ("harmonic_excitation_carriage_",)]  # fmt: skip
    assert_allclose(phases, [0.4, 2.9], atol=0.12)  # four standard errors
    assert both.serves


def test_an_effect_is_found_again_beside_another_one(builder: ModelBuilder) -> None:
    one = fast(builder, coulomb(20.0), 15, "alone", kinds=("coulomb_friction",))
    both = fast(builder, lambda t, q, v: coulomb(20.0)(t, q, v) + 8.0, 16, "both")
    parts = {p.label.partition("@")[0]: p for p in both.found.promises}
    pair = [parts[k].candidates[0] for k in ("coulomb_friction", "constant_force")]
    promise = Promise(tuple(pair), 0.0, {**parts["coulomb_friction"].start, **parts["constant_force"].start})
    fitted = Fitter(both.found.baseline).finished([promise])
    two = judged("several", tuple(fitted), "two")
    both = replace(both, found=replace(both.found, judgement=two))
    [found] = transfers(one, both)
    assert found.status == "confirmed"
    assert [c.kind for c in found.held.candidates if c not in found.member.candidates][-1] == "constant_force"
    [joint] = commons([one, both], [found], one.members)
    value, error = joint.together.shared.figures["coulomb_friction_carriage_F_c"]
    assert abs(value - 20.0) < 4 * error
    assert joint.serves


# ---- one value for all


def two(builder: ModelBuilder, seed: int) -> tuple[list[Traced], list]:
    """Two records of the same friction at different amplitudes, with masses of their own."""
    ones = []
    for name, size, M, s in (("small", 0.6, 93.0, 2 * seed), ("large", 1.3, 97.0, 2 * seed + 1)):
        made = record(to_and_fro(size), coulomb(20.0), 100 + s, M=M)
        ones.append(looked_at(name, problem(builder, made), ("coulomb_friction",)))
    return ones, [*transfers(*ones), *transfers(*reversed(ones))]


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in range(1, 9))])
def test_a_joint_fit_is_surer_than_each_and_covers_the_truth(seed: int, builder: ModelBuilder) -> None:
    ones, found = two(builder, seed)
    [both] = commons(ones, found, ones[0].members)
    name = "coulomb_friction_carriage_F_c"
    value, error = both.together.shared.figures[name]
    alone = [e.figures[name] for e in both.said]
    assert error < min(e for _, e in alone)
    assert error == pytest.approx(1 / np.sqrt(sum(1 / e**2 for _, e in alone)), rel=0.3)  # scatter of blocks
    assert abs(value - 20.0) < 3.5 * error
    masses = [h.theta["M"] for h in both.together.parts]
    assert_allclose(masses, [93.0, 97.0], atol=0.5)
    assert both.serves
    assert both.likeness.p_value > 1e-3
    assert max(both.chi2) < 1.2
    assert both.likeness.rise == pytest.approx(sum(both.together.costs) - sum(both.costs), abs=1e-9)
    assert both.likeness.rise > 0  # nothing is nearer to all than each by itself


@pytest.mark.slow
def test_errors_of_joint_fits_scatter_as_they_say(builder: ModelBuilder) -> None:
    name, found = "coulomb_friction_carriage_F_c", []
    for seed in range(20, 40):
        ones, carried = two(builder, seed)
        [both] = commons(ones, carried, ones[0].members)
        value, error = both.together.shared.figures[name]
        found.append(((value - 20.0) / error, both.likeness.p_value))
    z, chance = np.array(found).T
    assert np.sum(z**2) < chi2.isf(1e-4, len(z))
    assert (
        np.sum(z**2) > chi2.ppf(1e-4, len(z)) / 2
    )  # errors from blocks are never below those of white noise
    assert kstest(chance, "uniform").pvalue > 1e-4
