"""`taskspace`: the controller's own motion to the goal, rolled out, joined by polynomials and slowed to fit.

First the task-space controller moves alone. It has no search, so it may end at the nearest configuration instead of the
goal. Then, if `lead` allows it, it follows a configuration that runs ahead of it along a sampled path.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.native_model import planning_model
from optiplan.control.controller import Controller
from optiplan.control.defaults import default_limits
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.control.limits.joint_limits import PositionLimit
from optiplan.control.step import ControlStep
from optiplan.control.tasks.base import ControlTask
from optiplan.control.tasks.frame_tasks import PoseTask
from optiplan.control.tasks.joint_tasks import PostureTask
from optiplan.control.tasks.tool_abilities import default_gain
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import PlanContext
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import end_collides, out_of_time, too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.limit_violations import beyond_limits, excess
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.common.region_poses import single_ends, with_poses
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.planners.sampling.sample_path import SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.shrunk_obstacles import thinned
from optiplan.problem.problem import JointGoal, PoseGoal, Problem
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.from_samples import from_samples
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

_KNOTS = 5
"""Steps between the samples that polynomials join."""
_INSIDE = 1e-4
"""rad or m: how far the roll-out keeps from the ends of joints, for the polynomials between its samples."""
_STALLED, _GAIN = 1.5, 0.02
"""s of simulated motion within which the remaining distance must shrink by this share."""
_AHEAD = (0.05, 0.02)
"""s at the velocity limits: how far the leading configuration runs ahead; a shorter lead follows more closely."""
_SPEED = 0.7
"""Share of the velocity limits that the first lead aims at; the gains determine how far ahead it is."""
_SEARCH = 0.3
"""Share of the remaining budget for a path."""
_ROOM = (0.02, 0.008, 0.004)
"""m: clearances of sampled paths, tried in this order."""
_PATHS = 3
"""Paths for each clearance."""
_GOALS = 4
"""Goal configurations to which a path is sought."""
_CLOSE = 0.3
"""Share of the goal's tolerances within which the roll-out may end."""
_CLOSE_LED = 0.02
"""The same for the end of a sampled path, which may itself lie at the end of a pose's tolerances."""
_FITS = 8
"""Times that a motion is slowed down to its limits, at most."""


@dataclass(frozen=True)
class TaskSpaceOptions(PlannerOptions):
    """Options of the roll-out."""

    dt: float = option(0.004, "s, of a step.", least=1e-4, most=0.05)
    clearance: float = option(0.002, "m; how far the roll-out keeps from everything.", least=0.0)
    seconds: float = option(60.0, "s of simulated motion after which it is given up.", above=0)
    lead: bool = option(True, "lead the controller along a sampled path where it does not get to the goal by itself.")


class TaskSpace(Planner[TaskSpaceOptions]):
    """The goals in their order, until a roll-out ends at one of them; then led along a path."""

    Options = TaskSpaceOptions

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        work = PlanContext.of(with_poses(problem), budget)
        problem, watch = work.problem, work.watch
        with watch.stage("goals"):
            if work.model.collides(problem.start):
                return PlanResult(None, end_collides(work.model, problem.start, "start"), watch.seconds)
            goals = ranked_goals(problem, work.model, budget, _GOALS)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, watch.seconds)
        found, info = self._alone(work, progress)
        if isinstance(found, Failure) and self.options.lead and not budget.over:
            led, more = self._led(work, goals, progress)
            found, info = (found, info) if led is None else (led, more)
        if isinstance(found, Failure):
            return PlanResult(None, found, watch.seconds)
        return PlanResult(found, None, watch.seconds, info)

    def _alone(self, work: PlanContext, progress: Progress) -> tuple[Trajectory | Failure, dict[str, int]]:
        """Return the controller's own motion to a goal, or why there is none to the first."""
        failures: list[Failure] = []
        ends = single_ends(work.problem)
        for k, goal in enumerate(ends):
            progress("roll-out", 0.5 * k / len(ends))
            with work.watch.stage("roll-out"):
                found = self._attempt(work, goal)
            if isinstance(found, Trajectory):
                return found, {"goal": k}
            failures.append(found)
            if work.budget.over:
                return out_of_time(work.budget, "rolling out"), {}
        return failures[0], {}

    def _led(
        self, work: PlanContext, goals: list[Array], progress: Progress
    ) -> tuple[Trajectory | Failure | None, dict[str, int]]:
        """Return the motion along a path to one of the goals, or why it ends early; None without a path."""
        failure: Failure | None = None
        attempts = [(seed, room) for seed in range(_PATHS) for room in _ROOM]
        for k, (seed, room) in enumerate(attempts):
            progress("led roll-out", 0.5 + 0.5 * k / len(attempts))
            if work.budget.over:
                break
            with work.watch.stage("path"):
                path = self._path(work, goals, room, work.problem.seed + seed)
            if isinstance(path, Failure):
                continue
            found = self._along(work, path)
            if isinstance(found, Trajectory):
                return found, {"waypoints": len(path)}
            failure = replace(found, detail=f"led along a path of {len(path)} points: {found.detail}")
        return failure, {}

    def _along(self, work: PlanContext, path: Array) -> Trajectory | Failure:
        """Return the motion along a path: first far behind the lead, for speed, then closer where that cuts corners."""
        found: Trajectory | Failure = Failure("no-path", "it was not tried", {})
        goal, velocity = JointGoal(path[-1]), work.problem.limits.velocity
        for ahead in sorted({_SPEED / default_gain(work.problem.robot), *_AHEAD}, reverse=True):
            with work.watch.stage("roll-out"):
                found = self._attempt(work, goal, _Lead(path, velocity, ahead))
            if isinstance(found, Trajectory) or work.budget.over:
                break
        return found

    def _path(self, work: PlanContext, goals: list[Array], room: float, seed: int) -> Array | Failure:
        """Waypoints (k, n) to one of the goals, among obstacles thicker by `room`, m."""
        problem = work.problem
        error = problem.tracking_error
        model = planning_model(problem.robot, thinned(problem.scene, -room), error=error) if room > 0.0 else work.model
        options = SamplingOptions(work.budget.share(_SEARCH), seed=seed)
        found = sample_path(path_check(model, problem.limits), problem.start, goals, options)
        return found if isinstance(found, Failure) else found.waypoints

    def _attempt(
        self, work: PlanContext, goal: JointGoal | PoseGoal, lead: "_Lead | None" = None
    ) -> Trajectory | Failure:
        """Return the motion to one goal, within limits and free, or why there is none."""
        problem, limits, model = work.problem, work.problem.limits, work.model
        states = [State(problem.start)]
        last: ControlStep | None = None
        for last in self._steps(problem, goal, states[0], lead):
            states.append(last.state)
            if work.budget.over:
                return out_of_time(work.budget, "rolling out")
        off = _distance(problem, goal, states[-1].q)
        if off > 1.0 or (last is not None and not (last.v == 0.0).all()):
            return _ended(states[-1].q, last, off)
        motion = _fitted(_joined(problem, states, self.options.dt), problem)
        over = excess(motion, limits)
        if over is not None:
            return beyond_limits(problem.robot, over, motion, None)
        touch = first_contact(model, motion, lambda: work.budget.over)
        if touch is not None:
            detail = f"between two steps of the roll-out {touch.contact.meeting} at {touch.t:.3f} s"
            return Failure("collision", detail, touch.witness(motion))
        slower = within_torque(model.robot, limits, motion)
        return too_heavy(model.robot, limits, np.array([motion.start, motion.end])) if slower is None else slower

    def _steps(
        self, problem: Problem, goal: JointGoal | PoseGoal, state: State, lead: "_Lead | None"
    ) -> Iterator[ControlStep]:
        """Yield steps until the robot stands at the goal, or comes no nearer to it."""
        controller = self._controller(problem, goal)
        dt, arrived = self.options.dt, False
        least, since, led = np.inf, 0.0, lead is not None
        close = _CLOSE if lead is None else _CLOSE_LED
        for _ in range(int(self.options.seconds / dt)):
            if lead is not None:
                controller.tasks[0].target = lead.ahead_of(state.q)
            off = _distance(problem, goal, state.q)
            if led and (lead is None or lead.left == 0.0):
                least, led = np.inf, False  # the path is done: from now on what counts is the goal
            left = lead.left if led and lead is not None else off
            arrived = arrived or (off < close and not np.abs(state.v).max() > 0.01)
            since = 0.0 if left < (1.0 - _GAIN) * least else since + dt
            least = left if since == 0.0 else least
            step = controller.stop(state, dt) if arrived or since > _STALLED else controller.step(state, dt)
            state = step.state
            yield step
            if (arrived or since > _STALLED) and not state.v.any():
                return

    def _controller(self, problem: Problem, goal: JointGoal | PoseGoal) -> Controller:
        """A controller of the problem's robot, limits and scene, with the goal as its task."""
        robot = replace(problem.robot, limits=problem.limits)
        tasks: list[ControlTask]
        if isinstance(goal, JointGoal):
            tasks = [PostureTask(goal.q, cost=1.0, gain=default_gain(robot))]
        else:
            tasks = [PoseTask(goal.frame, goal.X_WG), PostureTask(problem.start, cost=1e-3)]
        ends = [problem.start, *([goal.q] if isinstance(goal, JointGoal) else [])]  # these may lie nearer to the ends
        lower = np.min([problem.limits.lower + _INSIDE, *ends], axis=0)
        upper = np.max([problem.limits.upper - _INSIDE, *ends], axis=0)
        inside = PositionLimit(np.maximum(lower, problem.limits.lower), np.minimum(upper, problem.limits.upper))
        others = [limit for limit in default_limits() if not isinstance(limit, PositionLimit)]
        return Controller(robot, tasks, limits=[inside, *others, ClearanceLimit(problem.scene, self.options.clearance)])


class _Lead:
    """A configuration that runs along a path (k, n), never farther ahead of the robot than `ahead`, s.

    Attributes:
        left: remaining time on the path at the velocity limits, s.
    """

    def __init__(self, path: Array, velocity: Array, ahead: float) -> None:
        self._path, self._velocity, self._ahead = path, velocity, ahead
        self._times = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(path, axis=0)) / velocity).max(axis=1))])
        self._at = 0.0

    @property
    def left(self) -> float:
        return float(self._times[-1] - self._at)

    def ahead_of(self, q: Array) -> Array:
        """Run on as far as the robot at q (n,) lets it: (n,)."""
        target = self._point(self._at)
        while self.left > 0.0:
            at = min(self._at + 0.05 * self._ahead, float(self._times[-1]))
            following = self._point(at)
            if float((np.abs(following - q) / self._velocity).max()) > self._ahead:
                break
            self._at, target = at, following
        return target

    def _point(self, time: float) -> Array:
        k = min(int(np.searchsorted(self._times, time, side="right")) - 1, len(self._times) - 2)
        share = (time - self._times[k]) / max(self._times[k + 1] - self._times[k], 1e-12)
        return np.asarray(self._path[k] + share * (self._path[k + 1] - self._path[k]))


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


def _ended(q: Array, last: ControlStep | None, off: float) -> Failure:
    """Return the failure of a roll-out that ends at q (n,) instead of the goal."""
    reason = "it did not move" if last is None else last.reason
    near = (
        ""
        if last is None or last.nearest is None
        else (f"; nearest: '{last.nearest.a}' and '{last.nearest.b}', {last.nearest.distance * 1e3:.1f} mm")
    )
    detail = f"the controller alone does not get to the goal: {off:.3g} tolerances away, {reason}{near}"
    return Failure("no-path", detail, {"q": q.tolist()})
