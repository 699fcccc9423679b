"""Where the objects of a task are, from when on: in the world, or in what holds them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pinocchio as pin

from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.geometry.shape import Shape
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Attach, Detach, TaskStep
from optiplan.problem.task.timeline import mismatch, steps_in_time
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Stay:
    """From `begin`, s, an object is at X_BO in a body: 0 the world, j the joint j of the robot's model."""

    begin: float
    body: int
    X_BO: pin.SE3


@dataclass(frozen=True, eq=False)
class MovingObject:
    """An object with its stays, the first from the start."""

    name: str
    shape: Shape
    stays: tuple[Stay, ...]


def moved_by(task: Sequence[TaskStep]) -> frozenset[str]:
    """Return the names of what a task takes or releases."""
    return frozenset(step.action.body for step in task if isinstance(step.action, Attach | Detach))


def object_stays(problem: Problem, trajectory: Trajectory | None, names: Iterable[str]) -> list[MovingObject]:
    """Return objects along a motion, by name; without one they stay where they are."""
    scenes: list[tuple[float, Scene]] = [(0.0, problem.scene)]
    if trajectory is not None and problem.task and not mismatch(problem, trajectory):
        for _, scene, begin, _ in steps_in_time(problem, trajectory):
            if scene is not scenes[-1][1]:
                scenes.append((begin, scene))
    found = []
    for name in sorted(names):
        stays = [(_stay(problem.robot, scene, name), begin) for begin, scene in scenes]
        kept = [
            Stay(begin, body, X)
            for k, ((body, X), begin) in enumerate(stays)
            if k == 0 or body != stays[k - 1][0][0] or X != stays[k - 1][0][1]
        ]
        found.append(MovingObject(name, _body(problem.scene, name).shape, tuple(kept)))
    return found


def _stay(robot: Robot, scene: Scene, name: str) -> tuple[int, pin.SE3]:
    body = _body(scene, name)
    if isinstance(body, Obstacle):
        return 0, body.X_WO
    frame = robot.model.frames[robot.model.getFrameId(body.link, pin.FrameType.BODY)]
    return int(frame.parentJoint), frame.placement * body.X_LO


def _body(scene: Scene, name: str) -> Obstacle | Attachment:
    bodies: list[Obstacle | Attachment] = [*scene.obstacles, *scene.attached]
    return next(body for body in bodies if body.name == name)
