"""Problems made from problems: the source is changed and read again, so that it always says what the problem is."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.problem.load import problem_from_dict, scaled_limits
from optiplan.problem.problem import Problem
from optiplan.problem.spec import LimitsSpec
from optiplan.problem.to_data import goal_data, scene_data, via_data


def derived(problem: Problem, changes: Mapping[str, Any]) -> Problem:
    """The problem with other parts, each of which has a `with_…` in `Problem`; its planner and seed stay.

    A problem without a source gets none.

    Raises:
        InputError: what a file with these parts would be refused for.
    """
    if not problem.source:
        limits = changes.get("limits")
        own = {} if limits is None else {"limits": scaled_limits(problem.robot.limits, LimitsSpec(**limits))}
        return replace(problem, **{**changes, **own})
    data = dict(problem.source) | {_KEYS.get(part, part): _DATA[part](value) for part, value in changes.items()}
    made = problem_from_dict(data, "/", lambda *_: problem.robot)
    return made.with_seed(problem.seed)


_KEYS = {"vias": "via"}
_DATA: dict[str, Callable[[Any], Any]] = {
    "start": lambda start: {"joints": np.asarray(start, dtype=float).tolist()},
    "goal": goal_data,
    "vias": via_data,
    "scene": scene_data,
    "limits": dict,
}
