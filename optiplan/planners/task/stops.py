"""Where a task stops, and why it must."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from optiplan.planners.task.chains import Done
from optiplan.planners.task.stretches import Stretch
from optiplan.problem.task.steps import Attach, Detach, Dwell, Move

NOT_QUICKER = "no motion without this stop was found that is free and quicker"
CORNER = "a corner of two lines: with `blend` it is passed"


def why_stop(before: Done, after: Done) -> str | None:
    """Return why the arm must rest between two steps; None where it need not."""
    for one in (before, after):
        action = one.step.action
        if isinstance(action, Attach | Detach | Dwell) or one.step.kind == "gripper":
            return one.step.name
        if one.stage is None or one.curve is None:
            return one.step.name
        if one.stage.problem.moving_start:
            return "the move that takes a motion over ends at rest"
        if isinstance(action, Move) and action.vias:
            return "a move with via points begins and ends at rest"
    assert before.stage is not None
    assert after.stage is not None
    if before.stage.columns != after.stage.columns:
        return "other joints go on"
    return CORNER if before.is_line and after.is_line else None


def stops_of(stretches: Sequence[Stretch]) -> list[dict[str, Any]]:
    """Return every stop between the first and the last motion: its time, s, the step that it follows, and why."""
    found: list[dict[str, Any]] = []
    begin = 0.0
    for before, after in pairwise(stretches):
        begin += before.ends[-1]
        a, b = before.done[-1], after.done[0]
        why = why_stop(a, b) or NOT_QUICKER
        if found and found[-1]["t"] == begin:
            found[-1]["why"] += f", {why}" if why not in found[-1]["why"] else ""
        else:
            found.append({"t": begin, "after": a.step.number, "why": why})
    return found
