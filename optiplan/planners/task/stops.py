"""Where a task stops, and why it must."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from optiplan.planners.task.planned_steps import PlannedMotion, PlannedStep, TaskPart
from optiplan.planners.task.smooth_runs import is_rounded
from optiplan.problem.problem import JointGoal
from optiplan.problem.seams.actions import Passing, SeamPart, Transit
from optiplan.problem.task.steps import Action, Move, StraightLine

NOT_QUICKER = "no motion without this stop was found that is free and quicker"
CORNER = "an exact corner of two lines (`blend` rounds it off)"
BACK = "a line straight back"
NO_WAY = "a corner of two lines whose blend is not free, or of a line that only turns"
BENT = "a corner of two lines that the arm cannot pass smoothly"

_BACK = -0.99
"""Cosine of the angle between two lines, in the joints' space, below which the second one leads back."""


def why_stop(before: PlannedStep, after: PlannedStep) -> str | None:
    """Return why the arm must rest between two steps; None where it need not."""
    own = _why_rest(before) or _why_rest(after)
    if own or not isinstance(before, PlannedMotion) or not isinstance(after, PlannedMotion):
        return own
    if before.stage.columns != after.stage.columns:
        return "other joints go on"
    if after.step.waits:
        return "a step that may wait for another arm"
    if not (before.is_line and after.is_line) or is_rounded(before, after):
        return None
    if before.corner is not None:
        return BENT
    if _leads_back(before, after):
        return BACK
    action = before.step.action
    return NO_WAY if isinstance(action, StraightLine) and action.blend else CORNER


def _why_rest(planned: PlannedStep) -> str | None:
    """Return why the arm rests before and after a step, whatever the others are."""
    action, name = planned.step.action, planned.step.name
    if not isinstance(planned, PlannedMotion) or planned.step.kind == "gripper":
        return name
    if isinstance(action, Passing | SeamPart | Transit):
        return "a path of the tool begins and ends at rest"
    if planned.stage.problem.moving_start:
        return "the move that takes a motion over ends at rest"
    if ends_in_motion(action):
        return "the move that ends in motion begins at rest"
    if isinstance(action, Move) and action.rests:
        return f"the target {name}"
    if isinstance(action, Move) and action.vias:
        return "a move with via points begins and ends at rest"
    still = not planned.curve.coefficients[:, 1:].any()
    return f"{name}: it is there already" if still else None


def ends_in_motion(action: Action) -> bool:
    """Whether a step ends with a stated velocity or acceleration."""
    return isinstance(action, Move) and any(isinstance(end, JointGoal) and end.moving for end in action.goal)


def _leads_back(before: PlannedMotion, after: PlannedMotion) -> bool:
    """Whether a line goes back along the one before it, in the joints' space."""
    speed = before.stage.problem.limits.velocity
    a, b = before.curve(before.curve.duration, 1) / speed, after.curve(0.0, 1) / speed
    return bool(a @ b < _BACK * np.linalg.norm(a) * np.linalg.norm(b))


def stops_of(parts: Sequence[TaskPart]) -> list[dict[str, Any]]:
    """Return the stops on the way: time `t`, s, the step that each comes `after`, and `why`."""
    found: list[dict[str, Any]] = []
    begin = 0.0
    for before, after in pairwise(parts):
        begin += before.duration
        a, b = before.steps[-1], after.steps[0]
        why = why_stop(a, b) or NOT_QUICKER
        if found and found[-1]["t"] == begin:
            found[-1]["why"] += f", {why}" if why not in found[-1]["why"] else ""
        else:
            found.append({"t": begin, "after": a.step.number, "why": why})
    return found
