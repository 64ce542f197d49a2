"""What close-loop hands over: the FMU with the effects found, in two forms that agree, with its origin."""

import json
import zipfile
from hashlib import sha3_256, sha256
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Unknown
from estimator.record import Record, Run
from fmus.errors import BadInput
from fmus.export.around.effects_alone import EffectsAlone
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.coupled import COUPLING_STEP
from fmus.export.provenance import altered, provenance
from fmus.host.archive import describe, problems
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from fmus.host.master.recording import read_recording
from fmus.models import MODELS
from scenarios.closing.closing import augment
from scenarios.exchange import import_ssp
from scenarios.exchange.augmented import coupling_step
from scenarios.simulating import run
from tests.helpers.baselines import fit_with
from tests.scenarios.test_ssp import installed, told

PORT = PortNames("carriage", "F_ext", "q_dot", "q")
DT, END = 0.01, 4.0
FOUND = {  # effects with values: drag with a lag of the drive, a law with a memory, a law of time
    "drag_and_lag": {
        "quadratic_damping_carriage_c": 300.0,
        "actuator_lag_F_share": 1.0,
        "actuator_lag_F_T": 0.05,
    },
    "hysteresis": {
        "hysteresis_carriage_F_h": 40.0,
        "hysteresis_carriage_q_y": 0.01,
        "hysteresis_carriage_beta": 0.5,
        "hysteresis_carriage_n": 1.0,
    },
    "step_and_load": {
        "step_force_carriage_F_0": 60.0,
        "step_force_carriage_t0": 1.7,
        "parameter_offset_M_delta": 20.0,
    },
}
EFFECTS = {
    "drag_and_lag": (("quadratic_damping", "carriage"), ("actuator_lag", "F")),
    "hysteresis": (("hysteresis", "carriage"),),
    "step_and_load": (("step_force", "carriage"), ("parameter_offset", "M")),
}
NEAR = {
    "drag_and_lag": 3e-4,  # the package's drag is by the velocity at the beginning of a step
    "hysteresis": 2e-3,
    "step_and_load": 2e-4,
}  # of the largest, see docs/exchange.md


def a_record():
    t = 3.0 + DT * np.arange(int(END / DT) + 1)  # a record's own clock
    u = np.column_stack([100 * np.sin(3 * (t - 3)) + 40])
    y = np.zeros((t.size, 1))
    return Record((Run(t, u, y, t < 5, t >= 5, t >= 5),), ("F",), ("q",), np.array([1e-3]))


def found(effects, values, verdict="traced"):
    """An outcome with these estimates, the first one without a standard error."""
    unknowns = tuple(Unknown(n, v, -1e9, 1e9, 1.0) for n, v in values.items())
    covariance = np.diag([np.nan, *(0.01 for _ in unknowns[1:])])
    fit = fit_with(
        unknowns, np.array(list(values.values())), covariance, np.zeros(1), np.zeros((1, len(unknowns)))
    )
    candidates = tuple(Candidate(kind, at, ()) for kind, at in effects)
    best = Hypothesis(candidates, fit, ())
    return SimpleNamespace(built_in=best, base=best, judgement=SimpleNamespace(verdict=verdict))


def experiment(folder):
    data = folder / "data.csv"
    data.write_text("time,F,q\n0,0,0\n")
    return SimpleNamespace(id="pull", every_file=(data,))


def handed_over(builder, folder, effects, values, told=lambda _: None):
    folder.mkdir(exist_ok=True)
    problem = SimpleNamespace(declared={"M": 97.0, "q": 0.1}, record=a_record(), coupling=COUPLING_STEP)
    return augment(builder, experiment(folder), problem, found(effects, values), folder, told)


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """Stands for an FMU of another hand."""
    return build_python(MODELS["drive"](), tmp_path_factory.mktemp("base") / "Sledge.fmu")


@pytest.fixture(scope="module", params=EFFECTS)
def foreign(request, base, tmp_path_factory):
    """Name of the case, the container and the package."""
    builder = ForeignBuilder(base, (PORT,), tmp_path_factory.mktemp("work"))
    out = tmp_path_factory.mktemp("out")
    return request.param, handed_over(builder, out, EFFECTS[request.param], FOUND[request.param])


@pytest.mark.slow
def test_a_package_of_base_and_effects_runs_as_the_container_does(foreign, base, tmp_path):
    name, (container, package) = foreign
    assert (container.name, package.name) == ("Sledge_augmented.fmu", "Sledge_augmented.ssp")
    back = import_ssp(package, tmp_path / "back")
    result = run(back, tmp_path / "out")
    assert result.ok
    record = a_record()
    t, u = record.runs[0].t, record.runs[0].u[:, 0]
    with Fmu(container) as fmu:
        expected = fmu.simulate(t, {"F": (u[1:] + u[:-1]) / 2}, ["q", "q_dot"], {})
    run_ = read_recording(tmp_path / "out" / "run.parquet").data
    rows = run_[["base.q", "base.q_dot"]].to_numpy()[:: round(DT / COUPLING_STEP)]
    assert rows.shape == expected.shape
    assert (np.abs(rows - expected).max(axis=0) <= NEAR[name] * np.abs(expected).max(axis=0)).all()
    with Fmu(base) as fmu:
        off = fmu.simulate(t, {"F": (u[1:] + u[:-1]) / 2}, ["q", "q_dot"], {"M": 97.0, "q": 0.1})
    assert (np.abs(off - expected).max(axis=0) > 10 * NEAR[name] * np.abs(expected).max(axis=0)).all()


@pytest.mark.slow
def test_another_tool_runs_the_package(tmp_path):
    """ecos hands on outputs a step late where they follow inputs at once; the package is made for that."""
    installed("ecospy", "tbb")
    base = build_native(MODELS["drive"](), tmp_path / "Sledge.fmu")  # needs no Python in a tool without
    builder, name = ForeignBuilder(base, (PORT,), tmp_path / "work"), "drag_and_lag"
    _, package = handed_over(builder, tmp_path / "out", EFFECTS[name], FOUND[name])
    assert run(import_ssp(package, tmp_path / "back"), tmp_path / "run").ok
    ours = read_recording(tmp_path / "run" / "run.parquet").data[["base.q", "base.q_dot"]].to_numpy()
    found = told("ssp_ecos.py", package, COUPLING_STEP, round(END / COUPLING_STEP), "base.q", "base.q_dot")
    assert (np.abs(found - ours).max(axis=0) <= 1e-3 * np.abs(ours).max(axis=0)).all()


def test_both_say_where_their_values_come_from(foreign):
    name, (container, package) = foreign
    assert problems(container) == []
    assert altered(container) == []
    about = provenance(container)
    kinds = [(e["kind"], e["location"]) for e in about["effects"]]
    assert tuple(kinds) == EFFECTS[name]
    with zipfile.ZipFile(package) as packed:
        inside = json.loads(packed.read("extra/org.railfmi/provenance.json"))["fmus"]["resources/effects.fmu"]
        assert inside["origin"] == about["origin"]
        (base,) = (n for n in packed.namelist() if n == "resources/base.fmu")
        assert sha256(packed.read(base)).hexdigest() == about["base"]["sha256"]
    origin = about["origin"]
    assert (origin["experiment"], origin["verdict"]) == ("pull", "traced")
    assert {n: v for n, (v, _) in origin["estimates"].items()} == FOUND[name]
    errors = [e for _, e in origin["estimates"].values()]
    assert errors == [None, *[pytest.approx(0.1)] * (len(errors) - 1)]
    data = container.parent / "data.csv"
    assert origin["data"] == {"data.csv": sha256(data.read_bytes()).hexdigest()}
    with zipfile.ZipFile(container) as packed:
        page = packed.read("documentation/index.html").decode()
    for word in ("pull", "not known", about["base"]["sha256"], "Sledge.fmu", *FOUND[name]):
        assert word in page


def test_the_package_carries_its_credibility_as_traceable_meta_data(foreign):
    """By SSP Traceability 1.0: a file on the whole, and one beside the FMU with its checksum."""
    name, (container, package) = foreign
    origin = provenance(container)["origin"]
    with zipfile.ZipFile(package) as packed:
        files = {n: packed.read(n) for n in packed.namelist()}
    (whole,) = (data for n, data in files.items() if n.endswith("traceability.srmd/resourceMetaData.srmd"))
    whole, beside = (ElementTree.fromstring(data) for data in (whole, files["resources/effects.srmd"]))
    common = "{http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon}"
    assert whole.tag == "{http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData}" + (
        "SimulationResourceMetaData"
    )
    assert (whole.get("version"), whole.get("data")) == ("1.0.0", None)
    assert beside.get("data") == "effects.fmu"
    assert beside.get("checksum") == sha3_256(files["resources/effects.fmu"]).hexdigest()
    for root in (whole, beside):
        (classification,) = root
        assert (classification.tag, classification.get("type")) == (
            f"{common}Classification", "org.railfmi.credibility"
        )  # fmt: skip
        said = [(e.get("keyword"), e.text) for e in classification]
        values = dict(said)
        assert (values["experiment"], values["verdict"]) == ("pull", "traced")
        assert [v for k, v in said if k == "effect"] == [f"{k} at {at}" for k, at in EFFECTS[name]]
        assert values["data.data.csv.sha256"] == origin["data"]["data.csv"]
        for n, (value, error) in origin["estimates"].items():
            assert float(values[f"estimate.{n}"]) == value
            low, high = map(float, values.get(f"estimate.{n}.interval_95", "nan nan").split())
            if error is None:
                assert f"estimate.{n}.standard_error" not in values
            else:
                assert (low, high) == pytest.approx((value - 1.96 * error, value + 1.96 * error), rel=1e-4)


def test_one_of_our_models_comes_as_two_builds_that_agree(tmp_path):
    effects, values = EFFECTS["drag_and_lag"][:1], {"quadratic_damping_carriage_c": 300.0, "M": 96.0}
    files = handed_over(ModelBuilder("drive", tmp_path / "work"), tmp_path / "out", effects, values)
    assert [f.name for f in files] == ["Drive_augmented.fmu", "Drive_augmented_native.fmu"]
    runs = []
    for file, kind in zip(files, ("python", "native"), strict=True):
        about = provenance(file)
        assert (about["kind"], about["origin"]["experiment"]) == (kind, "pull")
        assert about["origin"]["estimates"]["M"] == [96.0, pytest.approx(0.1)]
        assert about["parameters"]["M"]["value"] == 96.0
        with Fmu(file) as fmu:
            runs.append(fmu.simulate(a_record().runs[0].t, {"F": np.full(400, 80.0)}, ["q", "q_dot"], {}))
    assert_allclose(runs[1], runs[0], rtol=1e-9)


def test_without_a_connection_there_is_the_container_alone_and_a_word_why(base, tmp_path):
    told: list[str] = []
    builder = ForeignBuilder(base, (PORT,), tmp_path / "work")
    values = {"parameter_step_M_delta": 20.0, "parameter_step_M_t0": 1.0}
    files = handed_over(builder, tmp_path / "out", (("parameter_step", "M"),), values, told.append)
    assert [f.name for f in files] == ["Sledge_augmented.fmu"]
    assert "'M' changes while running" in told[-1]


def test_without_an_effect_there_is_nothing_to_couple(base, tmp_path):
    builder = ForeignBuilder(base, (PORT,), tmp_path / "work")
    files = handed_over(builder, tmp_path / "out", (), {"M": 99.0})
    assert [f.name for f in files] == ["Sledge_augmented.fmu"]


def alone(base, effects, values, **more):
    return EffectsAlone(describe(base), (PORT,), effects, values, **more)


@pytest.fixture(scope="module")
def spring(base, tmp_path_factory):
    model = alone(base, (("cubic_stiffness", "carriage"),), {"cubic_stiffness_carriage_k_3": 50.0})
    return build_native(model, tmp_path_factory.mktemp("spring"))


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-100, 100))
@settings(max_examples=30)
def test_the_effects_alone_add_their_force_half_a_step_ahead(spring, q, v, F):
    with Fmu(spring) as fmu:
        fmu.restart(q=q, q_dot=v, F_ext_in=F)
        assert_allclose(fmu["F_ext"], F - 50.0 * (q + COUPLING_STEP / 2 * v) ** 3, rtol=1e-12, atol=1e-12)
        fmu.step(0.3)
        assert fmu["clock"] == pytest.approx(0.3)


def test_what_an_effect_reads_and_sets_is_said(base):
    plugs = alone(base, EFFECTS["drag_and_lag"], {}).plugs
    assert (plugs.motion, plugs.shared) == (("q_dot",), ())
    assert plugs.through == {"F": "F_in", "F_ext": "F_ext_in"}
    constant = alone(base, (("parameter_offset", "M"),), {"M": 97.0, "parameter_offset_M_delta": 20.0}).plugs
    assert (constant.through, constant.constant) == ({}, {"M": 117.0})
    with pytest.raises(BadInput, match="no connection leads to a parameter"):
        alone(base, (("parameter_drift", "M"),), {})


@given(st.floats(1e-5, 2.0))
def test_the_coupling_step_divides_the_sampling_step(dt):
    step = coupling_step(dt * np.arange(5), COUPLING_STEP)
    assert step <= COUPLING_STEP * (1 + 1e-9)
    assert dt / step == pytest.approx(round(dt / step), rel=1e-8)


def test_a_long_record_is_cut_and_the_package_stays_small(base, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.exchange.augmented.MOST", 400)
    builder = ForeignBuilder(base, (PORT,), tmp_path / "work")
    _, package = handed_over(builder, tmp_path / "out", EFFECTS["drag_and_lag"], FOUND["drag_and_lag"])
    text = Path(import_ssp(package, tmp_path / "back")).read_text(encoding="utf-8")
    assert "duration = 0.2" in text
