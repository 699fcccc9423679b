"""Lines of a task: from which corner to which they lead, what must hold on the way, and how fast the tool is."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.problem.constraints.measures import FramePoses
from optiplan.problem.constraints.points import OnLine
from optiplan.problem.constraints.poses import OrientationCone
from optiplan.problem.constraints.statements import PathConstraint
from optiplan.problem.problem import PoseGoal, Problem
from optiplan.problem.task.steps import Action, StraightLine
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot
from optiplan.trajectory.samples import sample_times
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameMotion

STRAIGHT = 1e-4
"""m: how far a frame may be off its line."""

EVENLY = 1e-3
"""rad: how far a frame on a line may be from turning about one axis, or not at all."""

_HALVINGS = 50

HELD = 0.99
"""Share of the stated speed from which on it counts as held."""

_NEAR = 0.9
"""Share of a limit from which on it counts as what keeps the tool slower."""

_RATES = ("velocity", "acceleration", "jerk")
_SAMPLES = 1000


@dataclass(frozen=True, eq=False)
class LineWay:
    """What a line asks for: its corners, and how far it may keep from them.

    Attributes:
        frame: that moves.
        start: its pose where the line begins: a corner that it need not touch, where `enters` is given.
        goal: its pose where the line ends, likewise with `leaves`.
        enters: m, radius of the ball about the first corner in which the line need not be kept; None: it is exact.
        leaves: the same about the last corner; neither is more than half of either line.
        turns: rad, by which both lines of a corner turn at most, whose orientations it may mix.
    """

    frame: str
    start: pin.SE3
    goal: PoseGoal
    enters: float | None
    leaves: float | None
    turns: tuple[float, float]

    @property
    def end(self) -> pin.SE3:
        """The last corner."""
        return self.goal.X_WG


def frame_at(robot: Robot, action: Action, q: Array) -> pin.SE3 | None:
    """Return the pose of the frame of a line in a configuration (n,); None for another step."""
    return frame_pose(robot, q, action.frame) if isinstance(action, StraightLine) else None


def line_way(action: Action, after: Action | None, X: pin.SE3 | None, before: LineWay | None) -> LineWay | None:
    """Return the way of a line, None for another step.

    Args:
        action: of the step.
        after: of the next step, None after the last.
        X: where the frame is when the step begins.
        before: the way of the step before, if that is a line.
    """
    if not isinstance(action, StraightLine) or X is None:
        return None
    entered = before is not None and before.leaves is not None
    start = before.end if before is not None and entered else X
    goal = _end(action, start)
    own, other, leaves = pose_error(start, goal.X_WG), 0.0, None
    if action.blend > 0.0 and isinstance(after, StraightLine):
        following = pose_error(goal.X_WG, _end(after, goal.X_WG).X_WG)
        other = following.orientation
        leaves = min(action.blend, 0.5 * own.position, 0.5 * following.position)
    enters, turn = (before.leaves, before.turns[1]) if before is not None and entered else (None, own.orientation)
    return LineWay(action.frame, start, goal, enters, leaves, (turn, own.orientation + other))


def line_constraints(way: LineWay, robot: Robot, motion: Trajectory) -> Iterator[PathConstraint]:
    """Return what a line means: the origin on the segment; two axes fixed, or the one that it turns about.

    Where a corner may be rounded off, that holds from the time at which the frame leaves the ball about it, or until it
    enters it; in the ball the frame stays in the ball, and its orientation near that of the corner: it turns there by
    no more than both lines do.
    """
    position = _Origin(robot, way.frame, motion)
    low = 0.0 if way.enters is None else position.last_within(way.start.translation, way.enters)
    high = 1.0 if way.leaves is None else position.first_within(way.end.translation, way.leaves)
    low, high = min(low, high), max(low, high)
    end = way.end if way.leaves is not None else position.pose(1.0)
    yield OnLine(way.frame, way.start.translation, end.translation, STRAIGHT, during=(low, high))
    for axis, turned in _kept_axes(way, position, (low, high)):
        yield OrientationCone(way.frame, axis, turned @ axis, EVENLY, during=(low, high))
    balls = ((way.start, way.enters, (0.0, low), way.turns[0]), (way.end, way.leaves, (high, 1.0), way.turns[1]))
    for X, radius, during, turn in balls:
        if radius is None:
            continue
        yield OnLine(way.frame, X.translation, X.translation, radius + STRAIGHT, during=during)
        if turn + EVENLY < np.pi:
            for axis in np.eye(3)[:2]:
                yield OrientationCone(way.frame, axis, X.rotation @ axis, turn + EVENLY, during=during)


def _kept_axes(way: LineWay, at: "_Origin", during: tuple[float, float]) -> Iterator[tuple[Array, Array]]:
    """Yield the axes of the frame that keep their direction on the line, with the rotation to the world."""
    X = way.start if way.enters is not None else at.pose(during[0])
    Y = way.end if way.leaves is not None else at.pose(during[1])
    turn = pin.log3(X.rotation.T @ Y.rotation)
    angle = float(np.linalg.norm(turn))
    for axis in np.eye(3)[:2] if angle <= EVENLY else (turn / angle)[None]:
        yield axis, X.rotation


def _end(action: StraightLine, start: pin.SE3) -> PoseGoal:
    """Return where a line ends: at the pose before which it begins, or at `start` moved by its vector."""
    if action.by is None:
        begins = [end.X_WG if action.X_GB is None else end.X_WG * action.X_GB for end in action.ends]
        return action.ends[int(np.argmin([sum(pose_error(start, X)) for X in begins]))]
    by = start.rotation @ action.by if action.in_tool else action.by
    return PoseGoal(action.frame, pin.SE3(start.rotation, start.translation + by))


class _Origin:
    """The frame along a motion, by the share of its duration."""

    def __init__(self, robot: Robot, frame: str, motion: Trajectory) -> None:
        self._poses, self._motion = FramePoses(robot, frame), motion

    def pose(self, share: float) -> pin.SE3:
        """Return its pose."""
        return self._poses.at(self._motion(share * self._motion.duration))

    def first_within(self, point: Array, radius: float) -> float:
        """Return the share at which it enters the ball in which it ends, 1 where it does not end in it."""
        return self._bisected(
            point, radius, np.append(sample_times(self._motion)[::-1] / self._motion.duration, 0.0), 1.0
        )

    def last_within(self, point: Array, radius: float) -> float:
        """Return the share at which it leaves the ball in which it begins, 0 where it does not begin in it."""
        shares = sample_times(self._motion) / self._motion.duration
        return self._bisected(point, radius, np.append(shares, 1.0), 0.0)

    def _bisected(self, point: Array, radius: float, shares: Array, none: float) -> float:
        """Return the share, beginning with the first of `shares`, until which it stays in the ball."""
        inside = none
        for share in shares.tolist():
            if self._distance(point, share) > radius:
                outside = share
                break
            inside = share
        else:
            return inside
        for _ in range(_HALVINGS):
            middle = 0.5 * (inside + outside)
            if self._distance(point, middle) > radius:
                outside = middle
            else:
                inside = middle
        return inside

    def _distance(self, point: Array, share: float) -> float:
        return float(np.linalg.norm(self.pose(share).translation - point))


@dataclass(frozen=True)
class LineSpeed:
    """Speeds of the tool on one line, at samples.

    Attributes:
        asked: by the step, m/s.
        held: for half of the time at least, m/s: the median.
        why: which limit is nearest where the tool is slower than stated; empty where it holds what is stated.
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
