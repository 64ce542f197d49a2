"""The local page of a stream: / as HTML, /metrics for Prometheus, /health as JSON; on this machine alone."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import ClassVar

from fmus.errors import BadInput
from scenarios.watching.health import Status, health, metrics, page

HOST = "127.0.0.1"
PATIENCE = 5.0  # s, that a reader may take for a request
TICK = 0.2  # s, between looks at whether the server shall end


class Serving:
    """The server of a status, which the stream replaces; a reader sees the old one or the new one."""

    def __init__(self, status: Status) -> None:
        self.status = status
        self.port = 0

    @contextmanager
    def at(self, port: int) -> Iterator[None]:
        """Serve at a port of this machine, 0 for any free one; BadInput if it is taken."""
        kind = type("Handler", (_Handler,), {"status": lambda _: self.status})
        try:
            server = ThreadingHTTPServer((HOST, port), kind)
        except (OSError, OverflowError) as error:
            raise BadInput(f"--port {port}: cannot be used ({error}); give another one") from error
        server.daemon_threads = True
        self.port = server.server_address[1]
        thread = Thread(target=server.serve_forever, args=(TICK,), name="railfmi-page", daemon=True)
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            server.server_close()
            thread.join(PATIENCE)


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD; everything is made of one status."""

    status: ClassVar[Callable[["_Handler"], Status]]
    timeout = PATIENCE
    server_version, sys_version = "railfmi", ""

    def do_GET(self) -> None:
        """One of the three pages."""
        now, status = time.time(), self.status()
        code = 200
        if self.path == "/":
            kind, text = "text/html; charset=utf-8", page(status, now)
        elif self.path == "/metrics":
            kind, text = "text/plain; version=0.0.4; charset=utf-8", metrics(status, now)
        elif self.path == "/health":
            kind, (code, text) = "application/json", health(status, now)
        else:
            code, kind, text = 404, "text/plain; charset=utf-8", "there are /, /metrics and /health\n"
        self._answer(code, kind, text.encode("utf-8"))

    do_HEAD = do_GET

    def _answer(self, code: int, kind: str, body: bytes) -> None:
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Requests are not told."""
