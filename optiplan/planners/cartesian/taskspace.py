"""`taskspace`: the controller's own motion to the goal, rolled out, joined by polynomials and slowed to fit.

No search: what the task-space controller does about obstacles and limits is all that is done, so it may end at the
nearest configuration instead of the goal. It is quick, it is what a robot under this controller would do, and it says
where that ends.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.control.controller import Controller
from optiplan.control.defaults import default_limits
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.control.limits.joint_limits import PositionLimit
from optiplan.control.step import ControlStep
from optiplan.control.tasks.base import ControlTask
from optiplan.control.tasks.frame_tasks import PoseTask
from optiplan.control.tasks.joint_tasks import PostureTask
from optiplan.control.tasks.tool_abilities import default_gain
from optiplan.kinematics.jacobians import frame_pose
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import Work
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import end_collides, out_of_time, too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.limit_violations import beyond_limits, excess
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.from_samples import from_samples
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

_KNOTS = 5
"""Steps between the samples that polynomials join."""
_INSIDE = 1e-4
"""rad or m: how far the roll-out keeps from the ends of joints, for the polynomials between its samples."""
_STUCK = 100
"""Steps at the nearest configuration after which the roll-out is given up."""
_CLOSE = 0.3
"""Share of the goal's tolerances within which the roll-out may end."""
_FITS = 8


@dataclass(frozen=True)
class TaskSpaceOptions(PlannerOptions):
    """Options of the roll-out."""

    dt: float = option(0.004, "s, of a step.", least=1e-4, most=0.05)
    clearance: float = option(0.002, "m; how far the roll-out keeps from everything.", least=0.0)
    seconds: float = option(30.0, "s of simulated motion after which it is given up.", above=0)


class TaskSpace(Planner[TaskSpaceOptions]):
    """The goals in their order, until a roll-out ends at one of them."""

    Options = TaskSpaceOptions

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        work = Work.on(problem, budget)
        watch = work.watch
        with watch.stage("goals"):
            if work.model.collides(problem.start):
                return PlanResult(None, end_collides(work.model, problem.start, "start"), watch.seconds)
            goals = ranked_goals(problem, work.model, budget, 1)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, watch.seconds)
        failures: list[Failure] = []
        for k, goal in enumerate(problem.goal):
            progress("roll-out", k / len(problem.goal))
            with watch.stage("roll-out"):
                found = self._attempt(work, goal)
            if isinstance(found, Trajectory):
                return PlanResult(found, None, watch.seconds, {"goal": k})
            failures.append(found)
            if budget.over:
                return PlanResult(None, out_of_time(budget, "rolling out"), watch.seconds)
        return PlanResult(None, failures[0], watch.seconds)

    def _attempt(self, work: Work, goal: JointGoal | PoseGoal) -> Trajectory | Failure:
        """The motion to one goal, within limits and free, or why there is none."""
        problem, limits, model = work.problem, work.problem.limits, work.model
        states = [State(problem.start)]
        last: ControlStep | None = None
        for last in self._steps(problem, goal, states[0]):
            states.append(last.state)
            if work.budget.over:
                return out_of_time(work.budget, "rolling out")
        off = _distance(problem, goal, states[-1].q)
        if off > 1.0 or (last is not None and not (last.v == 0.0).all()):
            return _ended(states[-1].q, goal, last, off)
        motion = _fitted(_joined(problem, states, self.options.dt), problem)
        over = excess(motion, limits)
        if over is not None:
            return beyond_limits(over, motion, None)
        touch = first_contact(model, motion, lambda: work.budget.over)
        if touch is not None:
            pair = touch.contact.pair
            detail = f"between two steps of the roll-out '{pair.name_a}' meets '{pair.name_b}' at {touch.t:.3f} s"
            return Failure("collision", detail, touch.witness(motion))
        slower = within_torque(model.robot, limits, motion)
        return too_heavy(model.robot, limits, np.array([motion.start, motion.end])) if slower is None else slower

    def _steps(self, problem: Problem, goal: JointGoal | PoseGoal, state: State) -> Iterator[ControlStep]:
        """Steps until the robot stands at the goal, or at the nearest configuration to it."""
        controller = self._controller(problem, goal)
        dt, stuck, arrived = self.options.dt, 0, False
        for _ in range(int(self.options.seconds / dt)):
            arrived = arrived or (_distance(problem, goal, state.q) < _CLOSE and not np.abs(state.v).max() > 0.01)
            step = controller.stop(state, dt) if arrived else controller.step(state, dt)
            state = step.state
            yield step
            stuck = stuck + 1 if step.status in ("nearest", "stopped") else 0
            if (arrived and not state.v.any()) or stuck >= _STUCK:
                return

    def _controller(self, problem: Problem, goal: JointGoal | PoseGoal) -> Controller:
        """A controller of the problem's robot, limits and scene, with the goal as its task."""
        robot = replace(problem.robot, limits=problem.limits)
        tasks: list[ControlTask]
        if isinstance(goal, JointGoal):
            tasks = [PostureTask(goal.q, cost=1.0, gain=default_gain(robot))]
        else:
            tasks = [PoseTask(goal.frame, goal.X_WG), PostureTask(problem.start, cost=1e-3)]
        inside = PositionLimit(problem.limits.lower + _INSIDE, problem.limits.upper - _INSIDE)
        others = [limit for limit in default_limits() if not isinstance(limit, PositionLimit)]
        return Controller(robot, tasks, limits=[inside, *others, ClearanceLimit(problem.scene, self.options.clearance)])


def _distance(problem: Problem, goal: JointGoal | PoseGoal, q: Array) -> float:
    """How far q (n,) is from a goal, in its tolerances."""
    if isinstance(goal, JointGoal):
        return float(np.abs(q - goal.q).max() / goal.tolerance)
    X = goal.X_WG.actInv(frame_pose(problem.robot, q, goal.frame))
    turned = float(np.arccos(np.clip(0.5 * (np.trace(X.rotation) - 1.0), -1.0, 1.0)))
    return max(float(np.linalg.norm(X.translation)) / goal.position, float(turned / goal.orientation))


def _joined(problem: Problem, states: list[State], dt: float) -> Trajectory:
    """Polynomials of degree five through every fifth state and the last, which is at rest."""
    kept = sorted({*range(0, len(states), _KNOTS), len(states) - 1})
    if len(kept) == 1:
        kept = [0, 0]
    q = np.array([states[k].q for k in kept])
    v = np.array([states[k].v for k in kept])
    a = np.array([0.5 * (states[k].a + states[min(k + 1, len(states) - 1)].a) for k in kept])
    v[[0, -1]], a[[0, -1]] = 0.0, 0.0
    times = dt * np.array(kept, dtype=np.float64)
    if len(states) == 1:
        times[-1] = dt
    return from_samples(problem.robot.joint_names, times, q, v, a)


def _fitted(motion: Trajectory, problem: Problem) -> Trajectory:
    """The motion, slowed down as a whole until it keeps velocity, acceleration and jerk limits."""
    for _ in range(_FITS):
        over = excess(motion, problem.limits)
        if over is None or over.quantity == "position":
            break
        share = abs(over.value / over.limit) ** (1.0 / ORDERS.index(over.quantity))
        motion = motion.scaled(motion.duration * share * (1.0 + 1e-6))
    return motion


def _ended(q: Array, goal: JointGoal | PoseGoal, last: ControlStep | None, off: float) -> Failure:
    """Where the roll-out ended instead of the goal."""
    reason = "it did not move" if last is None else last.reason
    near = (
        ""
        if last is None or last.nearest is None
        else (f"; nearest: '{last.nearest.a}' and '{last.nearest.b}', {last.nearest.distance * 1e3:.1f} mm")
    )
    detail = f"the controller alone does not get to the goal: {off:.3g} tolerances away, {reason}{near}"
    return Failure("no-path", detail, {"q": q.tolist()})
