"""Laws of effects: right in their units, smooth, never driving where they resist."""

import math

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.effects import EFFECTS
from fmus.effects.actuator_saturation import ActuatorSaturation
from fmus.effects.force_law import ForceLaw
from fmus.effects.timing import LONGEST, SHORTEST, begun
from fmus.port import UNITS
from fmus.units import base_exponents
from tests.helpers.everything import EVERY_EFFECT, FORCE_LAWS

RESISTING = [k for k in FORCE_LAWS if k.endswith(("_damping", "_friction"))]
SCALE = {"kg": 3.0, "m": 0.5, "s": 7.0}  # other units of mass, length and time
T = np.linspace(0, 2, 801)
Q = 0.3 * np.sin(3 * T) + 0.1 * np.sin(11 * T)
V = 0.9 * np.cos(3 * T) + 1.1 * np.cos(11 * T)


def of(kind):
    """A sort of place for a kind: a motion, or a unit."""
    return "translation" if issubclass(EFFECTS[kind], ForceLaw) else "N.m"


def force(effect, values, q, v):
    return float(effect(values).force(q, v))


def some_values(effect, rng, motion="translation"):
    """Parameters about their start, amplitudes about 1, within their limits."""
    drawn = {p.name: (p.start or 1.0) * rng.uniform(0.5, 2) for p in effect.parameters(motion)}
    return {p.name: float(np.clip(drawn[p.name], p.min, p.max)) for p in effect.parameters(motion)}


def in_units(unit):
    """What one of a unit is in the units of SCALE; angles stay."""
    return math.prod(SCALE.get(base, 1.0) ** power for base, power in base_exponents(unit).exponents.items())


@pytest.mark.parametrize("kind", RESISTING)
@given(data=st.data(), q=st.floats(-1e3, 1e3), v=st.floats(-1e3, 1e3))
def test_damping_and_friction_never_feed_energy(kind, data, q, v):
    effect = EFFECTS[kind]
    chosen = {
        p.name: data.draw(st.floats(p.min or 0.0, 1e6 if p.max is None else p.max), label=p.name)
        for p in effect.parameters("rotation")
    }
    assert force(effect, chosen, q, v) * v <= 0


@pytest.mark.parametrize("kind", [*RESISTING, "hysteresis", "flexible_mode", "bump_stop"])
def test_what_is_passive_cannot_be_negative(kind):
    effect = EFFECTS[kind]
    assert all(p.min == 0.0 for p in effect.parameters("rotation") if p.name in effect.amplitudes)


@given(q=st.floats(-1, 1), gap=st.floats(0, 0.5), side=st.sampled_from([-1.0, 0.0, 1.0]))
def test_a_bump_stop_pushes_back_and_only_beyond_its_gap(q, gap, side):
    found = force(EFFECTS["bump_stop"], {"k": 3.0, "gap": gap, "side": side}, q, 0.0)
    met = abs(q) > gap and q * side >= 0
    assert found * q <= 0
    assert abs(found) == (pytest.approx(3.0 * (abs(q) - gap)) if met else 0.0)


@given(q=st.floats(-1, 1), gap=st.floats(0, 0.5))
def test_a_spring_with_free_play_gives_nothing_within_it(q, gap):
    spring = -7.0 * q + force(EFFECTS["free_play"], {"k": 7.0, "gap": gap}, q, 0.0)
    assert spring == pytest.approx(-7.0 * np.sign(q) * max(abs(q) - gap, 0.0), abs=1e-12)


@pytest.mark.parametrize("kind", FORCE_LAWS)
def test_force_along_a_motion_is_in_proportion_to_the_amplitudes(kind):
    effect = EFFECTS[kind]
    chosen = some_values(effect, np.random.default_rng(5))
    scaled = chosen | {name: 3.0 * chosen[name] for name in effect.amplitudes}
    expected = 3.0 * effect.along(chosen, T, Q, V)
    assert np.abs(expected).max() > 0
    assert_allclose(effect.along(scaled, T, Q, V), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_amplitudes_are_parameters_that_start_at_zero(kind):
    effect = EFFECTS[kind]
    parameters = {p.name: p for p in effect.parameters(of(kind))}
    assert effect.amplitudes
    assert all(parameters[name].start == 0.0 and effect.is_amplitude(name) for name in effect.amplitudes)
    assert all(p.doc and p.name == name for name, p in parameters.items())
    assert not any(p.fixed for p in parameters.values())  # a scenario may switch an effect on while running
    assert {n for n in parameters if effect.is_amplitude(n)} == set(effect.amplitudes)
    assert set(effect.complete) <= set(effect.amplitudes)
    assert all(parameters[n].min <= value <= parameters[n].max for n, value in effect.complete.items())
    assert set(effect.told) <= set(parameters) - set(effect.amplitudes)


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_a_group_has_an_amplitude_for_each_member(kind):
    effect = EFFECTS[kind]
    grouped = [effect.is_amplitude(f"{a}_mu0") for a in effect.amplitudes]
    assert all(grouped) == (effect.acts_on == "parameter")


@pytest.mark.parametrize("motion", UNITS)
@pytest.mark.parametrize("kind", FORCE_LAWS)
def test_units_make_the_law_hold_in_any_system_of_units(kind, motion):
    effect, rng = EFFECTS[kind], np.random.default_rng(6)
    chosen, unit = some_values(effect, rng, motion), {n: in_units(u) for n, u in UNITS[motion].items()}
    units = {p.name: in_units(p.unit) for p in effect.parameters(motion)}
    other = {name: value * units[name] for name, value in chosen.items()}
    if kind in ("step_force",):
        chosen["t0"], other["t0"] = 0.0, 0.0  # the rounding of a step is a time of its own
    s = in_units("s")
    expected = effect.along(chosen, T, Q, V) * unit["F"]
    found = effect.along(other, T * s, Q * unit["q"], V * unit["q"] / s)
    assert_allclose(found, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("of", "kind", "unit"),
    [
        ("rotation", "viscous_damping", "N.m.s/rad"),
        ("translation", "viscous_damping", "N.s/m"),
        ("rotation", "quadratic_damping", "N.m.s2/rad2"),
        ("translation", "cubic_stiffness", "N/m3"),
        ("rotation", "coulomb_friction", "N.m"),
        ("rotation", "flexible_mode", "N.m.s2/rad"),
        ("kg.m2", "parameter_drift", "kg.m2/s"),
        ("s/m", "parameter_step", "s/m"),
    ],
)
def test_units_are_written_for_the_place(of, kind, unit):
    assert EFFECTS[kind].parameters(of)[0].unit == unit


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_units_are_known_to_every_importer(kind):
    for sort in UNITS if issubclass(EFFECTS[kind], ForceLaw) else ("N.m", "1", "s/m"):
        for v in (*EFFECTS[kind].parameters(sort), *EFFECTS[kind].states(sort)):
            assert base_exponents(v.unit).factor == 1.0


def expressions(kind):
    """All that a kind computes, and the symbols that it depends on, at rest and off."""
    effect = EFFECTS[kind]
    own = [v.name for v in (*effect.parameters(of(kind)), *effect.states(of(kind)))]
    symbols = {n: cs.SX.sym(n) for n in (*own, "clock", "way")}
    at = {v.name: v.start for v in (*effect.parameters(of(kind)), *effect.states(of(kind)))}
    law, q, v = effect(symbols), cs.SX.sym("q"), cs.SX.sym("v")
    if effect.acts_on == "port":
        found = [law.force(q, v), *law.rates(q, v).values()]
    elif effect.acts_on == "input":
        found = [law.passed(q), law.passed_rate(q, v), *law.rates(q).values()]
    else:
        found = [law.changed(q)]
    everything = cs.vertcat(q, v, *symbols.values())
    return cs.Function("all", [everything], [cs.vertcat(*found)]), list(symbols), at


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_derivatives_are_finite_at_zero_and_about_it(kind):
    f, names, at = expressions(kind)
    slope, rng = f.jacobian(), np.random.default_rng(7)
    points = [np.array([0.0, 0.0, *(at.get(n, 0.0) for n in names)])]
    chosen = some_values(EFFECTS[kind], rng, of(kind)) | at | {"clock": 1.0}
    points += [np.array([*rng.uniform(-1, 1, 2), *(chosen.get(n, 0.0) for n in names)]) for _ in range(5)]
    for x in points:
        assert np.isfinite(slope(x, 0).full()).all()


@pytest.mark.parametrize("kind", sorted(set(EVERY_EFFECT) - {"actuator_saturation"}))
def test_nothing_jumps(kind):
    """Along any line the change over a ten-thousandth of it is small, as an integrator needs it."""
    f, names, at = expressions(kind)
    rng = np.random.default_rng(8)
    chosen = some_values(EFFECTS[kind], rng, of(kind))
    held = [chosen.get(n, at.get(n, 0.0)) for n in names]
    ends = [np.array([*rng.uniform(-1, 1, 2), *held]) for _ in range(2)]
    moving = [0, 1, *(2 + i for i, n in enumerate(names) if n not in chosen)]
    ends[1][moving[2:]] += 1.0  # clock, way and states
    line = np.linspace(0, 1, 10001)
    path = ends[0][:, None] + (ends[1] - ends[0])[:, None] * line
    values = np.array(f.map(path.shape[1])(path))
    # rounded laws change within T_r or v_s, some thousandths of the line; a jump would take one point
    assert np.all(np.abs(np.diff(values, axis=1)).max(axis=1) <= 0.1 * np.ptp(values, axis=1) + 1e-12)


def test_only_the_rate_of_a_saturated_input_jumps():
    u, u_dot = cs.SX.sym("u"), cs.SX.sym("u_dot")
    law = ActuatorSaturation({"share": 1.0, "limit": 2.0})
    f = cs.Function("f", [u, u_dot], [law.passed(u), law.passed_rate(u, u_dot)])
    assert [float(x) for x in f(1.5, 3.0)] == [1.5, 3.0]
    assert [float(x) for x in f(2.5, 3.0)] == [2.0, 0.0]
    assert [float(x) for x in f(-2.5, 3.0)] == [-2.0, 0.0]


@given(t0=st.floats(0.1, 10), since=st.floats(-5, 5), T_r=st.floats(SHORTEST, LONGEST))
def test_a_step_is_off_before_its_time_on_after_it_and_half_way_at_it(t0, since, T_r):
    found = float(begun(cs.DM(t0 + since), cs.DM(t0), cs.DM(T_r)))
    if abs(since) > 0.501 * T_r:
        assert found == (1.0 if since > 0 else 0.0)
    else:
        assert 0.0 <= found <= 1.0
    assert float(begun(cs.DM(t0), cs.DM(t0), cs.DM(T_r))) == 0.5
    assert float(begun(cs.DM(max(t0 + since, 0.0)), cs.DM(0.0), cs.DM(T_r))) == 1.0  # no time given: always


@pytest.mark.parametrize(
    ("kind", "values", "so"),
    [
        ("coulomb_friction", {"v_s": 1e-3}, True),
        ("coulomb_friction", {"v_s": 0.1}, False),  # a smooth damper over all of the motion
        ("stribeck_friction", {"v_s": 1e-3, "v_b": 0.02}, True),
        ("stribeck_friction", {"v_s": 0.02, "v_b": 0.01}, False),  # what falls is rounded away
        ("stribeck_friction", {"v_s": 0.1, "v_b": 0.2}, False),
        ("flexible_mode", {"f": 2.0, "D": 0.1}, True),
        ("flexible_mode", {"f": 0.2, "D": 0.1}, False),  # its mass stays where it is
        ("viscous_damping", {"c": 1.0}, True),
    ],
)
@pytest.mark.parametrize("turns", [0.0, 20.0])
def test_a_law_at_a_limit_of_its_shape_is_another_one(kind, values, so, turns):
    t = np.arange(0.0, 20.0, 0.01)
    q, v = 0.01 * np.sin(2 * np.pi * t), 0.02 * np.pi * np.cos(2 * np.pi * t)
    law = EFFECTS[kind]
    assert issubclass(law, ForceLaw)
    assert law.true_to_name(values, q, v) is so
    if turns and kind == "flexible_mode":  # a shaft that goes round, of which the angle tells no frequency
        assert law.true_to_name(values, q + turns * t, v + turns)


def test_the_laws_are_those_of_the_text_books():
    at = {"q": 0.2, "v": -3.0}
    assert force(EFFECTS["viscous_damping"], {"c": 2.0}, **at) == 6.0
    assert force(EFFECTS["quadratic_damping"], {"c": 2.0}, **at) == 18.0
    assert force(EFFECTS["constant_force"], {"F_0": 2.0}, **at) == -2.0
    assert force(EFFECTS["coulomb_friction"], {"F_c": 2.0, "v_s": 1e-3}, **at) == 2.0
    assert force(EFFECTS["cubic_stiffness"], {"k_3": 2.0}, **at) == pytest.approx(-0.016)
    turning = {"F_sin": 2.0, "F_cos": 1.0, "order": 3.0}
    assert force(EFFECTS["periodic_force"], turning, **at) == pytest.approx(2 * math.sin(0.6) + math.cos(0.6))
    falling = {"F_c": 2.0, "F_b": 3.0, "v_b": 3.0, "v_s": 1e-3}
    assert force(EFFECTS["stribeck_friction"], falling, **at) == pytest.approx(2 + 3 / math.e)
