"""`TaskCourse`: a task while a closed loop runs; it takes, releases, and keeps where the objects are."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.robot.frames import frame_pose, frame_poses
from optiplan.simulation.contacts import ContactWatch
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.log import Log, ObjectLog
from optiplan.simulation.plants.base import Payload, assumed_dynamics
from optiplan.simulation.plants.task_plant import TaskPlant
from optiplan.simulation.tasks.stages import TaskStage, stage_at


class Course:
    """What happens to objects while a loop runs: nothing."""

    def enter(self, t: Array, watch: ContactWatch | None) -> Array:
        """Begin what begins at the first of times t (K,), s; return the first of them, up to the next change."""
        return t

    def add(self) -> None:
        """Note the present state of the plant."""


NOTHING_HELD = Course()


class TaskCourse(Course):
    """Leads plant, controller and watch through the stages of a task.

    Attributes:
        places: of the reference on the path, s, at times (K,), s; at first those of the plan.
    """

    def __init__(
        self,
        stages: Sequence[TaskStage],
        names: Sequence[str],
        plant: TaskPlant,
        controller: ComputedTorque,
        payload: Payload | None = None,
    ) -> None:
        """Begin before the first stage.

        Args:
            stages: of the task, in order.
            names: of its objects.
            plant: with the objects.
            controller: that knows the loads of the plan.
            payload: at the tool, beside them.
        """
        self._stages, self._names, self._plant = stages, names, plant
        self._controller, self._payload = controller, payload
        self._now, self._done = -1, -1
        self._poses: list[Array] = []
        self._entered: list[int] = []
        self._load = 0.0
        self.places: Callable[[Array], Array] = np.asarray

    def enter(self, t: Array, watch: ContactWatch | None) -> Array:
        """Begin the stage of the first of times t (K,), s; return those that lie in it.

        What was taken or released once is not again, when the robot goes back behind it.
        """
        found = stage_at(self._stages, self.places(t))
        k = int(found[0])
        if k != self._now:
            stage = self._stages[k]
            actions = [action for one in self._stages[self._done + 1 : k + 1] for action in one.actions]
            self._now, self._done = k, max(self._done, k)
            self._plant.enter(stage, actions)
            self._controller.carry(assumed_dynamics(stage.problem.robot, self._payload))
            if watch is not None:
                watch.enter(stage.problem.robot, stage.problem.scene, stage.begin)
        later = np.flatnonzero(found != k)
        return t[: later[0]] if len(later) else t

    def add(self) -> None:
        """Note where the objects are."""
        self._poses.append(self._plant.objects())
        self._load = max(self._load, self._plant.grip_load())
        self._entered.append(self._now)

    def finished(self, log: Log, end: Array, by_friction: bool) -> Log:
        """Return a log with the objects; the plan has the joints at `end` (n,), rad or m, at the end."""
        poses, entered = np.array(self._poses), np.array(self._entered, np.intp)
        objects = object_logs(self._names, self._stages, poses, entered, log, end)
        return replace(log, objects=objects, slip_margin=1.0 - self._load if by_friction else None)


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
