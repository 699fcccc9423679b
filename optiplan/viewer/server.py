"""Serve the page on a local port until ctrl-C, in one thread without child processes."""

import sys
from collections.abc import Callable, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from optiplan.errors import OptiPlanError
from optiplan.problem.problem import Problem
from optiplan.viewer.page import render_page
from optiplan.viewer.runs import RunLike
from optiplan.viewer.safety import HEADERS, LOOPBACK, PAGE_POLICY, is_ours
from optiplan.viewer.scene import build_scene

FIRST_PORT = 7000
PORTS_TRIED = 100


class PageServer(ThreadingHTTPServer):
    """Serve one prepared page at `/`; if the port is busy, use the next free one; port 0: any.

    Raises:
        OptiPlanError: no port is free.
    """

    daemon_threads = True
    allow_reuse_address = False
    policy = PAGE_POLICY

    @property
    def handler(self) -> "type[PageHandler]":
        """What answers a request."""
        return PageHandler

    def __init__(self, page: str, host: str = "127.0.0.1", port: int = FIRST_PORT) -> None:
        self.page = page.encode("utf-8")
        last = min(port + PORTS_TRIED, 65536) if port else 1
        for candidate in range(port, last):
            try:
                super().__init__((host, candidate), self.handler)
                return
            except OSError as error:
                reason = error
        tried = f"port {port}" if last == port + 1 else f"ports {port} to {last - 1}"
        raise OptiPlanError(f"cannot serve the page on {host}, {tried}: {reason}")

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print what went wrong, but not that a browser went away before it had its answer."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)

    def answer(self, path: str) -> bytes | None:
        """Return the page at an address of this server, without its host; None: no such page."""
        return self.page if path.split("?")[0] == "/" else None

    def kept(self) -> str:
        """The page as it is now, which plays without this server."""
        return self.page.decode()

    @property
    def url(self) -> str:
        """Address of the page."""
        host, port = self.server_address[:2]
        return f"http://{host!s}:{port}/"


class PageHandler(BaseHTTPRequestHandler):
    """Answers requests of a browser."""

    server: PageServer

    def admitted(self) -> bool:
        """Whether the caller knows us by a name of ours; else it is answered with 403."""
        names = {*LOOPBACK, str(self.server.server_address[0])}
        if is_ours(self.headers.get("Host"), self.headers.get("Origin"), names):
            return True
        self.send_error(403, explain="This server is called by another name than its own.")
        return False

    def do_GET(self) -> None:
        """Answer with the page at `/`, and with 404 anywhere else; with 403 to whoever calls us by a name not ours."""
        if not self.admitted():
            return
        page = self.server.answer(self.path)
        if page is None:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(page)))
        self.send_header("Content-Security-Policy", self.server.policy)
        self.end_headers()
        self.wfile.write(page)

    def end_headers(self) -> None:
        """Add what every answer has, errors included."""
        for name, value in {**HEADERS, "Cache-Control": "no-store"}.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Suppress logging: standard error belongs to the command."""


def serve_runs(
    problem: Problem,
    runs: Sequence[RunLike],
    host: str = "127.0.0.1",
    port: int = FIRST_PORT,
    on_ready: Callable[[str], None] = lambda url: None,
) -> None:
    """Serve the page of these runs until ctrl-C; `on_ready` is called with its address once it can be opened.

    Raises:
        OptiPlanError: no port is free.
    """
    with PageServer(render_page(build_scene(problem, runs)), host, port) as server:
        serve_until_interrupted(server, lambda: on_ready(server.url))


def serve_until_interrupted(server: PageServer, on_ready: Callable[[], None]) -> None:
    """Serve until ctrl-C, from when `on_ready` has been called."""
    try:
        on_ready()
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        return
