"""Report the tool's speed on lines: what a step asks for, what the motion holds, and which limit keeps it lower."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import StraightLine
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameMotion

HELD = 0.99
"""Share of the speed asked for from which on it counts as held."""

_NEAR = 0.9
"""Share of a limit from which on it counts as what keeps the tool slower."""

_RATES = ("velocity", "acceleration", "jerk")
_SAMPLES = 1000


@dataclass(frozen=True)
class LineSpeed:
    """Speeds of the tool on one line, at samples.

    Attributes:
        asked: by the step, m/s.
        held: for half of the time at least, m/s: the median.
        why: which limit is nearest where the tool is slower than asked; empty where it holds what is asked.
    """

    asked: float
    held: float
    why: str = ""

    def __str__(self) -> str:
        """Return asked, held and why in one phrase."""
        words = f"{self.asked:.4g} m/s asked, {self.held:.3g} held"
        return f"{words} ({self.why})" if self.why else words


def line_speed(problem: Problem, motion: Trajectory, action: StraightLine) -> LineSpeed:
    """Return the speeds of a line's frame in its part of the motion; the problem has the robot with what it holds."""
    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * motion.duration
    q, v, a, j = (motion(t, order) for order in range(4))
    speed = np.linalg.norm(FrameMotion(problem.robot, action.frame).twists(q, v)[0], axis=1)
    held = float(np.median(speed))
    if held >= HELD * action.speed:
        return LineSpeed(action.speed, held)
    slow = speed < HELD * action.speed
    return LineSpeed(action.speed, held, _why(problem, *(rate[slow] for rate in (q, v, a, j))))


def _why(problem: Problem, q: Array, v: Array, a: Array, j: Array) -> str:
    """Return the limit that is nearest at most of the samples (N, n)."""
    limits, names = problem.limits, problem.robot.joint_names
    parts = dict(zip(_RATES, (np.abs(x) / b for x, b in zip((v, a, j), limits.rates, strict=True)), strict=True))
    with np.errstate(invalid="ignore"):
        parts["torque"] = np.nan_to_num(np.abs(inverse_dynamics(problem.robot, q, v, a)) / limits.torque)
    shares = np.stack(list(parts.values()))
    nearest = shares.max(axis=(0, 2)) >= _NEAR
    if not nearest.any():
        return "no limit of a joint is near: the line's law, or its ends at rest, keep it lower"
    flat = np.swapaxes(shares, 0, 1)[nearest].reshape(int(nearest.sum()), -1).argmax(axis=1)
    kind, joint = divmod(Counter(flat.tolist()).most_common(1)[0][0], len(names))
    return f"{list(parts)[kind]} of {names[joint]} is at its limit"
