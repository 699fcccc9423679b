"""The path that is to take over from the one that is executed."""

from collections.abc import Sequence
from typing import NamedTuple

from optiplan.errors import OptiPlanError
from optiplan.execution.arguments import same_state
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.execution.scene.scene_watch import SceneWatch
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
    rests: float,
    now: float,
    *,
    at_rest_only: bool = False,
) -> NextPath | str:
    """Return the path of a run that is to take over; or why it cannot.

    Args:
        given: run that is to take over, or its path.
        current: that is executed.
        states: on the way, with their times, s, in which it may begin.
        rests: s, from when on the robot stands still.
        now: s.
        at_rest_only: beside people.
    """
    try:
        path = given if isinstance(given, ProvedPath) else ProvedPath(given, "Executor.splice")
    except OptiPlanError as error:
        return f"the motion that was to take over: {error}"
    run = path.run
    if run.problem.robot.joint_names != current.problem.robot.joint_names:
        return "the motion that was to take over is of another robot"
    if at_rest_only and rests > now:
        return "beside people a motion takes over only where the robot stands still"
    start = run.problem.start_state
    found = [then for then, state in states if same_state(state, start)]
    if not found:
        return "the motion that was to take over begins in a state that is not on the way"
    then = max(found[-1], now) if rests <= found[-1] else found[-1]  # at rest it is in that state for ever
    if then < now:
        return f"the motion that was to take over came {now - then:.3f} s late"
    return NextPath(then, path)
