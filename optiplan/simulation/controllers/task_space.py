"""The task-space controller of `optiplan.control` in a closed loop: alone on velocities, or above torques."""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.controller import Controller
from optiplan.control.defaults import default_limits
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.control.tasks.base import ControlTask
from optiplan.control.tasks.frame_tasks import PoseTask
from optiplan.control.tasks.joint_tasks import PostureTask
from optiplan.problem.problem import Problem
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.files.schema import TaskSpaceSpec
from optiplan.simulation.plants.base import Input
from optiplan.simulation.references.base import ToolTarget
from optiplan.trajectory.state import State

JOINT_GAIN = 10.0
"""1/s, of references of the joints where none is given."""


class JointsTask(PostureTask):
    """Joints at positions that move: as `PostureTask`, with the velocity of its target as feed-forward.

    Attributes:
        velocity: (n,), rad/s or m/s; `acceleration`: (n,).
    """

    velocity: Array | None = None
    acceleration: Array | None = None

    def feed_forward(self, c: Configuration) -> Array | None:
        """The target's velocity, (n,)."""
        return self.velocity

    def feed_forward_rate(self, c: Configuration) -> Array | None:
        """The target's acceleration, (n,)."""
        return self.acceleration


class TaskSpaceLoop:
    """One step of `Controller` a period; its target is the tool's pose, or the joints' positions.

    On a plant that takes velocities, the mean velocity of the step is the command. On one that takes torques and with
    `feedback` = `commanded`, the step goes on from the state commanded before, and computed torque makes the robot
    follow it; with `measured`, it starts from the measured state and its acceleration becomes a torque as it is,
    tau = M(q) a + c + g.
    """

    output: Input

    def __init__(
        self,
        problem: Problem,
        options: TaskSpaceSpec,
        dt: float,
        frame: str | None,
        inner: ComputedTorque | None = None,
    ) -> None:
        """Build the controller.

        Args:
            problem: robot, limits and scene.
            options: as in a control file.
            dt: the control period, s.
            frame: that has a target; None: the joints have one.
            inner: makes torques; None: velocities are wanted.
        """
        self.output = "velocity" if inner is None else "torque"
        self._options, self._dt, self._inner = options, dt, inner
        robot = replace(problem.robot, limits=problem.limits)
        tasks: list[ControlTask] = []
        self._pose: PoseTask | None = None
        if frame is None:
            self._posture = JointsTask(
                problem.start, cost=1.0, gain=JOINT_GAIN if options.gain is None else options.gain
            )
        else:
            costs = (options.position_cost, options.orientation_cost)
            self._pose = PoseTask(frame, None, *costs, gain=options.gain)
            self._posture = JointsTask(problem.start, cost=options.posture_cost)
            tasks.append(self._pose)
        limits: list[ControlLimit] = list(default_limits(None))
        if options.clearance is not None:
            limits.append(ClearanceLimit(problem.scene, at_least=options.clearance))
        self._controller = Controller(
            robot,
            [*tasks, self._posture],
            None,
            limits,
            form=options.form,
            solver=options.solver,
            response=options.response,
            longest_step=dt,
        )
        self._state = State(problem.start)

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        if isinstance(target, ToolTarget):
            assert self._pose is not None
            self._pose.set_target(target.X_WF, target.twist, target.acceleration)
        else:
            posture = self._posture
            posture.target, posture.velocity, posture.acceleration = target.q, target.ahead_v, target.ahead_a
        measured = self._options.feedback == "measured"
        begin = State.of(q, v, self._state.a) if measured else self._state
        step = self._controller.step(begin, self._dt)
        self._state = step.state
        wanted = begin.q if isinstance(target, ToolTarget) else target.q
        if self._inner is None:
            return Command((step.q - begin.q) / self._dt, wanted, step)
        ahead = JointTarget(begin.q, begin.v, 0.5 * (begin.v + step.v), np.asarray(step.a))
        return Command(self._inner.torque(q, v, ahead), wanted, step)
