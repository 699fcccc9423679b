"""Where the robot should stand: the least time of straight motions through the places of a problem, by base pose.

At a base pose the start has to be free, and every place needs a free configuration within limits. The score is the
least sum of the times of straight joint motions from place to place over all configurations found, see `Ladder`: of
obstacles between the places it knows nothing, and no motion with stops at the places is much shorter. The best bases
are planned and proved afterwards.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.native_model import planning_model
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.planners.base import Budget
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.planners.tours.vertices import Vertices
from optiplan.problem.goals_and_vias import AllOfGoal, GoalEnd, JointGoal, PoseGoal
from optiplan.problem.problem import Problem, derived
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.scene_change import columns
from optiplan.problem.task.steps import Move, StraightLine, Target, TargetTour
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot

_TURNS = 8
"""Turns about a free axis that a score is of."""

_STARTS = 12
"""Descents for each place, of arms without inverse kinematics in closed form."""

_PLACES = 40
"""Places of a tour that a score is of, evenly chosen, at most."""

_SHRINKING, _FINEST = 0.5, 0.02
"""Factor and least share of the map's step in the search around the best of its points."""

_FRESH = 6
"""Steps of the search around a point without gain, after which it takes smaller ones: one for each direction."""


@dataclass(frozen=True)
class PlaceRange:
    """Base poses that are considered, about the one given in the problem.

    Attributes:
        x, y, z: m, how far the base may be moved along the axes of the world, either way.
        yaw: rad, how far it may be turned about the world's z axis, either way.
        points: of the map, along x and y each; along z and yaw as many as half of it, where these are free.
    """

    x: float = 0.4
    y: float = 0.4
    z: float = 0.0
    yaw: float = np.pi / 2.0
    points: int = 9

    @property
    def reach(self) -> Array:
        """The four ranges (4,), m and rad."""
        return np.array([self.x, self.y, self.z, self.yaw])


@dataclass(frozen=True, eq=False)
class PlaceScores:
    """Scores of base poses.

    Attributes:
        moved: (k, 4) x, y, z, m, and yaw, rad, from the given base.
        missing: (k,) places that are out of reach or not free, and the start.
        seconds: (k,) s; infinite where a place is missing.
    """

    moved: Array
    missing: Array
    seconds: Array

    def ranked(self) -> list[int]:
        """Return the base poses, the best first; of those with places missing the one with the fewest."""
        order = np.lexsort((np.abs(self.moved).sum(axis=1), self.seconds, self.missing))
        return [int(k) for k in order]


def moved_base(X_WB: pin.SE3, moved: Array) -> pin.SE3:
    """Return a base moved by x, y, z and turned by yaw about the world's z axis through its origin: moved (4,)."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, float(moved[3])) @ X_WB.rotation, X_WB.translation + moved[:3])


class PlaceScore:
    """The score of base poses for one problem."""

    def __init__(self, problem: Problem, budget: Budget) -> None:
        self.problem, self.budget = problem, budget
        self.places = [known for place in _places(problem) if (known := _of_known_frames(problem, place))]
        self._times = TravelTimes(problem.limits)

    def at(self, moved: Array) -> tuple[int, float]:
        """Return how many places are missing, and the score, s, of a base moved by x, y, z, yaw (4,)."""
        robot, scene = self.problem.robot, self.problem.scene
        robot = robot.mounted(replace(robot.mounting, X_WB=moved_base(robot.mounting.X_WB, moved)))
        problem = derived(self.problem, robot=robot, vias=(), task=(), path_constraints=())
        model = planning_model(robot, scene, error=problem.tracking_error)
        check = MotionCheck(model, problem.limits, Gravity(robot, problem.limits.torque))
        if check.blocked(problem.start):
            return 1 + len(self.places), np.inf
        layers = self._layers(problem, check)
        missing = sum(not len(Q) for Q in layers)
        if missing:
            return missing, np.inf
        before, seconds = problem.start[None], np.zeros(1)
        for Q in layers:
            seconds = (seconds[:, None] + self._times.between(before, Q)).min(axis=0)
            before = Q
        return 0, float(seconds.min())

    def _layers(self, problem: Problem, check: MotionCheck) -> list[Array]:
        """Return the free configurations (k, n) of each place."""
        regions = [(k, end) for k, place in enumerate(self.places) for end in place if isinstance(end, RegionGoal)]
        found: list[list[Array]] = [
            [end.q[None] for end in place if isinstance(end, JointGoal) and not check.blocked(end.q)]
            for place in self.places
        ]
        for frame in dict.fromkeys(end.frame for _, end in regions):
            own = [(k, end) for k, end in regions if end.frame == frame]
            targets = tuple(Target(str(i), end) for i, (_, end) in enumerate(own))
            vertices = Vertices(problem, TargetTour(problem.robot.joint_names, targets), check, self._times)
            reached = vertices.candidates(_TURNS, self.budget, _STARTS, all_over=True)
            for (k, _), Q in zip(own, reached, strict=True):
                found[k].append(Q)
        return [np.concatenate([np.zeros((0, problem.robot.n)), *Qs]) for Qs in found]


def search_places(
    problem: Problem, where: PlaceRange, budget: Budget, progress: Callable[[str, float], None]
) -> PlaceScores:
    """Return scores of base poses: of a grid, as far as the budget lasts, and of a search around its best points.

    The given base is the first. The grid is visited in a mixed order, so that it is even where the budget cuts it.
    """
    score, known = PlaceScore(problem, budget), _Known()
    known.add(np.zeros(4), *score.at(np.zeros(4)))
    grid, step = _grid(where)
    mapping = budget.share(0.6)
    for k in np.random.default_rng(problem.seed).permutation(len(grid)):
        if mapping.over:
            break
        progress("map", min(1.0, len(known.rows) / len(grid)))
        known.add(grid[k], *score.at(grid[k]))
    for best in known.scores().ranked()[:3]:
        _descend(score, known, known.scores().moved[best], step, where.reach, budget.share(0.4))
    return known.scores()


def _descend(score: PlaceScore, known: "_Known", moved: Array, step: Array, reach: Array, budget: Budget) -> None:
    """Move a base by a step along x, y, z or yaw while that is better; then by smaller steps."""
    best, size, since = known.value(moved), 1.0, 0
    directions = [sign * step[j] * np.eye(4)[j] for j in range(4) for sign in (1.0, -1.0) if step[j] > 0.0]
    while directions and size > _FINEST and not budget.over:
        direction = directions[0]
        directions = [*directions[1:], direction]
        tried = np.clip(moved + size * direction, -reach, reach)
        value = known.value(tried) or known.add(tried, *score.at(tried))
        if best is not None and value < best:
            moved, best, since = tried, value, 0
            directions = [direction, *directions[:-1]]
        else:
            since += 1
        if since >= max(_FRESH, len(directions)):
            size, since = size * _SHRINKING, 0


class _Known:
    """Scores so far."""

    def __init__(self) -> None:
        self.rows: list[tuple[Array, int, float]] = []
        self._values: dict[bytes, tuple[int, float]] = {}

    def add(self, moved: Array, missing: int, seconds: float) -> tuple[int, float]:
        """Keep a score, and return it as one value to compare."""
        self.rows.append((moved, missing, seconds))
        self._values[np.round(moved, 9).tobytes()] = missing, seconds
        return missing, seconds

    def value(self, moved: Array) -> tuple[int, float] | None:
        """Return a known score."""
        return self._values.get(np.round(moved, 9).tobytes())

    def scores(self) -> PlaceScores:
        """Return all of them."""
        moved, missing, seconds = zip(*self.rows, strict=True)
        return PlaceScores(np.array(moved), np.array(missing, dtype=float), np.array(seconds))


def _grid(where: PlaceRange) -> tuple[Array, Array]:
    """Return the base poses of the map (k, 4), and its step (4,)."""
    counts = [where.points, where.points, max(2, where.points // 2), max(2, where.points // 2)]
    axes = [
        np.linspace(-reach, reach, count) if reach > 0.0 else np.zeros(1)
        for reach, count in zip(where.reach, counts, strict=True)
    ]
    steps = [axis[1] - axis[0] if len(axis) > 1 else 0.0 for axis in axes]
    return np.array(list(product(*axes))), np.array(steps)


def _places(problem: Problem) -> Iterator[Sequence[GoalEnd]]:
    """Yield the ends of each place of a problem in turn; of a tour with a free order the nearest next."""
    if not problem.task:
        for via in problem.vias:
            yield _regions((via.at,))
        yield _regions(problem.goal)
    main = problem.robot.joint_names
    for step in problem.task:
        action = step.action
        if isinstance(action, TargetTour):
            at = frame_pose(problem.robot, problem.start, action.carried_by) if action.carried_by else None
            goals = [target.goal if at is None else target.goal.moved(at) for target in action.targets]
            kept = np.unique(np.linspace(0, len(goals) - 1, _PLACES).astype(int)) if len(goals) > _PLACES else None
            goals = goals if kept is None else [goals[k] for k in kept]
            yield from ([goal] for goal in (_nearest_next(goals) if action.free else goals))
        elif isinstance(action, Move):
            leads = _leads(problem.robot, action.joints)
            ends = [end for end in action.goal if leads or not isinstance(end, JointGoal)]
            yield _regions([_of_all(problem, action.joints, end) for end in ends])
        elif isinstance(action, StraightLine) and action.ends and action.joints == main:
            yield _regions(action.ends)


def _leads(robot: Robot, joints: Sequence[str]) -> bool:
    """Whether some of these joints move a tool; fingers and positioners do not, so their values are no place of it."""
    own = columns(robot, joints)
    return any(joints_that_move(robot, frame)[own].any() for frame in {robot.tool_frame, *robot.tool_frames.values()})


def _of_known_frames(problem: Problem, ends: Sequence[GoalEnd]) -> list[GoalEnd]:
    """Return the ends of frames that the robot has at the start, so without those of objects that are held later."""
    model = problem.robot.model
    return [end for end in ends if not isinstance(end, RegionGoal) or model.existFrame(end.frame)]


def _of_all(problem: Problem, joints: Sequence[str], end: GoalEnd) -> GoalEnd:
    """Return an end of some joints as one of all, the others as at the start."""
    if not isinstance(end, JointGoal):
        return end
    q = np.array(problem.start)
    q[columns(problem.robot, joints)] = end.q
    return JointGoal(q)


def _regions(ends: Sequence[GoalEnd]) -> list[GoalEnd]:
    """Return ends with poses as regions of their tolerance; of several frames at once the first one is looked at."""
    found: list[GoalEnd] = []
    for end in (one.parts[0] if isinstance(one, AllOfGoal) else one for one in ends):
        if isinstance(end, PoseGoal):
            off = np.repeat([end.position, end.orientation], 3)
            found.append(RegionGoal(end.frame, end.X_WG, pin.SE3.Identity(), -off, off))
        else:
            found.append(end)
    return found


def _nearest_next(goals: Sequence[RegionGoal]) -> list[RegionGoal]:
    left = list(goals)
    order = [left.pop(0)]
    while left:
        here = order[-1].X_WR.translation
        k = int(np.argmin([np.linalg.norm(goal.X_WR.translation - here) for goal in left]))
        order.append(left.pop(k))
    return order
