"""Equations as text: CasADi of every kind and Python alone compute what CasADi's own functions do."""

import subprocess
import sys
import textwrap
from array import array
from functools import cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from fmus.export.builders.portable import BINARY, CALLED, UNARY, equations_files, portable
from fmus.export.container.coupled import build_coupled
from fmus.export.runtime import symbolic
from fmus.export.runtime.equations import Equations
from fmus.model import equations
from fmus.models import MODELS
from fmus.variables import Parameter
from tests.helpers.everything import near_start, values
from tests.helpers.runs import names
from tests.helpers.sizes import by_size

CODES = sorted({*UNARY, *BINARY, *CALLED} - {cs.OP_ASSIGN, cs.OP_CONSTPOW})
TWO = {cs.OP_POW, cs.OP_ATAN2, cs.OP_HYPOT, cs.OP_FMOD, cs.OP_DIV, cs.OP_COPYSIGN, cs.OP_FMIN, cs.OP_FMAX} | {
    *BINARY, cs.OP_LT, cs.OP_LE, cs.OP_EQ, cs.OP_NE, cs.OP_AND, cs.OP_OR, cs.OP_IF_ELSE_ZERO,
}  # fmt: skip
KINDS = ("scalars", "matrices", "python")


def evaluated(text, kind):
    """A text as the three kinds of installation evaluate it: new CasADi, old CasADi, none."""
    with pytest.MonkeyPatch.context() as patch:
        if kind == "matrices":  # as before CasADi 3.8, where scalars cannot call functions
            called = symbolic.Helper.__call__

            def only_from_matrices(helper, x):
                if not any(isinstance(v, cs.MX) for v in x):
                    raise symbolic.NoCalls
                return called(helper, x)

            patch.setattr(symbolic.Helper, "__call__", only_from_matrices)
        if kind == "python":
            patch.setitem(sys.modules, "fmus.export.runtime.symbolic", None)
        found = Equations(text.decode())
    assert ("plain Python" in found.note) == (kind == "python")
    return found


def results(made, name, arguments):
    """All results of a function, one after the other."""
    given = [array("d", a) for a in arguments]
    found = [array("d", bytes(8 * n)) for n in made.sizes(name)[1]]
    made.on_memory(name, given, found)()
    return np.concatenate([np.array(f) for f in found])


@cache
def of_model(name, kind):
    made = equations(MODELS[name]())
    return evaluated(portable({"step": made.step, "outputs": made.h}), kind)


@pytest.mark.parametrize("kind", KINDS)
@by_size
def test_every_model_computes_the_same_numbers_from_its_text(name, kind):
    model = MODELS[name]()
    made, text, rng = equations(model), of_model(name, kind), np.random.default_rng(4)
    for k in range(6):
        x, u, p = near_start(model, rng)
        if "creep_law" in names(model, Parameter):
            p[names(model, Parameter).index("creep_law")] = k % 5  # each of its cases once
        assert_array_equal(results(text, "outputs", (x, u, p)), values(made.h, x, u, p))
        expected = [r.full().ravel() for r in made.step(x, u, p, model.step_size)]
        assert_array_equal(results(text, "step", (x, u, p, [model.step_size])), np.concatenate(expected))


def one(code):
    a, b = cs.SX.sym("a"), cs.SX.sym("b")
    return cs.SX.binary(code, a, b) if code in TWO else cs.SX.unary(code, a), a, b


@cache
def every_operation():
    a, b = cs.SX.sym("a"), cs.SX.sym("b")
    single = [cs.Function("one", [q, r], [e])(a, b) for e, q, r in map(one, CODES)]
    return cs.Function("all", [a, b], [cs.vertcat(*single)])


@cache
def operations(kind):
    return evaluated(portable({"all": every_operation()}), kind)


EDGES = st.floats(allow_subnormal=False) | st.floats(-30.0, 30.0) | st.sampled_from(
    [0.0, -0.0, 1.0, -1.0, 2.0, -3.0, 0.5, 1e300, -1e300, 1e-300, 710.0, np.inf, -np.inf, np.nan]
)  # fmt: skip


@pytest.mark.parametrize("kind", ["scalars", "python"])
@settings(max_examples=300)
@given(EDGES, EDGES)
def test_every_operation_is_casadis_also_where_pythons_own_would_raise(kind, a, b):
    found, expected = results(operations(kind), "all", ([a], [b])), values(every_operation(), a, b)
    with np.errstate(all="ignore"):  # the length of a hypotenuse is rounded otherwise in Python
        near = np.abs(found - expected) <= (np.spacing(np.abs(expected)) if kind == "python" else 0.0)
    same = near | (found == expected) | (np.isnan(found) & np.isnan(expected))
    assert same.all(), [(CODES[i], found[i], expected[i]) for i in np.flatnonzero(~same)]


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_gives_nothing_beyond_its_ends_and_a_choice_its_last_case(kind):
    at = cs.MX.sym("at")
    table = cs.Function("table", [at], [cs.MX(cs.DM([1.0, 2.0, 4.0, 8.0]).reshape((2, 2)))[:, at]])
    cases = [cs.Function(f"c{i}", [q := cs.SX.sym("q")], [q + i]) for i in range(3)]
    chosen = cs.Function.conditional("chosen", cases[:-1], cases[-1]).wrap()
    made = evaluated(portable({"table": table, "chosen": chosen}), kind)
    for place in (0.0, 1.0, 2.0, -1.0, np.nan, 1e9):
        assert_array_equal(results(made, "table", ([place],)), values(table, place))
    for case in (0.0, 0.9, 1.0, 2.0, 7.0, -0.5, -1.0):
        assert_array_equal(results(made, "chosen", ([case], [10.0])), values(chosen, case, 10.0))


def test_an_operation_without_text_is_serialised_and_only_an_older_casadi_cannot_read_it(tmp_path):
    x = cs.SX.sym("x", 2)
    f = cs.Function("f", [x], [cs.erf(x)])
    with pytest.raises(NotImplementedError, match="cannot be written"):
        portable({"f": f})
    for name, data in equations_files({"f": f}).items():
        (tmp_path / name).write_bytes(data)
    made = Equations.of(tmp_path)
    assert made.note == ""
    assert_array_equal(results(made, "f", ([0.3, -1.0],)), values(f, [0.3, -1.0]))
    (tmp_path / "f.casadi").write_text("jtenpfopljahod")  # as a version of later years might write
    with pytest.raises(RuntimeError, match="newer package casadi than"):
        Equations.of(tmp_path)


WITHOUT = """
    import sys
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
    path, missing = sys.argv[1:]
    d = read_model_description(path)
    args = dict(guid=d.guid, modelIdentifier=d.coSimulation.modelIdentifier, unzipDirectory=extract(path))
    fmu = FMU2Slave(instanceName="one", **args)
    sys.modules[missing] = None  # for what the FMU imports from here on
    fmu.instantiate(loggingOn=True)
    for _ in range(2):
        fmu.setupExperiment()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        for k in range(5):
            fmu.doStep(k * 1e-3, 1e-3)
        print("STATES", fmu.getReal(list(range(4))))
        fmu.reset()
    """


def run_without(fmu, missing):
    command = [sys.executable, "-c", textwrap.dedent(WITHOUT), str(fmu), missing]
    return subprocess.run(command, capture_output=True, text=True)


def states(done):
    return [line for line in done.stdout.splitlines() if line.startswith("STATES")]


def test_an_fmu_runs_without_casadi_and_says_once_that_it_is_slower(built):
    slow, fast = (run_without(built("testrig"), missing) for missing in ("casadi", "nothing_at_all"))
    assert slow.returncode == fast.returncode == 0
    assert states(slow) == states(fast)
    assert len(states(slow)) == 2
    assert slow.stdout.count("plain Python") == 1
    assert "plain Python" not in fast.stdout


def test_an_fmu_whose_package_is_missing_says_so_in_the_log(built, tmp_path):
    fmu = build_coupled(built("testrig"), (), (), tmp_path, name="Carrying")
    done = run_without(fmu, "fmpy")
    assert done.returncode != 0
    assert "Carrying needs the Python package fmpy: run 'pip install fmpy'" in done.stdout
