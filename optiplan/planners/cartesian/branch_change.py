"""Another branch of the inverse kinematics to run a tool path on, and the motion that leads to it."""

from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.tool_path import line
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.point_to_point.quintic import Quintic
from optiplan.planners.sampling.tree_planners import RrtConnect
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, derived
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.trajectory import Trajectory

_OTHER = 1e-3  # rad or m: configurations that differ by less are one


@dataclass(frozen=True, eq=False)
class Branch:
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
            result = planner.plan(there, budget.share(0.5), lambda stage, fraction: None)
            if result.trajectory is not None:
                return join_trajectories([result.trajectory, motion])
            reasons.append(result.failure)
        return reasons[-1] or Failure("no-path", "no way to another branch")


def other_branches(
    problem: Problem, frame: str, model: CollisionModel, budget: Budget, count: int, end: Array | None = None
) -> list[Branch]:
    """Return other free configurations with the frame at its start pose, the soonest reached first.

    With a prescribed configuration `end` (n,), the nearest to it come first: they are on its branch.
    """
    X = frame_pose(problem.robot, problem.start, frame)
    near = problem.start if end is None else end
    goals = ranked_goals(
        derived(problem, start=near, goal=(PoseGoal(frame, X),), vias=()), model, budget, count + 1, nearer=False
    )
    here = Tracker(problem.robot, frame, line(X, X), Aim())
    exact = [here.correct(0.0, q) for q in ([] if isinstance(goals, Failure) else goals)]
    return [Branch(q, changed=True) for q in exact if q is not None and np.abs(q - problem.start).max() > _OTHER]
