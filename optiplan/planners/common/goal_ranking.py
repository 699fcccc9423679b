"""Rank goal configurations that are free and within the torque limits; sample more on request."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.poses import pose_error
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import end_collides, end_too_heavy, out_of_time
from optiplan.planners.common.gravity import Gravity
from optiplan.problem.goals import SHARE, GoalOptions, goal_configurations
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.problem import GoalEnd, JointGoal, PoseGoal, Problem, RegionGoal
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.lower_bound import joint_times

if TYPE_CHECKING:
    from optiplan.planners.common.goal_improvement import NearerEnds

# Inverse kinematics is imported by the first goal of a pose: many problems go from joints to joints.

_LOOKING = 0.25  # share of the budget after which it is a failure that all goal configurations collide
_STARTS = 40  # inverse kinematics runs for each configuration requested of `more`, at most
_DISTINCT = 0.1  # rad or m: least difference of sampled configurations
_DISTINCT_MOVED = 0.02  # rad or m: the same of configurations moved towards the start
_ITERATIONS = 60  # of one run of the inverse kinematics
Box: TypeAlias = tuple[Array, Array]
"""Lower and upper bounds (n,) of configurations, within the limits, rad or m."""
_APART = 0.1
"""s at full speed of some joint: ends that are nearer to each other are one."""

_DRAWS, _IN_VAIN = 300, 15
"""Configurations drawn for ends within some time of the start, at most, and the number of failures in a row that ends
it: the chance of another end is 1 / 17 then, by Laplace's rule of succession."""
_FINE = 1e-3, 1e-2  # m and rad: within smaller tolerances all configurations collide if one does


def ranked_goals(
    problem: Problem, model: CollisionModel, budget: Budget, count: int = 8, *, nearer: bool = True
) -> list[Array] | Failure:
    """Return up to `count` goal configurations (n,), the one with the smallest lower bound first.

    With `nearer`, also those moved towards the start within the tolerance and the redundancy; without, all of a pose
    goal are within half its tolerance.

    Failure kinds: `start-in-collision`, `goal-unreachable`, `goal-in-collision`, `infeasible` (gravity exceeds the
    torque limits at the start or at all goals), `cancelled`, `budget`.
    """
    found = goal_sampler(problem, model, budget, count, nearer=nearer)
    return found if isinstance(found, Failure) else found.configurations[:count]


def goal_sampler(
    problem: Problem,
    model: CollisionModel,
    budget: Budget,
    count: int = 8,
    *,
    nearer: bool = True,
    moved: int | None = None,
) -> "GoalSampler | Failure":
    """Return a source of goal configurations that has found at least one, or a Failure; see `ranked_goals`.

    It fails when all goal configurations collide and the list is complete or a quarter of the budget is used up. The
    `moved` best are moved towards the start now, the others of the first `count` when more are wanted; None: all now.
    """
    gravity = Gravity(problem.robot, problem.limits.torque)
    if model.collides(problem.start):
        return end_collides(model, problem.start, "start")
    if gravity.too_much(problem.start):
        return end_too_heavy(gravity, problem.start[None], "start")
    options = GoalOptions(count, stop=lambda: budget.over)
    sampler = GoalSampler(problem, model, problem.seed, options, nearer, gravity, moved)
    looking = budget.share(_LOOKING)
    while not sampler.configurations and sampler.reachable and not sampler.complete and not looking.over:
        sampler.more(1, lambda: looking.over)
    if sampler.configurations or sampler.failure is None:
        return sampler
    if budget.over:
        return out_of_time(budget, "looking for goal configurations")
    return sampler.failure


class GoalSampler:
    """Goal configurations of a problem, extended on request; deterministic for a problem, a seed and the calls made.

    Attributes:
        configurations: (n,) each, free and within the torque limits, the one with the smallest lower bound first.
        complete: whether no others exist: joint goals, and poses with fine tolerances for which a closed form has
            found all branches.
        reachable: whether any configuration reaches the goal, in collision or not.
        failure: why no initial configuration was found; None if one was.
    """

    def __init__(
        self,
        problem: Problem,
        model: CollisionModel,
        seed: int,
        options: GoalOptions | None = None,
        nearer: bool = True,
        gravity: Gravity | None = None,
        moved: int | None = None,
    ) -> None:
        """Find the first configurations; with `nearer` also those moved towards the start, at first `moved`."""
        options = options or GoalOptions()
        self._problem, self._model = problem, model
        self._gravity = gravity or Gravity(problem.robot, problem.limits.torque)
        self._rng = np.random.default_rng(seed)
        poses = [goal for goal in problem.goal if not isinstance(goal, JointGoal)]
        single = [goal for goal in poses if not isinstance(goal, AllOfGoal)]
        self._nearer = [_nearer(problem, goal) for goal in single] if nearer else []
        self._drawn: list[Array] = []
        self._slid: list[Array] = []
        self._nearest: list[Array] = []
        self.configurations: list[Array] = []
        first = goal_configurations(problem, model, self._rng, replace(options, count=4 * options.count))
        held = [q for q in first.configurations if not self._gravity.too_much(q)]
        self.complete = all(_complete(problem, goal) for goal in problem.goal)
        self.reachable = first.kind != "goal-unreachable"
        self.failure = None if first.kind is None else Failure(first.kind, first.reason, first.witness)
        if first.configurations and not held:
            self.failure = end_too_heavy(self._gravity, np.array(first.configurations), "goal")
        self._drawn += held
        ranked = self._ranked(held)
        self.configurations = ranked
        self._unmoved = ranked[: options.count]
        self.move(options.stop, moved)
        draws = [_draw(problem, goal, self._rng) for goal in poses]
        self._draws = (draw() for draw in cycle(draws))
        systematic = np.random.default_rng(0)
        self._within = [_draw(problem, goal, systematic) for goal in poses]

    def move(self, stop: Callable[[], bool] = lambda: False, count: int | None = None) -> None:
        """Add those moved towards the start from the next `count` of the first configurations, or all; until `stop`."""
        count = len(self._unmoved) if count is None else count
        now, self._unmoved = self._unmoved[:count], self._unmoved[count:]
        self._add([end for q in now if not stop() for end in self._sooner(q)])

    def more(self, count: int, stop: Callable[[], bool] = lambda: False) -> list[Array]:
        """Return up to `count` new configurations, with those moved from them towards the start.

        They are added to `configurations`; ends early, perhaps with none, when `stop` returns True or after 40
        failed runs of the inverse kinematics for each.
        """
        self.move(stop)
        new: list[Array] = []
        for _ in range(0 if self.complete else _STARTS * count):
            if len(new) >= count or stop():
                break
            q = next(self._draws)
            if q is None or any(np.abs(q - other).max() <= _DISTINCT for other in self._drawn):
                continue
            self._drawn.append(q)
            if self._good(q):
                new.append(q)
        new += [end for q in new if not stop() for end in self._sooner(q)]
        return self._add(new)

    def nearest_ends(self, soonest: float, stop: Callable[[], bool] = lambda: False) -> list[Array]:
        """Return the ends (n,) that may be reached sooner than in `soonest` s: one of each branch, by their bounds.

        An end of a branch is a local minimum of the bound among the free configurations of a goal. Configurations
        slide along obstacles, limits and the redundancy until none is nearer. Other branches are drawn from the
        configurations that each joint alone can reach in that time; no such end lies outside of them. They come from
        one stream of numbers, whatever the seed. All that are found join `configurations`.
        """
        new = [end for q in list(self.configurations) if not stop() for end in self._branch_of(q)]
        box, vain = self._reach(soonest), 0
        for k in range(0 if self.complete or not self._within else _DRAWS):
            if stop() or vain >= _IN_VAIN:
                break
            q = self._within[k % len(self._within)](box)
            if q is None or not self._good(q):
                continue
            ends = [end for end in self._branch_of(q) if self._problem.lower_bounds([end])[0] < soonest]
            vain = 0 if ends else vain + 1
            new += ends
        self._add(new)
        bounds = self._problem.lower_bounds(self._nearest) if self._nearest else np.zeros(0)
        return [self._nearest[k] for k in np.argsort(bounds, kind="stable") if bounds[k] < soonest]

    def within(self, soonest: float, count: int, stop: Callable[[], bool] = lambda: False) -> list[Array]:
        """Return up to `count` free configurations (n,) with bounds below `soonest`, s, drawn from that one stream."""
        found: list[Array] = []
        box = self._reach(soonest)
        for k in range(0 if self.complete or not self._within else _STARTS * count):
            if stop() or len(found) >= count:
                break
            q = self._within[k % len(self._within)](box)
            if q is not None and self._good(q) and self._problem.lower_bounds([q])[0] < soonest:
                found.append(q)
        return found

    def _branch_of(self, q: Array) -> list[Array]:
        """Return the end of the branch of a free configuration (n,), if it is a new one."""
        if any(np.array_equal(q, other) for other in self._slid):
            return []
        self._slid.append(q)
        limits = self._problem.limits
        ends = [nearer.towards_start(q, self._model) for nearer in self._nearer if nearer.contains(q)]
        found = [passed[-1] for passed in ends if passed] or [q]
        new = [
            end
            for end in found
            if all(are_distinct(end, other, limits) for other in self._nearest) and not self._gravity.too_much(end)
        ]
        self._nearest += new
        self._slid += new
        return new

    def _reach(self, duration: float) -> Box:
        """Return the bounds (n,) of the configurations that each joint alone may reach from the start in so many s."""
        limits, start = self._problem.limits, self._problem.start
        distances = np.append(0.0, np.geomspace(1e-4, 100.0, 400))
        times = joint_times(np.repeat(distances[:, None], len(start), axis=1), limits)
        far = np.array([np.interp(duration, of_joint, distances) for of_joint in times.T])
        return np.maximum(limits.lower, start - far), np.minimum(limits.upper, start + far)

    def add(self, q: Array) -> None:
        """Add a free configuration (n,) in the goal from elsewhere, if gravity allows it, in place of those near it."""
        if not self._gravity.too_much(q):
            far = [other for other in self.configurations if np.abs(q - other).max() > _DISTINCT_MOVED]
            self.configurations = self._ranked([*far, q])

    def _add(self, found: list[Array]) -> list[Array]:
        """Insert new configurations by rank."""
        new: list[Array] = []
        for q in found:
            if all(np.abs(q - other).max() > _DISTINCT_MOVED for other in (*self.configurations, *new)):
                new.append(q)
        self.configurations = self._ranked([*self.configurations, *new])
        return self._ranked(new)

    def _ranked(self, found: list[Array]) -> list[Array]:
        if not found:
            return []
        bounds = self._problem.lower_bounds(found)
        return [found[k] for k in np.argsort(bounds, kind="stable")]

    def _good(self, q: Array) -> bool:
        return not self._gravity.too_much(q) and not self._model.collides(q)

    def _sooner(self, q: Array) -> Iterator[Array]:
        """Return, for each pose goal that holds q (n,), the free configuration nearest to the start on its way."""
        for ends in self._nearer:
            if ends.contains(q):
                passed = ends.towards_start(q)
                yield from [end for end in passed[::-1] if self._good(end)][:1]


def _nearer(problem: Problem, goal: PoseGoal | RegionGoal) -> "NearerEnds":
    """Return what moves configurations in a goal towards the start."""
    from optiplan.planners.common.goal_improvement import NearerEnds

    return NearerEnds(problem, goal)


def _draw(problem: Problem, goal: PoseGoal | RegionGoal | AllOfGoal, rng: np.random.Generator) -> "_Draw | _RegionDraw":
    """Return what gives a random configuration (n,) in a goal, or None if its initial guess does not converge."""
    return _Draw(problem, goal, rng) if isinstance(goal, PoseGoal) else _RegionDraw(problem, goal, rng)


def _guess(problem: Problem, moving: npt.NDArray[np.bool_], rng: np.random.Generator, box: Box | None) -> Array:
    """Return a random configuration (n,) within a box, by default the limits; joints that are not `moving` stay."""
    from optiplan.kinematics.ik.numeric import random_seeds

    q = random_seeds(problem.robot, problem.start, rng, 1)[0] if box is None else rng.uniform(*box)
    return np.where(moving, q, problem.start)


class _RegionDraw:
    """Random configurations in a region, or in the places of several frames, from random initial guesses."""

    def __init__(self, problem: Problem, goal: RegionGoal | AllOfGoal, rng: np.random.Generator) -> None:
        from optiplan.problem.regions.together import joints_of, sampler_of

        self._problem, self._moving, self._rng = problem, joints_of(problem.robot, goal), rng
        self._sampler = sampler_of(problem.robot, goal)

    def __call__(self, box: Box | None = None) -> Array | None:
        """Return a configuration (n,) from a guess within a box; None if it does not converge."""
        q, inside = self._sampler.drawn(_guess(self._problem, self._moving, self._rng, box), self._rng)
        return q if inside else None


class _Draw:
    """Random configurations that reach a pose, from random initial guesses and random targets within the tolerance."""

    def __init__(self, problem: Problem, goal: PoseGoal, rng: np.random.Generator) -> None:
        from optiplan.kinematics.ik.levenberg_marquardt import Descent
        from optiplan.problem.regions.together import joints_of

        self._problem, self._goal, self._rng = problem, goal, rng
        self._moving = joints_of(problem.robot, goal)
        self._descent = Descent(problem.robot, goal.frame, goal.orientation < np.pi)

    def __call__(self, box: Box | None = None) -> Array | None:
        """Return a configuration (n,) within half the tolerance, in a box; None if this guess does not converge."""
        goal, seed = self._goal, _guess(self._problem, self._moving, self._rng, box)
        if box is not None:
            self._descent.hold_within(*box)
        self._descent.aim(self._target())
        q = self._descent.descend(seed, _ITERATIONS)
        position, angle = pose_error(self._descent.place(q), goal.X_WG)
        reached = position <= SHARE * goal.position and (goal.orientation >= np.pi or angle <= SHARE * goal.orientation)
        return q if reached else None

    def _target(self) -> pin.SE3:
        """Return a pose drawn uniformly within 0.45 of the tolerance; the pose itself where that is fine."""
        goal = self._goal
        target = pin.SE3(goal.X_WG)
        shift, turn = (0.9 * SHARE * self._ball() for _ in range(2))
        if goal.position > _FINE[0]:
            target.translation = target.translation + goal.position * shift
        if _FINE[1] < goal.orientation < np.pi:
            target.rotation = pin.exp3(goal.orientation * turn) @ target.rotation
        return target

    def _ball(self) -> Array:
        """Return a uniform point (3,) of the unit ball."""
        direction = self._rng.standard_normal(3)
        return np.asarray(direction / np.linalg.norm(direction) * self._rng.uniform() ** (1.0 / 3.0))


def are_distinct(q: Array, other: Array, limits: Limits) -> bool:
    """Return whether two ends (n,) are not one: some joint takes a tenth of a second from one to the other."""
    return float((np.abs(q - other) / limits.velocity).max()) > _APART


def _complete(problem: Problem, goal: GoalEnd) -> bool:
    """Return whether all configurations of an alternative are found at once."""
    if isinstance(goal, JointGoal):
        return True
    if isinstance(goal, RegionGoal | AllOfGoal):
        return False
    from optiplan.kinematics.ik.closed_form import closed_form

    fine = goal.position <= _FINE[0] and goal.orientation <= _FINE[1]
    closed = closed_form(problem.robot, goal.frame) if fine else None
    if closed is None:
        return False
    found = closed.solve(goal.X_WG.homogeneous[None])
    return not found.singular[0, found.valid[0]].any()
