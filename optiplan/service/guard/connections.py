"""What a connection may take: so many of one client at a time, so long for the head of a request and for its body.

uvicorn itself limits neither: it counts connections of everybody together, and waits for half a request for ever.
"""

import asyncio
import ipaddress
import json
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from optiplan.service.guard.rates import client_of
from optiplan.service.refusals import error_body
from optiplan.service.settings import ServiceSettings

PARTING = 1.0
"""s in which a client that is refused can read why."""


def guarded_protocol(settings: ServiceSettings) -> Callable[..., asyncio.Protocol]:
    """What makes the protocols of a server: each with the limits of the settings, all with one count of clients."""
    return partial(GuardedProtocol, settings=settings, counts=Counter())


class GuardedProtocol(H11Protocol):
    """HTTP/1.1 of one connection within limits."""

    def __init__(self, *given: Any, settings: ServiceSettings, counts: Counter[str], **named: Any) -> None:
        super().__init__(*given, **named)
        self._settings, self._counts = settings, counts
        self._from = ""
        self._refused = False
        self._timer: asyncio.TimerHandle | None = None
        self._awaited: str | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count the client; refuse it where it has as many connections as it may."""
        super().connection_made(transport)
        host = self.client[0] if self.client else "local"
        if not trusted(host, self._settings.proxies):  # through a proxy come many
            self._from = client_of(host)
            self._counts[self._from] += 1
        if self._counts[self._from] > self._settings.connections:
            self._refused = True
            self.connections.discard(self)  # it takes nobody's place
            self._part(429, f"more than {self._settings.connections} connections at a time of one client")
        else:
            self._await("head")

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._await(None)
        self._counts[self._from] -= 1
        if self._counts[self._from] <= 0:
            del self._counts[self._from]
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Read on, and see what is awaited now."""
        if self._refused:
            return
        super().data_received(data)
        if self.conn.their_state is h11.SEND_BODY:
            self._await("body")
        else:
            self._await("head" if self.conn.their_state is h11.IDLE and self.conn.trailing_data[0] else None)

    def _await(self, what: str | None) -> None:
        """Begin to wait for the rest of a head or body; the time does not begin anew with each part."""
        if what == self._awaited:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._awaited, self._timer = what, None
        if what is not None:
            seconds = self._settings.head_time if what == "head" else self._settings.body_time
            self._timer = self.loop.call_later(seconds, self._late)

    def _late(self) -> None:
        what, self._awaited, self._timer = self._awaited, None, None
        if self.transport.is_closing():
            return
        begun = self.cycle is not None and not self.cycle.response_complete
        if begun:
            self.cycle.disconnected = True  # whatever the application answers now, nobody reads
            self.cycle.message_event.set()
        self._refused = True
        if (begun and self.cycle.response_started) or (what == "head" and not self.conn.trailing_data[0]):
            self.transport.close()
        else:
            self._part(408, f"the {what} of the request did not come in time")

    def _part(self, status: int, error: str) -> None:
        """Say why, and close once that can have been read."""
        body = json.dumps(error_body(error)).encode()
        head = f"HTTP/1.1 {status} {'Too Many Requests' if status == 429 else 'Request Timeout'}\r\n"
        head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\nConnection: close\r\n"
        head += "Retry-After: 1\r\n\r\n"
        self.transport.write(head.encode() + body)
        if self.transport.can_write_eof():
            with suppress(OSError):  # it is gone already
                self.transport.write_eof()
        self.loop.call_later(PARTING, self.transport.close)


def trusted(host: str, proxies: tuple[str, ...]) -> bool:
    """Whether an address is that of a proxy of ours, given as addresses and networks."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    return any(address in ipaddress.ip_network(proxy, strict=False) for proxy in proxies)
