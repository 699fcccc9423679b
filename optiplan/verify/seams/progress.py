"""How far along its path a tool is at each time: a guess, which the proof then holds the motion against."""

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.seams.actions import SeamPart
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameMotion

_STEP = 0.01
"""s, of the times at which the tool's place is looked for."""

_MOST = 200_000
"""Times at most."""

_CORRECTIONS = 4


class PathProgress:
    """A length s(t) along the path that never decreases, from the part's beginning to its end.

    Whatever it is, a tool within a tolerance of c(s(t)) at all times follows the path in its order. It is made from the
    nearest places on the curve, near what the way of the tool itself says.
    """

    def __init__(self, part: SeamPart, robot: Robot, motion: Trajectory) -> None:
        curve = part.path.curve
        count = min(_MOST, max(2, int(np.ceil(motion.duration / _STEP))))
        t = np.union1d(np.linspace(0.0, motion.duration, count + 1), motion.breakpoints[:_MOST])
        frame = FrameMotion(robot, part.path.frame)
        p = frame.poses(motion(t))[:, :3, 3]
        speed = np.linalg.norm(frame.twists(motion(t), motion(t, 1))[0], axis=1)
        middle = 0.5 * (t[1:] + t[:-1])
        between = np.linalg.norm(frame.twists(motion(middle), motion(middle, 1))[0], axis=1)
        ways = np.diff(t) * (speed[:-1] + 4.0 * between + speed[1:]) / 6.0
        way = np.concatenate([[0.0], np.cumsum(ways)])
        share = way / way[-1] if way[-1] > 0.0 else t / motion.duration
        s = part.low + (part.high - part.low) * share
        farthest = 10.0 * part.path.position
        guess = s.copy()
        for _ in range(_CORRECTIONS):
            ahead = ((p - curve.points(s)) * curve.points(s, 1)).sum(axis=1)
            s = np.clip(np.clip(s + ahead, guess - farthest, guess + farthest), part.low, part.high)
        s[0], s[-1] = part.low, part.high
        self.t, self.s = t, np.maximum.accumulate(s)

    def __call__(self, t: Array) -> Array:
        """Return the lengths (N,), m, at times t (N,), s."""
        return np.asarray(np.interp(t, self.t, self.s))
