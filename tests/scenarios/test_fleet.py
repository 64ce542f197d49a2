"""Fleets: the table of records, the tasks, rows and pooling, clear errors, and a whole run."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from fmus import limits
from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED
from scenarios.fleet.declaration import Declaration
from scenarios.fleet.records import NEEDED, read_records, with_record
from tests.helpers.paths import ROOT
from tests.truth.rig import write_record
from tests.truth.rig_effects import Effects, Torque

pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")

import psutil

from scenarios.fleet import work
from scenarios.fleet.fleet import Assembled, assembled, rejected, write_tables
from scenarios.fleet.page import write_page
from scenarios.fleet.planning import Plan, plan_of
from scenarios.fleet.pooling import pooled
from scenarios.fleet.result import effect_words
from scenarios.fleet.tables import effect_row
from scenarios.fleet.work import answered
from scenarios.tasks.running import Passing, Place
from scenarios.tasks.store import Answer, Store

SHIPPED = ROOT / "scenarios" / "shipped" / "fleet"
SETUP = (SHIPPED / "setup.toml").read_text(encoding="utf-8")
FLEET = """
id = "made"
records = "records.csv"

[setups.rig]
experiment = "setup.toml"
commands = ["check", "estimate", "close-loop"]
triage = true
"""
HEAD = "record,vehicle,class,place,mileage,data"
VEHICLES = 6


def written(folder: Path, fleet: str = FLEET, table: str | None = None) -> Path:
    """A fleet of VEHICLES with four records each, whose data are a line of text."""
    lines = [HEAD]
    for v in range(VEHICLES):
        for k in range(4):
            (folder / f"{v}{k}.csv").write_text(f"{v} {k}\n")
            lines.append(f"r{v}{k},v{v},tram,depot,{1000 * k + 10 * v},{v}{k}.csv")
    (folder / "records.csv").write_text("\n".join(lines) + "\n" if table is None else table)
    (folder / "setup.toml").write_text(SETUP)
    (folder / "fleet.toml").write_text(fleet)
    return folder / "fleet.toml"


def declared(**more) -> Declaration:
    return Declaration.model_validate(
        {"id": "x", "records": "records.csv", "setups": {"rig": {"experiment": "x"}}, **more}
    )


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "cannot be read as a table"),
        ("record,vehicle\n", "column 'data' is missing"),
        (HEAD + "\n", "holds no records"),
        (HEAD + ",milage\n", "column 'milage' is not known; did you mean 'mileage'?"),
        (HEAD + "\na,v,,,,1.csv\na,v,,,,2.csv\n", "row 3: record 'a' occurs twice"),
        (HEAD + "\na,,,,,1.csv\n", "row 2: column 'vehicle' is empty"),
        (HEAD + "\na,v,,,far,1.csv\n", "row 2: column 'mileage' holds 'far', not a number"),
        (HEAD + ",setup\na,v,,,,1.csv,fast\n", "row 2: there is no setup 'fast'"),
        (HEAD + ",parameters.mu0\na,v,,,,1.csv,low\n", "row 2: column 'parameters.mu0' holds 'low'"),
    ],
)
def test_what_is_wrong_in_the_table_of_records_is_one_line(table, said, tmp_path):
    file = tmp_path / "records.csv"
    file.write_text(table)
    with pytest.raises(BadInput) as caught:
        read_records(declared(), file)
    assert said in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_record_declares_values_of_its_own_and_keeps_the_zeros_of_a_name(tmp_path):
    file = tmp_path / "records.csv"
    file.write_text("record,vehicle,data,parameters.N,note\n007,01,x.csv,7900,wet\n008,02,y.csv,,dry\n")
    one, other = read_records(declared(ignore=("note",)), file)
    assert (one.id, one.vehicle, one.data, one.mileage) == ("007", "01", tmp_path / "x.csv", None)
    base = {"parameters": {"N": 8000.0, "a": 1.0}, "data": {"file": "z.csv", "sep": ";"}}
    made = with_record(base, one)
    assert made["parameters"] == {"N": 7900.0, "a": 1.0}
    assert made["data"] == {"file": str(tmp_path / "x.csv"), "sep": ";"}
    assert with_record(base, other)["parameters"] == base["parameters"]
    assert base["parameters"]["N"] == 8000.0


def test_a_table_in_parquet_says_the_same(tmp_path):
    import pandas as pd

    pd.DataFrame(
        {"record": ["a", "b"], "vehicle": ["v", "w"], "data": ["1", "2"], "mileage": [1.5, None]}
    ).to_parquet(tmp_path / "records.parquet")
    found = read_records(declared(), tmp_path / "records.parquet")
    assert [(r.id, r.mileage) for r in found] == [("a", 1.5), ("b", None)]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("triage = true", "triage = true\nmodels = ['new']", "there is no model 'new'"),
        ('"estimate", ', "", "'triage' needs both commands"),
        ('experiment = "setup.toml"', 'experiment = "none.toml"', "none.toml: cannot be read"),
        ('"check"', '"chekc"', "must be one of check, estimate, close-loop"),
        ('id = "made"', 'id = "made"\nlevel = 2.0', "level"),
        ('id = "made"', 'id = "made"\nrecord = "x"', "key 'record' is not known"),
    ],
)
def test_what_is_wrong_in_the_fleet_file_is_one_line(old, new, said, tmp_path):
    assert old in FLEET
    with pytest.raises(BadInput) as caught:
        plan_of(written(tmp_path, FLEET.replace(old, new)), ISOLATED)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_experiment_without_an_estimate_cannot_be_estimated(tmp_path):
    file = written(tmp_path)
    (tmp_path / "setup.toml").write_text(SETUP[: SETUP.index("[estimate]")])
    with pytest.raises(BadInput, match=r"setup\.toml: has no \[estimate\]"):
        plan_of(file, ISOLATED)


def test_a_file_with_a_clock_of_its_own_belongs_to_no_fleet(tmp_path):
    file = written(tmp_path)
    (tmp_path / "setup.toml").write_text(SETUP + '\n[files.tacho]\nfile = "tacho.csv"\ntime = "t"\n')
    with pytest.raises(BadInput, match=r"\[files\.tacho\] names a file, but a fleet's records have one each"):
        plan_of(file, ISOLATED)


def keys(plan: Plan) -> list[str]:
    return [j.task.key if j.task else "" for j in plan.jobs]


def test_a_task_is_known_by_model_record_and_setup(tmp_path):
    file = written(tmp_path)
    first = plan_of(file, ISOLATED)
    assert len(first.jobs) == 1 + 2 * 4 * VEHICLES
    assert len({*keys(first)}) == len(first.jobs)
    (tmp_path / "records.csv").write_text((tmp_path / "records.csv").read_text().replace("depot", "line"))
    assert keys(plan_of(file, ISOLATED)) == keys(first), "where a record was taken changes no answer"
    (tmp_path / "00.csv").write_text("other data\n")
    changed = [a != b for a, b in zip(keys(first), keys(plan_of(file, ISOLATED)), strict=True)]
    assert sum(changed) == 2
    (tmp_path / "setup.toml").write_text(SETUP.replace("mu0 = 0.4\n", "mu0 = 0.41\n"))
    assert not {*keys(plan_of(file, ISOLATED))[1:]} & {*keys(first)[1:]}


def test_units_beside_a_record_are_part_of_its_task(tmp_path):
    """Else the answer in the old units would be taken over when only they are corrected."""
    file, place = written(tmp_path), Place(tmp_path / "builds", tmp_path / "shipped")
    units = tmp_path / "00.csv.units.json"
    without = keys(plan_of(file, ISOLATED))
    found = [without]
    for text in ('{"omega_w": "rpm"}', '{"omega_w": "rad/s"}'):
        units.write_text(text)
        plan = plan_of(file, ISOLATED)
        for before in found:
            assert sum(a != b for a, b in zip(keys(plan), before, strict=True)) == 2, "those of this record"
        found.append(keys(plan))
    planned = next(j.task for j in plan.jobs if j.record and j.record.data.name == "00.csv")
    units.write_text('{"omega_w": "rpm"}')
    with pytest.raises(Passing, match=r"00\.csv: has changed since the fleet was planned"):
        answered(planned.given, place)
    units.unlink()
    assert keys(plan_of(file, ISOLATED)) == without


def test_a_record_without_data_is_a_row_with_the_reason(tmp_path):
    file = written(tmp_path)
    (tmp_path / "00.csv").unlink()
    plan = plan_of(file, ISOLATED)
    found = assembled(plan, Store(tmp_path / "none"), {}, 1.0)
    assert [row["record"] for row in found.rows] == ["r00", "r00"][: len(found.rows)]
    assert all("00.csv: cannot be read" in row["reason"] for row in found.rows)


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_a_record_that_is_no_file_is_not_waited_for(kind, tmp_path):
    file = written(tmp_path)
    data = tmp_path / "00.csv"
    data.unlink()
    {"pipe": os.mkfifo, "device": lambda d: d.symlink_to("/dev/zero"), "folder": os.mkdir}[kind](data)
    reasons = [j.reason for j in plan_of(file, ISOLATED).jobs if j.record and j.record.data == data]
    assert reasons
    assert all(r == reasons[0] and r.startswith("00.csv: cannot be read (is a folder, ") for r in reasons)


def test_a_table_of_records_that_would_fill_the_memory_is_not_read(tmp_path, monkeypatch):
    import pandas as pd

    monkeypatch.setattr(limits, "RECORD", 1e-6)
    pd.DataFrame({name: ["a"] * 1000 for name in NEEDED}).to_parquet(tmp_path / "records.parquet")
    with pytest.raises(BadInput, match=r"^\S+records\.parquet: holds 2.4e-05 GB, more than 1e-06 GB"):
        read_records(declared(), tmp_path / "records.parquet")


def test_a_broken_record_is_an_answer_with_the_reason_and_changed_data_none(tmp_path):
    """Without a worker: what it would do with a file that is no record."""
    plan = plan_of(written(tmp_path), ISOLATED)
    place = Place(tmp_path / "builds", tmp_path / "shipped")
    job = next(j for j in plan.jobs if j.command == "close-loop")
    assert job.task is not None
    answer = answered(job.task.given, place)
    assert answer["verdict"] == "failed"
    [row] = answer["rows"]
    assert "00.csv" in row["reason"]
    assert str(place.builds) not in row["reason"]
    with pytest.raises(Passing, match="has changed since"):
        answered({**job.task.given, "data_sha256": "0" * 64}, place)


def test_a_full_disk_is_no_answer_about_the_fmu(tmp_path, monkeypatch):
    """Else the next run would take it over when there is room again."""

    def full(given, place):
        raise BadInput(f"x.fmu: cannot be unpacked ({os.strerror(errno.ENOSPC)}); free space")

    monkeypatch.setattr(work, "_check", full)
    with pytest.raises(BadInput, match="No space left"):
        answered({"command": "check"}, Place(tmp_path / "builds", tmp_path / "shipped"))


def estimate(value: float, verdict: str = "consistent") -> Answer:
    row = {
        "kind": "parameter",
        "location": "mu0",
        "parameter": "mu0",
        "size": value,
        "std": 0.01,
        "unit": "1",
    }
    return {"verdict": verdict, "rows": [{**row, "verdict": verdict, "reason": ""}]}


def loop(verdict: str, size: float | None, visible: float | None) -> Answer:
    """An answer of close-loop: drag at the roller of that size, or none; visible: the size it would show."""
    named = {
        "kind": "viscous_damping",
        "location": "roller",
        "parameter": "c",
        "std": 0.02,
        "unit": "N.m.s/rad",
    }
    row = {"verdict": verdict, **({} if size is None else {**named, "size": size})}
    line = {"kind": "viscous_damping", "location": "roller", "parameter": "c", "largest": visible}
    return {"verdict": verdict, "rows": [row], "visible": [line]}


@pytest.fixture
def answered_fleet(tmp_path) -> tuple[Plan, Store]:
    return six_vehicles(tmp_path)


def six_vehicles(folder: Path) -> tuple[Plan, Store]:
    """Six vehicles: v0 drifts, v1 has drag, v2 and v3 would show it, v4 would not, v5 is not decided."""
    plan, store = plan_of(written(folder), ISOLATED), Store(folder / "store")
    for job in plan.jobs:
        assert job.task is not None
        if job.record is None:
            answer = {"verdict": "passed", "rows": [{"kind": "restart", "verdict": "passed", "reason": ""}]}
        elif job.command == "estimate":
            v, miles = job.record.vehicle, job.record.mileage or 0.0
            answer = estimate(0.4 + (1e-4 * miles if v == "v0" else 0.0), "inconsistent")
        else:
            answer = {
                "v1": loop("traced", 0.5, 0.1), "v4": loop("no_discrepancy", None, 2.0),
                "v5": loop("ambiguous", 0.5, 0.1),
            }.get(job.record.vehicle, loop("no_discrepancy", None, 0.1))  # fmt: skip
        store.finish(job.task.key, answer)
    return plan, store


def test_an_effect_of_one_vehicle_is_tested_on_the_others(answered_fleet):
    plan, store = answered_fleet
    answers = {j.task.key: store.read(j.task.key) or {} for j in plan.jobs if j.task}
    [found] = pooled(plan, answers)
    assert (found.kind, found.location, found.parameter) == ("viscous_damping", "roller", "c")
    assert (found.shown, found.possible) == (["v1"], ["v5"])
    assert (found.absent, found.blind) == (["v0", "v2", "v3"], ["v4"])
    assert found.share == 0.25
    assert found.share_low < 0.25 < found.share_high
    assert found.size.value == pytest.approx(0.5)
    assert found.size.std == pytest.approx(0.01)


def test_vehicles_that_a_triage_left_out_take_the_share_away(answered_fleet):
    """Those that were traced are no sample of the class."""
    plan, store = answered_fleet
    answers = {j.task.key: store.read(j.task.key) or {} for j in plan.jobs if j.task}
    loops = [j for j in plan.jobs if j.command == "close-loop" and j.record]
    for job in loops:
        if job.record.vehicle in ("v2", "v3"):
            del answers[job.task.key]
    [left] = pooled(replace(plan, jobs=[replace(j, triaged=False) for j in plan.jobs]), answers)
    assert (left.untraced, left.absent, left.share) == (["v2", "v3"], ["v0"], 0.5)
    [found] = pooled(replace(plan, jobs=[replace(j, triaged=True) for j in loops]), answers)
    assert (found.untraced, found.share, found.share_low) == (["v2", "v3"], None, None)
    words = effect_words(effect_row(found))
    assert "not traced in 2" in words
    assert "%" not in words


def test_a_discrepancy_that_nothing_explains_denies_no_effect(answered_fleet):
    plan, store = answered_fleet
    answers = {j.task.key: store.read(j.task.key) or {} for j in plan.jobs if j.task}
    for job in plan.jobs:
        if job.command == "close-loop" and job.record and job.record.vehicle == "v2":
            answers[job.task.key] = loop("unexplained", None, 0.1)
    [found] = pooled(plan, answers)
    assert (found.absent, found.blind) == (["v0", "v3"], ["v2", "v4"])


def test_an_effect_of_either_sign_is_as_large_as_its_magnitude(answered_fleet):
    plan, store = answered_fleet
    answers = {j.task.key: store.read(j.task.key) or {} for j in plan.jobs if j.task}
    for job in plan.jobs:
        if job.command == "close-loop" and job.record and job.record.vehicle == "v2":
            answers[job.task.key] = loop("traced", -0.5, 0.1)
    [found] = pooled(plan, answers)
    assert (found.shown, found.absent) == (["v1", "v2"], ["v0", "v3"])
    assert found.size.value == pytest.approx(0.0, abs=1e-9)


def test_an_estimate_that_has_no_sample_has_no_value_of_the_record():
    """The filter stopped at the first one; nothing is estimated, while the prior is known."""
    after = {"deviation_left": {"mu0": 1.0}, "correlation": [[1.0]], "alike": []}
    nothing = SimpleNamespace(estimated={}, identifiability={"after": after}, diverged=True)
    assert work._own(nothing) == {}


def test_triage_traces_only_what_the_estimate_rejects(answered_fleet):
    plan, store = answered_fleet
    first = next(j for j in plan.jobs if j.command == "estimate" and j.record and j.record.id == "r00")
    assert first.task is not None
    assert len(rejected(plan, store)) == 4 * VEHICLES
    store.finish(first.task.key, estimate(0.4))
    assert len(rejected(plan, store)) == 4 * VEHICLES - 1
    assert assembled(plan, store, {}, 1.0).result.tasks["triaged out"] == 1


@pytest.fixture
def found(answered_fleet) -> Assembled:
    plan, store = answered_fleet
    return assembled(plan, store, {}, 1.0)


def test_the_tables_name_each_value_and_what_it_follows_from(found, tmp_path):
    for name in ("one", "two"):
        write_tables(tmp_path / name, found)
    files = sorted((tmp_path / "one").rglob("*.parquet"))
    assert len(files) == 3 + 3
    for file in files:
        assert file.read_bytes() == (tmp_path / "two" / file.relative_to(tmp_path / "one")).read_bytes()
    table = ds.dataset(tmp_path / "one" / "results", partitioning="hive").to_table().to_pandas()
    assert len(table) == len(found.rows)
    assert {"check", "estimate", "close-loop"} == {*table["command"]}
    rows = table[table["command"] == "estimate"]
    assert (
        (rows[["model_sha256", "record_sha256", "setup_sha256", "program_sha256", "task"]].map(len) == 64)
        .to_numpy()
        .all()
    )
    assert not any("seconds" in name for name in table.columns)
    drifts = pq.read_table(tmp_path / "one" / "drifts.parquet").to_pandas()
    assert drifts.loc[drifts["drifts"], "vehicle"].tolist() == ["v0"]


def test_the_result_and_the_page_say_who_drifts(found, tmp_path):
    assert found.result.headline.startswith("made: 24 records of 6 vehicles; 1 vehicle with a parameter")
    [line] = [x for x in found.result.lines() if "drifts by" in x]
    assert "v0 at depot: mu0" in line
    assert len(found.result.to_frame()) == 1
    write_page(tmp_path, found)
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert "http://" not in page
    assert "https://" not in page
    for figure in ("map", "courses", "distributions"):
        assert (tmp_path / f"{figure}.png").exists()
    assert "viscous damping at roller" in page


def test_a_task_without_an_answer_is_left_with_the_reason(answered_fleet):
    plan, store = answered_fleet
    job = plan.jobs[1]
    assert job.task is not None
    store.file(job.task.key).unlink()
    found = assembled(plan, store, {job.task.key: "memory ran out"}, 1.0)
    assert found.result.tasks["left"] == 1
    assert not found.result.complete
    assert [f["reason"] for f in found.result.failed] == ["memory ran out"]


@pytest.mark.slow
def test_what_a_worker_does_with_a_record_that_shows_an_effect(tmp_path):
    """Drag at the roller is traced, in rows with unit, error and probability; the model is checked."""
    made = write_record(
        tmp_path, "drag", np.random.default_rng(1), duration=20.0, dt=0.02, parameters_true={"mu0": 0.37},
        effects=Effects(roller=Torque(quadratic=0.3)),
    )  # fmt: skip
    table = f"{HEAD}\ndrag,v,,,,{made.parent / 'data.csv'}\n"
    file = written(tmp_path, FLEET.replace('"estimate", ', "").replace("triage = true\n", ""), table)
    (tmp_path / "setup.toml").write_text(made.read_text())
    plan, store = plan_of(file, ISOLATED), Store(tmp_path / "store")
    place = Place(tmp_path / "builds", tmp_path / "shipped")
    place.builds.mkdir()
    for job in plan.jobs:
        assert job.task is not None
        store.finish(job.task.key, answered(job.task.given, place))
    found = assembled(plan, store, {}, 1.0)
    write_tables(tmp_path / "out", found)
    rows = [r for r in found.rows if r["command"] == "close-loop"]
    [drag] = [r for r in rows if r["kind"] == "quadratic_damping"]
    assert (drag["verdict"], drag["location"], drag["parameter"]) == ("traced", "roller", "c")
    assert drag["low_95"] < 0.3 < drag["high_95"]
    assert drag["size"] == pytest.approx(0.3, abs=0.01)
    assert drag["probability"] > 0.5
    assert drag["unit"] == "N.m.s2/rad2"
    [mu0] = [r for r in rows if r["kind"] == "calibrated"]
    assert mu0["low_95"] < 0.37 < mu0["high_95"]
    [effect] = found.effects
    assert (effect.parameter, effect.shown, effect.share) == ("c", ["v"], 1.0)
    assert {r["verdict"] for r in found.rows if r["command"] == "check"} <= {"passed", "not offered"}


@pytest.mark.slow
def test_the_shipped_fleet_from_its_file_to_its_page(tmp_path):
    """As commands, since the workers' event loop outlives a test."""
    found = []
    for n in (1, 2):
        out = tmp_path / f"{n}"
        run = [sys.executable, "-m", "railfmi", "fleet", str(SHIPPED / "fleet.toml"), "--out", str(out), "-q"]
        subprocess.run([*run, "--workers", f"{n}"], cwd=ROOT, check=True, capture_output=True)
        found.append(json.loads((out / "result.json").read_text()))
    files = [f.relative_to(tmp_path / "1") for f in (tmp_path / "1").rglob("*.parquet")]
    assert len(files) == 4
    for file in files:
        assert (tmp_path / "1" / file).read_bytes() == (tmp_path / "2" / file).read_bytes()
    first, again = found
    assert first["tasks"] == again["tasks"]
    assert [d["vehicle"] for d in first["drifts"]] == ["rig-004"]
    assert [f["record"] for f in first["failed"]] == ["rig-001-bench-a-02"]


@pytest.mark.slow
def test_an_interrupt_says_how_to_go_on_and_leaves_no_process(tmp_path):
    out = tmp_path / "out"
    run = [sys.executable, "-m", "railfmi", "fleet", str(SHIPPED / "fleet.toml"), "--out", str(out)]
    started = subprocess.Popen([*run, "--workers", "1"], cwd=ROOT, stderr=subprocess.PIPE, text=True)
    family: list[psutil.Process] = []
    while started.poll() is None and len([*out.glob(".tasks/*/*.json")]) < 2:
        family = psutil.Process(started.pid).children(recursive=True)
        time.sleep(0.1)
    started.send_signal(signal.SIGINT)
    _, said = started.communicate(timeout=60)
    assert started.returncode == 130
    assert said.strip().endswith("interrupted; finished tasks are kept; the same command goes on from here")
    assert not any(p.is_running() and p.status() != psutil.STATUS_ZOMBIE for p in family)
    assert not (out / "result.json").exists()
