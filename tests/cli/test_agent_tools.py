"""The tools for agents, called by MCP's own client."""

import json
import sys

import pytest

from optiplan.cli.agent_tools import agent_server
from optiplan.errors import OptiPlanError
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import answer_of


@pytest.fixture(scope="module")
def answers(tmp_path_factory) -> dict:
    """What the tools answer, asked by MCP's client over one connection in memory."""
    mcp = pytest.importorskip("mcp")  # not while tests are collected: each worker would load it
    folder = tmp_path_factory.mktemp("runs") / "kept"
    asked = {
        "robots": ("list_robots", {}),
        "good": ("check_problem", {"problem": QUICK}),
        "bad": ("check_problem", {"problem": QUICK.replace("planar2r", "planar3r")}),
        "plan": ("plan", {"problem": QUICK, "samples": 10, "out": str(folder)}),
        "nowhere": ("plan", {"problem": QUICK, "out": ""}),
        "example": ("plan", {"problem": "19_lspb"}),
        "wrong": ("plan", {"problem": "robot: panda\n"}),
        "code": ("plan", {"problem": QUICK, "planner": "os:system"}),
        "own code": ("explain_failure", {"problem": QUICK.replace("quintic", "{name: 'os:system'}")}),
        "failure": ("explain_failure", {"problem": NO_WAY.replace("rrtconnect", "quintic"), "budget": 2.0}),
    }

    async def ask() -> dict:
        async with mcp.Client(agent_server()) as client:
            found = {"tools": await client.list_tools(), "schema": await client.read_resource("optiplan://schema")}
            for name, (tool, arguments) in asked.items():
                found[name] = json.loads((await client.call_tool(tool, arguments)).content[0].text)
            refused = await client.call_tool("plan", {"problem": QUICK, "budget": 1e6})
            return found | {"refused": refused, "folder": folder}

    return answer_of(ask())


def test_the_client_lists_tools_with_their_arguments(answers):
    tools = {tool.name: tool for tool in answers["tools"].tools}
    assert set(tools) == {"list_robots", "check_problem", "plan", "explain_failure", "render_picture"}
    budget = tools["plan"].input_schema["properties"]["budget"]
    assert budget["description"] == "time for planning, s"
    assert json.loads(answers["schema"].contents[0].text)["properties"]["robot"]


def test_problems_are_checked_and_planned(answers):
    assert "panda" in answers["robots"]["robots"]
    assert "trajopt" in answers["robots"]["planners"]
    assert answers["good"] == {"valid": True, "issues": [], "name": "free", "robot": "planar2r"}
    assert answers["bad"]["issues"][0]["line"] == 3
    assert answers["plan"]["verified"] is True
    assert answers["plan"]["motion"]["q"][-1] == pytest.approx([-0.5, 1.2])
    assert (answers["folder"] / "run.json").exists()
    assert answers["nowhere"]["issues"][0]["field"] == "out"
    assert answers["example"]["verified"] is True
    assert answers["wrong"]["verified"] is False
    assert any(issue["field"] == "version" for issue in answers["wrong"]["issues"])
    for name in ("code", "own code"):
        assert answers[name]["issues"][0]["found"] == "unknown planner 'os:system'"
    assert answers["refused"].is_error


def test_a_failure_is_explained(answers):
    told = answers["failure"]
    assert told["verified"] is False
    assert "ceiling" in told["explanation"]


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mcp.server", None)
    with pytest.raises(OptiPlanError, match=r"pip install 'optiplan\[agents\]'"):
        agent_server()
