"""Small runs to be recorded, planned once."""

from functools import cache
from pathlib import Path

import optiplan as op
from optiplan.config.document import parse_yaml
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.viewer.runs import ViewedRun
from tests.small_problems import QUICK


def viewed(run: op.Run) -> ViewedRun:
    record = run.to_dict()
    return ViewedRun(run.planner, run.trajectory, record["report"], record["failure"], record)


def planned(obstacles: list | None = None) -> tuple[Problem, ViewedRun]:
    """The quick problem of the service's tests, or it among other obstacles."""
    stated = parse_yaml(QUICK.replace("far", "ball"), Path("quick.yaml")).data
    problem = problem_from_dict(stated if obstacles is None else {**stated, "scene": {"obstacles": obstacles}})
    return problem, viewed(op.plan(problem))


@cache
def attached_run() -> tuple[Problem, ViewedRun]:
    """A task that takes a cube and moves it."""
    task = [{"attach": {"object": "cube", "link": "forearm"}}, {"move": {"joints": [0.0, 1.2]}}]
    cube = {"name": "cube", "shape": {"box": [0.05, 0.05, 0.05]}, "pose": {"position": [0.0, 0.8, 1.0]}}
    stated = {"version": 1, "name": "takes", "robot": "planar2r", "start": {"joints": [0.5, 1.0]}}
    problem = op.load_problem(stated | {"scene": {"obstacles": [cube]}, "task": task})
    return problem, viewed(op.plan(problem))
