"""What every model keeps, whoever wrote it; and the names that the contract promises."""

import re

import casadi as cs
import numpy as np
import pytest

from fmus.effects import EFFECTS
from fmus.errors import BadInput
from fmus.model import Model, equations
from fmus.models import MODELS, model_class
from fmus.port import UNITS, Port
from fmus.units import base_exponents
from fmus.variables import (
    Input,
    Output,
    Parameter,
    Rate,
    State,
    Variable,
    rate,
)
from tests.helpers.everything import (
    EVERY_MODEL,
    near_start,
    start,
    values,
)

TESTRIG = {  # name: unit, kind
    **dict.fromkeys(["omega_w", "omega_r"], ("rad/s", State)),
    **dict.fromkeys(["theta_w", "theta_r"], ("rad", State)),
    **dict.fromkeys(["T_P", "T_w_ext", "T_r_ext"], ("N.m", Input)),
    "f_sync": ("Hz", Input),
    **dict.fromkeys(["omega_w_dot", "omega_r_dot"], ("rad/s2", Output)),
    **dict.fromkeys(["xi_x", "f_adhesion"], ("1", Output)),
    "F_x": ("N", Output),
    "T_A": ("N.m", Output),
    **dict.fromkeys(["J_w", "J_r"], ("kg.m2", Parameter)),
    **dict.fromkeys(["r_w", "r_r", "a", "b"], ("m", Parameter)),
    **dict.fromkeys(["mu0", "A", "k_A", "k_S", "nu", "pole_pairs"], ("1", Parameter)),
    **dict.fromkeys(["R_Th", "X_Th", "X_2", "R_2"], ("Ohm", Parameter)),
    "N": ("N", Parameter),
    "B": ("s/m", Parameter),
    "G": ("Pa", Parameter),
    "V_Th": ("V", Parameter),
    "f_nom": ("Hz", Parameter),
}
SIDES, CORNERS = ("left", "right"), ("fl", "fr", "rl", "rr")
WHEELSET = {
    **dict.fromkeys(["y", "y_m"], ("m", State)),
    **dict.fromkeys(["y_dot", "y_m_dot"], ("m/s", State)),
    "psi": ("rad", State),
    "psi_dot": ("rad/s", State),
    **dict.fromkeys(["y_irr", "gauge_irr"], ("m", Input)),
    **dict.fromkeys(["y_irr_dot", "V"], ("m/s", Input)),
    **dict.fromkeys(["F_y_ext", "F_ym_ext"], ("N", Input)),
    "M_z_ext": ("N.m", Input),
    **dict.fromkeys(["y_ddot", "y_m_ddot"], ("m/s2", Output)),
    "psi_ddot": ("rad/s2", Output),
    **dict.fromkeys([f"{q}_{side}" for q in ("F_x", "F_y") for side in SIDES], ("N", Output)),
    **dict.fromkeys([f"{q}_{side}" for q in ("xi_x", "xi_y") for side in SIDES], ("1", Output)),
    **dict.fromkeys([f"{q}_{side}" for q in ("r", "a", "b") for side in SIDES], ("m", Output)),
    **dict.fromkeys([f"M_z_{side}" for side in SIDES], ("N.m", Output)),
    **dict.fromkeys([f"xi_s_{side}" for side in SIDES], ("1/m", Output)),
    **dict.fromkeys(["delta_left", "delta_right", "phi"], ("rad", Output)),
    "flange_contact": ("1", Output),
    **dict.fromkeys(["r0", "s", "d"], ("m", Parameter)),
    **dict.fromkeys(["m_w", "m_m"], ("kg", Parameter)),
    **dict.fromkeys(["I_wy", "I_wz"], ("kg.m2", Parameter)),
    **dict.fromkeys(["k_y", "k_x"], ("N/m", Parameter)),
    **dict.fromkeys(["b_y", "b_x"], ("N.s/m", Parameter)),
    **dict.fromkeys(["nu", "mu0", "A", "k_A", "k_S"], ("1", Parameter)),
    **dict.fromkeys(["creep_law", "contact_search", "patch"], ("1", Parameter)),
    **dict.fromkeys(["F_n", "f11", "f22"], ("N", Parameter)),
    "f23": ("N.m", Parameter),
    "f33": ("N.m2", Parameter),
    "G": ("Pa", Parameter),
    "B": ("s/m", Parameter),
}
LIFTS, TURNS = ("z1", "z2", "z3"), ("phi_y1", "phi_x1", "phi_x2", "phi_x3")
VEHICLE = {
    **dict.fromkeys(LIFTS, ("m", State)),
    **dict.fromkeys([f"{q}_dot" for q in LIFTS], ("m/s", State)),
    **dict.fromkeys(TURNS, ("rad", State)),
    **dict.fromkeys([f"{q}_dot" for q in TURNS], ("rad/s", State)),
    **dict.fromkeys([f"u_{c}" for c in CORNERS], ("m", Input)),
    **dict.fromkeys([f"u_{c}_dot" for c in CORNERS], ("m/s", Input)),
    **dict.fromkeys([f"F_{q}_ext" for q in LIFTS], ("N", Input)),
    **dict.fromkeys([f"M_{q[-2:]}_ext" for q in TURNS], ("N.m", Input)),
    **dict.fromkeys([f"{q}_ddot" for q in LIFTS], ("m/s2", Output)),
    **dict.fromkeys([f"{q}_ddot" for q in TURNS], ("rad/s2", Output)),
    **dict.fromkeys([f"d_{level}_{c}" for level in "sp" for c in CORNERS], ("m", Output)),
    **dict.fromkeys([f"d_{level}_{c}_dot" for level in "sp" for c in CORNERS], ("m/s", Output)),
    **dict.fromkeys(["m1", "m2"], ("kg", Parameter)),
    **dict.fromkeys(["k1", "k2"], ("N/m", Parameter)),
    **dict.fromkeys(["b1", "b2"], ("N.s/m", Parameter)),
    **dict.fromkeys(["J_y1", "J_x1", "J_x2"], ("kg.m2", Parameter)),
    **dict.fromkeys(["c1", "c2", "a1", "a2"], ("m", Parameter)),
    "n_primary": ("1", Parameter),
    **dict.fromkeys([f"h_{e}_{c}" for e in ("k1", "b1", "k2", "b2") for c in CORNERS], ("1", Parameter)),
}
PROMISED = {"testrig": TESTRIG, "wheelset": WHEELSET, "vehicle7dof": VEHICLE}


@pytest.fixture(params=EVERY_MODEL)
def model(request):
    return MODELS[request.param]()


def test_names_are_flat_identifiers(model):
    for name, variable in model.variables.items():
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name), name
        assert variable.name == name
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", model.name)  # FMI's model identifier, a C name


def test_units_are_si(model):
    for variable in model.variables.values():
        unit = base_exponents(variable.unit)
        assert (unit.factor, unit.offset) == (1.0, 0.0), f"{variable.name} in {variable.unit}"


def test_each_variable_has_a_description_and_a_start_within_its_limits(model):
    for v in model.variables.values():
        assert v.doc.strip(), v.name
        assert v.min is None or v.min <= v.start, v.name
        assert v.max is None or v.start <= v.max, v.name
        assert v.nominal is None or v.nominal > 0, v.name


def test_states_have_a_nominal(model):
    # inputs of tests, tolerances of steps and estimators go by it
    assert [v.name for v in model.of(State) if v.nominal is None] == []


def test_rates_are_named_after_their_state_and_have_its_unit_by_second(model):
    for v in model.of(Rate):
        assert isinstance(v.of, State)
        expected = f"{v.of.name[:-4]}_ddot" if v.of.name.endswith("_dot") else f"{v.of.name}_dot"
        assert v.name == expected
        state, derivative = base_exponents(v.of.unit).exponents, base_exponents(v.unit).exponents
        assert {**state, "s": state.get("s", 0) - 1} == {"s": 0, **derivative}


def test_names_of_derivatives_are_kept_for_derivatives(model):
    rates = {v.name for v in model.of(Rate)}
    for v in model.of(Output):
        assert not v.name.endswith(("_dot", "_ddot")) or v.name in rates or _is_rate_of_known(model, v), (
            v.name
        )


def _is_rate_of_known(model, v):
    return v.name.rpartition("_")[0] in model.variables


def test_ports_act_through_port_inputs(model):
    for location, port in model.ports().items():
        assert re.fullmatch(r"[a-z][a-z0-9_]*", location)
        for name in port.forces:
            assert name.endswith("_ext"), name
            assert isinstance(model.variables[name], Input), name
            assert model.variables[name].start == 0.0, name


def test_every_port_input_belongs_to_a_port(model):
    used = {name for port in model.ports().values() for name in port.forces}
    assert {v.name for v in model.of(Input) if v.name.endswith("_ext")} <= used


def test_velocity_of_a_port_is_the_rate_of_its_displacement(model):
    x, u, p = (
        cs.vertcat(*(model.free_symbols[v.name] for v in model.of(k))) for k in (State, Input, Parameter)
    )
    point = near_start(model, np.random.default_rng(1))
    dx = values(equations(model).f, *point)
    # an input that comes with its rate moves with it, all others are held
    du = cs.vertcat(*(model.free_symbols.get(f"{v.name}_dot", 0.0) for v in model.of(Input)))
    for location, port in model.ports().items():
        q = cs.SX(port.displacement)
        slope = cs.jtimes(q, x, cs.DM(dx)) + cs.jtimes(q, u, du)
        gap = cs.Function("gap", [x, u, p], [slope - port.velocity])
        assert abs(float(gap(*point))) < 1e-9, location


def test_a_force_does_the_work_of_its_port(model):
    """F v at a port is the power that its parts do on the coordinates: v = sum of gain * v of the input.

    What the model stands on is held, as it is in virtual work.
    """
    ports = model.ports()
    single = {next(iter(p.forces)): p.velocity for p in ports.values() if [*p.forces.values()] == [1.0]}
    x, u, p = (
        cs.vertcat(*(model.free_symbols[v.name] for v in model.of(k))) for k in (State, Input, Parameter)
    )
    states, inputs, parameters = near_start(model, np.random.default_rng(2))
    held = [v.name.endswith("_dot") for v in model.of(Input)]
    point = states, np.where(held, 0.0, inputs), parameters
    for location, port in ports.items():
        if set(port.forces) <= set(single):
            parts = sum(gain * single[name] for name, gain in port.forces.items())
            # of several alike, the motion is the mean, and the force acts at each
            gap = cs.Function("gap", [x, u, p], [len(port.acting) * port.velocity - parts])
            assert abs(float(gap(*point))) < 1e-9, location


def test_equations_are_finite_at_the_start_and_about_it(model):
    made, rng = equations(model), np.random.default_rng(3)
    points = [(start(model, State), start(model, Input), start(model, Parameter))]
    points += [near_start(model, rng) for _ in range(20)]
    for point in points:
        assert np.isfinite(values(made.f, *point)).all()
        assert np.isfinite(values(made.h, *point)).all()
        assert np.isfinite(values(made.step, *point, model.step_size)).all()


def test_parameters_from_the_literature_name_it(model):
    if model.name.lower() in PROMISED:
        assert [v.name for v in model.of(Parameter) if not v.source] == []


@pytest.mark.parametrize(
    ("name", "variable", "unit", "kind"),
    [(m, n, unit, kind) for m, table in PROMISED.items() for n, (unit, kind) in table.items()],
)
def test_contract_names_exist(name, variable, unit, kind):
    found = MODELS[name]().variables[variable]
    assert isinstance(found, kind)
    assert found.unit == unit


class Ball(Model):
    """A mass with a force."""

    name = "Ball"
    step_size = 0.01
    x = State("m", doc="place", nominal=1.0)
    v = State("m/s", doc="speed", nominal=1.0)
    F_ext = Input("N", doc="force")
    m = Parameter("kg", 2.0, doc="mass")
    E = Output("J", doc="energy")
    v_dot = rate(v, "m/s2", "acceleration")

    def derivatives(self):
        return {"x": self.v, "v": self.F_ext / self.m}

    def outputs(self):
        return {"E": self.m * self.v**2 / 2}

    def ports(self):
        return {"ball": Port(self.x, self.v, {"F_ext": 1.0})}


def test_a_model_is_its_declaration():
    made = equations(Ball())
    assert values(made.f, [1, 3], [8], [2]).tolist() == [3, 4]
    assert values(made.h, [1, 3], [8], [2]).tolist() == [9, 4]
    assert list(Ball().variables) == ["x", "v", "F_ext", "m", "E", "v_dot"]
    assert isinstance(Ball.x, Variable)


@pytest.mark.parametrize(
    ("method", "given", "words"),
    [
        ("derivatives", {"x": 0.0}, "Ball.derivatives: v declared or given"),
        ("derivatives", {"x": 0.0, "v": 0.0, "w": 1.0}, "Ball.derivatives: w declared or given"),
        ("outputs", {}, "Ball.outputs: E declared or given"),
        ("outputs", {"E": 0.0, "P": 1.0}, "Ball.outputs: P declared or given"),
    ],
)
def test_missing_and_left_over_expressions_are_refused(method, given, words):
    wrong = type("Wrong", (Ball,), {method: lambda self: given})
    with pytest.raises(ValueError, match=words):
        equations(wrong())


def test_probes_open_every_location(model):
    probed = type(model)(probes=True)
    for location, port in probed.ports().items():
        units = UNITS[port.motion]
        assert probed.variables[f"{location}_force"].unit == units["F"]
        assert probed.variables[f"{location}_displacement"].unit == units["q"]
        assert probed.variables[f"{location}_velocity"].unit == f"{units['q']}/s"
    equations(probed)


class Called(Ball):
    """The ball with functions called in its equations: they see each other's results."""

    def derivatives(self):
        x, y = cs.MX.sym("x"), cs.MX.sym("y", 2)
        square = cs.Function("square", [x], [x**2, cs.vertcat(x, 3 * x)])
        product = cs.Function("product", [y], [y[0] * y[1]])
        squared, both = self.call(square, self.x + self.v)
        (thrice,) = self.call(product, both)  # 3 (x + v)^2
        return {"x": self.v, "v": self.F_ext / self.m + thrice - 3 * squared + self.v * squared}


def test_functions_called_in_the_equations_are_worked_out_in_their_order():
    made = equations(Called())
    x, F, m = np.array([0.7, -0.2]), np.array([8.0]), np.array([2.0])
    assert values(made.f, x, F, m) == pytest.approx([-0.2, 4 - 0.2 * 0.25])
    step = values(made.step, x, F, m, np.array([1e-3]))
    assert step == pytest.approx(x + 1e-3 * np.array([-0.198, 3.95]), abs=1e-6)
    slope = made.f.jacobian()(x, F, m, 0)[0].full()
    assert slope == pytest.approx(np.array([[0, 1], [-0.2, 0.25 - 0.2]]))


class Splined(Ball):
    """The ball on a spring whose force is a spline, in a function that every model of the class shares."""

    name = "Splined"
    q = cs.MX.sym("q")
    spline = cs.bspline(q, cs.DM([1, -2, 3, 4]), [[-2.0] * 4 + [2.0] * 4], [3], 1)
    spring = cs.Function("spring", [q], [spline])

    def derivatives(self):
        (force,) = self.call(self.spring, self.x)
        return {"x": self.v, "v": (self.F_ext - force) / self.m}


@pytest.mark.parametrize("kind", [*MODELS.values(), Splined], ids=lambda kind: kind.name)
def test_linearising_a_model_changes_none_of_its_equations(kind):
    def written(model):
        made = equations(model)
        return [f.serialize() for f in (made.f, made.h, made.step)]

    model = kind()
    before = written(model)
    equations(model).step.jacobian()
    assert written(model) == before
    assert written(kind()) == before


def test_models_are_found_by_name_in_any_case():
    assert model_class("TestRig") is MODELS["testrig"]
    with pytest.raises(BadInput, match="did you mean 'testrig'"):
        model_class("testrigg")


def test_an_effect_twice_at_one_place_is_refused():
    twice = [(EFFECTS["viscous_damping"], "ball")] * 2
    with pytest.raises(BadInput, match="built in twice"):
        Ball(twice)
