"""`MotionTask`: follow a motion joint by joint, with its velocities as feed-forward."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.joint_tasks import PostureTask
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

FOLLOW_COST = 100.0
"""Per rad or m: what the controller adds for steadiness weighs a millionth of it."""

FOLLOW_GAIN = 20.0
"""1/s: a deviation falls to a third in 50 ms."""

WAITS = 0.005
"""s of a joint's largest speed; a motion whose robot is farther off goes on more slowly, and waits at twice as much."""


THERE = 0.02
"""Share of WAITS, 1 ms of a joint's largest speed: a robot that is no farther off has arrived."""


MET = 1e-3
"""Share of WAITS, 0.02 ms of a joint's largest speed: a robot that is no farther off is on the motion."""


class MotionTask(PostureTask):
    """Joints on a motion p(t): e = q - p(t); J the identity; feed-forward (p(t + dt) - p(t)) / dt, or p'(t).

    A step that is not held back so ends at p(t + dt). Where the robot is off by more than WAITS, the motion's time goes
    on more slowly, and stands still where it is off by twice as much: it does not run away from a robot that waits.
    Of joints without limits the motion is taken in the turn that is nearest to the robot in the first step.

    Args:
        motion: of all joints of the robot.
        gain: 1/s.
        by_acceleration: whether q' = q + dt (v + x) / 2, and the velocity x is that at the end of the step.

    Attributes:
        time: on the motion, s; at its end it stays.
        velocity: (n,), rad/s or m/s, with which a step ends on the motion, or nearer to it.
    """

    name: ClassVar[str] = "motion"

    def __init__(self, motion: Trajectory, gain: float = FOLLOW_GAIN, by_acceleration: bool = False) -> None:
        super().__init__(motion.start, FOLLOW_COST, gain)
        self._by_acceleration, self._off = by_acceleration, np.inf
        self.time = 0.0
        self._motion = motion
        self._turns: Array | None = None  # (n,) rad, whole ones by which the robot is farther
        self._forward: Array = motion(np.zeros(1), 1)[0]
        self._change: Array = np.zeros_like(self._forward)
        self.velocity: Array = self._forward

    @property
    def done(self) -> bool:
        """Whether the robot has come to the end of the motion."""
        return self.time >= self._motion.duration and self._off <= THERE

    @property
    def is_met(self) -> bool:
        """Whether the robot was on the motion when the step began, so that the step may simply go on along it."""
        return self._off <= MET

    def bind(self, robot: Robot) -> None:
        """Take the speeds of the joints."""
        super().bind(robot)
        self._endless = robot.endless
        self._scale = WAITS * np.where(np.isfinite(self._speed), self._speed, 1.0)

    def begin_step(self, state: State, dt: float) -> None:
        """Go on along the motion for dt s, or less where the robot has stayed behind."""
        if self._turns is None:
            turns = np.round((state.q - self._motion(np.array([self.time]))[0]) / (2.0 * np.pi))
            self._turns = 2.0 * np.pi * np.where(self._endless, turns, 0.0)
        now = self._motion(np.array([self.time]))[0] + self._turns
        self._off = float((np.abs(state.q - now) / self._scale).max())
        pace = min(max(2.0 - self._off, 0.0), 1.0)
        then = min(self.time + dt * pace, self._motion.duration)
        if self._by_acceleration:
            self._forward, ahead = pace * self._motion(np.array([self.time, then]), 1)
            self._change = (ahead - self._forward) / dt
        else:
            ahead = (self._motion(np.array([then]))[0] + self._turns - now) / dt
            self._change, self._forward = (ahead - self._forward) / dt, ahead
        self.velocity = ahead - self.gain * (state.q - now)
        self._target, self.time = now, then

    def feed_forward(self, c: Configuration) -> Array:
        """(n,), rad/s or m/s."""
        return self._forward

    def feed_forward_rate(self, c: Configuration) -> Array:
        """(n,), rad/s² or m/s²."""
        return self._change
