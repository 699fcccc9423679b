"""What a plant does with the objects of a task; our own plant, in which links carry them."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, number_argument
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_change import carrying, scene_after
from optiplan.problem.task.steps import Attach, ChangeTool, Detach, Event
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.simulation.plants.base import NOMINAL, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.tasks.stages import TaskStage

FRICTION = 0.6
"""Coefficient of friction of objects, where none is given: rubber or wood on wood, dry."""


def changes_tools(problem: Problem) -> bool:
    """Whether a task changes tools, for which MuJoCo has no bodies."""
    return any(isinstance(step.action, ChangeTool) for step in problem.task)


@dataclass(frozen=True)
class FrictionGrip:
    """How fingers hold objects by friction in MuJoCo.

    Where a task closes a gripper on an object right after it took it, the fingers press. Where it closes none, a weld
    holds, and two pads stand for the fingers in the figures: they press along y of the tool frame.

    Args:
        force: with which each finger presses, N.
        friction: coefficient of friction of objects with everything.

    Raises:
        InputError: one of them is not a number above 0.

    Example:
        >>> import optiplan as op
        >>> op.FrictionGrip(force=20.0)
        FrictionGrip(force=20.0, friction=0.6)
    """

    force: float = 30.0
    friction: float = FRICTION

    def __post_init__(self) -> None:
        for name, value in (("force", self.force), ("friction", self.friction)):
            number_argument("FrictionGrip", name, value, "a finite number > 0", above=0.0)


class TaskPlant(Protocol):
    """A plant with objects that are taken and released."""

    def enter(self, stage: TaskStage, actions: Sequence[Event]) -> None:
        """Begin a stage: take and release these objects, in order."""

    def objects(self) -> Array:
        """Poses of the objects that change hands, (m, 7): position, m, and quaternion x, y, z, w, in the world."""

    def grip_load(self) -> float:
        """Greatest share of the friction of a grip that was needed since the last call; 0 without a grip."""


def objects_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of the objects that a task takes or releases, in the order of its steps."""
    actions = (step.action for step in problem.task)
    return tuple(dict.fromkeys(action.body for action in actions if isinstance(action, Attach | Detach)))


def object_poses(names: Sequence[str], scene: Scene, robot: Robot, placed: pin.Data) -> Array:
    """Return the poses of bodies of a scene, (m, 7), as of `TaskPlant.objects`, with the frames as in `placed`."""
    stand = {body.name: body.X_WO for body in scene.obstacles}
    for held in scene.attached:
        link = robot.model.getFrameId(held.link, pin.FrameType.BODY)
        stand[held.name] = placed.oMf[link] * held.X_LO
    return np.array([pin.SE3ToXYZQUAT(stand[name]) for name in names]).reshape(-1, 7)


class CarryingPlant(RigidBodyPlant):
    """Our plant with objects: what is held is one body with its link; what is released stays where it is."""

    def __init__(self, problem: Problem, q: Array, step: float, options: PlantOptions = NOMINAL) -> None:
        """Begin at q (n,), rad or m, in the scene of a problem; the rest as of `TorquePlant`."""
        super().__init__(carrying(problem.robot, problem.scene), q, step, options)
        self._robot, self._options, self._scene = problem.robot, options, problem.scene
        self._names, self._data = objects_of(problem), problem.robot.model.createData()

    def enter(self, stage: TaskStage, actions: Sequence[Event]) -> None:
        """See `TaskPlant`; an object is taken where the links really are."""
        for action in actions:
            self._scene = scene_after(self._scene, action, self._robot, self.q)
        if actions:
            robot = carrying(self._robot, self._scene)
            self.dynamics = RigidBodyDynamics(robot, self._options.mass, self._options.centre)

    def objects(self) -> Array:
        """See `TaskPlant`."""
        pin.framesForwardKinematics(self._robot.model, self._data, self.q)
        return object_poses(self._names, self._scene, self._robot, self._data)

    def grip_load(self) -> float:
        """0: what is held cannot slip here."""
        return 0.0
