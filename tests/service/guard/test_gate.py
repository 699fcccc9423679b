"""The gate: foreign names, pages and clients do not pass; every answer keeps its place."""

import asyncio
import json
import logging
import sys
from io import StringIO

import httpx
import pytest

from optiplan.errors import OptiPlanError
from optiplan.service.guard.gate import Gate
from optiplan.service.guard.json_log import JsonLines, log_to_stderr
from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.guard.rates import Rates
from optiplan.service.server import check_token
from optiplan.service.settings import ServiceSettings
from tests.waiting import answer_of

TOKEN = "a-token-of-enough-characters"


async def echo(scope, receive, send):
    """Answers with the length of the body."""
    body = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if not message.get("more_body"):
            break
    if scope["path"] == "/broken":
        raise RuntimeError("a secret of ours")
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": str(len(body)).encode()})


def ask(settings, method="GET", path="/", host="127.0.0.1:7100", **given):
    async def call():
        transport = httpx.ASGITransport(Gate(echo, settings, RequestCounts()))
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            return await client.request(method, path, **given)

    return answer_of(call())


@pytest.mark.parametrize("host", ["127.0.0.1:7100", "localhost", "LOCALHOST:80", "[::1]:7100"])
def test_our_own_names_pass(host):
    assert ask(ServiceSettings(), host=host.lower()).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:7100", "localhost.evil.example", "0.0.0.0"])
def test_a_foreign_name_is_refused(host):
    answer = ask(ServiceSettings(), host=host)
    assert answer.status_code == 403
    assert "name" in answer.json()["error"]


def test_a_name_can_be_allowed():
    assert ask(ServiceSettings(hosts=("planner.cell",)), host="planner.cell:7100").status_code == 200
    settings = ServiceSettings(host="10.0.0.5", token=TOKEN, hosts=("planner.cell",))
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    assert ask(settings, host="planner.cell", headers=bearer).status_code == 200
    assert ask(settings, host="other.cell", headers=bearer).status_code == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:7101", "http://[broken"])
def test_a_foreign_page_is_refused(origin):
    for method in ("GET", "POST", "OPTIONS"):
        assert ask(ServiceSettings(), method, headers={"Origin": origin}).status_code == 403


def test_our_own_page_passes_and_no_other_reads_answers():
    answer = ask(ServiceSettings(), "POST", headers={"Origin": "http://127.0.0.1:7100"})
    assert answer.status_code == 200
    assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize("path", ["/", "/broken"])
def test_headers_are_on_every_answer(path):
    headers = ask(ServiceSettings(), path=path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert "frame-ancestors 'self'" in headers["content-security-policy"]
    assert headers["x-request-id"]
    assert headers["cache-control"] == "no-store"


def test_an_internal_error_tells_no_secret():
    answer = ask(ServiceSettings(), path="/broken")
    assert answer.status_code == 500
    assert "secret" not in answer.text


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": TOKEN},
        {"Authorization": "Basic " + TOKEN},
        {"Cookie": "optiplan_token=wrong"},
        {"Cookie": "öö=;;;"},
    ],
)
def test_without_the_token_nothing_is_answered_but_health(headers):
    encoded = {name: value.encode("latin-1") for name, value in headers.items()}
    settings = ServiceSettings(token=TOKEN)
    assert ask(settings, headers=encoded).status_code == 401
    assert ask(settings, path="/healthz", headers=encoded).status_code == 200
    assert ask(settings, path="/metrics", headers=encoded).status_code == 401


@pytest.mark.parametrize(
    "beside", ["", "plain=1; ", 'prefs={"dark": true}; ', "version=2; ", "note=two words; ", "a[b]; "]
)
def test_the_token_passes_as_header_or_cookie(beside):
    """Also beside cookies of other programs on this machine: cookies know no ports."""
    settings = ServiceSettings(token=TOKEN)
    for headers in ({"Authorization": f"Bearer {TOKEN}"}, {"Cookie": f"{beside}optiplan_token={TOKEN}"}):
        assert ask(settings, headers=headers).status_code == 200


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/pages/service.css", "/optiplan/healthz"])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_a_wrong_token_in_an_open_address_earns_no_cookie(method, path):
    for query in ("token=", "token=wrong", f"token={TOKEN}&token=wrong"):
        answer = ask(ServiceSettings(token=TOKEN, root_path="/optiplan"), method, f"{path}?{query}")
        assert answer.status_code == 200
        assert TOKEN not in str(answer.headers)


def test_a_token_in_the_address_becomes_a_cookie():
    answer = ask(ServiceSettings(token=TOKEN), path=f"/studio?token={TOKEN}&a=1")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/studio?a=1"
    assert "HttpOnly" in answer.headers["set-cookie"]
    assert "SameSite=Strict" in answer.headers["set-cookie"]
    assert ask(ServiceSettings(token=TOKEN), "POST", f"/?token={TOKEN}").status_code == 401


def test_a_cookie_that_came_over_tls_never_goes_without():
    async def call(scheme):
        transport = httpx.ASGITransport(Gate(echo, ServiceSettings(token=TOKEN), RequestCounts()))
        async with httpx.AsyncClient(transport=transport, base_url=f"{scheme}://127.0.0.1") as client:
            return (await client.get(f"/?token={TOKEN}")).headers["set-cookie"]

    assert "; Secure" in answer_of(call("https"))
    assert "Secure" not in answer_of(call("http"))


@pytest.mark.parametrize("prefix", ["", "/optiplan"])
def test_below_a_path_of_a_proxy_the_address_and_the_cookie_are_below_it(prefix):
    """Whether the proxy passes its own path on or takes it away."""
    settings = ServiceSettings(token=TOKEN, root_path="/optiplan")
    answer = ask(settings, path=f"{prefix}/studio?token={TOKEN}&a=1")
    assert answer.headers["location"] == "/optiplan/studio?a=1"
    assert "Path=/optiplan" in answer.headers["set-cookie"]
    assert ask(settings, path=f"{prefix}/healthz").status_code == 200
    assert ask(settings, path=f"{prefix}/metrics").status_code == 401


def test_large_bodies_are_refused_whether_they_say_so_or_not():
    settings = ServiceSettings(body=1000)
    assert ask(settings, "POST", content=b"x" * 1000).text == "1000"
    assert ask(settings, "POST", content=b"x" * 1001).status_code == 413

    async def parts():
        for _ in range(11):
            yield b"x" * 100

    assert ask(settings, "POST", content=parts()).status_code == 413
    assert ask(settings, "POST", headers={"Content-Length": "-1"}, content=b"").status_code == 413


async def answers_at_once(scope, receive, send):
    """Reads nothing, as routes that there are not."""
    await send({"type": "http.response.start", "status": 404, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def order_of(settings, parts, headers=(), app=echo, says_length=True):
    """What happens with a request that comes in parts: each part, the head and the end of the answer, its status."""
    order, left = [], list(parts)

    async def receive():
        if not left:
            await asyncio.Event().wait()
        order.append(left.pop(0))
        return {"type": "http.request", "body": order[-1], "more_body": bool(left) or order[-1] == b"never whole"}

    async def send(message):
        if message["type"] == "http.response.start":
            order.append(message["status"])
        elif not message.get("more_body"):
            order.append("end")

    length = (b"content-length", str(sum(map(len, parts))).encode())
    given = [(b"host", b"localhost"), length if says_length else (b"transfer-encoding", b"chunked"), *headers]
    scope = {"type": "http", "method": "POST", "path": "/", "query_string": b"", "headers": given}
    answer_of(Gate(app, settings, RequestCounts())(scope, receive, send))
    return order


@pytest.mark.parametrize(
    ("status", "settings", "headers", "app"),
    [
        (401, {"token": TOKEN}, [], echo),
        (403, {}, [(b"origin", b"https://evil.example")], echo),
        (404, {}, [], answers_at_once),
        (429, {"burst": 0}, [], echo),
        (503, {}, [], echo),
    ],
)
def test_an_answer_begins_once_the_request_has_come(status, settings, headers, app, monkeypatch):
    """A proxy that passes both on at a time would break off the answer."""
    if status == 503:
        monkeypatch.setattr("optiplan.service.guard.gate.MOST_CALLS", 0)
    assert order_of(ServiceSettings(**settings), [b"{", b"}"], headers, app) == [b"{", b"}", status, "end"]


def test_an_answer_waits_for_no_more_than_is_taken():
    settings, parts = ServiceSettings(body=2), [b"ab", b"c", b"d", b"e"]
    assert order_of(settings, parts) == [413, *parts, "end"]
    for app, status in ((echo, 413), (answers_at_once, 404)):
        order = order_of(settings, parts, app=app, says_length=False)
        assert order == [b"ab", b"c", status, b"d", b"e", "end"]


def test_an_answer_does_not_wait_for_ever(monkeypatch):
    monkeypatch.setattr("optiplan.service.guard.gate.LINGER", 0.01)
    order = order_of(ServiceSettings(), [b"never whole"], app=answers_at_once)
    assert order == [b"never whole", 404, "end"]


def test_clients_have_a_rate_each(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("optiplan.service.guard.rates.time.monotonic", lambda: now[0])
    rates = Rates(rate=2.0, burst=3)
    assert [rates.wait("a") for _ in range(3)] == [0.0, 0.0, 0.0]
    assert rates.wait("a") == pytest.approx(0.5)
    assert rates.wait("b") == 0.0
    now[0] = 0.5
    assert rates.wait("a") == 0.0
    assert rates.wait("a") > 0.0


def test_too_many_requests_say_when_to_come_again():
    async def call():
        transport = httpx.ASGITransport(Gate(echo, ServiceSettings(rate=0.1, burst=2), RequestCounts()))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return [await client.get("/") for _ in range(3)]

    answers = answer_of(call())
    assert [answer.status_code for answer in answers] == [200, 200, 429]
    assert int(answers[-1].headers["retry-after"]) >= 1


def test_an_open_address_needs_a_token():
    with pytest.raises(OptiPlanError, match="OPTIPLAN_TOKEN"):
        check_token(ServiceSettings(host="0.0.0.0"))
    with pytest.raises(OptiPlanError, match="at least 16"):
        check_token(ServiceSettings(host="0.0.0.0", token="short"))
    with pytest.raises(OptiPlanError, match="no cookie carries"):
        check_token(ServiceSettings(token="correct horse battery staple"))
    check_token(ServiceSettings(host="0.0.0.0", token=TOKEN))
    check_token(ServiceSettings(host="::1"))


def test_log_lines_are_json_with_the_request(caplog):
    with caplog.at_level("INFO", logger="optiplan.requests"):
        answer = ask(ServiceSettings(), path="/some?secret=1")
    record = next(one for one in caplog.records if one.name == "optiplan.requests")
    line = json.loads(JsonLines().format(record))
    assert line["request_id"] == answer.headers["x-request-id"]
    assert (line["method"], line["path"], line["status"]) == ("GET", "/some", 200)
    assert line["seconds"] > 0.0
    assert "secret" not in json.dumps(line)


def test_the_log_goes_to_standard_error_as_it_is_now(monkeypatch, capsys):
    """A stream that was standard error once and is closed since is no "Logging error"."""
    root, own = logging.getLogger(), logging.getLogger("optiplan")
    handlers, levels = root.handlers[:], (root.level, own.level)
    try:
        with monkeypatch.context() as before:
            closed = StringIO()
            before.setattr(sys, "stderr", closed)
            log_to_stderr("info")
            closed.close()
        logging.getLogger("optiplan.service").warning("here")
    finally:
        root.handlers[:] = handlers
        root.setLevel(levels[0])
        own.setLevel(levels[1])
    (line,) = capsys.readouterr().err.splitlines()
    assert json.loads(line)["message"] == "here"
