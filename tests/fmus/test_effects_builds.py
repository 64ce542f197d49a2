"""Effects in FMUs: each kind built, restarted from its middle, and around a foreign FMU as in our own."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lsim

from fmus.drive.model import Drive
from fmus.effects import EFFECTS, offers, parse_effect
from fmus.errors import BadInput
from fmus.export.around.outside import Outside
from fmus.export.builders import hypotheses
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder
from fmus.export.builders.native.working import build_working
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.coupled import build_coupled
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from fmus.host.grading.check import grade
from fmus.model import joins
from fmus.models import MODELS
from fmus.variables import State
from tests.helpers.everything import EVERY_EFFECT, FALLBACK

PORT = PortNames("carriage", "F_ext", "q_dot", "q")
T = np.linspace(0, 3, 301)
INPUTS = {"F": 150 * np.sin(np.pi * T[:-1]) + 60 * np.sin(11 * T[:-1])}
OUTPUTS = ["q", "q_dot"]
AT = {"port": "carriage", "parameter": "M", "input": "F"}
CASES = [
    f"{kind}@{'F_v' if kind == 'parameter_drift' else AT[EFFECTS[kind].acts_on]}"
    for kind in EVERY_EFFECT
    if EFFECTS[kind].acts_on in AT and kind not in FALLBACK
]
SHARP = {  # shapes that ask more of the coupling than those that `typical` takes
    "hysteresis": {"F_h": 30.0, "q_y": 0.01},
    "flexible_mode": {"m": 20.0, "f": 6.0, "D": 0.05},
}
# those that need a model which says what makes a component
COMPONENTS = {kind for kind in EVERY_EFFECT if EFFECTS[kind].acts_on == "component"}


def middle(guesses):
    return guesses[len(guesses) // 2]


@cache
def typical(kind):
    """Values of an effect's parameters that show in the drive: a shape that it guesses, 30 N of a force."""
    effect, M, F_v = EFFECTS[kind], 95.0, 200.0
    F = 150 * np.sin(np.pi * T) + 60 * np.sin(11 * T)
    if effect.acts_on == "port":
        v = lsim(([1.0], [M, F_v]), F, T)[1]
        motion = T, cumulative_trapezoid(v, T, initial=0.0), v
        shape = middle(effect.guesses(*motion, v))
        size = 30.0 / np.abs(effect.along(shape | dict.fromkeys(effect.amplitudes, 1.0), *motion)).max()
        return shape | dict.fromkeys(effect.amplitudes, size)
    shape = middle(effect.guesses(T, F) if effect.acts_on == "input" else effect.guesses(T))
    size = effect.size(T[-1]) if effect.acts_on == "input" else effect.size(M, T[-1])
    return shape | dict.fromkeys(effect.amplitudes, size) | dict(effect.complete)


def started(text):
    """Parameters of a case by their names in an FMU."""
    effect, location = parse_effect(text)
    values = SHARP.get(effect.kind) or typical(effect.kind)
    return {effect.name_at(location, name): value for name, value in values.items()}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """The drive without effects."""
    return build_python(Drive(), tmp_path_factory.mktemp("drive"))


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """own(text) is the drive with an effect built in; anything may act at its port."""
    folder, made = tmp_path_factory.mktemp("own"), {}

    class Line(Drive):
        """A drive to which anything may happen."""

        places_known = False

    def build(text):
        if text not in made:
            made[text] = build_python(Line([parse_effect(text)]), folder / f"{len(made)}.fmu")
        return made[text]

    return build


@pytest.fixture(scope="module")
def around(drive, tmp_path_factory):
    """around(text) is the drive as a foreign FMU with an effect around it."""
    folder, made = tmp_path_factory.mktemp("around"), {}

    def build(text):
        if text not in made:
            kind, location = text.split("@")
            made[text] = build_coupled(drive, [PORT], [(kind, location)], folder / f"{len(made)}.fmu")
        return made[text]

    return build


def run(path, start):
    """Free run of the drive, (N, 2)."""
    with Fmu(path) as fmu:
        return fmu.simulate(T, INPUTS, OUTPUTS, start)


@pytest.mark.parametrize("text", CASES)
def test_around_a_foreign_fmu_an_effect_does_what_it_does_in_our_own(text, drive, own, around):
    bare, inside, outside = run(drive, {}), run(own(text), started(text)), run(around(text), started(text))
    size = np.abs(inside - bare).max(axis=0)
    assert np.all(size > 1e-4)  # m, m/s: the case shows
    assert np.all(np.abs(outside - inside).max(axis=0) < 5e-5 * size)  # of coupling steps of 1 ms
    assert_allclose(run(around(text), {}), bare, atol=1e-12)  # off: the same steps, in shorter ones


@pytest.mark.parametrize("text", CASES)
def test_an_effect_that_is_off_changes_no_run(text, drive, own):
    assert_array_equal(run(own(text), {}), run(drive, {}))


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("hysteresis@carriage", 2e-3),
        ("input_delay@F", 1e-3),  # its fastest motion takes 11 ms
        ("step_force@carriage", 2e-3),
        ("viscous_damping@carriage", 2e-3),
        ("quadratic_damping@carriage", 2e-3),
    ],
)
def test_the_coupling_error_is_of_second_order(text, step, drive, own, tmp_path):
    expected, error = run(own(text), started(text)), []
    for dt in (step, step / 2):
        kind, location = text.split("@")
        made = build_coupled(drive, [PORT], [(kind, location)], tmp_path / f"{dt}.fmu", step=dt)
        error.append(np.abs(run(made, started(text)) - expected).max())
    assert np.log2(error[0] / error[1]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("build", ["own", "around"])
@pytest.mark.parametrize("text", CASES)
def test_a_restart_from_the_middle_repeats_the_rest(text, build, request):
    """Exactly, but for the first coupling step around a foreign FMU, for which no acceleration is known."""
    path, start, middle = request.getfixturevalue(build)(text), started(text), 170
    with Fmu(path) as fmu:
        states = fmu.description.states
        whole = fmu.simulate(T, INPUTS, states, start)
        there = dict(zip(states, whole[middle].tolist(), strict=True))
        rest = {n: u[middle:] for n, u in INPUTS.items()}
        again = fmu.simulate(T[middle:], rest, states, start | there)
    away = np.abs(again - whole[middle:]).max(axis=0)
    assert np.all(away <= (1e-5 * np.ptp(whole, axis=0) if build == "around" else 0.0))


@pytest.mark.parametrize("text", ["hysteresis@carriage", "parameter_step@M", "input_delay@F"])
def test_what_an_effect_brings_passes_the_grade(text, own, around):
    for path in (own(text), around(text)):
        assert [c.title for c in grade(path).checks if c.passed is False] == []


def test_states_of_effects_can_be_seen_and_set(around):
    with Fmu(around("actuator_lag@F")) as fmu:
        lag = "actuator_lag_F_x"
        assert lag in fmu.description.states
        fmu.restart(actuator_lag_F_share=1.0, **{lag: 40.0})
        fmu.step(0.1)
        assert fmu[lag] == pytest.approx(40.0 * np.exp(-1.0), rel=1e-6)


def test_what_changes_while_running_is_heard_by_the_carried_fmu(around, own):
    for path in (around("parameter_offset@M"), own("parameter_offset@M")):
        with Fmu(path) as fmu:
            fmu.restart()
            fmu.step(0.01, F=10.0)
            fmu.set(parameter_offset_M_delta=95.0)
            assert fmu["q_ddot"] == pytest.approx((10.0 - 200.0 * fmu["q_dot"]) / 190.0, rel=1e-9)
            fmu.set(parameter_offset_M_delta=0.0, M=50.0)
            assert fmu["q_ddot"] == pytest.approx((10.0 - 200.0 * fmu["q_dot"]) / 50.0, rel=1e-9)


def test_several_effects_of_every_sort_at_once(drive, tmp_path):
    effects = [tuple(text.split("@")) for text in CASES]
    start = {n: v for text in CASES for n, v in started(text).items()}

    class Line(Drive):
        """A drive to which anything may happen."""

        places_known = False

    ours = build_python(Line([(EFFECTS[k], at) for k, at in effects]), tmp_path / "ours.fmu")
    theirs = build_coupled(drive, [PORT], effects, tmp_path / "theirs.fmu")
    expected = run(ours, start)
    assert_allclose(run(theirs, start), expected, atol=3e-3 * np.abs(expected).max())


@pytest.mark.slow
def test_everything_on_offer_can_be_built_around_a_foreign_fmu(drive, tmp_path):
    builder = ForeignBuilder(drive, (PORT,), tmp_path)
    kinds = {kind for kind, _ in builder.offers}
    assert kinds == set(EVERY_EFFECT) - COMPONENTS - FALLBACK
    assert {at for _, at in builder.offers} == {"carriage", "F", "M", "F_v"}
    known = describe(builder(builder.offers)).variables
    for kind, location in builder.offers:
        assert any(name.startswith(f"{kind}_{location}_") for name in known)


def test_a_models_builder_offers_what_makes_sense_in_it(tmp_path):
    found = ModelBuilder("testrig", tmp_path).offers
    assert ("actuator_saturation", "T_P") in found
    assert ("parameter_step", "mu0") in found
    assert ("periodic_force", "wheel") in found
    assert ("bump_stop", "wheel") not in found
    assert not {at for _, at in found} & {"pole_pairs", "T_w_ext"}


@pytest.mark.parametrize("joined", [False, True])
def test_effects_that_share_a_library_do_not_change_each_others_numbers(joined, tmp_path):
    """Two by two, in rows of which some have one of them, both or none; and from a start of their states."""
    builder, rng = ModelBuilder("drive", tmp_path / "shared"), np.random.default_rng(1)
    offers = list(builder.offers)
    inputs = {"F": np.append(INPUTS["F"], 0.0)} if joined else INPUTS
    for first, second in zip(offers, offers[1:] + offers[:1], strict=True):
        alone = Drive([(EFFECTS[kind], at) for kind, at in sorted((first, second))], probes=True)
        values = [started("@".join(e)) for e in (first, second)]
        off = {n: 0.0 for own in values for n in own if n in amplitudes(alone)}
        rows = [off | values[0], off | values[1], values[0] | values[1], off | {"M": 100.0}]
        states = {s.name: 0.1 * rng.normal() for s in alone.of(State)}
        found = []
        for path in (builder((first, second)), build_working(alone, tmp_path / "alone.fmu", in_rows=True)):
            with Fmu(path) as fmu:
                assert set(fmu.description.states) == set(states)
                whole = [values[0] | values[1] | row | states for row in rows]
                found.append(fmu.simulate_rows(T, inputs, (*OUTPUTS, "q_ddot"), whole, joined))
        assert_allclose(found[0], found[1], rtol=1e-12, atol=1e-12)  # in another order of the effects
        assert np.ptp(found[0], axis=0).max() > 0


def amplitudes(model):
    return {effect.name_at(at, name) for effect, at in model.effects for name in effect.amplitudes}


@pytest.mark.parametrize("model", sorted(name for name in MODELS if joins(MODELS[name]())))
def test_an_fmu_for_a_hypothesis_shows_no_other_effects(model, tmp_path):
    """Its library has all that its model offers."""
    builder = ModelBuilder(model, tmp_path)
    for kind, at in (
        builder.offers[0],
        builder.offers[-1],
        *(e for e in builder.offers if e[0] == "flexible_mode"),
    ):
        with Fmu(builder(((kind, at),))) as fmu, Fmu(builder(())) as bare:
            more = set(fmu.description.variables) - set(bare.description.variables)
            asked = {"clock", "way"} if EFFECTS[kind].asks or EFFECTS[kind].of_way else set()
            assert more
            assert all(
                n.startswith(f"{kind}_{at}_") or n.startswith(tuple(asked)) for n in more if n[:4] != "der_"
            )
            assert not set(bare.description.variables) - set(fmu.description.variables)


@pytest.mark.parametrize("model", sorted(name for name in MODELS if not joins(MODELS[name]())))
def test_who_shares_an_fmu_does_not_depend_on_what_is_asked(model, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hypotheses, "_once", lambda folder, effects, *_: effects)
        builder = ModelBuilder(model, tmp_path)
        built = {e: builder((e,)) for e in builder.offers}
        a, b = builder.offers[0], builder.offers[-1]
        assert builder((a, b)) == builder((b, a)) == tuple(sorted({*built[a], *built[b]}))
        assert builder(()) == ()
    for e, sharing in built.items():
        assert e in sharing
        assert all(built[other] == sharing for other in sharing)
        assert len(sharing) == 1 or not any(EFFECTS[kind].states("translation") for kind, _ in sharing)


def test_what_a_foreign_fmu_lacks_is_named(drive):
    known = describe(drive)
    for effects, words in (
        ([("viscous_damping", "cariage")], "has no location 'cariage'; did you mean 'carriage'"),
        ([("parameter_step", "m")], "has no tunable parameter 'm'"),
        ([("actuator_lag", "F_ext")], "has no input beside its ports 'F_ext'"),
    ):
        with pytest.raises(BadInput, match=words):
            Outside(known, [PORT]).build([(EFFECTS[k], at) for k, at in effects])
    with pytest.raises(BadInput, match="port 'x': Drive has no input or output 'p'"):
        Outside(known, [PortNames("x", "F_ext", "q_dot", "p")])
    assert ("flexible_mode", "carriage") in offers(Outside(known, [PORT]))
