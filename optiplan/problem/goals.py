"""Goals as sets: the configurations in them."""

from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.collision.model import CollisionModel
from optiplan.kinematics.ik.joint_wraps import apart, endless_turns, whole_turns
from optiplan.problem.goals_and_vias import AllOfGoal, ExactGoal
from optiplan.problem.problem import GoalEnd, JointGoal, PoseGoal, Problem
from optiplan.problem.regions.region import RegionGoal
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan.kinematics.ik.numeric import IkResult


NoGoal = Literal["goal-unreachable", "goal-in-collision"]
"""Why no configuration is in the goal: none reaches it, or all that do are in collision."""

_DISTINCT = 0.1  # rad or m: least difference of configurations in a region
_MOST_TURNS = 64  # images by whole turns of a stated configuration: of six endless joints all
SHARE = 0.5  # share of a tolerance that a solution may use; the rest is for the error of planning


@dataclass(frozen=True)
class GoalOptions:
    """Options of the search for goal configurations.

    Attributes:
        count: how many to return, at most.
        solutions: of the inverse kinematics of a pose, before collisions are looked at.
        attempts: random starts of the inverse kinematics of a pose.
        stop: polled between starts.
    """

    count: int = 8
    solutions: int = 24
    attempts: int = 100
    stop: Callable[[], bool] = field(default=lambda: False)


@dataclass(frozen=True, eq=False)
class GoalSet:
    """Configurations in the goal, or the reason why there are none.

    Attributes:
        configurations: free, within limits, distinct; nearest to the start first; each (n,).
        kind: why there are none; None where there are some.
        reason: one sentence for a person when there are none.
        witness: JSON-ready: the nearest miss, or the configuration in collision with bodies, points and depth.
    """

    configurations: list[Array]
    kind: NoGoal | None = None
    reason: str = ""
    witness: dict[str, Any] = field(default_factory=dict)


def listed_ends(problem: Problem) -> list[Array]:
    """Return the configurations (n,) that the goal lists, joints without limits at the turns nearest to the start."""
    listed = [goal for goal in problem.goal if isinstance(goal, JointGoal)]
    return [q for goal in listed for q in turned(problem.robot, goal, problem.start)]


def turned(robot: Robot, goal: JointGoal, near: Array) -> list[Array]:
    """Return the configurations that are at a goal but for whole turns of endless joints, the nearest (n,) first."""
    return [goal.q] if isinstance(goal, ExactGoal) else endless_turns(robot, goal.q, near, _MOST_TURNS)


def goal_configurations(
    problem: Problem, model: CollisionModel, rng: np.random.Generator, options: GoalOptions | None = None
) -> GoalSet:
    """Return distinct, free configurations of all alternatives, ordered by the time at full speed from the start."""
    options = options or GoalOptions()
    free: list[Array] = []
    refusals: list[GoalSet] = []
    for goal in problem.goal:
        candidates = _candidates(problem, goal, rng, options)
        if isinstance(candidates, GoalSet):
            refusals.append(candidates)
            continue
        good = [q for q in candidates if not model.collides(q)]
        if not good:
            refusals.append(_all_collide(model, candidates))
        moving = None if isinstance(goal, JointGoal) else _moving(problem.robot, goal)
        for q in good:
            images = [q] if moving is None else whole_turns(problem.robot, q, problem.start, options.count, moving)
            known = np.array(free).reshape(-1, len(q))
            free += [image for image in images if not (np.abs(known - image).max(axis=1) < 1e-6).any()]
    if not free:
        return refusals[0] if len(refusals) == 1 else _join(refusals)
    free.sort(key=lambda q: float((np.abs(q - problem.start) / problem.limits.velocity).max()))
    return GoalSet(free[: options.count])


def _candidates(
    problem: Problem, goal: GoalEnd, rng: np.random.Generator, options: GoalOptions
) -> list[Array] | GoalSet:
    if isinstance(goal, JointGoal):
        return turned(problem.robot, goal, problem.start)
    from optiplan.kinematics.ik.numeric import random_seeds

    robot = problem.robot
    moving = _moving(robot, goal)
    named = [np.where(moving, q, problem.start) for q in (problem.start, *robot.configurations.values())]
    drawn = random_seeds(robot, problem.start, rng, options.attempts)
    seeds = [np.where(moving, q, problem.start) for q in drawn]
    if isinstance(goal, RegionGoal | AllOfGoal):
        return _in_region(robot, goal, (named, seeds), rng, options)
    return _solve(robot, goal, named + seeds, options)


def _moving(robot: Robot, goal: PoseGoal | RegionGoal | AllOfGoal) -> Flags:
    from optiplan.problem.regions.together import joints_of

    return joints_of(robot, goal)


def _in_region(
    robot: Robot,
    goal: RegionGoal | AllOfGoal,
    seeds: tuple[list[Array], list[Array]],
    rng: np.random.Generator,
    options: GoalOptions,
) -> list[Array] | GoalSet:
    """Named configurations brought into the region, then random ones to poses drawn from it."""
    from optiplan.kinematics.ik.numeric import IkResult
    from optiplan.problem.regions.together import sampler_of

    sampler, named = sampler_of(robot, goal), seeds[0]
    found: list[Array] = []
    least = IkResult(found, named[0], np.inf, np.inf)
    for k, seed in enumerate(named + seeds[1]):
        q, inside = sampler.onto(seed) if k < len(named) else sampler.drawn(seed, rng)
        if inside and all(apart(robot, q, other) > _DISTINCT for other in found):
            found.append(q)
        miss = sampler.miss(q)
        if sum(miss) < least.position_error + least.orientation_error:
            least = IkResult(found, q, *miss)
        if len(found) >= options.solutions or options.stop():
            break
    return found or _unreachable(goal, least)


def _solve(robot: Robot, goal: PoseGoal, seeds: list[Array], options: GoalOptions) -> list[Array] | GoalSet:
    from optiplan.kinematics.ik.numeric import IkOptions
    from optiplan.kinematics.ik.solve import inverse_kinematics

    tolerance = IkOptions(goal.position * SHARE, goal.orientation * SHARE, options.solutions, stop=options.stop)
    if goal.orientation >= np.pi:
        tolerance = replace(tolerance, orientation=goal.orientation)
    found = inverse_kinematics(robot, goal.frame, goal.X_WG, seeds, tolerance)
    return found.solutions or _unreachable(goal, found)


def _unreachable(goal: PoseGoal | RegionGoal | AllOfGoal, found: "IkResult") -> GoalSet:
    where = "at the goal pose" if isinstance(goal, PoseGoal) else "in the goal region"
    if isinstance(goal, AllOfGoal):
        puts = f"puts {' and '.join(repr(part.frame) for part in goal.parts)} in their places at once"
    else:
        puts = f"puts '{goal.frame}' {where}"
    reason = (
        f"no configuration within the joint limits {puts}; the nearest found misses by "
        f"{found.position_error:.3g} m and {found.orientation_error:.3g} rad"
    )
    witness = {
        "q": found.nearest.tolist(),
        "position_error": found.position_error,
        "orientation_error": found.orientation_error,
    }
    return GoalSet([], "goal-unreachable", reason, witness)


def _all_collide(model: CollisionModel, candidates: list[Array]) -> GoalSet:
    """Report the bodies of the candidate with the least penetration, or a joint where all are too near a limit."""
    many = "the goal configuration is" if len(candidates) == 1 else f"all {len(candidates)} goal configurations are"
    within = [q for q in candidates if model.beyond_limits(q) is None]
    if not within:
        reason = f"{many} too near a limit of position: {model.beyond_limits(candidates[0])}"
        return GoalSet([], "goal-in-collision", reason, {"q": candidates[0].tolist()})
    contacts = [(q, contact) for q in within if (contact := model.clearance(q)) is not None]
    q, contact = max(contacts, key=lambda item: item[1].distance)
    names = [contact.pair.name_a, contact.pair.name_b]
    or_limits = "" if len(within) == len(candidates) else " or too near a limit of position"
    reason = f"{many} in collision{or_limits}; the least of it: {contact.overlap}"
    witness = {
        "q": q.tolist(),
        "pair": names,
        "points": [contact.point_a.tolist(), contact.point_b.tolist()],
        "distance": contact.bodies_apart,
    }
    return GoalSet([], "goal-in-collision", reason, witness)


def _join(refusals: list[GoalSet]) -> GoalSet:
    kinds = {refusal.kind for refusal in refusals}
    kind: NoGoal = "goal-in-collision" if "goal-in-collision" in kinds else "goal-unreachable"
    reason = "; ".join(f"alternative {k}: {refusal.reason}" for k, refusal in enumerate(refusals))
    return GoalSet([], kind, reason, {"alternatives": [refusal.witness for refusal in refusals]})
