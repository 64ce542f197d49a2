"""Tasks on workers: each is done once, whatever is killed, and the table has the same bytes."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from scenarios.cli.app import run_safely
from scenarios.tasks.hashes import hash_of, hash_of_file, hash_of_program
from scenarios.tasks.store import Store
from tests.helpers.paths import ROOT, SHIPPED

pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")

from psutil import net_connections

from scenarios.tasks import running
from tests.helpers.tasks import BEGUN, FINISHED, noted

PATIENCE = 300  # s, for a process of tasks on a busy machine
KEY = hash_of("a task")


def command(folder: Path, count: int, *options: object) -> list[str]:
    return [sys.executable, "-m", "tests.helpers.tasks", str(folder), str(count), *map(str, options)]


def done(folder: Path, count: int, *options: object) -> subprocess.CompletedProcess[str]:
    """Have the tasks done."""
    return subprocess.run(
        command(folder, count, *options), cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE
    )


def until(holds, patience: float = PATIENCE) -> None:
    """Wait until something holds."""
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def tables(folder: Path) -> dict[str, bytes]:
    """The bytes of all files of the results."""
    found = folder / "results"
    return {f.relative_to(found).as_posix(): f.read_bytes() for f in sorted(found.rglob("*.parquet"))}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """Twelve tasks, done without any trouble by one worker."""
    folder = tmp_path_factory.mktemp("whole")
    assert done(folder, 12).returncode == 0
    return folder


def test_a_checksum_does_not_depend_on_the_order_of_keys():
    assert hash_of({"a": 1, "b": [2.5, None]}) == hash_of({"b": [2.5, None], "a": 1})
    assert hash_of({"a": 1}) != hash_of({"a": 2})
    assert hash_of_program() == hash_of_program()


def test_a_file_is_known_by_its_bytes(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_bytes(b"1")
    other.write_bytes(b"1")
    assert hash_of_file(one) == hash_of_file(other)
    other.write_bytes(b"2")
    assert hash_of_file(one) != hash_of_file(other)


def test_a_task_is_finished_when_its_whole_file_is_there(tmp_path):
    store = Store(tmp_path)
    assert store.read(KEY) is None
    store.finish(KEY, {"verdict": "done", "x": 0.1})
    assert store.read(KEY) == {"key": KEY, "verdict": "done", "x": 0.1}
    whole = store.file(KEY).read_text()
    unknown = json.dumps({"key": KEY, "verdict": 3})
    for spoiled in ("", whole[:-5], "[]", json.dumps({"key": "another"}), unknown, "[" * 100_000):
        store.file(KEY).write_text(spoiled)
        assert store.read(KEY) is None, spoiled[:40]


def test_failed_tasks_alone_are_forgotten(tmp_path):
    store, good = Store(tmp_path), hash_of("good")
    store.finish(KEY, {"verdict": "failed"})
    store.finish(good, {"verdict": "done"})
    store.forget_failed([KEY, good, hash_of("none")])
    assert store.read(KEY) is None
    assert store.read(good) is not None


def test_a_claim_waits_for_the_one_before(tmp_path):
    """The other process has the claim until it is killed."""
    script = f"import time\nfrom scenarios.tasks.store import Store\nfrom pathlib import Path\n" \
             f"with Store(Path({str(tmp_path)!r})).claimed({KEY!r}):\n    print('claimed', flush=True)\n" \
             f"    time.sleep({PATIENCE})"  # fmt: skip
    other = subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "claimed\n"
        mine = os.fork()
        if not mine:
            with Store(tmp_path).claimed(KEY):
                os._exit(0)
        time.sleep(0.3)
        assert os.waitpid(mine, os.WNOHANG) == (0, 0)
        other.kill()
        assert os.waitstatus_to_exitcode(os.waitpid(mine, 0)[1]) == 0
    finally:
        other.kill()
        other.wait()
        if other.stdout:
            other.stdout.close()


def test_no_build_is_found_that_another_run_has_left(tmp_path, monkeypatch):
    """A build is a program: one that lies in a folder of results from elsewhere must not be run."""
    worker = SimpleNamespace(local_directory=str(tmp_path))
    monkeypatch.setattr(running, "get_worker", lambda: worker)
    store, crew = Store(tmp_path / ".tasks"), running.Crew()
    place = running._place(store, crew.builds)
    (place.builds / "model.fmu").touch()
    assert running._place(store, crew.builds) == place
    other = running._place(store, running.Crew().builds)
    assert list(other.builds.iterdir()) == []
    assert other.builds.is_relative_to(tmp_path / ".builds")


def test_finished_tasks_are_not_done_again(whole, tmp_path):
    assert sorted(noted(whole, FINISHED)) == [*range(12)]
    before = tables(whole)
    assert done(whole, 12).returncode == 0
    assert sorted(noted(whole, BEGUN)) == [*range(12)]
    assert tables(whole) == before
    assert set(before) == {"kind=even/part-0.parquet", "kind=odd/part-0.parquet"}


@pytest.mark.slow
def test_two_workers_write_the_same_bytes(whole, tmp_path):
    assert done(tmp_path, 12, "--workers", 2).returncode == 0
    assert sorted(noted(tmp_path, FINISHED)) == [*range(12)]
    assert tables(tmp_path) == tables(whole)


def test_a_killed_worker_is_replaced_and_nothing_is_lost(whole, tmp_path):
    assert done(tmp_path, 12, "--fatal", 5).returncode == 0
    assert (tmp_path / "trace" / "killed").exists()
    assert sorted(noted(tmp_path, FINISHED)) == [*range(12)]
    assert sorted(noted(tmp_path, BEGUN)) == sorted([*range(12), 5])
    assert tables(tmp_path) == tables(whole)


@pytest.mark.slow
def test_what_cannot_be_done_now_is_tried_by_the_next_run(whole, tmp_path):
    first = done(tmp_path, 12, "--passing", 3)
    assert first.returncode == 0, first.stderr
    assert "the disk of this worker is asleep" in first.stdout
    assert len(noted(tmp_path, FINISHED)) == 11
    assert done(tmp_path, 12).returncode == 0
    assert sorted(noted(tmp_path, FINISHED)) == [*range(12)]
    assert tables(tmp_path) == tables(whole)


@pytest.mark.slow
def test_the_next_run_goes_on_after_a_killed_client(whole, tmp_path):
    """Only the task that was being done is done again; the workers of the killed client end with it."""
    client = subprocess.Popen(command(tmp_path, 12, "--seconds", 0.3), cwd=ROOT)
    try:
        until(lambda: len(noted(tmp_path, FINISHED)) >= 3)
    finally:
        client.send_signal(signal.SIGKILL)
        client.wait()
    killed_at = len(noted(tmp_path, BEGUN))
    assert done(tmp_path, 12).returncode == 0
    assert len(noted(tmp_path, BEGUN)) <= 12 + 1
    assert {*noted(tmp_path, FINISHED)} == {*range(12)}
    assert killed_at < 12
    assert tables(tmp_path) == tables(whole)


@pytest.fixture
def cluster(tmp_path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes of a cluster, which end with the test."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def dask(*arguments: object) -> subprocess.Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, arguments)], cwd=ROOT, env=environment,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def scheduling(cluster: list[subprocess.Popen[bytes]], folder: Path) -> tuple[subprocess.Popen[bytes], str]:
    """A scheduler; its process and its address."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    scheduler = dask(
        "scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--scheduler-file", file
    )
    cluster.append(scheduler)
    until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
    return scheduler, json.loads(file.read_text())["address"]


def started(cluster: list[subprocess.Popen[bytes]], folder: Path) -> tuple[subprocess.Popen[bytes], str]:
    """A scheduler with a worker; its process and its address."""
    scheduler, address = scheduling(cluster, folder)
    cluster.append(
        dask("worker", address, "--nthreads", 1, "--no-dashboard", "--death-timeout", PATIENCE,
             "--local-directory", folder / f"worker-{len(cluster)}")
    )  # fmt: skip
    return scheduler, address


@pytest.mark.slow
def test_the_next_run_goes_on_after_a_killed_scheduler(whole, tmp_path, cluster):
    scheduler, address = started(cluster, tmp_path)
    client = subprocess.Popen(
        command(tmp_path, 12, "--scheduler", address, "--seconds", 0.5), cwd=ROOT, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    until(lambda: len(noted(tmp_path, FINISHED)) >= 3)
    scheduler.send_signal(signal.SIGKILL)
    _, said = client.communicate(timeout=PATIENCE)
    assert client.returncode == 2
    [line] = said.strip().splitlines()  # and no traceback of the library
    assert line.startswith(f"--scheduler {address}: was lost; what was finished is kept")
    _, address = started(cluster, tmp_path)
    again = done(tmp_path, 12, "--scheduler", address)
    assert again.returncode == 0, again.stderr
    assert len(noted(tmp_path, BEGUN)) <= 12 + 1
    assert {*noted(tmp_path, FINISHED)} == {*range(12)}
    assert tables(tmp_path) == tables(whole)


@pytest.mark.slow
def test_ctrl_c_while_a_scheduler_has_no_workers_says_how_to_go_on(tmp_path, cluster):
    _, address = scheduling(cluster, tmp_path)
    port = int(address.rpartition(":")[2])
    words = ["campaign", str(SHIPPED / "campaign" / "settling.toml"), "--scheduler", address, "--quiet"]
    process = subprocess.Popen(
        [sys.executable, "-m", "scenarios.cli", *words, "--out", str(tmp_path / "out")], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    with process:
        until(lambda: any(c.laddr.port == port and c.status == "ESTABLISHED" for c in net_connections("tcp")))
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    [line] = said.splitlines()
    assert line.startswith("railfmi: interrupted; ")
    assert line.endswith("the same command goes on from here")


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(tmp_path):
    found = done(tmp_path, 1, "--scheduler", "tcp://127.0.0.1:9")
    assert found.returncode == 2
    assert "--scheduler tcp://127.0.0.1:9: cannot be reached" in found.stderr


@pytest.mark.parametrize("name", ["fleet", "campaign"])
def test_without_the_extra_the_command_says_how_to_get_it(name, tmp_path, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    for module in [m for m in sys.modules if m.startswith(("scenarios.fleet", "scenarios.campaign"))]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "scenarios.tasks.running", raising=False)
    assert run_safely([name, str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert "pip install '.[fleet]'" in said
