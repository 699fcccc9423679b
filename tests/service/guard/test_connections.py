"""Connections of a server: how long half a request is waited for, how many one client has, what late ones read."""

import socket
import threading
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from urllib.parse import urlsplit

import httpx
import pytest
import uvicorn

from optiplan.service.guard.connections import guarded_protocol, trusted
from optiplan.service.guard.gate import Gate
from optiplan.service.guard.metrics import RequestCounts
from optiplan.service.guard.rates import client_of
from optiplan.service.settings import ServiceSettings
from tests.service.guard.test_gate import echo
from tests.small_problems import NO_WAY
from tests.waiting import PATIENCE

HEAD = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 10\r\n"


@contextmanager
def serving(application=echo, **given):
    """A gate before an application, by default one that echoes; yields its port."""
    settings = ServiceSettings(**given)
    config = uvicorn.Config(
        Gate(application, settings, RequestCounts()), http=guarded_protocol(settings), log_config=None, lifespan="off"
    )
    server, sock = uvicorn.Server(config), socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([sock],), daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield sock.getsockname()[1]
    server.should_exit = True
    thread.join(PATIENCE)
    assert not thread.is_alive()


def read_all(client):
    """What comes until the other side has closed."""
    found = b""
    while part := client.recv(65536):
        found += part
    return found


def connected(port, sent=b""):
    client = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
    client.sendall(sent)
    return client


@pytest.mark.parametrize(
    ("sent", "word"),
    [(b"", b""), (b"GET / HTTP/1.1\r\nHo", b"408"), (HEAD + b"\r\nhalf", b"408")],
)
def test_half_a_request_is_not_waited_for(sent, word):
    with serving(head_time=0.2, body_time=0.2) as port, connected(port, sent) as client:
        assert word in read_all(client).split(b"\r\n")[0]


def test_the_time_of_a_request_does_not_begin_anew_with_each_part():
    with serving(head_time=0.5) as port, connected(port, b"GET / HTTP/1.1\r\n") as client:
        stop = threading.Event()

        def drip():
            while not stop.wait(0.05):
                client.send(b"X: y\r\n")

        thread = threading.Thread(target=drip, daemon=True)
        thread.start()
        try:
            assert b"408" in client.recv(100)
        finally:
            stop.set()
            thread.join()


def test_a_connection_that_is_kept_has_each_request_in_its_own_time():
    with serving(head_time=1.0, body_time=1.0) as port, connected(port) as client:
        for _ in range(2):
            client.sendall(HEAD + b"\r\n01234")
            client.sendall(b"56789")
            answer = b""
            while not answer.endswith(b"0\r\n\r\n"):
                answer += client.recv(65536)
            assert answer.startswith(b"HTTP/1.1 200")
            time.sleep(1.2)  # between requests the time of a kept connection counts
        client.sendall(b"GET /")
        assert b"408" in read_all(client)


def test_one_client_has_so_many_connections_and_others_theirs():
    with serving(connections=3) as port:
        held = [connected(port) for _ in range(3)]
        answers = []
        for _ in range(20):  # until all three are counted
            with connected(port) as client:
                answers.append(read_all(client).split(b"\r\n")[0])
        assert answers[-1] == b"HTTP/1.1 429 Too Many Requests"
        other = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE, source_address=("127.0.0.2", 0))
        other.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        assert read_all(other).startswith(b"HTTP/1.1 200")
        held.pop().close()
        ours = b""
        while not ours.startswith(b"HTTP/1.1 200"):  # its place is free once its end is seen
            with connected(port, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n") as client:
                ours = read_all(client)
        for client in (*held, other):
            client.close()


def test_connections_through_a_proxy_are_not_counted():
    with serving(connections=1, proxies=("127.0.0.0/8",)) as port:
        held = [connected(port) for _ in range(3)]
        with connected(port, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n") as client:
            assert read_all(client).startswith(b"HTTP/1.1 200")
        for client in held:
            client.close()


@pytest.mark.parametrize("size", [2_000_000, 50_000_000])
def test_who_still_sends_reads_that_the_body_is_too_large(size):
    """Python's urllib sends the whole body before it reads, on a connection that is to be closed."""
    with serving(body=1_000_000) as port:
        for path in ("", "broken"):
            request = urllib.request.Request(f"http://127.0.0.1:{port}/{path}", data=b"x" * size)
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request, timeout=PATIENCE)
            assert refused.value.code == 413
            assert b"too large" in refused.value.read()


def test_who_still_sends_reads_every_other_refusal():
    with serving(token="0123456789abcdef0123") as port:
        request = urllib.request.Request(f"http://127.0.0.1:{port}/", data=b"x" * 4_000_000)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=PATIENCE)
        assert refused.value.code == 401


def test_who_asks_before_sending_is_answered_without_the_body():
    with serving(body=1000) as port:
        head = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5000\r\nExpect: 100-continue\r\n\r\n"
        with connected(port, head) as client:
            assert client.recv(65536).startswith(b"HTTP/1.1 413")


def test_a_client_is_an_address_or_of_ipv6_its_network():
    assert client_of("10.0.0.1") == client_of("::ffff:10.0.0.1") == "10.0.0.1"
    assert client_of("2001:db8::1") == client_of("2001:db8::ffff") != client_of("2001:db8:0:1::1")
    assert client_of("fe80::1%eth0") == client_of("fe80::2")
    assert client_of("testclient") == "testclient"
    assert trusted("10.1.2.3", ("10.0.0.0/8",))
    assert not trusted("11.1.2.3", ("10.0.0.0/8", "::1"))
    assert not trusted("local", ("10.0.0.0/8",))


def test_a_body_that_grows_too_large_is_told_so_by_every_route(server):
    def parts():
        for _ in range(60):
            yield b"x" * 100_000

    for path in ("/api/runs", "/api/problems/validate", "/api/uploads/large.stl"):
        method = "PUT" if "uploads" in path else "POST"
        answer = server.http.request(method, path, content=parts(), headers={"Content-Type": "application/json"})
        assert answer.status_code == 413, answer.text


def test_the_head_of_everything_that_can_be_got(server):
    run = server.ended(server.submit(seed=901)["id"])["id"]
    paths = ["/", "/studio", "/cell.py", "/healthz", "/metrics", "/openapi.json", "/api/runs", "/api/robots/panda"]
    paths += [f"/api/runs/{run}{what}" for what in ("", "/run.json", "/run.zip", "/export.csv", "/events")]
    for path in paths:
        head, whole = server.http.head(path), server.http.get(path)
        assert (head.status_code, head.content) == (200, b""), path
        assert head.headers["content-type"] == whole.headers["content-type"]
        if "content-length" in whole.headers and path not in ("/metrics", "/api/runs"):
            assert head.headers["content-length"] == whole.headers["content-length"]
    assert server.http.head("/api/runs/" + "0" * 32).status_code == 404
    assert server.http.head("/api/plan").status_code == 405


def test_the_head_of_a_stream_ends(server):
    run = server.submit(problem=NO_WAY, budget=60.0, seed=902)["id"]
    assert server.http.head(f"/api/runs/{run}/events").headers["content-type"].startswith("text/event-stream")
    server.http.post(f"/api/runs/{run}/cancel")
    server.ended(run)


def test_connections_that_ask_for_a_websocket_are_counted_until_they_close(server):
    """uvicorn itself would take them over; pages of any origin may open them, so they could shut everybody out."""
    asked = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade, close\r\nUpgrade: websocket\r\n"
    asked += b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    port = urlsplit(server.url).port
    for _ in range(server.service.settings.connections + 10):
        with connected(port, asked) as client:
            client.recv(100)
    assert httpx.get(f"{server.url}/healthz", trust_env=False).status_code == 200


def test_refused_clients_that_are_gone_already_leave_no_error_behind(caplog):
    """Each left a traceback in the log: a client could fill the disk with them."""

    async def busy(scope, receive, send):
        time.sleep(0.5)  # until then nobody is let in
        await echo(scope, receive, send)

    with serving(busy, connections=1) as port, connected(port, HEAD + b"\r\n" + 10 * b"x") as first:
        time.sleep(0.1)
        for _ in range(20):
            connected(port).close()
        assert first.recv(65536).startswith(b"HTTP/1.1 ")
        with connected(port) as last:
            assert read_all(last).startswith(b"HTTP/1.1 429 ")
    assert [one.getMessage() for one in caplog.records if one.name == "asyncio"] == []
