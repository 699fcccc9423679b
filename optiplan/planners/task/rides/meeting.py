"""Meet what moves: when, at which of several ends, in which configuration, and the move that arrives at that moment."""

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import joints_that_move, random_seeds
from optiplan.planners.base import Budget, Failure, Planner, Progress
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.tool_path import line
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.task.chains import of_step
from optiplan.planners.task.planned_steps import PlannedStep, object_and_link
from optiplan.planners.task.rides.ride_path import RidePath, RideSection
from optiplan.planners.task.rides.riding import Rider, TimedPart, free_in_time
from optiplan.planners.task.stages import Stage, Stages, WorldState
from optiplan.problem.goals_and_vias import ExactGoal, PoseGoal
from optiplan.problem.grasps.places import places
from optiplan.problem.problem import Problem
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.task.rides import Ride
from optiplan.problem.task.steps import Move, TaskStep
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories, standstill, with_resting_joints
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.timing.lower_bound import lower_bounds
from optiplan.trajectory.trajectory import Trajectory

_STEPS = (0.05, 1.02, 0.3)
"""s between the times that are tried at first, how much longer they get each time, and s at most."""

_HORIZON = 60.0
"""s within which something is met."""

_SEEDS, _ITERATIONS = 4, 40
"""Random starts of the inverse kinematics at each time, and steps of one."""

_ENDS, _ENOUGH = 12, 4
"""Ends that are tried at one time, those first that were free before, and configurations that are enough."""

_BLAME = 3
"""Times in vain for which a failure of the steps at an end counts."""

_APART = 0.05
"""rad or m between configurations that are tried."""

_TRIED = 3
"""Configurations that are tried at one time."""

_EARLIER = 3
"""Times that are tried between the one found and the one at which the arm could be there."""

_SLACK = 1.002, 2e-3
"""Factor and s by which a meeting is later than the move that arrives there takes."""


@dataclass(frozen=True, eq=False)
class _Found:
    """A meeting: the time of it, s, and the part of the motion from before it to the end of the ride."""

    at: float
    part: TimedPart
    move: float


@dataclass(eq=False)
class MeetingSearch:
    """The search for a meeting and what follows it.

    Attributes:
        problem: of the whole task.
        planner: of the move.
        steps: the move that meets something, and the steps that go with it.
        budget: of the search.
        info: what the search did.
    """

    problem: Problem
    planner: Planner[Any]
    steps: Sequence[TaskStep]
    budget: Budget
    progress: Progress
    info: dict[str, Any] = field(default_factory=dict)

    def run(self, state: WorldState, t: float) -> TimedPart | Failure:
        """Return the part of the motion from a state at rest at time t, s, the earliest end that is found."""
        first = self.steps[0]
        ride, move = first.ride, first.action
        assert ride is not None
        assert isinstance(move, Move)
        still = WorldState(state.q, state.scene.standing)
        stage = Stages(self.problem).at(still, first, move.joints)
        reach = _Reach(self.problem, stage, ride, move)
        failures: list[tuple[int, Failure]] = []
        at, step, ready = t + _STEPS[0], _STEPS[0], t
        while at <= t + _HORIZON and not self.budget.over:
            self.progress(f"{first.words}: choosing when", min(1.0, (at - t) / _HORIZON))
            soonest, needed = np.inf, ready
            for q in reach.configurations(at)[:_TRIED]:
                bound = t + float(lower_bounds(stage.problem.start, q[None], stage.problem.limits)[0])
                soonest, needed = min(soonest, bound), max(needed, bound)
                if bound > at:
                    failures.append((0, self._late(ride, at, bound)))
                    continue
                found = self._meet(state, t, at, (stage, q))
                if isinstance(found, _Found):
                    return self._sooner(state, t, (stage, reach), found).part
                rank, failure, possible = found
                reach.blame(q)
                failures.append((rank, failure))
                ready = max(ready, possible)
            step = min(_STEPS[1] * step, _STEPS[2])
            at = max(at + step, ready, 0.5 * (at + soonest) if np.isfinite(soonest) else 0.0)
            if reach.over(max(needed, ready)):
                break
        if self.budget.over and not failures:
            return of_step(out_of_time(self.budget, "choosing when to meet it"), first, state, self.problem.robot)
        return self._failed(reach, failures, state)

    def _late(self, ride: Ride, at: float, needed: float) -> Failure:
        detail = f"'{ride.mover.name}' is there at {at:.3g} s, and the arm not before {needed:.3g} s"
        return Failure("reach", detail, {"t": at, "needed": needed})

    def _failed(self, reach: "_Reach", failures: Sequence[tuple[int, Failure]], state: WorldState) -> Failure:
        first = self.steps[0]
        name = reach.ride.mover.name
        if not failures:
            words = reach.words()
            failure = Failure("reach", f"'{name}' {words}", {"q": state.q.tolist()})
            return of_step(failure, first, state, self.problem.robot)
        rank, failure = max(failures, key=lambda one: one[0])
        if rank == 0:
            detail = f"'{name}' leaves the reach of the arm before it can be met: {failure.detail}"
            failure = replace(failure, detail=detail, witness={"q": state.q.tolist(), **failure.witness})
        if "step" in failure.witness:
            return failure
        return of_step(failure, first, state, self.problem.robot)

    def _sooner(self, state: WorldState, t: float, where: "tuple[Stage, _Reach]", found: _Found) -> _Found:
        """Return a meeting as early as the move allows, where one is found."""
        stage, reach = where
        for _ in range(_EARLIER):
            at = t + _SLACK[0] * found.move + _SLACK[1]
            if at > found.at - _SLACK[1] or self.budget.over:
                break
            near = reach.configurations(at)
            sooner = [self._meet(state, t, at, (stage, q)) for q in near[:1]]
            better = [one for one in sooner if isinstance(one, _Found) and one.part.duration < found.part.duration]
            if not better:
                break
            found = better[0]
        return found

    def _meet(
        self, state: WorldState, t: float, at: float, where: tuple[Stage, Array]
    ) -> _Found | tuple[int, Failure, float]:
        """Return the meeting in a configuration at a time, s; else how far it came, why not, and when it could be."""
        first, (stage, q) = self.steps[0], where
        ride = first.ride
        assert ride is not None
        self.info["attempts"] = self.info.get("attempts", 0) + 1
        arrived = stage.arrived(q, state)
        rider = Rider(self.problem, ride, self.steps[1:], self.budget, state.scene.standing)
        rest = rider.go(arrived, at)
        if isinstance(rest, Failure):
            return (1 if rest.kind == "limits" else 2), rest, t
        v, a = (
            _rates(stage, ride, q, at) if rest.motion is None else (rest.motion(0.0, k)[stage.columns] for k in (1, 2))
        )
        goal = stage.to((ExactGoal(q, velocity=v, acceleration=a),))
        result = plan_through(self.planner, goal, self.budget.share(0.5), self.progress)
        if result.trajectory is None:
            failure = result.failure or Failure("no-path", "no motion was found")
            return 4, of_step(failure, first, state, self.problem.robot, stage), t
        takes = result.trajectory.duration
        if t + takes > at:
            return 0, self._late(ride, at, t + takes), t + _SLACK[0] * takes + _SLACK[1]
        motion = with_resting_joints(result.trajectory, stage.columns, self.problem.robot.joint_names, state.q)
        if at > t + takes:
            motion = join_trajectories([standstill(motion.joint_names, state.q, at - t - takes), motion])
        touch = free_in_time(self.problem, state.scene, first, motion, t, self.budget)
        if touch is not None:
            return 5, of_step(touch, first, state, self.problem.robot), t
        return _Found(at, _joined(first, motion, rest, PlannedStep(first, state, arrived)), takes)


def _joined(step: TaskStep, motion: Trajectory, rest: TimedPart, planned: PlannedStep) -> TimedPart:
    """Return the move, and what follows it, as one part."""
    own = Segment(step.number, step.kind, step.name, 0.0, motion.duration, *object_and_link(planned))
    later = [replace(one, begin=one.begin + own.end, end=one.end + own.end) for one in rest.segments]
    whole = motion if rest.motion is None else join_trajectories([motion, rest.motion])
    return TimedPart(whole, (own, *later), rest.after)


def _rates(stage: Stage, ride: Ride, q: Array, t: float) -> tuple[Array, Array]:
    """Return the velocity and acceleration of the joints (k,) that go with what moves at time t, s."""
    X = ride.mover.motion.pose(t).actInv(Descent(stage.problem.robot, ride.frame).place(q).copy())
    path = RidePath(ride.mover.motion, t, [RideSection(line(X, X), 1.0)])
    tracker = Tracker(stage.problem.robot, stage.problem.limits, ride.frame, path, Aim())
    v = tracker.rate(0.0, q)
    return v, tracker.joint_curvature(0.0, q, v)


class _Reach:
    """The configurations in which the ends are reached at a time."""

    def __init__(self, problem: Problem, stage: Stage, ride: Ride, move: Move) -> None:
        self.ride, self._stage = ride, stage
        self._poses = [X for end in move.goal for X in _poses_of(end)]
        self._rng = np.random.default_rng(problem.seed)
        self._last: list[Array] = []
        self._met: list[float] = []
        self._vain = np.zeros(len(self._poses), dtype=int)
        self._asked = 0.0
        self._ends: list[tuple[int, Array]] = []

    def configurations(self, t: float) -> list[Array]:
        """Return free configurations (k,) at which the frame is at an end at time t, s, the nearest first."""
        robot, model, start = self._stage.problem.robot, self._stage.model, self._stage.problem.start
        M, found = self.ride.mover.motion.pose(t), list[Array]()
        self._asked, self._ends = t, []
        seeds = [*self._last, start, *robot.configurations.values()]
        seeds += random_seeds(robot, start, self._rng, _SEEDS)
        leads = joints_that_move(robot, self.ride.frame)
        seeds = [np.where(leads, seed, start) for seed in seeds]
        descent = Descent(robot, self.ride.frame)
        for k in np.argsort(self._vain, kind="stable").tolist()[:_ENDS]:
            X, tolerance = self._poses[k]
            descent.aim(M * X)
            self._vain[k] += 1
            for seed in seeds:
                q = descent.descend(seed, _ITERATIONS)
                position, angle = pose_error(descent.place(q), M * X)
                if position > tolerance[0] or angle > tolerance[1]:
                    continue
                self._met.append(t)
                if model.collides(q) or any(np.abs(q - other).max() < _APART for other in found):
                    continue
                self._vain[k] = min(self._vain[k], 1) - 1
                found.append(q)
                self._ends.append((k, q))
                if len(found) >= _ENOUGH:
                    break
            if len(found) >= _ENOUGH:
                break
        bounds = lower_bounds(start, np.array(found), self._stage.problem.limits) if found else np.zeros(0)
        found = [found[k] for k in np.argsort(bounds, kind="stable").tolist()]
        self._last = found[:_TRIED] or self._last
        return found

    def blame(self, q: Array) -> None:
        """Try other ends first from now on than the one that a configuration is of, from which the steps failed."""
        for k, other in self._ends:
            if other is q:
                self._vain[k] += _BLAME

    def over(self, t: float) -> bool:
        """Return whether nothing changes any more: what moves has stopped, and the arm could be there by t, s."""
        return max(self.ride.mover.motion.until, t) < self._asked

    def words(self) -> str:
        """Return in words that nothing was met."""
        if not self._met:
            return f"is never within reach of the arm within {self._asked:.3g} s"
        low, high = min(self._met), max(self._met)
        return f"is within reach from {low:.3g} to {high:.3g} s, but something is in the way there at all times"


def _poses_of(end: Any) -> Iterator[tuple[pin.SE3, tuple[float, float]]]:
    """Yield the poses of an end, each with its tolerance, m and rad."""
    if isinstance(end, PoseGoal):
        yield end.X_WG, (end.position, end.orientation)
    elif isinstance(end, RegionGoal):
        for one in places(end):
            yield one.X_WG, (one.position, one.orientation)
