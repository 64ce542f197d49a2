"""What the master is made of: signals, connections, feedthrough, clock, recordings; and what it refuses."""

import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import describe
from fmus.host.fmu import Fmu
from fmus.host.master.clock import Clock
from fmus.host.master.connections import Connection, Directory, link
from fmus.host.master.feedthrough import direct_inputs
from fmus.host.master.master import Master
from fmus.host.master.recording import Recording, read_recording
from fmus.host.master.signals import signal
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers import READERS
from scenarios.experiment.record import load_record
from tests.helpers.coupled_models import (
    COUPLED,
    START,
    STATES,
    Mass,
    Sprung,
)
from tests.helpers.packed import with_description
from tests.helpers.paths import ROOT

T = np.linspace(0, 3, 31)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")
    return {"a": build_python(Sprung(), folder), "b": build_python(Mass(), folder)}


@pytest.fixture(scope="module")
def descriptions(parts):
    return {name: describe(path) for name, path in parts.items()}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2", 2 + 0 * T),
        ("-t**2 + 3*t % 2", -(T**2) + 3 * T % 2),
        ("852 if t < 1.5 else -852", np.where(T < 1.5, 852, -852)),
        ("(1 < t <= 2) - (not t > 0.5)", 1.0 * ((T > 1) & (T <= 2)) - (T <= 0.5)),
        ("1 if t > 2 or t < 1 and t > 0 else 0", 1.0 * ((T > 2) | ((T < 1) & (T > 0)))),
        ("max(0, sin(2 * pi * t)) + step(t - 1)", np.maximum(0, np.sin(2 * np.pi * T)) + (T >= 1)),
        ("where(t > 1, sqrt(t - 1), 0)", np.sqrt(np.maximum(T - 1, 0))),
        ("exp(-t) * cos(t) / e + abs(floor(-t))", np.exp(-T) * np.cos(T) / np.e + np.abs(np.floor(-T))),
    ],
)
def test_expressions(text, expected):
    assert_allclose(signal("b.F", text).at(T), expected, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("__import__('os').getcwd()", r"'__import__\('os'\)\.getcwd\(\)' may not stand"),
        ("t.real", "'t.real' may not stand"),
        ("[x for x in t]", "may not stand"),
        ("(lambda: 1)()", "may not stand"),
        ("'a' + t", "''a'' may not stand"),
        ("True", "'True' may not stand"),
        ("sin(t, out=t)", "may not stand"),
        ("exec(t)", "function 'exec' is not known"),
        ("sinn(t)", "did you mean 'sin'"),
        ("tt", "'tt' is not known"),
        ("max(t)", "'max' takes 2 arguments, not 1"),
        ("3 +", "no expression in t"),
        ("", "no expression in t"),
        ("t" * 1001, "1001 characters"),
        ("(" * 400 + "t" + ")" * 400, "no expression in t"),
        ("1" + "0" * 400, "no expression in t"),
        (np.nan, "is nan"),
        (True, "give a number"),
        (None, "give a number"),
        (([0, 1], [1]), r"times \(2,\) and values \(1,\)"),
        (([0, 1, 1], [1, 2, 3]), "times that increase"),
        (([0, 1], [1, np.nan]), "finite"),
        (([0, 1], [1, "x"]), "no number"),
    ],
)
def test_sources_that_are_none(source, words):
    with pytest.raises(BadInput, match=rf"^input 'b\.F': .*{words}"):
        signal("b.F", source)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("1 / (t - 1)", r"is inf at t = 1 s"),
        ("9 ** 9 ** 9 * t", "is nan at t = 0 s"),
        ("sqrt(1 - t)", "is nan at"),
        (lambda t: t[:-1], r"gives shape \(30,\) for 31 times"),
    ],
)
def test_values_that_are_none(source, words):
    with pytest.raises(BadInput, match=rf"^input 'b\.F': {words}"):
        signal("b.F", source).at(T)


def connected(descriptions, out="m", into="m", **options):
    """The link from b.x to a.x_other with units of one's choice."""
    changed = {}
    for name, variable, unit in (("b", "x", out), ("a", "x_other", into)):
        d = descriptions[name]
        v = dataclasses.replace(d.variables[variable], unit=unit)
        changed[name] = dataclasses.replace(d, variables={**d.variables, variable: v})
    return link(Connection("b.x", "a.x_other", **options), Directory(changed))


@pytest.mark.parametrize(
    ("out", "into", "options", "gain", "offset"),
    [
        ("m", "m", {}, 1, 0),
        ("mm", "m", {}, 1e-3, 0),
        ("km/h", "m/s", {"gain": -1.0, "offset": 2.0}, -1 / 3.6, 2),
        ("degC", "K", {}, 1, 273.15),
        ("degC", "K", {"gain": 2.0, "offset": 1.0}, 2, 547.3),
        ("mm", "N", {"gain": 5.0, "gain_unit": "kN/m"}, 5.0, 0),
        ("rpm", "rad/s", {}, 2 * np.pi / 60, 0),
        (None, "N", {"gain": 3.0}, 3, 0),
        ("m", None, {}, 1, 0),
        ("ticks", "ticks", {}, 1, 0),
    ],
)
def test_units_of_a_connection(descriptions, out, into, options, gain, offset):
    made = connected(descriptions, out, into, **options)
    assert_allclose([made.gain, made.offset], [gain, offset], rtol=1e-12)


@pytest.mark.parametrize(
    ("out", "into", "options", "words"),
    [
        (
            "m",
            "N",
            {},
            "unit 'm' of the output does not fit unit 'N' of the input; connect quantities of one",
        ),
        ("m", "N", {"gain_unit": "N.s/m"}, "unit 'm' of the output times the gain's 'N.s/m' does not fit"),
        ("Hz", "rad/s", {}, "unit 'Hz' of the output does not fit unit 'rad/s'"),
        ("ticks", "m", {}, "unit 'ticks' of the output does not fit unit 'm'"),
    ],
)
def test_units_that_do_not_fit(descriptions, out, into, options, words):
    with pytest.raises(BadInput, match=rf"^connection 'b\.x' -> 'a\.x_other': {words}"):
        connected(descriptions, out, into, **options)


def test_what_an_output_depends_on(descriptions, vdp, tmp_path):
    d = descriptions["a"]
    assert direct_inputs(d, "x") == ()  # a state
    assert direct_inputs(d, "k") == ()
    assert direct_inputs(d, "F") == ("x_other", "v_other")  # as stated
    nothing = dataclasses.replace(d, dependencies={})
    assert direct_inputs(nothing, "F") == ("x_other", "v_other", "F_ext")
    assert direct_inputs(nothing, "x") == ()
    assert direct_inputs(d, "F_ext") == ("F_ext",)
    stated = dataclasses.replace(d, dependencies={"F": ("x_other",), "x": ("F_ext",)})
    assert direct_inputs(stated, "F") == ("x_other",)
    assert direct_inputs(stated, "x") == ("F_ext",)
    assert describe(vdp).dependencies == {}
    told = b'<Output valueReference="1" dependencies=""/><Output valueReference="3" dependencies="1 5"/>'
    path = with_description(vdp, tmp_path / "x.fmu", rb'<Output valueReference="[13]"/>', b"")
    path = with_description(path, tmp_path / "y.fmu", b"<ModelStructure>", b"<ModelStructure>" + told)
    assert describe(path).dependencies == {"x0": (), "x1_dot": ("u",)}


@st.composite
def clocks(draw):
    """A clock of up to three members, a duration and event times, some of them off its grid."""
    multiples = [1, *draw(st.lists(st.integers(1, 6), max_size=2))]
    step = draw(st.sampled_from([1e-3, 0.1, 1 / 3, 0.25]))
    whole = draw(st.integers(1, 40)) * step
    duration = whole + draw(st.sampled_from([0.0, 0.3 * step]))
    times = st.one_of(st.integers(0, 40).map(lambda k: k * step), st.floats(0, duration))
    events = [(t, {}) for t in draw(st.lists(times, max_size=3)) if t <= duration]
    names = [f"m{i}" for i in range(len(multiples))]
    return Clock(names, step, multiples, [True] * len(names), draw(st.integers(1, 5))), duration, events


@given(clocks())
def test_everyone_covers_all_of_the_time(given):
    clock, duration, events = given
    plan = clock.plan(duration, events)
    assert plan.times[0] == 0
    assert plan.times[-1] == pytest.approx(duration, rel=1e-12)
    assert (np.diff(plan.times) > 0).all()
    for i, multiple in enumerate(clock.multiples):
        own = [
            (t, dt)
            for t, who, dts in zip(plan.times, plan.due, plan.steps, strict=False)
            for j, dt in zip(who, dts, strict=True)
            if j == i
        ]
        starts, steps = np.array(own).T
        assert starts[0] == 0
        assert_allclose(starts + steps, [*starts[1:], plan.times[-1]], atol=1e-9 * clock.step)
        assert (steps <= multiple * clock.step * (1 + 1e-12)).all()
        for t, _ in events:
            assert np.abs(np.array([*starts, plan.times[-1]]) - t).min() < 1e-8 * clock.step
    rows = np.array(plan.times)[plan.recorded]
    assert_allclose(rows, np.arange(len(rows)) * clock.record_every * clock.step, atol=1e-12)
    assert len(rows) == np.floor(plan.times[-1] / clock.step / clock.record_every + 1e-6) + 1


def test_times_are_the_nearest_numbers_to_their_decimals():
    plan = Clock(["m"], 0.001, [1], [False], 1).plan(3.0, [])
    assert plan.times == [float(f"{k / 1000:.3f}") for k in range(3001)]
    assert set(plan.steps) == {(0.001,)}


@pytest.fixture(scope="module")
def recorded(parts):
    with Master(parts, COUPLED, step=0.01, initial=START, record=[*STATES, "a.F", "b.fixed"]) as master:
        return master.run(2.0)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_recording_comes_back_from_its_file(recorded, tmp_path, kind):
    path = getattr(recorded, f"to_{kind}")(tmp_path / f"run.{kind}")
    back = read_recording(path)
    assert back.data.equals(recorded.data)
    assert back.units == recorded.units
    assert back.units == {
        "time": "s",
        "a.x": "m",
        "a.v": "m/s",
        "b.x": "m",
        "b.v": "m/s",
        "a.F": "N",
        "b.fixed": "1",
    }
    again = getattr(recorded, f"to_{kind}")(tmp_path / f"again.{kind}")
    assert path.read_bytes() == again.read_bytes()


def test_a_recording_without_units_or_rows(tmp_path):
    data = pd.DataFrame({"time": [], "p.y": []}, dtype=float)
    for kind in ("csv", "parquet"):
        path = getattr(Recording(data, {"time": "s", "p.y": None}), f"to_{kind}")(tmp_path / f"x.{kind}")
        back = read_recording(path)
        assert back.units == {"time": "s", "p.y": None}
        assert back.data.shape == (0, 2)
    (tmp_path / "x.csv.units.json").unlink()
    assert read_recording(tmp_path / "x.csv").units == {"time": None, "p.y": None}
    for name, words in (("none.csv", "no such recording"), ("x.csv", None), ("x.dat", "neither .csv nor")):
        (tmp_path / "x.dat").touch()
        if words:
            with pytest.raises(BadInput, match=words):
                read_recording(tmp_path / name)


EXPERIMENT = """
id = "simulated"
fmu = "{fmu}"
data = "{data}"
time = "time"
[split]
identify = [0.0, 1.2]
test = [1.2, 2.0]
[inputs]
F = "a.F"
[outputs.x]
column = "b.x"
unit = "m"
"""


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_recording_is_data_of_an_experiment(recorded, parts, tmp_path, kind):
    if f".{kind}" not in READERS:
        pytest.skip(f"experiments do not read .{kind} yet")
    data = getattr(recorded, f"to_{kind}")(tmp_path / f"run.{kind}")
    (tmp_path / "experiment.toml").write_text(EXPERIMENT.format(fmu=parts["b"], data=data.name))
    [run] = load_record(load_experiment(tmp_path / "experiment.toml"), describe(parts["b"])).runs
    assert_array_equal(run.t, recorded.data["time"])
    assert_allclose(run.y[:, 0], recorded.data["b.x"], rtol=1e-15)


def refusal(parts, duration=1.0, connections=COUPLED, step=0.01, **options):
    """Make and run."""
    with Master(options.pop("fmus", parts), connections, step=step, **options) as master:
        master.run(duration)


C = Connection
REFUSED = {
    "no FMU": ({"fmus": {}}, "no FMU given"),
    "dot": ({"fmus": {"a.b": "x.fmu"}}, "FMU name 'a.b'"),
    "no file": ({"fmus": {"a": "none.fmu"}}, "none.fmu: no such FMU file"),
    "unknown FMU": (
        {"connections": [("aa.F", "b.F")]},
        "connection 'aa.F' -> 'b.F': there is no FMU 'aa'; did you mean 'a'",
    ),
    "unknown output": ({"connections": [("a.G", "b.F")]}, "FMU 'a' (Sprung) has no variable 'G'"),
    "unknown input": (
        {"connections": [("a.F", "b.FF")]},
        "FMU 'b' (Mass) has no variable 'FF'; did you mean 'F'",
    ),
    "twice": ({"connections": [("a.F", "b.F"), ("a.F", "b.F")]}, "input 'b.F' is connected twice"),
    "output as target": ({"connections": [("a.x", "b.x")]}, "'b.x' is no input but of causality 'output'"),
    "input as source": (
        {"connections": [("a.F_ext", "b.F")]},
        "'a.F_ext' is no output but of causality 'input'",
    ),
    "units": (
        {"connections": [("b.v", "a.x_other")]},
        "unit 'm/s' of the output does not fit unit 'm' of the input",
    ),
    "loop": (
        {"connections": [C("a.F", "a.x_other", gain_unit="m/N")]},
        "algebraic loop a.F -> a.x_other -> a.F: each follows the one before at once",
    ),
    "input unknown": (
        {"inputs": {"a.F_exd": 1.0}},
        "input 'a.F_exd': FMU 'a' (Sprung) has no variable 'F_exd'; did",
    ),
    "input connected": ({"inputs": {"b.F": 1.0}}, "input 'b.F': is connected to 'a.F' too"),
    "input a state": ({"inputs": {"b.x": 1.0}}, "'b.x' is no input but of causality 'output'"),
    "short table": (
        {"inputs": {"a.F_ext": ([0, 0.5], [1, 1])}},
        "runs from 0 to 0.5 s, the run from 0 to 1 s",
    ),
    "nan function": ({"inputs": {"a.F_ext": lambda t: t * np.nan}}, "input 'a.F_ext': is nan at t = 0 s"),
    "parameter unknown": (
        {"parameters": {"a.kk": 1.0}},
        "parameter 'a.kk': FMU 'a' (Sprung) has no variable",
    ),
    "parameter a state": ({"parameters": {"a.x": 1.0}}, "'a.x' is no parameter but of causality 'output'"),
    "parameter low": ({"parameters": {"a.m": -1.0}}, "parameter 'a.m': -1 is outside 0.001 to inf"),
    "event low": ({"events": [(0.5, {"a.m": 0.0})]}, "event at t = 0.5 s: 'a.m': 0 is outside 0.001 to inf"),
    "parameter text": ({"parameters": {"a.k": "1"}}, "parameter 'a.k': '1' is no finite number; give one"),
    "parameter nan": ({"parameters": {"a.k": np.nan}}, "parameter 'a.k': nan is no finite number"),
    "initial": ({"initial": {"a.F": 1.0}}, "initial 'a.F': is no state; those of 'a' are x, v"),
    "event late": ({"events": [(1.5, {"a.k": 1.0})]}, "the event at t = 1.5 s comes after the end at 1 s"),
    "event early": ({"events": [(-1.0, {"a.k": 1.0})]}, "event at t = -1 s: the run begins at 0"),
    "event fixed": (
        {"events": [(0.5, {"b.fixed": 1.0})]},
        "'b.fixed' is a fixed parameter, not a tunable one",
    ),
    "event input": ({"events": [(0.5, {"b.F": 1.0})]}, "'b.F' is no parameter but of causality 'input'"),
    "record": ({"record": ["a.y"]}, "record: FMU 'a' (Sprung) has no variable 'y'"),
    "duration": ({"duration": 0.0}, "a run of 0 s has no length"),
    "endless": ({"duration": np.inf}, "a run of inf s has no length"),
    "step": ({"step": 0.0}, "step of 'a': 0 s is no step; give a positive one"),
    "steps": ({"steps": {"a": 0.025}}, "step of 'a': 0.025 s is no multiple of the shortest step, 0.01 s"),
    "steps of none": ({"steps": {"c": 0.02}}, "step of 'c': there is no FMU of that name"),
    "record_step": ({"record_step": 0.015}, "record_step: 0.015 s is no multiple of the shortest step"),
    "order": ({"order": "newton"}, "order 'newton' with extrapolation 'hold' is not known"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(parts, case):
    options, words = REFUSED[case]
    with pytest.raises(BadInput, match=re.escape(words)) as refused:
        refusal(parts, **options)
    assert "\n" not in str(refused.value)


def test_a_loop_is_named_all_the_way(parts, tmp_path):
    unstated = with_description(parts["a"], tmp_path / "unstated.fmu", rb' dependencies="[^"]*"', b"")
    fmus = {"a": parts["a"], "b": unstated, "c": parts["b"]}
    links = [
        C("c.x", "a.v_other", gain_unit="1/s"),
        C("a.F", "b.x_other", gain_unit="m/N"),
        C("b.F", "a.x_other", gain_unit="m/N"),
    ]
    words = "algebraic loop a.F -> b.x_other -> b.F -> a.x_other -> a.F (b: assumed, as the FMU"
    with pytest.raises(BadInput, match=re.escape(words)):
        Master(fmus, links, step=0.01)


def test_an_fmu_with_steps_of_one_length(parts, tmp_path):
    """Where a time does not lie on its steps it is refused; where it does, all is well."""
    rigid = with_description(
        parts["b"],
        tmp_path / "rigid.fmu",
        b'canHandleVariableCommunicationStepSize="true"',
        b'canHandleVariableCommunicationStepSize="false"',
    )
    with Master({"b": rigid}, step=0.1, events=[(0.3, {"b.k": 1.0})]) as master:
        master.run(1.0)
        with pytest.raises(BadInput, match=r"^t = 0\.95 s .* is no whole number of steps of 'b', 0\.1 s"):
            master.run(0.95)
    with (
        Master({"b": rigid}, step=0.1, events=[(0.25, {"b.k": 1.0})]) as master,
        pytest.raises(BadInput, match=r"^t = 0\.25 s"),
    ):
        master.run(1.0)


def test_what_cannot_be_twice(parts, vdp, tmp_path):
    single = with_description(
        vdp,
        tmp_path / "single.fmu",
        b"<CoSimulation ",
        b'<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" ',
    )
    with pytest.raises(BadInput, match="FMU 'q': is in use under another name"):
        Master({"p": single, "q": single}, step=0.1)
    with Fmu(parts["b"]) as fmu, pytest.raises(BadInput, match="FMU 'q': is in use under another name"):
        Master({"p": fmu, "q": fmu}, step=0.1)


def test_the_example_of_the_documentation_runs(tmp_path, monkeypatch, capsys):
    """The controller holds the wheel's speed, also after the rail got wet, by more creep."""
    page = (ROOT / "docs" / "master.md").read_text(encoding="utf-8")
    [code] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "example"}
    exec(compile(code, "master.md", "exec"), names)
    data = names["result"].data.set_index("time")
    assert_allclose(data["rig.omega_w"][[3.9, 5.9, 10.0]], [12.15, 11.8, 11.8], rtol=2e-3)
    assert abs(data["rig.xi_x"][10.0]) > 1.5 * abs(data["rig.xi_x"][5.9])
    assert read_recording("run.parquet").data.equals(read_recording("run.csv").data)
    assert "times real time" in capsys.readouterr().out
