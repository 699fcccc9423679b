"""Problem files as bodies of requests: whole, or not at all."""

import pytest

from optiplan.service.guard.yaml_bodies import YamlBodies
from optiplan.service.refusals import Refusal
from tests.waiting import answer_of


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
