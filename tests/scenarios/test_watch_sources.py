"""Where windows come from and which of them count: a folder, a broker, triggers."""

import os
import shutil
import socket
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.errors import BadInput
from scenarios.watching.declaration import Mqtt
from scenarios.watching.policy import POLICY
from scenarios.watching.sources.folder import Folder, natural
from scenarios.watching.sources.mqtt import _password
from scenarios.watching.sources.source import Arrival
from scenarios.watching.triggers import TRIGGERS
from tests.helpers.streams import record, write_experiment, write_watch, write_windows

WAIT = 20.0  # s, for a busy machine


def made(folder: Path, *names: str, age: float = 100.0) -> None:
    for name in names:
        (folder / name).write_text("x")
        os.utime(folder / name, (time.time() - age,) * 2)


def names(source: Folder) -> list[str]:
    return [a.name for a in source.arrivals()]


@given(st.lists(st.integers(0, 10**6), min_size=2, max_size=9, unique=True))
def test_numbers_in_names_count_as_numbers(numbers):
    sorted_names = sorted((f"run{n}.csv" for n in numbers), key=natural)
    assert sorted_names == [f"run{n}.csv" for n in sorted(numbers)]


def test_each_file_comes_once_in_the_order_of_names(tmp_path):
    made(tmp_path, "w10", "w9", "w100", ".hidden", "_mine", "w11.part")
    (tmp_path / "w1").mkdir()
    source = Folder(tmp_path, "*", 1.0)
    assert names(source) == ["w9", "w10", "w100"]
    assert names(source) == []
    made(tmp_path, "w50")  # late, between those that came
    assert names(source) == ["w50"]


def test_a_file_comes_when_it_has_not_changed_for_a_while(tmp_path):
    now = time.time()
    clock = [now]
    source = Folder(tmp_path, "*.csv", 2.0, lambda: clock[0])
    made(tmp_path, "a.csv", age=0.0)
    made(tmp_path, "other.txt")
    assert names(source) == []
    clock[0] = now + 3
    [arrival] = source.arrivals()
    assert arrival.fresh  # what cannot be read yet comes again
    source.again(arrival)
    clock[0] = now + 3 + POLICY.patience
    [arrival] = source.arrivals()
    assert not arrival.fresh


def test_a_restart_gets_what_was_not_finished(tmp_path):
    made(tmp_path, "w1", "w2", "w3")
    source = Folder(tmp_path, "*", 1.0)
    assert names(source) == ["w1", "w2", "w3"]
    source.finished(("w1", "w3"))  # w2 is held back
    other = Folder(tmp_path, "*", 1.0)
    other.go_on(source.kept())
    assert names(other) == ["w2"]


def test_what_a_folder_remembers_is_bounded(tmp_path):
    source = Folder(tmp_path, "*", 0.0)
    many = [f"w{i}" for i in range(3 * POLICY.remembered)]
    source.finished(tuple(many))
    assert len(source.kept()) == POLICY.remembered
    made(tmp_path, "w0", many[-1], f"w{3 * POLICY.remembered}")
    assert names(source) == [f"w{3 * POLICY.remembered}"]  # w0 is an old one


def test_a_folder_that_is_none_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match="no such folder of windows"):
        Folder(tmp_path / "gone", "*", 0.0)


numbers = st.lists(st.floats(-5, 5), min_size=1, max_size=6).map(np.array)


@given(numbers, st.floats(-4, 0), st.floats(0.1, 4))
def test_a_band_holds_between_its_limits(x, low, high):
    band = TRIGGERS["band"](column="v", low=low, high=high)
    assert band.holds({"v": x}) == all(low <= value <= high for value in x)
    assert not band.holds({"v": np.append(x, np.nan)})


@given(numbers, st.floats(0.1, 5))
def test_steady_is_a_small_range(x, within):
    steady = TRIGGERS["steady"](column="v", within=within)
    assert steady.holds({"v": x}) == (max(x) - min(x) <= within)
    assert not steady.holds({"v": np.append(x, np.nan)})


@given(numbers, numbers)
def test_a_fence_is_the_inside_of_its_polygon(x, y):
    """A parallelogram, whose inside is known by its two coordinates; points on a side may count or not."""
    n = min(len(x), len(y))
    x, y = x[:n], y[:n]
    fence = TRIGGERS["fence"](
        latitude="lat", longitude="lon", corners=((-2.0, -3.0), (-2.0, 1.0), (2.0, 3.0), (2.0, -1.0))
    )
    across, along = y, x - y / 2  # within 2 and within -2 to 2 of the slanted sides
    inside = [abs(a) < 2 and -2 < b < 2 for a, b in zip(across, along, strict=True)]
    edge = [abs(abs(a) - 2) < 1e-9 or abs(abs(b) - 2) < 1e-9 for a, b in zip(across, along, strict=True)]
    if not any(edge):
        assert fence.holds({"lat": y, "lon": x}) == all(inside)


def test_every_trigger_says_which_columns_it_needs():
    for kind, trigger in TRIGGERS.items():
        assert trigger.kind == kind
        assert trigger.__doc__


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@pytest.fixture
def broker(tmp_path):
    """The port of Mosquitto on this machine, which keeps sessions while it runs."""
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("no MQTT broker 'mosquitto' here")
    pytest.importorskip("paho.mqtt.client")
    port = free_port()
    (tmp_path / "broker.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    process = subprocess.Popen(
        [program, "-c", str(tmp_path / "broker.conf")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + WAIT
    while time.monotonic() < until:
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.05)
    yield port
    process.terminate()
    process.wait(WAIT)


def publish(port: int, payloads: list[bytes]) -> None:
    from paho.mqtt import client as mqtt

    sender = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    sender.connect("127.0.0.1", port)
    sender.loop_start()
    for payload in payloads:
        sender.publish("rig/windows", payload, qos=1).wait_for_publish(WAIT)
    sender.disconnect()
    sender.loop_stop()


def received(source, count: int) -> list[Arrival]:
    """So many arrivals, each with what its file holds."""
    found, until = [], time.monotonic() + WAIT
    while len(found) < count and time.monotonic() < until:
        found += [(a.name, a.file.read_bytes()) for a in source.arrivals()]
        time.sleep(0.02)
    return found


def test_a_message_that_is_not_confirmed_comes_again(broker, tmp_path):
    from scenarios.watching.sources.mqtt import Broker

    declared = Mqtt(host="127.0.0.1", port=broker, topic="rig/windows", format=".csv")
    source = Broker(declared, tmp_path / "watch.toml")
    publish(broker, [b"one", b"two", b"three"])
    first = received(source, 3)
    assert [data for _, data in first] == [b"one", b"two", b"three"]
    source.finished((first[0][0],))
    source.confirmed()
    kept = source.kept()
    source.close()
    again = Broker(declared, tmp_path / "watch.toml")
    again.go_on(kept)
    publish(broker, [b"four"])
    assert [data for _, data in received(again, 3)] == [b"two", b"three", b"four"]
    again.close()


def test_a_broker_that_is_not_there_is_bad_input(tmp_path):
    pytest.importorskip("paho.mqtt.client")
    from scenarios.watching.sources.mqtt import Broker

    declared = Mqtt(host="127.0.0.1", port=free_port(), topic="x")
    with pytest.raises(BadInput, match="cannot be reached"):
        Broker(declared, tmp_path / "watch.toml")


@pytest.mark.parametrize(
    ("place", "words"), [("several", "several lines, and no password alone"), ("/dev/zero", "a device")]
)
def test_what_is_no_password_is_sent_to_no_broker(place, words, tmp_path):
    """A declaration of somebody else may name any file of mine, and a broker of its own."""
    (tmp_path / "several").write_text("-----BEGIN PRIVATE KEY-----\nkey\n")
    declared = Mqtt(host="127.0.0.1", topic="t", user="me", password_file=place)
    with pytest.raises(BadInput, match=words):
        _password(declared, tmp_path / "watch.toml")


def test_a_password_stands_alone_in_its_file(tmp_path):
    (tmp_path / "password").write_text("secret\n")
    declared = Mqtt(host="127.0.0.1", topic="t", user="me", password_file="password")
    assert _password(declared, tmp_path / "watch.toml") == "secret"


def test_a_stream_from_a_broker_is_that_from_a_folder(broker, tmp_path):
    from scenarios.watching.watching import watch

    data = record(41, 8.0)
    for name in ("folder", "broker"):
        write_experiment(tmp_path / name, record(42, 10.0))
    files = write_windows(tmp_path / "folder" / "windows", data, range(0, 800, 100))
    write_watch(tmp_path / "folder")
    toml = write_watch(tmp_path / "broker").read_text()
    mqtt = f'[stream.mqtt]\nhost = "127.0.0.1"\nport = {broker}\ntopic = "rig/windows"\n'
    (tmp_path / "broker" / "watch.toml").write_text(
        toml.replace('folder = "windows"\n', "").replace("[test]", f"{mqtt}[test]")
    )
    sending = threading.Thread(target=publish_when_asked, args=(broker, files, tmp_path / "broker" / "out"))
    sending.start()
    by_message = watch(tmp_path / "broker", tmp_path / "broker" / "out", once=True)
    sending.join(WAIT)
    while by_message.counts.windows < len(files):  # it had ended before the first message came
        by_message = watch(tmp_path / "broker", tmp_path / "broker" / "out", once=True)
    by_folder = watch(tmp_path / "folder", tmp_path / "folder" / "out", once=True)
    assert by_message.estimates == by_folder.estimates
    assert by_message.counts == by_folder.counts
    log = pd.read_csv(tmp_path / "broker" / "out" / "windows.csv")
    assert log["window"].iloc[-1] == "rig/windows 8"


def publish_when_asked(port: int, files: list[Path], out: Path) -> None:
    """Publish as soon as somebody watches, who has subscribed by then."""
    until = time.monotonic() + 5 * WAIT
    while not out.exists() and time.monotonic() < until:
        time.sleep(0.1)
    publish(port, [f.read_bytes() for f in files])
