"""The gate: every request passes it before anything of it is read.

It looks, in this order, at how much is under way, the name by which it is called, where it comes from, the token, how
often the client asks, and how large the body is; then it sends the headers that keep an answer where it belongs, and
writes a line of log.
"""

import asyncio
import hmac
import json
import logging
import math
import time
import uuid
from collections.abc import MutableMapping
from typing import Any
from urllib.parse import parse_qsl, urlencode

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.guard.rates import Rates, client_of
from optiplan.service.pages.framing import error_page, wants_page
from optiplan.service.refusals import Refusal, busy, error_body, internal_error
from optiplan.service.settings import ServiceSettings
from optiplan.viewer.safety import HEADERS, LOOPBACK, host_name, same_origin

COOKIE = "optiplan_token"
"""Carries the token for browsers."""
OPEN = ("/healthz", "/readyz", "/pages/service.css")
"""Answered without a token: they tell nothing."""
PAGE = (
    "default-src 'self'; script-src 'self' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' data: blob:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
"""Content policy of what has none of its own: everything from this server, nothing inside the page."""
REQUEST = "optiplan.request"
"""Key of a scope: the id of the request, as in the log."""
LINGER = 30.0
"""s in which the rest of a body that nobody wants may still come."""
MOST_CALLS = 2000
"""Requests under way at a time; more are refused with 503."""

_log = logging.getLogger("optiplan.requests")


class Gate:
    """ASGI application in front of another one."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings, metrics: RequestCounts) -> None:
        self._app, self._settings, self._metrics = app, settings, metrics
        self._rates = Rates(settings.rate, settings.burst)
        self._calls = 0
        loopback = settings.host in LOOPBACK
        self._names = (
            {*LOOPBACK, settings.host, *map(str.lower, settings.hosts)} if loopback or settings.hosts else None
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request pass, or refuse it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # no websockets here
        call = _Call(scope, receive, send, self._settings.body)
        method = "GET" if scope["method"] == "HEAD" else scope["method"]  # of which the head is sent
        asked = {**scope, "method": method, REQUEST: call.id}
        self._calls += 1
        try:
            self._check(asked, call)
            if (clean := self._token_in_address(asked)) is not None:
                await call.redirect(clean, self._cookie(scope))
            else:
                await self._app(asked, call.receive, call.send)
        except Refusal as error:
            path = self._path(scope)
            page = wants_page(scope["method"], path, call.headers.get("accept", ""))
            await call.refuse(error, error_page(error, path) if page else None)
        except Exception:
            _log.exception("internal error", extra={"request_id": call.id, "path": scope["path"]})
            await call.refuse(internal_error(call.id))
        finally:
            self._calls -= 1
            self._metrics.add(scope["method"], call.status, time.perf_counter() - call.began)
            _log.info("request", extra=call.line(scope))

    def _check(self, scope: Scope, call: "_Call") -> None:
        if self._calls > MOST_CALLS:
            raise Refusal(503, "too many requests at a time", headers={"Retry-After": "1"})
        host, origin = call.headers.get("host"), call.headers.get("origin")
        if self._names is not None and host_name(host or "") not in self._names:
            raise Refusal(403, "this server is called by a name that is not its own; see --allow-host")
        if origin is not None and not same_origin(origin, host or ""):
            raise Refusal(403, "requests from pages of other servers are refused")
        if self._settings.token and self._path(scope) not in OPEN and not self._has_token(scope, call):
            raise Refusal(401, "a token is needed: Authorization: Bearer …", headers={"WWW-Authenticate": "Bearer"})
        client = client_of((scope.get("client") or ("local", 0))[0])
        if (wait := self._rates.wait(client)) > 0.0:
            raise busy("too many requests", wait)
        if call.length > self._settings.body:
            raise _too_large(self._settings.body)

    def _has_token(self, scope: Scope, call: "_Call") -> bool:
        given = call.headers.get("authorization", "")
        scheme, _, token = given.partition(" ")
        if scheme.lower() == "bearer":
            return self._same(token.strip())
        if self._same(HTTPConnection(scope).cookies.get(COOKIE, "")):
            return True
        return self._token_comes_in_address(scope)

    def _token_comes_in_address(self, scope: Scope) -> bool:
        return scope["method"] == "GET" and self._same(dict(_query(scope)).get("token", ""))

    def _same(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self._settings.token.encode())

    def _token_in_address(self, scope: Scope) -> str | None:
        """The address without the token that a person opened a page with; the token goes on as a cookie."""
        if not self._settings.token or not self._token_comes_in_address(scope):
            return None
        rest = urlencode([pair for pair in _query(scope) if pair[0] != "token"])
        path = self._settings.root_path + "/" + self._path(scope).lstrip("/")  # `//elsewhere` is another server
        return f"{path}?{rest}" if rest else path

    def _path(self, scope: Scope) -> str:
        """The path below where a proxy has put this server, whether the proxy passes that on or not."""
        path, root = str(scope["path"]), self._settings.root_path
        return path.removeprefix(root) if root and path.startswith(root + "/") else path

    def _cookie(self, scope: Scope) -> str:
        """The token as a cookie that pages of others cannot use; where it came by TLS, it never goes without."""
        secure = "; Secure" if scope.get("scheme") == "https" else ""
        path = self._settings.root_path or "/"
        return f"{COOKIE}={self._settings.token}; HttpOnly; SameSite=Strict; Path={path}{secure}"


class _Call:
    """One request on its way: its body is counted, its answer gets our headers.

    An answer begins once its request has come whole, unless that is more than we take, and ends once the rest has come,
    too. Who sends all before it reads would find a broken connection; and Go's proxies, Caddy among them, close a body
    that they still pass on when the head of the answer comes, and break off that answer.
    """

    def __init__(self, scope: Scope, receive: Receive, send: Send, most: int) -> None:
        self.id, self.began, self.status = uuid.uuid4().hex[:16], time.perf_counter(), 0
        self.headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        self._receive, self._send, self._most, self._read = receive, send, most, 0
        self._head = scope["method"] == "HEAD"
        length = self.headers.get("content-length", "0")
        self.length = int(length) if length.isascii() and length.isdigit() else math.inf
        """Bytes that are to come, where the client says so."""
        self._comes = self.length > 0 or "transfer-encoding" in self.headers
        """Whether more of the body is waited for."""
        self._held_back = self.headers.get("expect", "").lower() == "100-continue"
        """Whether the client sends the body only once it is asked for."""
        self._done = False

    async def receive(self) -> Message:
        """A part of the body; the first that makes it too large is refused, whatever the application says to that."""
        self._held_back = False
        message = await self._next_part()
        if self._read > self._most:
            error = _too_large(self._most)
            await self.refuse(error)
            raise error
        return message

    async def send(self, message: Message) -> None:
        """A part of the answer; nothing after its end."""
        if self._done:
            return
        if message["type"] == "http.response.start":
            self.status = message["status"]
            if self.length <= self._most:
                await self._pour_away(self._most)
            known = {name.lower() for name, _ in message["headers"]}
            ours = {**HEADERS, "Content-Security-Policy": PAGE, "X-Request-Id": self.id, "Cache-Control": "no-store"}
            extra = [(name.lower().encode(), value.encode()) for name, value in ours.items()]
            message["headers"] = [*message["headers"], *(pair for pair in extra if pair[0] not in known)]
            await self._send(message)
            if not self._head:
                return
            message = {"type": "http.response.body", "body": b""}
        if not message.get("more_body", False):
            self._done = True
            if self._comes and not self._held_back:
                await self._send({**message, "more_body": True})
                await self._pour_away(math.inf)
                message = {"type": "http.response.body", "body": b""}
        await self._send(message)

    async def _next_part(self) -> Message:
        message = await self._receive()
        self._comes = message.get("more_body", False)
        self._read += len(message.get("body", b""))
        return message

    async def _pour_away(self, most: float) -> None:
        """Read on in a body that nobody wants: until it has come, or more of it than that, for some time."""
        try:
            async with asyncio.timeout(LINGER):
                while self._comes and not self._held_back and self._read <= most:
                    await self._next_part()
        except TimeoutError:
            self._comes = False

    async def refuse(self, why: Refusal, page: str | None = None) -> None:
        """Answer with an error, unless an answer has begun; as a page where a person reads it."""
        if self.status:
            return
        body = json.dumps(error_body(why)).encode() if page is None else page.encode()
        kind = "application/json" if page is None else "text/html; charset=utf-8"
        await self._answer(why.status, {"Content-Type": kind, **why.headers}, body)

    async def redirect(self, path: str, cookie: str) -> None:
        """Send the browser to another address of ours, with a cookie."""
        await self._answer(303, {"Location": path, "Set-Cookie": cookie}, b"")

    async def _answer(self, status: int, headers: dict[str, str], body: bytes) -> None:
        listed = [(name.lower().encode(), value.encode("latin-1")) for name, value in headers.items()]
        listed.append((b"content-length", str(len(body)).encode()))
        await self.send({"type": "http.response.start", "status": status, "headers": listed})
        await self.send({"type": "http.response.body", "body": body})

    def line(self, scope: Scope) -> MutableMapping[str, Any]:
        """What the log says of it."""
        client = (scope.get("client") or ("local", 0))[0]
        seconds = round(time.perf_counter() - self.began, 6)
        words = {"request_id": self.id, "method": scope["method"], "path": scope["path"], "client": client}
        return {**words, "status": self.status, "seconds": seconds}


def _too_large(most: int) -> Refusal:
    return Refusal(413, f"the body is too large; this server takes {most} bytes")


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
