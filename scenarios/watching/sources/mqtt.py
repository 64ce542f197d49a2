"""Messages of a broker by MQTT, of one window each, through the library paho-mqtt."""

import queue
import tempfile
import threading
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.taken import check_text
from scenarios.watching.declaration import Mqtt
from scenarios.watching.sources.source import Arrival, Source

QUEUED = 32  # messages that wait here; then the broker keeps the others
KEEP_ALIVE = 30  # s
CONNECTING = 5.0  # s, until the first connection must stand
AT_LEAST_ONCE = 1  # quality of service: what is not confirmed comes again


class Broker(Source):
    """Each message is confirmed to the broker when its result is in a checkpoint, not before.

    The session is one that the broker keeps. What comes while railfmi does not run, or was not confirmed when
    it was killed, comes again. A message that comes twice holds samples that are past, which are left out.
    """

    def __init__(self, declared: Mqtt, where: Path) -> None:
        self._declared = declared
        try:
            self._client_module: Any = import_module("paho.mqtt.client")
        except ImportError as error:
            raise BadInput(
                f"{where}: [stream.mqtt] needs the package 'paho-mqtt', which is not installed; "
                "run 'pip install paho-mqtt'"
            ) from error
        self._messages: queue.Queue[Any] = queue.Queue(QUEUED)
        self._open: dict[str, Any] = {}  # messages by name, that are not confirmed
        self._settled: list[str] = []
        self._count = 0
        self._subscribed = threading.Event()
        self._refused = ""
        self._client = self._connect(where)
        self._work = tempfile.TemporaryDirectory(prefix="railfmi_mqtt_")

    def _connect(self, where: Path) -> Any:
        d, mqtt = self._declared, self._client_module
        client = mqtt.Client(
            mqtt.CallbackAPIVersion.VERSION2, client_id=d.client, clean_session=False, manual_ack=True
        )
        if d.user is not None:
            client.username_pw_set(d.user, _password(d, where))
        if d.certificates is not None:
            check_text(where.parent / d.certificates)
            client.tls_set(str(where.parent / d.certificates))
        client.max_inflight_messages_set(QUEUED)
        client.on_connect, client.on_message = self._on_connect, self._on_message
        client.on_subscribe = self._on_subscribe
        at = f"{where}: [stream.mqtt] {d.host}:{d.port}"
        try:
            client.connect(d.host, d.port, KEEP_ALIVE)
        except (OSError, ValueError) as error:
            raise BadInput(
                f"{at} cannot be reached ({error}); start the broker or correct the key"
            ) from error
        client.loop_start()
        if not self._subscribed.wait(CONNECTING):
            client.loop_stop()
            said = self._refused or "it does not answer"
            raise BadInput(f"{at} takes no connection ({said}); correct user, password_file, port or topic")
        return client

    def _on_connect(self, client: Any, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        """Also after each connection that was lost."""
        if code.is_failure:
            self._refused = str(code)
            return
        client.subscribe(self._declared.topic, AT_LEAST_ONCE)

    def _on_subscribe(self, _client: Any, _data: Any, _mid: int, codes: Any, _properties: Any) -> None:
        """The broker has answered to the subscription: what is published from now on comes here."""
        [code] = codes  # of the one topic
        if code.is_failure:
            self._refused = f"topic {self._declared.topic}: {code}"
            return
        self._subscribed.set()

    def _on_message(self, _client: Any, _data: Any, message: Any) -> None:
        self._messages.put(message)

    def arrivals(self) -> Iterator[Arrival]:
        """See Source."""
        while True:
            try:
                message = self._messages.get_nowait()
            except queue.Empty:
                return
            self._count += 1
            name = f"{message.topic} {self._count}"
            self._open[name] = message
            file = Path(self._work.name) / f"{self._count}{self._declared.format}"
            file.write_bytes(message.payload)
            yield Arrival(name, file)
            file.unlink(missing_ok=True)

    def again(self, arrival: Arrival) -> None:
        """See Source; a message is whole when it comes, so this is never asked for."""

    def finished(self, names: tuple[str, ...]) -> None:
        """See Source."""
        self._settled += names

    def kept(self) -> tuple[str, ...]:
        """See Source."""
        return (str(self._count),)

    def go_on(self, kept: tuple[str, ...]) -> None:
        """See Source."""
        [count] = kept
        self._count = int(count)

    def confirmed(self) -> None:
        """See Source."""
        for name in self._settled:
            message = self._open.pop(name)
            self._client.ack(message.mid, message.qos)
        self._settled.clear()

    def close(self) -> None:
        """See Source."""
        self._client.disconnect()
        self._client.loop_stop()
        self._work.cleanup()


def _password(d: Mqtt, where: Path) -> str | None:
    """The password in the file that the declaration names; it goes to the broker, and nothing else may."""
    if d.password_file is None:
        return None
    file = where.parent / d.password_file
    check_text(file)
    try:
        text = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: the password cannot be read ({error}); correct password_file") from error
    if len(text.splitlines()) > 1:
        raise BadInput(f"{file}: holds several lines, and no password alone; correct password_file")
    return text
