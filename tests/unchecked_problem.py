"""Problems for tests whose parts no file could hold, or whose checks would cost more than what is tested."""

from typing import Any

import numpy as np

from optiplan.geometry.scene import Scene
from optiplan.problem.problem import Goal, Objective, Problem
from optiplan.robot.robot import Robot


def unchecked_problem(robot: Robot, start: Any, goal: Goal, **parts: Any) -> Problem:
    """A problem of attributes as they are, without source and hash; those not in `parts` have their defaults."""
    rest = np.zeros(robot.n)
    defaults: dict[str, Any] = {"name": "problem", "scene": Scene(), "limits": robot.limits, "vias": (), "task": ()}
    defaults |= {"objective": Objective(), "path_constraints": (), "planner": "trajopt", "options": {}, "seed": 0}
    defaults |= {"start_velocity": rest, "start_acceleration": rest, "source": {}, "hash": ""}
    return Problem.of(defaults | {"robot": robot, "start": start, "goal": goal} | parts)
