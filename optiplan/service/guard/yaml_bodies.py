"""Problem files as the body of a request: `curl --data-binary @cell.yaml -H "Content-Type: application/yaml"`.

What else a submission may say comes as the query: `?planner=rrtconnect&budget=5`.
"""

import json
from typing import Any
from urllib.parse import parse_qsl

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from optiplan.service.refusals import Refusal

KINDS = (b"application/yaml", b"application/x-yaml", b"text/yaml", b"text/x-yaml")
NUMBERS = {"budget": float, "deadline": float, "seed": int}


class YamlBodies:
    """Turns such a request into the JSON that routes take."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        headers = dict(scope.get("headers", ()))
        kind = headers.get(b"content-type", b"").partition(b";")[0].strip().lower()
        if scope["type"] != "http" or scope["method"] != "POST" or kind not in KINDS:
            await self._app(scope, receive, send)
            return
        text = await _whole(receive)
        body = json.dumps({"problem": _decoded(text), **_query(scope)}).encode()
        kept = [pair for pair in scope["headers"] if pair[0] not in (b"content-type", b"content-length")]
        kept += [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
        messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

        async def replay() -> Message:
            return messages.pop() if messages else await receive()

        await self._app({**scope, "headers": kept, "query_string": b""}, replay, send)


async def _whole(receive: Receive) -> bytes:
    parts = []
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":  # half a file may be a problem too, one without its last obstacles
            raise Refusal(400, "the body of the request broke off")
        parts.append(message.get("body", b""))
        if not message.get("more_body"):
            return b"".join(parts)


def _decoded(text: bytes) -> str:
    try:
        return text.decode()
    except UnicodeDecodeError as error:
        found = f"byte {error.object[error.start]:#04x} at offset {error.start}"
        raise Refusal(422, f"body: found {found}; expected UTF-8 text") from None


def _query(scope: Scope) -> dict[str, Any]:
    """The query as fields of a submission; what is no number stays text, and is then refused."""
    found: dict[str, Any] = {}
    for key, value in parse_qsl(scope["query_string"].decode("latin-1")):
        if key == "problem":
            raise Refusal(422, "problem: found one in the query; expected the one in the body alone")
        try:
            found[key] = NUMBERS[key](value) if key in NUMBERS else value
        except ValueError:
            found[key] = value
    return found
