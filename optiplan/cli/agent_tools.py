"""The planner as tools for agents, by the Model Context Protocol: what can be asked, and answers as plain data."""

import json
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

import optiplan as op
from optiplan.config.document import parse_yaml
from optiplan.errors import InputError, Issue, OptiPlanError, path_argument
from optiplan.planners.registry import PLANNERS
from optiplan.problem.from_data import read_problem
from optiplan.problem.problem import Problem
from optiplan.problem.schema.problem import problem_schema
from optiplan.runs.run import Run
from optiplan.runs.run_folder import check_folder
from optiplan.verify.report import jsonable

MOST_BUDGET = 120.0
"""s of one plan."""
MOST_SAMPLES = 2000
"""Rows of a motion in one answer."""
ABOUT = """OptiPlan plans robot motions that are proved collision-free and within limits at all times.
Read the resource optiplan://schema, write a problem as YAML, mend it with check_problem, then plan it.
Only `verified: true` is a proof; explain_failure tells what is in the way."""

Text = Annotated[str, Field(description="a problem as YAML text, or the name of a bundled example, such as 02_shelf")]
Budget = Annotated[float, Field(gt=0, le=MOST_BUDGET, description="time for planning, s")]


def agent_server() -> Any:
    """Return the server of the tools, ready to `run`.

    Raises:
        OptiPlanError: the package `mcp` is not installed.
    """
    try:
        from mcp.server import MCPServer
    except ImportError as error:
        raise OptiPlanError("tools for agents need the package mcp: pip install 'optiplan[agents]'") from error
    server = MCPServer("optiplan", instructions=ABOUT, version=op.__version__)
    for tool in (list_robots, check_problem, plan, explain_failure, render_picture):
        server.tool(structured_output=False)(tool)
    server.resource("optiplan://schema", mime_type="application/schema+json", name="JSON schema of a problem")(schema)
    return server


def schema() -> str:
    """JSON schema of a problem file, with the meaning of its parts."""
    return json.dumps(problem_schema(), indent=1)


def list_robots() -> str:
    """List the bundled robots, the planners and the example problems, each with what it is."""
    return _answer({"robots": dict(op.robots()), "planners": dict(op.planners()), "examples": dict(_examples())})


def check_problem(problem: Text) -> str:
    """Find everything that is wrong with a problem: line, field, what was found and what would be valid."""
    try:
        stated = _problem(problem)
    except InputError as error:
        return _answer({"valid": False, "issues": [vars(issue) for issue in error.issues]})
    return _answer({"valid": True, "issues": [], "name": stated.name, "robot": stated.robot.name})


def plan(
    problem: Text,
    budget: Budget = 10.0,
    planner: Annotated[str | None, Field(description="another planner than the problem's; see list_robots")] = None,
    samples: Annotated[float, Field(ge=0, le=500, description="rows of the motion a second; 0: none")] = 0.0,
    out: Annotated[str | None, Field(description="folder to keep the run in, for `optiplan view`")] = None,
) -> str:
    """Plan a motion and prove it: duration, s, every check of the proof, and the motion sampled if asked for."""
    try:
        if out is not None:  # before anything is planned
            check_folder(path_argument("plan", "out", out, "the path of a folder"))
    except InputError as error:
        return _refused(error)
    run = _planned(problem, budget, planner)
    if isinstance(run, str):
        return run
    told = _told(run)
    if run.trajectory is not None and samples > 0.0:
        duration = run.trajectory.duration
        count = min(MOST_SAMPLES, max(2, int(np.ceil(samples * duration)) + 1))
        rows = run.trajectory.sampled(np.linspace(0.0, duration, count))
        told["motion"] = {"joint_names": list(run.trajectory.joint_names), "t": rows["t"], "q": rows["q"]}
    if out is not None:
        try:
            run.save(out)
            told["folder"] = out
        except InputError as error:  # costs the folder, not the run
            told["issues"] = [vars(issue) for issue in error.issues]
    return _answer(told)


def explain_failure(problem: Text, budget: Budget = 10.0) -> str:
    """Plan a problem and say why no motion is verified: the reason, the bodies or joints, where, by how much."""
    run = _planned(problem, budget, None)
    if isinstance(run, str):
        return run
    if run.report is not None and run.report.verified:
        return _answer({"verified": True, "explanation": "this problem has a verified motion; see plan"})
    told = _told(run)
    words = [] if run.failure is None else [f"{run.failure.kind}: {run.failure.detail}"]
    if run.report is not None:
        words += [f"{check.name}: {check.detail or check.place}" for check in run.report.checks if not check.passed]
    witness = {} if run.failure is None else {k: v for k, v in run.failure.witness.items() if k in WITNESS}
    return _answer(told | {"explanation": "; ".join(words), "witness": witness})


WITNESS = ("pair", "distance", "q", "t", "joint", "value", "limit", "position_error", "orientation_error", "points")
"""What an agent can use of a failure's witness."""


def render_picture(problem: Text, budget: Budget = 10.0) -> Any:
    """Draw the scene of a problem with the path of its tool: a PNG where chromium is installed, else an SVG as text."""
    from optiplan.viewer.pictures import browser_program
    from optiplan.viewer.thumbnail import scene_picture

    run = _planned(problem, budget, None)
    if isinstance(run, str):
        return run
    if browser_program():
        from mcp.server.mcpserver import Image

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.png"
            if _png(run, path):
                return Image(data=path.read_bytes(), format="png")
    return scene_picture(run.problem, run.trajectory)


def _png(run: Run, path: Path) -> bool:
    """Whether a picture of the page could be written."""
    from optiplan.viewer.page import render_page
    from optiplan.viewer.pictures import save_picture
    from optiplan.viewer.runs import ViewedRun
    from optiplan.viewer.scene import build_scene

    try:
        save_picture(render_page(build_scene(run.problem, [ViewedRun.of(run)])), path, "t=0.5&paused", (960, 640))
    except OptiPlanError:  # no playwright: the drawing does as well
        return False
    return True


def _examples() -> list[tuple[str, str]]:
    from optiplan.resources import problems_dir

    found = []
    for path in sorted(problems_dir().glob("*.yaml")):
        first = path.read_text("utf-8").split("\n", 1)[0]
        found.append((path.stem, first.lstrip("# ") if first.startswith("#") else ""))
    return found


def _problem(text: str, planner: str | None = None) -> Problem:
    """Return the problem of a text or of an example, for a planner, or else its own.

    Raises:
        InputError: the problem has an error, or the planner is not a bundled one.
    """
    if "\n" not in text.strip() and ":" not in text:
        problem = op.load_problem(text.strip())
    else:
        problem = Problem.of(read_problem(parse_yaml(text, Path("problem.yaml")), Path.cwd()))
    name = problem.planner if planner is None else planner
    if name not in PLANNERS:  # `module:Class` would run the agent's choice of code
        raise InputError([Issue("plan", None, "planner", f"unknown planner '{name}'", ", ".join(PLANNERS))])
    return problem


def _planned(text: str, budget: float, planner: str | None) -> Run | str:
    """Return the run, or the answer that says what is wrong with the input."""
    try:
        return op.plan(_problem(text, planner), planner, budget=budget)
    except InputError as error:
        return _refused(error)


def _refused(error: InputError) -> str:
    return _answer({"verified": False, "issues": [vars(issue) for issue in error.issues]})


def _told(run: Run) -> dict[str, Any]:
    record = run.to_dict()
    checks = [] if run.report is None else record["report"]["checks"]
    keys = ("name", "passed", "kind", "worst", "limit", "unit", "place", "time")
    return {
        "verified": bool(run.report is not None and run.report.verified),
        "planner": run.planner,
        "duration": None if run.trajectory is None else run.trajectory.duration,
        "failure": None if run.failure is None else {"kind": run.failure.kind, "detail": run.failure.detail},
        "checks": [{key: check.get(key) for key in keys} for check in checks],
        "metrics": record.get("metrics"),
        "timings": record.get("timings"),
    }


def _answer(data: dict[str, Any]) -> str:
    return json.dumps(jsonable(data), allow_nan=False)
