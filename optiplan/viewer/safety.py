"""What every page of ours is sent with, and which names of this server a browser may use.

A page of elsewhere can have its name resolve to this machine (DNS rebinding), or send requests from a browser of ours:
so the Host of a request must be a name of ours, and its Origin, where it has one, must be one of our pages.
"""

from collections.abc import Collection
from urllib.parse import urlsplit

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Names of this machine that no other machine can be reached by."""

PAGE_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; media-src blob:; worker-src blob:; connect-src data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Of a page with everything inside it, which needs nothing from anywhere."""

DRAWN_POLICY = PAGE_POLICY.replace("connect-src", "connect-src 'self'")
"""Of a page into which scripts draw: it asks its own server for what they draw, and nobody else."""

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Of every answer."""


def host_name(host: str) -> str:
    """The name in a Host header, without port and brackets, in lower case; empty where it is none."""
    try:
        return urlsplit(f"//{host.strip()}").hostname or ""
    except ValueError:
        return ""


def is_ours(host: str | None, origin: str | None, names: Collection[str]) -> bool:
    """Whether a request calls this server by one of its names, and comes from a page of it or from no page.

    Args:
        host: header `Host`.
        origin: header `Origin`; None without one.
        names: names of this server, in lower case.
    """
    if host is None or host_name(host) not in names:
        return False
    return origin is None or same_origin(origin, host)


def same_origin(origin: str, host: str) -> bool:
    """Whether a page of `origin` is one of the server that a request calls `host`."""
    try:
        return urlsplit(origin).netloc.lower() == host.strip().lower()
    except ValueError:
        return False
