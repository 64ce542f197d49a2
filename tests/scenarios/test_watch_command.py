"""The command watch: its page, its end by a signal, and one line for each wrong input."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from scenarios.cli.app import run_safely
from scenarios.watching.checkpoint import FILE, Counts
from scenarios.watching.health import Height, Status, health, metrics, page
from scenarios.watching.policy import POLICY
from scenarios.watching.serving import HOST, Serving
from scenarios.watching.tracing import Answer, answer_of
from tests.helpers.paths import SHIPPED
from tests.helpers.streams import record, write_experiment, write_watch, write_windows

EXAMPLE = SHIPPED / "watch"
PATIENCE = 240  # s, for a busy machine
SAMPLE = re.compile(r'^railfmi_watch_\w+(\{\w+="(?:[^"\\\n]|\\.)*"\})? (?:NaN|[+-]?Inf|[-+.\de]+)$')

STATUS = Status(
    "rig", Counts(
        windows=12, tested=9, learning=2, past=1, samples=900, seconds=9.0, alarms=1, nis=1.9, freedom=2.0
    ), 9.0, 1.0, True, 0.01, (Height("bias of omega_w", 0.7, 2.0), Height("NIS", 0.1, -0.3)),
    (("mu0", 0.4, 0.01),), ('at t = 8 s: <b>something</b> "odd"',), (Answer("000001", "traced"),), 3.0,
    40.0, 0, 1000.0,
)  # fmt: skip


def test_the_metrics_have_the_form_that_prometheus_reads():
    lines = metrics(STATUS, 1001.0).splitlines()
    samples = [line for line in lines if not line.startswith("#")]
    assert all(SAMPLE.match(line) for line in samples), samples
    for kind in ("HELP", "TYPE"):
        told = [line.split()[2] for line in lines if line.startswith(f"# {kind}")]
        assert len(told) == len(set(told))
        assert {line.partition("{")[0].split()[0] for line in samples} <= set(told)
    assert 'railfmi_watch_windows_total{state="tested"} 9.0' in lines
    assert "railfmi_watch_rejects 1.0" in lines
    assert 'railfmi_watch_estimate{name="mu0"} 0.4' in lines


def test_labels_are_escaped():
    odd = replace(STATUS, heights=(Height('a "b"\\\n', float("inf"), 0.0),))
    assert 'railfmi_watch_height{statistic="a \\"b\\"\\\\\\n"} Inf' in metrics(odd, 0.0)


def test_health_says_when_nothing_comes_and_when_the_clock_goes_back():
    assert health(STATUS, 1001.0)[0] == 200
    code, text = health(STATUS, 1001.0 + POLICY.stale)
    assert code == 503
    assert "no window has come" in json.loads(text)["reason"]
    code, text = health(replace(STATUS, backward=POLICY.backward), 1001.0)
    assert code == 503
    assert "--anew" in json.loads(text)["reason"]
    assert health(Status("rig"), 5.0)[0] == 200  # nothing was to come yet


def test_the_page_escapes_what_it_is_told():
    told = page(STATUS, 1001.0)
    assert "<b>something</b>" not in told
    assert "The model does not describe the stream" in told
    assert re.search(r"0\.400?.±.0\.010?", told)
    assert "At t = 8 s: &lt;b&gt;" in told
    assert "src=" not in told  # it loads no other file


def test_the_server_answers_on_this_machine_alone():
    serving = Serving(replace(STATUS, seen=time.time()))
    with serving.at(0):
        base = f"http://{HOST}:{serving.port}"
        for path, kind in (("/", "text/html"), ("/metrics", "text/plain"), ("/health", "application/json")):
            with urllib.request.urlopen(base + path, timeout=10) as answer:
                assert answer.headers["Content-Type"].startswith(kind)
                assert answer.read()
        with pytest.raises(urllib.error.HTTPError, match="404") as refused:
            urllib.request.urlopen(f"{base}/etc/passwd", timeout=10)
        refused.value.close()
        serving.status = replace(serving.status, experiment="another")
        with urllib.request.urlopen(base, timeout=10) as answer:
            assert b"another" in answer.read()
    assert HOST == "127.0.0.1"


def test_an_event_says_what_close_loop_found(tmp_path):
    assert answer_of(tmp_path).verdict == "not looked into yet"
    (tmp_path / "close-loop").mkdir()
    found = {"verdict": "traced", "effects": [{"kind": "parameter_step", "location": "mu0"}]}
    (tmp_path / "close-loop" / "result.json").write_text(json.dumps(found))
    assert answer_of(tmp_path).sentence.endswith("traced (parameter_step at mu0)")
    (tmp_path / "failed").write_text("2")
    assert answer_of(tmp_path).verdict == "failed"


@pytest.fixture
def stream(tmp_path):
    """A folder of a stream of 3 s."""
    write_experiment(tmp_path, record(51, 4.0))
    write_windows(tmp_path / "windows", record(52, 3.0), range(0, 300, 100))
    write_watch(tmp_path)
    return tmp_path


def edited(file: str, old: str, new: str):
    def spoil(folder: Path) -> None:
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new))

    return spoil


def foreign_checkpoint(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / FILE).write_bytes(b"PK no checkpoint")


WRONG = {
    "no watch.toml": (lambda f: (f / "watch.toml").unlink(), ["watch.toml", "cannot be read"]),
    "unknown key": (edited("watch.toml", "settle", "setle"), ["setle", "did you mean 'settle'?"]),
    "no folder": (lambda f: shutil.rmtree(f / "windows"), ["windows", "no such folder"]),
    "two sources": (
        edited("watch.toml", "[test]", '[stream.mqtt]\nhost = "h"\ntopic = "t"\n[test]'),
        ["exactly one of the keys 'folder' and 'mqtt'"],
    ),
    "rate of nothing": (
        edited("watch.toml", "false_alarms_per_hour = 0.1", "false_alarms_per_hour = 0.0"),
        ["false_alarms_per_hour"],
    ),
    "unknown trigger": (
        edited("watch.toml", "[trace]", '[[trigger]]\nkind = "speed"\n[trace]'),
        ["kind", "band, fence, steady"],
    ),
    "trigger without limits": (
        edited("watch.toml", "[trace]", '[[trigger]]\nkind = "band"\ncolumn = "v"\n[trace]'),
        ["'low' or 'high'"],
    ),
    "no experiment": (edited("watch.toml", '"experiment.toml"', '"gone.toml"'), ["gone.toml"]),
    "nothing to estimate": (
        edited("experiment.toml", "[estimate]\nparameters", "[plan]\n#"), ["has no [estimate]"]
    ),
    "smoothing": (
        edited("experiment.toml", "[estimate]", "[estimate]\noptions.smooth = true"), ["smooth"]
    ),
    "a derivative": (
        edited("experiment.toml", "[estimate]", '[derived.a]\nderivative = "omega_w"\n[estimate]'),
        ["[derived.a]", "both sides"],
    ),
    "a record that is thinned": (
        edited("experiment.toml", 'id = "', 'rate = 50\nid = "'), ["key 'rate'", "leave the key out"]
    ),
    "another clock": (
        edited("experiment.toml", "[estimate]", '[files.tacho]\ntime = "t"\n[estimate]'),
        ["key 'files'", "have its source resample"],
    ),
    "another checkpoint": (foreign_checkpoint, [FILE, "--anew"]),
    "events of an earlier stream": (
        lambda f: (f / "out" / "events" / "000001").mkdir(parents=True), ["events", "move it away"]
    ),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_input_gets_one_line_and_exit_2(wrong, stream, capfd):
    spoil, words = WRONG[wrong]
    spoil(stream)
    assert run_safely(["watch", str(stream), "--once", "--out", str(stream / "out")]) == 2
    said = capfd.readouterr()
    lines = [line for line in (said.out + said.err).splitlines() if line.strip()]
    assert len(lines) == 1, lines
    assert lines[0].startswith("railfmi: ")
    for word in words:
        assert word in lines[0], lines[0]
    assert not (stream / "out" / "windows.csv").exists(), "nothing may be half-written"


def test_a_broken_window_is_left_out_with_its_reason(stream, capfd):
    whole = (stream / "windows" / "w1.parquet").read_bytes()
    broken = stream / "windows" / "w1.parquet"
    broken.write_bytes(whole[: len(whole) // 2])
    os.utime(broken, (time.time() - 1000,) * 2)
    assert run_safely(["watch", str(stream), "--once", "--out", str(stream / "out")]) == 0
    log = pd.read_csv(stream / "out" / "windows.csv").set_index("window")
    assert log.loc["w1.parquet", "state"] == "unusable"
    assert "not a sound Parquet file" in log.loc["w1.parquet", "notes"]
    assert "the filter begins anew" in log.loc["w2.parquet", "notes"]
    assert "1 not usable" in capfd.readouterr().out


def test_the_shipped_example_finds_its_friction_step(tmp_path, capfd):
    assert run_safely(["watch", str(EXAMPLE), "--once", "--json", "--out", str(tmp_path)]) == 0
    told = json.loads(capfd.readouterr().out)["result"]
    assert told["counts"]["alarms"] == 1
    t = float(re.search(r"t = ([\d.]+) s", told["alarms"][0])[1])
    assert 60.0 < t <= 63.0  # the friction falls at 60 s
    assert (tmp_path / "events" / "000001" / "experiment.toml").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_signal_ends_it_and_keeps_the_checkpoint(stream, number):
    command = [sys.executable, "-m", "scenarios.cli", "watch", str(stream), "--out", str(stream / "out")]
    process = subprocess.Popen(
        command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    log, until = stream / "out" / "windows.csv", time.monotonic() + PATIENCE
    while time.monotonic() < until and not (log.exists() and len(log.read_text().splitlines()) == 4):
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.1)
    process.send_signal(number)
    begun = time.monotonic()
    said, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + number
    assert "goes on from the last window" in said
    assert (stream / "out" / FILE).exists()
    assert json.loads((stream / "out" / "watch.json").read_text())["counts"]["windows"] == 3
    assert time.monotonic() - begun < PATIENCE / 4


@pytest.mark.slow
def test_a_killed_stream_goes_on_to_the_bit(tmp_path):
    """kill -9 after some windows, again and again, against one run that nobody disturbs."""
    data = record(61, 20.0)
    for name in ("whole", "killed"):
        write_experiment(tmp_path / name, record(62, 10.0))
        write_watch(tmp_path / name, "most = 0", learn=6.0)
        write_windows(tmp_path / name / "windows", data, range(0, 2000, 20))
    base = [sys.executable, "-m", "scenarios.cli", "watch", "--once"]
    subprocess.run([*base, str(tmp_path / "whole"), "--out", str(tmp_path / "whole" / "out")], check=True)
    log, done = tmp_path / "killed" / "out" / "windows.csv", 0
    while done < 80:
        process = subprocess.Popen(
            [*base, str(tmp_path / "killed"), "--out", str(log.parent)], start_new_session=True
        )
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until and process.poll() is None:
            rows = len(log.read_text().splitlines()) if log.exists() else 0
            if rows > done + 20:
                break
            time.sleep(0.01)
        done = max(done + 20, rows)
        os.kill(process.pid, signal.SIGKILL)  # its command dies with it
        process.wait()
        time.sleep(0.5)
    subprocess.run([*base, str(tmp_path / "killed"), "--out", str(log.parent)], check=True)
    for name in ("watch.json",):
        assert (log.parent / name).read_bytes() == (tmp_path / "whole" / "out" / name).read_bytes()
    logs = [pd.read_csv(tmp_path / n / "out" / "windows.csv") for n in ("whole", "killed")]
    pd.testing.assert_frame_equal(*(one.drop(columns="milliseconds") for one in logs))
