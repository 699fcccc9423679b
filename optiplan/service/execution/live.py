"""A controller that runs: a simulated robot follows a target that somebody moves, in real time."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, finite_or_none
from optiplan.control.step import ControlStep
from optiplan.errors import InputError, wrong_argument
from optiplan.geometry.poses import pose_error
from optiplan.problem.problem import Problem
from optiplan.robot.frames import frame_pose
from optiplan.simulation.closed_loop import OF_TASKS
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.controllers.task_space import TaskSpaceLoop
from optiplan.simulation.files.schema import TaskSpaceSpec
from optiplan.simulation.plants.base import Plant
from optiplan.simulation.plants.dynamics import RigidBodyDynamics, check_inertias
from optiplan.simulation.plants.ideal import IdealPlant
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.references.base import ToolTarget
from optiplan.viewer.runs import Poses

PERIOD = 0.005
"""s, of the controller."""
FINE = 2.5e-4
"""s, of the plant."""
FREQUENCY = 10.0
"""Hz, of the errors that computed torque lets die away."""
STREAM = 0.04
"""s between two states that are told."""
LAG = 0.1
"""s that the simulation may be behind the clock; more is left out, and counted."""
STILL = np.zeros(6)


class LiveLoop:
    """The task-space controller above a plant, from a problem's start, with the tool's pose there as first target.

    The plant has rigid-body dynamics with the robot's torque limits under computed torque; a robot without inertias, or
    `engine` = `ideal`, moves with exactly the velocities that it is told.

    Args:
        problem: robot, limits, start and scene.
        engine: `own` or `ideal`; None: `own` where the robot has inertias.

    Raises:
        InputError: `own`, of a robot without inertias; a task.
    """

    def __init__(self, problem: Problem, engine: str | None = None) -> None:
        if problem.task:
            raise wrong_argument("LiveLoop", "problem", *OF_TASKS)
        self.problem, self.engine = problem, engine or _engine(problem)
        robot, inner = problem.robot, None
        self._plant: Plant = IdealPlant(problem.start, PERIOD)
        if self.engine == "own":
            check_inertias(robot)
            self._plant = RigidBodyPlant(robot, problem.start, FINE)
            inner = ComputedTorque(RigidBodyDynamics(robot), FREQUENCY)
        self._loop = TaskSpaceLoop(problem, TaskSpaceSpec(), PERIOD, robot.tool_frame, inner)
        self._poses, self._data = Poses(problem), robot.model.createData()
        self._target = self.first = frame_pose(robot, problem.start, robot.tool_frame)
        self._step: ControlStep | None = None
        self._wanted = np.asarray(problem.start, float)
        self._slowest = self.t = self.lost = 0.0

    def run(self, channel: Any) -> None:
        """Go on until `channel.heard(seconds)` hears `stop`; `channel.state(…)` is told where everything is."""
        began, told = time.perf_counter(), -STREAM
        while True:
            for message in channel.heard(0.5 * PERIOD):
                if "stop" in message:
                    return
                self.aim(message["target"])
            now = time.perf_counter() - began - self.lost
            if now - self.t > LAG:
                self.lost += now - self.t - LAG
                now = self.t + LAG
            while self.t + PERIOD <= now:
                self.advance()
            if now - told >= STREAM:
                told = now
                channel.state(self.state())

    def aim(self, pose: Array) -> None:
        """Move the target to a pose (x, y, z, qx, qy, qz, qw) in the world, from one period to the next."""
        given = np.asarray(pose, float)
        given[3:] /= np.linalg.norm(given[3:])
        self._target = pin.XYZQUATToSE3(given)

    def advance(self) -> None:
        """One period of the controller."""
        plant = self._plant
        command = self._loop.command(plant.q, plant.v, ToolTarget(self._target, STILL, STILL))
        plant.advance(command.value, round(PERIOD / plant.step))
        self._step, self._wanted = command.step, command.q
        if command.step is not None:
            self._slowest = max(self._slowest, command.step.seconds)
        self.t += PERIOD

    def state(self) -> dict[str, Any]:
        """Where everything is, JSON-ready; `docs/service.md` lists its keys."""
        q, step = self._plant.q, self._step
        robot = self.problem.robot
        tool = frame_pose(robot, q, robot.tool_frame, self._data)
        error = pose_error(tool, self._target)
        nearest = None if step is None else step.nearest
        slowest, self._slowest = self._slowest, 0.0
        return {
            "t": self.t,
            "q": q.tolist(),
            "v": self._plant.v.tolist(),
            "wanted": self._wanted.tolist(),
            "poses": self._poses.of(q[None])[0][0].tolist(),
            "tool": pin.SE3ToXYZQUAT(tool).tolist(),
            "target": pin.SE3ToXYZQUAT(self._target).tolist(),
            "error": {"position": error.position, "rotation": error.orientation},
            "status": "tracking" if step is None else step.status,
            "reason": "" if step is None else step.reason,
            "active": [] if step is None else list(step.active),
            "slack": {} if step is None else {name: float(value) for name, value in step.slack.items()},
            "nearest": nearest and {"pair": [nearest.a, nearest.b], "distance": float(nearest.distance)},
            "step_seconds": slowest,
            "lost": self.lost,
        }


def live_about(loop: LiveLoop) -> Mapping[str, Any]:
    """What is told of a loop before it begins."""
    robot, limits = loop.problem.robot, loop.problem.limits
    return {
        "engine": loop.engine,
        "period": PERIOD,
        "joint_names": list(robot.joint_names),
        "frame": robot.tool_frame,
        "velocity_limits": list(map(finite_or_none, limits.velocity)),
        "clearance": TaskSpaceSpec().clearance,
        "target": pin.SE3ToXYZQUAT(loop.first).tolist(),
    }


def _engine(problem: Problem) -> str:
    try:
        check_inertias(problem.robot)
    except InputError:
        return "ideal"
    return "own"
