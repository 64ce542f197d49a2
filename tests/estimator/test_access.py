"""Access to FMUs: what the probe finds is what plain restarts give, by every way, compiled or not."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.access.copies import Copies, Refused
from estimator.access.exchange import Exchange, continuous_states
from estimator.access.loop import PythonLoop
from estimator.access.probe import CO_SIMULATION, probe
from estimator.access.recipe import Way
from estimator.plant import LAST
from fmus.drive.model import Drive
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from tests.helpers.foreign import HIDDEN
from tests.helpers.vdp import solved

DT = 0.01
LOOPS = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "python"])
VDP = ["x0", "x1", "mu", "u"], ["x0", "x1", "x1_dot"]
VDP_START = {"x0": 2.0, "x1": 0.0, "mu": 1.5, "u": 0.2}
RIG = (
    ["omega_w", "omega_r", "theta_w", "theta_r", "mu0", "T_P"],
    ["omega_w", "omega_r", "theta_w", "theta_r", "F_x"],
)
RIG_START = {"omega_w": 12.16, "omega_r": 9.36, "theta_w": 0.0, "theta_r": 0.0, "mu0": 0.4, "T_P": 100.0}
FOREIGN = ["x", "k", "u"], ["x"]
FOREIGN_START = {"x": 1.0, "k": 2.0, "u": 0.3}
CLOCK = "self.x += dt * (self.u * math.cos(t) - self.k * self.x)"
STICKY = "self.h += 1.0\nself.x += dt * (self.u - self.k * self.x) * (1.0 + 1e-12 * self.h)"


LATE = """y = 0.0
def register_variable(self, variable, *more, **named):
    super().register_variable(variable, *more, **named)
    if variable.name == "k":
        super().register_variable(Real("y", causality=Fmi2Causality.output))
"""


def plain(path, put, get, rows, t=0.0, dt=DT, constants=None):
    """Outputs before and after a step by restarts through the host, (2, k, n_get)."""
    with Fmu(path) as fmu:
        found = []
        for row in rows:
            fmu.restart(t, **{**(constants or {}), **dict(zip(put, row.tolist(), strict=True))})
            before = fmu.read(get)
            fmu.step(dt)
            found.append((before, fmu.read(get)))
    return np.swapaxes(np.array(found), 0, 1)


def tried(path, what, start, dt=DT, t0=0.0, **more):
    with Archive(path) as archive:
        return probe(archive, *what, {}, start, t0, dt, **more)


@LOOPS
def test_the_c_fmu_refuses_states_while_it_runs_and_is_resumed_instead(vdp, compiled):
    found = tried(vdp, VDP, VDP_START, compiled=compiled)
    assert found.way in (Way.RESUME, Way.RESTART)
    assert "cannot be set now" in found.refused[Way.SET]
    assert found.late == frozenset()


@LOOPS
def test_our_own_fmu_takes_its_states_while_it_runs(built, compiled):
    found = tried(built("testrig"), RIG, RIG_START, dt=5e-3, compiled=compiled)
    assert Way.SET not in {w for w, why in found.refused.items() if "µs" not in why}
    assert found.free_time or found.way is not Way.SET
    assert 0 < found.cost < 1e-2


def test_an_fmu_that_looks_at_the_clock_is_not_resumed_from_another_time(foreign):
    path = foreign(CLOCK, canGetAndSetFMUstate=True)
    found = tried(path, FOREIGN, FOREIGN_START, t0=3.0)
    assert found.refused[Way.RESUME] == "its equations depend on the time"
    with Archive(path) as archive, Copies(archive, found.way, *FOREIGN, {}, 3.0, found.free_time) as copies:
        rows = np.array([[1.0, 2.0, 0.3], [0.5, 1.9, -0.2]])
        for t in (3.0, 3.0 + DT, 3.0 + 2 * DT):
            assert_array_equal(copies.advance(rows, t, DT), plain(path, *FOREIGN, rows, t)[1])


def test_an_fmu_that_remembers_its_steps_is_found_out(foreign):
    with pytest.raises(BadInput, match=r"has a hidden state, so it cannot be estimated; export it with all"):
        tried(foreign(HIDDEN), FOREIGN, FOREIGN_START)


def test_a_memory_below_rounding_forbids_setting_but_not_restarting(foreign):
    """Restarts agree to the bit, and a run does so within rounding: only what is set while it runs is off."""
    found = tried(foreign(STICKY), FOREIGN, FOREIGN_START)
    assert found.way is Way.RESTART
    assert "differs from that after a restart" in found.refused[Way.SET]


STEP = "self.x += dt * (self.u - self.k * self.x)\n"
SHOWS = ["x", "k", "u"], ["x", "y"]


@LOOPS
def test_an_output_that_is_computed_in_steps_is_read_after_a_short_one(foreign, compiled):
    """After a restart y is not yet that of the state; a step shows it, with the input that acts then."""
    late = foreign(f"{STEP}self.y = 3 * self.x + self.u", LATE)
    found = tried(late, SHOWS, FOREIGN_START, compiled=compiled)
    assert (found.late, found.look) == (frozenset(), LAST * DT)
    rows = np.array([[1.0, 2.0, 0.3], [0.5, 1.9, -0.2]])
    more = found.free_time, compiled, found.look
    with Archive(late) as archive, Copies(archive, found.way, *SHOWS, {}, 0.0, *more) as copies:
        for t in (0.0, DT):
            shown = copies.evaluate(rows, t)[:, 1]
            assert_allclose(shown, 3 * rows[:, 0] + rows[:, 2], rtol=5 * LAST * DT)
            assert_array_equal(copies.advance(rows, t, DT), plain(late, *SHOWS, rows, t)[1])


@pytest.mark.parametrize(
    ("step", "options"),
    [
        (f"self.y = 3 * self.x\n{STEP}", {}),  # that of the step before
        (f"{STEP}self.y = 3 * self.x", {"canHandleVariableCommunicationStepSize": "false"}),
        (f"if dt < 1e-3:\n    return False\n{STEP}self.y = 3 * self.x", {}),
    ],
    ids=["of the step before", "steps of one length", "no short steps"],
)
def test_an_output_that_lags_behind_the_state_is_named(foreign, step, options):
    found = tried(foreign(step, LATE, **options), SHOWS, FOREIGN_START)
    assert (found.late, found.look) == ({"y"}, 0.0)


def test_an_fmu_that_shows_its_outputs_at_once_makes_no_short_steps(foreign):
    assert tried(foreign(), FOREIGN, FOREIGN_START).look == 0.0


@LOOPS
@pytest.mark.parametrize("way", CO_SIMULATION)
@pytest.mark.parametrize("free", [True, False], ids=["free", "monotone"])
def test_every_way_into_our_own_fmu_gives_the_bits_of_a_restart(built, way, free, compiled):
    path, constants = built("testrig"), {"N": 7900.0}
    rng = np.random.default_rng(1)
    put, get = RIG
    rows = np.array([RIG_START[n] for n in put]) * (1 + 0.02 * rng.standard_normal((5, len(put))))
    with Archive(path) as archive, Copies(archive, way, put, get, constants, 0.0, free, compiled) as copies:
        for k in range(3):
            before, after = plain(path, put, get, rows, k * DT, DT, constants)
            assert_array_equal(copies.evaluate(rows, k * DT), before)
            assert_array_equal(copies.advance(rows, k * DT, DT), after)
            rows = rows[::-1] * 1.001


@LOOPS
def test_time_may_jump_whatever_the_way(vdp, compiled):
    rows = np.array([[2.0, 0.0, 1.5, 0.1], [1.0, 0.5, 0.7, -0.1], [-1.0, 0.5, 1.0, 0.0]])
    expected = plain(vdp, *VDP, rows)[1]
    with Archive(vdp) as archive:
        for way in (Way.RESUME, Way.RESTART):
            with Copies(archive, way, *VDP, {}, compiled=compiled) as copies:
                for t, some in product((0.0, 5.0, 1.0), (rows, rows[:1], rows[:2])):
                    assert_allclose(copies.advance(some, t, DT), expected[: len(some)], rtol=1e-12)


@settings(max_examples=15)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 3), st.floats(-1, 1))
def test_copies_of_the_c_fmu_solve_its_equation(vdp, x0, x1, mu, u):
    rows = np.array([[x0, x1, mu, u], [x1, x0, mu / 2, -u]])
    with Archive(vdp) as archive, Copies(archive, Way.RESUME, *VDP, {}) as copies:
        found = copies.advance(rows, 0.0, DT)
    for row, got in zip(rows, found, strict=True):
        expected = solved(np.array([0, DT]), [row[3]], row[2], (row[0], row[1]))[-1]
        assert_allclose(got, expected, atol=1e-9)


@LOOPS
def test_a_refusal_names_values_and_reason_and_the_copies_go_on(built, compiled):
    put, get = RIG
    good = np.array([[RIG_START[n] for n in put]])
    bad = good.copy()
    bad[0, put.index("mu0")] = -1.0
    with (
        Archive(built("testrig")) as archive,
        Copies(archive, Way.SET, put, get, {}, 0.0, True, compiled) as c,
    ):
        first = c.advance(good, 0.0, DT)
        with pytest.raises(Refused, match=r"at t = 0.01 s from .*mu0 = -1.*: .*mu0 = -1 is outside"):
            c.advance(np.vstack([good, bad]), DT, DT)
        assert_array_equal(c.advance(good, DT, DT), first)


def test_without_numba_the_loop_is_in_python(vdp, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "estimator.access.jitted", None)
    rows = np.array([[2.0, 0.0, 1.5, 0.1]])
    with Archive(vdp) as archive, Copies(archive, Way.RESTART, *VDP, {}) as copies:
        assert_array_equal(copies.advance(rows, 0.0, DT), plain(vdp, *VDP, rows)[1])
        assert isinstance(copies._loop, PythonLoop)


DRIVE = ["q", "q_dot", "M", "F"], ["q", "q_dot", "q_ddot"]
DRIVE_START = {"q": 0.1, "q_dot": 0.2, "M": 90.0, "F": 30.0}


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2", "FMI 3"])
def native(request, tmp_path_factory):
    """The drive as a native FMU, for co-simulation and model exchange."""
    build = pytest.importorskip("fmus.export.builders.native.build", reason="native FMUs are not built here")
    return build.build_native(Drive(), tmp_path_factory.mktemp("native"), fmi=request.param)


def test_model_exchange_makes_the_same_steps(native):
    rows = np.array([list(DRIVE_START.values()), [0.0, -0.3, 60.0, -10.0], list(DRIVE_START.values())])
    with Archive(native) as archive:
        with Copies(archive, Way.RESTART, *DRIVE, {"F_v": 120.0}) as copies:
            expected = copies.evaluate(rows, 0.0), copies.advance(rows, 0.0, DT)
        exchange = Exchange(archive, *DRIVE, {"F_v": 120.0}, parts=10)
        found = exchange.evaluate(rows, 0.0), exchange.advance(rows, 0.0, DT)
        F, H = exchange.jacobians(rows[0], 0.0, DT)
        exchange.close()
    assert_allclose(found[0], expected[0], rtol=1e-14)
    assert_allclose(found[1], expected[1], rtol=1e-12)
    assert_array_equal(found[1][0], found[1][2])
    decay = np.exp(-120.0 / 90.0 * DT)
    assert_allclose(F, [[1.0, (1 - decay) * 90.0 / 120.0], [0.0, decay]], rtol=1e-12, atol=1e-15)
    assert_allclose(H, [[1, 0], [0, 1], [0, -120.0 / 90.0]], rtol=1e-14)


def test_model_exchange_is_used_where_co_simulation_shows_no_way(native, monkeypatch):
    def refused(*_):
        raise BadInput("no way")

    monkeypatch.setattr("estimator.access.probe._by_co_simulation", refused)
    found = tried(native, DRIVE, DRIVE_START)
    assert (found.way, set(found.refused)) == (Way.EXCHANGE, set(CO_SIMULATION))
    assert found.parts in (2, 4, 8)
    with pytest.raises(BadInput, match="no way"):  # and its own reason where there is neither
        tried(native, (["q", "M", "F"], ["q"]), DRIVE_START)


def test_an_fmu_without_model_exchange(vdp):
    with Archive(vdp) as archive:
        assert continuous_states(archive) == ()
        with pytest.raises(BadInput, match="is not for model exchange"):
            Exchange(archive, *VDP, {})
