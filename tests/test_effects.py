"""Effects: off at zero, right in their units, never driving where they resist, refused where senseless."""

import math

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.effects import EFFECTS, parse_effect
from fmus.effects.effect import Effect
from fmus.errors import BadInput
from fmus.model import equations
from fmus.models import MODELS
from fmus.port import UNITS
from fmus.units import base_exponents
from fmus.variables import Input, Output, Parameter, State
from tests.everything import EVERY_EFFECT, EVERY_MODEL, EVERY_PLACE, fitting, near_start, start, values

CONTRACT = """
    constant_force step_force coulomb_friction stribeck_friction viscous_damping quadratic_damping
    cubic_stiffness bump_stop free_play hysteresis periodic_force harmonic_excitation
    stiffness_change damping_change
"""
RESISTING = [kind for kind in EVERY_EFFECT if kind.endswith(("_damping", "_friction"))]
OF_ONE_MOTION = [(m, kind, at) for m, kind, at in EVERY_PLACE if not MODELS[m]().ports()[at].parts]
SCALE = {"kg": 3.0, "m": 0.5, "s": 7.0}  # other units of mass, length and time


def force(effect: type[Effect], values: dict[str, float], q: float, v: float) -> float:
    """The force of a law with these parameters."""
    return float(effect(values).force(q, v))


def some_values(
    effect: type[Effect], rng: np.random.Generator, motion: str = "translation"
) -> dict[str, float]:
    """Parameters about their start, amplitudes about 1, within their limits."""
    return {
        p.name: max((p.start or 1.0) * rng.uniform(0.5, 2), p.min if p.min is not None else -math.inf)
        for p in effect.parameters(motion)
    }


def in_units(unit: str) -> float:
    """What one of a unit is in the units of SCALE; angles stay."""
    return math.prod(SCALE.get(base, 1.0) ** power for base, power in base_exponents(unit).exponents.items())


@pytest.mark.parametrize("place", EVERY_PLACE, ids="-".join)
def test_zero_amplitude_changes_nothing(place):
    name, kind, location = place
    base, model = MODELS[name](), MODELS[name]([(EFFECTS[kind], location)])
    bare, built = equations(base), equations(model)
    rng = np.random.default_rng(0)
    for _ in range(10):
        x, u, p = near_start(base, rng)
        more = np.concatenate([p, start(model, Parameter)[len(p) :]])
        assert_array_equal(values(built.f, x, u, more), values(bare.f, x, u, p))
        assert_array_equal(values(built.h, x, u, more), values(bare.h, x, u, p))


@pytest.mark.parametrize("place", OF_ONE_MOTION, ids="-".join)
def test_a_law_at_a_place_is_its_force_on_the_motion_there(place):
    name, kind, location = place
    probed, model, effect = (
        MODELS[name](probes=True),
        MODELS[name]([(EFFECTS[kind], location)]),
        EFFECTS[kind],
    )
    by_hand, built = equations(probed), equations(model)
    inputs, outputs = ([v.name for v in probed.of(k)] for k in (Input, Output))
    rng = np.random.default_rng(4)
    for _ in range(5):
        x, u, p = near_start(MODELS[name](), rng)
        chosen = some_values(effect, rng)
        pushed = np.concatenate([u, np.zeros(len(inputs) - len(u))])
        motion = dict(zip(outputs, values(by_hand.h, x, pushed, p), strict=True))
        q, v = (motion[f"{location}_{what}"] for what in ("displacement", "velocity"))
        pushed[inputs.index(f"{location}_force")] = force(effect, chosen, q, v)
        more = np.concatenate([p, list(chosen.values())])
        # 1e-9: the same sums in another order
        expected = values(by_hand.f, x, pushed, p)
        assert_allclose(values(built.f, x, u, more), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("place", sorted({*EVERY_PLACE} - {*OF_ONE_MOTION}), ids="-".join)
def test_a_law_at_places_alike_is_its_force_at_each_by_the_motion_there(place):
    name, kind, location = place
    base, model, effect = MODELS[name](), MODELS[name]([(EFFECTS[kind], location)]), EFFECTS[kind]
    bare, built, inputs = equations(base), equations(model), [v.name for v in base.of(Input)]
    symbols = [
        cs.vertcat(*(base.free_symbols[v.name] for v in base.of(k))) for k in (State, Input, Parameter)
    ]
    rng = np.random.default_rng(7)
    for _ in range(5):
        point = x, u, p = near_start(base, rng)
        chosen, pushed = some_values(effect, rng), u.copy()
        for part in base.ports()[location].parts:
            there = cs.vertcat(part.displacement, part.velocity, *part.forces.values())
            q, v, *gains = values(cs.Function("there", symbols, [there]), *point)
            for n, gain in zip(part.forces, gains, strict=True):
                pushed[inputs.index(n)] += gain * force(effect, chosen, q, v)
        expected = values(bare.f, x, pushed, p)
        found = values(built.f, x, u, np.concatenate([p, list(chosen.values())]))
        # 1e-9: the same sums in another order
        assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("kind", RESISTING)
@given(data=st.data(), q=st.floats(-1e3, 1e3), v=st.floats(-1e3, 1e3))
def test_damping_and_friction_never_feed_energy(kind, data, q, v):
    effect = EFFECTS[kind]
    chosen = {
        p.name: data.draw(st.floats(p.min or 0.0, 1e6 if p.max is None else p.max), label=p.name)
        for p in effect.parameters("rotation")
    }
    assert force(effect, chosen, q, v) * v <= 0


@pytest.mark.parametrize("kind", RESISTING)
def test_damping_and_friction_cannot_be_negative(kind):
    effect = EFFECTS[kind]
    assert all(p.min == 0.0 for p in effect.parameters("rotation") if p.name in effect.amplitudes)


@pytest.mark.parametrize("kind", EVERY_EFFECT)
@given(q=st.floats(-1e3, 1e3), v=st.floats(-1e3, 1e3), factor=st.floats(-1e3, 1e3))
def test_force_is_in_proportion_to_the_amplitudes(kind, q, v, factor):
    effect = EFFECTS[kind]
    chosen = some_values(effect, np.random.default_rng(5))
    scaled = chosen | {name: factor * chosen[name] for name in effect.amplitudes}
    expected = factor * force(effect, chosen, q, v)
    assert_allclose(force(effect, scaled, q, v), expected, rtol=1e-9, atol=1e-300)


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_amplitudes_are_parameters_that_start_at_zero(kind):
    effect = EFFECTS[kind]
    parameters = {p.name: p for p in effect.parameters("translation")}
    assert effect.amplitudes
    assert all(parameters[name].start == 0.0 for name in effect.amplitudes)
    assert all(p.doc and p.name == name for name, p in parameters.items())
    assert not any(p.fixed for p in parameters.values())  # a scenario may switch an effect on while running


@pytest.mark.parametrize("motion", UNITS)
@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_units_make_the_law_hold_in_any_system_of_units(kind, motion):
    effect, rng = EFFECTS[kind], np.random.default_rng(6)
    units = UNITS[motion]
    for _ in range(5):
        chosen, (q, v) = some_values(effect, rng, motion), rng.uniform(-2, 2, 2)
        other = {p.name: chosen[p.name] * in_units(p.unit) for p in effect.parameters(motion)}
        in_other = force(effect, other, q * in_units(units["q"]), v * in_units(f"{units['q']}/s"))
        assert_allclose(in_other, force(effect, chosen, q, v) * in_units(units["F"]), rtol=1e-9)


@pytest.mark.parametrize(
    ("motion", "kind", "unit"),
    [
        ("rotation", "viscous_damping", "N.m.s/rad"),
        ("translation", "viscous_damping", "N.s/m"),
        ("rotation", "quadratic_damping", "N.m.s2/rad2"),
        ("translation", "cubic_stiffness", "N/m3"),
        ("rotation", "coulomb_friction", "N.m"),
    ],
)
def test_units_are_written_for_the_kind_of_motion(motion, kind, unit):
    assert EFFECTS[kind].parameters(motion)[0].unit == unit


def test_kinds_are_the_contracts():
    assert set(EVERY_EFFECT) <= {*CONTRACT.split()}


def test_the_laws_are_those_of_the_text_books():
    at = {"q": 0.2, "v": -3.0}
    assert force(EFFECTS["viscous_damping"], {"c": 2.0}, **at) == 6.0
    assert force(EFFECTS["quadratic_damping"], {"c": 2.0}, **at) == 18.0
    assert force(EFFECTS["constant_force"], {"F_0": 2.0}, **at) == -2.0
    assert force(EFFECTS["coulomb_friction"], {"F_c": 2.0, "v_s": 1e-3}, **at) == 2.0
    assert force(EFFECTS["cubic_stiffness"], {"k_3": 2.0}, **at) == pytest.approx(-0.016)
    turning = {"F_sin": 2.0, "F_cos": 1.0, "order": 3.0}
    assert force(EFFECTS["periodic_force"], turning, **at) == pytest.approx(2 * math.sin(0.6) + math.cos(0.6))


@pytest.mark.parametrize("name", EVERY_MODEL)
def test_every_effect_can_be_built_in_at_once(name):
    model = MODELS[name](fitting(name))
    equations(model)
    for effect, location in fitting(name):
        for parameter in effect.parameters("translation"):
            built = model.variables[f"{effect.kind}_{location}_{parameter.name}"]
            assert (built.start, built.min) == (parameter.start, parameter.min)


@pytest.mark.parametrize(
    ("kind", "location", "words"),
    [
        ("viscous_damping", "rolller", "Testrig has no location 'rolller'; did you mean 'roller'"),
        ("viscous_damping", "xyz", "known are contact, roller, wheel"),
        ("cubic_stiffness", "wheel", "cubic_stiffness makes no sense at 'wheel' of Testrig"),
    ],
)
def test_a_misplaced_effect_is_refused(kind, location, words):
    with pytest.raises(BadInput, match=words):
        MODELS["testrig"]([(EFFECTS[kind], location)])


def test_effects_are_offered_only_where_they_make_sense():
    for name in EVERY_MODEL:
        for location, port in MODELS[name]().ports().items():
            for kind in EVERY_EFFECT:
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
