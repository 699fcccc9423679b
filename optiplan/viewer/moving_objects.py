"""Where the objects and tools of a task are, from when on: in the world, in what holds them, or nowhere."""

from collections.abc import Iterable, Sequence

import pinocchio as pin

from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.geometry.shape import Shape
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Attach, ChangeTool, Detach, TaskStep
from optiplan.problem.task.timeline import mismatch, steps_in_time
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Stay:
    """From `begin`, s, an object is at X_BO in a body: 0 the world, j the joint j of the robot's model.

    `absent`: it is nowhere, like a tool without a rack that is not mounted. `motion`: it moves like this in the world,
    from the pose on.
    """

    begin: float
    body: int
    X_BO: pin.SE3
    absent: bool = False
    motion: ObstacleMotion | None = None


@dataclass(frozen=True, eq=False)
class MovingObject:
    """An object with its stays, the first from the start."""

    name: str
    shape: Shape
    stays: tuple[Stay, ...]


def moved_by(task: Sequence[TaskStep]) -> frozenset[str]:
    """Return the names of what a task takes or releases, and of the bodies of tools that it changes."""
    taken = {step.action.body for step in task if isinstance(step.action, Attach | Detach)}
    changes = [step.action for step in task if isinstance(step.action, ChangeTool)]
    tools = [tool for change in changes for tool in (change.leaves, change.takes) if tool is not None]
    return frozenset(taken | {body.name for tool in tools for body in tool.bodies})


def object_stays(problem: Problem, trajectory: Trajectory | None, names: Iterable[str]) -> list[MovingObject]:
    """Return objects along a motion, by name; without one they stay where they are."""
    scenes: list[tuple[float, Scene]] = [(0.0, problem.scene)]
    if trajectory is not None and problem.task and not mismatch(problem, trajectory):
        for _, scene, begin, _ in steps_in_time(problem, trajectory):
            if scene is not scenes[-1][1]:
                scenes.append((begin, scene))
    of_tools = {body.name: body.shape for tool in problem.tools for body in tool.bodies}
    every: list[Obstacle | Attachment] = [*problem.scene.obstacles, *problem.scene.attached]
    shapes = of_tools | {body.name: body.shape for body in every}
    found = []
    for name in sorted(names):
        stays = [(_stay(problem.robot, scene, name), begin) for begin, scene in scenes]
        kept = [
            Stay(begin, *stay) for k, (stay, begin) in enumerate(stays) if k == 0 or not _same(stay, stays[k - 1][0])
        ]
        found.append(MovingObject(name, shapes[name], tuple(kept)))
    return found


def mounted_tools(problem: Problem, trajectory: Trajectory) -> list[tuple[float, str]]:
    """Return when a task changes tools, s, and the frame that is the tool frame from then on."""
    if not problem.tools or not problem.task or mismatch(problem, trajectory):
        return []
    own = problem.robot.reference.tool_frame
    changes = [(step.action, begin) for step, _, begin, _ in steps_in_time(problem, trajectory)]
    return [
        (begin, own if action.takes is None else action.takes.name)
        for action, begin in changes
        if isinstance(action, ChangeTool)
    ]


_Place = tuple[int, pin.SE3, bool, ObstacleMotion | None]


def _same(stay: _Place, before: _Place) -> bool:
    return stay[:3] == before[:3] and stay[3] is before[3]


def _stay(robot: Robot, scene: Scene, name: str) -> _Place:
    body = _body(scene, name)
    if body is None:
        return 0, pin.SE3.Identity(), True, None
    if isinstance(body, Obstacle):
        return 0, body.X_WO, False, body.motion
    frame = robot.model.frames[robot.model.getFrameId(body.link, pin.FrameType.BODY)]
    return int(frame.parentJoint), frame.placement * body.X_LO, False, None


def _body(scene: Scene, name: str) -> Obstacle | Attachment | None:
    bodies: list[Obstacle | Attachment] = [*scene.obstacles, *scene.attached]
    return next((body for body in bodies if body.name == name), None)
