"""A path of the tool as steps: to it, along it from event to event, and away from it."""

from collections.abc import Iterator
from dataclasses import replace

from optiplan.problem.seams.actions import Passing, SeamPart, SeamPath, Transit
from optiplan.problem.task.steps import TaskStep
from optiplan.trajectory.segments import ON_PATH, PASSING

APPROACH, RUN_IN, RUN_OUT = "to the path", "run in", "run out"
"""Names of the motions to the path and away from it."""


def seam_steps(step: TaskStep, path: SeamPath) -> Iterator[TaskStep]:
    """Yield the steps of a path: an approach, a run-in, the parts with the events between them, and a run-out.

    The step's constraints hold along the path itself.
    """
    free = replace(step, kind=ON_PATH, action=Transit(path.joints), constraints=())
    yield replace(free, name=APPROACH)
    yield replace(free, name=RUN_IN)
    for k, (low, high) in enumerate(path.parts()):
        if k > 0:
            event = path.events[k - 1]
            yield replace(step, kind=PASSING, name=event.name, action=Passing(path, event.at), constraints=())
        yield replace(step, kind=ON_PATH, action=SeamPart(path, low, high))
    yield replace(free, name=RUN_OUT)
