"""Execute a planned motion: computed torque on our rigid-body plant, or on MuJoCo's."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import wrong_argument
from optiplan.problem.problem import Problem
from optiplan.problem.task.tour_steps import in_order
from optiplan.records import dataclass
from optiplan.simulation.closed_loop import Loop, simulate
from optiplan.simulation.controllers.joints import ComputedTorque, WheeledTorque
from optiplan.simulation.execution_report import execution_report
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Payload, Plant, PlantOptions, assumed_dynamics
from optiplan.simulation.plants.dynamics import check_inertias
from optiplan.simulation.plants.imperfections import PERFECT, Imperfections
from optiplan.simulation.plants.mecanum_wheels import MecanumWheels
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.plants.task_plant import CarryingPlant, FrictionGrip, changes_tools, objects_of
from optiplan.simulation.references.executed import ExecutedReference
from optiplan.simulation.references.joints import TrajectoryReference
from optiplan.simulation.tasks.course import NOTHING_HELD, TaskCourse
from optiplan.simulation.tasks.stages import TaskStage, stages_of
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.simulation.plants.mujoco_tasks import MujocoTaskPlant

Engine = Literal["own", "mujoco"]


@dataclass(frozen=True)
class ExecutionOptions:
    """How a motion is executed.

    Attributes:
        engine: `own` or `mujoco`.
        dt: control period, s; `step`: of the plant, s.
        frequency: of the error dynamics of computed torque, Hz; critically damped.
        settle: s after the end.
        payload: at the tool, of which the controller may know another mass.
        imperfections: of measurement and timing.
        grip: of the objects of a task, in MuJoCo; None: welds.
        wheels: whether a mecanum base drives on its wheels, in MuJoCo; else its joints have drives.
    """

    engine: Engine = "own"
    dt: float = 1e-3
    step: float = 2.5e-4
    frequency: float = 10.0
    settle: float = 0.1
    payload: Payload | None = None
    imperfections: Imperfections = PERFECT
    grip: FrictionGrip | None = None
    wheels: bool = False

    def __post_init__(self) -> None:
        """Refuse what our own plant does not have.

        Raises:
            InputError: a grip by friction, or wheels, without MuJoCo.
        """
        for name, given in (("grip", self.grip is not None), ("wheels", self.wheels)):
            if given and self.engine != "mujoco":
                found, other = (
                    f"{getattr(self, name)} with the engine '{self.engine}'",
                    {"grip": "weld", "wheels": "False"},
                )
                raise wrong_argument("execute", name, found, f"the engine mujoco, or {other[name]}")


def execute(
    problem: Problem,
    trajectory: Trajectory,
    options: ExecutionOptions = ExecutionOptions(),
    *,
    reference: ExecutedReference | None = None,
) -> Log:
    """Let computed torque follow a trajectory of a problem, from its start to its end.

    The plant begins with the velocities that the trajectory begins with. A task is executed with its objects.

    Args:
        problem: that the trajectory solves.
        trajectory: what to follow.
        options: how.
        reference: set-points of an executor of this trajectory, with torques of its planned loads; None: the trajectory
            at its own speed.

    Raises:
        InputError: a joint of the robot moves no inertia; a task that goes with what moves, or, in MuJoCo, that changes
            tools.
    """
    robot = problem.robot
    if any(step.ride is not None for step in in_order(problem, trajectory).task):
        raise wrong_argument("execute", "run", "a task that goes with what moves", "a task among things that stand")
    if options.engine == "mujoco" and changes_tools(problem):
        raise wrong_argument("execute", "engine", "mujoco, with a task that changes tools", "the engine own")
    check_inertias(robot)
    start = np.asarray(trajectory.start)
    made = PlantOptions(payload=options.payload, velocity=trajectory(np.zeros(1), 1)[0])
    wheels, course = MecanumWheels(robot) if options.wheels else None, None
    controller = _controller(problem, options, wheels)
    if problem.task:
        stages = stages_of(problem, trajectory)
        plant = task_plant(problem, trajectory, stages, options, made, wheels)
        course = TaskCourse(stages, objects_of(problem), plant, controller, options.payload)
        course.places = course.places if reference is None else reference.places
    loop = Loop(
        robot=robot,
        limits=problem.limits,
        reference=TrajectoryReference(trajectory) if reference is None else reference,
        controller=controller,
        plant=plant if problem.task else torque_plant(problem, options.engine, start, options.step, made, wheels),
        dt=options.dt,
        settle=options.settle,
        imperfections=options.imperfections,
        scene=problem.scene,
        course=NOTHING_HELD if course is None else course,
    )
    log = simulate(loop)
    if course is not None:
        log = course.finished(log, np.asarray(trajectory.end), options.grip is not None)
    log = replace(log, wheels=None if wheels is None else wheels.log())
    return replace(log, report=execution_report(log, robot, problem.limits))


def _controller(problem: Problem, options: ExecutionOptions, wheels: MecanumWheels | None) -> ComputedTorque:
    dynamics = assumed_dynamics(problem.robot, options.payload)
    if wheels is None:
        return ComputedTorque(dynamics, options.frequency)
    return WheeledTorque(dynamics, options.frequency, wheels.aim)


def torque_plant(
    problem: Problem,
    engine: Engine,
    q: Array,
    step: float,
    options: PlantOptions,
    wheels: MecanumWheels | None = None,
) -> Plant:
    """Return the plant of a problem's robot in its scene, at q (n,), rad or m, with a step, s."""
    if engine == "mujoco":
        from optiplan.simulation.plants.mujoco_plant import MujocoPlant

        return MujocoPlant(problem.robot, problem.scene, q, step, options, wheels)
    return RigidBodyPlant(problem.robot, q, step, options)


def task_plant(
    problem: Problem,
    trajectory: Trajectory,
    stages: list[TaskStage],
    options: ExecutionOptions,
    made: PlantOptions,
    wheels: MecanumWheels | None,
) -> "CarryingPlant | MujocoTaskPlant":
    """Return the plant of a task's robot and objects, at the start of a motion."""
    if options.engine == "mujoco":
        from optiplan.simulation.plants.mjcf_objects import TaskObjects
        from optiplan.simulation.plants.mujoco_tasks import MujocoTaskPlant

        objects = TaskObjects(problem, trajectory, stages, options.grip)
        return MujocoTaskPlant(problem, objects, options.step, made, wheels)
    return CarryingPlant(problem, np.asarray(trajectory.start), options.step, made)
