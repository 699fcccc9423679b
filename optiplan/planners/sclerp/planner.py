"""`sclerp`: for each goal, the joint path of the chosen scheme, checked for collisions, then timed."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.cartesian.diagnosis import farthest_failure
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.failures import out_of_time, path_too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.region_poses import single_ends, with_poses
from optiplan.planners.path_constraints.tool_limits import tool_limits
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.planners.sclerp.screw_motion import ScrewTask, attempt
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory

_NEEDED = 6  # joints, for a screw; an arm with more of them is redundant
_NEAR_BOUND = 1.01  # duration / lower bound up to which a motion is not compared with others


class Sclerp(Planner[SclerpOptions]):
    """The tool moves along the screw that leads from the start's pose to the goal's, as well as the scheme can."""

    Options = SclerpOptions

    holds_constraints = True  # where the screw does; the verifier decides

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        problem = with_poses(problem)
        watch, model = Stopwatch(), kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
        with watch.stage("goals"):
            goals = ranked_goals(problem, model, budget, self.options.goals, nearer=False)
        if isinstance(goals, Failure) and goals.kind != "goal-unreachable":
            return PlanResult(None, goals, watch.seconds)
        failures: list[Failure] = []
        motions: list[tuple[Trajectory, dict[str, Any]]] = []
        for k, task in enumerate(self._tasks(problem, [] if isinstance(goals, Failure) else goals)):
            if motions and (budget.over or self._enough(problem, motions[-1][0])):
                break
            progress("screws", k / (k + 1.0))
            with watch.stage("screws"):
                path = attempt(model, task, self.options, budget)
            if budget.over:
                break
            if isinstance(path, Failure):
                failures.append(path)
                continue
            with watch.stage("timing"):
                tool = tool_limits(problem, task.tool.frame, parts=False)
                options = TimingOptions(tool=tool, stop=lambda: budget.over)
                trajectory = time_path(path, problem.robot, problem.limits, options)
            if trajectory is None:
                failures.append(path_too_heavy(problem.robot, problem.limits, path))
            else:
                motions.append((trajectory, task.info))
        if motions:
            best, info = min(motions, key=lambda motion: motion[0].duration)
            return PlanResult(best, None, watch.seconds, {**info, "tried": len(motions), "cut_short": budget.over})
        late = out_of_time(budget, "following a screw") if budget.over else None
        return PlanResult(None, late or farthest_failure(goals, failures), watch.seconds)

    def _enough(self, problem: Problem, motion: Trajectory) -> bool:
        """Return whether the comparison ends: the options exclude it, or the motion is close to its bound."""
        o = self.options
        if o.scheme != "qp" or o.redundancy != "best" or problem.robot.n <= _NEEDED:
            return True
        least = lower_bound(problem.start, motion(motion.duration), problem.limits)
        return motion.duration <= _NEAR_BOUND * least

    def _tasks(self, problem: Problem, ends: list[Array]) -> Iterator[ScrewTask]:
        """Return every alternative of the goal, as the joints move least and led to each goal configuration.

        A goal without orientation is a goal for each orientation that a goal configuration has.
        """
        redundant = self.options.scheme == "qp" and problem.robot.n > _NEEDED
        led, both = (redundant and self.options.redundancy == one for one in ("goal", "best"))
        robot = replace(problem.robot, limits=problem.limits)
        for goal in single_ends(problem):
            tool = ScrewTool(robot, goal.frame if isinstance(goal, PoseGoal) else robot.tool_frame)
            if isinstance(goal, JointGoal):
                yield ScrewTask(tool, problem.start, tool.pose(goal.q), goal.q, True, {})
                continue
            free = goal.orientation >= np.pi
            for q in ends if ends and (led or free) else [problem.start]:
                yield ScrewTask(tool, problem.start, _pose(tool, goal, q), q if led and ends else None, False, {})
            if both:
                yield from (ScrewTask(tool, problem.start, _pose(tool, goal, q), q, False, {}) for q in ends)


def _pose(tool: ScrewTool, goal: PoseGoal, q: Array) -> pin.SE3:
    """Return X_WG of the goal; its rotation is that of the tool at q (n,) where any orientation will do."""
    free = goal.orientation >= np.pi
    return pin.SE3(tool.pose(q).rotation, goal.X_WG.translation) if free else goal.X_WG
