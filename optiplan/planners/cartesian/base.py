"""Base of the planners of one tool path: follow it in joint space and time it, or report why that fails."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.cartesian.branch_change import Branch, other_branches
from optiplan.planners.cartesian.diagnosis import farthest_failure
from optiplan.planners.cartesian.differential_ik import LIMIT_AVOIDANCES, Aim, Tracker, coupled_frames
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import ToolPath
from optiplan.planners.common.context import PlanContext
from optiplan.planners.common.failures import out_of_time, path_too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.region_poses import single_ends, with_poses
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.timing.time_path import Method, TimingOptions, ToolLimits, time_path
from optiplan.trajectory.trajectory import Trajectory

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
    duration: float | None = option(None, "s; None is the shortest within all limits.", above=0)
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
        for k, (branch, task, aim) in enumerate(self._attempts(work, tasks, goals)):
            if budget.over:
                return PlanResult(None, out_of_time(budget, "following tool paths"), seconds)
            progress("following", k / (k + 1.0))
            found = self._attempt(work, task, branch, aim)
            if isinstance(found, Trajectory):
                info = {"tool_length": task.path.length, "tool_angle": task.path.angle, "attempts": k + 1}
                info |= {"branch_changed": branch.changed, "cut_short": budget.over}
                return PlanResult(found, None, seconds, info)
            failures.append(replace(found, detail=f"on another branch, {found.detail}") if branch.changed else found)
        if budget.over:
            return PlanResult(None, out_of_time(budget, "following tool paths"), seconds)
        return PlanResult(None, farthest_failure(goals, failures), seconds)

    def _attempt(self, work: PlanContext, task: _Task, branch: Branch, aim: Aim) -> Trajectory | Failure:
        """Return the motion on one branch, or why there is none."""
        with work.watch.stage("following"):
            followed = follow(work.model, task.path, task.frame, branch.q, work.budget, aim)
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

    def _attempts(
        self, work: PlanContext, tasks: list[_Task], goals: list[Array] | Failure
    ) -> Iterator[tuple[Branch, _Task, Aim]]:
        """Yield the start's own branch for every task, then, with `change_branch`, the others."""
        ends = [] if isinstance(goals, Failure) else goals
        for task in tasks:
            for aim in self._aims(work.problem, task, ends):
                yield Branch(work.problem.start), task, aim
        for task in tasks if self.options.change_branch else ():
            with work.watch.stage("goals"):
                count = self.options.goals
                branches = other_branches(work.problem, task.frame, work.model, work.budget, count, task.goal)
            for branch in branches:
                yield branch, task, self._plain(work.problem, task)

    def _plain(self, problem: Problem, task: _Task) -> Aim:
        return Aim(task.goal, LIMIT_AVOIDANCES[0], task.orientation, coupled_frames(problem, task.frame))

    def _aims(self, problem: Problem, task: _Task, ends: list[Array]) -> Iterator[Aim]:
        """Yield the plain aim; for a redundant arm also aims that avoid limits more, or end in a goal configuration."""
        plain = self._plain(problem, task)
        yield plain
        tracker = Tracker(problem.robot, task.frame, task.path, plain)
        if tracker.redundant:
            yield replace(plain, avoidance=LIMIT_AVOIDANCES[1])
            exact = [] if task.goal is not None else [tracker.correct(1.0, q) for q in ends]
            yield from (replace(plain, goal=q) for q in exact if q is not None)

    def _timed(self, work: PlanContext, followed: Trajectory, frame: str) -> Trajectory | Failure:
        o = self.options
        given = {"linear": o.speed, "angular": o.angular_speed, "linear_acceleration": o.acceleration}
        limits = {name: value for name, value in given.items() if value is not None}
        for one in work.problem.path_constraints:
            if isinstance(one, ToolSpeed) and one.frame == frame:
                wanted = {"linear": one.linear, "angular": one.angular}
                limits |= {name: min(value, limits.get(name, np.inf)) for name, value in wanted.items()}
        tool = ToolLimits(frame, **limits) if limits else None
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
