"""Where the objects of a task were, and how far from the plan they end."""

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.robot.frames import frame_pose, frame_poses
from optiplan.simulation.log import Log, ObjectLog
from optiplan.simulation.tasks.stages import TaskStage


def object_logs(
    names: Sequence[str], stages: Sequence[TaskStage], poses: Array, entered: Index, log: Log, end: Array
) -> dict[str, ObjectLog]:
    """Return what became of each object.

    Args:
        names: of the m objects.
        stages: of the task.
        poses: (K, m, 7), of every control step.
        entered: (K,), the stage of each.
        log: of the robot, with some of these steps.
        end: (n,), where the plan has the joints at the end, rad or m.
    """
    rows = np.minimum(np.round(log.t / log.dt).astype(np.intp), len(poses) - 1)
    found = {}
    for j, name in enumerate(names):
        planned = _planned(stages[-1], name, end)
        actual = pin.XYZQUATToSE3(poses[-1, j])
        apart = planned.actInv(actual)
        slip = max(_slips(stages, name, poses[rows, j], entered[rows], log.q), default=0.0)
        offset: Array = np.array(actual.translation - planned.translation)
        turn = float(np.linalg.norm(pin.log3(apart.rotation)))
        found[name] = ObjectLog(poses[rows, j], offset, float(np.linalg.norm(offset)), turn, slip)
    return found


def _planned(stage: TaskStage, name: str, q: Array) -> pin.SE3:
    """Return the pose of an object of a scene, with the joints at q (n,)."""
    for body in stage.problem.scene.attached:
        if body.name == name:
            return frame_pose(stage.problem.robot, q, body.link) * body.X_LO
    return next(body.X_WO for body in stage.problem.scene.obstacles if body.name == name)


def _slips(stages: Sequence[TaskStage], name: str, poses: Array, entered: Index, Q: Array) -> Iterator[float]:
    """Return how far an object moved in the link that held it, m, each time that it was held.

    Poses (K, 7), stages (K,) and joints Q (K, n) are of the same times. Fingers hold from the time when they press.
    """
    holder = [{body.name: body.link for body in stage.problem.scene.attached}.get(name, "") for stage in stages]
    for k, stage in enumerate(stages):
        if name in stage.fingers and name not in stage.pressed:
            holder[k] = ""
    links = np.array([holder[k] for k in entered.tolist()])
    cuts = np.flatnonzero(links[1:] != links[:-1]) + 1
    for rows in np.split(np.arange(len(links)), cuts):
        link = str(links[rows[0]])
        if link:
            X = frame_poses(stages[0].problem.robot, Q[rows], link)
            local = np.einsum("kji,kj->ki", X[:, :3, :3], poses[rows, :3] - X[:, :3, 3])
            yield float(np.linalg.norm(local - local[0], axis=1).max())
