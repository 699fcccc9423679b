"""Plan between states of motion: one curve between them, or a stop, a motion from rest to rest and a run-up."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.kinematics.ik.joint_wraps import endless_turns
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, stages_of
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.incumbent import Incumbent
from optiplan.planners.common.limit_violations import excess
from optiplan.planners.path_constraints.motion_check import Broken, broken_constraint
from optiplan.planners.trajopt.initial_guess import with_bump
from optiplan.planners.trajopt.nonzero_end_optimiser import EndStates, NonzeroEndOptimiser, torque_ratio, with_reserve
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser, attempt_record
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.stopping_rule import Patience
from optiplan.problem.problem import GoalEnd, JointGoal, Problem, derived
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.profiles.state_to_state import BetweenStates, NoProfile, fastest_run_up, fastest_stop
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

_DIRECT, _DETOUR = 1.0 / 3.0, 0.7
"""Share of the budget for curves from the direct profiles, and of the rest for the motion from rest to rest."""

_SAME = 1e-6
"""rad or m: configurations nearer than this are one."""

_NO_STOP = "no curve was found, and stopping at once is no way out"


def plan_nonzero_ends(
    planner: Planner[TrajOptOptions], problem: Problem, budget: Budget, progress: Progress
) -> PlanResult:
    """Plan a problem that states motion at its start or at goals.

    The fastest profile of each joint is the answer where it is free, and the first guess of a curve otherwise. Where
    no curve is free, the robot stops, moves from rest to the start of a run-up as `planner` finds it, and runs up to
    the goal. That motion is an answer, and the first guess of another curve. Then curves with a bump are tried while
    `Patience` allows.
    """
    return _NonzeroEndRun(planner, problem, budget, progress).result()


class _NonzeroEndRun:
    """State of one call."""

    def __init__(self, planner: Planner[TrajOptOptions], problem: Problem, budget: Budget, progress: Progress) -> None:
        self.planner, self.problem, self.budget, self.progress = planner, problem, budget, progress
        self.options, self.watch = planner.options, Stopwatch()
        self.info: dict[str, Any] = {"attempts": [], "cut_short": False}
        self.incumbent = Incumbent(problem, progress, self.watch)
        self.bound = 0.0
        self.curve: tuple[Attempt, NonzeroEndOptimiser] | None = None
        self.breaking: tuple[Broken, Trajectory] | None = None  # the last motion refused for a path constraint
        self.patience = Patience(budget, self.options.good_enough)
        with self.watch.stage("set-up"):
            self.model = kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
            self.optimiser = Optimiser(with_reserve(problem), self.model, self.options)

    def result(self) -> PlanResult:
        """Search and return the best motion, or the failure."""
        failure = self._search()
        self.info["cut_short"] |= self.budget.over
        if failure is None and self.breaking is not None and not self.budget.over:
            failure = broken_constraint(*self.breaking, "no motion was found that holds the path constraints")
        if self.budget.cancelled or failure is None:
            failure = out_of_time(self.budget, "looking for a trajectory")
        return self.incumbent.result(self.info, failure)

    def _search(self) -> Failure | None:
        with self.watch.stage("goals"):
            goals = ranked_goals(self.problem, self.model, self.budget)
        if isinstance(goals, Failure):
            return goals
        bounds = self.problem.lower_bounds(goals)
        self.bound = self.problem.objective.time * float(bounds.min())
        early = self.budget.share(_DIRECT)
        for q in goals[: self.options.straight_goals]:
            for end in self.problem.end_states(q):
                if not early.over and self._should_continue():
                    self._direct(end, early)
        failure = None
        if not self.incumbent.candidates and not self.budget.over:
            failure = self._detour()
        self._bumps()
        return None if self.incumbent.candidates else failure

    def _direct(self, end: State, budget: Budget) -> None:
        """Try the profiles from state to state, and the curve optimised from them."""
        names, limits = self.problem.robot.joint_names, self.problem.limits
        start = self.problem.start_state
        profile = BetweenStates(start, end, limits, names).trajectory()
        if self._good(profile) is None:
            self._offer(profile)
        if self._should_continue():
            self._optimised("direct", profile, EndStates(start, end), budget)

    def _good(self, motion: Trajectory) -> Failure | None:
        """Return why a motion cannot be an answer; None where it can."""
        over = excess(motion, self.problem.limits)
        if over is not None:
            joint = motion.joint_names[over.joint]
            detail = f"'{joint}' would reach {over.quantity} {over.value:.4g}, beyond its limit {over.limit:.4g}"
            return Failure("limits", detail, {"t": over.t, "joint": joint, "q": motion(over.t).tolist()})
        if torque_ratio(self.problem, motion) > 1.0:
            return Failure("limits", "it would take more torque than there is", {"q": motion.start.tolist()})
        with self.watch.stage("collision"):
            touch = first_contact(self.model, motion, lambda: self.budget.over)
        if touch is None:
            return None
        return Failure("collision", f"{touch.words} after {touch.t:.3f} s", touch.witness(motion))

    def _detour(self) -> Failure | None:
        """Stop, go from rest to rest, run up; then optimise from that."""
        problem, names, limits = self.problem, self.problem.robot.joint_names, self.problem.limits
        try:
            stop = fastest_stop(problem.start_state, limits, names)
        except NoProfile as error:
            return Failure("limits", f"{_NO_STOP}: {error}")
        if stop is not None and (why := self._good(stop)) is not None:
            return replace(why, detail=f"{_NO_STOP}: {why.detail}")
        if stop is not None and (beyond := self.optimiser.constraints.broken_at_rest(stop.end)) is not None:
            detail = f"{_NO_STOP}: at rest after {stop.duration:.3f} s it is {beyond.words} ({beyond.name})"
            witness = {"constraint": beyond.name, "t": stop.duration, "q": stop.end.tolist()}
            return Failure("constraint", detail, witness)
        run_ups: list[tuple[Array, Trajectory | None]] = []
        goals: list[GoalEnd] = []
        refused: Failure | None = None
        for goal in problem.goal:
            if not isinstance(goal, JointGoal) or not goal.moving:
                goals.append(goal)
                continue
            found = self._run_up(goal)
            if isinstance(found, Failure):
                refused = found
                continue
            rest = goal.q if found is None else found.start
            goals.append(replace(goal, q=rest, velocity=None, acceleration=None))
            run_ups.append((rest, found))
        if not goals and refused is not None:
            return replace(refused, detail=f"no curve was found, and a run-up is no way in: {refused.detail}")
        still = derived(problem, goal=tuple(goals)).with_start(problem.start if stop is None else stop.end)
        with self.watch.stage("from rest to rest"):
            planned = self.planner.plan(still, self.budget.share(_DETOUR), stages_of(self.progress))
        self.info["cut_short"] |= bool(planned.info.get("cut_short", False))
        if planned.trajectory is None:
            return planned.failure
        run_up = _run_up_from(planned.trajectory.end, run_ups, problem.robot)
        parts = [part for part in (stop, planned.trajectory, run_up) if part is not None]
        whole = join_trajectories(parts)
        self._offer(whole)
        end = whole.state(whole.duration)
        self._optimised("detour", whole, EndStates(problem.start_state, end), self.budget)
        return None

    def _run_up(self, goal: JointGoal) -> Trajectory | Failure | None:
        """Return the motion from rest into a goal; None where the goal is at rest up to rounding."""
        try:
            motion = fastest_run_up(goal.state, self.problem.limits, self.problem.robot.joint_names)
        except NoProfile as error:
            return Failure("limits", str(error), {"q": goal.q.tolist()})
        return None if motion is None else self._good(motion) or motion

    def _bumps(self) -> None:
        """Optimise from the best curve with a bump, while a gain is expected."""
        rng = np.random.default_rng(self.problem.seed)
        for _ in range(self.options.seeds):
            if self.curve is None or not self._should_continue():
                return
            attempt, optimiser = self.curve
            T = attempt.trajectory.duration
            control = with_bump(optimiser.basis, attempt.control, T, self.problem.limits, rng)
            self._run("bump", optimiser, control, T, self.budget)

    def _optimised(self, kind: str, motion: Trajectory, ends: EndStates, budget: Budget) -> None:
        optimiser = NonzeroEndOptimiser(self.problem, self.optimiser, ends)
        self._run(kind, optimiser, optimiser.along(motion), motion.duration, budget)

    def _run(self, kind: str, optimiser: NonzeroEndOptimiser, control: Array, duration: float, budget: Budget) -> None:
        """Optimise a curve and offer it, if it is free."""
        self.progress("optimisation", 1.0 - self.budget.remaining / self.budget.seconds)
        with self.watch.stage("optimisation"):
            attempt = optimiser.run(control, duration, budget)
        steps = self.optimiser.taken
        self.patience.work(steps=steps)
        self.info["attempts"].append(attempt_record(kind, attempt, steps, self.optimiser.log))
        if attempt is None or not attempt.free:
            if attempt is not None and not attempt.touches:
                self.breaking = attempt.broken[0], attempt.trajectory
            self.patience.record(None)
            return
        if self._offer(attempt.trajectory):
            self.curve = attempt, optimiser
        self.patience.record(self.problem.cost(attempt.trajectory))

    def _offer(self, trajectory: Trajectory) -> bool:
        """Keep a free motion if it is better than the best; return whether it is."""
        if not self.incumbent.improves(trajectory):
            return False
        for broken in self.optimiser.constraints.broken(trajectory):
            self.breaking = broken, trajectory
            return False
        return self.incumbent.offer(trajectory)

    def _should_continue(self) -> bool:
        """Return whether the budget and `Patience` allow another attempt."""
        if self.budget.over:
            return False
        return not self.incumbent.candidates or self.patience.worth_another(self.incumbent.cost, self.bound)


def _run_up_from(rest: Array, run_ups: Sequence[tuple[Array, Trajectory | None]], robot: Robot) -> Trajectory | None:
    """Return the run-up that begins at `rest` (n,), up to whole turns of endless joints; None where there is none."""
    for q, run_up in run_ups:
        turned = endless_turns(robot, q, rest, 1)[0]
        if run_up is not None and np.abs(turned - rest).max() < _SAME:
            coefficients = run_up.coefficients.copy()
            coefficients[:, 0] += turned - q
            return Trajectory(run_up.joint_names, run_up.breakpoints, coefficients)
    return None
