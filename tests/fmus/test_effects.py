"""Effects in models: off at zero, at their places what the laws say, refused where senseless."""

import inspect
import sys
from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS, offers, parse_effect
from fmus.effects.force_law import ForceLaw
from fmus.effects.input_effect import InputEffect
from fmus.errors import BadInput
from fmus.model import equations
from fmus.models import MODELS
from fmus.variables import Input, Parameter, State
from tests.helpers.bench import Bench
from tests.helpers.everything import (
    EVERY_EFFECT,
    EVERY_MODEL,
    EVERY_PLACE,
    FALLBACK,
    FORCE_LAWS,
    WITH_MEMORY,
    fitting,
    near_start,
    start,
    values,
)
from tests.helpers.laws import FORCES, PARAMETERS, RATES
from tests.helpers.paths import ROOT
from tests.helpers.sizes import SIZES, marks_of

CONTRACT = """
    constant_force step_force coulomb_friction stribeck_friction viscous_damping quadratic_damping
    cubic_stiffness bump_stop free_play hysteresis periodic_force harmonic_excitation
    stiffness_change damping_change
    parameter_offset parameter_step parameter_drift
    actuator_gain actuator_lag actuator_saturation input_delay
    flexible_mode
"""
ALL = {**MODELS, "bench": Bench}
OWN = {kind for kind in EVERY_EFFECT if ROOT in Path(inspect.getfile(EFFECTS[kind])).parents}
CHANGING = [kind for kind in EVERY_EFFECT if EFFECTS[kind].acts_on in ("parameter", "component")]
MORE = {"clock": 1.0, "way": 30.0}  # a time at which steps that began at 1 s are half done


def all_of(name, *kinds):
    """Effects of these kinds, or of all, wherever they make sense in a model."""
    return [(EFFECTS[k], at) for k, at in offers(ALL[name]()) if not kinds or k in kinds]


def some_values(variables, rng):
    """A value near the start of each variable, about 1 where that is 0, within its limits; by name."""
    drawn = {v.name: (v.start or 1.0) * rng.uniform(0.5, 2) for v in variables}
    return {v.name: np.clip(drawn[v.name], v.min, v.max) for v in variables}


def point(model, base, rng):
    """x, u, p of a model with effects: the base's own near their start, and what effects brought, by name."""
    own = [
        dict(zip((v.name for v in base.of(k)), part, strict=True))
        for k, part in zip((State, Input, Parameter), near_start(base, rng), strict=True)
    ]
    brought = some_values([v for n, v in model.variables.items() if n in model.brought], rng) | {
        n: v for n, v in MORE.items() if n in model.brought
    }
    known = own[0] | own[1] | own[2] | brought
    x, u, p = ([known[v.name] for v in model.of(k)] for k in (State, Input, Parameter))
    return known, (x, u, p)


def of_location(known, kind, location):
    """Parameters and states of an effect at a location, without its prefix."""
    prefix = f"{kind}_{location}_"
    return {n.removeprefix(prefix): v for n, v in known.items() if n.startswith(prefix)}


def force(kind, q, v, p):
    """Force by the second writing of a law, or by the law itself where there is none: its place is tested."""
    if kind in FORCES:
        return FORCES[kind](MORE["clock"], MORE["way"], q, v, p)
    return float(EFFECTS[kind]({**MORE, **p}).force(q, v))


def rates_of(kind, q, v, p):
    """Rates of a law's states by name, written a second time where they are."""
    if kind in RATES:
        return {state: rate(q, v, p) for state, rate in RATES[kind].items()}
    return {state: float(rate) for state, rate in EFFECTS[kind]({**MORE, **p}).rates(q, v).items()}


def changed(kind, value, p):
    """What becomes of a parameter, written a second time where it is."""
    if kind in PARAMETERS:
        return PARAMETERS[kind](MORE["clock"], value, p)
    return float(EFFECTS[kind]({**MORE, **p}).changed(value))


@pytest.mark.parametrize("name", ALL)
def test_effects_that_are_off_change_no_rate_and_no_output(name):
    base, model = ALL[name](), ALL[name](all_of(name))
    bare, built = equations(base), equations(model)
    rng = np.random.default_rng(0)
    for clock in (0.0, 1.0, 50.0):
        x, u, p = near_start(base, rng)
        more = start(model, State)
        more[[v.name for v in model.of(State)].index("clock")] = clock
        more[: len(x)] = x
        rates = values(built.f, more, u, np.concatenate([p, start(model, Parameter)[len(p) :]]))
        assert_array_equal(rates[: len(x)], values(bare.f, x, u, p))
        held = [v.name not in MORE for v in model.of(State)[len(x) :]]
        assert_array_equal(rates[len(x) :][held], 0.0)  # a memory rests until its effect is switched on
        more_p = np.concatenate([p, start(model, Parameter)[len(p) :]])
        assert_array_equal(values(built.h, more, u, more_p), values(bare.h, x, u, p))


@pytest.mark.parametrize(
    ("name", "kind"),
    [pytest.param(m, k, marks=marks_of(SIZES[m])) for m, k in sorted({(m, k) for m, k, _ in EVERY_PLACE})],
)
def test_an_effect_that_is_off_changes_no_step(name, kind):
    base, model = MODELS[name](), MODELS[name](all_of(name, kind)[:1])
    bare, built, rng = equations(base), equations(model), np.random.default_rng(1)
    for _ in range(5):
        x, u, p = near_start(base, rng)
        more_x, more_p = ([*a, *start(model, k)[len(a) :]] for a, k in ((x, State), (p, Parameter)))
        expected = values(bare.step, x, u, p, model.step_size)
        found = values(built.step, more_x, u, more_p, model.step_size)[: len(x)]
        if type(model).method == "rk4" or kind not in WITH_MEMORY:
            assert_array_equal(found, expected)
        else:  # the stages' linear equations are solved in another order
            assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "kind"),
    [pytest.param(m, k, marks=marks_of(SIZES.get(m, 0))) for m in ALL for k in FORCE_LAWS if all_of(m, k)],
)
def test_a_force_law_acts_at_each_part_of_its_place_by_the_motion_there(name, kind):
    base, model = ALL[name](), ALL[name](all_of(name, kind))
    bare, built, rng = equations(base), equations(model), np.random.default_rng(2)
    symbols = [[base.free_symbols[v.name] for v in base.of(k)] for k in (State, Input, Parameter)]
    columns = [cs.vertcat(*s) for s in symbols]
    inputs = [v.name for v in base.of(Input)]
    for _ in range(2):
        known, (x, u, p) = point(model, base, rng)
        n, pushed = len(base.of(State)), np.array(u, dtype=float)
        own = (x[:n], u, p[: len(base.of(Parameter))])
        rates = dict(zip((v.name for v in model.of(State)), values(built.f, x, u, p), strict=True))
        for _, at in all_of(name, kind):
            port, chosen = base.ports()[at], of_location(known, kind, at)
            for i, part in enumerate(port.acting, 1):
                there = cs.vertcat(part.displacement, part.velocity, *part.forces.values())
                q, v, *gains = values(cs.Function("there", columns, [there]), *own)
                number = f"_{i}" if len(port.acting) > 1 else ""
                memory = [s.name for s in EFFECTS[kind].states(part.motion)]
                mine = chosen | {s: chosen[f"{s}{number}"] for s in memory}
                pushing = force(kind, q, v, mine)
                for target, gain in zip(part.forces, gains, strict=True):
                    pushed[inputs.index(target)] += gain * pushing
                for state, rate in rates_of(kind, q, v, mine).items():  # atol: of some 100
                    assert_allclose(rates[f"{kind}_{at}_{state}{number}"], rate, rtol=1e-9, atol=1e-8)
        expected = values(bare.f, own[0], pushed, own[2])
        found = np.array([*rates.values()])[:n]
        # 1e-9: the same sums in another order
        assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("kind", CHANGING)
@pytest.mark.parametrize("location", ["m", "k", "V", "mounting", "mount", "spring"])
def test_parameters_become_what_the_effect_says(kind, location):
    base = Bench()
    if location not in EFFECTS[kind].locations(base) or not EFFECTS[kind].locations(base)[location]:
        with pytest.raises(BadInput, match=location):
            Bench([(EFFECTS[kind], location)])
        return
    names = EFFECTS[kind].locations(base)[location]
    model = Bench([(EFFECTS[kind], location)])
    known, (x, u, p) = point(model, base, np.random.default_rng(3))
    chosen, values_then = of_location(known, kind, location), start(base, Parameter)
    for name in names:
        i = [v.name for v in base.of(Parameter)].index(name)
        mine = {n.removesuffix(f"_{name}"): v for n, v in chosen.items()}
        values_then[i] = changed(kind, values_then[i], mine)
    expected = values(equations(base).f, x[:3], u, values_then)
    assert_allclose(values(equations(model).f, x, u, p)[:3], expected, rtol=1e-12)


def test_a_parameter_and_an_input_stay_within_their_limits():
    model = Bench([(EFFECTS["parameter_offset"], "m"), (EFFECTS["actuator_gain"], "V")])
    f = equations(model).f
    known, (x, u, _) = point(model, Bench(), np.random.default_rng(4))
    p = {v.name: v.start for v in model.of(Parameter)}
    p |= {"parameter_offset_m_delta": -1e6, "actuator_gain_V_gain": -3.0}
    lightest = p | {"parameter_offset_m_delta": 1.0 - p["m"]}
    assert_array_equal(values(f, x, u, [*p.values()]), values(f, x, u, [*lightest.values()]))
    assert known["V"] > 0
    assert values(f, x, u, [*p.values()])[2] == 0.0  # no speed, rather than a negative one


def test_laws_at_ports_see_parameters_and_inputs_as_other_effects_left_them():
    effects = [(EFFECTS["viscous_damping"], "base"), (EFFECTS["actuator_gain"], "u")]
    p = {v.name: v.start for v in Bench(effects).of(Parameter)}
    p |= {"viscous_damping_base_c": 100.0, "actuator_gain_u_gain": 0.5}
    x, u = [0.0, 0.0, 0.0], [0.0, 1.0, 20.0, 0.0, 0.0]
    for order in (effects, effects[::-1]):
        given = [p[v.name] for v in Bench(order).of(Parameter)]
        acceleration = values(equations(Bench(order)).f, x, u, given)[1]
        assert acceleration == pytest.approx((p["b"] + 100.0) * 1.5 / p["m"], rel=1e-12)


def test_kinds_are_the_contracts():
    kinds = {*CONTRACT.split()}
    assert kinds <= OWN
    assert len(FALLBACK) == len(FALLBACK & OWN) == 3
    assert {k for k in kinds if k in FORCE_LAWS} <= set(FORCES)
    assert {k for k in kinds if k in CHANGING} <= set(PARAMETERS)
    assert {k for k in kinds & WITH_MEMORY if k in FORCE_LAWS} <= set(RATES)


def test_what_is_told_twice_is_offered_once():
    found = set(offers(Bench()))
    assert ("stiffness_change", "mount") in found
    assert ("parameter_drift", "k") in found  # it goes on changing, which a component's change does not
    assert not found & {("parameter_offset", "k"), ("parameter_step", "b"), ("parameter_offset", "f0")}
    assert not {at for _, at in found} & {"law", "F_ext", "u_dot"}
    assert ("damping_change", "mount") in found
    assert ("damping_change", "spring") not in found
    assert ("parameter_step", "mounting") in found


@pytest.mark.parametrize("name", ALL)
def test_every_effect_can_be_built_in_at_once(name):
    base, model = ALL[name](), ALL[name](all_of(name))
    brought = [v for n, v in model.variables.items() if n in model.brought]
    assert len(model.variables) == len(base.variables) + len(brought)
    for v in brought:
        assert v.doc.strip(), v.name
        assert v.min is None or v.min <= v.start, v.name
        assert v.max is None or v.start <= v.max, v.name
        assert not isinstance(v, State) or (v.start == 0.0 and v.nominal), v.name
        assert not isinstance(v, Parameter) or not v.fixed, v.name


def test_a_harmonic_force_may_be_locked_to_the_way_where_there_is_a_speed():
    assert "harmonic_excitation_mass_n_x" in Bench(all_of("bench", "harmonic_excitation")).variables
    wheel = MODELS["testrig"]([(EFFECTS["harmonic_excitation"], "wheel")])
    assert not any("n_x" in n or n == "way" for n in wheel.variables)


@pytest.mark.parametrize(
    "made", [MODELS["wheelset"], MODELS["wheelset"].with_switches()], ids=["own", "many"]
)
def test_the_way_is_that_of_the_speed_as_effects_have_changed_it(made):
    effects = [(EFFECTS["actuator_gain"], "V"), (EFFECTS["harmonic_excitation"], "wheelset_lateral")]
    for chosen in (effects, effects[::-1]):
        assert "actuator_gain_V_gain" in {s.name() for s in cs.symvar(made(chosen).rates["way"])}


def test_time_and_way_are_there_only_for_those_who_ask():
    assert "clock" not in Bench([(EFFECTS["viscous_damping"], "mass")]).variables
    model = Bench([(EFFECTS["step_force"], "mass"), (EFFECTS["parameter_drift"], "m")])
    assert [v.name for v in model.of(State)][3:] == ["clock"]


@pytest.mark.parametrize(
    ("kind", "location", "words"),
    [
        ("viscous_damping", "rolller", "Testrig has no location 'rolller'; did you mean 'roller'"),
        ("viscous_damping", "xyz", "known are contact, roller, wheel"),
        ("cubic_stiffness", "wheel", "cubic_stiffness makes no sense at 'wheel' of Testrig, which turns"),
        ("parameter_step", "mu", "Testrig has no tunable parameter 'mu'; did you mean 'mu0'"),
        ("parameter_offset", "pole_pairs", "Testrig has no tunable parameter 'pole_pairs'"),
        ("actuator_gain", "T_w_ext", "Testrig has no input beside its ports 'T_w_ext'"),
        ("stiffness_change", "secondary", "Testrig has no component 'secondary'; none are known here"),
    ],
)
def test_a_misplaced_effect_is_refused(kind, location, words):
    with pytest.raises(BadInput, match=words):
        MODELS["testrig"]([(EFFECTS[kind], location)])


def test_a_part_that_damps_nothing_has_no_damping_to_change():
    with pytest.raises(BadInput, match="damping_change makes no sense at 'spring' of Bench, which has none"):
        Bench([(EFFECTS["damping_change"], "spring")])


def test_effects_are_offered_only_where_they_make_sense():
    for name in EVERY_MODEL:
        for location, port in MODELS[name]().ports().items():
            for kind in set(FORCE_LAWS) - FALLBACK:
                if (name, kind, location) not in EVERY_PLACE:
                    assert port.place not in EFFECTS[kind].places
                    with pytest.raises(BadInput, match=f"'{location}' of {MODELS[name].name}"):
                        MODELS[name]([(EFFECTS[kind], location)])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("viscous_damping", "write KIND@LOCATION"),
        ("viscous_damping@", "write KIND@LOCATION"),
        ("", "write KIND@LOCATION"),
        ("viscous_dampin@roller", "did you mean 'viscous_damping'"),
        ("@roller", "kind '' is not known"),
    ],
)
def test_an_effect_written_wrongly_is_refused(text, words):
    with pytest.raises(BadInput, match=words):
        parse_effect(text)


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_an_effect_is_read_from_its_name(kind):
    assert parse_effect(f"{kind}@somewhere") == (EFFECTS[kind], "somewhere")


def test_the_contracts_examples_can_be_built():
    for text in (
        "actuator_saturation@T_P",
        "parameter_step@mu0",
        "input_delay@f_sync",
        "flexible_mode@wheel",
    ):
        effect, location = parse_effect(text)
        assert any(
            n.startswith(f"{effect.kind}_{location}_")
            for n in MODELS["testrig"]([(effect, location)]).variables
        )


def test_each_effect_says_where_it_comes_from_and_what_it_looks_like():
    for effect in EFFECTS.values():
        text = sys.modules[effect.__module__].__doc__
        assert "In data: " in text
        assert effect.source
        assert issubclass(effect, (ForceLaw, InputEffect)) or effect.acts_on in ("parameter", "component")


def test_all_that_fits_is_offered():
    assert len(fitting("testrig")) == len(offers(MODELS["testrig"]()))


def test_the_documentation_names_every_kind_with_its_parameters_and_source():
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    assert set(rows) == {*OWN, *FAULTS}
    for kind, fault in FAULTS.items():
        assert f"`{fault.__doc__.strip().rstrip('.')}`" in rows[kind]
    for kind, effect in ((kind, EFFECTS[kind]) for kind in OWN):
        law = effect.__doc__.strip().splitlines()[0].rstrip(".").replace("|", "\\|")
        assert f"`{law}`" in rows[kind]
        assert all(f"`{p.name}`" in rows[kind] for p in effect.parameters("translation"))
        assert f"- `{kind}`: {effect.source}." in text
