"""Execute a planned motion: computed torque on our rigid-body plant, or on MuJoCo's."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import wrong_argument
from optiplan.problem.problem import Problem
from optiplan.simulation.closed_loop import OF_TASKS, Loop, simulate
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Payload, Plant, PlantOptions, assumed_dynamics
from optiplan.simulation.plants.dynamics import check_inertias
from optiplan.simulation.plants.imperfections import PERFECT, Imperfections
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.references.joints import TrajectoryReference
from optiplan.trajectory.trajectory import Trajectory

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
    """

    engine: Engine = "own"
    dt: float = 1e-3
    step: float = 2.5e-4
    frequency: float = 10.0
    settle: float = 0.1
    payload: Payload | None = None
    imperfections: Imperfections = PERFECT


def execute(problem: Problem, trajectory: Trajectory, options: ExecutionOptions = ExecutionOptions()) -> Log:
    """Let computed torque follow a trajectory of a problem, from its start to its end.

    The plant begins with the velocities that the trajectory begins with.

    Raises:
        InputError: a joint of the robot moves no inertia; a task, whose scene changes on the way: execute its parts.
    """
    if problem.task:
        found, expected = OF_TASKS
        parts = f"{expected}, such as the parts of a task, optiplan.problem.task.timeline.scene_parts"
        raise wrong_argument("execute", "problem", found, parts)
    robot = problem.robot
    check_inertias(robot)
    start = np.asarray(trajectory.start)
    made = PlantOptions(payload=options.payload, velocity=trajectory(np.zeros(1), 1)[0])
    loop = Loop(
        robot=robot,
        limits=problem.limits,
        reference=TrajectoryReference(trajectory),
        controller=ComputedTorque(assumed_dynamics(robot, options.payload), options.frequency),
        plant=torque_plant(problem, options.engine, start, options.step, made),
        dt=options.dt,
        settle=options.settle,
        imperfections=options.imperfections,
        scene=problem.scene,
    )
    return simulate(loop)


def torque_plant(problem: Problem, engine: Engine, q: Array, step: float, options: PlantOptions) -> Plant:
    """Return the plant of a problem's robot in its scene, at q (n,), rad or m, with a step, s."""
    if engine == "mujoco":
        from optiplan.simulation.plants.mujoco_plant import MujocoPlant

        return MujocoPlant(problem.robot, problem.scene, q, step, options)
    return RigidBodyPlant(problem.robot, q, step, options)
