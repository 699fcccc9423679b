"""Server and worker as processes: started, told where they are, stopped by a signal."""

import asyncio
import gc
import logging
import os
import re
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import uvicorn

from optiplan.errors import OptiPlanError
from optiplan.service.application import make_application
from optiplan.service.guard.connections import guarded_protocol
from optiplan.service.guard.json_log import log_to_stderr
from optiplan.service.health import serve_health
from optiplan.service.planner_service import PlannerService
from optiplan.service.settings import ServiceSettings
from optiplan.viewer.drawing.drawing import DrawingError
from optiplan.viewer.safety import LOOPBACK

SHORTEST_TOKEN = 16
"""Characters."""
TOKEN = re.compile(r"[A-Za-z0-9._~+/=-]+")
"""What a header and a cookie carry unchanged (RFC 6750)."""
SWITCH = 5e-4
"""s after which a thread that computes lets others run: answers do not wait for the queue's threads."""
PATIENCE = 3
"""s that connections have to end when the server stops."""
GRACE = 20.0
"""s within which a process has ended after a signal, whatever hangs in it."""
READY = 120.0
"""s within which a server is ready."""
LINGER = 2.0
"""s that threads have to end once all work is closed."""

YOUNG_OBJECTS = 700
"""New objects between two looks for garbage, as Python has it: the command line looks far less often, and the memory of
a server would grow by 4 kB with each request, and by 140 kB with each execution."""

_BEGIN, _END = b"b", b"e"

_log = logging.getLogger("optiplan.service")


def run_server(settings: ServiceSettings, level: str = "info") -> int:
    """Serve until a signal ends it; the address is printed on standard output once it can be opened.

    Raises:
        OptiPlanError: the address is none of this machine or in use; it needs a token; the database cannot be used.
    """
    check_token(settings)
    log_to_stderr(level)
    sys.setswitchinterval(SWITCH)
    with listening(settings) as sock, _LastResort() as last:
        server = make_server(settings)
        _look_for_garbage()
        server.on_stop = last.begin
        with _scripts(server.service, settings, sock) as meshcat:
            server.on_ready = lambda: _announce(settings.host, sock, meshcat)
            asyncio.run(server.serve(sockets=[sock]))
    return 0


def run_worker(settings: ServiceSettings, level: str = "info", health_port: int = 0) -> int:
    """Solve queued runs until a signal ends it; runs under way are put back.

    Args:
        settings: of the process.
        level: of what is logged.
        health_port: where `/healthz` and `/readyz` are answered, to callers on this machine; 0: nowhere.

    Raises:
        OptiPlanError: the database, the folder or the port cannot be used.
    """
    log_to_stderr(level)
    service, signals = PlannerService(settings, serving=False), _pipe_of_stop_signals()
    if health_port:
        serve_health(service.health, health_port)
    service.start()
    _look_for_garbage()
    print(f"working on the queue with {settings.solvers} processes (ctrl-C ends)", flush=True)
    with _LastResort() as last:
        os.read(signals, 1)
        last.begin()
        service.close()
    return 0


def _look_for_garbage() -> None:
    """Look for garbage often, but not through what is loaded, which stays and takes 50 ms."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG_OBJECTS)


class _LastResort:
    """Ends the process where a signal does not: threads may hang in a library or in the kernel.

    As a context: what is within has `GRACE` s from `begin`, and threads that are left have `LINGER` s from its exit.
    Without `begin`, nothing is ended.
    """

    def __init__(self) -> None:
        self._reading, self._writing = os.pipe()
        self._code = 0

    def begin(self) -> None:
        """Let the time begin; a signal's handler may call this."""
        os.write(self._writing, _BEGIN)

    def __enter__(self) -> "_LastResort":
        threading.Thread(target=self._watch, name="last resort", daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._code = 0 if kind is None else 1
        os.write(self._writing, _END)

    def _watch(self) -> None:
        """Wait for the signal, then for the end."""
        if os.read(self._reading, 1) == _END:
            return
        until = time.monotonic() + GRACE
        while select.select([self._reading], [], [], max(0.0, until - time.monotonic()))[0]:
            if os.read(self._reading, 1) == _END:
                time.sleep(LINGER)
                os._exit(self._code)
        _log.error("not ended within %g s of a signal: ended by force", GRACE)
        os._exit(1)


def _pipe_of_stop_signals() -> int:
    """The reading end of a pipe into which SIGINT and SIGTERM write a byte each, from now on.

    A handler that sets an event would not do: it runs in the main thread, which may hold the event's lock just then.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    return reading


def check_token(settings: ServiceSettings) -> None:
    """Check that who can reach the server from elsewhere needs a token.

    Raises:
        OptiPlanError: there is none, a short one, or one that no header and no cookie can carry.
    """
    if settings.token and len(settings.token) < SHORTEST_TOKEN:
        raise OptiPlanError(f"the token has {len(settings.token)} characters; expected at least {SHORTEST_TOKEN}")
    if settings.token and not TOKEN.fullmatch(settings.token):
        raise OptiPlanError("the token has characters that no cookie carries; expected letters, digits and ._~+/=-")
    if settings.host not in LOOPBACK and not settings.token:
        raise OptiPlanError(
            f"{settings.host} can be reached from other machines: give --token-file or OPTIPLAN_TOKEN "
            "(a token: openssl rand -hex 32)"
        )


def listening(settings: ServiceSettings) -> socket.socket:
    """A socket that listens at the address of the settings.

    Raises:
        OptiPlanError: it cannot be had.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((settings.host, settings.port))
    except OSError as error:
        sock.close()
        raise OptiPlanError(f"cannot listen on {settings.host}, port {settings.port}: {error.strerror}") from None
    return sock


def make_server(settings: ServiceSettings) -> "_Server":
    """The server of an application, not yet running.

    Raises:
        OptiPlanError: the database or the folder cannot be used.
    """
    service = PlannerService(settings)
    config = uvicorn.Config(
        make_application(service),
        http=guarded_protocol(settings),  # type: ignore[arg-type]  # what makes one will do
        ws="none",  # else uvicorn takes a connection that asks for one away from its guard, who counts it for ever
        proxy_headers=bool(settings.proxies),
        forwarded_allow_ips=list(settings.proxies),
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=PATIENCE,
        timeout_keep_alive=30,
        h11_max_incomplete_event_size=65536,
    )
    server = _Server(config)
    server.service, server.on_shutdown = service, service.executions.finish
    return server


@contextmanager
def serving(settings: ServiceSettings) -> Iterator[tuple[str, PlannerService]]:
    """Serve in a thread of this process; yield the address and the service once its processes are ready.

    Raises:
        OptiPlanError: the address cannot be had, the database cannot be used, or the server does not become ready.
    """
    with listening(settings) as sock:
        server = make_server(settings)
        thread = threading.Thread(target=server.run, args=([sock],), name="server", daemon=True)
        with _scripts(server.service, settings, sock):
            thread.start()
            try:
                until = time.monotonic() + READY
                while not server.started or server.service.health.ready()[0] != 200:
                    if not thread.is_alive() or time.monotonic() > until:
                        raise OptiPlanError(f"the server did not become ready within {READY:g} s")
                    time.sleep(0.1)
                yield _address(settings.host, sock), server.service
            finally:
                server.should_exit = True
                thread.join(GRACE)


class _Server(uvicorn.Server):
    """Calls `on_ready` once it answers, `on_stop` at a signal, and `on_shutdown` before it closes its connections.

    A signal ends it, and that is a good end.
    """

    service: PlannerService

    on_ready: Any = staticmethod(lambda: None)
    on_stop: Any = staticmethod(lambda: None)
    on_shutdown: Any = None

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self.on_stop()
        self.force_exit = self.should_exit and sig == signal.SIGINT  # pressed twice
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self.on_ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await self.on_shutdown()
        await super().shutdown(sockets)


def _address(host: str, sock: socket.socket) -> str:
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{sock.getsockname()[1]}"


@contextmanager
def _scripts(service: PlannerService, settings: ServiceSettings, sock: socket.socket) -> Iterator[str | None]:
    """Let scripts draw by meshcat's protocol as long as this lasts, if the settings say so; yield where.

    Raises:
        OptiPlanError: the port cannot be had.
    """
    if service.drawing is None or settings.meshcat_port is None:
        yield None
        return
    from optiplan.viewer.drawing.meshcat_endpoint import MeshcatEndpoint

    def no_page() -> str:
        raise DrawingError("no page alone holds what is drawn here; `optiplan view --meshcat-port` has one")

    web_url = f"{_address(settings.host, sock)}/"
    endpoint = MeshcatEndpoint(service.drawing, settings.meshcat_port, web_url, no_page, _log.error)
    endpoint.start()
    service.meshcat_url = endpoint.url
    try:
        yield endpoint.url
    finally:
        endpoint.close()
        service.drawing.close()


def _announce(host: str, sock: socket.socket, meshcat: str | None) -> None:
    print(f"serving at {_address(host, sock)}/ (ctrl-C ends)", flush=True)
    if meshcat is not None:
        print(f'meshcat.Visualizer("{meshcat}") draws into the pages of runs', flush=True)
    sys.stdout.flush()
