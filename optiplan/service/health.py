"""Whether a process can work, as a whole: made from the threads that live and from a write to the database.

systemd's watchdog starts a process anew that does not say, now and then, that it lives.
Source: sd_notify(3), sd_watchdog_enabled(3): a datagram `WATCHDOG=1` to the socket that `NOTIFY_SOCKET` names, twice in
`WATCHDOG_USEC` at least.
"""

import json
import logging
import os
import socket
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from optiplan.errors import OptiPlanError
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.execution.solver_pool import SolverPool
from optiplan.service.refusals import error_body
from optiplan.service.store.write_probe import WriteProbe

_log = logging.getLogger("optiplan.service")

SHARE = 1 / 3
"""Of the time that systemd waits, between two words."""

Health = tuple[int, dict[str, object]]
"""Status and body of an answer to a look at the health of a process."""


class HealthCheck:
    """Looks at a process that serves or works.

    Attributes:
        also: what finds further faults that make it not ready.
    """

    def __init__(self, pool: SolverPool, queue: RunQueue, probe: WriteProbe) -> None:
        self.also: list[Callable[[], list[str]]] = []
        self._pool, self._queue, self._probe = pool, queue, probe

    def living(self) -> Health:
        """200 where all threads live; 503 where only a new start helps."""
        ended = self._ended()
        return _answer([f"threads have ended or hang: {', '.join(ended)}"] if ended else [])

    def ready(self) -> Health:
        """200 where all threads live, the processes are warm, and database and disk take changes; else 503 and why."""
        ended = self._ended()
        faults = [f"threads have ended or hang: {', '.join(ended)}"] if ended else []
        if not ended and not self._pool.ready:
            faults.append("processes are starting")
        if (fault := self._probe.fault()) is not None:
            faults.append(str(fault))
        return _answer([*faults, *(fault for look in self.also for fault in look())])

    def _ended(self) -> list[str]:
        return [*self._pool.ended, *self._queue.ended]


def _answer(faults: list[str]) -> Health:
    return (503, error_body("; ".join(faults))) if faults else (200, {"status": "ok"})


def serve_health(check: HealthCheck, port: int) -> ThreadingHTTPServer:
    """Answer `/healthz` and `/readyz` on this machine's loopback address, in threads of their own.

    Raises:
        OptiPlanError: the port is in use.
    """

    class Handler(BaseHTTPRequestHandler):
        timeout = 5.0

        def do_GET(self) -> None:
            looks = {"/healthz": check.living, "/readyz": check.ready}
            look = looks.get(self.path)
            status, body = (404, error_body("expected /healthz or /readyz")) if look is None else look()
            content = json.dumps(body).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *words: object) -> None:
            _log.debug(format, *words)

    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except OSError as error:
        raise OptiPlanError(f"cannot listen on 127.0.0.1, port {port}: {error.strerror}") from None
    threading.Thread(target=server.serve_forever, name="health", daemon=True).start()
    return server


def feed_watchdog(alive: Callable[[], bool]) -> threading.Event:
    """Say that this process lives as long as it does, from a thread of its own; nothing where systemd does not ask.

    Returns:
        What ends that.
    """
    stop = threading.Event()
    address, wait = os.environ.get("NOTIFY_SOCKET", ""), os.environ.get("WATCHDOG_USEC", "")
    if not address or not wait.isdigit() or os.environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return stop
    name = "\0" + address[1:] if address.startswith("@") else address

    def feed() -> None:
        while not stop.wait(SHARE * 1e-6 * int(wait)):
            try:
                if alive():
                    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
                        sock.sendto(b"WATCHDOG=1", name)
            except Exception:  # another word comes soon, or systemd acts
                _log.exception("the watchdog cannot be told")

    threading.Thread(target=feed, name="watchdog", daemon=True).start()
    return stop
