"""Do the steps that go with what moves: the arm follows one path, and fingers close beside it."""

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.native_model import planning_model
from optiplan.geometry.poses import pose_error
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.differential_ik import LIMIT_AVOIDANCES, Aim, Tracker
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import line
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.limit_violations import Excess
from optiplan.planners.seams.seam_motion import first_within_limits
from optiplan.planners.task.chains import line_end, of_step
from optiplan.planners.task.planned_steps import PlannedStep, object_and_link
from optiplan.planners.task.rides.ride_path import PEAK_ACCELERATION, PEAK_SPEED, RidePath, RideSection
from optiplan.planners.task.stages import Stage, Stages, WorldState
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.problem.task.rides import LONGEST, Ride, WaitUntil
from optiplan.problem.task.scene_change import carrying, columns, scene_after, scene_during
from optiplan.problem.task.steps import Dwell, Event, Move, StraightLine, TaskStep
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import beside_each_other, cut_trajectory, join_trajectories, standstill
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_FIRST = 0.5, 2.0, 3.0, 12.0
"""m/s, rad/s, m/s² and rad/s² on lines, as they are seen from what moves, that are tried first."""

_SHORTEST = 0.15
"""s of a line at least."""

_SLOWER = (1.0, 1.4, 2.0, 3.0, 4.5)
"""Factors on these times that are tried."""

_LOOK, _ITERATIONS = 0.1, 30
"""s between configurations that are looked at before the way is followed, and steps of the inverse kinematics."""

_OFF, _JUMP = 1e-3, 1.0
"""m and rad by which they may be off the way, and rad or m between two of them."""

_AFTER = 1e-6
"""s by which a wait is longer than until its condition holds: what rounding may take."""


@dataclass(frozen=True, eq=False)
class TimedPart:
    """A part of a motion in time.

    Attributes:
        motion: of all joints, from time 0 on; None where the part takes no time.
        segments: of its steps, from time 0 on.
        after: state at its end; what moves in the scene does so from the beginning of the whole motion.
    """

    motion: Trajectory | None
    segments: tuple[Segment, ...]
    after: WorldState

    @property
    def duration(self) -> float:
        """S."""
        return 0.0 if self.motion is None else self.motion.duration


@dataclass(frozen=True, eq=False)
class _Row:
    """A step of a ride: how long it takes, s, its fingers, and the line or rest of the tool if it takes time."""

    step: TaskStep
    duration: float
    fingers: Trajectory | None = None
    columns: tuple[int, ...] = ()


@dataclass(eq=False)
class Rider:
    """Does the steps after a meeting, from a state of the whole robot at a time.

    Attributes:
        problem: of the whole task.
        ride: with what the arm goes.
        steps: that follow the move which meets it.
        budget: polled on the way.
        standing: what stands around when it is met.
    """

    problem: Problem
    ride: Ride
    steps: Sequence[TaskStep]
    budget: Budget
    standing: Scene
    _stages: Stages = field(init=False)

    def __post_init__(self) -> None:
        self._stages = Stages(self.problem)

    def go(self, state: WorldState, t: float) -> TimedPart | Failure:
        """Return the motion from a state at time t, s, at which the frame is in place, as quick as limits let it be."""
        if not self.steps:
            return TimedPart(None, (), state)
        failure: Failure | None = None
        for slower in _SLOWER:
            found = self._at_pace(state, t, slower)
            if not isinstance(found, Failure):
                return found
            failure = found
            if found.witness.get("quantity", "position") == "position" or self.budget.over:
                break
        return failure or Failure("no-path", "no pace of the steps was found")

    def _at_pace(self, state: WorldState, t: float, slower: float) -> TimedPart | Failure:
        robot, motion = self.problem.robot, self.ride.mover.motion
        first = self.steps[0]
        begin = motion.pose(t).actInv(frame_pose(carrying(robot, state.scene), state.q, self.ride.frame))
        rows, sections, X, now, q = list[_Row](), list[RideSection](), begin, t, np.array(state.q)
        for step in self.steps:
            found, section = self._row(step, now, q), None
            if isinstance(found, Failure):
                return of_step(found, step, state, robot)
            row, action = found, step.action
            if isinstance(action, StraightLine):
                path = line(X, line_end(action, X))
                row = _Row(step, _time_of(path.length, path.angle, action.speed) * slower)
                section, X = RideSection(path, row.duration), path.end
            elif row.duration > 0.0:
                section = RideSection(line(X, X), row.duration)
            if row.fingers is not None:
                q[list(row.columns)] = row.fingers.end
            rows.append(row)
            sections += [] if section is None else [section]
            now += row.duration
        if not sections:
            return self._in_scenes(state, t, rows, None)
        path_in_time = RidePath(motion, t, sections)
        stage = self._stages.at(WorldState(state.q, self.standing), first, self.ride.joints)
        curve = self._out_of_reach(stage, path_in_time) or self._followed(stage, path_in_time)
        if isinstance(curve, Failure):
            return of_step(curve, self._step_at(rows, curve), state, robot, stage)
        timed = curve.scaled(path_in_time.duration)
        kept = first_within_limits(stage.problem, [timed])
        if not isinstance(kept, Trajectory):
            return of_step(self._too_fast(stage.problem, kept, timed), self._step_when(rows, kept), state, robot, stage)
        return self._in_scenes(state, t, rows, timed)

    def _row(self, step: TaskStep, now: float, q: Array) -> _Row | Failure:
        action = step.action
        if isinstance(action, Dwell):
            return _Row(step, action.seconds)
        if isinstance(action, WaitUntil):
            lasts = until_end(action, now)
            return lasts if isinstance(lasts, Failure) else _Row(step, lasts)
        if isinstance(action, Move):
            own, goal = columns(self.problem.robot, action.joints), action.goal[0]
            assert isinstance(goal, JointGoal)
            limits = self.problem.limits.of_joints(own)
            fingers = stop_at_corners(np.array([q[own], goal.q]), limits, action.joints)
            still = np.abs(q[own] - goal.q).max() <= 0.0
            return _Row(step, 0.0 if still else fingers.duration, None if still else fingers, tuple(own))
        return _Row(step, 0.0)

    def _out_of_reach(self, stage: Stage, path: RidePath) -> Failure | None:
        """Return where no configuration near the one before is on the way, or one touches what stands; None: nowhere.

        It is quick: configurations at some times, not a motion.
        """
        descent, q = Descent(stage.problem.robot, self.ride.frame), stage.problem.start
        for s in np.linspace(0.0, 1.0, 2 + int(path.duration / _LOOK)).tolist():
            X = path.pose(s)
            descent.aim(X)
            now = descent.descend(q, _ITERATIONS)
            position, angle = pose_error(descent.place(now), X)
            mover, t = self.ride.mover, path.begin + s * path.duration
            speed = float(np.linalg.norm(mover.motion.twist(X, t)[:3]))
            there = (
                f"{100.0 * s:.3g} % along the way with '{mover.name}' at {speed:.3g} m/s, at {_words(X.translation)} m"
            )
            place = {"fraction": s, "q": now.tolist()}
            if max(position, angle) > _OFF or np.abs(now - q).max() > _JUMP:
                return Failure("reach", f"the arm cannot go on {there}: its reach or a joint's limit ends", place)
            if stage.model.collides(now):
                contact = stage.model.clearance(now)
                words = "bodies meet" if contact is None else contact.meeting
                return Failure("collision", f"{words} {there}", place)
            q = now
        return None

    def _followed(self, stage: Stage, path: RidePath) -> Trajectory | Failure:
        problem = stage.problem
        failure: Failure | None = None
        for avoidance in LIMIT_AVOIDANCES[: 2 if problem.robot.n > 6 else 1]:
            tracker = Tracker(problem.robot, problem.limits, self.ride.frame, path, Aim(None, avoidance))
            found = follow(stage.model, tracker, problem.start, self.budget)
            if not isinstance(found, Failure):
                return found
            failure = failure or found
        return failure or Failure("no-path", "the way cannot be followed")

    def _too_fast(self, problem: Problem, over: Excess | None, timed: Trajectory) -> Failure:
        name = self.ride.mover.name
        if over is None:
            detail = f"'{name}' moves faster than the arm can: torques pass their limits"
            return Failure("limits", detail, {"q": timed.start.tolist(), "quantity": "torque"})
        joint = problem.robot.joint_names[over.joint]
        reached = (
            f"'{joint}' would reach {over.quantity} {over.value:.4g} {problem.robot.unit(over.quantity, over.joint)}"
        )
        detail = f"'{name}' moves faster than the arm can go with it: {reached}, beyond its limit {over.limit:.4g}"
        return Failure("limits", detail, {"q": timed(over.t).tolist(), "joint": joint, "quantity": over.quantity})

    def _step_when(self, rows: Sequence[_Row], over: Excess | None) -> TaskStep:
        return self._at(rows, 0.0 if over is None else over.t)

    def _step_at(self, rows: Sequence[_Row], failure: Failure) -> TaskStep:
        total = sum(row.duration for row in rows)
        return self._at(rows, float(failure.witness.get("fraction", 0.0)) * total)

    def _at(self, rows: Sequence[_Row], t: float) -> TaskStep:
        for row in rows:
            if row.duration > 0.0 and t <= row.duration:
                return row.step
            t -= row.duration
        return rows[-1].step

    def _in_scenes(
        self, state: WorldState, t: float, rows: Sequence[_Row], arm: Trajectory | None
    ) -> TimedPart | Failure:
        """Return the steps of all joints, each free in the scene that there is by then."""
        robot, since = self.problem.robot, 0.0
        parts, segments = list[Trajectory](), list[Segment]()
        for row in rows:
            before, end, step = state, since + row.duration, row.step
            if row.duration > 0.0 and arm is not None:
                motion = self._whole(before.q, cut_trajectory(arm, since, min(end, arm.duration)), row)
                touch = free_in_time(self.problem, before.scene, step, motion, t + since, self.budget)
                if touch is not None:
                    return of_step(touch, step, before, robot)
                parts.append(motion)
                state = WorldState(motion.end, before.scene)
            if isinstance(step.action, Event):
                state = WorldState(state.q, scene_after(state.scene, step.action, robot, state.q, t + since))
            held = object_and_link(PlannedStep(step, before, state))
            segments.append(Segment(step.number, step.kind, step.name, since, end, *held))
            since = end
        return TimedPart(join_trajectories(parts) if parts else None, tuple(segments), state)

    def _whole(self, q: Array, arm: Trajectory, row: _Row) -> Trajectory:
        """Return the motion of all joints: arm and fingers move, the others stand where they are in q (n,)."""
        robot = self.problem.robot
        own = columns(robot, self.ride.joints)
        moving = [(own, arm)]
        if row.fingers is not None:
            moving.append((list(row.columns), row.fingers.scaled(arm.duration)))
        rest = [k for k in range(robot.n) if not any(k in places for places, _ in moving)]
        if rest:
            names = tuple(robot.joint_names[k] for k in rest)
            moving.append((rest, standstill(names, q[rest], arm.duration)))
        return beside_each_other(moving, robot.joint_names)


def until_end(action: WaitUntil, t: float) -> float | Failure:
    """Return how long is waited from time t, s, on: 0 where the condition holds; else why there is no end of it."""
    until = action.first(t)
    if until is None:
        detail = f"'{action.words}' does not hold at {t:.4g} s, when the arm is there, nor within {LONGEST:g} s after"
        return Failure("no-path", detail, {"t": t})
    return 0.0 if until <= t else until - t + _AFTER


def free_in_time(
    problem: Problem, scene: Scene, step: TaskStep, motion: Trajectory, t: float, budget: Budget
) -> Failure | None:
    """Return how a motion of all joints that begins at time t, s, touches something; None where it does not."""
    robot: Robot = carrying(problem.robot, scene)
    now = scene_during(scene.later(t), step).ending_at(motion.start, motion.end)
    own = derived(problem, robot=robot, scene=now)
    model = planning_model(own.robot, own.scene, error=own.tracking_error)
    touch = first_contact(model, motion, lambda: budget.over)
    if touch is None:
        return None
    if budget.over:
        return out_of_time(budget, "checking a motion among what moves")
    return Failure("collision", touch.words, touch.witness())


def _words(p: Array) -> str:
    return f"[{', '.join(f'{x:.4f}' for x in p)}]"


def _time_of(length: float, angle: float, speed: float) -> float:
    """Return how long a line takes, s, that goes no faster than is asked and than is tried first."""
    fastest = min(_FIRST[0], speed)
    steady = max(PEAK_SPEED * length / fastest, PEAK_SPEED * angle / _FIRST[1])
    gained = max(PEAK_ACCELERATION * length / _FIRST[2], PEAK_ACCELERATION * angle / _FIRST[3]) ** 0.5
    return float(max(steady * (1.0 + 1e-9), gained, _SHORTEST))
