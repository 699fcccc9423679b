"""The interface is what its OpenAPI document says, whatever is sent: held against it by schemathesis."""

import json

import pytest
from hypothesis import HealthCheck, given, settings

EXAMPLES = 8
"""Requests of each route."""


def test_every_route_keeps_its_word(server):
    schemathesis = pytest.importorskip("schemathesis")  # not while tests are collected: each worker would load it
    checks = pytest.importorskip("schemathesis.specs.openapi.checks")
    interface = schemathesis.openapi.from_url(f"{server.url}/openapi.json")
    interface.config.generation.update(codec=None)  # all that UTF-8 encodes, too, without asking each character first
    tried, broken = 0, []
    for found in interface.get_all_operations():
        route = found.ok()

        @settings(max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck))
        @given(case=route.as_strategy())
        def keeps_its_word(case):
            case.call_and_validate(timeout=60.0, excluded_checks=[checks.positive_data_acceptance])

        try:
            keeps_its_word()
        except (Exception, BaseExceptionGroup) as error:  # all routes are tried
            broken.append(f"{route.label}: {error}\n{[str(one) for one in getattr(error, 'exceptions', ())]}")
        tried += 1
    assert not broken, "\n".join(broken)
    assert tried > 20


def test_every_route_and_field_is_described(server):
    document = server.http.get("/openapi.json").json()
    for path, methods in document["paths"].items():
        for method, route in methods.items():
            assert route.get("description") or route.get("summary"), f"{method} {path}"
    assert "/api/runs" in document["paths"]
    assert "/api/plan" in document["paths"]
    assert "https://" not in json.dumps(document)
