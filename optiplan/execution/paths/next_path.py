"""The path that is to take over from the one that is executed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from optiplan.errors import OptiPlanError
from optiplan.execution.arguments import SAME_STATE, same_state
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.execution.scene.policy import Policy
from optiplan.execution.scene.scene_watch import SceneWatch
from optiplan.robot.robot import Robot
from optiplan.runs.run import Run
from optiplan.trajectory.state import State


class NextPath(NamedTuple):
    """The path that is to take over at `then`, s.

    `number`: of the planning process; 0: it is from `splice`. `watch`: of the path, where it is made already.
    """

    then: float
    path: ProvedPath
    watch: SceneWatch | None = None
    number: int = 0


def spliced_path(
    given: Run | ProvedPath,
    current: Run,
    states: Sequence[tuple[float, State]],
    standing: State | None,
    now: float,
    policy: Policy,
    *,
    at_rest_only: bool = False,
) -> NextPath | str:
    """Return the path of a run that is to take over; or why it cannot.

    Args:
        given: run that is to take over, or its path.
        current: that is executed.
        states: on the way, with their times, s, in which it may begin.
        standing: where the robot stands still from now on; None where it does not.
        now: s.
        policy: what is done where its path is blocked.
        at_rest_only: beside people.
    """
    try:
        path = given if isinstance(given, ProvedPath) else ProvedPath(given, "Executor.splice")
    except OptiPlanError as error:
        return f"the motion that was to take over: {error}"
    run = path.run
    if not _same_robot(run.problem.robot, current.problem.robot):
        return "the motion that was to take over is of another robot"
    refused = policy.refused(run.problem)
    if refused:
        return f"the motion that was to take over is a run of {refused}, which is not replanned"
    if at_rest_only and (standing is None or not path.starts_at_rest):
        return "beside people a motion takes over only where the robot stands still"
    start = run.problem.start_state
    found = [then for then, state in states if same_state(state, start)]
    if standing is not None and same_state(standing, start):
        found = [max([now, *found[-1:]])]  # it stays in that state
    if not found:
        return "the motion that was to take over begins in a state that is not on the way"
    then = found[-1]
    if then < now:
        return f"the motion that was to take over came {now - then:.3f} s late"
    return NextPath(then, path)


def _same_robot(one: Robot, other: Robot) -> bool:
    """Whether two robots are one, mounted alike, whatever they hold."""
    first, second = ((robot.fingerprint, robot.joint_names, dict(robot.locked)) for robot in (one, other))
    a, b = one.mounting, other.mounting
    mounts = (a.X_WB.homogeneous, b.X_WB.homogeneous), (a.gravity, b.gravity)
    return first == second and all(np.allclose(x, y, rtol=0.0, atol=SAME_STATE) for x, y in mounts)
