"""A problem in one line, and as a small table for notebooks."""

import html
from typing import TYPE_CHECKING

from optiplan.problem.goals_and_vias import JointGoal, PoseGoal

if TYPE_CHECKING:
    from optiplan.problem.problem import Problem


def in_one_line(problem: "Problem") -> str:
    """Return name, robot, goal and scene."""
    past = f" past {len(problem.vias)} points" if problem.vias else ""
    return f"Problem: {problem.name}, {problem.robot.name}, to {_end(problem)}{past}; {_around(problem)}"


def as_table(problem: "Problem") -> str:
    """Return the same with the start and the hash, as HTML."""
    rows = {
        "robot": f"{problem.robot.name}, {problem.robot.n} joints",
        "start": ", ".join(f"{q:.4g}" for q in problem.start),
        "goal": _end(problem),
        "via points": len(problem.vias) or "",
        "scene": _around(problem),
        "hash": f"{problem.hash:.12}",
    }
    cells = "".join(f"<tr><th>{key}</th><td>{html.escape(str(v))}</td></tr>" for key, v in rows.items() if v)
    return f"<table><caption>Problem: {html.escape(problem.name)}</caption>{cells}</table>"


def _end(problem: "Problem") -> str:
    """Return the goal in words."""
    if problem.task:
        return f"do {problem.task[-1].number} steps"
    if len(problem.goal) != 1:
        return f"any of {len(problem.goal)} ends"
    goal = problem.goal[0]
    if isinstance(goal, JointGoal):
        return "a configuration"
    return f"a {'pose' if isinstance(goal, PoseGoal) else 'region'} of {goal.frame}"


def _around(problem: "Problem") -> str:
    return str(problem.scene).removeprefix("Scene: ")
