"""Base of the planners of one tool path: follow it in joint space and time it, or report why that fails."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, silent
from optiplan.planners.cartesian.diagnosis import SINGULAR, farthest_failure, smallest_singular_value
from optiplan.planners.cartesian.differential_ik import LIMIT_AVOIDANCES, Aim, Tracker, coupled_frames
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import ToolPath, line
from optiplan.planners.common.context import PlanContext
from optiplan.planners.common.failures import out_of_time, path_too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.region_poses import single_ends, with_poses
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.planners.path_constraints.tool_limits import tool_limits
from optiplan.planners.point_to_point.quintic import Quintic
from optiplan.planners.sampling.tree_planners import RrtConnect
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, derived
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.timing.time_path import Method, TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory

_OTHER = 1e-3  # rad or m: configurations that differ by less are one
_METHODS: dict[str, Method] = {"trapezoid": "toppra", "jerk": "jerk", "uniform": "uniform"}


@dataclass(frozen=True)
class ToolMotionOptions(PlannerOptions):
    """Options of every planner of this family."""

    speed: float | None = option(None, "of the tool, m/s, at most.", above=0)
    angular_speed: float | None = option(None, "rad/s, at most.", above=0)
    acceleration: float | None = option(None, "of the tool, m/s², at most.", above=0)
    profile: Literal["trapezoid", "jerk", "uniform"] | None = option(
        None,
        "`trapezoid` runs at the limits and lets the acceleration jump, which only `limits: {jerk: none}` in the "
        "problem allows; `jerk` keeps jerk limits; `uniform` is one S-curve, everywhere slowed down alike. None: "
        "`jerk` where there are jerk limits, else `trapezoid`.",
    )
    duration: float | None = option(
        None,
        "s, of the tool's path, without a change of branch before it; None is the shortest within all limits.",
        above=0,
    )
    free_orientation: bool = option(False, "only the position is prescribed.")
    change_branch: bool = option(
        False, "if the start's branch of the inverse kinematics leads nowhere, move to another one first."
    )
    goals: int = option(
        8, "how many goal configurations a redundant arm may aim at, or branches may be changed to.", above=0
    )


Options = TypeVar("Options", bound=ToolMotionOptions)


@dataclass(frozen=True, eq=False)
class _Task:
    """One alternative of the goal: the frame, its path, whether its orientation counts, and the end if prescribed."""

    frame: str
    path: ToolPath
    orientation: bool
    goal: Array | None


@dataclass(frozen=True, eq=False)
class _Branch:
    """A configuration q (n,) with the tool at its start pose; `changed` if it is not the start."""

    q: Array
    changed: bool = False

    def before(self, problem: Problem, motion: Trajectory, budget: Budget) -> Trajectory | Failure:
        """Return the motion from the problem's start to q and then the given one, or why there is no way to q."""
        if not self.changed:
            return motion
        there = derived(problem, goal=(JointGoal(self.q, 1e-9),), vias=())
        reasons = []
        for planner in (Quintic(), RrtConnect()):
            result = planner.plan(there, budget.share(0.5), silent)
            if result.trajectory is not None:
                return join_trajectories([result.trajectory, motion])
            reasons.append(result.failure)
        return reasons[-1] or Failure("no-path", "no way to another branch")


class _Trial(NamedTuple):
    """What is tried: a task on one branch, with one use of the redundancy."""

    branch: _Branch
    task: _Task
    aim: Aim


class ToolMotion(Planner[Options]):
    """A planner is this class and its `path`.

    It holds only path constraints that the tool path meets by itself; the verifier decides.
    """

    holds_constraints = True

    @abstractmethod
    def path(self, start: pin.SE3, goal: pin.SE3, tolerance: tuple[float, float]) -> ToolPath:
        """The tool's path between two poses of the frame in the world.

        Args:
            start: X_WF where the robot stands.
            goal: X_WF that is wanted.
            tolerance: of the goal, m and rad.

        Raises:
            InputError: the options do not go with these poses.
        """

    def check(self, problem: Problem, budget: Budget) -> None:
        """Return the issues of the options known without planning; none with vias, which are passed leg by leg.

        Raises:
            InputError: they do not go with the start and any of the goals.
        """
        if not problem.vias:
            self._tasks(problem)

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`.

        Raises:
            InputError: the options do not go with the start and any of the goals.
        """
        problem = with_poses(problem)
        work = PlanContext.of(problem, budget)
        seconds = work.watch.seconds
        with work.watch.stage("goals"):
            goals = ranked_goals(problem, work.model, budget, self.options.goals, nearer=False)
        if isinstance(goals, Failure) and goals.kind != "goal-unreachable":
            return PlanResult(None, goals, seconds)
        tasks, failures = self._tasks(problem), list[Failure]()
        for k, one in enumerate(self._attempts(work, tasks, goals)):
            if budget.over:
                return PlanResult(None, out_of_time(budget, "following tool paths"), seconds)
            progress("following", k / (k + 1.0))
            found, changed = self._attempt(work, one), one.branch.changed
            if isinstance(found, Trajectory):
                info = {"tool_length": one.task.path.length, "tool_angle": one.task.path.angle, "attempts": k + 1}
                info |= {"branch_changed": changed, "cut_short": budget.over}
                return PlanResult(found, None, seconds, info)
            failures.append(replace(found, detail=f"on another branch, {found.detail}") if changed else found)
        if budget.over:
            return PlanResult(None, out_of_time(budget, "following tool paths"), seconds)
        return PlanResult(None, farthest_failure(goals, failures), seconds)

    def _attempt(self, work: PlanContext, one: _Trial) -> Trajectory | Failure:
        """Return the motion on one branch, or why there is none."""
        branch, task = one.branch, one.task
        with work.watch.stage("following"):
            tracker = Tracker(work.problem.robot, work.problem.limits, task.frame, task.path, one.aim)
            followed = follow(work.model, tracker, branch.q, work.budget)
        if isinstance(followed, Failure):
            return followed
        with work.watch.stage("timing"):
            timed = self._timed(work, followed, task.frame)
        if isinstance(timed, Failure):
            return timed
        with work.watch.stage("approach"):
            return branch.before(work.problem, timed, work.budget)

    def _tasks(self, problem: Problem) -> list[_Task]:
        """Return the alternatives of the goal that fit the options."""
        tasks, refused, robot = [], [], problem.robot
        for goal in single_ends(problem):
            frame = goal.frame if isinstance(goal, PoseGoal) else robot.tool_frame
            start, oriented, end = frame_pose(robot, problem.start, frame), not self.options.free_orientation, None
            if isinstance(goal, JointGoal):
                X, tolerance, end = frame_pose(robot, goal.q, frame), (goal.tolerance, goal.tolerance), goal.q
            else:
                X, tolerance = goal.X_WG, (goal.position, goal.orientation)
                oriented = oriented and goal.orientation < np.pi
            try:
                tasks.append(_Task(frame, self.path(start, X, tolerance), oriented, end))
            except InputError as error:
                refused.append(error)
        if not tasks:
            raise refused[0]
        return tasks

    def _attempts(self, work: PlanContext, tasks: list[_Task], goals: list[Array] | Failure) -> Iterator[_Trial]:
        """Yield the start's own branch for every task, then, with `change_branch`, the others."""
        ends = [] if isinstance(goals, Failure) else goals
        for task in tasks:
            for aim in self._aims(work.problem, task, ends):
                yield _Trial(_Branch(work.problem.start), task, aim)
        for task in tasks if self.options.change_branch else ():
            with work.watch.stage("goals"):
                branches = _other_branches(work, task, self.options.goals)
            for branch in branches:
                yield _Trial(branch, task, self._plain(work.problem, task))

    def _plain(self, problem: Problem, task: _Task) -> Aim:
        return Aim(task.goal, LIMIT_AVOIDANCES[0], task.orientation, coupled_frames(problem, task.frame))

    def _aims(self, problem: Problem, task: _Task, ends: list[Array]) -> Iterator[Aim]:
        """Yield the plain aim; for a redundant arm also aims that avoid limits more, or end in a goal configuration."""
        plain = self._plain(problem, task)
        yield plain
        tracker = Tracker(problem.robot, problem.limits, task.frame, task.path, plain)
        if tracker.redundant:
            yield replace(plain, avoidance=LIMIT_AVOIDANCES[1])
            exact = [] if task.goal is not None else [tracker.correct(1.0, q) for q in ends]
            yield from (replace(plain, goal=q) for q in exact if q is not None)

    def _timed(self, work: PlanContext, followed: Trajectory, frame: str) -> Trajectory | Failure:
        o = self.options
        asked = (np.inf if rate is None else rate for rate in (o.speed, o.angular_speed, o.acceleration))
        tool = tool_limits(work.problem, frame, *asked)
        method = None if o.profile is None else _METHODS[o.profile]
        robot, joint_limits = work.problem.robot, work.problem.limits
        timed = time_path(followed, robot, joint_limits, TimingOptions(method, tool, stop=lambda: work.budget.over))
        if timed is None:
            return path_too_heavy(robot, joint_limits, followed)
        if o.duration is None:
            return timed
        if o.duration < timed.duration:
            detail = (
                f"the path takes {timed.duration:.4g} s within all limits; a duration of {o.duration:.4g} s is asked"
            )
            return Failure("limits", detail, {"q": work.problem.start.tolist(), "duration": timed.duration})
        return timed.scaled(o.duration)


def _other_branches(work: PlanContext, task: _Task, count: int) -> list[_Branch]:
    """Return `count` other free configurations with the frame at its start pose, the soonest reached first.

    With a prescribed end, the nearest to it come first: they are on its branch. Singular ones come last: at a singular
    pose there are any number of them, and no path may leave them.
    """
    problem, X = work.problem, frame_pose(work.problem.robot, work.problem.start, task.frame)
    near = problem.start if task.goal is None else task.goal
    there = derived(problem, start=near, goal=(PoseGoal(task.frame, X),), vias=())
    aim = Aim(coupled=coupled_frames(problem, task.frame))
    here = Tracker(problem.robot, problem.limits, task.frame, line(X, X), aim)
    many = 4 if smallest_singular_value(here, problem.start) <= SINGULAR else 1
    goals = ranked_goals(there, work.model, work.budget, many * (count + 1), nearer=False)
    exact = [here.correct(0.0, q) for q in ([] if isinstance(goals, Failure) else goals)]
    others = [q for q in exact if q is not None and np.abs(q - problem.start).max() > _OTHER]
    others.sort(key=lambda q: smallest_singular_value(here, q) <= SINGULAR)
    return [_Branch(q, changed=True) for q in others[:count]]
