"""Many rows in one call of a native FMU give what instances one after the other give."""

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.effects import EFFECTS
from fmus.export.builders.native import code as source_code
from fmus.export.builders.native import lanes
from fmus.export.builders.native.lanes import BINARY, CALLED, ONE_BY_ONE, UNARY, lanes_of, widest
from fmus.export.builders.native.working import build_working
from fmus.host.fmu import Fmu, FmuError
from fmus.model import Model
from fmus.models import MODELS
from fmus.variables import Input, Output, Parameter, State
from tests.helpers.everything import near_start
from tests.helpers.native import native
from tests.helpers.runs import names, start_of
from tests.helpers.sizes import by_size

ALIKE = 1e-12  # relative to the size of a variable, the greatest difference between rows and instances
ALONG = 1e-9  # the same after many steps, over which contact and friction enlarge what rounding leaves
ROUNDED = 4.0  # units in the last place by which a function may differ from C's library
TWO = {cs.OP_POW, cs.OP_ATAN2, cs.OP_HYPOT, cs.OP_FMOD, *BINARY}
CODES = sorted({*UNARY, *BINARY, *CALLED, *ONE_BY_ONE} - {cs.OP_ASSIGN, cs.OP_CONSTPOW})


class Operations(Model):
    """Every operation of two inputs as an output."""

    name = "Operations"
    step_size = 1.0
    z = State("1", doc="nothing")
    a = Input("1", doc="first argument")
    b = Input("1", doc="second argument")
    vars().update({f"y_{code}": Output("1", doc="an operation") for code in CODES})

    def derivatives(m):
        return {"z": -m.z}

    def outputs(m):
        a, b = cs.SX.sym("a"), cs.SX.sym("b")
        found = {}
        for code in CODES:
            one = cs.Function(
                "one", [a, b], [cs.SX.binary(code, a, b) if code in TWO else cs.SX.unary(code, a)]
            )
            found[f"y_{code}"] = one(m.a, m.b)
        return found


WIDTHS = sorted({4, widest()})


def in_lanes(model, width, folder):
    """The working FMU of a model with so many lanes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(source_code, "widest", lambda: width)
        return build_working(model, folder / f"{width}.fmu", in_rows=True)


@pytest.fixture(scope="module", params=WIDTHS)
def operations(request, tmp_path_factory):
    with Fmu(in_lanes(Operations(), request.param, tmp_path_factory.mktemp("operations"))) as fmu:
        assert fmu.at_once == request.param
        yield fmu


def record(model, seed, k, n=60):
    """Times and inputs of a run, and k starts that differ in every state and parameter that may differ."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(model.step_size * rng.uniform(0.3, 2.5, n))
    u = np.array([near_start(model, rng)[1] for _ in t])
    fixed = {v.name: v.start for v in model.of(Parameter) if v.fixed}
    starts = [start_of(model, near_start(model, rng)) | fixed for _ in range(k)]
    return t, dict(zip(names(model, Input), u.T, strict=True)), starts


@by_size
def test_rows_are_simulated_as_instances_are(name):
    model = MODELS[name]()
    with Fmu(native(name)) as fmu:
        for seed, k in enumerate((1, 4, 6)):
            t, inputs, starts = record(model, seed, k)
            held = {name: samples[:-1] for name, samples in inputs.items()}  # over each step
            for driven in (inputs, held):
                expected = np.array([fmu.simulate(t, driven, fmu.description.outputs, s) for s in starts])
                found = fmu.simulate_rows(t, driven, fmu.description.outputs, starts)
                off = np.abs(found - expected) / np.maximum(np.abs(expected).max(axis=(0, 1)), 1e-9)
                assert off[:, :2].max() <= ALIKE
                assert off.max() <= ALONG
                assert k == 1 or np.ptp(found[:, -1], axis=0).max() > 0


@by_size
def test_of_every_so_many_samples_one_is_read_with_the_same_bits(name):
    model = MODELS[name]()
    t, inputs, starts = record(model, 3, 5, n=61)
    with Fmu(native(name)) as fmu:
        asked = t, inputs, fmu.description.outputs, starts
        whole = fmu.simulate_rows(*asked)
        for every in (1, 2, 5, 60):
            assert_array_equal(fmu.simulate_rows(*asked, every=every), whole[:, ::every])


@pytest.mark.skipif(len(WIDTHS) == 1, reason="this processor has four lanes only")
@by_size
def test_a_row_is_the_same_however_many_are_advanced_at_once(name, tmp_path):
    model = MODELS[name]()
    t, inputs, starts = record(model, 7, 11)
    found = []
    for width in WIDTHS:
        with Fmu(in_lanes(model, width, tmp_path)) as fmu:
            found.append(fmu.simulate_rows(t, inputs, fmu.description.outputs, starts))
    assert_array_equal(*found)


def test_a_machine_without_wide_registers_has_four_lanes(tmp_path, monkeypatch):
    flags = tmp_path / "cpuinfo"
    monkeypatch.setattr(lanes, "CPU", flags)
    for said, width, vectors in (
        ("flags\t\t: fpu avx2 avx512f avx512dq avx512vl\n", 8, True),
        ("flags\t\t: fpu avx2 avx512f\n", 4, True),
        ("flags\t\t: fpu avx\n", 4, False),
        ("Features\t: fp asimd\n", 4, False),
    ):
        flags.write_text(f"processor\t: 0\n{said}")
        lanes.features.cache_clear()
        assert (lanes.widest(), lanes.has_vectors()) == (width, vectors)
    flags.unlink()
    lanes.features.cache_clear()
    assert (lanes.widest(), lanes.has_vectors()) == (4, False)
    monkeypatch.undo()
    lanes.features.cache_clear()


def test_a_row_out_of_its_bounds_is_left_to_an_instance_that_says_why():
    model = MODELS["testrig"]()
    t, inputs, starts = record(model, 0, 5)
    heavy = next(v.name for v in model.of(Parameter) if v.min == 0.0 and not v.fixed)
    with Fmu(native("testrig")) as fmu:
        outputs = fmu.description.outputs[:2]
        assert fmu.simulate_rows(t, inputs, outputs, starts) is not None
        for wrong in (-1.0, np.nan):
            assert fmu.simulate_rows(t, inputs, outputs, [*starts[:4], starts[4] | {heavy: wrong}]) is None
        with pytest.raises(FmuError, match=heavy):
            fmu.simulate(t, inputs, outputs, starts[4] | {heavy: -1.0})
        spoilt = {name: np.where(t == t[7], np.nan, samples) for name, samples in inputs.items()}
        assert fmu.simulate_rows(t, spoilt, outputs, starts) is None


ORDINARY = st.floats(-30.0, 30.0) | st.sampled_from([0.0, 1.0, -1.0, 0.66, 0.625, 1e-300, 1e300, 1e5, -2e6])


def exponent_of_e(a, b):
    """Size of b ln a, to which the error of a power by its logarithm is in proportion; 0 for those of C."""
    size = abs(b * np.log(a)) if a > 0 else np.inf
    return 1.5 * size if size < 50 else 0.0


@settings(max_examples=200)
@given(st.lists(st.tuples(ORDINARY, ORDINARY), min_size=1, max_size=9))
def test_every_operation_is_that_of_the_library(operations, pairs):
    starts = [{"a": a, "b": b} for a, b in pairs]
    asked = [f"y_{code}" for code in CODES]
    found = operations.simulate_rows(np.zeros(1), {}, asked, starts)[:, 0]
    expected = np.array([operations.simulate(np.zeros(1), {}, asked, s)[0] for s in starts])
    assert_array_equal(np.isnan(found), np.isnan(expected))
    same = (found == expected) | np.isnan(expected)
    off = np.full(expected.shape, ROUNDED)
    off[:, CODES.index(cs.OP_POW)] += [exponent_of_e(a, b) for a, b in pairs]
    with np.errstate(invalid="ignore"):
        near = np.abs(found - expected) <= off * np.spacing(np.abs(expected))
    assert np.all(same | near), [CODES[j] for j in np.flatnonzero(~(same | near).all(axis=0))]


@settings(max_examples=200)
@given(st.lists(st.tuples(ORDINARY, ORDINARY), min_size=2, max_size=9))
def test_an_operation_does_not_depend_on_what_the_neighbours_of_a_row_are(operations, pairs):
    asked, now = [f"y_{code}" for code in CODES], np.zeros(1)
    starts = [{"a": a, "b": b} for a, b in pairs]
    alone = [operations.simulate_rows(now, {}, asked, [s])[0] for s in starts]
    assert_array_equal(operations.simulate_rows(now, {}, asked, starts), alone)


@by_size
def test_a_row_is_the_same_whatever_its_neighbours_are(name):
    model = MODELS[name]()
    states = names(model, State)
    with Fmu(native(name)) as fmu:
        outputs, compared = fmu.description.outputs, 0
        t, inputs, starts = record(model, 3, 4, n=4)
        wild = [{**s, n: 10.0**k * (1.0 + abs(s[n]))} for s in starts[1:] for n in states for k in (0, 2, 4)]
        alone = fmu.simulate_rows(t, inputs, outputs, starts[:1])[0]
        for other in wild:
            both = fmu.simulate_rows(t, inputs, outputs, [starts[0], other])
            if both is not None:  # a group with a row that cannot be advanced is left to instances
                compared += 1
                assert_array_equal(both[0], alone)
        assert compared > 0


LAWS = {  # one that asks the clock, one without states, one with a state: what switches it on
    "wheelset": {
        ("parameter_step", "mu0"): {"delta": -0.1},
        ("cubic_stiffness", "primary_lateral"): {"k_3": 1e11},
        ("hysteresis", "primary_lateral"): {"F_h": 300.0},
    },
    "vehicle7dof": {
        ("parameter_step", "m1"): {"delta": 1000.0},
        ("cubic_stiffness", "primary_fl"): {"k_3": 1e11},
        ("hysteresis", "primary_fl"): {"F_h": 300.0},
    },
}


@pytest.fixture(scope="module", params=LAWS)
def laws(request, tmp_path_factory):
    """A model without laws, the same with laws that may be off, and what switches each of them on."""
    folder, chosen = tmp_path_factory.mktemp("laws"), LAWS[request.param]
    model, effects = MODELS[request.param], [(EFFECTS[kind], at) for kind, at in chosen]
    bare = build_working(model(), folder / "bare.fmu", in_rows=True)
    many = build_working(model.with_switches()(effects), folder / "many.fmu", in_rows=True)
    on = [
        {EFFECTS[kind].name_at(at, name): value for name, value in given.items()}
        for (kind, at), given in chosen.items()
    ]
    with Fmu(bare) as one, Fmu(many) as other:
        yield model(), one, other, on


def test_a_row_is_the_same_whether_steps_pass_over_the_states_of_laws_or_not(laws):
    """They do where no law of a group of rows moves one."""
    model, bare, many, on = laws
    t, inputs, starts = record(model, 5, 1)
    asked, off = bare.description.outputs, dict.fromkeys((n for given in on for n in given), 0.0)
    rows = [{**starts[0], **off, **given} for given in ({}, *on)]
    alone = [many.simulate_rows(t, inputs, asked, [row])[0] for row in rows]
    assert_array_equal(many.simulate_rows(t, inputs, asked, rows), alone)
    assert_array_equal(bare.simulate_rows(t, inputs, asked, starts)[0], alone[0])
    for row, found in zip(rows, alone, strict=True):
        expected = many.simulate(t, inputs, asked, row)
        assert_allclose(found, expected, rtol=0, atol=ALONG * np.abs(expected).max())
    assert all(np.abs(found - alone[0]).max() > 0 for found in alone[1:])


def test_a_function_with_an_operation_without_lanes_has_none():
    x = cs.SX.sym("x")
    assert lanes_of([cs.Function("plain", [x], [cs.sin(x)])]) is not None
    assert lanes_of([cs.Function("erf", [x], [cs.erf(x)])]) is None
    q = cs.MX.sym("q", 2, 2)
    assert lanes_of([cs.Function("dense", [q], [q.T])]) is not None
    assert lanes_of([cs.Function("sparse", [q], [cs.densify(cs.project(q, cs.Sparsity.lower(2)).T)])]) is None


def test_a_choice_that_differs_from_row_to_row_is_made_for_each(tmp_path):
    cases = [cs.Function(f"c{i}", [q := cs.SX.sym("q")], [q**i + i]) for i in range(3)]
    chosen = cs.Function.conditional("chosen", cases[:-1], cases[-1])

    class Chosen(Model):
        name = "Chosen"
        step_size = 0.1
        z = State("1", doc="a state")
        case = Parameter("1", 0.0, doc="which one")
        y = Output("1", doc="result")

        def derivatives(m):
            return {"z": -m.z}

        def outputs(m):
            return {"y": m.call(chosen, m.case, m.z)[0]}

    with Fmu(build_working(Chosen(), tmp_path / "model.fmu")) as fmu:
        rows = [{"case": float(i), "z": 2.0 + i} for i in (0, 1, 2, 5, -1, 1, 1)]
        found = fmu.simulate_rows(np.zeros(1), {}, ["y"], rows)[:, 0, 0]
        expected = [fmu.simulate(np.zeros(1), {}, ["y"], row)[0, 0] for row in rows]
    assert_allclose(found, expected, rtol=1e-15)
    assert len(set(found)) == len({(min(r["case"], 2.0) % 3, r["z"]) for r in rows})
