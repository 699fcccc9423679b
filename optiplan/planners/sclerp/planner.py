"""`sclerp`: goal by goal, the joint path of the chosen scheme, looked at for obstacles, then timed."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.failures import out_of_time, too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.region_poses import single_ends, with_poses
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.screw_kinematics import Tool
from optiplan.planners.sclerp.screw_motion import ScrewTask, attempt
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory

_SAMPLES = 200  # of a path, where gravity is looked for
_NEEDED = 6  # joints, for a screw; an arm with more of them can be led


class Sclerp(Planner[SclerpOptions]):
    """The tool moves along the screw that leads from the start's pose to the goal's, as well as the scheme can."""

    Options = SclerpOptions

    holds_constraints = True  # where the screw does; the verifier tells

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        problem = with_poses(problem)
        watch, model = Stopwatch(), kept_planning_model(problem.robot, problem.scene)
        with watch.stage("goals"):
            goals = ranked_goals(problem, model, budget, self.options.goals, nearer=False)
        if isinstance(goals, Failure) and goals.kind != "goal-unreachable":
            return PlanResult(None, goals, watch.seconds)
        failures: list[Failure] = []
        for k, task in enumerate(self._tasks(problem, [] if isinstance(goals, Failure) else goals)):
            progress("screws", k / (k + 1.0))
            with watch.stage("screws"):
                path = attempt(model, task, self.options, budget)
            if budget.over:
                return PlanResult(None, out_of_time(budget, "following a screw"), watch.seconds)
            if isinstance(path, Failure):
                failures.append(path)
                continue
            with watch.stage("timing"):
                trajectory = time_path(path, problem.robot, problem.limits, TimingOptions(stop=lambda: budget.over))
            if trajectory is not None:
                return PlanResult(trajectory, None, watch.seconds, {**task.info, "cut_short": budget.over})
            failures.append(_heavy(problem, path))
        return PlanResult(None, _reason(goals, failures), watch.seconds)

    def _tasks(self, problem: Problem, ends: list[Array]) -> Iterator[ScrewTask]:
        """Every alternative of the goal; led to each goal configuration, if the options say so.

        A goal without orientation is a goal for each orientation that a goal configuration has.
        """
        led = self.options.scheme == "qp" and self.options.redundancy == "goal" and problem.robot.n > _NEEDED
        for goal in single_ends(problem):
            tool = Tool(problem.robot, goal.frame if isinstance(goal, PoseGoal) else problem.robot.tool_frame)
            if isinstance(goal, JointGoal):
                yield ScrewTask(tool, problem.start, tool.pose(goal.q), goal.q, True, {})
                continue
            free = goal.orientation >= np.pi
            for q in ends if ends and (led or free) else [problem.start]:
                X_WG = pin.SE3(tool.pose(q).rotation, goal.X_WG.translation) if free else goal.X_WG
                yield ScrewTask(tool, problem.start, X_WG, q if led and ends else None, False, {})


def _heavy(problem: Problem, path: Trajectory) -> Failure:
    return too_heavy(problem.robot, problem.limits, path(np.linspace(0.0, path.duration, _SAMPLES)))


def _reason(goals: list[Array] | Failure, failures: list[Failure]) -> Failure:
    """The failure that came farthest along its screw; what is known of the goal comes first."""
    farthest = max(failures, key=lambda failure: float(failure.witness.get("fraction", 1.0)))
    if not isinstance(goals, Failure):
        return farthest
    return Failure(goals.kind, f"{goals.detail}; {farthest.detail}", {**goals.witness, **farthest.witness})
