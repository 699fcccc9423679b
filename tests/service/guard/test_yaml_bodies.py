"""Problem files as bodies of requests: whole, or not at all."""

import pytest

from optiplan.service.guard.yaml_bodies import YamlBodies
from optiplan.service.refusals import Refusal
from tests.waiting import answer_of


@pytest.mark.parametrize(
    ("query", "content", "word"),
    [
        ("", "name: Tür".encode("latin-1"), "body: found byte 0xfc at offset 7; expected UTF-8 text"),
        ("?problem=x", b"", "in the query"),
    ],
)
def test_the_body_is_the_problem_and_utf_8(server, query, content, word):
    answer = server.http.post(f"/api/runs{query}", content=content, headers={"Content-Type": "application/yaml"})
    assert answer.status_code == 422
    assert word in answer.json()["error"]


def test_half_a_file_is_no_problem():
    """What has come may be a problem of its own, one without its last obstacles."""
    sent = [{"type": "http.request", "body": b"version: 1\n", "more_body": True}, {"type": "http.disconnect"}]
    passed_on = []

    async def application(scope, receive, send):
        passed_on.append(scope)

    async def receive():
        return sent.pop(0)

    async def send(message):
        raise AssertionError(message)

    headers = [(b"content-type", b"application/yaml")]
    scope = {"type": "http", "method": "POST", "path": "/api/runs", "query_string": b"", "headers": headers}
    with pytest.raises(Refusal, match="broke off"):
        answer_of(YamlBodies(application)(scope, receive, send))
    assert not passed_on
