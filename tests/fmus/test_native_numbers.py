"""Native FMUs compute what the PythonFMU build computes, by both FMI versions and kinds of simulation."""

from contextlib import contextmanager
from ctypes import c_double

import casadi as cs
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from numpy.testing import assert_allclose, assert_array_equal

from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from fmus.host.status import DISCARD
from fmus.model import Model, equations
from fmus.models import MODELS
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from tests.helpers.everything import near_start, values
from tests.helpers.native import every_version, native
from tests.helpers.runs import (
    DT,
    names,
    start_of,
    stirred,
)
from tests.helpers.sizes import by_size, quick_if_smallest

LONG = 0.05  # s, many internal steps


def history(path, model, dt, seed, steps=30):
    """All outputs of the model after each step, from a point near the start."""
    rng = np.random.default_rng(seed)
    begin, rows = start_of(model, near_start(model, rng)), stirred(model, rng, steps)
    with Fmu(path) as fmu:
        fmu.restart(**begin)
        found = []
        for row in rows:
            fmu.step(dt, **row)
            found.append(fmu.read(names(model, (State, Output))))
    return np.array(found)


@by_size
@pytest.mark.parametrize("dt", [DT, LONG])
def test_native_python_and_both_versions_agree_to_the_last_bit(built, name, dt):
    model = MODELS[name]()
    expected = history(built(name), model, dt, 4)
    found = [history(native(name, fmi=fmi), model, dt, 4) for fmi in (2, 3)]
    assert np.isfinite(expected).all()
    # 1e-9 is what is promised; another machine's libm may differ from CasADi's in the last bits
    assert_allclose(found[0], expected, rtol=1e-9, atol=1e-15)
    assert_array_equal(found[0], found[1])


@quick_if_smallest  # every effect at every place makes a large program of any model
def test_builds_with_effects_agree(built, name):
    model = MODELS[name]()
    expected = history(built(name, "all"), model, DT, 5, steps=10)
    assert_allclose(history(native(name, "all"), model, DT, 5, steps=10), expected, rtol=1e-9, atol=1e-15)


class Tabled(Model):
    """A mass on a spring from a table, with a choice between two dampers: functions called in equations."""

    name = "Tabled"
    step_size = 0.01
    method = "rodas3"
    x = State("m", 0.3, doc="place", nominal=1.0)
    v = State("m/s", doc="speed", nominal=1.0)
    u = Input("N", doc="force", nominal=1.0)
    law = Parameter("1", 1.0, min=0.0, max=1.0, doc="damper: 0 linear, 1 quadratic", fixed=True)
    F = Output("N", doc="force of the spring")

    def _forces(self):
        grid = np.linspace(-3, 3, 25)
        spring = cs.interpolant("spring", "bspline", [grid], np.sinh(grid))
        v = cs.SX.sym("v")
        dampers = [cs.Function(f"d{i}", [v], [e]) for i, e in enumerate((0.5 * v, v * cs.fabs(v)))]
        chosen = cs.Function.conditional("damper", dampers[:1], dampers[1])
        return self.call(spring, self.x)[0], self.call(chosen, self.law, self.v)[0]

    def derivatives(self):
        spring, damper = self._forces()
        return {"x": self.v, "v": self.u - spring - damper}

    def outputs(self):
        return {"F": self._forces()[0]}


@pytest.mark.parametrize("law", [0.0, 1.0])
def test_functions_called_in_equations_are_compiled_too(law, tmp_path):
    model, dt = Tabled(), 0.05
    rows = stirred(model, np.random.default_rng(2), 20)
    ends = []
    builds = (
        build_python(model, tmp_path / "p"),
        *(build_native(model, tmp_path / str(n), n) for n in (2, 3)),
    )
    for path in builds:
        with Fmu(path) as fmu:
            fmu.restart(law=law)
            ends.append([[fmu.step(dt, **row), *fmu.read(["x", "v", "F"])][1:] for row in rows])
    assert_allclose(ends[1], ends[0], rtol=1e-9, atol=1e-15)
    assert_array_equal(ends[1], ends[2])
    point = np.array([0.3, 0.7, 0.1, law])
    with exchanged(builds[2], 3, {"x": 0.3, "v": 0.7, "u": 0.1, "law": law}) as (fmu, refs):
        slope = [refs["v_dot"]]
        along = [fmu.getDirectionalDerivative(slope, [refs[n]], [1.0])[0] for n in ("x", "v", "u")]
        back = fmu.getAdjointDerivative(slope, [refs[n] for n in ("x", "v", "u")], [1.0], nSensitivity=3)
    damping = 0.5 if law == 0 else 2 * point[1]
    # 1e-3: the table is a spline through points of the sinh
    assert_allclose(along, [-np.cosh(point[0]), -damping, 1.0], atol=1e-3)
    assert_allclose(back, along, rtol=1e-12)


@by_size
@pytest.mark.parametrize("parts", [1, 2.5, 3, 7.000000001])
def test_a_step_is_divided_as_in_python(built, name, parts):
    """Lengths about multiples of the internal step, where one more or less would show."""
    model = MODELS[name]()
    runs = [history(p, model, parts * model.step_size, 6, 3) for p in (built(name), native(name))]
    assert_allclose(runs[1], runs[0], rtol=1e-9, atol=1e-15)


@by_size
@every_version
def test_model_exchange_by_cvode_gives_the_run_of_co_simulation(name, fmi):
    model = MODELS[name]()
    begin = start_of(model, near_start(model, np.random.default_rng(7)))
    # CVODE gives up after 500 steps between two outputs, which at 1e-9 are a few periods of a swing: outputs
    # are close enough together for a swing of 100 Hz
    common = {"start_values": begin, "stop_time": 0.5, "output_interval": 0.01}
    common["output"] = names(model, State)
    cs_run = simulate_fmu(str(native(name, fmi=fmi)), fmi_type="CoSimulation", **common)
    me_run = simulate_fmu(
        str(native(name, fmi=fmi)),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-9,
        **common,
    )
    assert len(cs_run) == len(me_run) == 51
    nominal = np.array([v.nominal for v in model.of(State)])
    gap = [np.subtract(list(a)[1:], list(b)[1:]) / nominal for a, b in zip(cs_run, me_run, strict=True)]
    # internal steps of co-simulation may err by the tolerance each
    assert_allclose(gap, 0, atol=100 * model.tolerance)


@contextmanager
def exchanged(path, fmi, start_values):
    """A model exchange instance in continuous-time mode, and references by name."""
    with Archive(path) as archive:
        d = archive.description
        kind = FMU2Model if fmi == 2 else FMU3Model
        fmu = kind(
            guid=d.guid, unzipDirectory=str(archive.folder), modelIdentifier=d.identifier, instanceName="one"
        )
        fmu.instantiate()
        refs = {n: v.reference for n, v in d.variables.items()}
        put = fmu.setReal if fmi == 2 else fmu.setFloat64
        put([refs[n] for n in start_values], list(start_values.values()))
        if fmi == 2:
            fmu.setupExperiment()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        if fmi == 2:
            fmu.newDiscreteStates()
        else:
            fmu.updateDiscreteStates()
        fmu.enterContinuousTimeMode()
        yield fmu, refs
        fmu.terminate()
        fmu.freeInstance()


@by_size
@every_version
def test_partial_derivatives_are_those_of_the_equations(name, fmi):
    model, rng = MODELS[name](), np.random.default_rng(9)
    point = near_start(model, rng)
    jacobian = jacobian_of(model, np.concatenate(point))
    with exchanged(native(name, fmi=fmi), fmi, start_of(model, point)) as (fmu, refs):
        into, out = ([refs[n] for n in names(model, k)] for k in ((State, Input, Parameter), Output))
        seed = rng.normal(size=len(into)) * np.maximum(np.abs(np.concatenate(point)), 1e-3)
        expected = jacobian @ seed
        found = fmu.getDirectionalDerivative(out, into, seed.tolist())
        # 1e-9 of the largest: the sum may cancel
        assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
        own = refs[names(model, State)[0]]
        assert fmu.getDirectionalDerivative([own], [own], [3.0]) == [3.0]
        if fmi == 3:
            back = rng.normal(size=len(out)) / (np.abs(jacobian).max(axis=1) + 1e-300)
            expected = jacobian.T @ back
            adjoint = fmu.getAdjointDerivative(out, into, back.tolist(), nSensitivity=len(into))
            assert_allclose(adjoint, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
            assert fmu.getAdjointDerivative([own], [own], [3.0]) == [3.0]


def jacobian_of(model, point):
    """Of the outputs by states, inputs and parameters, by CasADi itself."""
    sizes = np.cumsum([0, *(len(model.of(k)) for k in (State, Input, Parameter))])
    v = cs.MX.sym("v", int(sizes[-1]))
    h = equations(model).h(*cs.vertsplit(v, sizes.tolist()))
    return cs.Function("J", [v], [cs.jacobian(h, v)])(point).full()


@by_size
@every_version
def test_model_exchange_shows_the_equations(name, fmi):
    model = MODELS[name]()
    x, u, p = near_start(model, np.random.default_rng(11))
    with exchanged(native(name, fmi=fmi), fmi, start_of(model, (x, u, p))) as (fmu, refs):
        derivatives = "Derivatives" if fmi == 2 else "ContinuousStateDerivatives"
        assert_array_equal(states(fmu, fmi, f"Get{derivatives}", len(x)), values(equations(model).f, x, u, p))
        assert_array_equal(states(fmu, fmi, "GetContinuousStates", len(x)), x)
        nominal = states(fmu, fmi, "GetNominalsOfContinuousStates", len(x))
        assert_array_equal(nominal, [v.nominal for v in model.of(State)])
        get = fmu.getReal if fmi == 2 else fmu.getFloat64
        found = get([v for n, v in refs.items() if n in names(model, Output)])
        assert_array_equal(found, values(equations(model).h, x, u, p))


@every_version
def test_states_that_are_no_numbers_are_discarded_so_that_a_solver_may_go_on(fmi):
    model = MODELS["drive"]()
    point = near_start(model, np.random.default_rng(3))
    with exchanged(native("drive", fmi=fmi), fmi, start_of(model, point)) as (fmu, _):
        n = len(model.of(State))
        bad = (c_double * n)(*[np.nan] * n)
        with pytest.raises(FMICallException) as refused:
            getattr(fmu, f"fmi{fmi}SetContinuousStates")(fmu.component, bad, n)
        assert refused.value.status == DISCARD
        assert_array_equal(states(fmu, fmi, "GetContinuousStates", n), point[0])


def states(fmu, fmi, function, n):
    """What a call says of the n states."""
    found = np.zeros(n)
    getattr(fmu, f"fmi{fmi}{function}")(fmu.component, (c_double * n).from_buffer(found), n)
    return found
